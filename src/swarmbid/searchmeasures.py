"""How well a search mission went: counted from the truth, which the UAVs never see."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any, Protocol

import numpy as np

from swarmbid.arrays import FloatArray
from swarmbid.world.mission import SearchMission
from swarmbid.world.tracker import gospa

CUT_OFF = 100.0
"""m within which an estimate counts as one of a target, in tracking and in GOSPA."""
GOSPA_EVERY = 10.0
"""s between two GOSPA distances."""


class Estimate(Protocol):
    """What is read of a contact."""

    @property
    def x(self) -> float:
        """m."""

    @property
    def y(self) -> float:
        """m."""

    @property
    def over(self) -> bool:
        """Whether nobody need look for it any more."""


@dataclass(frozen=True)
class Measures:
    """What one search mission achieved, and what it took.

    Parameters
    ----------
    targets, moving : how many there were, and how many of them move.
    found : share of all targets that were confirmed by somebody.
    first_detection : s, of the first confirmed target; the mission's duration if none was.
    mean_detection : s, mean over all targets; one never found counts with the mission's duration.
    detections : s, when each was found, in order: the cumulative detection curve.
    served : share of the static targets that were visited for the time wanted.
    tracked : mean share of the mission's time for which a moving target was followed, never found or not.
    tracked_since_found : the same, of the time since each was found.
    gaps, longest_gap : interruptions of following a target, per moving target found; s, the longest.
    gospa : m, mean over time, of what the first live UAV knows.
    unserved : found targets that nobody had served or was to serve at the end.
    false_targets : confirmed contacts that were no target, or one that had been found already.
    metres : flown by all. messages, bytes : sent by all.
    linked : share of time for which some UAV reached the ground station; 1 without one.
    identified : share of the static targets at which all the equipment wanted was at work at one time.
    revisited : share of the visits due after the first, of static targets found, that were made nearer to
        their time than to another's.
    """

    targets: int
    moving: int
    found: float
    first_detection: float
    mean_detection: float
    detections: tuple[float, ...]
    served: float
    tracked: float
    tracked_since_found: float
    gaps: float
    longest_gap: float
    gospa: float
    unserved: int
    false_targets: int
    metres: float
    messages: int
    bytes: int
    linked: float
    identified: float = 0.0
    revisited: float = 0.0

    def to_dict(self) -> dict[str, Any]:
        """Return it ready for JSON."""
        return asdict(self)


class Watch:
    """Sees everything, step by step, and counts."""

    def __init__(self, mission: SearchMission) -> None:
        count = len(mission.targets)
        self.mission = mission
        self.moving = np.array([target.kind != "static" for target in mission.targets], np.bool_)
        self.found = np.full(count, math.inf)
        self.served = np.zeros(count, np.bool_)
        self.identified = np.zeros(count, np.bool_)
        self.revisits: set[tuple[int, int]] = set()
        self.followed = np.zeros(count)
        self.followed_known = np.zeros(count)
        self.since = np.zeros(count)
        self.gaps: list[float] = []
        self.false = 0
        self._gap = np.full(count, math.nan)
        self._gospa: list[float] = []
        self._linked = self._steps = 0

    def detected(self, now: float, event: Any, xy: FloatArray) -> str:
        """Note a confirmed contact; return the id of the target that it is, empty for none."""
        row = self._nearest(event.x, event.y, xy)
        if row is None or math.isfinite(self.found[row]):
            self.false += 1
        if row is None:
            return ""
        self.found[row] = min(self.found[row], now)
        return self.mission.targets[row].id

    def finished(self, x: float, y: float, xy: FloatArray) -> None:
        """Note that somebody has done what there was to do at a static target."""
        row = self._nearest(x, y, xy)
        if row is not None:
            self.served[row] = True

    def stood(self, now: float, x: float, y: float, equipment: frozenset[str], xy: FloatArray) -> None:
        """Note that somebody has done what stood to be done at a static target.

        Parameters
        ----------
        equipment : all that is at work there now.
        """
        row = self._nearest(x, y, xy)
        if row is None:
            return
        wanted = frozenset(self.mission.identify)
        self.identified[row] |= bool(wanted) and wanted <= equipment
        if self.mission.revisit > 0.0 and math.isfinite(self.found[row]):
            k = round((now - float(self.found[row])) / self.mission.revisit)
            if 1 <= k <= self._visits_due(row):
                self.revisits.add((row, k))

    def _visits_due(self, row: int) -> int:
        left = self.mission.duration - self.mission.dwell - float(self.found[row])
        return max(0, math.floor(left / self.mission.revisit))

    def step(
        self,
        now: float,
        following: Sequence[Estimate],
        view: Sequence[Estimate],
        linked: bool,
        xy: FloatArray,
    ) -> None:
        """Count one second.

        Parameters
        ----------
        following : estimates of the targets that somebody sees and follows now.
        view : what the first live UAV knows. linked : whether some UAV reaches the ground station.
        """
        self._steps += 1
        self._linked += linked
        now_followed = np.zeros(len(self.moving), np.bool_)
        for one in following:
            row = self._nearest(one.x, one.y, xy)
            if row is not None:
                now_followed[row] = True
        self.followed += now_followed
        self.followed_known += now_followed & np.isfinite(self.found)
        self.since += np.isfinite(self.found)
        for row in np.flatnonzero(self.moving & np.isfinite(self.found)).tolist():
            if now_followed[row]:
                if self._gap[row] > 0.0:
                    self.gaps.append(float(self._gap[row]))
                self._gap[row] = 0.0
            elif not math.isnan(self._gap[row]):
                self._gap[row] += 1.0
        if now % GOSPA_EVERY == 0.0:
            known = np.array([(one.x, one.y) for one in view if not one.over], np.float64).reshape(-1, 2)
            self._gospa.append(gospa(xy, known, CUT_OFF))

    def measures(self, flown: Sequence[float], *, messages: int, bytes: int, unserved: int) -> Measures:
        """Return what was counted."""
        duration = self.mission.duration
        found = np.isfinite(self.found)
        times = np.where(found, self.found, duration)
        moving, still = self.moving, ~self.moving
        open_gaps = self._gap[np.nan_to_num(self._gap) > 0.0].tolist()
        gaps = [*self.gaps, *open_gaps]
        known = moving & found
        due = 0
        if self.mission.revisit > 0.0:
            due = sum(self._visits_due(row) for row in np.flatnonzero(still & found).tolist())
        return Measures(
            targets=len(self.moving),
            moving=int(moving.sum()),
            found=_mean(found),
            first_detection=float(times.min(initial=duration)),
            mean_detection=_mean(times),
            detections=tuple(sorted(self.found[found].tolist())),
            served=_mean(self.served[still]),
            tracked=_mean(self.followed[moving] / max(self._steps, 1)),
            tracked_since_found=_mean(self.followed_known[known] / np.maximum(self.since[known], 1.0)),
            gaps=len(gaps) / max(int(known.sum()), 1),
            longest_gap=max(gaps, default=0.0),
            gospa=_mean(np.array(self._gospa)),
            unserved=unserved,
            false_targets=self.false,
            metres=float(sum(flown)),
            messages=messages,
            bytes=bytes,
            linked=self._linked / max(self._steps, 1),
            identified=_mean(self.identified[still]),
            revisited=len(self.revisits) / max(due, 1),
        )

    def _nearest(self, x: float, y: float, xy: FloatArray) -> int | None:
        if not len(xy):
            return None
        off = np.hypot(xy[:, 0] - x, xy[:, 1] - y)
        row = int(np.argmin(off))
        return row if off[row] <= CUT_OFF else None


def _mean(values: Any) -> float:
    return float(np.mean(values)) if len(values) else 0.0
