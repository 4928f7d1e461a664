"""Where one UAV searches next: what it believes, its share of the area, and the strategy.

Strategies: "ours" divides what is left to find among those who search, anew whenever one of them joins or
leaves, and each flies the leg of its share that promises most; the others are there to be compared with.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from swarmbid.errors import Fault, InputError
from swarmbid.world.belief import Footprint
from swarmbid.world.division import divide
from swarmbid.world.glimpses import GlimpseBatch, GlimpseLog
from swarmbid.world.grid import Grid
from swarmbid.world.mission import SearchMission
from swarmbid.world.patterns import parallel_sweep
from swarmbid.world.planner import Planner
from swarmbid.world.vehicle import Vehicle

STRATEGIES = ("ours", "greedy", "lawnmower", "random_walk")
REPLAN = 4.0
"""s between two looks at the plan."""
SETTLE = 10.0
"""s between two divisions at least: whoever looks closer at something is soon back."""
REFRESH = 240.0
"""s after which the area is divided anew by what is left to find, though nobody joined or left."""
HORIZON = 60.0
KEPT = 1500
"""Newest glimpses of each UAV that can still be passed on."""

Point = tuple[float, float]


class Searching:
    """One UAV's part of the search.

    Parameters
    ----------
    rng : for "random_walk", and for all where nothing is left to find.
    shared : whether beliefs are exchanged.
    """

    def __init__(
        self,
        mission: SearchMission,
        vehicle: Vehicle,
        grid: Grid,
        strategy: str,
        rng: np.random.Generator,
        *,
        shared: bool = True,
    ) -> None:
        if strategy not in STRATEGIES:
            mend = "Choose one of: " + ", ".join(STRATEGIES) + "."
            raise InputError([Fault("search", "strategy", f"is {strategy!r}", mend)])
        self.vehicle = vehicle
        self.grid = grid
        self.strategy = strategy
        self.shared = shared
        self.area = mission.area
        altitude = vehicle.position[2]
        self.footprint = Footprint(vehicle.sensor, altitude, grid)
        self.belief = mission.belief(grid)
        self.log = GlimpseLog(vehicle.id, keep=KEPT, stride=0.25 * self.footprint.radius)
        self.planner = Planner(grid, self.footprint, vehicle.speed)
        self.share = grid.mask
        self.searchers: tuple[str, ...] = ()
        self._divided_at = -math.inf
        self._planned_at = -math.inf
        self._goal: Point | None = None
        self._sweep: tuple[Point, ...] = ()
        self._leg = 0
        self._rng = rng
        self._belief_at = 0.0

    def glimpse(self, now: float, x: float, y: float) -> None:
        """Note that the UAV looked at where it is, and saw nothing new."""
        if self.log.add(now, x, y):
            self.belief.glimpse(self.footprint, x, y)

    def hear(self, batch: GlimpseBatch, now: float) -> None:
        """Take in glimpses of others, each once."""
        new = self.log.merge(batch)
        if len(new) and self.shared:
            self.belief.glimpses(self.footprint, new[:, 1:], np.maximum(now - new[:, 0], 0.0))

    def advance(self, now: float) -> None:
        """Let the belief move on."""
        self.belief.advance(now - self._belief_at)
        self._belief_at = now

    def divide(self, now: float, searchers: Mapping[str, Point]) -> bool:
        """Divide the area among those who search, if they are others than before; return whether."""
        names = tuple(sorted(searchers))
        if self.strategy == "lawnmower":
            if self.searchers:
                return False
        elif self.strategy != "ours" or now - self._divided_at < (
            REFRESH if names == self.searchers else SETTLE
        ):
            return False
        weights = self.belief.probability if self.strategy == "ours" else self.grid.mask.astype(np.float64)
        if float(weights.sum()) <= 0.0:
            weights = self.grid.mask.astype(np.float64)
        labels = divide(self.grid, weights, [searchers[name] for name in names])
        anew = names != self.searchers
        self.searchers = names
        self._divided_at = now
        self.share = labels == names.index(self.vehicle.id)
        self._planned_at = -math.inf
        if self.strategy == "lawnmower":
            self._sweep = parallel_sweep(
                self.area, 1.6 * self.footprint.radius, within=self.grid.outline(self.share),
                start=searchers[self.vehicle.id],
            )  # fmt: skip
        return anew

    def forget_goal(self) -> None:
        """The UAV has been elsewhere: plan anew."""
        self._planned_at = -math.inf
        self._goal = None
        self.planner.goal = None

    def goal(self, now: float, x: float, y: float, heading: float) -> Point:
        """Return where to fly next."""
        if self.strategy == "lawnmower":
            return self._next_of_sweep(x, y)
        arrived = self._goal is None or math.dist(self._goal, (x, y)) < self.vehicle.speed * 2.0
        if self.strategy == "random_walk":
            if arrived:
                self._goal = self._anywhere()
            assert self._goal is not None
            return self._goal
        if arrived or now - self._planned_at >= REPLAN:
            self._planned_at = now
            found = None
            for allowed in (self.share, self.grid.mask):
                found = self.planner.plan(
                    self.belief.probability, allowed, (x, y), heading, self.vehicle.turn_radius, HORIZON
                )
                if found is not None:
                    break
            self._goal = found or self._anywhere()
        assert self._goal is not None
        return self._goal

    def _next_of_sweep(self, x: float, y: float) -> Point:
        if not self._sweep:
            return self._anywhere()
        close = max(self.vehicle.speed * 1.5, self.vehicle.turn_radius * 1.2)
        for _ in range(len(self._sweep)):
            if math.dist(self._sweep[self._leg], (x, y)) >= close:
                break
            self._leg = (self._leg + 1) % len(self._sweep)
        return self._sweep[self._leg]

    def _anywhere(self) -> Point:
        rows, columns = np.nonzero(self.grid.mask)
        pick = int(self._rng.integers(len(rows)))
        return float(self.grid.x[columns[pick]]), float(self.grid.y[rows[pick]])
