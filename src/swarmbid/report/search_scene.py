"""What a search mission's trace holds that can be drawn: flights, true targets, the area, the colours."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from swarmbid.report.svg import colour_class, number, tag
from swarmbid.sightings import Life, lives
from swarmbid.trace import Crashed, Pose, Trace, Truth

Point = tuple[float, float]
MOST_POINTS = 1500
"""Most points of one line on a map."""


@dataclass(frozen=True)
class Line:
    """Where something was, in order of time; `modes` of a vehicle, empty for a target."""

    times: list[float]
    places: list[Point]
    modes: list[str]

    def at(self, t: float) -> Point | None:
        """Where it was, straight between two records; None before the first."""
        after = bisect_right(self.times, t)
        if after == 0:
            return None
        if after == len(self.times):
            return self.places[-1]
        begin, end = self.times[after - 1], self.times[after]
        part = (t - begin) / (end - begin) if end > begin else 0.0
        (x1, y1), (x2, y2) = self.places[after - 1], self.places[after]
        return x1 + (x2 - x1) * part, y1 + (y2 - y1) * part

    def mode_at(self, t: float) -> str:
        """What the vehicle was doing."""
        after = bisect_right(self.times, t)
        return self.modes[max(0, after - 1)] if self.modes else ""

    def between(self, begin: float, end: float) -> list[Point]:
        """The places of a span of time, both ends included."""
        first, last = bisect_right(self.times, begin), bisect_right(self.times, end)
        ends = [self.at(begin), self.at(end)]
        found = [*ends[:1], *self.places[first:last], *ends[1:]]
        return thin([one for one in found if one is not None])

    def runs(self) -> list[tuple[str, float, float]]:
        """Mode, begin and end of each time without a change of mode."""
        found: list[tuple[str, float, float]] = []
        for t, mode in zip(self.times, self.modes, strict=True):
            if found and found[-1][0] == mode:
                found[-1] = (mode, found[-1][1], t)
            else:
                if found:
                    found[-1] = (found[-1][0], found[-1][1], t)
                found.append((mode, t, t))
        return found


class SearchScene:
    """A trace of a search mission, ready to draw.

    Attributes
    ----------
    vehicles : id -> its flight. targets : true target id -> its way. lives : task id -> its records.
    end : s, time of the last record.
    """

    def __init__(self, trace: Trace) -> None:
        self.trace = trace
        self.world: dict[str, Any] = trace.header.world or {}
        self.lives: dict[str, Life] = lives(trace)
        self.end = max((record.t for record in trace.records), default=0.0)
        self.vehicles: dict[str, Line] = {
            str(one["id"]): Line([], [], []) for one in self.world.get("vehicles", ())
        }
        self.targets: dict[str, Line] = {
            str(one["id"]): Line([], [], []) for one in self.world.get("targets", ())
        }
        self.crashes: dict[str, float] = {one.agent: one.t for one in trace.of(Crashed)}
        for record in trace.records:
            if isinstance(record, Pose):
                line = self.vehicles.setdefault(record.agent, Line([], [], []))
                line.modes.append(record.mode)
            elif isinstance(record, Truth):
                line = self.targets.setdefault(record.target, Line([], [], []))
            else:
                continue
            line.times.append(record.t)
            line.places.append((record.x, record.y))

    @cached_property
    def colours(self) -> dict[str, int]:
        """Id of a vehicle -> its number, which gives the colour."""
        return {vehicle: index for index, vehicle in enumerate(self.vehicles)}

    @cached_property
    def boundary(self) -> list[Point]:
        """The corners of the area, m; none if the trace has none."""
        return [(x, y) for x, y in self.world.get("area", {}).get("boundary", ())]

    @cached_property
    def exclusions(self) -> list[list[Point]]:
        """The corners of each exclusion zone, m."""
        return [[(x, y) for x, y in zone] for zone in self.world.get("area", {}).get("exclusions", ())]

    @cached_property
    def bases(self) -> list[Point]:
        """The places of the bases, each once, m."""
        found = [
            vehicle["base"] for vehicle in self.world.get("vehicles", ()) if vehicle.get("base") is not None
        ]
        return list(dict.fromkeys((float(base[0]), float(base[1])) for base in found))

    @cached_property
    def box(self) -> tuple[float, float, float, float]:
        """West, south, east, north of all there is, m."""
        points = [*self.boundary, *self.bases]
        for line in (*self.vehicles.values(), *self.targets.values()):
            points += line.places
        xs, ys = [x for x, _ in points] or [0.0], [y for _, y in points] or [0.0]
        return min(xs), min(ys), max(xs), max(ys)

    def colour(self, vehicle: str) -> str:
        """CSS class of a vehicle's colour; a soft grey for anybody else."""
        return colour_class(self.colours[vehicle]) if vehicle in self.colours else "shared"

    def frame(self, left: float, top: float, width: float, most_height: float) -> Frame:
        """Return the view of everything within a width and a height, px."""
        west, south, east, north = self.box
        across, along = max(east - west, 1.0), max(north - south, 1.0)
        margin = 0.04 * max(across, along)
        scale = min(width / (across + 2 * margin), most_height / (along + 2 * margin))
        height = (along + 2 * margin) * scale
        spare = (width - (across + 2 * margin) * scale) / 2
        return Frame(left + spare - (west - margin) * scale, top + (north + margin) * scale, scale, height)


@dataclass(frozen=True)
class Frame:
    """From metres to px: origin of the metres in px, px a metre, height used in px."""

    x0: float
    y0: float
    scale: float
    height: float

    def __call__(self, place: Point) -> Point:
        return self.x0 + place[0] * self.scale, self.y0 - place[1] * self.scale

    def path(self, places: Sequence[Point], *, closed: bool = False) -> str:
        """Path data of a line."""
        points = [f"{number(x)} {number(y)}" for x, y in map(self, places)]
        return "M" + "L".join(points) + ("z" if closed else "")


def thin(places: list[Point]) -> list[Point]:
    """Leave out evenly what a line has beyond `MOST_POINTS`; both ends stay."""
    step = -(-len(places) // MOST_POINTS)
    return places if step <= 1 else [*places[:-1:step], places[-1]]


def ground(scene: SearchScene, frame: Frame) -> str:
    """Draw the area, its exclusion zones, the bases and the ground station."""
    parts = []
    if scene.boundary:
        parts.append(tag("path", d=frame.path(scene.boundary, closed=True), class_="area"))
    for zone in scene.exclusions:
        parts.append(tag("path", d=frame.path(zone, closed=True), class_="zone"))
    station = scene.world.get("ground_station")
    if station is not None:
        x, y = frame((float(station[0]), float(station[1])))
        parts.append(tag("path", d=f"M{number(x)} {number(y - 9)}l4 11h-8z", class_="base"))
    for base in scene.bases:
        x, y = frame(base)
        parts.append(tag("path", d=f"M{number(x - 8)} {number(y)}l8-7 8 7h-2v6h-12v-6z", class_="base"))
    return "".join(parts)


def parts_of(line: Line, drawn: Callable[[str], str]) -> list[tuple[str, list[Point]]]:
    """Split a flight where the way of drawing its mode changes: class and places of each part."""
    found: list[tuple[str, float, float]] = []
    for mode, begin, end in line.runs():
        css = drawn(mode)
        if found and found[-1][0] == css:
            found[-1] = (css, found[-1][1], end)
        else:
            found.append((css, begin, end))
    return [(css, line.between(begin, end)) for css, begin, end in found if end > begin]
