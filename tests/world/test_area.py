"""Areas: what is free, what is seen, and the shortest ways around."""

import itertools
import math
import pickle

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from swarmbid.errors import InputError
from swarmbid.world.area import MOST_REMEMBERED, Area
from swarmbid.world.area import length_of as length

BLOCK = ((40.0, 40.0), (60.0, 40.0), (60.0, 60.0), (40.0, 60.0))
HOLED = Area.square(100.0, [BLOCK])
L_SHAPE = Area(((0, 0), (100, 0), (100, 50), (50, 50), (50, 100), (0, 100)))


def test_free_area_is_what_the_exclusions_leave() -> None:
    assert HOLED.size == 100.0 * 100.0 - 20.0 * 20.0
    assert HOLED.bounds == (0.0, 0.0, 100.0, 100.0)
    assert HOLED.contains([10.0, 50.0, 110.0], [10.0, 50.0, 10.0]).tolist() == [True, False, False]
    assert HOLED.contains(np.full((2, 3), 5.0), np.full((2, 3), 5.0)).shape == (2, 3)


def test_border_is_free() -> None:
    for point in ((0.0, 0.0), (100.0, 33.0), (40.0, 50.0), (60.0, 60.0)):
        assert HOLED.inside(point)
    assert HOLED.clear((0.0, 40.0), (100.0, 40.0))  # along the side of the block
    assert HOLED.clear((0.0, 0.0), (100.0, 0.0))  # along the boundary
    assert not HOLED.clear((0.0, 40.001), (100.0, 40.001))
    assert not L_SHAPE.clear((90.0, 40.0), (40.0, 95.0))


def test_convex_area_answers_as_any_other() -> None:
    area = Area.square(10.0)
    assert area.clear((0.0, 0.0), (10.0, 10.0))
    assert not area.clear((0.0, 0.0), (10.1, 10.0))
    assert area.route((1.0, 1.0), (9.0, 2.0)) == ((9.0, 2.0),)


def test_either_order_of_corners_and_a_repeated_last_one_are_the_same_place() -> None:
    turned = Area.square(100.0, [BLOCK[::-1] + BLOCK[-1:]])
    assert turned.size == HOLED.size
    assert turned.route((0.0, 50.0), (100.0, 50.0)) == HOLED.route((0.0, 50.0), (100.0, 50.0))


def test_route_turns_at_the_corners_of_the_block() -> None:
    # Straight through the middle is barred: 2 * sqrt(40^2 + 10^2) + 20 along one side.
    way = HOLED.route((0.0, 50.0), (100.0, 50.0))
    assert way in (((40.0, 40.0), (60.0, 40.0), (100.0, 50.0)), ((40.0, 60.0), (60.0, 60.0), (100.0, 50.0)))
    assert length(((0.0, 50.0), *way)) == pytest.approx(2 * math.hypot(40, 10) + 20)


def test_route_turns_at_a_reflex_corner_of_the_boundary() -> None:
    assert L_SHAPE.route((90.0, 40.0), (40.0, 95.0)) == ((50.0, 50.0), (40.0, 95.0))


def test_route_from_a_corner_or_along_a_side_repeats_no_point() -> None:
    assert HOLED.route((40.0, 40.0), (60.0, 60.0)) in (
        ((60.0, 40.0), (60.0, 60.0)),
        ((40.0, 60.0), (60.0, 60.0)),
    )
    assert HOLED.route((5.0, 5.0), (5.0, 5.0)) == ((5.0, 5.0),)


