"""UAVs that fly: turn-rate limits, fuel, and a way home that is always affordable.

A fixed-wing UAV turns with its least radius towards a place, then flies straight; a place inside its
turning circle it leaves behind first. That is one arc and one line in closed form (the relaxed Dubins
path, Boissonnat and Bui 1994), so a step of any length costs the same and hits the place exactly.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from swarmbid.checks import Checker
from swarmbid.model import Agent
from swarmbid.world.area import Area, Point
from swarmbid.world.sensor import Sensor

TURN = 6.3
"""Turning radii that turning may cost a leg beyond its length. The worst place is right behind the UAV: 2 pi.
With one at the angle t on the rim of the turning circle, just inside it, 2 sin t are flown straight and
2 pi - t on the rim, less the distance 2 sin(t / 2): at most 2 pi, as t goes to 0. The rest is rounding."""
_RIM = 1e-6
"""Share of the turning radius by which a place on the rim of the turning circle may count as on it."""


@dataclass(frozen=True, kw_only=True)
class Vehicle:
    """A UAV as it is built.

    Parameters
    ----------
    id, type, speed, fuel_per_metre, equipment : as for `swarmbid.model.Agent`.
    position : east, north, up in m at the start; it keeps its height.
    turn_radius : m; 0 for a multirotor, which turns on the spot and hovers.
    endurance : s in the air on one tank. reserve : s of it that are never used.
    turnaround : s on the ground to fill up.
    base : east, north in m, where it must return to; None for nowhere.
    radio_range : m.
    """

    id: str
    position: tuple[float, float, float]
    sensor: Sensor
    type: str = "uav"
    speed: float = 15.0
    turn_radius: float = 0.0
    endurance: float = math.inf
    reserve: float = 0.0
    turnaround: float = 0.0
    base: Point | None = None
    radio_range: float = math.inf
    equipment: frozenset[str] = frozenset()
    fuel_per_metre: float = 0.0

    def __post_init__(self) -> None:
        check = Checker("vehicle", self, self.id)
        check.position("position")
        check.name("type")
        check.number("speed", above=0.0)
        check.number("turn_radius", low=0.0)
        fuel = check.number("endurance", above=0.0, infinite=True)
        fuel = check.number("reserve", low=0.0) and fuel
        check.number("turnaround", low=0.0)
        check.number("radio_range", above=0.0, infinite=True)
        check.number("fuel_per_metre", low=0.0)
        check.names("equipment", frozenset)
        if not isinstance(self.sensor, Sensor):
            check.fault("sensor", f"is {self.sensor!r}", "Give a Sensor.")
        if not check.faults and self.position[2] <= 0.0:
            check.fault("position", f"is {self.position}", "Give a height above 0 m, or it sees nothing.")
        if self.base is not None:
            check_point(check, "base")
        if fuel and self.reserve >= self.endurance:
            check.fault(
                "reserve", f"is {self.reserve:g} s of {self.endurance:g} s", "Give less than the endurance."
            )
        check.done()

    def agent(self) -> Agent:
        """Return what the negotiation knows of it; distances count on the ground, so at height 0."""
        return Agent(
            id=self.id,
            type=self.type,
            position=(self.position[0], self.position[1], 0.0),
            speed=self.speed,
            fuel_per_metre=self.fuel_per_metre,
            endurance=self.endurance,
            equipment=self.equipment,
            base=None if self.base is None else (*self.base, 0.0),
        )


def check_point(check: Checker, name: str) -> bool:
    """Check that a field holds two finite numbers and keep it as a tuple of floats."""
    value = getattr(check.owner, name)
    try:
        x, y = (float(part) for part in value)
    except (TypeError, ValueError):
        x = y = math.nan
    if not (math.isfinite(x) and math.isfinite(y)):
        check.fault(name, f"is {value!r}", "Give two finite numbers: east and north.")
        return False
    check.put(name, (x, y))
    return True


@dataclass(slots=True)
class VehicleState:
    """Where a UAV is and what it has used up.

    Parameters
    ----------
    x, y : m. heading : rad from east, counter-clockwise, -pi to pi.
    airborne : s since the tank was full. flown : m in all.
    landed_until : s, when the tank will be full; None in the air.
    homeward : on `way`, and stays on it until it has landed or is sent elsewhere by `advance`.
    way : the way home as of the last look, its first place where the UAV was then.
    slack : s that were left then, beyond the reserve and the way home. seen_at : (airborne, flown) then.
    """

    x: float
    y: float
    heading: float = 0.0
    airborne: float = 0.0
    flown: float = 0.0
    landed_until: float | None = None
    homeward: bool = False
    way: tuple[Point, ...] = field(default=(), repr=False)
    slack: float = field(default=-math.inf, repr=False)
    seen_at: tuple[float, float] = field(default=(0.0, 0.0), repr=False)


def start(vehicle: Vehicle) -> VehicleState:
    """Return a UAV in the air at its first position, heading east, with a full tank."""
    return VehicleState(vehicle.position[0], vehicle.position[1])


def remaining(vehicle: Vehicle, state: VehicleState) -> float:
    """Return the s until the endurance is used up, the reserve included."""
    return vehicle.endurance - state.airborne


def advance(vehicle: Vehicle, state: VehicleState, goal: Point | None, seconds: float) -> None:
    """Fly for a while, towards `goal` if there is one.

    Arrived, or without a goal, a multirotor hovers and a fixed wing circles, never farther than twice its
    turning radius from a goal that it has reached. On the ground nothing happens. The caller keeps goals
    out of exclusion zones (`Area.route`); the arc of a turn may swing out by two turning radii.
    """
    if state.landed_until is not None:
        return
    state.homeward = False
    left = seconds if goal is None else _fly(vehicle, state, goal, seconds)
    if left > 0.0:
        _loiter(vehicle, state, left)


def fly_home(vehicle: Vehicle, state: VehicleState, area: Area, seconds: float) -> bool:
    """Fly towards the base around the exclusion zones; True once it is there, early rather than late.

    The way is chosen once and kept, so that two ways of equal length cannot make it dither.
    """
    if vehicle.base is None:
        raise ValueError(f"vehicle {vehicle.id} has no base to fly to")
    if state.landed_until is not None:
        return True
    if not state.homeward:
        state.way = _way_home(vehicle, state, area)[0]
        state.homeward = True
    while state.way:
        seconds = _fly(vehicle, state, state.way[0], seconds)
        if (state.x, state.y) != state.way[0]:
            return False
        state.way = state.way[1:]
    return True


def time_home(vehicle: Vehicle, state: VehicleState, area: Area) -> float:
    """Return an upper bound of the s to the base, turns and detours included; 0 without a base."""
    if vehicle.base is None or state.landed_until is not None:
        return 0.0
    if state.homeward:
        return _bound(vehicle, state, state.way)
    return _way_home(vehicle, state, area)[1]


def must_return(vehicle: Vehicle, state: VehicleState, area: Area, horizon: float = 1.0) -> bool:
    """Tell whether to call `fly_home` now, so that the reserve stays whole.

    Ask before each step, `horizon` s being the longest until the next. In that time the UAV may use up so
    much fuel, fly as far away, and need one more turn; no more, for it can always go back to where it was
    and take the way home that it knew there. Once homeward the answer stays True until it has landed.
    Without a base it tells that the fuel is used up.
    """
    if state.landed_until is not None or vehicle.endurance == math.inf:
        return False
    if vehicle.base is None:
        return remaining(vehicle, state) <= vehicle.reserve + horizon
    if state.homeward:
        return True
    turn = TURN * vehicle.turn_radius / vehicle.speed
    margin = 2.0 * horizon + turn
    if state.slack > margin and state.way:
        # Far from the limit the way home need not be looked for in each step.
        spent = state.airborne - state.seen_at[0]
        moved = math.dist((state.x, state.y), state.way[0])
        honest = spent >= 0.0 and moved <= state.flown - state.seen_at[1] + 1e-6
        # Corners that lie between by now may each cost a turn.
        if honest and state.slack - 2.0 * spent > max(2.0 * margin + 2.0 * turn, 0.5 * state.slack):
            return False
    way, seconds = _way_home(vehicle, state, area, horizon * vehicle.speed)
    state.way = ((state.x, state.y), *way)
    state.slack = remaining(vehicle, state) - vehicle.reserve - seconds
    state.seen_at = (state.airborne, state.flown)
    return state.slack <= margin


def at_base(vehicle: Vehicle, state: VehicleState) -> bool:
    """Tell whether it is near enough to land: a fixed wing circles by two turning radii."""
    return (
        vehicle.base is not None
        and math.dist((state.x, state.y), vehicle.base) <= 2.0 * vehicle.turn_radius + 1.0
    )


def land(vehicle: Vehicle, state: VehicleState, now: float) -> None:
    """Land at the base at time `now` s; ValueError anywhere else."""
    if vehicle.base is None or not at_base(vehicle, state):
        raise ValueError(f"vehicle {vehicle.id} is not at its base, but at ({state.x:g}, {state.y:g})")
    state.x, state.y = vehicle.base
    state.landed_until = now + vehicle.turnaround
    state.homeward = False
    state.way, state.slack = (), -math.inf


def take_off(vehicle: Vehicle, state: VehicleState, now: float) -> bool:
    """Take off with a full tank once the turnaround is over; return whether it is in the air."""
    if state.landed_until is None:
        return True
    if now < state.landed_until:
        return False
    state.landed_until = None
    state.airborne = 0.0
    return True


def _way_home(
    vehicle: Vehicle, state: VehicleState, area: Area, back: float = 0.0
) -> tuple[tuple[Point, ...], float]:
    """Return the places on the way to the base, and the bound of its s.

    Parameters
    ----------
    back : m, how far the UAV may go back the way it came, be it through the zone that a turn swung into.
    """
    assert vehicle.base is not None
    here = (state.x, state.y)
    # A turn may have swung out of the area; the way home leads back in, not along outside.
    inside = area.nearest(here)
    best = area.route(inside, vehicle.base)
    if inside != here:
        best = (inside, *best)
    seconds = _bound(vehicle, state, best)
    if state.way and state.way[-1] == vehicle.base:
        known = _bound(vehicle, state, state.way)
        last = state.way[0]
        # Far from the limit the last look is long ago, and what lies between may be a no-fly zone.
        if known < seconds and (math.dist(here, last) <= back or area.clear(inside, last)):
            return state.way, known
    return best, seconds


def _bound(vehicle: Vehicle, state: VehicleState, way: tuple[Point, ...]) -> float:
    metres, last = 0.0, (state.x, state.y)
    for place in way:
        leg = math.dist(last, place)
        if leg > 0.0:
            metres += leg + TURN * vehicle.turn_radius
        last = place
    return metres / vehicle.speed


def _fly(vehicle: Vehicle, state: VehicleState, goal: Point, seconds: float) -> float:
    """Fly towards a place for at most so many s; return the s left over when it is there."""
    dx, dy = goal[0] - state.x, goal[1] - state.y
    away = math.hypot(dx, dy)
    if away == 0.0:
        return seconds
    radius = vehicle.turn_radius
    budget = vehicle.speed * seconds
    if radius == 0.0:
        state.heading = math.atan2(dy, dx)
        ahead, turn, side, line = 0.0, 0.0, 1.0, away
    else:
        ahead, turn, side, line = _path(state.heading, dx, dy, radius)
    total = ahead + turn * radius + line
    state.flown += min(total, budget)
    if total <= budget:
        state.heading = _wrapped(state.heading + side * turn)
        state.x, state.y = goal
        used = total / vehicle.speed
        state.airborne += used
        return max(seconds - used, 0.0)
    state.airborne += seconds
    step = min(ahead, budget)
    _straight(state, step)
    budget -= step
    if budget > 0.0:
        step = min(turn * radius, budget)
        if step > 0.0:
            _arc(state, side, radius, step)
        _straight(state, budget - step)
    return 0.0


def _path(heading: float, dx: float, dy: float, radius: float) -> tuple[float, float, float, float]:
    """Return (m straight ahead, rad of turn, its side, m of line) to a place so far east and north."""
    cos, sin = math.cos(heading), math.sin(heading)
    x, y = dx * cos + dy * sin, dy * cos - dx * sin
    side = 1.0 if y >= 0.0 else -1.0
    y = abs(y)
    ahead = line = 0.0
    off = math.hypot(x, y - radius)
    if off < radius * (1.0 - _RIM):
        # Inside the turning circle: fly on until it lies on the rim, behind.
        rim = math.sqrt(max(radius * radius - (radius - y) * (radius - y), 0.0))
        ahead, x = x + rim, -rim
    else:
        line = math.sqrt(max(off * off - radius * radius, 0.0))
    turn = (math.atan2(y - radius, x) + math.atan2(radius, line)) % (2.0 * math.pi)
    if x > 0.0 and turn > 1.5 * math.pi:
        turn = 0.0  # straight ahead, but for rounding
    return ahead, turn, side, line


def _straight(state: VehicleState, metres: float) -> None:
    state.x += metres * math.cos(state.heading)
    state.y += metres * math.sin(state.heading)


def _arc(state: VehicleState, side: float, radius: float, metres: float) -> None:
    after = state.heading + side * metres / radius
    state.x += side * radius * (math.sin(after) - math.sin(state.heading))
    state.y -= side * radius * (math.cos(after) - math.cos(state.heading))
    state.heading = _wrapped(after)


def _loiter(vehicle: Vehicle, state: VehicleState, seconds: float) -> None:
    state.airborne += seconds
    if vehicle.turn_radius > 0.0:
        metres = vehicle.speed * seconds
        state.flown += metres
        _arc(state, 1.0, vehicle.turn_radius, metres)


def _wrapped(angle: float) -> float:
    return (angle + math.pi) % (2.0 * math.pi) - math.pi
