"""Tracks of found targets: constant-velocity Kalman filter, gates, M of N confirmation, fusion.

State (x, y, vx, vy) in m and m/s; white acceleration noise (Bar-Shalom, Li and Kirubarajan, Estimation
with Applications to Tracking and Navigation, ch. 6).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from swarmbid.arrays import FloatArray
from swarmbid.errors import Fault, InputError

GATE = 9.21034037197618
"""99 % point of chi-square with two degrees of freedom, -2 log(0.01)."""


@dataclass(slots=True)
class Track:
    """What is believed of one target.

    Parameters
    ----------
    mean : float64[4]. covariance : float64[4, 4]. t : s, of both. number : within its tracker.
    hits, misses : looks that detected it in all, and in a row that did not.
    recent : the last N looks, True where it was detected. confirmed : it had M of N once.
    """

    mean: FloatArray
    covariance: FloatArray
    t: float
    number: int = 0
    hits: int = 1
    misses: int = 0
    recent: list[bool] = field(default_factory=lambda: [True])
    confirmed: bool = False

    def predict(self, t: float, noise: float) -> None:
        """Move to the time `t` s; `noise` is the acceleration's spectral density, m2/s3."""
        dt = t - self.t
        if dt <= 0.0:
            return
        move = np.eye(4)
        move[0, 2] = move[1, 3] = dt
        self.mean = move @ self.mean
        covariance = move @ self.covariance @ move.T
        a, b, c = noise * dt**3 / 3.0, noise * dt * dt / 2.0, noise * dt
        for axis in (0, 1):
            covariance[axis, axis] += a
            covariance[axis, axis + 2] += b
            covariance[axis + 2, axis] += b
            covariance[axis + 2, axis + 2] += c
        self.covariance = covariance
        self.t = t

    def distance(self, x: float, y: float, sigma: float) -> float:
        """Return the squared Mahalanobis distance of a measurement with standard deviation `sigma` m."""
        p = self.covariance
        a, b, c = p[0, 0] + sigma * sigma, p[0, 1], p[1, 1] + sigma * sigma
        dx, dy = x - self.mean[0], y - self.mean[1]
        return float((c * dx * dx - 2.0 * b * dx * dy + a * dy * dy) / (a * c - b * b))

    def update(self, x: float, y: float, sigma: float) -> None:
        """Take in a position measurement with standard deviation `sigma` m (Joseph's form)."""
        p = self.covariance
        a, b, c = p[0, 0] + sigma * sigma, p[0, 1], p[1, 1] + sigma * sigma
        inverse = np.array([[c, -b], [-b, a]]) / (a * c - b * b)
        gain = p[:, :2] @ inverse
        self.mean = self.mean + gain @ np.array([x - self.mean[0], y - self.mean[1]])
        keep = np.eye(4)
        keep[:, :2] -= gain
        self.covariance = keep @ p @ keep.T + sigma * sigma * (gain @ gain.T)

    def moves(self, slow: float = 0.5) -> bool | None:
        """Tell whether it moves (True), rests (False), or the evidence decides neither (None).

        It moves if rest is refused at 99 % (chi-square of the velocity); it rests if it is not refused
        and three standard deviations above its speed are still below `slow` m/s.
        """
        p = self.covariance
        a, b, c = p[2, 2], p[2, 3], p[3, 3]
        vx, vy = self.mean[2], self.mean[3]
        if (c * vx * vx - 2.0 * b * vx * vy + a * vy * vy) / (a * c - b * b) > GATE:
            return True
        largest = 0.5 * (a + c) + math.sqrt(0.25 * (a - c) ** 2 + b * b)
        return False if math.hypot(vx, vy) + 3.0 * math.sqrt(largest) < slow else None