def test_ends_outside_are_joined_by_the_nearest_free_place() -> None:
    assert HOLED.nearest((-3.0, 20.0)) == (0.0, 20.0)
    assert HOLED.nearest((42.0, 50.0)) == (40.0, 50.0)
    assert HOLED.nearest((7.0, 8.0)) == (7.0, 8.0)
    # A base need not lie in the search area; a place in the block is reached by its nearest side.
    assert HOLED.route((30.0, 20.0), (104.0, 20.0)) == ((104.0, 20.0),)
    assert HOLED.route((70.0, 20.0), (58.0, 50.0)) == ((60.0, 50.0), (58.0, 50.0))
    assert HOLED.route((42.0, 50.0), (41.0, 50.0)) == ((40.0, 50.0), (41.0, 50.0))
    assert HOLED.route((60.0, 50.0), (58.0, 50.0)) == ((58.0, 50.0),)
    assert L_SHAPE.route((90.0, 40.0), (90.0, 90.0)) == ((90.0, 90.0),)


def test_who_is_outside_comes_back_on_the_way_and_does_not_leave_again() -> None:
    """The arc of a turn ends outside; the nearest place, beside it, a fixed wing would chase for ever."""
    assert HOLED.route((20.0, -5.0), (80.0, 10.0)) == ((80.0, 10.0),)
    # Out of the block: straight, or by a corner, never deeper into it, and never out at its other side.
    assert HOLED.route((42.0, 45.0), (10.0, 50.0)) == ((10.0, 50.0),)
    assert HOLED.route((42.0, 45.0), (90.0, 50.0)) == ((40.0, 40.0), (60.0, 40.0), (90.0, 50.0))
    # Behind the block, by its corner; the line from outside to the corner is free as well.
    assert HOLED.route((50.0, -5.0), (60.0, 70.0)) == ((60.0, 40.0), (60.0, 70.0))
    # Just outside the notch of the L: around its corner, never straight across what is not searched.
    assert L_SHAPE.route((90.0, 50.5), (40.0, 95.0)) == ((50.0, 50.0), (40.0, 95.0))
    assert L_SHAPE.route((90.0, 52.0), (90.0, 10.0)) == ((90.0, 10.0),)
    # A line that would leave the area again is not taken.
    nicked = Area(((0, 0), (100, 0), (100, 50), (56, 50), (55, 47), (54, 50), (0, 50)))
    assert nicked.route((20.0, 70.0), (60.0, 45.0)) == ((20.0, 50.0), (60.0, 45.0))
    # Nor one through a zone that lies at the boundary.
    docked = Area.square(100.0, [((40.0, -10.0), (60.0, -10.0), (60.0, 40.0), (40.0, 40.0))])
    way = docked.route((39.0, -1.0), (70.0, 30.0))
    assert way == ((39.0, 0.0), (40.0, 40.0), (60.0, 40.0), (70.0, 30.0))


blocks = st.lists(
    st.tuples(st.integers(5, 75), st.integers(5, 75), st.integers(3, 18), st.integers(3, 18)),
    min_size=1,
    max_size=6,
)
places = st.tuples(st.integers(0, 100), st.integers(0, 100))


def _boxes(sizes: list[tuple[int, int, int, int]]) -> list[tuple[float, float, float, float]]:
    return [(x, y, x + w, y + h) for x, y, w, h in sizes]


def _naive_clear(a, b, boxes) -> bool:
    """No box's inside is crossed: clip the segment to each open box (Liang and Barsky)."""
    for west, south, east, north in boxes:
        low, high = 0.0, 1.0
        for start, step, near, far in (
            (a[0], b[0] - a[0], west, east),
            (a[1], b[1] - a[1], south, north),
        ):
            if step == 0:
                if not near < start < far:
                    low, high = 1.0, 0.0
                continue
            ends = sorted(((near - start) / step, (far - start) / step))
            low, high = max(low, ends[0]), min(high, ends[1])
        if high - low > 1e-9:
            return False
    return True


def _naive_distance(a, b, boxes) -> float:
    """Floyd and Warshall over every corner of every box."""
    corners = [(x, y) for w, s, e, n in boxes for x in (w, e) for y in (s, n)]
    nodes = [a, b, *corners]
    far = [[math.dist(p, q) if _naive_clear(p, q, boxes) else math.inf for q in nodes] for p in nodes]
    for via, i, j in itertools.product(range(len(nodes)), repeat=3):
        far[i][j] = min(far[i][j], far[i][via] + far[via][j])
    return far[0][1]


