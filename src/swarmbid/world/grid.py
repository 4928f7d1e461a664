"""The area cut into square cells, for beliefs and for dividing the search."""

from __future__ import annotations

import math
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from swarmbid.arrays import FloatArray
from swarmbid.errors import Fault, InputError

LARGEST_GRID = 4_000_000
"""Most cells; a grid beyond it is a mistyped unit."""


class Region(Protocol):
    """What a grid asks of an area."""

    @property
    def bounds(self) -> tuple[float, float, float, float]:
        """West, south, east and north end, m."""

    def contains(self, x: Any, y: Any) -> Any:
        """Tell which points are in the free area."""


class Grid:
    """Square cells that cover an area.

    Parameters
    ----------
    area : where; its exclusions are masked out.
    cell : side of a cell, m.

    Attributes
    ----------
    shape : (rows, cols); row 0 is the southernmost. cell, west, south : m.
    mask : bool[rows, cols], the cell's centre is in the free area. cells : how many of them.
    x : float64[cols], y : float64[rows], centres, m.
    """

    def __init__(self, area: Region, cell: float) -> None:
        if not 0.0 < cell < math.inf:
            raise InputError([Fault("grid", "cell", f"is {cell}", "Give more than 0 m.")])
        west, south, east, north = area.bounds
        # What is left over by rounding (30.000000000000004 cells) is no cell of its own.
        cols = max(1, math.ceil((east - west) / cell - 1e-9))
        rows = max(1, math.ceil((north - south) / cell - 1e-9))
        if rows * cols > LARGEST_GRID:
            raise InputError(
                [Fault("grid", "cell", f"is {cell:g}, for {rows} x {cols} cells", "Give larger cells.")]
            )
        self.shape = (rows, cols)
        self.cell = float(cell)
        self.west, self.south = float(west), float(south)
        self.x: FloatArray = self.west + (np.arange(cols, dtype=np.float64) + 0.5) * self.cell
        self.y: FloatArray = self.south + (np.arange(rows, dtype=np.float64) + 0.5) * self.cell
        xs, ys = np.meshgrid(self.x, self.y)
        inside = np.asarray(area.contains(xs.ravel(), ys.ravel()), dtype=np.bool_)
        self.mask: NDArray[np.bool_] = inside.reshape(self.shape)
        self.cells = int(self.mask.sum())
        if self.cells == 0:
            raise InputError(
                [Fault("grid", "cell", f"is {cell:g}, and no cell's centre is free", "Give smaller cells.")]
            )

    def cell_of(self, x: float, y: float) -> tuple[int, int]:
        """Return (row, col) of the cell at a place; the nearest one for places outside."""
        rows, cols = self.shape
        row = math.floor((y - self.south) / self.cell)
        col = math.floor((x - self.west) / self.cell)
        return min(max(row, 0), rows - 1), min(max(col, 0), cols - 1)

    def outline(self, share: NDArray[np.bool_]) -> Any:
        """Return the union of some cells, bool[rows, cols]: a shapely polygon, or several."""
        import shapely

        boxes = []
        for row, cells in enumerate(np.asarray(share, dtype=np.bool_)):
            # Runs of neighbours at once: a share has far fewer of them than cells.
            edges = np.flatnonzero(np.diff(np.concatenate(([False], cells, [False])).astype(np.int8)))
            for first, end in edges.reshape(-1, 2).tolist():
                west, south = self.west + first * self.cell, self.south + row * self.cell
                boxes.append(
                    shapely.box(west, south, self.west + end * self.cell, self.south + (row + 1) * self.cell)
                )
        return shapely.union_all(boxes).simplify(0.0)
