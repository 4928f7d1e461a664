"""Targets: how each kind moves, edges, and streams that do not disturb each other."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from swarmbid.errors import InputError
from swarmbid.world.area import Area
from swarmbid.world.targets import KINDS, Target, Targets

NOBODY = np.empty((0, 2))
WIDE = Area.square(1e6)
MIDDLE = (5e5, 5e5)
HOLED = Area.square(400.0, [((150.0, 150.0), (250.0, 150.0), (250.0, 250.0), (150.0, 250.0))])


def run(targets, seconds, area=WIDE, threats=NOBODY, step=1.0, seed=1):
    world = Targets(targets, seed)
    for _ in range(round(seconds / step)):
        world.advance(step, area, threats)
    return world


def target(id, kind="static", position=MIDDLE, **fields):
    return Target(id=id, kind=kind, position=position, **fields)


def test_static_ones_rest_and_constant_ones_go_straight():
    world = run(
        [
            target("s", position=(5.0, 6.0)),
            target("c", "constant_velocity", (10.0, 20.0), velocity=(2.0, -0.5)),
        ],
        8.0,
    )
    assert world.xy.tolist() == [[5.0, 6.0], [26.0, 16.0]]
    assert world.velocities.tolist() == [[0.0, 0.0], [2.0, -0.5]]


def test_a_random_walk_spreads_as_it_should():
    """Variance an axis: v^2 T (t - T (1 - exp(-t / T))), T the mean time between turns; standard error of
    a sample variance of n nearly Gaussian numbers: variance sqrt(2 / n), less for flatter tails. Turns wait
    for the end of a step h, which adds (h / T)^2 / 12 of it, 0.1 %."""
    n, v, turn, t = 1500, 3.0, 20.0, 300.0
    walkers = [target(f"w{k}", "random_walk", speed=v, turn_time=turn) for k in range(n)]
    world = run(walkers, t, step=2.5)
    assert np.hypot(*world.velocities.T) == pytest.approx(np.full(n, v))
    off = world.xy - MIDDLE
    variance = v * v * turn * (t - turn * (1.0 - math.exp(-t / turn)))
    assert np.all(np.abs(np.mean(off**2, axis=0) - variance) <= 3.0 * variance * math.sqrt(2.0 / n))
    assert np.all(np.abs(off.mean(axis=0)) <= 3.0 * math.sqrt(variance / n))


def test_drifting_ones_follow_the_current_with_a_leeway_of_their_own():
    drifters = [target("a", "drifting", velocity=(0.1, 0.0)), target("b", "drifting", velocity=(0.0, -0.2))]
    world = Targets([*drifters, target("s")], 1, current=(1.0, -0.5))
    for _ in range(200):
        world.advance(1.0, WIDE)
    off = world.xy - MIDDLE
    assert off == pytest.approx(np.array([[220.0, -100.0], [200.0, -140.0], [0.0, 0.0]]))


def test_evasive_ones_flee_from_the_nearest():
    hare = target("e", "evasive", (100.0, 100.0), velocity=(1.0, 0.0), speed=4.0, alert_distance=50.0)
    calm = run([hare], 1.0, threats=np.array([[151.0, 100.0]]))
    assert calm.xy.tolist() == [[101.0, 100.0]]
    fled = run([hare], 1.0, threats=np.array([[160.0, 100.0], [100.0, 60.0], [70.0, 60.0]]))
    assert fled.xy[0] == pytest.approx([100.0, 104.0])
    # Right below a vehicle no direction is away: it stays its course.
    assert run([hare], 1.0, threats=np.array([[100.0, 100.0]])).xy.tolist() == [[101.0, 100.0]]


def test_a_wall_met_in_flight_does_not_make_it_faster_for_ever():
    area = Area.square(100.0)
    hare = target("e", "evasive", (98.0, 50.0), velocity=(1.0, 0.0), speed=4.0, alert_distance=50.0)
    world = run([hare], 1.0, area, threats=np.array([[70.0, 50.0]]))
    assert world.xy.tolist() == [[98.0, 50.0]]  # 4 m: to the wall and back
    world.advance(1.0, area, NOBODY)
    assert world.xy.tolist() == [[97.0, 50.0]]


def test_without_a_speed_it_takes_that_of_its_velocity():
    """So may a scenario give every moving kind one velocity."""
    movers = [target(kind, kind, velocity=(3.0, 4.0)) for kind in ("random_walk", "evasive")]
    world = run(movers, 2.0, threats=np.array([[MIDDLE[0] - 1.0, MIDDLE[1]]]))
    assert np.hypot(*(world.xy - MIDDLE).T) == pytest.approx([10.0, 10.0])
    slow = target("w", "random_walk", velocity=(3.0, 4.0), speed=0.5)
    assert np.hypot(*run([slow], 2.0).velocities[0]) == pytest.approx(0.5)


def test_edges_turn_them_back():
    area = Area.square(100.0)
    world = run([target("c", "constant_velocity", (95.0, 50.0), velocity=(2.0, 1.0))], 4.0, area)
    assert world.velocities.tolist() == [[-2.0, 1.0]] and world.xy[0, 1] == 54.0
    corner = run([target("c", "constant_velocity", (99.0, 99.0), velocity=(3.0, 3.0))], 1.0, area)
    assert corner.xy.tolist() == [[98.0, 98.0]]  # mirrored at both walls: 102 is 98
    # The current carries on: what drifts piles up at the edge.
    adrift = run([target("d", "drifting", (50.0, 50.0), velocity=(1.0, 0.0))], 200.0, area)
    assert adrift.xy[0, 0] >= 98.0


@settings(max_examples=60, deadline=None)
@given(
    seed=st.integers(0, 2**32),
    kinds=st.lists(st.sampled_from(KINDS[1:]), min_size=1, max_size=6),
    speed=st.floats(0.5, 25.0),
    step=st.sampled_from([0.5, 1.0, 3.0]),
)
def test_nobody_leaves_the_free_area(seed, kinds, speed, step):
    targets = [
        target(
            f"t{k}",
            kind,
            (20.0 + 20.0 * k, 100.0),
            velocity=(speed, -0.3 * speed),
            speed=speed,
            turn_time=9.0,
        )
        for k, kind in enumerate(kinds)
    ]
    world = Targets(targets, seed)
    for k in range(80):
        world.advance(step, HOLED, np.array([[4.0 * k, 90.0]]))
        assert all(HOLED.inside(place) for place in world.xy.tolist())


def test_adding_a_target_never_shifts_another():
    """Nor does their order; the same seed gives the same bytes, another seed others."""
    some = [target(f"t{k}", kind, velocity=(1.0, 0.0), speed=1.0) for k, kind in enumerate(KINDS[1:])]
    more = [target("new", "random_walk", speed=9.0), *reversed(some), target("d", "drifting")]
    alone, together = run(some, 300.0), run(more, 300.0)
    assert alone.xy.tobytes() == together.xy[1:-1][::-1].tobytes()
    assert alone.xy.tobytes() == run(some, 300.0).xy.tobytes()
    other = run(some, 300.0, seed=2).xy
    assert (alone.xy != other).any(axis=1).tolist() == [False, True, False, False]


def test_faults_are_told_at_once():
    with pytest.raises(InputError) as caught:
        target("", "lazy", (0.0, math.nan), velocity=(1.0,), value=0.0, duration=-1.0, turn_time=0.0)
    named = {fault.field for fault in caught.value.faults}
    assert named == {"id", "kind", "position", "velocity", "value", "duration", "turn_time"}
    with pytest.raises(InputError, match="static"):
        target("a", velocity=(1.0, 0.0))
    with pytest.raises(InputError, match="used twice"):
        Targets([target("a"), target("a")], 1)
    with pytest.raises(InputError, match="current"):
        Targets([], 1, current=(1.0, math.inf))
