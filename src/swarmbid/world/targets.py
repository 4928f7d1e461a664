"""What is searched for: targets that rest, go straight, wander, flee or drift.

Every target draws from a stream of its own, so that one more target moves no other.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from swarmbid.arrays import FloatArray
from swarmbid.checks import Checker
from swarmbid.errors import Fault, InputError
from swarmbid.rng import stream
from swarmbid.world.area import TOUCH, Area, Point, is_point

KINDS = ("static", "constant_velocity", "random_walk", "evasive", "drifting")
MOST_BOUNCES = 16


@dataclass(frozen=True, kw_only=True)
class Target:
    """One target, and the task that it will be when it is found.

    Parameters
    ----------
    id, type : as for `swarmbid.model.Task`.
    position : east and north, m, at the start.
    kind : how it moves. "static": not. "constant_velocity": with `velocity`. "random_walk": with `speed`,
        on a new course after times that are exponential with mean `turn_time`. "evasive": with `speed`
        away from the nearest vehicle within `alert_distance`, else with `velocity`. "drifting": with the
        current that all share, and `velocity` as its own leeway.
    velocity : m/s, east and north.
    speed : m/s; None for that of `velocity`. turn_time : s. alert_distance : m.
    value : score for serving it. duration : s of service.
    agents_required, equipment : what serving it takes, as for `swarmbid.model.Task`.
    """

    id: str
    position: Point
    kind: str = "static"
    type: str = "target"
    velocity: Point = (0.0, 0.0)
    speed: float | None = None
    turn_time: float = 60.0
    alert_distance: float = 300.0
    value: float = 1.0
    duration: float = 0.0
    agents_required: int = 1
    equipment: frozenset[str] = frozenset()

    def __post_init__(self) -> None:
        check = Checker("target", self, self.id)
        check.name("type")
        if self.kind not in KINDS:
            check.fault("kind", f"is {self.kind!r}", f"Use one of {', '.join(KINDS)}.")
        for name, unit in (("position", "m"), ("velocity", "m/s")):
            value = getattr(self, name)
            if is_point(value):
                check.put(name, (float(value[0]), float(value[1])))
            else:
                check.fault(name, f"is {value!r}", f"Give two finite numbers: east, north in {unit}.")
        if self.speed is not None:
            check.number("speed", low=0.0)
        if self.kind == "static" and not check.faults and self.velocity != (0.0, 0.0):
            check.fault("velocity", f"is {self.velocity}, of a static target", "Leave it out.")
        check.number("turn_time", above=0.0)
        check.number("alert_distance", low=0.0)
        check.number("value", above=0.0)
        check.number("duration", low=0.0)
        check.count("agents_required", "Give 1 or more, or 0 for as many as its equipment takes.", low=0)
        check.names("equipment", frozenset)
        check.done()

    @property
    def pace(self) -> float:
        """Return the m/s of its own that it wanders or flees with."""
        return math.hypot(*self.velocity) if self.speed is None else self.speed


class Targets:
    """Where all targets are, step by step.

    Parameters
    ----------
    targets : in any order; rows follow it.
    seed : of one stream for each target that wanders, so that one more target shifts no other.
    current : m/s, east and north, that all drifting targets share.

    Attributes
    ----------
    xy, velocities : float64[num, 2], m and m/s, now. now : s.
    """

    def __init__(
        self,
        targets: Iterable[Target],
        seed: int,
        current: Point = (0.0, 0.0),
    ) -> None:
        self.targets = tuple(targets)
        ids = [target.id for target in self.targets]
        if len(set(ids)) < len(ids):
            twice = next(name for row, name in enumerate(ids) if name in ids[:row])
            raise InputError([Fault("targets", "id", f"{twice!r} is used twice", "Give each its own.")])
        if not is_point(current):
            raise InputError(
                [Fault("targets", "current", f"is {current!r}", "Give two finite numbers in m/s.")]
            )
        self.now = 0.0
        self.xy = np.array([one.position for one in self.targets], dtype=float).reshape(-1, 2)
        self.velocities = np.zeros_like(self.xy)
        self._own = np.array([one.velocity for one in self.targets], dtype=float).reshape(-1, 2)
        self._speed = np.array([one.pace for one in self.targets], dtype=float)
        self._alert = np.array([one.alert_distance for one in self.targets], dtype=float)
        kinds = np.array([one.kind for one in self.targets], dtype=object)
        self._evasive = np.flatnonzero(kinds == "evasive")
        self._drifting = np.flatnonzero(kinds == "drifting")
        self._moving = kinds != "static"
        self._own[self._drifting] += current
        straight = (kinds == "constant_velocity") | (kinds == "evasive") | (kinds == "drifting")
        self.velocities[straight] = self._own[straight]
        self._turn_at = np.full(len(self.targets), math.inf)
        self._rngs: dict[int, np.random.Generator] = {}
        for row in np.flatnonzero(kinds == "random_walk").tolist():
            self._rngs[row] = stream(seed, "target", ids[row])
            self._turn_at[row] = 0.0
            self._turn(row)

    def advance(self, seconds: float, area: Area, threats: FloatArray | None = None) -> None:
        """Let time pass. Who meets the boundary or a zone bounces off it.

        A course changes with the step after the turn was due. Zones thinner than a step may be jumped.

        Parameters
        ----------
        threats : float64[num, 2], m, where vehicles are that targets may flee from.
        """
        for row in np.flatnonzero(self._turn_at <= self.now).tolist():
            self._turn(row)
        self.now += seconds
        # What the shore or a vehicle did to them last does not last.
        self.velocities[self._drifting] = self._own[self._drifting]
        if len(self._evasive):
            self._flee(threats)
        moved = self.xy + self.velocities * seconds
        blocked = self._moving & ~area.contains(moved[:, 0], moved[:, 1])
        for row in np.flatnonzero(blocked).tolist():
            at, velocity = bounce(area, self.xy[row].tolist(), self.velocities[row].tolist(), seconds)
            moved[row], self.velocities[row] = at, velocity
            going = math.hypot(*velocity)
            if going > 0.0 and row not in self._rngs and self.targets[row].kind != "drifting":
                # A straight course goes on from the wall, as fast as before; a current does not turn.
                self._own[row] = velocity
                self._own[row] *= math.hypot(*self.targets[row].velocity) / going
        self.xy = moved

    def _turn(self, row: int) -> None:
        rng, target = self._rngs[row], self.targets[row]
        course = 2.0 * math.pi * rng.random()
        self.velocities[row] = target.pace * math.cos(course), target.pace * math.sin(course)
        while self._turn_at[row] <= self.now:
            self._turn_at[row] += rng.exponential(target.turn_time)

    def _flee(self, threats: FloatArray | None) -> None:
        rows = self._evasive
        self.velocities[rows] = self._own[rows]
        if threats is None or not len(threats):
            return
        away = self.xy[rows, None, :] - threats[None, :, :]
        distance = np.hypot(away[..., 0], away[..., 1])
        nearest = np.argmin(distance, axis=1)
        every = np.arange(len(rows))
        distance, away = distance[every, nearest], away[every, nearest]
        # Right below a vehicle no direction is away; it stays its course.
        scared = (distance <= self._alert[rows]) & (distance > 0.0)
        if scared.any():
            fleeing = rows[scared]
            unit = away[scared] / distance[scared, None]
            self.velocities[fleeing] = unit * self._speed[fleeing, None]


def bounce(area: Area, at: Point, velocity: Point, seconds: float) -> tuple[Point, Point]:
    """Move a point that bounces off the edges of the free area; return where it is and its velocity.

    Parameters
    ----------
    at : m, in the free area. velocity : m/s.
    """
    (x, y), (vx, vy) = at, velocity
    left = seconds
    for _ in range(MOST_BOUNCES):
        soonest, hit = left, None
        for ax, ay, bx, by in area.edges:
            ex, ey = bx - ax, by - ay
            inwards = vy * ex - vx * ey
            if inwards >= 0.0:
                continue
            square = ex * ex + ey * ey
            gap = (y - ay) * ex - (x - ax) * ey
            if gap < -TOUCH * math.sqrt(square):
                continue
            when = max(0.0, gap / -inwards)
            if when < soonest:
                along = ((x + vx * when - ax) * ex + (y + vy * when - ay) * ey) / square
                if -1e-9 <= along <= 1.0 + 1e-9:
                    soonest, hit = when, (-ey, ex, inwards / square)
        x, y, left = x + vx * soonest, y + vy * soonest, left - soonest
        if hit is None:
            return (x, y), (vx, vy)
        vx, vy = vx - 2.0 * hit[2] * hit[0], vy - 2.0 * hit[2] * hit[1]
    # In a corner too narrow to bounce out of: turn round.
    return (at[0], at[1]), (-velocity[0], -velocity[1])
