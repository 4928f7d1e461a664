"""What the drones of the Drone Swarm Search Environment believe of where the person is.

Both beliefs start from the observed probability matrix and take in cells that were searched in vain.
`Fading` knows nothing but the matrix. `Persons` also knows by which rule the environment lets a person
drift, never where this one is nor which way it was drawn to drift: that it infers (Bayes).

Cells are (row, column) here; the environment's positions are (x, y), x the column.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from swarmbid.arrays import FloatArray

Cell = tuple[int, int]

TURNS = ((0.0, 45.0), (20.0, 55.0), (300.0, 360.0), (315.0, 360.0))
"""degrees; a person's own vector is the water's, turned by an angle from one of these, all as likely."""
WALK = 0.05
"""Weight of a person's own direction, beside the matrix's nine cells around it, when it moves."""


class Belief(Protocol):
    """What the policy asks of a belief; one object serves episode after episode."""

    def start(self, matrix: FloatArray) -> None:
        """Begin an episode with its first observed matrix."""

    def miss(self, cells: Iterable[Cell]) -> None:
        """Take in that these cells were searched and nobody was found."""

    def advance(self, matrix: FloatArray) -> None:
        """Go on by one step, at the end of which `matrix` is observed."""

    def forecast(self, steps: int) -> FloatArray:
        """Return the probability of each cell so many steps from now, float64[rows, columns]."""


class Fading:
    """The observed matrix, lowered where it was searched of late.

    Bayes' miss update at the time of the search; then the cell recovers, for somebody may have drifted
    into it: the share of the matrix's value that it lacks is exp(-age / memory).

    Parameters
    ----------
    memory : steps.
    """

    def __init__(self, memory: float) -> None:
        self._keep = math.exp(-1.0 / memory)

    def start(self, matrix: FloatArray) -> None:
        """Begin an episode."""
        self._matrix = matrix.astype(float)
        self._lacking: FloatArray = np.zeros(matrix.shape)

    def miss(self, cells: Iterable[Cell]) -> None:
        """Lower these cells to nothing."""
        for cell in cells:
            self._lacking[cell] = 1.0

    def advance(self, matrix: FloatArray) -> None:
        """Take the new matrix; let the searched cells recover."""
        self._matrix = matrix.astype(float)
        self._lacking *= self._keep

    def forecast(self, steps: int) -> FloatArray:
        """Return the belief as it is now: the matrix alone does not say where it will go."""
        found = self._matrix * (1.0 - self._lacking)
        return _normal(found)


class Persons:
    """The exact posterior of the person's cell under the environment's rule of drift.

    A person's vector u is the mean of the water's vector v and of v turned by a random angle and
    stretched. Each step adds u |u| / speed to a pair of counters; in the step after one has reached 1 the
    person moves to one of nine cells, drawn with the weights of the matrix around it plus `WALK` for its
    own direction, and the full counters are lowered by 1. So given u the instants of its moves are
    certain, and the cell is a Markov chain: one probability grid per hypothesis of u, all weighed by
    Bayes together.

    Parameters
    ----------
    vector : (x, y) m/s, the water's drift, as the environment was set up.
    speed : m/s, of a drone.
    angles : hypotheses for each range of `TURNS`, at the middles of equal parts.
    """

    def __init__(self, vector: tuple[float, float], speed: float = 10.0, angles: int = 6) -> None:
        self._rate = np.array(
            [
                _drift(vector, math.radians(low + (high - low) * (part + 0.5) / angles)) / speed
                for low, high in TURNS
                for part in range(angles)
            ]
        )

    def start(self, matrix: FloatArray) -> None:
        """Begin an episode: the person is at the matrix's peak, which is sharp then."""
        peak = np.unravel_index(int(matrix.argmax()), matrix.shape)
        self._matrix = matrix.astype(float)
        self._counters = self._rate.copy()  # the environment makes a step before it is first observed
        self._joint: FloatArray = np.zeros((len(self._rate), *matrix.shape))
        self._joint[:, peak[0], peak[1]] = 1.0 / len(self._rate)

    def miss(self, cells: Iterable[Cell]) -> None:
        """Nobody is in these cells: detection is certain where it is tried."""
        for row, column in cells:
            self._joint[:, row, column] = 0.0
        self._joint = _normal(self._joint)

    def advance(self, matrix: FloatArray) -> None:
        """Move the person by the matrix of before, as the environment does, then take the new one."""
        self._joint, self._counters = moved(self._joint, self._counters, self._rate, self._matrix)
        self._matrix = matrix.astype(float)

    def forecast(self, steps: int) -> FloatArray:
        """Return the belief so many steps from now, the matrix staying as it is."""
        joint, counters = self._joint, self._counters
        for _ in range(steps):
            joint, counters = moved(joint, counters, self._rate, self._matrix)
        found: FloatArray = joint.sum(axis=0)
        return found


