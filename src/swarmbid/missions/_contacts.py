"""What one UAV makes of its detections: tracks, what type they are of, and which are known already.

Whether a contact moves is decided by evidence (`Track.moves`), never by an oracle; until it is decided the
UAV stays with it. Two UAVs may find one target: of two contacts that cannot be told apart the one found
earlier counts (then the lower id of the finder), and the other is over.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from swarmbid.arrays import FloatArray
from swarmbid.messages.survey import Contact
from swarmbid.world.tracker import GATE, Track, Tracker

PATIENCE = 40.0
"""s after which a contact whose rest is not refused by then is taken for static."""
SURE_LOOKS = 4
"""Looks in a row that must say that a contact moves."""
SURE_HITS = 8
"""Detections that it takes to say so: fewer say little of a velocity."""
SLOWEST = 0.7
"""m/s: what surely moves slower than that is static."""
OWN = 2.0
"""A known contact is one's own track's if the two lie within so many times their standard deviations."""
ALIKE = 3.0
"""m/s by which the velocities of two contacts may differ that are one target."""
TOGETHER = 5
"""Looks in a row at which two moving contacts must be together to be one target."""
FORESIGHT = 20.0
"""s for which a moving contact is thought to keep its course; later it may be anywhere around."""
DRIFT = 8.0
"""m/s by which the place of a moving contact grows uncertain while nobody sees it."""


@dataclass
class Candidate:
    """A confirmed track that is no known contact yet.

    Parameters
    ----------
    track : of this UAV. since : s, when it was confirmed. moved : looks in a row that say it moves.
    """

    track: Track
    since: float
    moved: int = 0


class Contacts:
    """All targets that a UAV knows of, and its own tracks.

    Parameters
    ----------
    agent : id. sigma : m, of measurements. minimum : m, targets nearer than this are not told apart.
    """

    def __init__(self, agent: str, sigma: float, minimum: float) -> None:
        self.agent = agent
        self.sigma = sigma
        self.minimum = minimum
        self.known: dict[str, Contact] = {}
        self.changed: dict[str, float] = {}
        self.tracker = Tracker(noise=0.15, sigma=sigma, speed=5.0, confirm=(3, 6), delete=8)
        self.candidates: dict[int, Candidate] = {}
        self.task_of: dict[int, str] = {}
        self._count = 0
        self._close: dict[tuple[str, str], int] = {}

    def look(self, now: float, measured: FloatArray, x: float, y: float, radius: float) -> None:
        """Take in one look from (x, y) that reaches `radius` m."""
        tracks = self.tracker.tracks
        seen = [math.hypot(float(one.mean[0]) - x, float(one.mean[1]) - y) <= radius for one in tracks]
        self.tracker.look(now, measured, seen)
        alive = {track.number: track for track in self.tracker.tracks}
        # A track that nobody has looked at for long says nothing any more.
        self.tracker.tracks = [track for track in alive.values() if self._fresh(track, now)]
        alive = {track.number: track for track in self.tracker.tracks}
        self.candidates = {number: one for number, one in self.candidates.items() if number in alive}
        self.task_of = {number: task for number, task in self.task_of.items() if number in alive}
        for number, track in alive.items():
            if not track.confirmed or number in self.candidates:
                continue
            task = self.task_of.get(number)
            if task is None or task not in self.known or self.known[task].over:
                task = self.match(track, now)
                if task is None:
                    self.candidates[number] = Candidate(track, now)
                else:
                    self.task_of[number] = task
            if task is not None and track.misses == 0:
                self._refresh(task, track, now)

    def _fresh(self, track: Track, now: float) -> bool:
        spread = math.sqrt(max(float(track.covariance[0, 0]), float(track.covariance[1, 1])))
        return spread < 40.0 * self.sigma

    def match(self, track: Track, now: float) -> str | None:
        """Return the nearest known contact that a track cannot be told apart from; None if there is none."""
        best, nearest = None, math.inf
        for task, contact in self.known.items():
            if contact.over:
                continue
            apart = self._apart(float(track.mean[0]), float(track.mean[1]), contact, now)
            if apart < nearest and apart <= self._reach(contact, now):
                best, nearest = task, apart
        return best

    def _apart(self, x: float, y: float, contact: Contact, now: float) -> float:
        ahead = min(now - contact.t, FORESIGHT) if contact.moving else 0.0
        return math.hypot(x - contact.x - contact.vx * ahead, y - contact.y - contact.vy * ahead)

    def _reach(self, contact: Contact, now: float) -> float:
        aged = DRIFT * (now - contact.t) if contact.moving else 0.0
        spread = math.sqrt(GATE) * OWN * math.hypot(contact.sigma, self.sigma)
        return min(max(self.minimum, spread) + aged, 6.0 * self.minimum)

    def decided(self, now: float) -> list[tuple[int, bool, str]]:
        """Return candidates whose type is known: number, whether it moves, and the evidence in words."""
        found = []
        for number, one in sorted(self.candidates.items()):
            moves = one.track.moves(SLOWEST)
            # A test at 99 % is wrong now and then if it is asked every second.
            one.moved = one.moved + 1 if moves else 0
            if moves and (one.moved < SURE_LOOKS or one.track.hits < SURE_HITS):
                moves = None
            waited = now - one.since
            if moves is None and waited < PATIENCE:
                continue
            speed = math.hypot(float(one.track.mean[2]), float(one.track.mean[3]))
            spread = math.sqrt(max(float(one.track.covariance[2, 2]), float(one.track.covariance[3, 3])))
            about = f"{speed:.1f} m/s give or take {spread:.1f} after {one.track.hits} detections"
            found.append((number, bool(moves), about))
        return found

    def unclear(self, now: float) -> tuple[float, float] | None:
        """Return where to look closer: a detection not yet confirmed, or a contact of unknown type."""
        for track in self.tracker.tracks:
            if track.number in self.candidates:
                return float(track.mean[0]), float(track.mean[1])
        for track in self.tracker.tracks:
            if not track.confirmed and self.match(track, now) is None:
                return float(track.mean[0]), float(track.mean[1])
        return None

    def open(self, number: int, moving: bool, now: float) -> Contact:
        """Make a known contact of a candidate."""
        one = self.candidates.pop(number)
        self._count += 1
        task = f"{self.agent}-t{self._count}"
        contact = _contact(task, self.agent, one.since, moving, one.track, now)
        self.task_of[number] = task
        self._put(contact, now)
        return contact

    def matched(self, now: float) -> None:
        """Give up candidates that turn out to be contacts which others have told of meanwhile."""
        for number, one in sorted(self.candidates.items()):
            task = self.match(one.track, now)
            if task is not None:
                del self.candidates[number]
                self.task_of[number] = task

    def merge(self, contacts: Iterable[Contact], now: float) -> None:
        """Take in what another knows: what is over stays so, else the later estimate counts."""
        for heard in contacts:
            mine = self.known.get(heard.task)
            if mine is None or _rank(heard) > _rank(mine):
                self._put(heard, now)

    def doubles(self, now: float) -> list[tuple[str, str]]:
        """Return pairs (the one that counts, the other) of contacts that cannot be told apart.

        It counts how often two moving ones were together, so call it at equal times.
        """
        live = sorted(
            (one for one in self.known.values() if not one.over),
            key=lambda one: (one.found_at, one.by, one.task),
        )
        pairs, gone, close = [], set[str](), dict[tuple[str, str], int]()
        for row, first in enumerate(live):
            for second in live[row + 1 :]:
                if first.task in gone or second.task in gone or first.by == second.by:
                    continue
                if first.moving != second.moving and abs(first.t - second.t) > PATIENCE:
                    continue
                ahead = second.t - first.t
                x = first.x + (first.vx * ahead if first.moving else 0.0)
                y = first.y + (first.vy * ahead if first.moving else 0.0)
                reach = self.minimum + 0.2 * DRIFT * abs(ahead) * first.moving
                alike = math.hypot(first.vx - second.vx, first.vy - second.vy) <= ALIKE
                near = alike and math.hypot(x - second.x, y - second.y) <= reach
                pair = (first.task, second.task)
                close[pair] = self._close.get(pair, 0) + 1 if near else 0
                # Two that cross are near each other for a moment only.
                if near and (not (first.moving or second.moving) or close[pair] >= TOGETHER):
                    pairs.append(pair)
                    gone.add(second.task)
        self._close = close
        return pairs

    def close(self, task: str, now: float) -> None:
        """Nobody need look for a contact any more."""
        old = self.known[task]
        if not old.over:
            fields = {name: getattr(old, name) for name in old.__struct_fields__} | {"over": True}
            self._put(Contact(**fields), now)

    def track(self, task: str) -> Track | None:
        """Return this UAV's own track of a contact: of several the one seen last."""
        found = [track for track in self.tracker.tracks if self.task_of.get(track.number) == task]
        return min(found, key=lambda track: (track.misses, -track.number), default=None)

    def where(self, task: str, now: float) -> tuple[float, float]:
        """Return where a contact should be now, m."""
        contact = self.known[task]
        ahead = min(now - contact.t, FORESIGHT) if contact.moving else 0.0
        return contact.x + contact.vx * ahead, contact.y + contact.vy * ahead

    def _refresh(self, task: str, track: Track, now: float) -> None:
        old = self.known[task]
        if old.over:
            return
        self._put(_contact(task, old.by, old.found_at, old.moving, track, now), now)

    def _put(self, contact: Contact, now: float) -> None:
        old = self.known.get(contact.task)
        self.known[contact.task] = contact
        if old is None or old.over != contact.over or contact.moving:
            self.changed[contact.task] = now


def _rank(contact: Contact) -> tuple[object, ...]:
    """What orders two contacts of one task, the same aboard every UAV, whatever was heard first."""
    exact = (-contact.sigma, contact.x, contact.y, contact.vx, contact.vy)
    return (contact.over, contact.t, *exact, contact.by, contact.found_at, contact.moving)


def _contact(task: str, by: str, found_at: float, moving: bool, track: Track, now: float) -> Contact:
    x, y, vx, vy = (float(one) for one in np.asarray(track.mean))
    spread = math.sqrt(max(float(track.covariance[0, 0]), float(track.covariance[1, 1])))
    if not moving:
        vx = vy = 0.0
    return Contact(task, by, found_at, moving, now, x, y, vx, vy, spread)
