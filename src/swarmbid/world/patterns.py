"""Search patterns: waypoints that pass over a whole area, or around a datum.

Names and shapes after the IAMSAR Manual (IMO and ICAO, volume II, chapter 5): parallel sweep, creeping
line, expanding square, sector search. No-fly zones are flown around.

A parallel sweep covers exactly: every place to be searched is within half a spacing of a track, however the
border runs. The area is cut into bands one spacing wide, each with its track along the middle, and each band
into slabs between corners (the trapezoidal decomposition of Choset, "Coverage of known spaces: the
boustrophedon cellular decomposition", Autonomous Robots 2000). Where the middle of the band is not to be
searched, or not to be flown, the track runs along the border instead: of each slice across the band it takes
the place nearest to the middle, so no place of the slice is further from it than from the middle.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import Any

from swarmbid.errors import Fault, InputError
from swarmbid.world.area import Area, Point, length_of

NEAR = 1e-6
"""Places nearer than this are one place, m."""

MOST_TRACKS = 20_000
"""More tracks than that are a mistyped spacing."""

Track = list[Point]


def parallel_sweep(
    area: Area,
    spacing: float,
    *,
    heading: float | None = None,
    start: Point | None = None,
    within: Any = None,
) -> tuple[Point, ...]:
    """Return the waypoints of parallel tracks over an area, or over a searcher's share of it.

    Parameters
    ----------
    area : where; the whole way stays in its free area.
    spacing : most distance between tracks, m; they are spread evenly, so it may be less.
    heading : of the tracks, rad from east, anticlockwise; None for along the longer side, which turns least.
    start : where the searcher is, m; it begins at the nearer of the ends. None for the end that lies to the
        back and the right, looking along the heading.
    within : the part to search: a list of rings, or a shapely polygon; None for everything. The way from one
        track to the next may leave it.

    Returns
    -------
    Waypoints, the first one the beginning of the first track; none, if there is nothing to search.
    """
    faults = _not_positive("parallel_sweep", spacing=spacing)
    if faults:
        raise InputError(faults)
    region = area.polygon if within is None else area.polygon.intersection(_polygon(within))
    if region.area <= 0.0:
        return ()
    along = _longer_side(region) if heading is None else heading
    bands = _bands(region, spacing, along)
    back = _turn(-along)
    tracks = [[[_rotate(point, *back) for point in track] for track in band] for band in bands]
    return _joined(area, tracks, start)


def creeping_line(
    area: Area,
    spacing: float,
    *,
    heading: float | None = None,
    start: Point | None = None,
    within: Any = None,
) -> tuple[Point, ...]:
    """Return the waypoints of a creeping line: tracks across the direction in which the search moves on.

    Parameters are those of `parallel_sweep`, but `heading` is where the search creeps to; None for along
    the longer side, so that the tracks are short.
    """
    if heading is None:
        region = area.polygon if within is None else area.polygon.intersection(_polygon(within))
        heading = _longer_side(region) if region.area > 0.0 else 0.0
    return parallel_sweep(area, spacing, heading=heading + math.pi / 2, start=start, within=within)


def expanding_square(
    datum: Point, spacing: float, legs: int, *, heading: float = 0.0, area: Area | None = None
) -> tuple[Point, ...]:
    """Return the waypoints of an expanding square: legs of 1, 1, 2, 2, 3, 3 ... spacings, turning right.

    Parameters
    ----------
    datum : the likeliest place, m, the first waypoint.
    spacing : between legs, m. legs : how many, 1 or more.
    heading : of the first leg, rad from east, anticlockwise.
    area : what lies outside its free area is left out, and no-fly zones are flown around.
    """
    faults = _not_positive("expanding_square", spacing=spacing)
    if legs < 1:
        faults.append(Fault("expanding_square", "legs", f"is {legs}", "Give 1 or more."))
    if faults:
        raise InputError(faults)
    points = [datum]
    for leg in range(legs):
        points.append(_onward(points[-1], spacing * (leg // 2 + 1), heading - leg * math.pi / 2))
    return _clipped(area, points)


def sector(
    datum: Point, radius: float, *, heading: float = 0.0, passes: int = 1, area: Area | None = None
) -> tuple[Point, ...]:
    """Return the waypoints of a sector search: three triangles through the datum, turning right by 120 deg.

    Parameters
    ----------
    datum : the likeliest place, m, the first waypoint; each pass crosses it three times.
    radius : length of every leg, m.
    heading : of the first leg, rad from east, anticlockwise.
    passes : how many times; each is turned right by 30 deg against the one before.
    area : what lies outside its free area is left out, and no-fly zones are flown around.
    """
    faults = _not_positive("sector", radius=radius)
    if passes < 1:
        faults.append(Fault("sector", "passes", f"is {passes}", "Give 1 or more."))
    if faults:
        raise InputError(faults)
    points = [datum]
    for number in range(passes):
        for triangle in range(3):
            # The leg back to the datum goes straight on through it, hence the next sector at +120 deg.
            out = heading - number * math.pi / 6 + triangle * 2 * math.pi / 3
            points.append(_onward(datum, radius, out))
            points.append(_onward(datum, radius, out - math.pi / 3))
            points.append(datum)
    return _clipped(area, points)


def _bands(region: Any, spacing: float, along: float) -> list[list[Track]]:
    """Tracks of every band of a region, band by band, in coordinates turned so that tracks run along x."""
    import shapely
    from shapely.affinity import affine_transform

    cosine, sine = _turn(along)
    turned = affine_transform(region, [cosine, sine, -sine, cosine, 0.0, 0.0])
    west, south, east, north = turned.bounds
    count = max(1, math.ceil((north - south) / spacing - 1e-9))
    if count > MOST_TRACKS:
        why = f"is {spacing:g} m, for {count} tracks"
        raise InputError([Fault("parallel_sweep", "spacing", why, "Give a wider one.")])
    width = (north - south) / count
    bands = []
    for band in range(count):
        low = south + band * width
        # The first and last band reach a little too far, so that rounding leaves no thread uncovered.
        box = shapely.box(west - 1.0, low - (band == 0), east + 1.0, low + width + (band == count - 1))
        bands.append(_tracks(turned.intersection(box), low + width / 2))
    return bands


def _tracks(part: Any, middle: float) -> list[Track]:
    """Tracks over one band: of every slice, the place nearest to the middle, chained from west to east."""
    done: list[Track] = []
    growing: list[tuple[Track, float, float]] = []  # a track, and the slice at its end
    for slab in _slabs(part):
        rest = growing
        growing = []
        for (x0, x1), (low0, low1), (high0, high1) in slab:
            piece = _clamped(x0, x1, low0, low1, high0, high1, middle)
            touching = [
                (abs(track[-1][1] - piece[0][1]), k)
                for k, (track, low, high) in enumerate(rest)
                if abs(track[-1][0] - x0) <= NEAR and low <= high0 + NEAR and high >= low0 - NEAR
            ]
            if touching:
                track = rest.pop(min(touching)[1])[0]
                track.extend(piece)
            else:
                track = piece
            growing.append((track, low1, high1))
        done.extend(track for track, _, _ in rest)
    done.extend(track for track, _, _ in growing)
    tracks = [_straightened(track) for track in done]
    return sorted((track for track in tracks if track), key=lambda track: track[0])


Trapezoid = tuple[tuple[float, float], tuple[float, float], tuple[float, float]]
"""Its west and east end, the lower edge at both, the upper edge at both."""


def _slabs(part: Any) -> list[list[Trapezoid]]:
    """Cut polygons at the x of every corner; between two of them there are only trapezoids."""
    import shapely

    polygons = [polygon for polygon in shapely.get_parts(part).tolist() if polygon.geom_type == "Polygon"]
    rings = [list(ring.coords) for polygon in polygons for ring in (polygon.exterior, *polygon.interiors)]
    # A side across the tracks that leans by rounding alone is no slab for the track to climb along.
    snapped: dict[float, float] = {}
    last = -math.inf
    for x in sorted({x for ring in rings for x, _ in ring}):
        last = x if x - last > NEAR / 10 else last
        snapped[x] = last
    edges: list[tuple[float, float, float, float]] = []
    for ring in rings:
        for (a, ya), (b, yb) in pairwise(ring):
            xa, xb = snapped[a], snapped[b]
            if xa != xb:
                edges.append((xa, ya, xb, yb) if xa < xb else (xb, yb, xa, ya))
    slabs = []
    for x0, x1 in pairwise(sorted(set(snapped.values()))):
        heights = sorted(
            (_height(edge, (x0 + x1) / 2), _height(edge, x0), _height(edge, x1))
            for edge in edges
            if edge[0] <= x0 and edge[2] >= x1
        )
        slabs.append(
            [
                ((x0, x1), (below[1], below[2]), (above[1], above[2]))
                for below, above in zip(heights[::2], heights[1::2], strict=True)
            ]
        )
    return slabs


def _height(edge: tuple[float, float, float, float], x: float) -> float:
    xa, ya, xb, yb = edge
    return yb if x == xb else ya + (yb - ya) * ((x - xa) / (xb - xa))


def _clamped(
    x0: float, x1: float, low0: float, low1: float, high0: float, high1: float, middle: float
) -> Track:
    """The places of a trapezoid's slices that are nearest to the middle: at most four corners."""
    shares = [0.0, 1.0]
    for a, b in ((low0, low1), (high0, high1)):
        if (a - middle) * (b - middle) < 0.0:
            shares.append((middle - a) / (b - a))
    track = []
    for share in sorted(shares):
        low, high = low0 + (low1 - low0) * share, high0 + (high1 - high0) * share
        track.append((x0 + (x1 - x0) * share, min(max(middle, low), max(high, low))))
    return track


