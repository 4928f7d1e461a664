"""Vector lanes over tasks: one insertion position, a block of candidate tasks side by side.

Functions of one lane are inlined into loops over at most `BLOCK` tasks, without branches and without
reductions, so that LLVM turns them into vector instructions while every lane keeps the exact scalar
arithmetic: no ``fastmath``, hence the same bits on every x86 target, on which ties between unlike
machines depend. The exponential is a polynomial of our own, for the C library's differ between machines.

Rows of the task table and slots of the agent vector are named and filled in `swarmbid.arrays`.
"""

from __future__ import annotations

import numpy as np
from numba import njit

BLOCK = 128
"""Lanes worked on at once: the scratch rows of a block stay in the first-level cache."""

_LOG2E = 1.4426950408889634
_LN2_HIGH = 6.93147180369123816490e-01
_LN2_LOW = 1.90821492927058770002e-10
_ROUND = 6755399441055744.0  # 1.5 * 2^52: adding it rounds to the nearest integer, kept in the low bits
_TO_EXPONENT = np.int64(52)


@njit(cache=True, error_model="numpy")
def exp_lane(exponent):
    """Return e to the `exponent`, clamped to [-708, 708], to within a unit in the last place or two.

    2^n e^r with r = x - n ln 2, |r| <= ln(2)/2. The polynomial is the best of degree 11 in relative error
    (2^-57.9) that has 1 + r exactly, so that e^0 is exactly 1.
    """
    x = min(max(exponent, -708.0), 708.0)
    shifted = x * _LOG2E + _ROUND
    n = shifted - _ROUND
    r = (x - n * _LN2_HIGH) - n * _LN2_LOW
    # The remainder (e^r - 1 - r) / r^2, in pairs of powers for shorter waits (Estrin).
    r2 = r * r
    r4 = r2 * r2
    p01 = 0.16666666666666413 * r + 0.5000000000000011
    p23 = 0.008333333333494461 * r + 0.041666666666530155
    p45 = 0.00019841269506578688 * r + 0.0013888888943630114
    p67 = 2.7557586373840165e-06 * r + 2.480149309890655e-05
    p89 = 2.5000061602835666e-08 * r + 2.763024837921144e-07
    rest = (p01 + r2 * p23) + r4 * ((p45 + r2 * p67) + r4 * p89)
    p = (r2 * rest + r) + 1.0
    # n stands in the low bits of `shifted`; adding it to the exponent bits of p multiplies by 2^n.
    bits = np.float64(p).view(np.int64) + (np.float64(shifted).view(np.int64) << _TO_EXPONENT)
    return np.int64(bits).view(np.float64)


@njit(cache=True, error_model="numpy")
def whole_vectors(count):
    """Return how many lanes to work on for `count` tasks, so that no loop ends in scalar code."""
    return (count + 7) // 8 * 8


@njit(cache=True, error_model="numpy")
def copy_lanes(values, out, count):
    """Copy `count` lanes.

    A function of its own, as those below: LLVM checks its two arrays for overlap once a call, where it
    gives up at a dozen in one loop.
    """
    for j in range(count):
        out[j] = values[j]


@njit(cache=True, error_model="numpy")
def copy_whole(values, out, count):
    """Copy `count` lanes that hold whole numbers to integers."""
    for j in range(count):
        out[j] = np.int64(values[j])


@njit(cache=True, error_model="numpy")
def distance_lanes(x, y, z, xs, ys, zs, count, step, out):
    """Distances in m from one point to a block of tasks, rounded down to `step` if it is not 0."""
    for j in range(count):
        dx = xs[j] - x
        dy = ys[j] - y
        dz = zs[j] - z
        out[j] = np.sqrt(dx * dx + dy * dy + dz * dz)
    if step > 0.0:
        for j in range(count):
            out[j] = np.floor(out[j] / step + 1e-9) * step


@njit(cache=True, error_model="numpy")
def distance_between(ax, ay, az, bx, by, bz, step):
    """Metres between two points, with the same arithmetic as `distance_lanes`."""
    dx = bx - ax
    dy = by - ay
    dz = bz - az
    d = np.sqrt(dx * dx + dy * dy + dz * dz)
    if step > 0.0:
        d = np.floor(d / step + 1e-9) * step
    return d
