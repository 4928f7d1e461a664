"""Vector lanes over tasks: one insertion position, a block of candidate tasks side by side.

Every loop here runs over at most `BLOCK` tasks, without branches and without reductions, so that
LLVM turns it into vector instructions while every lane keeps the exact scalar arithmetic: no
``fastmath``, hence the same bits on every x86 target, on which ties between unlike machines depend.
The exponential is a polynomial of our own, for the C library's differ between machines.

Rows of the task table and slots of the agent vector are named and filled in `swarmbid.arrays`.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from swarmbid.arrays import X, Y, Z

BLOCK = 256
"""Lanes worked on at once: the scratch rows of a block stay in the first-level cache."""

_LOG2E = 1.4426950408889634
_LN2_HIGH = 6.93147180369123816490e-01
_LN2_LOW = 1.90821492927058770002e-10
_ROUND = 6755399441055744.0  # 1.5 * 2^52: adding it rounds to the nearest integer


@njit(cache=True, nogil=True, error_model="numpy")
def exp_lanes(exponent, bits, scale, count):
    """Replace `exponent` by its exponential, lane by lane, to within 1 unit in the last place or two.

    Parameters
    ----------
    exponent : float64[BLOCK], clamped to [-708, 708], overwritten.
    bits, scale : one scratch buffer seen as int64[BLOCK] and as float64[BLOCK].
    count : lanes in use.
    """
    for j in range(count):
        x = min(max(exponent[j], -708.0), 708.0)
        n = (x * _LOG2E + _ROUND) - _ROUND
        r = (x - n * _LN2_HIGH) - n * _LN2_LOW
        # Taylor to degree 13 on |r| <= ln(2)/2: the remainder is below 2^-58.
        p = 1.0 / 6227020800.0
        p = p * r + 1.0 / 479001600.0
        p = p * r + 1.0 / 39916800.0
        p = p * r + 1.0 / 3628800.0
        p = p * r + 1.0 / 362880.0
        p = p * r + 1.0 / 40320.0
        p = p * r + 1.0 / 5040.0
        p = p * r + 1.0 / 720.0
        p = p * r + 1.0 / 120.0
        p = p * r + 1.0 / 24.0
        p = p * r + 1.0 / 6.0
        p = p * r + 0.5
        p = p * r + 1.0
        p = p * r + 1.0
        exponent[j] = p
        bits[j] = (np.int64(n) + np.int64(1023)) << np.int64(52)
    for j in range(count):
        exponent[j] = exponent[j] * scale[j]


@njit(cache=True, nogil=True, error_model="numpy")
def distance_lanes(x, y, z, tasks, count, step, out):
    """Distances in m from one point to the first tasks of a table, rounded down to `step` if not 0."""
    xs, ys, zs = tasks[X], tasks[Y], tasks[Z]
    for j in range(count):
        dx = xs[j] - x
        dy = ys[j] - y
        dz = zs[j] - z
        out[j] = np.sqrt(dx * dx + dy * dy + dz * dz)
    if step > 0.0:
        for j in range(count):
            out[j] = np.floor(out[j] / step + 1e-9) * step


@njit(cache=True, nogil=True, error_model="numpy")
def distance_between(ax, ay, az, bx, by, bz, step):
    """Metres between two points, with the same arithmetic as `distance_lanes`."""
    dx = bx - ax
    dy = by - ay
    dz = bz - az
    d = np.sqrt(dx * dx + dy * dy + dz * dz)
    if step > 0.0:
        d = np.floor(d / step + 1e-9) * step
    return d