@settings(max_examples=60, deadline=None)
@given(blocks, places, places)
@example(
    [(14, 35, 2, 56), (78, 15, 5, 59), (22, 1, 5, 25), (45, 76, 5, 19), (50.5, 47, 2, 28)], (0, 89), (100, 37)
)
def test_route_is_as_short_as_the_naive_twin_and_stays_free(sizes, a, b) -> None:
    boxes = _boxes(sizes)
    rings = [((w, s), (e, s), (e, n), (w, n)) for w, s, e, n in boxes]
    try:
        area = Area.square(100.0, rings)
    except InputError:  # boxes that touch may close a yard between them
        return
    for point in (a, b):
        if any(w < point[0] < e and s < point[1] < n for w, s, e, n in boxes):
            return
    way = (a, *area.route(a, b))
    assert way[-1] == b
    assert all(area.clear(p, q) for p, q in itertools.pairwise(way))
    # Places on sides that two boxes share are free to the twin, though no way leads there.
    assert length(way) >= _naive_distance(a, b, boxes) - 1e-6
    if all(_apart(p, q) for p, q in itertools.combinations(boxes, 2)):
        assert length(way) == pytest.approx(_naive_distance(a, b, boxes), abs=1e-4)
        assert length((b, *area.route(b, a))) == pytest.approx(length(way), abs=1e-4)


def _apart(p, q) -> bool:
    return p[2] < q[0] or q[2] < p[0] or p[3] < q[1] or q[3] < p[1]


def test_many_goals_are_forgotten_without_changing_a_way() -> None:
    area = Area.square(100.0, [BLOCK])
    before = area.route((0.0, 50.0), (110.0, 50.0))
    for k in range(MOST_REMEMBERED + 10):
        area.route((0.0, 50.0), (110.0, 40.5 + k / 20))
    assert len(area._stretched) <= MOST_REMEMBERED
    assert area.route((0.0, 50.0), (110.0, 50.0)) == before


def test_trace_form_and_pickle_bring_the_same_area_back() -> None:
    HOLED.route((0.0, 50.0), (100.0, 50.0))
    for again in (Area.from_dict(HOLED.to_dict()), pickle.loads(pickle.dumps(HOLED))):
        assert again == HOLED
        assert hash(again) == hash(HOLED)
        assert again.route((0.0, 50.0), (100.0, 50.0)) == HOLED.route((0.0, 50.0), (100.0, 50.0))


@pytest.mark.parametrize(
    ("boundary", "exclusions", "why"),
    [
        (((0, 0), (1, 0)), (), "boundary: is ((0, 0), (1, 0)). Give at least three corners"),
        (((0, 0), (1, 1), (1, 0), (0, 1)), (), "boundary: Self-intersection"),
        (((0, 0), (1, 0), (2, 0)), (), "so that no edge crosses another"),
        (((0, 0), (1, 0), (math.nan, 1)), (), "each (east, north) in m"),
        ("area", (), "boundary: is 'area'. Give at least three corners"),
        (BLOCK, (((30, 30), (70, 30), (70, 70), (30, 70)),), "leave no free area"),
        (BLOCK, (((49, 30), (51, 30), (51, 70), (49, 70)),), "into 2 parts"),
    ],
)
def test_faults(boundary, exclusions, why) -> None:
    with pytest.raises(InputError) as error:
        Area(boundary, exclusions)
    assert why in str(error.value)


def test_all_faults_at_once() -> None:
    with pytest.raises(InputError) as error:
        Area(((0, 0),), (((0, 0),), BLOCK))
    assert [fault.field for fault in error.value.faults] == ["boundary", "exclusions[0]"]
    with pytest.raises(InputError):
        Area.square(0.0)
