"""Flight: the turn limit, a naive twin of the closed form, fuel that always lasts to the base."""

from __future__ import annotations

import math

import pytest
import shapely
from hypothesis import example, given, settings
from hypothesis import strategies as st

from swarmbid.errors import InputError
from swarmbid.rng import stream
from swarmbid.world import vehicle as flight
from swarmbid.world.area import Area, length_of
from swarmbid.world.sensor import Sensor
from swarmbid.world.vehicle import Vehicle, VehicleState

OPEN = Area.square(2000.0)
HOLED = Area.square(2000.0, [((600.0, 300.0), (1400.0, 300.0), (1400.0, 1700.0), (600.0, 1700.0))])
BENT = Area(((0.0, 0.0), (2000.0, 0.0), (2000.0, 2000.0), (1700.0, 2000.0), (1700.0, 200.0), (0.0, 200.0)))
AREAS = (OPEN, HOLED, BENT)

SWING = 4.0
"""Turning radii of a way home that may lie outside: in by two, and out again."""

finite = st.floats(-300.0, 300.0)
angles = st.floats(-math.pi, math.pi)
radii = st.sampled_from([0.0, 10.0, 40.0, 90.0])


def uav(**fields) -> Vehicle:
    return Vehicle(
        **{"id": "u", "position": (50.0, 50.0, 100.0), "sensor": Sensor(), "speed": 15.0, **fields}
    )


def naive(
    state: VehicleState, goal: tuple[float, float], radius: float, metres: float
) -> tuple[float, float]:
    """Fly the same rule in steps of a millimetre: turn towards the goal unless it is in the turning circle.

    Each step is the chord of its arc, so that the centre of the turn stays where it is.
    """
    x, y, heading, step = state.x, state.y, state.heading, 1e-3
    for _ in range(round(metres / step)):
        dx, dy = goal[0] - x, goal[1] - y
        off = (math.atan2(dy, dx) - heading + math.pi) % (2.0 * math.pi) - math.pi
        side = 1.0 if off >= 0.0 else -1.0
        centre = (x - side * radius * math.sin(heading), y + side * radius * math.cos(heading))
        turn = side * min(abs(off), step / radius) if math.dist(centre, goal) >= radius - 1e-4 else 0.0
        x += step * math.cos(heading + turn / 2.0)
        y += step * math.sin(heading + turn / 2.0)
        heading += turn
    return x, y


@pytest.mark.parametrize(
    ("goal", "heading"),
    [
        ((200.0, 60.0), 0.0),  # ahead
        ((-150.0, -80.0), 0.5),  # behind, to the right
        ((10.0, 30.0), 0.0),  # inside the left turning circle
        ((-10.0, -30.0), 2.0),
        ((0.0, -100.0), 1.0),
    ],
)
def test_the_closed_form_flies_as_small_steps_do(goal, heading):
    fixed_wing = uav(turn_radius=40.0)
    begin = VehicleState(0.0, 0.0, heading)
    whole = VehicleState(0.0, 0.0, heading)
    flight.advance(fixed_wing, whole, goal, 30.0)  # passes the goal by far: only its length counts below
    for seconds in (2.0, 5.0, 9.0):
        state = VehicleState(0.0, 0.0, heading)
        flight.advance(fixed_wing, state, goal, seconds)
        if math.dist((state.x, state.y), goal) < 1.0:
            break
        expected = naive(begin, goal, 40.0, seconds * fixed_wing.speed)
        assert math.dist((state.x, state.y), expected) < 0.1


@given(x=finite, y=finite, heading=angles, radius=radii, steps=st.integers(1, 40))
def test_many_steps_end_where_one_does(x, y, heading, radius, steps):
    vehicle = uav(turn_radius=radius)
    once, often = VehicleState(0.0, 0.0, heading), VehicleState(0.0, 0.0, heading)
    flight._fly(vehicle, once, (x, y), float(steps))
    for _ in range(steps):
        if (often.x, often.y) != (x, y):
            flight._fly(vehicle, often, (x, y), 1.0)
    assert math.dist((once.x, once.y), (often.x, often.y)) < 1e-3
    assert abs(once.flown - often.flown) < 1e-3


