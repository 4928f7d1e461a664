"""Division of the search: fair, whole, compact, and the same whoever computes it."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.ndimage import label

from swarmbid.errors import InputError
from swarmbid.rng import stream
from swarmbid.world.area import Area
from swarmbid.world.division import divide
from swarmbid.world.grid import Grid

BLOCK = ((40.0, 40.0), (60.0, 40.0), (60.0, 60.0), (40.0, 60.0))
OPEN = Grid(Area.square(100.0), 5.0)
HOLED = Grid(Area.square(100.0, [BLOCK]), 5.0)


def test_two_searchers_get_a_half_each_on_their_own_side() -> None:
    grid = Grid(Area(((0, 0), (80, 0), (80, 40), (0, 40))), 10.0)
    owner = divide(grid, 1.0, [(70.0, 20.0), (10.0, 20.0)])
    assert owner.dtype == np.int64
    assert owner.tolist() == [[1] * 4 + [0] * 4] * 4


def test_weights_move_the_cut() -> None:
    grid = Grid(Area(((0, 0), (80, 0), (80, 10), (0, 10))), 10.0)
    assert divide(grid, [[5, 1, 1, 1, 1, 1, 0, 0]], [(0, 5), (80, 5)]).tolist() == [[0, 1, 1, 1, 1, 1, 1, 1]]


def test_masked_cells_are_nobodys() -> None:
    owner = divide(HOLED, 1.0, [(0, 0), (100, 100), (0, 100)])
    assert ((owner == -1) == ~HOLED.mask).all()


@settings(max_examples=60, deadline=None)
@given(st.integers(1, 25), st.integers(0, 10_000), st.booleans())
def test_everybody_gets_a_fair_share(count, seed, holed) -> None:
    grid = HOLED if holed else OPEN
    rng = stream(seed, "division")
    weights = rng.random(grid.shape)
    owner = divide(grid, weights, [tuple(place) for place in rng.uniform(0, 100, (count, 2)).tolist()])
    shares = np.array([weights[owner == k].sum() for k in range(count)])
    assert (owner[grid.mask] >= 0).all()
    fair = weights[grid.mask].sum() / count
    # A halving misses by at most half a cell; the miss is passed on to the parts in proportion, so
    # log2(count) halvings, rounded up, miss by no more than as many half cells.
    assert np.abs(shares - fair).max() <= 0.5 * math.ceil(math.log2(count)) * weights.max() + 1e-9


@pytest.mark.parametrize("count", [2, 3, 5, 8, 13])
def test_regions_of_an_open_area_are_connected_and_compact(count) -> None:
    owner = divide(OPEN, 1.0, [(5.0 * k, 50.0) for k in range(count)])
    for k in range(count):
        region = owner == k
        assert label(region)[1] == 1
        rows, cols = np.nonzero(region)
        box = (np.ptp(rows) + 1) * (np.ptp(cols) + 1)
        # A rectangle of whole rows or columns, and one begun on each side.
        assert region.sum() >= 0.6 * box
        assert max(np.ptp(rows) + 1, np.ptp(cols) + 1) <= 3.5 * min(np.ptp(rows) + 1, np.ptp(cols) + 1)


def test_a_cut_that_tears_nothing_apart_is_preferred() -> None:
    # A U whose arms lie across the longer side: cut along it, the upper half would be two arms.
    area = Area(((0, 0), (60, 0), (60, 80), (40, 80), (40, 10), (20, 10), (20, 80), (0, 80)))
    owner = divide(Grid(area, 5.0), 1.0, [(10, 80), (50, 80)])
    assert [label(owner == k)[1] for k in (0, 1)] == [1, 1]


@settings(max_examples=40, deadline=None)
@given(st.permutations(range(6)), st.integers(0, 1000))
def test_order_of_the_searchers_does_not_matter(order, seed) -> None:
    rng = stream(seed, "order")
    weights = rng.random(OPEN.shape)
    places = [tuple(place) for place in rng.integers(0, 4, (6, 2)).astype(float).tolist()]
    places = [(x + k / 64, y) for k, (x, y) in enumerate(places)]
    owner = divide(OPEN, weights, places)
    other = divide(OPEN, weights, [places[k] for k in order])
    assert (np.array(order)[other] == owner).all()


def test_searchers_at_one_base_still_get_a_region_each() -> None:
    owner = divide(OPEN, 1.0, [(0.0, 0.0)] * 4)
    assert [int((owner == k).sum()) for k in range(4)] == [100] * 4
    assert (owner == divide(OPEN, 1.0, [(0.0, 0.0)] * 4)).all()


def test_the_way_to_the_regions_is_least() -> None:
    """Naive twin: try every assignment."""
    for seed in range(5):
        places = [tuple(p) for p in stream(seed, "match").uniform(0, 100, (5, 2)).tolist()]
        owner = divide(OPEN, 1.0, places)
        centres = []
        for k in range(5):
            rows, cols = np.nonzero(owner == k)
            centres.append((OPEN.x[cols].mean(), OPEN.y[rows].mean()))
        best = min(
            sum(math.dist(places[k], centres[c]) for k, c in enumerate(order))
            for order in itertools.permutations(range(5))
        )
        assert sum(map(math.dist, places, centres)) == pytest.approx(best)


def test_all_the_weight_in_one_cell_still_gives_everybody_a_cell() -> None:
    weights = np.zeros(OPEN.shape)
    weights[0, 0] = 1.0
    owner = divide(OPEN, weights, [(10.0 * k, 0.0) for k in range(7)])
    assert sorted(set(owner.ravel().tolist())) == list(range(7))
    assert (divide(OPEN, 0.0, [(0, 0), (9, 9)]) == divide(OPEN, 1.0, [(0, 0), (9, 9)])).all()


def test_more_searchers_than_cells_and_none() -> None:
    grid = Grid(Area.square(20.0), 10.0)
    owner = divide(grid, 1.0, [(float(k), 0.0) for k in range(9)])
    assert len(set(owner.ravel().tolist())) == 4
    assert divide(grid, 1.0, []).tolist() == [[-1, -1], [-1, -1]]


@pytest.mark.parametrize("weights", [np.ones((2, 3)), -1.0, math.nan, math.inf])
def test_faults(weights) -> None:
    with pytest.raises(InputError):
        divide(OPEN, weights, [(0, 0)])


def test_outline_is_the_union_of_the_cells() -> None:
    share = np.zeros(OPEN.shape, dtype=bool)
    share[0, :3] = share[1, 1] = True
    share[5, 5] = True
    outline = OPEN.outline(share)
    assert outline.area == 5 * 25.0
    assert outline.bounds == (0.0, 0.0, 30.0, 30.0)
    assert len(outline.geoms) == 2
    assert OPEN.outline(np.zeros(OPEN.shape, dtype=bool)).is_empty
    assert OPEN.outline(HOLED.mask).area == 100.0 * 100.0 - 400.0
