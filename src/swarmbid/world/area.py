"""Where the mission happens: a polygon with no-fly zones cut out, and the shortest ways through it.

Polygons are cut by shapely, once; what a vehicle asks at every step is plain arithmetic.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swarmbid.arrays import FloatArray, RowArray
from swarmbid.checks import LARGEST
from swarmbid.errors import Fault, InputError

Point = tuple[float, float]
"""East and north, m."""

Edge = tuple[float, float, float, float]
"""From (x, y) to (x, y), the free area on its left."""

TOUCH = 1e-6
"""m; so near to an edge is on it."""

MOST_REMEMBERED = 256
"""How many areas stretched to a point outside are kept."""


class _Ways(NamedTuple):
    """Shortest ways between the corners that ways bend at."""

    corners: tuple[Point, ...]
    lengths: FloatArray  # m
    following: RowArray  # the next corner on the way from row to column


@dataclass(frozen=True)
class Area:
    """A polygon in which vehicles fly and targets move, less its exclusion zones.

    Parameters
    ----------
    boundary : corners in order, m; no edge crosses another.
    exclusions : polygons that nobody enters. They may overlap and stick out, but not cut the free area
        in two.

    Raises
    ------
    InputError : for crossed edges, for no free area, and for one in several parts.

    Examples
    --------
    >>> field = Area.square(100.0, exclusions=(((40, 0), (60, 0), (60, 90), (40, 90)),))
    >>> field.route((20.0, 10.0), (80.0, 10.0))
    ((40.0, 90.0), (60.0, 90.0), (80.0, 10.0))
    """

    boundary: tuple[Point, ...]
    exclusions: tuple[tuple[Point, ...], ...] = ()

    @classmethod
    def square(cls, side: float, exclusions: tuple[tuple[Point, ...], ...] = ()) -> Area:
        """Return a square from (0, 0) on, `side` m wide."""
        return cls(((0.0, 0.0), (side, 0.0), (side, side), (0.0, side)), exclusions)

    def __post_init__(self) -> None:
        faults: list[Fault] = []
        boundary = _ring("boundary", self.boundary, faults)
        exclusions = tuple(
            _ring(f"exclusions[{row}]", ring, faults) for row, ring in enumerate(self.exclusions)
        )
        if faults:
            raise InputError(faults)
        object.__setattr__(self, "boundary", boundary)
        object.__setattr__(self, "exclusions", exclusions)
        if self.polygon.geom_type != "Polygon" or self.polygon.area <= 0.0:
            parts = len(getattr(self.polygon, "geoms", ()))
            why = f"cut the area into {parts} parts" if parts > 1 else "leave no free area"
            raise InputError([Fault("area", "exclusions", why, "Leave one connected free area.")])

    @cached_property
    def polygon(self) -> Any:
        """The free area, for shapely."""
        import shapely

        zones = shapely.union_all([shapely.Polygon(ring) for ring in self.exclusions])
        free = shapely.Polygon(self.boundary).difference(zones).simplify(0.0)
        # Anticlockwise outside and clockwise inside, so that what is free is on the left of every edge.
        free = shapely.orient_polygons(free)
        shapely.prepare(free)
        return free

    def contains(self, x: ArrayLike, y: ArrayLike) -> NDArray[np.bool_]:
        """Tell which of many points are in the free area, its edges left out."""
        import shapely

        return np.asarray(shapely.contains_xy(self.polygon, x, y), dtype=np.bool_)

    def inside(self, point: Point) -> bool:
        """Tell whether one point is in the free area or on its edge."""
        x, y = point
        odd = False
        for ax, ay, bx, by in self.edges:
            if (ay > y) != (by > y) and x < ax + (y - ay) * (bx - ax) / (by - ay):
                odd = not odd
        return odd or self._nearest_on_edges(x, y)[0] <= TOUCH

    @cached_property
    def size(self) -> float:
        """Free area, m2."""
        return float(self.polygon.area)

    @cached_property
    def bounds(self) -> tuple[float, float, float, float]:
        """West, south, east and north end of the boundary, m."""
        xs, ys = zip(*self.boundary, strict=True)
        return min(xs), min(ys), max(xs), max(ys)

    @cached_property
    def rings(self) -> tuple[tuple[Point, ...], ...]:
        """Corners around the free area, first outside (anticlockwise), then of each hole (clockwise)."""
        rings = (self.polygon.exterior, *self.polygon.interiors)
        return tuple(tuple((float(x), float(y)) for x, y in ring.coords[:-1]) for ring in rings)

    @cached_property
    def edges(self) -> tuple[Edge, ...]:
        """All edges around the free area."""
        return tuple((*ring[row - 1], *corner) for ring in self.rings for row, corner in enumerate(ring))

    @cached_property
    def corners(self) -> tuple[Point, ...]:
        """The corners that point into the free area: where shortest ways bend."""
        found = []
        for ring in self.rings:
            for row, (x, y) in enumerate(ring):
                (px, py), (nx, ny) = ring[row - 1], ring[(row + 1) % len(ring)]
                inx, iny, outx, outy = x - px, y - py, nx - x, ny - y
                if inx * outy - iny * outx < -1e-12 * math.hypot(inx, iny) * math.hypot(outx, outy):
                    found.append((x, y))
        return tuple(found)

    def clear(self, a: Point, b: Point) -> bool:
        """Tell whether the straight line from `a` to `b` stays in the free area; touching is allowed."""
        if not (self.inside(a) and self.inside(b)):
            return False
        return not self.corners or self._unbroken(a, b)

    def route(self, a: Point, b: Point) -> tuple[Point, ...]:
        """Return the shortest way from `a` to `b` as waypoints, `b` last and `a` left out.

        From outside the free area, where the arc of a turn may have ended, it comes back on the way to the
        first place if it may: a nearest place beside it would recede before a fixed wing for ever. If `b` is
        outside the boundary, the way may use the convex hull of both: a base need not lie in the search area.
        The first route that bends costs a visibility graph, some 20 us a pair of corners.
        """
        region = self.stretched(b)
        if not region.corners:
            return (b,)
        start, goal = region.nearest(a), region.nearest(b)
        way = [goal] if start == goal or region._unbroken(start, goal) else region._around(start, goal)
        if start != a and not region._regained(a, way[0]):
            way.insert(0, start)
        if goal != b:
            way.append(b)
        return tuple(way[1:] if way[0] == a and len(way) > 1 else way)

    def nearest(self, point: Point) -> Point:
        """Return the point of the free area that is nearest to `point`; itself if it is inside."""
        if self.inside(point):
            return point
        return self._nearest_on_edges(*point)[1]

    def stretched(self, point: Point) -> Area:
        """Return this area, or if `point` is outside its boundary, one that reaches it."""
        if self._bounded(*point):
            return self
        known = self._stretched.get(point)
        if known is None:
            import shapely

            hull = shapely.convex_hull(shapely.MultiPoint([*self.boundary, point]))
            known = Area(tuple(hull.exterior.coords[:-1]), self.exclusions)
            if len(self._stretched) >= MOST_REMEMBERED:
                self._stretched.clear()
            self._stretched[point] = known
        return known

    def to_dict(self) -> dict[str, Any]:
        """Return plain lists, for a trace."""
        return {
            "boundary": [list(corner) for corner in self.boundary],
            "exclusions": [[list(corner) for corner in ring] for ring in self.exclusions],
        }

    @classmethod
    def from_dict(cls, data: dict[str, Any]) -> Area:
        """Return the area that `to_dict` wrote."""
        return cls(data["boundary"], tuple(data["exclusions"]))

    @cached_property
    def _stretched(self) -> dict[Point, Area]:
        return {}

    def _bounded(self, x: float, y: float) -> bool:
        west, south, east, north = self.bounds
        if not (west - TOUCH <= x <= east + TOUCH and south - TOUCH <= y <= north + TOUCH):
            return False
        odd = False
        bx, by = self.boundary[-1]
        for ax, ay in self.boundary:
            if (ay > y) != (by > y) and x < ax + (y - ay) * (bx - ax) / (by - ay):
                odd = not odd
            if _to_edge(x, y, (bx, by, ax, ay))[0] <= TOUCH:
                return True
            bx, by = ax, ay
        return odd

    def _nearest_on_edges(self, x: float, y: float) -> tuple[float, Point]:
        return min(_to_edge(x, y, edge) for edge in self.edges)

    @cached_property
    def _notched(self) -> bool:
        """Whether a zone reaches the boundary, so that who is outside may face it."""
        import shapely

        gone = shapely.Polygon(self.boundary).area - shapely.Polygon(self.rings[0]).area
        return bool(gone > 1e-9 * self.size)

    def _regained(self, a: Point, b: Point) -> bool:
        """Whether the line from `a` outside the free area to `b` stays in it once it is there.

        Until then it is never farther from it than `a`, as `b` is in sight of the place nearest to `a`.
        """
        if self._notched and not self._bounded(*a):
            return False
        free = self._pieces(a, b)
        return all(free[free.index(True) :]) if True in free else True

    def _unbroken(self, a: Point, b: Point) -> bool:
        """Whether the line between two points of the free area stays in it."""
        return all(self._pieces(a, b))

    def _pieces(self, a: Point, b: Point) -> list[bool]:
        """Cut a line where it meets edges, and tell of each piece whether it is free.

        Each is wholly inside or outside, and so is its middle.
        """
        x, y = a
        dx, dy = b[0] - x, b[1] - y
        length = math.hypot(dx, dy)
        if length <= TOUCH:
            return []
        west, east = min(x, b[0]) - TOUCH, max(x, b[0]) + TOUCH
        south, north = min(y, b[1]) - TOUCH, max(y, b[1]) + TOUCH
        cuts = [0.0, 1.0]
        for ax, ay, bx, by in self.edges:
            if (ax < west and bx < west) or (ax > east and bx > east):
                continue
            if (ay < south and by < south) or (ay > north and by > north):
                continue
            ex, ey = bx - ax, by - ay
            edge = math.hypot(ex, ey)
            across = dx * ey - dy * ex
            if abs(across) <= 1e-12 * length * edge:
                continue  # parallel: its neighbours cut at its corners
            along = ((ax - x) * ey - (ay - y) * ex) / across
            on_edge = ((ax - x) * dy - (ay - y) * dx) / across
            if 0.0 < along < 1.0 and -TOUCH <= on_edge * edge <= edge + TOUCH:
                cuts.append(along)
        cuts.sort()
        return [
            self.inside((x + (low + high) / 2.0 * dx, y + (low + high) / 2.0 * dy))
            for low, high in itertools.pairwise(cuts)
            if (high - low) * length > TOUCH
        ]

    @cached_property
    def _ways(self) -> _Ways:
        """All shortest ways between corners (Floyd and Warshall)."""
        corners = self.corners
        num = len(corners)
        lengths = np.full((num, num), math.inf)
        following = np.tile(np.arange(num), (num, 1))
        for row in range(num):
            lengths[row, row] = 0.0
            for col in range(row):
                if self._unbroken(corners[row], corners[col]):
                    lengths[row, col] = lengths[col, row] = math.dist(corners[row], corners[col])
        for by in range(num):
            through = lengths[:, by, None] + lengths[None, by, :]
            # Shorter by rounding only is not shorter, else ways could run in circles.
            better = through < lengths - 1e-9
            lengths = np.where(better, through, lengths)
            following = np.where(better, following[:, by, None], following)
        return _Ways(corners, lengths, following)

    def _around(self, a: Point, b: Point) -> list[Point]:
        corners, lengths, following = self._ways
        first, last = (
            np.array(
                [math.dist(end, corner) if self._unbroken(end, corner) else math.inf for corner in corners]
            )
            for end in (a, b)
        )
        total = first[:, None] + lengths + last[None, :]
        here, goal = divmod(int(np.argmin(total)), len(corners))
        way = [corners[here]]
        while here != goal:
            here = int(following[here, goal])
            way.append(corners[here])
        return [*way, b]


def length_of(way: Iterable[Point]) -> float:
    """Return the metres along some points."""
    return sum(math.dist(a, b) for a, b in itertools.pairwise(way))


def is_point(value: Any) -> bool:
    """Tell whether something is two finite numbers."""
    try:
        x, y = value
        return abs(float(x)) <= LARGEST and abs(float(y)) <= LARGEST
    except (TypeError, ValueError):
        return False


def _to_edge(x: float, y: float, edge: Edge) -> tuple[float, Point]:
    """Return how far a point is from an edge, and the point of the edge that is so near."""
    ax, ay, bx, by = edge
    ex, ey = bx - ax, by - ay
    square = ex * ex + ey * ey
    along = ((x - ax) * ex + (y - ay) * ey) / square if square > 0.0 else 0.0
    along = min(max(along, 0.0), 1.0)
    px, py = ax + along * ex, ay + along * ey
    return math.hypot(x - px, y - py), (px, py)


def _ring(field: str, ring: Sequence[Point], faults: list[Fault]) -> tuple[Point, ...]:
    """Return the corners as plain floats, the first not repeated; note what is wrong with them."""
    import shapely

    try:
        corners = list(ring)
    except TypeError:
        corners = []
    if len(corners) < 3 or not all(is_point(corner) for corner in corners):
        faults.append(
            Fault("area", field, f"is {ring!r}", "Give at least three corners, each (east, north) in m.")
        )
        return ()
    plain = tuple((float(x), float(y)) for x, y in corners)
    if plain[0] == plain[-1]:
        plain = plain[:-1]
    shape = shapely.Polygon(plain) if len(plain) >= 3 else None
    if shape is None or not shape.is_valid or shape.area <= 0.0:
        why = "has no area" if shape is None else shapely.is_valid_reason(shape)
        faults.append(
            Fault("area", field, why, "Give the corners in order, so that no edge crosses another.")
        )
        return ()
    return plain
