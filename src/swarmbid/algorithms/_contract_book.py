"""What one agent knows of one task: who calls for it, who answers what, and how far it has come.

The outcome that all agents must agree on follows from the live acts alone, by rules that everybody
applies alike; what an agent plays itself, as manager or as contractor, is kept beside it.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Container
from dataclasses import dataclass, field

from swarmbid.arrays import MissionArrays
from swarmbid.messages.acts import CONFIRM, FAILURE, INFORM, PROPOSE, REFUSE, RESULT, Act
from swarmbid.model import Task, distance

STARTED, CONTRACTED = "started", "contracted"
HAND_OVER, TAKE_OVER, FAILED = "hand-over", "take-over", "failed"


@dataclass(frozen=True)
class Outcome:
    """How far a task has come, as one agent knows it.

    Parameters
    ----------
    state : "open", "contracted", "started", "done", "failed", "cancelled" or "unserved". Of the last two
        kinds that nobody could do, a task may be taken up again while its window is open.
    agent : id of who holds it or did it; empty for nobody. reason : why nobody did.
    epoch : of its last contract or award; it only rises.
    """

    state: str
    agent: str = ""
    reason: str = ""
    epoch: int = 0


@dataclass
class Book:
    """All about one task that is not over.

    Parameters
    ----------
    id, task : the task; None while only its id was heard of.
    found : whether others may not know it, so that calls must describe it. me : row of this agent.

    Attributes
    ----------
    calls, answers, asides : newest act of each agent's row as manager, as contractor, and in neither role.
    stage, part : states of this agent as manager and as contractor.
    epoch, asked : of the call that this agent makes, and the one that answers must be newer than.
    chosen : row of the agent that it has awarded the task, -1 for none.
    parked : the last word of who leads or led, if that was that nobody can do the task.
    floor : the highest epoch that this agent has heard of; what is said under a lower one is outdated.
    deadline : s, when it stops waiting for answers or for a confirmation.
    vacant : s, since when nobody leads, if that is so.
    tries : calls in a row that nobody took up. vain : awards in a row that nobody confirmed in time.
    barred : row -> act that was awarded in vain.
    """

    id: str
    task: Task | None = None
    found: bool = False
    me: int = -1
    calls: dict[int, Act] = field(default_factory=dict)
    answers: dict[int, Act] = field(default_factory=dict)
    asides: dict[int, Act] = field(default_factory=dict)
    stage: str = "idle"
    epoch: int = 0
    asked: int = 0
    chosen: int = -1
    deadline: float = math.inf
    vacant: float = math.inf
    tries: int = 0
    vain: int = 0
    barred: dict[int, int] = field(default_factory=dict)
    handing: bool = False
    keep: bool = False
    part: str = "idle"
    failed_here: bool = False
    bid: float = 0.0
    held_epoch: int = 0
    floor: int = 0
    parked: Act | None = None
    declined: tuple[str, int] = ("", 0)
    _succession: dict[int, int] = field(default_factory=dict)
    _top: tuple[int, Act] | None = None
    _known_top: bool = False

    def changed(self) -> None:
        """Forget what follows from acts."""
        self._known_top = False

    def succession(self, arrays: MissionArrays) -> dict[int, int]:
        """Row of agent -> its place among those who are to manage the task: by distance, then id."""
        if not self._succession and self.task is not None:
            place = self.task.position
            order = sorted(
                range(arrays.num_agents), key=lambda row: (distance(arrays.agents[row].position, place), row)
            )
            self._succession = {row: rank for rank, row in enumerate(order)}
        return self._succession

    def top(self, arrays: MissionArrays) -> tuple[int, Act] | None:
        """The manager whose word counts, and its word: highest epoch, then first in the succession."""
        if not self._known_top:
            ranks = self.succession(arrays)
            self._top = max(
                self.calls.items(),
                key=lambda item: (item[1].epoch, -ranks.get(item[0], item[0])),
                default=None,
            )
            self._known_top = True
            if self._top is not None:
                act = self._top[1]
                self.parked = act if act.performative in (RESULT, FAILURE) else None
        return self._top

    def turn(self, arrays: MissionArrays, absent: Container[int], me: int) -> int:
        """How many that are not gone come before an agent in the succession."""
        turn = 0
        for row in self.succession(arrays):
            if row == me:
                break
            turn += row not in absent
        return turn

    def holder(self, but: int = -1) -> int:
        """Row of who says that it holds the task, -1 for nobody.

        Of several the one that has started it, then that of the highest epoch, then of the highest id.
        """
        best, best_key = -1, (False, -1)
        for row, act in sorted(self.answers.items()):
            key = (act.reason == STARTED, act.epoch)
            if act.performative == INFORM and row != but and key >= best_key:
                best, best_key = row, key
        return best

    def outcome(self, arrays: MissionArrays) -> Outcome:
        """How far the task has come; follows from the acts that were heard.

        What is said under an epoch that is known to be over counts no more, but for a task that is under
        way: its manager will lift it. A contract lasts until its contractor says that it has failed. What
        this agent itself has begun is its own until it is over.
        """
        ids = arrays.agent_ids
        holder = self.me if self.part == STARTED else self.holder()
        if holder >= 0 and self.answers[holder].reason == STARTED:
            return Outcome(STARTED, ids[holder], "", self.floor)
        top = self.top(arrays)
        if top is not None and top[1].epoch >= self.floor:
            act = top[1]
            if act.performative == INFORM and not self._given_back(arrays, act):
                return Outcome(CONTRACTED, act.to, "", self.floor)
        if holder >= 0 and (top is None or top[1].epoch >= self.floor):
            return Outcome(CONTRACTED, ids[holder], "", self.floor)  # its manager is gone, or a hand-over
        if self.parked is not None:
            return Outcome(self.parked_as, "", self.parked.reason, self.floor)
        return Outcome("open", "", "", self.floor)

    def _given_back(self, arrays: MissionArrays, contract: Act) -> bool:
        """Whether who is under contract has failed since or given the task back; its manager will call."""
        act = self.answers.get(arrays.agent_row[contract.to])
        return act is not None and act.performative == FAILURE and act.epoch >= contract.epoch

    @property
    def parked_as(self) -> str:
        """State of a task that nobody can do; empty if it is not parked."""
        if self.parked is None:
            return ""
        return "unserved" if self.parked.performative == RESULT else FAILED

    def bid_of(self, arrays: MissionArrays, agent_id: str) -> float:
        """What the agent that holds the task had bid for it."""
        own = self.answers.get(arrays.agent_row.get(agent_id, -1))
        if own is not None and own.performative in (INFORM, CONFIRM):
            return own.bid
        top = self.top(arrays)
        return top[1].bid if top is not None else 0.0

    def all_answered(self, rows: list[int]) -> bool:
        """Whether these agents have all answered the call."""
        answers = self.answers
        for row in rows:
            act = answers.get(row)
            if act is None or act.asked < self.asked or act.performative not in (PROPOSE, REFUSE, FAILURE):
                return False
        return True

    def proposals(self) -> dict[int, Act]:
        """Proposals that can be awarded, by row."""
        return {
            row: act
            for row, act in self.answers.items()
            if act.performative == PROPOSE and act.asked >= self.asked and self.barred.get(row) != act.number
        }

    def proposals_since(self, asked: int) -> dict[int, Act]:
        """Proposals for the call of an epoch, barred or not, by row."""
        return {
            row: act
            for row, act in self.answers.items()
            if act.performative == PROPOSE and act.asked >= asked
        }

    def reply_to(self, act: Act) -> int:
        """Number of the award that was declined in this conversation, else of the call."""
        manager, number = self.declined
        return number if manager == act.manager else act.number

    def reasons(self) -> str:
        """Why nobody proposes, counted."""
        counts = Counter(act.reason for act in self.answers.values() if act.performative in (REFUSE, FAILURE))
        return ", ".join(f"{reason} {count}" for reason, count in sorted(counts.items()))