@given(x=finite, y=finite, heading=angles, radius=radii, seconds=st.floats(0.01, 5.0))
def test_speed_and_turn_rate_are_never_exceeded(x, y, heading, radius, seconds):
    vehicle = uav(turn_radius=radius)
    state = VehicleState(0.0, 0.0, heading)
    for _ in range(30):
        before = (state.x, state.y, state.heading)
        flight.advance(vehicle, state, (x, y), seconds)
        assert math.dist(before[:2], (state.x, state.y)) <= 15.0 * seconds + 1e-4
        turned = abs((state.heading - before[2] + math.pi) % (2.0 * math.pi) - math.pi)
        assert radius == 0.0 or turned <= 15.0 * seconds / radius + 1e-4
        assert -math.pi <= state.heading <= math.pi
    assert state.airborne == pytest.approx(30 * seconds)
    assert state.flown <= 15.0 * state.airborne + 1e-6


@given(x=finite, y=finite, heading=angles, radius=st.floats(1.0, 100.0))
@example(x=1e-3, y=0.0, heading=math.pi, radius=50.0)
def test_turning_costs_a_full_circle_at_most(x, y, heading, radius):
    vehicle = uav(turn_radius=radius)
    state = VehicleState(0.0, 0.0, heading)
    left = flight._fly(vehicle, state, (x, y), 1e4)
    assert (state.x, state.y) == (x, y) and left > 0.0
    assert state.flown <= math.hypot(x, y) + flight.TURN * radius + 1e-9
    assert state.airborne == pytest.approx(state.flown / vehicle.speed)


def test_turning_can_cost_nearly_a_full_circle():
    """The bound is no larger than it must be: 2 pi radii for a place just behind."""
    state = VehicleState(0.0, 0.0)
    flight._fly(uav(turn_radius=50.0), state, (-1e-3, 0.0), 1e4)
    assert state.flown > 2.0 * math.pi * 50.0 - 0.1 > (flight.TURN - 0.03) * 50.0


@pytest.mark.parametrize("radius", [0.0, 40.0])
def test_it_stays_with_a_goal_it_has_reached(radius):
    vehicle = uav(turn_radius=radius)
    state = VehicleState(0.0, 0.0)
    flight.advance(vehicle, state, (300.0, 100.0), 60.0)
    for _ in range(200):
        flight.advance(vehicle, state, (300.0, 100.0), 1.3)
        assert math.dist((state.x, state.y), (300.0, 100.0)) <= 2.0 * radius + 1e-6


@pytest.mark.parametrize("radius", [0.0, 40.0])
def test_without_a_goal_it_hovers_or_circles(radius):
    vehicle = uav(turn_radius=radius)
    state = VehicleState(10.0, 20.0, 1.0)
    flight.advance(vehicle, state, None, 2.0 * math.pi * 40.0 / 15.0)
    assert (state.x, state.y) == pytest.approx((10.0, 20.0))
    assert state.airborne == pytest.approx(2.0 * math.pi * 40.0 / 15.0)
    assert state.flown == pytest.approx(2.0 * math.pi * radius)


@settings(max_examples=150, deadline=None)
@given(
    area=st.sampled_from(AREAS),
    radius=radii,
    seed=st.integers(0, 2**32),
    endurance=st.floats(700.0, 1500.0),
    horizon=st.sampled_from([0.5, 1.0, 4.0]),
)
def test_who_obeys_is_home_with_the_reserve(area, radius, seed, endurance, horizon):
    """Random goals, anywhere, until `must_return`: what is left at the base is never below the reserve."""
    rng = stream(seed, "goals")
    vehicle = uav(turn_radius=radius, endurance=endurance, reserve=100.0, base=(50.0, 50.0))
    state = flight.start(vehicle)
    aim = None
    while not flight.must_return(vehicle, state, area, horizon):
        if aim is None or rng.random() < 0.02 * horizon:
            aim = area.nearest((2000.0 * rng.random(), 2000.0 * rng.random()))
        # It flies around zones; only the arcs of a fixed wing's turns swing out.
        goal = area.route((state.x, state.y), aim)[0]
        # No step is longer than the horizon, but some are shorter.
        flight.advance(vehicle, state, goal, horizon * (1.0 - 0.5 * rng.random()))
    assert flight.remaining(vehicle, state) >= vehicle.reserve + flight.time_home(vehicle, state, area)
    bound = flight.time_home(vehicle, state, area)
    begun = state.airborne
    flight.fly_home(vehicle, state, area, 0.0)
    # Nothing of the way home is forbidden, but for going back the last step or coming in from a swing.
    way = shapely.LineString([(state.x, state.y), *state.way])
    assert (
        way.length - way.intersection(area.polygon).length <= SWING * radius + horizon * vehicle.speed + 1e-3
    )
    while not flight.fly_home(vehicle, state, area, horizon):
        assert flight.must_return(vehicle, state, area, horizon)
        assert flight.time_home(vehicle, state, area) <= bound - (state.airborne - begun) + (
            flight.TURN * radius / vehicle.speed + 1e-6
        )
    assert flight.at_base(vehicle, state)
    assert state.airborne - begun <= bound + 1e-6
    assert flight.remaining(vehicle, state) >= vehicle.reserve


