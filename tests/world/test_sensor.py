"""The sensor: probabilities by hand, frequencies within three standard errors, sweep width."""

from __future__ import annotations

import math

import numpy as np
import pytest

from swarmbid.errors import InputError
from swarmbid.rng import stream
from swarmbid.world.sensor import FALL_OFFS, Sensor


def test_probabilities_by_hand():
    """At 100 m and 45 degrees the edge is at 100 m, where the slant is sqrt(2) times the height."""
    off = np.array([[0.0, 50.0], [100.0, 100.1]])
    definite = Sensor(detection=0.8).probability(off, 100.0)
    assert definite.tolist() == [[0.8, 0.8], [0.0, 0.0]] or definite.tolist() == [[0.8, 0.8], [0.8, 0.0]]
    linear = Sensor(detection=0.8, fall_off="linear").probability(off, 100.0)
    assert linear == pytest.approx(np.array([[0.8, 0.4], [0.0, 0.0]]), abs=1e-12)
    cube = Sensor(detection=0.8, fall_off="inverse_cube").probability([0.0, 75.0], 100.0)
    # 75 m off: the slant is 1.25 times the height, and 1 - 0.2^(1 / 1.25^3).
    assert cube == pytest.approx([0.8, 1.0 - 0.2 ** (1.0 / 1.25**3)])


@pytest.mark.parametrize("fall_off", FALL_OFFS)
def test_it_falls_off_and_ends_at_the_radius(fall_off):
    sensor = Sensor(half_angle=0.6, detection=0.7, fall_off=fall_off)
    radius = sensor.radius(80.0)
    assert radius == pytest.approx(80.0 * math.tan(0.6))
    chance = sensor.probability(np.linspace(0.0, 1.5 * radius, 301), 80.0)
    assert chance[0] == pytest.approx(0.7)
    assert np.all(np.diff(chance) <= 1e-15) and np.all(chance[201:] == 0.0) and np.all(chance[:199] > 0.0)


@pytest.mark.parametrize("fall_off", FALL_OFFS)
def test_it_detects_as_often_as_it_should(fall_off):
    """n looks at targets 60 m off: the share of hits has the standard error sqrt(p (1 - p) / n)."""
    sensor = Sensor(detection=0.7, fall_off=fall_off, sigma=3.0)
    n = 20_000
    around = 2.0 * math.pi * np.arange(n) / n
    targets = np.stack((500.0 + 60.0 * np.cos(around), 60.0 * np.sin(around)), axis=1)
    seen = sensor.glimpse(stream(1, "look", fall_off), 500.0, 0.0, 100.0, targets)
    p = float(sensor.probability(60.0, 100.0))
    assert abs(len(seen.rows) / n - p) <= 3.0 * math.sqrt(p * (1.0 - p) / n)
    noise = (seen.measured - targets[seen.rows]).ravel()
    assert abs(noise.mean()) <= 3.0 * 3.0 / math.sqrt(len(noise))
    # The standard error of a standard deviation is sigma / sqrt(2 n).
    assert abs(noise.std() - 3.0) <= 3.0 * 3.0 / math.sqrt(2.0 * len(noise))


def test_what_is_out_of_sight_is_not_seen():
    sensor = Sensor(detection=1.0, sigma=0.0)
    targets = np.array([[0.0, 101.0], [0.0, 99.0], [-300.0, 0.0], [70.0, -70.0]])
    seen = sensor.glimpse(stream(1, "look"), 0.0, 0.0, 100.0, targets)
    assert seen.rows.tolist() == [1, 3] and seen.measured.tolist() == targets[[1, 3]].tolist()
    assert seen.false_alarms.shape == (0, 2)
    none = sensor.glimpse(stream(1, "look"), 0.0, 0.0, 100.0, np.empty((0, 2)))
    assert none.rows.shape == (0,) and none.places().shape == (0, 2)


