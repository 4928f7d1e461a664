"""Where to search next: the straight leg that promises the most detections per second of flight.

Greedy, one leg at a time: what a set of looks detects is submodular, each look adding less the more was
seen before, which is what makes greedy search good (Nemhauser, Wolsey and Fisher 1978).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from swarmbid.arrays import FloatArray
from swarmbid.errors import Fault, InputError
from swarmbid.world.belief import Footprint
from swarmbid.world.grid import Grid

FAN = 12
BEST_CELLS = 12
STICK = 1.25
"""A new goal must promise so many times the old one's rate, or the UAV would dither between equals."""


class Planner:
    """One UAV's search planner; remembers its goal.

    Parameters
    ----------
    grid, footprint : of the belief. speed : m/s.
    """

    def __init__(self, grid: Grid, footprint: Footprint, speed: float) -> None:
        if not 0.0 < speed < math.inf:
            raise InputError([Fault("planner", "speed", f"is {speed}", "Give more than 0 m/s.")])
        self.grid, self.footprint, self.speed = grid, footprint, speed
        self.goal: tuple[float, float] | None = None
        self._x, self._y = (axis.ravel() for axis in np.meshgrid(grid.x, grid.y))

    def plan(
        self,
        probability: FloatArray,
        allowed: NDArray[np.bool_],
        position: tuple[float, float],
        heading: float,
        turn_radius: float = 0.0,
        horizon: float = 120.0,
    ) -> tuple[float, float] | None:
        """Return the next waypoint, or None if nothing is left to find in the allowed cells.

        Parameters
        ----------
        probability : float64[rows, cols], the belief. allowed : bool[rows, cols], the UAV's share.
        heading : rad from east, counter-clockwise. turn_radius : m. horizon : s, detections are worth
            exp(-t / horizon).
        """
        worth = np.where(allowed & self.grid.mask, probability, 0.0)
        if not worth.any():
            self.goal = None
            return None
        goals = self._candidates(worth, allowed & self.grid.mask, position)
        if self.goal is not None and math.dist(self.goal, position) > self.footprint.radius / 2.0:
            goals.insert(0, self.goal)
            held = True
        else:
            held = False
        rates = self.rates(worth, np.array(goals), position, heading, turn_radius, horizon)
        best = int(np.argmax(rates))
        if held and rates[0] > 0.0 and rates[best] <= STICK * rates[0]:
            best = 0
        self.goal = goals[best]
        return self.goal

    def rates(
        self,
        worth: FloatArray,
        goals: FloatArray,
        position: tuple[float, float],
        heading: float,
        turn_radius: float,
        horizon: float,
    ) -> FloatArray:
        """Return the discounted detections per s of the straight legs to `goals`, float64[n].

        The turn towards the goal costs its arc; each cell is looked at once, when abeam.
        """
        some = np.flatnonzero(worth.ravel())
        dx, dy = goals[:, 0] - position[0], goals[:, 1] - position[1]
        length = np.maximum(np.hypot(dx, dy), 1e-9)
        ux, uy = dx / length, dy / length
        turn = np.abs((np.arctan2(dy, dx) - heading + math.pi) % (2.0 * math.pi) - math.pi)
        late = turn * turn_radius / self.speed
        x, y = self._x[some] - position[0], self._y[some] - position[1]
        along = np.clip(np.outer(ux, x) + np.outer(uy, y), 0.0, length[:, None])
        off = np.hypot(x - along * ux[:, None], y - along * uy[:, None])
        row, col = np.nonzero(off < self.footprint.reach)
        found = worth.ravel()[some[col]] * self.footprint.probability(off[row, col])
        found *= np.exp(-(late[row] + along[row, col] / self.speed) / horizon)
        gain = np.bincount(row, weights=found, minlength=len(goals))
        return gain / (late + np.maximum(length, self.footprint.radius) / self.speed)

    def _candidates(
        self, worth: FloatArray, free: NDArray[np.bool_], position: tuple[float, float]
    ) -> list[tuple[float, float]]:
        """Return the best blurred cells, far enough apart, and a fan of near places, in free cells."""
        grid = self.grid
        half = max(1, round(self.footprint.radius / grid.cell))
        total = np.pad(worth, ((half + 1, half), (half + 1, half))).cumsum(axis=0).cumsum(axis=1)
        wide = 2 * half + 1
        blurred = total[wide:, wide:] - total[:-wide, wide:] - total[wide:, :-wide] + total[:-wide, :-wide]
        score = np.where(free, blurred, -1.0)
        goals: list[tuple[float, float]] = []
        for _ in range(BEST_CELLS):
            row, col = divmod(int(np.argmax(score)), grid.shape[1])
            if score[row, col] <= 0.0:
                break
            goals.append((float(grid.x[col]), float(grid.y[row])))
            score[max(0, row - half) : row + half + 1, max(0, col - half) : col + half + 1] = -1.0
        for k in range(FAN):
            bearing = 2.0 * math.pi * k / FAN
            for reach in (2.0, 5.0):
                x = position[0] + reach * self.footprint.radius * math.cos(bearing)
                y = position[1] + reach * self.footprint.radius * math.sin(bearing)
                row, col = grid.cell_of(x, y)
                if free[row, col]:
                    goals.append((float(grid.x[col]), float(grid.y[row])))
        return goals
