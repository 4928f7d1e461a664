"""What one UAV believes of where undiscovered targets are.

Missed detections lower the belief by Bayes' rule: p' = p (1 - d) / (1 - p d) where each cell holds a
target by itself, and p' ~ p (1 - d) where there is exactly one target (Stone, Theory of Optimal
Search). In odds both are products, kept as sums of whole numbers: see `swarmbid.kernels.belief`.
"""

from __future__ import annotations

import math
from typing import Any, Protocol

import numpy as np

from swarmbid.arrays import FloatArray
from swarmbid.errors import Fault, InputError
from swarmbid.kernels.belief import UNIT, add_glimpses, posterior, spread
from swarmbid.world.grid import Grid

BINS = 2048
SURE = 1.0 - 2.0**-40
"""The largest detection probability, so that evidence stays finite."""

KINDS = ("independent", "one")


class Looking(Protocol):
    """What a footprint asks of a sensor."""

    def radius(self, altitude: float) -> float:
        """Return how far the sensor sees on the ground, m."""

    def probability(self, distance: Any, altitude: float) -> Any:
        """Return the detection probability of a glimpse, by distance from nadir in m."""


class Footprint:
    """A sensor's detection probability by distance, averaged over a cell of a grid.

    The average makes a glimpse count that falls between the centres of coarse cells.

    Attributes
    ----------
    radius : m, reach on the ground. reach : m, farthest cell centre that a glimpse touches.
    area : m2, the integral of the detection probability over the ground.
    """

    def __init__(self, sensor: Looking, altitude: float, grid: Grid) -> None:
        self.radius = float(sensor.radius(altitude))
        half = grid.cell / 2.0
        self.reach = self.radius + half * math.sqrt(2.0)
        self.per_bin = BINS / (self.reach * self.reach)
        distance = np.sqrt((np.arange(BINS) + 0.5) / self.per_bin)
        within = (np.arange(8) + 0.5) / 4.0 * half - half
        dx, dy = (axis.ravel() for axis in np.meshgrid(within, within))
        mean = np.zeros(BINS)
        bearings = np.arange(5) * (math.pi / 16.0)  # an eighth of the circle; the rest is its mirror
        for bearing in bearings:
            off = np.hypot(
                distance[:, None] * math.cos(bearing) + dx, distance[:, None] * math.sin(bearing) + dy
            )
            seen = np.where(off <= self.radius, sensor.probability(off, altitude), 0.0)
            mean += seen.mean(axis=1)
        self.detection: FloatArray = np.clip(mean / len(bearings), 0.0, SURE)
        self.table = np.rint(-np.log1p(-self.detection) * UNIT).astype(np.int64)
        self.area = float(self.detection.sum() * math.pi / self.per_bin)

    def probability(self, distance: Any) -> FloatArray:
        """Return the detection probability of a target somewhere in the cell so many m away."""
        at = (np.square(np.asarray(distance, dtype=float)) * self.per_bin).astype(np.int64)
        return np.where(at < BINS, self.detection[np.minimum(at, BINS - 1)], 0.0)