class Tracker:
    """One UAV's tracks.

    Parameters
    ----------
    noise : m2/s3. sigma : m, of measurements. speed : m/s, standard deviation of a new track's velocity.
    confirm : (M, N), detected in M of N looks. delete : looks in a row without detection that end it.
    """

    def __init__(
        self,
        noise: float = 0.1,
        sigma: float = 5.0,
        speed: float = 10.0,
        confirm: tuple[int, int] = (3, 5),
        delete: int = 5,
    ) -> None:
        faults = [
            Fault("tracker", name, f"is {value}", "Give more than 0.")
            for name, value in (("noise", noise), ("sigma", sigma), ("speed", speed), ("delete", delete))
            if not 0.0 < value < math.inf
        ]
        if not 1 <= confirm[0] <= confirm[1]:
            faults.append(Fault("tracker", "confirm", f"is {confirm}", "Give 1 <= M <= N."))
        if faults:
            raise InputError(faults)
        self.noise, self.sigma, self.speed = noise, sigma, speed
        self.confirm, self.delete = confirm, delete
        self.tracks: list[Track] = []
        self._number = 0

    def look(self, t: float, measured: FloatArray, seen: Sequence[bool] | None = None) -> None:
        """Take in one look at time `t` s.

        Parameters
        ----------
        measured : float64[n, 2], m. seen : per track, whether the sensor looked at it; None for all.
        """
        for track in self.tracks:
            track.predict(t, self.noise)
        used = self._associate(measured)
        taken = set(used.values())
        for row, track in enumerate(self.tracks):
            if row in used:
                track.update(float(measured[used[row], 0]), float(measured[used[row], 1]), self.sigma)
                track.hits += 1
                track.misses = 0
            elif seen is not None and not seen[row]:
                continue
            else:
                track.misses += 1
            track.recent = [*track.recent, row in used][-self.confirm[1] :]
            track.confirmed = track.confirmed or sum(track.recent) >= self.confirm[0]
        self.tracks = [track for track in self.tracks if track.misses < self.delete]
        for k in range(len(measured)):
            if k not in taken:
                self._start(t, float(measured[k, 0]), float(measured[k, 1]))

    def _associate(self, measured: FloatArray) -> dict[int, int]:
        """Return track row -> measurement row: most pairs in the gate, then the nearest."""
        if not self.tracks or not len(measured):
            return {}
        cost = np.array(
            [[track.distance(float(x), float(y), self.sigma) for x, y in measured] for track in self.tracks]
        )
        if cost.size == 1:
            return {0: 0} if cost[0, 0] <= GATE else {}
        from scipy.optimize import linear_sum_assignment

        barred = (GATE + 1.0) * (min(cost.shape) + 1.0)
        rows, columns = linear_sum_assignment(np.where(cost <= GATE, cost, barred))
        pairs = zip(rows.tolist(), columns.tolist(), strict=True)
        return {row: column for row, column in pairs if cost[row, column] <= GATE}

    def _start(self, t: float, x: float, y: float) -> None:
        place, speed = self.sigma**2, self.speed**2
        mean = np.array([x, y, 0.0, 0.0])
        track = Track(mean, np.diag([place, place, speed, speed]), t, self._number)
        track.confirmed = self.confirm[0] == 1
        self._number += 1
        self.tracks.append(track)


def intersect(
    mean: FloatArray, covariance: FloatArray, other_mean: FloatArray, other_covariance: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Fuse two estimates of one target whose common past is unknown (covariance intersection).

    P^-1 = w A^-1 + (1 - w) B^-1, with w among 33 steps from 0 to 1 the one of least trace (Julier and
    Uhlmann 1997). Never more certain than either is entitled to: what was heard twice is not counted twice.
    """
    a, b = np.linalg.inv(covariance), np.linalg.inv(other_covariance)
    weights = np.linspace(0.0, 1.0, 33)
    fused = np.linalg.inv(weights[:, None, None] * a + (1.0 - weights)[:, None, None] * b)
    best = int(np.argmin(np.trace(fused, axis1=1, axis2=2)))
    w = weights[best]
    return fused[best] @ (w * (a @ mean) + (1.0 - w) * (b @ other_mean)), fused[best]


def gospa(truth: FloatArray, estimate: FloatArray, cut_off: float, p: float = 2.0) -> float:
    """Return the GOSPA distance in m, alpha = 2 (Rahmathullah, Garcia-Fernandez and Svensson 2017).

    Parameters
    ----------
    truth, estimate : float64[n, 2] and float64[m, 2], m. cut_off : m, a target farther off is missed.
    """
    lone = abs(len(truth) - len(estimate)) * cut_off**p / 2.0
    if not len(truth) or not len(estimate):
        return float(lone ** (1.0 / p))
    from scipy.optimize import linear_sum_assignment

    off = np.hypot(truth[:, None, 0] - estimate[None, :, 0], truth[:, None, 1] - estimate[None, :, 1])
    cost = np.minimum(off, cut_off) ** p
    rows, columns = linear_sum_assignment(cost)
    return float((cost[rows, columns].sum() + lone) ** (1.0 / p))
