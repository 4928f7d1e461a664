"""Search theory: what a random search and a lawn-mower find is what the formulas say."""

from __future__ import annotations

import math

import numpy as np
import pytest

from swarmbid.rng import stream
from swarmbid.world import vehicle as flight
from swarmbid.world.area import Area, length_of
from swarmbid.world.patterns import parallel_sweep
from swarmbid.world.sensor import FALL_OFFS, Sensor
from swarmbid.world.vehicle import Vehicle, VehicleState

ALTITUDE = RADIUS = 50.0
SPEED = 20.0


def searcher(sensor: Sensor) -> Vehicle:
    return Vehicle(id="u", position=(0.0, 0.0, ALTITUDE), sensor=sensor, speed=SPEED)


@pytest.mark.parametrize("fall_off", FALL_OFFS)
def test_random_search_obeys_koopman(fall_off):
    """POD = 1 - exp(-W L / A) (Koopman, Search and Screening, 1946), at W L / A of 1/2 and of 1.

    Each searcher flies legs of exponential length, 10 R on average, over a torus, so that it is everywhere
    equally often. It turns by at most 90 degrees, so that a turn covers little twice: on average
    R^2 (tan(t / 2) - t / 2) of 2 R times 10 R, 0.25 % of the effort. Its course is forgotten after
    10 R / (1 - 2 / pi) = 28 R, during which it never meets itself: a track of n such pieces finds
    x^2 exp(-x) / (2 n) more than one of endlessly many, 0.1 % here. Both are far below three sigma, 1.4 %.
    Searchers are independent, targets of one searcher are not: sigma is that of the mean over searchers.
    """
    side, searchers, num = 4000.0, 30, 400
    sensor = Sensor(detection=0.7, fall_off=fall_off, period=4.0)
    vehicle = searcher(sensor)
    step = sensor.period * SPEED
    width = sensor.sweep_width(ALTITUDE, SPEED)
    looks = round(side * side / width / step)
    shares = np.empty((searchers, 2))
    for row in range(searchers):
        rng = stream(row, "random search", fall_off)
        # Away from the seam, where a look would have to see across.
        targets = rng.uniform(RADIUS, side - RADIUS, (num, 2))
        state = VehicleState(*rng.uniform(0.0, side, 2).tolist(), rng.uniform(-math.pi, math.pi))
        found = np.zeros(num, dtype=bool)
        for look in range(looks):
            if rng.random() < step / (10.0 * RADIUS):
                state.heading += rng.uniform(-math.pi / 2.0, math.pi / 2.0)
            ahead = state.x + 1e3 * math.cos(state.heading), state.y + 1e3 * math.sin(state.heading)
            flight.advance(vehicle, state, ahead, sensor.period)
            found[sensor.glimpse(rng, state.x % side, state.y % side, ALTITUDE, targets).rows] = True
            if look + 1 == looks // 2:
                shares[row, 0] = found.mean()
        shares[row, 1] = found.mean()
        assert state.flown == pytest.approx(looks * step)
    effort = np.array([looks // 2, looks]) * step * width / side**2
    error = shares.std(axis=0, ddof=1) / math.sqrt(searchers)
    assert np.all(error < 0.01)
    assert np.all(np.abs(shares.mean(axis=0) - (1.0 - np.exp(-effort))) <= 3.0 * error)


def swept(sensor: Sensor, spacing: float, num: int) -> float:
    """Fly a lawn-mower over a square; return which share of evenly spread targets is found.

    The ends of the tracks are left out: there the tracks are joined, and a target is seen from one side.
    """
    side = 10.0 * spacing
    area = Area.square(side)
    rng = stream(7, "lawn-mower", sensor.fall_off)
    targets = np.stack((rng.uniform(RADIUS, side - RADIUS, num), rng.uniform(0.0, side, num)), axis=1)
    vehicle, found = searcher(sensor), np.zeros(num, dtype=bool)
    way = parallel_sweep(area, spacing, heading=0.0)
    assert length_of(way) == pytest.approx(10.0 * side + 9.0 * spacing)
    state = VehicleState(*way[0])
    for goal in way:
        while True:
            found[sensor.glimpse(rng, state.x, state.y, ALTITUDE, targets).rows] = True
            if (state.x, state.y) == goal:
                break
            flight.advance(vehicle, state, goal, sensor.period)
    return float(found.mean())


def test_a_sure_lawn_mower_finds_everything():
    """Two looks s apart leave nothing between them out to sqrt(R^2 - s^2 / 4) beside the track."""
    sensor = Sensor(detection=1.0, period=1.0)
    spacing = 2.0 * math.sqrt(RADIUS**2 - (SPEED * sensor.period) ** 2 / 4.0)
    assert swept(sensor, spacing, 3000) == 1.0
    assert swept(sensor, 1.1 * spacing, 3000) < 0.95


@pytest.mark.parametrize("period", [0.5, 4.0])
@pytest.mark.parametrize("fall_off", FALL_OFFS)
def test_an_unsure_lawn_mower_finds_what_one_pass_does(fall_off, period):
    """Tracks 2 R apart do not overlap: the share found is that of one pass on average, W / (2 R)."""
    sensor = Sensor(detection=0.4, fall_off=fall_off, period=period)
    num = 4000
    share = sensor.sweep_width(ALTITUDE, SPEED) / (2.0 * RADIUS)
    # Only where looks fall on a track is not random; that they do not always divide it evenly costs 0.5 %.
    assert (
        abs(swept(sensor, 2.0 * RADIUS, num) - share) <= 3.0 * math.sqrt(share * (1.0 - share) / num) + 0.005
    )


def test_one_look_each_finds_the_detection_probability():
    """Looks so far apart that no two overlap: of the targets that are looked at at all, P_d are found."""
    sensor = Sensor(detection=0.4, period=2.0 * RADIUS / SPEED)
    num = 4000
    seen = math.pi / 4.0  # the disc in the square of each look
    found = swept(sensor, 2.0 * RADIUS, num)
    assert abs(found - 0.4 * seen) <= 3.0 * math.sqrt(0.4 * seen * (1.0 - 0.4 * seen) / num) + 0.005
