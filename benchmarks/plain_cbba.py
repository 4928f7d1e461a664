"""CBBA as one writes it first: plain Python, lists, whole states sent to everybody every round.

Written for comparison, from the decision table and Algorithm 1 of the papers (Choi, Brunet and How 2009),
with bids that never rise along a bundle (Johnson et al. 2012). Time-discounted rewards; later tasks may
be delayed. It shares no code with swarmbid.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, field
from typing import Any

NOBODY = -1

Stop = tuple[tuple[float, float, float], float]
"""Where it is, and when it is left, s."""


@dataclass
class Bidder:
    """One agent: where it is, what it believes, what it has taken.

    Attributes
    ----------
    bids, winners : per task, the best bid known (y) and whose it is (z).
    heard : per agent, the round of the newest news about it (s).
    bundle : tasks in order of taking, with the bids they were taken with. path : in order of visit.
    """

    me: int
    data: dict[str, Any]
    bids: list[float] = field(default_factory=list)
    winners: list[int] = field(default_factory=list)
    heard: list[int] = field(default_factory=list)
    bundle: list[tuple[int, float]] = field(default_factory=list)
    path: list[int] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.tasks = self.data["tasks"]
        self.agent = self.data["agents"][self.me]
        self.bids = [0.0] * len(self.tasks)
        self.winners = [NOBODY] * len(self.tasks)
        self.heard = [0] * len(self.data["agents"])

    def score_from(self, place: tuple[float, float, float], leaves: float, path: list[int]) -> float:
        """Score of visiting `path` from `place`, leaving it at `leaves` s; -inf if a window is missed."""
        total = 0.0
        x, y, z = place
        for j in path:
            task = self.tasks[j]
            leg = math.sqrt((task["x"] - x) ** 2 + (task["y"] - y) ** 2 + (task["z"] - z) ** 2)
            start = max(leaves + leg / self.agent["speed"], task["start"])
            if start > task["end"]:
                return -math.inf
            total += task["value"] * math.exp(-task["discount"] * (start - task["start"]))
            leaves = start + task["duration"]
            x, y, z = task["x"], task["y"], task["z"]
        return total

    def best_insertion(
        self, j: int, stops: list[tuple[tuple[float, float, float], float]]
    ) -> tuple[float, int]:
        """Return the gain of task `j` at its best place, and the place."""
        best, best_place = -math.inf, 0
        for n in range(len(self.path) + 1):
            suffix = self.path[n:]
            gain = self.score_from(*stops[n], [j, *suffix]) - self.score_from(*stops[n], suffix)
            if gain > best:
                best, best_place = gain, n
        return best, best_place

    def stops(self) -> list[Stop]:
        """Return where and when the agent leaves its own place and each stop of its path."""
        found = [((self.agent["x"], self.agent["y"], self.agent["z"]), self.agent["availability"])]
        for j in self.path:
            task = self.tasks[j]
            (x, y, z), leaves = found[-1]
            leg = math.sqrt((task["x"] - x) ** 2 + (task["y"] - y) ** 2 + (task["z"] - z) ** 2)
            start = max(leaves + leg / self.agent["speed"], task["start"])
            found.append(((task["x"], task["y"], task["z"]), start + task["duration"]))
        return found

    def build(self) -> None:
        """Phase 1: take the best task while its bid wins."""
        while len(self.bundle) < self.data["bundle_limit"]:
            ceiling = self.bundle[-1][1] if self.bundle else math.inf
            stops = self.stops()
            best, best_task, best_place = 0.0, NOBODY, 0
            for j in range(len(self.tasks)):
                if j in self.path:
                    continue
                gain, place = self.best_insertion(j, stops)
                bid = min(gain, ceiling)
                wins = bid > self.bids[j] or (bid == self.bids[j] and self.me > self.winners[j])
                if wins and gain > best:
                    best, best_task, best_place = gain, j, place
            if best_task == NOBODY:
                return
            bid = min(best, ceiling)
            self.bundle.append((best_task, bid))
            self.path.insert(best_place, best_task)
            self.bids[best_task], self.winners[best_task] = bid, self.me

    def resolve(self, sender: Bidder, now: int) -> bool:
        """Phase 2: apply the decision table to one neighbour's state; return whether anything changed."""
        changed = False
        me, k = self.me, sender.me
        s, s_k = self.heard, sender.heard
        for j in range(len(self.tasks)):
            theirs, mine = sender.winners[j], self.winners[j]
            bid, own = sender.bids[j], self.bids[j]
            better = bid > own or (bid == own and theirs > mine)
            action = "leave"
            if theirs == k:
                if mine == me:
                    action = "update" if better else "leave"
                elif mine in (k, NOBODY) or s_k[mine] > s[mine] or better:
                    action = "update"
            elif theirs == me:
                if mine == k or (mine not in (me, NOBODY) and s_k[mine] > s[mine]):
                    action = "reset"
            elif theirs == NOBODY:
                if mine == k or (mine not in (me, NOBODY) and s_k[mine] > s[mine]):
                    action = "update"
            else:
                newer = s_k[theirs] > s[theirs]
                if mine == me:
                    action = "update" if newer and better else "leave"
                elif mine == k:
                    action = "update" if newer else "reset"
                elif mine in (theirs, NOBODY):
                    action = "update" if newer else "leave"
                elif newer and (s_k[mine] > s[mine] or better):
                    action = "update"
                elif s_k[mine] > s[mine] and s[theirs] > s_k[theirs]:
                    action = "reset"
            if action == "update" and (theirs, bid) != (mine, own):
                self.winners[j], self.bids[j] = theirs, bid
                changed = True
            elif action == "reset":
                self.winners[j], self.bids[j] = NOBODY, 0.0
                changed = True
        for m in range(len(s)):
            s[m] = max(s[m], s_k[m])
        s[k] = now
        return changed

    def release(self) -> None:
        """Give up the first task that was lost and all that were taken after it."""
        for n, (j, _) in enumerate(self.bundle):
            if self.winners[j] != self.me:
                for later, _ in self.bundle[n:]:
                    self.path.remove(later)
                    if self.winners[later] == self.me:
                        self.winners[later], self.bids[later] = NOBODY, 0.0
                del self.bundle[n:]
                return

    def copy(self) -> Bidder:
        """Return what is sent: the whole state."""
        other = Bidder(self.me, self.data)
        other.bids, other.winners, other.heard = self.bids[:], self.winners[:], self.heard[:]
        return other


@dataclass(frozen=True)
class Outcome:
    """What came of a run: total score, rounds until nothing changed, CPU s, whether it was finished."""

    total: float
    rounds: int
    seconds: float
    finished: bool


def run(data: dict[str, Any], cap: float = math.inf) -> Outcome:
    """Negotiate over a complete graph until a round changes nothing, or for `cap` s of CPU.

    Parameters
    ----------
    data : an instance as `benchmarks.instances.load` gives it.
    """
    begin = time.process_time()
    bidders = [Bidder(me, data) for me in range(len(data["agents"]))]
    rounds = 0
    while True:
        rounds += 1
        before = [one.winners[:] for one in bidders]
        for one in bidders:
            one.build()
        messages = [one.copy() for one in bidders]
        changed = False
        for one in bidders:
            for message in messages:
                if message.me != one.me:
                    changed = one.resolve(message, rounds) or changed
            one.release()
        seconds = time.process_time() - begin
        finished = not changed and before == [one.winners for one in bidders]
        if finished or seconds > cap:
            total = sum(one.score_from(*one.stops()[0], one.path) for one in bidders)
            return Outcome(total, rounds, seconds, finished)
