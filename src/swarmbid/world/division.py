"""Who searches where: a grid cut into compact regions of equal weight, one for each searcher.

Recursive bisection: the cells are cut across their longer side so that each part weighs what its
searchers should get, until every part has one; a cut the other way is taken if it leaves fewer pieces.
Then each searcher takes a near region, so that the sum of distances is least. When a searcher leaves or
comes back, everybody divides again and, from the same grid, weights and positions, gets the same regions.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from swarmbid.arrays import FloatArray, RowArray
from swarmbid.errors import Fault, InputError
from swarmbid.world.grid import Grid

OUTSIDE = -1


def divide(
    grid: Grid, weights: ArrayLike, searchers: ArrayLike, shares: Sequence[float] | None = None
) -> RowArray:
    """Return which searcher each cell belongs to, int64[rows, cols]; `OUTSIDE` where nothing is free.

    Each cut is off by at most half the weight of a cell. Searchers in another order get the same regions,
    if no two have the same place. Of more searchers than cells, those with the largest shares, then the
    nearest ones, get a cell each and the rest none; without searchers nobody owns anything.

    Parameters
    ----------
    weights : float64[rows, cols] or one number, 0 or more; what is to be shared, such as probability times
        time. If all are 0, the cells count.
    searchers : float64[num, 2], m, where they are.
    shares : how much each should get, relative to the others; equal by default.
    """
    places = np.asarray(searchers, dtype=np.float64).reshape(-1, 2)
    num = len(places)
    wanted = np.ones(num) if shares is None else np.asarray(shares, dtype=np.float64)
    weights = np.asarray(weights, dtype=np.float64)
    faults = []
    if not np.isfinite(places).all():
        faults.append(Fault("divide", "searchers", "are not all somewhere", "Give finite positions."))
    if wanted.shape != (num,) or not (np.isfinite(wanted) & (wanted > 0.0)).all():
        faults.append(Fault("divide", "shares", f"are {wanted.tolist()}", f"Give {num} numbers above 0."))
    if weights.shape not in ((), grid.shape):
        faults.append(Fault("divide", "weights", f"have shape {weights.shape}", f"Give {grid.shape}."))
    else:
        weights = np.broadcast_to(weights, grid.shape)
        if not (np.isfinite(weights) & (weights >= 0.0))[grid.mask].all():
            faults.append(Fault("divide", "weights", "are not all numbers from 0", "Give 0 or more."))
    if faults:
        raise InputError(faults)

    result = np.full(grid.shape, OUTSIDE, dtype=np.int64)
    if num == 0:
        return result
    rows, cols = np.nonzero(grid.mask)
    weight = weights[rows, cols]
    if float(weight.sum()) <= 0.0:
        weight = np.ones(len(rows))
    regions = _cut(rows, cols, weight, np.sort(wanted)[::-1][: len(rows)])
    order = np.lexsort((wanted, places[:, 1], places[:, 0]))
    owner = order[_match(grid, rows, cols, regions, places[order], wanted[order])]
    for region, searcher in zip(regions, owner.tolist(), strict=True):
        cells = region[0]
        result[rows[cells], cols[cells]] = searcher
    return result


def _cut(
    rows: RowArray, cols: RowArray, weight: FloatArray, shares: FloatArray
) -> list[tuple[RowArray, float]]:
    """Return (cells, share) of each part; recursive bisection."""
    done: list[tuple[RowArray, float]] = []
    todo = [(np.arange(len(rows)), shares)]
    while todo:
        cells, wanted = todo.pop()
        if len(wanted) == 1:
            done.append((cells, float(wanted[0])))
            continue
        half = len(wanted) // 2
        tall = bool(np.ptp(rows[cells]) > np.ptp(cols[cells]))
        best, fewest = None, math.inf
        for across in (tall, not tall):
            first, second = (cols[cells], rows[cells]) if across else (rows[cells], cols[cells])
            ordered = cells[np.lexsort((first, second))]
            at = _cut_at(weight[ordered], wanted)
            parts = ordered[:at], ordered[at:]
            pieces = sum(_pieces(rows[part], cols[part]) for part in parts)
            if pieces < fewest:
                best, fewest = parts, pieces
            if fewest == 2:
                break
        assert best is not None
        todo.append((best[1], wanted[half:]))
        todo.append((best[0], wanted[:half]))
    return done


def _cut_at(weight: FloatArray, wanted: FloatArray) -> int:
    """Return how many cells, in this order, the first half of those who want a share should get."""
    half = len(wanted) // 2
    so_far = np.cumsum(weight)
    goal = float(wanted[:half].sum() / wanted.sum() * so_far[-1])
    # Between the two cuts around the goal, the nearer one.
    at = int(np.searchsorted(so_far, goal))
    before = float(so_far[at - 1]) if at > 0 else 0.0
    cut = at + 1 if at < len(weight) and so_far[at] - goal < goal - before else at
    # Every searcher gets a cell, however light the rest.
    return min(max(cut, half), len(weight) - (len(wanted) - half))


def _pieces(rows: RowArray, cols: RowArray) -> int:
    """Return in how many pieces some cells are; cells that share only a corner are apart."""
    from scipy.ndimage import label

    mask = np.zeros((np.ptp(rows) + 1, np.ptp(cols) + 1), dtype=np.bool_)
    mask[rows - rows.min(), cols - cols.min()] = True
    return int(label(mask)[1])


def _match(
    grid: Grid,
    rows: RowArray,
    cols: RowArray,
    regions: list[tuple[RowArray, float]],
    places: FloatArray,
    wanted: FloatArray,
) -> RowArray:
    """Return the searcher of each region, among those who want such a share."""
    from scipy.optimize import linear_sum_assignment

    centres = np.array([(grid.x[cols[cells]].mean(), grid.y[rows[cells]].mean()) for cells, _ in regions])
    off = centres[:, None, :] - places[None, :, :]
    away = np.hypot(off[..., 0], off[..., 1])
    size = np.array([share for _, share in regions])
    away[size[:, None] != wanted[None, :]] = math.inf
    owner: RowArray = linear_sum_assignment(away)[1].astype(np.int64)
    return owner