def test_it_stays_out_nearly_as_long_as_it_may():
    """Obeying costs a few seconds of searching, not minutes."""
    vehicle = uav(endurance=600.0, reserve=60.0, base=(50.0, 50.0))
    state = flight.start(vehicle)
    while not flight.must_return(vehicle, state, OPEN):
        flight.advance(vehicle, state, (1900.0, 1900.0), 1.0)
    while not flight.fly_home(vehicle, state, OPEN, 1.0):
        pass
    assert 0.0 <= flight.remaining(vehicle, state) - vehicle.reserve <= 3.0


@pytest.mark.parametrize("goal", [(1900.0, 1000.0), (1450.0, 900.0), (1900.0, 1900.0)])
def test_the_way_home_keeps_out_of_exclusion_zones(goal):
    vehicle = uav(base=(50.0, 1000.0))
    state = VehicleState(*goal)
    home = length_of((goal, *HOLED.route(goal, (50.0, 1000.0)))) / 15.0
    assert flight.time_home(vehicle, state, HOLED) == pytest.approx(home)
    last = goal
    while not flight.fly_home(vehicle, state, HOLED, 1.0):
        assert HOLED.inside((state.x, state.y)) and math.dist(last, (state.x, state.y)) <= 15.0 + 1e-9
        last = (state.x, state.y)
    assert state.airborne == pytest.approx(home)


def test_another_order_ends_the_way_home():
    vehicle = uav(base=(50.0, 50.0), endurance=500.0)
    state = VehicleState(1000.0, 1000.0)
    flight.fly_home(vehicle, state, OPEN, 1.0)
    assert flight.must_return(vehicle, state, OPEN)
    flight.advance(vehicle, state, (1000.0, 1000.0), 1.0)
    assert not flight.must_return(vehicle, state, OPEN)


def test_a_full_tank_takes_the_turnaround():
    vehicle = uav(base=(50.0, 50.0), endurance=500.0, turnaround=90.0)
    state = flight.start(vehicle)
    with pytest.raises(ValueError, match="not at its base"):
        flight.land(vehicle, VehicleState(500.0, 50.0), 0.0)
    flight.advance(vehicle, state, (300.0, 50.0), 30.0)
    while not flight.fly_home(vehicle, state, OPEN, 1.0):
        pass
    flight.land(vehicle, state, 200.0)
    used = state.airborne
    flight.advance(vehicle, state, (900.0, 900.0), 10.0)
    assert (state.x, state.y, state.airborne) == (50.0, 50.0, used)
    assert not flight.must_return(vehicle, state, OPEN)
    assert not flight.take_off(vehicle, state, 289.9)
    assert flight.take_off(vehicle, state, 290.0)
    assert state.airborne == 0.0 and flight.remaining(vehicle, state) == 500.0
    assert state.flown == pytest.approx(500.0)


def test_without_a_base_the_fuel_still_ends():
    vehicle = uav(endurance=100.0, reserve=10.0)
    state = flight.start(vehicle)
    flight.advance(vehicle, state, None, 88.0)
    assert not flight.must_return(vehicle, state, OPEN)
    flight.advance(vehicle, state, None, 1.0)
    assert flight.must_return(vehicle, state, OPEN)
    with pytest.raises(ValueError, match="no base"):
        flight.fly_home(vehicle, state, OPEN, 1.0)


def test_all_faults_are_told_at_once():
    with pytest.raises(InputError) as caught:
        uav(id="-", speed=0.0, turn_radius=-1.0, endurance=50.0, reserve=50.0, base=(1.0,), sensor=None)
    named = {fault.field for fault in caught.value.faults}
    assert named == {"id", "speed", "turn_radius", "reserve", "base", "sensor"}
    with pytest.raises(InputError, match="height"):
        uav(position=(0.0, 0.0, 0.0))


def test_the_agent_is_the_vehicle_on_the_ground():
    vehicle = uav(endurance=500.0, equipment=["camera"], base=(1.0, 2.0), fuel_per_metre=0.5)
    agent = vehicle.agent()
    assert (agent.id, agent.speed, agent.endurance, agent.fuel_per_metre) == ("u", 15.0, 500.0, 0.5)
    assert agent.position == (50.0, 50.0, 0.0) and agent.base == (1.0, 2.0, 0.0)
    assert agent.equipment == frozenset({"camera"})
