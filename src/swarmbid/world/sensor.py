"""A sensor that looks straight down: how far it sees, how surely, and what it makes up.

Source: Koopman, Search and Screening (1946) for the lateral range curve, the sweep width and the
inverse cube law.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from swarmbid.arrays import FloatArray, RowArray
from swarmbid.checks import Checker

FALL_OFFS = ("definite", "linear", "inverse_cube")
"""How the detection probability falls from nadir to the edge of what is seen."""

_NO_ROWS = np.empty(0, dtype=np.int64)
_NO_PLACES = np.empty((0, 2))
for _empty in (_NO_ROWS, _NO_PLACES):
    _empty.flags.writeable = False


class Glimpse(NamedTuple):
    """What one look showed.

    Parameters
    ----------
    rows : int64[n], which targets were detected, ascending.
    measured : float64[n, 2], m, where they seemed to be.
    false_alarms : float64[m, 2], m, where there seemed to be some.
    """

    rows: RowArray
    measured: FloatArray
    false_alarms: FloatArray

    def places(self) -> FloatArray:
        """Return all reports, float64[n + m, 2], m, as a UAV gets them: it cannot tell which are true."""
        return np.concatenate((self.measured, self.false_alarms))


@dataclass(frozen=True, kw_only=True)
class Sensor:
    """A downward sensor that takes a glimpse every `period`.

    Parameters
    ----------
    half_angle : rad between straight down and the edge of its cone; half the field of view.
    detection : probability that one glimpse detects a target right below.
    fall_off : "definite": the same out to the edge. "linear": down to 0 at the edge. "inverse_cube": the
        expected detections -log(1 - P) fall as (h / slant range)^3, as the solid angle of a small target
        does; needs `detection` below 1.
    period : s between glimpses.
    false_alarm_rate : expected number per glimpse, anywhere in what is seen.
    sigma : m, standard deviation of a measured position, east and north alike.
    """

    half_angle: float = math.pi / 4.0
    detection: float = 0.9
    fall_off: str = "definite"
    period: float = 1.0
    false_alarm_rate: float = 0.0
    sigma: float = 0.0

    def __post_init__(self) -> None:
        check = Checker("sensor", self)
        if check.number("half_angle", above=0.0) and self.half_angle > 1.55:
            check.fault("half_angle", f"is {self.half_angle:g}", "Give at most 1.55 rad, 89 degrees.")
        if self.fall_off not in FALL_OFFS:
            check.fault("fall_off", f"is {self.fall_off!r}", f"Use one of {', '.join(FALL_OFFS)}.")
        certain = check.number("detection", low=0.0, high=1.0) and self.detection == 1.0
        if certain and self.fall_off == "inverse_cube":
            check.fault("detection", "is 1, which does not fall off by the inverse cube", "Give less.")
        check.number("period", above=0.0)
        check.number("false_alarm_rate", low=0.0, high=1e3)
        check.number("sigma", low=0.0)
        check.done()

    def radius(self, altitude: float) -> float:
        """Return how far from nadir it sees on the ground, m."""
        return max(0.0, altitude) * math.tan(self.half_angle)

    def probability(self, distance: ArrayLike, altitude: float) -> FloatArray:
        """Return the detection probability of one glimpse, by m from nadir."""
        away = np.asarray(distance, dtype=np.float64)
        radius = self.radius(altitude)
        if radius <= 0.0:
            return np.zeros(away.shape)
        if self.fall_off == "definite":
            chance = np.full(away.shape, self.detection)
        elif self.fall_off == "linear":
            chance = self.detection * (1.0 - away / radius)
        else:
            cosine = altitude / np.sqrt(altitude * altitude + away * away)
            chance = -np.expm1(math.log1p(-self.detection) * cosine * cosine * cosine)
        return np.where(away <= radius, chance, 0.0)

    def lateral_range(self, offset: ArrayLike, altitude: float, speed: float) -> FloatArray:
        """Return the probability that a straight pass detects what is `offset` m beside it.

        1 - product of (1 - P) over the glimpses of the pass, averaged over where they happen to fall.
        """
        beside = np.asarray(offset, dtype=np.float64)
        step = speed * self.period
        if not 0.0 < step < math.inf:
            raise ValueError(f"speed must be above 0, not {speed}")
        radius = self.radius(altitude)
        num = 2 * math.ceil(radius / step) + 2
        phases = (np.arange(64) + 0.5) / 64.0
        along = (np.arange(num)[:, None] - num // 2 + phases) * step
        away = np.hypot(beside[..., None, None], along)
        missed = np.prod(1.0 - self.probability(away, altitude), axis=-2)
        chance: FloatArray = 1.0 - missed.mean(axis=-1)
        return chance

    def sweep_width(self, altitude: float, speed: float) -> float:
        """Return the sweep width W in m: the integral of the lateral range curve."""
        strips = 256
        radius = self.radius(altitude)
        offsets = (np.arange(strips) + 0.5) / strips * radius
        return 2.0 * radius * float(self.lateral_range(offsets, altitude, speed).mean())

    def glimpse(
        self, rng: np.random.Generator, x: float, y: float, altitude: float, targets: FloatArray
    ) -> Glimpse:
        """Look once from (x, y).

        Parameters
        ----------
        targets : float64[num, 2], m, where the targets are.
        """
        radius = self.radius(altitude)
        rows, measured, false_alarms = _NO_ROWS, _NO_PLACES, _NO_PLACES
        if len(targets):
            dx, dy = targets[:, 0] - x, targets[:, 1] - y
            square = dx * dx + dy * dy
            near = np.flatnonzero(square <= radius * radius)
            if len(near):
                chance = self.probability(np.sqrt(square[near]), altitude)
                rows = near[rng.random(len(near)) < chance]
                measured = targets[rows] + self.sigma * rng.standard_normal((len(rows), 2))
        if self.false_alarm_rate > 0.0:
            num = int(rng.poisson(self.false_alarm_rate))
            if num:
                away = radius * np.sqrt(rng.random(num))
                bearing = 2.0 * math.pi * rng.random(num)
                false_alarms = np.column_stack((x + away * np.cos(bearing), y + away * np.sin(bearing)))
        return Glimpse(rows, measured, false_alarms)