def _straightened(track: Track) -> Track:
    """Leave out the corners at which a track does not turn."""
    kept: Track = []
    for point in track:
        if kept and math.dist(kept[-1], point) <= NEAR:
            continue
        if len(kept) > 1 and _straight(kept[-2], kept[-1], point):
            kept.pop()
        kept.append(point)
    return kept


def _straight(a: Point, b: Point, c: Point) -> bool:
    """Tell whether b is on the straight way from a to c."""
    across = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
    onward = (b[0] - a[0]) * (c[0] - b[0]) + (b[1] - a[1]) * (c[1] - b[1])
    return onward > 0.0 and abs(across) <= NEAR * math.dist(a, c)


def _joined(area: Area, bands: list[list[Track]], start: Point | None) -> tuple[Point, ...]:
    """Fly all the tracks, from each to the nearest end of another, around the no-fly zones."""
    tracks = [track for band in bands for track in band]
    if not tracks:
        return ()
    # To begin in the middle would leave one side for a second time.
    outer = [*range(len(bands[0])), *range(len(tracks) - len(bands[-1]), len(tracks))]
    ends = [(k, side) for k in outer or range(len(tracks)) for side in (0, -1)]
    track, side = ends[0] if start is None else _nearest(area, tracks, ends, start)
    left = dict.fromkeys(range(len(tracks)))
    points: list[Point] = []
    while True:
        del left[track]
        leg = tracks[track] if side == 0 else tracks[track][::-1]
        if points:
            points.extend(area.route(points[-1], leg[0]))
        points.extend(leg[1:] if points else leg)
        if not left:
            return tuple(_straightened(points))
        track, side = _nearest(area, tracks, ((k, end) for k in left for end in (0, -1)), points[-1])


