"""A search-and-track mission: where, who searches, what is hidden, and what is known beforehand."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from swarmbid.checks import Checker
from swarmbid.model import Mission
from swarmbid.world.area import Area, Point
from swarmbid.world.belief import KINDS, Belief
from swarmbid.world.grid import LARGEST_GRID, Grid
from swarmbid.world.targets import Target
from swarmbid.world.vehicle import Vehicle, check_point, start, time_home

LIKELIEST = 0.99
"""The most that a cell may promise beforehand, so that finding nothing there can be learned from."""


@dataclass(frozen=True, kw_only=True)
class SearchMission:
    """The world, and what the UAVs are told of it.

    Parameters
    ----------
    area : where. vehicles : one or more, each over the free area, ids unique among all.
    targets : hidden from the UAVs.
    duration : s. cell : m, side of a cell of the belief.
    kind : "independent" (any number of targets) or "one" (exactly one), as for `Belief`.
    expected : how many targets are expected in the area; ignored for "one".
    datum : (x, y, sigma) in m, a last known position and its standard deviation; None for anywhere.
    drift, diffusion : m/s and m2/s, how targets are believed to move.
    radio_range : m, the most for all UAVs. ground_station : east, north in m, or None.
    dwell : s of service at a static target. reward : score of a target.
    revisit : s between visits to a static target; 0 for a single one.
    identify : equipment that a group must bring to each static target.
    """

    area: Area
    vehicles: tuple[Vehicle, ...]
    targets: tuple[Target, ...] = ()
    name: str = "search"
    duration: float = 3600.0
    cell: float = 50.0
    kind: str = "independent"
    expected: float = 1.0
    datum: tuple[float, float, float] | None = None
    drift: tuple[float, float] = (0.0, 0.0)
    diffusion: float = 0.0
    radio_range: float = math.inf
    ground_station: Point | None = None
    dwell: float = 0.0
    reward: float = 100.0
    revisit: float = 0.0
    identify: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "vehicles", tuple(self.vehicles))
        object.__setattr__(self, "targets", tuple(self.targets))
        check = Checker("search mission", self)
        check.name("name")
        check.number("duration", above=0.0)
        if check.number("cell", above=0.0):
            self._check_cell(check)
        if self.kind not in KINDS:
            check.fault("kind", f"is {self.kind!r}", f"Use one of {', '.join(KINDS)}.")
        check.number("expected", above=0.0)
        if self.datum is not None:
            faults = len(check.faults)
            check.position("datum")
            if len(check.faults) == faults and self.datum[2] <= 0.0:
                check.fault("datum", f"has a deviation of {self.datum[2]:g} m", "Give more than 0.")
        check_point(check, "drift")
        check.number("diffusion", low=0.0)
        check.number("radio_range", above=0.0, infinite=True)
        if self.ground_station is not None:
            check_point(check, "ground_station")
        check.number("dwell", low=0.0)
        check.number("reward", above=0.0)
        check.number("revisit", low=0.0)
        faults = len(check.faults)
        check.names("identify", tuple)
        if len(check.faults) == faults:
            self._check_equipment(check)
        self._check_team(check)
        check.done()

    def _check_cell(self, check: Checker) -> None:
        west, south, east, north = self.area.bounds
        cells = math.ceil((east - west) / self.cell) * math.ceil((north - south) / self.cell)
        if cells > LARGEST_GRID:
            check.fault("cell", f"is {self.cell:g}, for {cells} cells", "Give larger cells.")

    def _check_team(self, check: Checker) -> None:
        if not self.vehicles:
            check.fault("vehicles", "are none", "Give one or more.")
        seen: set[str] = set()
        for name in (*(vehicle.id for vehicle in self.vehicles), *(target.id for target in self.targets)):
            if name in seen:
                check.fault("vehicles, targets", f"use the id {name!r} twice", "Give each its own.")
            seen.add(name)
        for vehicle in self.vehicles:
            free = True
            for name, place in (("position", vehicle.position[:2]), ("base", vehicle.base)):
                if place is not None and not self.area.inside(place):
                    free = False
                    where = f"vehicles.{vehicle.id}.{name}"
                    check.fault(where, f"is {place}, not in the free area", "Move it.")
            home = time_home(vehicle, start(vehicle), self.area) if free else 0.0
            if home + vehicle.reserve >= vehicle.endurance:
                why = f"is {vehicle.endurance:g} s, but the way to the base may take {home:.0f} s"
                mend = "Give more than that and the reserve together."
                check.fault(f"vehicles.{vehicle.id}.endurance", why, mend)
        for target in self.targets:
            if not self.area.inside(target.position):
                check.fault(
                    f"targets.{target.id}.position", f"is {target.position}, not in the free area", "Move it."
                )

    def _check_equipment(self, check: Checker) -> None:
        # UAVs that each bring a part may serve a target together, but somebody must bring each part.
        carried = frozenset[str]().union(*(vehicle.equipment for vehicle in self.vehicles))
        missing = sorted(set(self.identify) - carried)
        if missing:
            check.fault("identify", f"asks for {missing[0]!r}, which no vehicle carries", "Equip one.")

    def belief(self, grid: Grid) -> Belief:
        """Return what every UAV believes at the start.

        `expected` targets (or the one), spread over the free cells evenly or by the datum's Gaussian.
        """
        weights = grid.mask.astype(np.float64)
        if self.datum is not None:
            x, y, sigma = self.datum
            off = np.square(grid.x[None, :] - x) + np.square(grid.y[:, None] - y)
            # The nearest cell weighs 1, so that a datum far outside the area does not vanish altogether.
            off -= off[grid.mask].min()
            weights *= np.exp(-off / (2.0 * sigma * sigma))
        prior = weights / weights.sum()
        if self.kind != "one":
            prior = np.minimum(prior * self.expected, LIKELIEST)
        return Belief(grid, self.kind, prior, self.drift, self.diffusion)

    def roster(self) -> Mission:
        """Return the team as the negotiation knows it, without tasks: they are found in flight."""
        return Mission(agents=tuple(vehicle.agent() for vehicle in self.vehicles), tasks=(), name=self.name)

    def to_dict(self) -> dict[str, Any]:
        """Return the world for the head of a trace, ready for JSON; None for what is unlimited."""
        return {
            "area": self.area.to_dict(),
            "vehicles": [
                {
                    "id": vehicle.id,
                    "type": vehicle.type,
                    "speed": vehicle.speed,
                    "turn_radius": vehicle.turn_radius,
                    "endurance": _finite(vehicle.endurance),
                    "reserve": vehicle.reserve,
                    "base": None if vehicle.base is None else list(vehicle.base),
                    "radius": vehicle.sensor.radius(vehicle.position[2]),
                    "radio_range": _finite(min(vehicle.radio_range, self.radio_range)),
                    "equipment": sorted(vehicle.equipment),
                }
                for vehicle in self.vehicles
            ],
            "targets": [{"id": one.id, "kind": one.kind, "type": one.type} for one in self.targets],
            "duration": self.duration,
            "ground_station": None if self.ground_station is None else list(self.ground_station),
        }


def _finite(value: float) -> float | None:
    return None if math.isinf(value) else value