def moved(
    joint: FloatArray, counters: FloatArray, rate: FloatArray, matrix: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return belief and counters after one step.

    Parameters
    ----------
    joint : float64[hypotheses, rows, columns]. counters, rate : float64[hypotheses, 2], (x, y).
    matrix : float64[rows, columns], as observed before the step.
    """
    moves: NDArray[np.bool_] = np.any(np.abs(counters) >= 1.0, axis=1)
    counters = counters + rate
    if not moves.any():
        return joint, counters
    heading = np.sign(np.round(counters)).astype(int)
    rows, columns = matrix.shape
    padded = np.pad(matrix, 1)
    offsets = [(down, right) for down in (-1, 0, 1) for right in (-1, 0, 1)]
    around = [padded[1 + d : 1 + d + rows, 1 + r : 1 + r + columns] for d, r in offsets]
    total = np.sum(around, axis=0) + WALK
    joint = joint.copy()
    for right, down in sorted({(int(x), int(y)) for x, y in heading[moves]}):
        those = np.flatnonzero(moves & (heading == (right, down)).all(axis=1))
        here = joint[those] / total
        there = np.zeros_like(here)
        for offset, weight in zip(offsets, around, strict=True):
            there += _shifted(here * (weight + (WALK if offset == (down, right) else 0.0)), offset)
        joint[those] = there
    counters -= np.where(moves[:, np.newaxis] & (np.abs(counters) >= 1.0), np.sign(counters), 0.0)
    return joint, counters


def _drift(vector: tuple[float, float], turn: float) -> FloatArray:
    """Return u |u| of the person whose vector is turned by `turn` rad, counter-clockwise."""
    water = np.array(vector)
    stretch = 0.5 + math.exp(-abs(turn - math.pi / 2.0) / math.pi)
    cos, sin = math.cos(turn), math.sin(turn)
    own = stretch * np.array([cos * water[0] - sin * water[1], sin * water[0] + cos * water[1]])
    mean = (water + own) / 2.0
    found: FloatArray = mean * np.hypot(*mean)
    return found


def _shifted(grids: FloatArray, offset: Cell) -> FloatArray:
    """Move probability by `offset`; what would leave an edge stays there, each axis for itself."""
    for axis, by in ((1, offset[0]), (2, offset[1])):
        if by:
            before: tuple[slice, ...] = (slice(None),) * axis
            first, last = (*before, slice(1, None)), (*before, slice(None, -1))
            edge = (*before, slice(-1, None) if by > 0 else slice(None, 1))
            old, grids = grids, np.zeros_like(grids)
            grids[first if by > 0 else last] = old[last if by > 0 else first]
            grids[edge] += old[edge]
    return grids


def _normal(weights: FloatArray) -> FloatArray:
    """Return `weights` with sum 1; all alike if nothing is left, when the model has been refuted."""
    total = float(weights.sum())
    if total > 0.0:
        return weights / total
    return np.full(weights.shape, 1.0 / weights.size)