def _nearest(
    area: Area, tracks: Sequence[Track], ends: Iterable[tuple[int, int]], point: Point
) -> tuple[int, int]:
    """Return the end of a track that is nearest to fly to; the first one of equals."""
    order = sorted((math.dist(point, tracks[k][side]), k, -side) for k, side in ends)
    best, chosen = math.inf, (order[0][1], -order[0][2])
    for straight, k, side in order:
        if straight >= best - NEAR:  # no way is shorter than the straight one
            break
        end = tracks[k][-side]
        way = length_of((point, *area.route(point, end)))
        if way < best - NEAR:
            best, chosen = way, (k, -side)
    return chosen


def _clipped(area: Area | None, points: list[Point]) -> tuple[Point, ...]:
    """Keep of a way what is in the free area, and join the pieces by the shortest ways."""
    if area is None:
        return tuple(points)
    import shapely

    way: list[Point] = []
    for a, b in pairwise(points):
        kept = shapely.LineString((a, b)).intersection(area.polygon)
        pieces = [
            sorted(((float(x), float(y)) for x, y in piece.coords), key=lambda p: math.dist(a, p))
            for piece in shapely.get_parts(kept).tolist()
            if piece.geom_type == "LineString" and piece.length > NEAR
        ]
        for piece in sorted(pieces, key=lambda piece: math.dist(a, piece[0])):
            if not way:
                way.append(piece[0])
            elif math.dist(way[-1], piece[0]) > NEAR:
                way.extend(area.route(way[-1], piece[0]))
            way.append(piece[-1])
    return tuple(way)


def _polygon(within: Any) -> Any:
    """A searcher's share as a valid polygon."""
    import shapely

    if hasattr(within, "geom_type"):
        return within
    parts = [shapely.Polygon(ring) for ring in within]
    if not all(part.is_valid for part in parts):
        raise InputError(
            [Fault("parallel_sweep", "within", "holds no simple polygon", "Give corners in order.")]
        )
    return shapely.union_all(parts)


def _longer_side(region: Any) -> float:
    """Direction of the longer side of the least rectangle around a region, rad, from 0 to less than pi."""
    import shapely

    corners = shapely.get_coordinates(shapely.oriented_envelope(region)).tolist()
    sides = [(math.dist(a, b), math.atan2(b[1] - a[1], b[0] - a[0]) % math.pi) for a, b in pairwise(corners)]
    longest = max(side for side, _ in sides)
    # Of a square, both sides are the longest: take the one nearer to east, whatever the last bit says.
    angles = [angle for side, angle in sides if side >= longest * (1.0 - 1e-9)]
    angle = min(angles, key=lambda angle: min(angle, math.pi - angle))
    return 0.0 if math.pi - angle < 1e-12 else angle


def _turn(angle: float) -> tuple[float, float]:
    """Cosine and sine, exact along the axes."""
    quarter = round(angle / (math.pi / 2))
    if abs(angle - quarter * (math.pi / 2)) < 1e-12:
        return ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))[quarter % 4]
    return math.cos(angle), math.sin(angle)


def _rotate(point: Point, cosine: float, sine: float) -> Point:
    """Turn a point clockwise about the origin."""
    return point[0] * cosine + point[1] * sine, point[1] * cosine - point[0] * sine


def _onward(point: Point, distance: float, heading: float) -> Point:
    cosine, sine = _turn(heading)
    return point[0] + distance * cosine, point[1] + distance * sine


def _not_positive(where: str, **values: float) -> list[Fault]:
    return [
        Fault(where, name, f"is {value}", "Give more than 0 m.")
        for name, value in values.items()
        if not 0.0 < value < math.inf
    ]
