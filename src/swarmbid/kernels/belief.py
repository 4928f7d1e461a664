"""What looking at an area does to the evidence on its cells, and how belief drifts and spreads.

Evidence is a sum of integers: -log(1 - detection probability) in units of 2^-32. Whole numbers add
up alike in every order, so agents that heard the same glimpses hold the same bits.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from swarmbid.kernels.lanes import exp_lane

UNIT = 4294967296.0


@njit(cache=True, error_model="numpy")
def add_glimpses(evidence, mask, west, south, cell, radius, per_bin, table, xs, ys, fades):
    """Add the evidence of glimpses that found nothing.

    Parameters
    ----------
    evidence : int64[rows, cols], written. mask : bool[rows, cols], cells that count.
    west, south, cell : m. radius : m, farthest cell centre touched. per_bin : bins per m2.
    table : int64[bins], evidence by squared distance to the cell centre.
    xs, ys : float64[n], m. fades : float64[n], 0 to 1, share of the evidence that still holds.
    """
    rows, cols = evidence.shape
    for k in range(xs.shape[0]):
        x = (xs[k] - west) / cell - 0.5
        y = (ys[k] - south) / cell - 0.5
        reach = radius / cell
        first_row, last_row = max(0, int(np.ceil(y - reach))), min(rows - 1, int(np.floor(y + reach)))
        first_col, last_col = max(0, int(np.ceil(x - reach))), min(cols - 1, int(np.floor(x + reach)))
        for row in range(first_row, last_row + 1):
            dy = (row - y) * cell
            for col in range(first_col, last_col + 1):
                dx = (col - x) * cell
                at = int((dx * dx + dy * dy) * per_bin)
                if at < table.shape[0] and mask[row, col]:
                    evidence[row, col] += int(table[at] * fades[k] + 0.5)


@njit(cache=True, error_model="numpy")
def posterior(base, evidence, one, out):
    """Belief from what was believed before and the evidence since; `out` is written.

    Parameters
    ----------
    base : float64[rows, cols]. evidence : int64[rows, cols]. one : exactly one target, or one a cell.
    """
    rows, cols = base.shape
    total = 0.0
    # Only differences count with one target; without the least, much-searched areas would underflow.
    least = np.int64(0)
    if one:
        least = np.int64(9223372036854775807)
        for row in range(rows):
            for col in range(cols):
                if base[row, col] > 0.0:
                    least = min(least, evidence[row, col])
    for row in range(rows):
        for col in range(cols):
            odds = base[row, col] * exp_lane((least - evidence[row, col]) / UNIT)
            value = odds if one else odds / (1.0 - base[row, col] + odds)
            out[row, col] = value if base[row, col] > 0.0 else 0.0
            total += out[row, col]
    if one and total > 0.0:
        for row in range(rows):
            for col in range(cols):
                out[row, col] /= total


@njit(cache=True, error_model="numpy")
def spread(mass, mask, east, north, share, crowded, steps, after):
    """Move mass by drift (upwind) and diffusion between free cells; none leaves. `mass` is written.

    Parameters
    ----------
    mass, after : float64[rows, cols]; `after` is scratch. mask : bool[rows, cols].
    east, north : cells a step, |east| + |north| + 4 share <= 1. share : diffused to each neighbour.
    crowded : whether a cell holds one target at most, so that drift into a full cell stops.
    """
    rows, cols = mass.shape
    for _ in range(steps):
        after[:] = mass
        for row in range(rows):
            for col in range(cols):
                if not mask[row, col]:
                    continue
                here = mass[row, col]
                for axis in range(2):
                    next_row, next_col = row + axis, col + 1 - axis
                    if next_row >= rows or next_col >= cols or not mask[next_row, next_col]:
                        continue
                    there = mass[next_row, next_col]
                    flow = north if axis == 1 else east
                    source, room = (here, 1.0 - there) if flow > 0.0 else (there, 1.0 - here)
                    moved = share * (here - there) + flow * source * (room if crowded else 1.0)
                    after[row, col] -= moved
                    after[next_row, next_col] += moved
        mass[:] = after
