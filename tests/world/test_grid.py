"""The grid: cells, mask, places."""

from __future__ import annotations

import pytest
from tests.world.test_belief import Box

from swarmbid.errors import InputError
from swarmbid.world.grid import Grid


def test_cells_centres_and_mask():
    grid = Grid(Box(100.0, 40.0, (20.0, 0.0, 40.0, 20.0)), 10.0)
    assert grid.shape == (4, 10) and grid.cells == 36
    assert grid.x[:2].tolist() == [5.0, 15.0] and grid.y[-1] == 35.0
    assert not grid.mask[:2, 2:4].any()


def test_cell_of_agrees_with_the_centres_and_clamps():
    grid = Grid(Box(95.0, 40.0), 10.0)
    assert grid.shape == (4, 10)
    for row, y in enumerate(grid.y):
        for col, x in enumerate(grid.x):
            assert grid.cell_of(x, y) == (row, col)
    assert grid.cell_of(-5.0, 1e6) == (3, 0)


def test_rounding_makes_no_cell():
    assert Grid(Box(0.1 + 0.2, 1.0), 0.1).shape == (10, 3)


@pytest.mark.parametrize("cell", [0.0, -1.0, float("nan"), 1e-4])
def test_bad_cells_are_refused(cell):
    with pytest.raises(InputError):
        Grid(Box(100.0, 100.0), cell)