def test_false_alarms_are_poisson_and_even():
    """Counts have mean and variance of the rate; a disc of half the radius holds a quarter of them."""
    sensor = Sensor(false_alarm_rate=0.5)
    rng = stream(3, "look")
    looks = [sensor.glimpse(rng, 10.0, 20.0, 100.0, np.empty((0, 2))) for _ in range(20_000)]
    counts = np.array([len(look.false_alarms) for look in looks])
    assert abs(counts.mean() - 0.5) <= 3.0 * math.sqrt(0.5 / len(looks))
    # Var of the sample variance of a Poisson count: (rate + 2 rate^2) / n.
    assert abs(counts.var() - 0.5) <= 3.0 * math.sqrt((0.5 + 2.0 * 0.25) / len(looks))
    off = np.concatenate([look.false_alarms for look in looks]) - (10.0, 20.0)
    away = np.hypot(off[:, 0], off[:, 1])
    assert away.max() <= sensor.radius(100.0)
    assert abs(np.mean(away < 50.0) - 0.25) <= 3.0 * math.sqrt(0.25 * 0.75 / len(away))
    assert np.all(np.abs(off.mean(axis=0)) <= 3.0 * 50.0 / math.sqrt(len(off)))


def test_places_are_hits_and_false_alarms_alike():
    sensor = Sensor(detection=1.0, false_alarm_rate=4.0)
    seen = sensor.glimpse(
        stream(4, "look"), 0.0, 0.0, 100.0, np.array([[3.0, 4.0], [900.0, 0.0], [5.0, 6.0]])
    )
    assert len(seen.false_alarms) > 0
    assert seen.places().tolist() == [[3.0, 4.0], [5.0, 6.0], *seen.false_alarms.tolist()]


def test_sweep_width_of_a_definite_range_is_its_diameter():
    """Glimpses so close that none slips through between two of them, but near the very edge."""
    assert Sensor(detection=1.0).sweep_width(100.0, 1.0) == pytest.approx(200.0, rel=1e-3)


@pytest.mark.parametrize("fall_off", FALL_OFFS)
@pytest.mark.parametrize("speed", [20.0, 150.0])
def test_sweep_width_agrees_with_flying_past(fall_off, speed):
    """Targets spread over a band of width B beside one pass: B times the share that is found is W."""
    sensor = Sensor(detection=0.6, fall_off=fall_off, period=1.0)
    rng = stream(5, "pass", fall_off)
    n, band = 20_000, 240.0
    targets = np.stack((speed * rng.random(n), band * (rng.random(n) - 0.5)), axis=1)
    found = np.zeros(n, dtype=bool)
    reach = math.ceil(100.0 / speed) + 1
    for k in range(-reach, reach + 1):
        found[sensor.glimpse(rng, k * speed, 0.0, 100.0, targets).rows] = True
    share = sensor.sweep_width(100.0, speed) / band
    assert abs(found.mean() - share) <= 3.0 * math.sqrt(share * (1.0 - share) / n) + 1e-3


def test_same_stream_same_report():
    targets = np.array([[10.0, 0.0], [0.0, 20.0], [900.0, 0.0]])
    sensor = Sensor(false_alarm_rate=2.0)
    one, two = (sensor.glimpse(stream(9, "look"), 0.0, 0.0, 100.0, targets) for _ in range(2))
    assert one.places().tobytes() == two.places().tobytes() and one.rows.tolist() == two.rows.tolist()


def test_all_faults_are_told_at_once():
    with pytest.raises(InputError) as caught:
        Sensor(half_angle=0.0, detection=1.5, fall_off="cubic", period=0.0, false_alarm_rate=-1.0, sigma=-1.0)
    named = {fault.field for fault in caught.value.faults}
    assert named == {"half_angle", "detection", "fall_off", "period", "false_alarm_rate", "sigma"}
    with pytest.raises(InputError, match="does not fall off"):
        Sensor(detection=1.0, fall_off="inverse_cube")
