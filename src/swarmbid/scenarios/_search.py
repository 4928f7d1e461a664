"""What the search scenarios share: a square with a no-fly zone, UAVs at its edge, targets anywhere."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import fields
from typing import Any

from swarmbid.errors import Fault, InputError
from swarmbid.rng import stream
from swarmbid.world.area import Area
from swarmbid.world.sensor import Sensor
from swarmbid.world.vehicle import Vehicle

Point = tuple[float, float]


def check(where: str, options: Any, lowest: Mapping[str, float], positive: tuple[str, ...]) -> None:
    """Raise InputError for every option below what it may be."""
    wrong = [
        Fault(where, item.name, f"is {getattr(options, item.name)!r}", "Give a whole number.")
        for item in fields(options)
        if isinstance(item.default, int) and not isinstance(getattr(options, item.name), int)
    ]
    if wrong:
        raise InputError(wrong)
    faults = [
        Fault(where, name, f"is {getattr(options, name)}", f"Give {low:g} or more.")
        for name, low in lowest.items()
        if not low <= getattr(options, name) < math.inf
    ]
    faults += [
        Fault(where, name, f"is {getattr(options, name)}", "Give more than 0.")
        for name in positive
        if not 0.0 < getattr(options, name) < math.inf
    ]
    if faults:
        raise InputError(faults)


def square_with_hole(where: str, width: float, hole: float) -> Area:
    """A square from (0, 0) on, with a square no-fly zone of `hole` m north-east of its middle; 0 for none."""
    if hole > 0.4 * width:
        mend = f"Give at most {0.4 * width:g}, so that it fits."
        raise InputError([Fault(where, "hole", f"is {hole:g}", mend)])
    boundary = ((0.0, 0.0), (width, 0.0), (width, width), (0.0, width))
    if hole <= 0.0:
        return Area(boundary)
    west = south = 0.55 * width
    ring = ((west, south), (west + hole, south), (west + hole, south + hole), (west, south + hole))
    return Area(boundary, (ring,))


def vehicles(
    count: int,
    width: float,
    sensor: Sensor,
    *,
    altitude: float,
    speed: float,
    turn_radius: float,
    endurance: float,
    reserve: float,
    radio_range: float,
    equipment: tuple[frozenset[str], ...] = (frozenset(),),
) -> tuple[Vehicle, ...]:
    """UAVs side by side at the base, the middle of the south edge; equipment goes round."""
    base = (0.5 * width, 0.02 * width)
    gap = 0.01 * width
    return tuple(
        Vehicle(
            id=f"uav{row + 1:02d}",
            position=(base[0] + gap * (row - (count - 1) / 2.0), base[1], altitude),
            speed=speed,
            turn_radius=turn_radius,
            endurance=_tank(endurance, row, count),
            reserve=reserve,
            turnaround=120.0,
            base=base,
            sensor=sensor,
            radio_range=radio_range,
            equipment=equipment[row % len(equipment)],
        )
        for row in range(count)
    )


def _tank(endurance: float, row: int, count: int) -> float:
    """Batteries age: the first lasts 0.6 of the time of the last, so that not all come home at once."""
    return endurance * (1.0 if count == 1 else 0.6 + 0.4 * row / (count - 1))


def free_places(seed: int, name: str, count: int, area: Area) -> list[Point]:
    """Draw places anywhere in the free area, each from a stream of its own."""
    west, south, east, north = area.bounds
    found = []
    for row in range(count):
        rng = stream(seed, "search", name, row)
        while True:
            place = (float(rng.uniform(west, east)), float(rng.uniform(south, north)))
            if area.inside(place):
                found.append(place)
                break
    return found