class Belief:
    """A probability grid of undiscovered targets.

    Parameters
    ----------
    kind : "independent" (each cell holds a target with its own probability) or "one" (exactly one).
    prior : a number (per cell if independent; any positive one for "one") or an array over the grid.
    drift : (vx, vy) m/s, common to all targets. diffusion : m2/s; a walk's variance grows by
        2 diffusion t on each axis.
    every : s, how much time `advance` gathers before it moves anything.
    """

    def __init__(
        self,
        grid: Grid,
        kind: str = "independent",
        prior: float | FloatArray = 0.01,
        drift: tuple[float, float] = (0.0, 0.0),
        diffusion: float = 0.0,
        every: float = 5.0,
    ) -> None:
        faults = []
        if kind not in KINDS:
            faults.append(Fault("belief", "kind", f"is {kind!r}", f"Use one of {', '.join(KINDS)}."))
        if not 0.0 <= diffusion < math.inf:
            faults.append(Fault("belief", "diffusion", f"is {diffusion}", "Give 0 m2/s or more."))
        if not all(map(math.isfinite, drift)):
            faults.append(Fault("belief", "drift", f"is {drift}", "Give finite speeds."))
        if not 0.0 < every < math.inf:
            faults.append(Fault("belief", "every", f"is {every}", "Give more than 0 s."))
        shape = np.shape(prior)
        if shape not in ((), grid.shape):
            faults.append(Fault("belief", "prior", f"has shape {shape}", f"Give a number or {grid.shape}."))
        else:
            base = np.where(grid.mask, prior, 0.0).astype(np.float64)
            high = math.inf if kind == "one" else 1.0
            if not (np.all(base >= 0.0) and np.all(base <= high) and 0.0 < base.sum() < math.inf):
                faults.append(Fault("belief", "prior", "is no probability", "Give 0 to 1, not all 0."))
        if faults:
            raise InputError(faults)
        self.grid = grid
        self.one = kind == "one"
        self.drift = (float(drift[0]), float(drift[1]))
        self.diffusion = float(diffusion)
        self.every = float(every)
        self._base: FloatArray = base / base.sum() if self.one else base
        self._evidence = np.zeros(grid.shape, dtype=np.int64)
        self._pending = 0.0
        self._now: FloatArray | None = None

    @property
    def probability(self) -> FloatArray:
        """Return the belief, float64[rows, cols]; a copy is the caller's to make before changing it."""
        if self._now is None:
            self._now = np.empty(self.grid.shape)
            posterior(self._base, self._evidence, self.one, self._now)
        return self._now

    def glimpse(self, footprint: Footprint, x: float, y: float) -> None:
        """Look at one place and find nothing."""
        self.glimpses(footprint, np.array([[x, y]]))

    def glimpses(self, footprint: Footprint, places: FloatArray, ages: FloatArray | None = None) -> None:
        """Take in glimpses that found nothing; their order does not matter.

        Parameters
        ----------
        places : float64[n, 2], m.
        ages : float64[n], s since each was made. One that is heard late moves on with the drift, and
            fades as radius^2 / (radius^2 + 4 diffusion age), the share of a Gaussian that spread so
            far; exact for targets that rest, an approximation for others.
        """
        x, y = np.array(places[:, 0], dtype=float), np.array(places[:, 1], dtype=float)
        fades = np.ones(len(x))
        if ages is not None:
            x += self.drift[0] * ages
            y += self.drift[1] * ages
            area = footprint.radius * footprint.radius
            fades = area / (area + 4.0 * self.diffusion * np.asarray(ages, dtype=float))
        grid = self.grid
        add_glimpses(
            self._evidence, grid.mask, grid.west, grid.south, grid.cell, footprint.reach,
            footprint.per_bin, footprint.table, x, y, fades,
        )  # fmt: skip
        self._now = None

    def alarm(
        self,
        footprint: Footprint,
        at: tuple[float, float],
        measured: tuple[float, float],
        sigma: float,
        clutter: float,
    ) -> None:
        """Weigh one unconfirmed detection; call it instead of `glimpse` for that look.

        A cell's odds grow by 1 - d + d N(measured; cell, sigma) / clutter: the target was missed and
        the alarm is false, or it made the alarm.

        Parameters
        ----------
        at : where the sensor was, m. sigma : m, of the measurement, the cell's own size is added.
        clutter : false alarms per look and m2, more than 0.
        """
        if not (sigma >= 0.0 and clutter > 0.0):
            raise ValueError(f"sigma {sigma} must be >= 0 and clutter {clutter} > 0")
        grid = self.grid
        detection = footprint.probability(np.hypot(grid.x[None, :] - at[0], grid.y[:, None] - at[1]))
        variance = sigma * sigma + grid.cell * grid.cell / 12.0
        off = np.square(grid.x[None, :] - measured[0]) + np.square(grid.y[:, None] - measured[1])
        density = np.exp(-off / (2.0 * variance)) / (2.0 * math.pi * variance)
        ratio = 1.0 - detection + detection * density / clutter
        self._evidence -= np.where(grid.mask, np.rint(np.log(ratio) * UNIT), 0.0).astype(np.int64)
        self._now = None

    def found(self, x: float, y: float, radius: float) -> None:
        """Forget what was believed within `radius` m of a target that was found.

        With exactly one target nothing is left to be found anywhere.
        """
        grid = self.grid
        near = np.hypot(grid.x[None, :] - x, grid.y[:, None] - y) <= radius
        near[grid.cell_of(x, y)] = True
        self._base = np.zeros(grid.shape) if self.one else np.where(near, 0.0, self._base)
        self._now = None

    def advance(self, seconds: float) -> None:
        """Let time pass: targets drift and spread, inside the free area, none lost.

        Upwind drift blurs by up to half a cell times the speed a second.
        """
        if self.diffusion == 0.0 and self.drift == (0.0, 0.0):
            return
        self._pending += seconds
        if self._pending < self.every:
            return
        cell = self.grid.cell
        rate = (abs(self.drift[0]) + abs(self.drift[1])) / cell + 4.0 * self.diffusion / (cell * cell)
        steps = max(1, math.ceil(self._pending * rate / 0.8))
        step = self._pending / steps
        mass = self.probability.copy()
        spread(
            mass, self.grid.mask, self.drift[0] * step / cell, self.drift[1] * step / cell,
            self.diffusion * step / (cell * cell), not self.one, steps, np.empty(mass.shape),
        )  # fmt: skip
        self._base = mass
        self._evidence[:] = 0
        self._pending = 0.0
        self._now = None
