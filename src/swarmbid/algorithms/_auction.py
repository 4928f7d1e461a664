"""What CBAA and CBBA share: two phases, one conversation.

An algorithm of this family is a decision table, a bundle limit and a rule for what stays of the old
bundle. Everything else stands here: what a message changes, building, what is said, local commands.

What an agent says: the beliefs that changed since its last message, and those on which a neighbour was
heard to differ. Messages of one sender build on each other; who misses one notices at the next, drops it
(its stamps are newer than what it leaves out) and asks for the full state, which is also sent every
`full_every` messages.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from swarmbid.algorithms._beliefs import DONE_BID, BeliefTable, translated
from swarmbid.algorithms._bundle import Bundle
from swarmbid.algorithms._conversation import Conversation, check_options
from swarmbid.algorithms._voice import FULL_AFTER_ASKED, BeliefsVoice
from swarmbid.arrays import NO_AGENT, MissionArrays
from swarmbid.errors import Fault
from swarmbid.kernels.bundle import BID, PATH, START
from swarmbid.kernels.consensus import TO_SEND, TO_WEIGH
from swarmbid.messages import Beliefs, Message, MessageError
from swarmbid.model import Mission, Position, Task
from swarmbid.negotiator import TaskOutbid, TaskReleased, TaskTaken
from swarmbid.scores import Score, make_score

STARTED_BID = DONE_BID / 2.0
"""Bid on a task that has been started: nobody outbids it, but it is open again if its agent is lost."""


class ConsensusAuction(Conversation[BeliefsVoice]):
    """An auction in two phases: bid on what pays, agree with the neighbours on who won.

    Parameters
    ----------
    agent_id : which agent of the mission.
    mission : the mission, or its arrays (share them between agents of one process).
    score : see `swarmbid.scores.make_score`.
    insertion : "hold", "shift" or "append"; the score's own by default.
    warp : bids never rise along a bundle (Johnson et al. 2012), so that any score converges.
    rebuild : build the bundle afresh whenever something changed; False keeps what was not outbid.
    stamps : "originator" (the sender's own counter, relayed unchanged) or "reception" (the papers'
        time of reception, which needs equal clocks).
    period : s between two messages at most. heartbeat : s between messages when all agree.
    full_every : messages between two full states; 1 sends the full state always, as the papers do.
    idle_every : periods between two messages of an agent that has no news but does not know yet that all
        agree; 1 speaks every period, as the papers do.
    incarnation : count it up whenever the agent starts again with nothing remembered.
    """

    DECISIONS: ClassVar[NDArray[np.int8]]
    """The decision table, packed (`swarmbid.kernels.consensus`)."""

    def __init__(
        self,
        agent_id: str,
        mission: Mission | MissionArrays,
        score: str | Score | None = None,
        *,
        insertion: str | None = None,
        warp: bool = True,
        rebuild: bool = True,
        stamps: str = "originator",
        period: float = 1.0,
        heartbeat: float = 10.0,
        full_every: int = 200,
        idle_every: int = 4,
        incarnation: int = 1,
    ) -> None:
        faults = []
        if stamps not in ("originator", "reception"):
            mend = "Give 'originator' or 'reception'."
            faults.append(Fault(f"agent {agent_id}", "stamps", f"is {stamps!r}", mend))
        arrays = check_options(
            agent_id, mission, insertion, period=period, heartbeat=heartbeat, faults=faults,
            full_every=full_every, idle_every=idle_every,
        )  # fmt: skip
        voice = BeliefsVoice(agent_id, arrays.num_agents, incarnation=incarnation, full_every=full_every)
        super().__init__(agent_id, arrays, voice, period=period, heartbeat=heartbeat, idle_every=idle_every)
        self._rebuild = rebuild
        self._reception = stamps == "reception"
        found = make_score(score)
        agent = arrays.agents[self._me]
        self._bundle = Bundle(
            arrays, self._me, found,
            limit=self._limit(arrays.bundle_limit(agent)), insertion=insertion or found.insertion, warp=warp,
        )  # fmt: skip
        self._beliefs = BeliefTable(arrays, self._me)
        self._started: list[tuple[int, float]] = []

    def _limit(self, limit: int) -> int:
        """Most tasks at once."""
        return limit

    def _kept(self) -> int:
        """How many tasks of the bundle, counted from its first, stay without question."""
        if self._rebuild:
            return 0
        still = self._beliefs.winner[self._bundle.tasks] == self._me
        return int(np.argmin(still)) if not still.all() else self._bundle.length

    # --- the conversation

    def _understand(self, message: Message) -> Message:
        if not isinstance(message, Beliefs):
            raise MessageError("malformed", "is of another algorithm")
        return translated(message, self._arrays)

    def _missed(self, sender: int, message: Message) -> str | None:
        assert isinstance(message, Beliefs)
        if message.asked.size and self._me in message.asked:
            self._voice.repeat(FULL_AFTER_ASKED)
        if message.since > self._received[sender]:
            self._voice.asked.add(sender)
            return "gap"
        self._voice.asked.discard(sender)
        return None

    def _absorb(self, sender: int, message: Message, now: float) -> None:
        assert isinstance(message, Beliefs)
        heard = message.heard
        if self._reception:
            heard = heard.copy()
            heard[sender] = round(now * 1e6) + 1  # whole microseconds; 0 would be "nothing heard"
        self._beliefs.resolve(self.DECISIONS, sender, message, heard)

    def _decide(self, now: float) -> None:
        if self._must_build or self._beliefs.pending & TO_WEIGH:
            self._build()

    def _news(self) -> bool:
        return bool(self._beliefs.pending & TO_SEND)

    def _say(self, now: float, *, heartbeat: bool) -> Message:
        return self._voice.say(
            now, self._beliefs, self._agreement, self._left,
            own_stamps=not self._reception, settled=self._agreed, heartbeat=heartbeat,
        )  # fmt: skip

    def _build(self) -> None:
        """Phase 1, and what it changes in the beliefs."""
        bundle, beliefs = self._bundle, self._beliefs
        changed, build = bundle.to_weigh(beliefs.take_flagged(TO_WEIGH), beliefs.bid, beliefs.winner)
        if not build and not self._must_build:
            return
        before = bundle.tasks.copy()
        bids = bundle.marks[BID, : bundle.length].copy()
        lost = [row for row in before.tolist() if beliefs.winner[row] != self._me]
        bundle.build(beliefs.bid, beliefs.winner, changed, self._kept())
        beliefs.claim(before, bundle.order, bundle.marks, bundle.length)
        self._must_build = False
        self._report(before, bids, lost)

    def _report(self, before: NDArray[np.int64], bids: Any, lost: list[int]) -> None:
        """Turn the difference between the old and the new bundle into events."""
        bundle, beliefs = self._bundle, self._beliefs
        marks, ids = bundle.marks, self._arrays.task_ids
        after, new_bids = bundle.tasks.tolist(), marks[BID, : bundle.length].tolist()
        held, old_bids = before.tolist(), bids.tolist()
        if after == held and new_bids == old_bids and not lost:
            return
        now_held = set(after)
        because = None
        for row, bid in zip(held, old_bids, strict=True):
            if row in now_held:
                continue
            winner = int(beliefs.winner[row])
            if row in lost and winner != NO_AGENT:
                by = self._arrays.agent_ids[winner]
                self._events.append(TaskOutbid(ids[row], bid, by, float(beliefs.bid[row])))
                because = because or ids[row]
            else:
                self._events.append(TaskReleased(ids[row], because))
        held_before = dict(zip(held, old_bids, strict=True))
        places = bundle.order[PATH, : bundle.length].tolist()
        for row, bid in zip(after, new_bids, strict=True):
            if held_before.get(row) != bid or row in lost:
                place = places.index(row)
                self._events.append(TaskTaken(ids[row], bid, place, float(marks[START, place])))

    # --- what the driver may ask

    @property
    def path(self) -> list[tuple[str, float]]:
        """Started tasks first, then the path (p_i, τ_i)."""
        ids = self._arrays.task_ids
        return [(ids[row], start) for row, start in [*self._started, *self._bundle.path]]

    @property
    def bundle(self) -> list[str]:
        """Task ids in order of taking (b_i)."""
        return [self._arrays.task_ids[row] for row in self._bundle.tasks.tolist()]

    @property
    def digest(self) -> int:
        """See `Negotiator.digest`."""
        return self._beliefs.digest

    def beliefs(self) -> dict[str, tuple[tuple[str, float], ...]]:
        """See `Negotiator.beliefs`."""
        return self._beliefs.as_dict()

    def heard(self) -> dict[str, int]:
        """How new the news of each agent is (s_i); -1 if nothing was heard."""
        return dict(zip(self._arrays.agent_ids, self._beliefs.heard.tolist(), strict=True))

    # --- local commands

    def add_task(self, task: Task) -> None:
        """See `Negotiator.add_task`."""
        old = self._arrays
        mission = replace(old.mission, tasks=(*old.mission.tasks, task))
        self._arrays = MissionArrays(mission)
        self._beliefs = self._beliefs.moved_to(self._arrays)
        self._bundle = self._bundle.moved_to(self._arrays)
        self._started = [(self._arrays.task_row[old.task_ids[row]], start) for row, start in self._started]
        self._change()

    def cancel_task(self, task_id: str) -> None:
        """See `Negotiator.cancel_task`."""
        row = self._row(task_id)
        self._bundle.close(row)
        self._started = [(started, start) for started, start in self._started if started != row]
        if self._beliefs.winner[row] != NO_AGENT:
            self._beliefs.set(row, NO_AGENT, 0.0)
        self._change()

    def start_task(self, task_id: str, now: float) -> None:
        """See `Negotiator.start_task`."""
        row = self._row(task_id)
        task = self._arrays.tasks[row]
        self._bundle.take_out(row)
        self._bundle.close(row)
        self._bundle.move(task.position, now + task.duration)
        self._started.append((row, now))
        self._beliefs.set(row, self._me, STARTED_BID)
        self._change()

    def finish_task(self, task_id: str, now: float) -> None:
        """See `Negotiator.finish_task`. The belief stays, so that nobody does the task again."""
        row = self._row(task_id)
        if row not in [started for started, _ in self._started]:
            raise ValueError(f"task {task_id} was not started by {self.agent_id}; call start_task first")
        self._started = [(started, start) for started, start in self._started if started != row]
        self._bundle.move(self._arrays.tasks[row].position, now)
        self._beliefs.set(row, self._me, DONE_BID)
        self._change()

    def set_position(self, position: Position, now: float) -> None:
        """See `Negotiator.set_position`."""
        self._bundle.move(position, now)
        self._change()

    def leave(self) -> None:
        """See `Negotiator.leave`. What has been started is finished, so it is not open to others."""
        for row in self._bundle.tasks.tolist():
            if self._beliefs.winner[row] == self._me:
                self._beliefs.set(row, NO_AGENT, 0.0)
            self._events.append(TaskReleased(self._arrays.task_ids[row], None))
        for row, _ in self._started:
            self._beliefs.set(row, self._me, DONE_BID)
        self._bundle.drop_all()
        self._leave()

    # --- who has left

    def _open_what_is_left(self) -> None:
        for row in self._left:
            gone = self._gone(row)
            self._agreement.wait_for(row, not gone)
            if gone and row != self._me:
                self._beliefs.open_all_of(row)

    def _newest(self, row: int) -> int:
        newest = super()._newest(row)
        return newest if self._reception else max(newest, int(self._beliefs.heard[row]))
