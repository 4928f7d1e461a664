"""Search patterns: what they cover, where they fly, how long they are."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from swarmbid.errors import InputError
from swarmbid.world.area import Area
from swarmbid.world.area import length_of as length
from swarmbid.world.grid import Grid
from swarmbid.world.patterns import creeping_line, expanding_square, parallel_sweep, sector

BLOCK = ((40.0, 40.0), (60.0, 40.0), (60.0, 60.0), (40.0, 60.0))
HOLED = Area(((0.0, 0.0), (100.0, 0.0), (100.0, 100.0), (0.0, 100.0)), (BLOCK,))


def furthest(area: Area, way, within=None, step: float = 1.0) -> float:
    """How far the worst place of a lattice over the searched part is from the way: the naive twin."""
    import shapely

    west, south, east, north = area.bounds
    x, y = np.meshgrid(np.arange(west, east + step / 2, step), np.arange(south, north + step / 2, step))
    free = shapely.intersects_xy(area.polygon if within is None else area.polygon & within, x, y)
    x, y = x[free], y[free]
    nearest = np.full(x.shape, np.inf)
    for a, b in itertools.pairwise(way):
        across = np.array(b) - np.array(a)
        share = ((x - a[0]) * across[0] + (y - a[1]) * across[1]) / max(across @ across, 1e-30)
        share = np.clip(share, 0.0, 1.0)
        nearest = np.minimum(nearest, np.hypot(x - a[0] - share * across[0], y - a[1] - share * across[1]))
    return float(nearest.max())


def flies_free(area: Area, way) -> bool:
    return all(area.clear(a, b) for a, b in itertools.pairwise(way))


def test_sweep_of_a_rectangle_is_the_lawn_mower() -> None:
    area = Area(((0, 0), (40, 0), (40, 30), (0, 30)))
    assert parallel_sweep(area, 10.0) == ((0, 5), (40, 5), (40, 15), (0, 15), (0, 25), (40, 25))
    # 30 m in tracks of at most 14 m: three of 10 m, rather than two and a rest.
    assert parallel_sweep(area, 14.0) == parallel_sweep(area, 10.0)
    assert parallel_sweep(area, 20.0, heading=math.pi / 2) == ((30, 0), (30, 30), (10, 30), (10, 0))


def test_tracks_run_along_the_longer_side_of_a_turned_rectangle() -> None:
    turn = math.radians(30)
    corners = [(0, 0), (100, 0), (100, 20), (0, 20)]
    cosine, sine = math.cos(turn), math.sin(turn)
    area = Area(tuple((x * cosine - y * sine, x * sine + y * cosine) for x, y in corners))
    way = parallel_sweep(area, 10.0)
    assert len(way) == 4
    assert length(way) == pytest.approx(2 * 100 + 10)
    assert math.atan2(way[1][1] - way[0][1], way[1][0] - way[0][0]) % math.pi == pytest.approx(turn)


@pytest.mark.parametrize(
    ("start", "first"),
    [((-5, 0), (0, 5)), ((50, 0), (40, 5)), ((50, 40), (40, 25)), ((0, 31), (0, 25)), (None, (0, 5))],
)
def test_sweep_begins_at_the_nearer_end(start, first) -> None:
    area = Area(((0, 0), (40, 0), (40, 30), (0, 30)))
    assert parallel_sweep(area, 10.0, start=start)[0] == first


def test_creeping_line_is_across() -> None:
    area = Area(((0, 0), (40, 0), (40, 30), (0, 30)))
    assert creeping_line(area, 20.0) == ((30, 0), (30, 30), (10, 30), (10, 0))
    assert creeping_line(area, 10.0, heading=math.pi / 2, start=(40, 0))[0] == (40, 5)


def test_sweep_covers_around_a_no_fly_zone() -> None:
    way = parallel_sweep(HOLED, 8.0)
    assert flies_free(HOLED, way)
    assert furthest(HOLED, way) <= 4.0 + 1e-6
    # Each side of the block is swept for itself, not in turns across it: less than a quarter is added.
    assert length(way) <= 1.25 * HOLED.size / 8.0 + 100.0


def test_track_follows_a_border_at_a_flat_angle() -> None:
    # Tracks cut off straight where they meet the slope (1 in 10) would leave slivers of 5 m x 50 m.
    area = Area(((0, 0), (200, 0), (200, 20)))
    way = parallel_sweep(area, 10.0, heading=0.0)
    assert flies_free(area, way)
    assert furthest(area, way, step=0.5) <= 5.0 + 1e-6


coordinate = st.integers(0, 60)


@st.composite
def star(draw, corners: int = 9) -> tuple[tuple[float, float], ...]:
    """A polygon seen whole from its centre, convex or not."""
    radii = draw(st.lists(st.integers(10, 50), min_size=4, max_size=corners))
    return tuple(
        (50 + r * math.cos(2 * math.pi * k / len(radii)), 50 + r * math.sin(2 * math.pi * k / len(radii)))
        for k, r in enumerate(radii)
    )


@settings(max_examples=60, deadline=None)
@given(
    star(),
    st.lists(st.tuples(coordinate, coordinate, st.integers(2, 25), st.integers(2, 25)), max_size=3),
    st.floats(3.0, 40.0),
    st.floats(-4.0, 4.0) | st.none(),
)
def test_every_free_place_is_within_half_a_spacing(boundary, boxes, spacing, heading) -> None:
    rings = tuple(((x, y), (x + w, y), (x + w, y + h), (x, y + h)) for x, y, w, h in boxes)
    try:
        area = Area(boundary, rings)
    except InputError:  # nothing or several parts left
        return
    way = parallel_sweep(area, spacing, heading=heading)
    assert flies_free(area, way)
    assert furthest(area, way) <= spacing / 2 + 1e-5


def test_a_share_is_covered_and_only_the_share() -> None:
    import shapely

    grid = Grid(HOLED, 5.0)
    share = grid.mask & (grid.x[None, :] + grid.y[:, None] < 90.0)
    within = grid.outline(share)
    assert within.area == pytest.approx(share.sum() * 25.0)
    way = parallel_sweep(HOLED, 10.0, within=within)
    assert flies_free(HOLED, way)
    assert furthest(HOLED, way, within) <= 5.0 + 1e-6
    assert within.buffer(1e-6).covers(shapely.MultiPoint(way))
    rings = [[(0, 0), (20, 0), (20, 20), (0, 20)]]
    assert parallel_sweep(HOLED, 10.0, within=rings) == ((0, 5), (20, 5), (20, 15), (0, 15))


def test_two_shares_apart_are_joined_through_the_free_area() -> None:
    rings = [[(0, 40), (30, 40), (30, 60), (0, 60)], [(70, 40), (100, 40), (100, 60), (70, 60)]]
    way = parallel_sweep(HOLED, 10.0, within=rings, heading=0.0)
    assert flies_free(HOLED, way)
    assert len(way) == 8 + 2 or len(way) == 8 + 1  # round one or two corners of the block
    # One share after the other: the gap of 40 m is crossed once.
    assert sum((a[0] < 50) != (b[0] < 50) for a, b in itertools.pairwise(way)) == 1


def test_nothing_to_search() -> None:
    inside_block = [[(45, 45), (55, 45), (55, 55), (45, 55)]]
    assert parallel_sweep(HOLED, 5.0, within=inside_block) == ()
    assert creeping_line(HOLED, 5.0, within=inside_block) == ()
    assert parallel_sweep(HOLED, 5.0, within=[]) == ()


def test_expanding_square_of_iamsar() -> None:
    # IAMSAR volume II, 5.5.3: the first two legs one spacing, every two legs one more, turning right.
    way = expanding_square((0.0, 0.0), 10.0, 6, heading=math.pi / 2)
    assert way == ((0, 0), (0, 10), (10, 10), (10, -10), (-10, -10), (-10, 20), (20, 20))
    legs = [math.dist(a, b) for a, b in itertools.pairwise(expanding_square((3, 4), 5.0, 9, heading=0.3))]
    assert legs == pytest.approx([5, 5, 10, 10, 15, 15, 20, 20, 25])


def test_expanding_square_covers_around_the_datum() -> None:
    area = Area(((-25, -25), (25, -25), (25, 25), (-25, 25)))
    # Within the legs of a round no place is more than half a spacing off, but for the corners: 5 * sqrt(2).
    way = expanding_square((0.0, 0.0), 10.0, 13)
    assert furthest(area, way) <= 5.0 * math.sqrt(2) + 1e-9


def test_sector_search_of_iamsar() -> None:
    # IAMSAR volume II, 5.5.4: nine legs of one radius, turns of 120 deg to the right, three times
    # through the datum, straight on.
    way = sector((10.0, 20.0), 50.0, heading=math.pi / 2)
    assert [math.dist(a, b) for a, b in itertools.pairwise(way)] == pytest.approx([50.0] * 9)
    assert [way[k] for k in (0, 3, 6, 9)] == [(10.0, 20.0)] * 4
    courses = [math.atan2(b[1] - a[1], b[0] - a[0]) for a, b in itertools.pairwise(way)]
    turns = [math.degrees(a - b) % 360 for a, b in itertools.pairwise(courses)]
    assert [round(turn) % 360 for turn in turns] == [120, 120, 0, 120, 120, 0, 120, 120]
    second = sector((10.0, 20.0), 50.0, heading=math.pi / 2, passes=2)
    assert len(second) == 19
    assert math.atan2(second[10][1] - 20, second[10][0] - 10) == pytest.approx(math.radians(60))


@pytest.mark.parametrize(
    "way",
    [
        expanding_square((50.0, 30.0), 9.0, 14, area=HOLED),
        sector((30.0, 30.0), 60.0, passes=2, area=HOLED),
        expanding_square((50.0, 50.0), 15.0, 9, area=HOLED),
    ],
)
def test_patterns_around_a_datum_stay_in_the_free_area(way) -> None:
    assert len(way) > 6
    assert flies_free(HOLED, way)


def test_datum_pattern_outside_the_area_is_empty() -> None:
    assert expanding_square((500.0, 500.0), 5.0, 4, area=HOLED) == ()


@pytest.mark.parametrize(
    "call",
    [
        lambda: parallel_sweep(HOLED, 0.0),
        lambda: parallel_sweep(HOLED, math.nan),
        lambda: parallel_sweep(HOLED, 1e-4),
        lambda: parallel_sweep(HOLED, 5.0, within=[[(0, 0), (9, 9), (9, 0), (0, 9)]]),
        lambda: sector((0, 0), -1.0),
        lambda: sector((0, 0), 1.0, passes=0),
    ],
)
def test_faults(call) -> None:
    with pytest.raises(InputError):
        call()


def test_both_faults_of_an_expanding_square() -> None:
    with pytest.raises(InputError) as error:
        expanding_square((0, 0), math.inf, 0)
    assert [fault.field for fault in error.value.faults] == ["spacing", "legs"]
