"""What CBAA and CBBA share: two phases, one conversation.

An algorithm of this family is a decision table, a bundle limit and a rule for what stays of the old
bundle. Everything else stands here: taking in messages, building, speaking, agreement, local commands.

How an agent speaks. At most once a `period`, it broadcasts the beliefs that changed since its last
message, and those on which a neighbour was heard to differ. Messages of one sender build on each other;
who misses one notices at the next, drops it (its stamps are newer than what it leaves out) and asks for
the full state, which is also sent every `full_every` messages. An agent speaks on, and its stamp
advances, until it has seen every live agent hold its digest; then it is silent but for a heartbeat.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from swarmbid.algorithms._agreement import Agreement
from swarmbid.algorithms._beliefs import DONE_BID, BeliefTable, translated
from swarmbid.algorithms._bundle import RULES, Bundle
from swarmbid.algorithms._voice import FULL_AFTER_ASKED, Voice
from swarmbid.arrays import NO_AGENT, MissionArrays, StampArray
from swarmbid.errors import Fault, InputError
from swarmbid.kernels.bundle import BID, PATH, START
from swarmbid.kernels.consensus import TO_SEND, TO_WEIGH
from swarmbid.messages import INCARNATION, Beliefs, Message, MessageError
from swarmbid.model import Mission, Position, Task
from swarmbid.negotiator import (
    Agreed,
    Doubted,
    Event,
    MessageDropped,
    Negotiator,
    TaskOutbid,
    TaskReleased,
    TaskTaken,
)
from swarmbid.scores import Score, make_score

STARTED_BID = DONE_BID / 2.0
"""Bid on a task that has been started: nobody outbids it, but it is open again if its agent is lost."""


class ConsensusAuction(Negotiator):
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
        arrays = mission if isinstance(mission, MissionArrays) else MissionArrays(mission)
        self.agent_id = agent_id
        self.period = period
        self.heartbeat = heartbeat
        self.idle_every = idle_every
        self._rebuild = rebuild
        self._reception = stamps == "reception"
        self._check(arrays, insertion, stamps, full_every)
        self._arrays = arrays
        self._me = arrays.agent_row[agent_id]
        found = make_score(score)
        agent = arrays.agents[self._me]
        self._bundle = Bundle(
            arrays, self._me, found,
            limit=self._limit(arrays.bundle_limit(agent)), insertion=insertion or found.insertion, warp=warp,
        )  # fmt: skip
        self._beliefs = BeliefTable(arrays, self._me)
        self._agreement = Agreement(arrays.num_agents, self._me)
        self._received: StampArray = np.zeros(arrays.num_agents, np.int64)
        self._voice = Voice(agent_id, arrays.num_agents, incarnation=incarnation, full_every=full_every)
        self._started: list[tuple[int, float]] = []
        self._left: dict[int, int] = {}
        self._agreed = False
        self._must_build = True
        self._events: list[Event] = []
        self._due = -np.inf
        self._busy = True

    def _check(self, arrays: MissionArrays, insertion: str | None, stamps: str, full_every: int) -> None:
        where = f"agent {self.agent_id}"
        faults = []
        if self.agent_id not in arrays.agent_row:
            faults.append(Fault(where, "id", "is not in the mission", "Name one of its agents."))
        if insertion is not None and insertion not in RULES:
            mend = "Choose one of: " + ", ".join(RULES) + "."
            faults.append(Fault(where, "insertion", f"is {insertion!r}", mend))
        if stamps not in ("originator", "reception"):
            faults.append(Fault(where, "stamps", f"is {stamps!r}", "Give 'originator' or 'reception'."))
        if min(full_every, self.idle_every) < 1 or not self.period > 0.0 or not self.heartbeat >= self.period:
            mend = "Give full_every and idle_every of 1 or more, a period above 0 s, a heartbeat no shorter."
            faults.append(Fault(where, "period, heartbeat, full_every, idle_every", "do not fit", mend))
        if faults:
            raise InputError(faults)

    def _limit(self, limit: int) -> int:
        """Most tasks at once."""
        return limit

    def _kept(self) -> int:
        """How many tasks of the bundle, counted from its first, stay without question."""
        if self._rebuild:
            return 0
        still = self._beliefs.winner[self._bundle.tasks] == self._me
        return int(np.argmin(still)) if not still.all() else self._bundle.length

    # --- the door in

    def receive(self, message: Message, now: float) -> None:
        """Take in one message; see `Negotiator.receive`."""
        reason = self._take_in(message, now)
        if reason is not None:
            self._events.append(MessageDropped(str(getattr(message, "sender", "?")), reason))

    def _take_in(self, message: Message, now: float) -> str | None:
        """Return why the message was dropped, or None."""
        if not isinstance(message, Beliefs):
            return "malformed"
        sender = self._arrays.agent_row.get(message.sender)
        if sender is None:
            return "unknown_sender"
        if sender == self._me:
            return "own"
        last = int(self._received[sender])
        if message.sequence <= last:
            return "stale"
        if message.sequence <= self._left.get(sender, 0):
            return "gone"
        try:
            message = translated(message, self._arrays)
        except MessageError as error:
            return error.reason
        self._busy = True
        # What is said of digests stands on its own, so it counts even where the beliefs cannot.
        self._agreement.hear(sender, message)
        if message.asked.size and self._me in message.asked:
            self._voice.repeat(FULL_AFTER_ASKED)
        if message.since > last:
            self._voice.asked.add(sender)
            return "gap"
        self._received[sender] = message.sequence
        self._voice.asked.discard(sender)
        heard = message.heard
        if self._reception:
            heard = heard.copy()
            heard[sender] = round(now * 1e6) + 1  # whole microseconds; 0 would be "nothing heard"
        if message.left.size:
            for row, stamp in zip(message.left.tolist(), message.left_at.tolist(), strict=True):
                self._note_left(row, stamp)
        self._beliefs.resolve(self.DECISIONS, sender, message, heard)
        if self._left:
            self._open_what_is_left()
        if self._agreed and not message.settled and now - self._voice.last_spoken >= 2.0 * self.period:
            # Somebody still doubts though we have long been silent: a word of ours was lost.
            self._voice.repeat()
        return None

    # --- the door out

    def next_tick(self) -> float | None:
        """When there is something to weigh or to say; see `Negotiator.next_tick`."""
        if self._busy:
            return float(self._due)
        if self._leaving:
            return None
        return float(self._voice.last_spoken + self.heartbeat)

    def tick(self, now: float) -> list[Message]:
        """Build if bids changed, then speak if there is something to say; see `Negotiator.tick`."""
        if now < self._due:
            return []
        self._due = now + self.period
        pending = self._beliefs.pending
        if not self._leaving and (self._must_build or pending & TO_WEIGH):
            self._build()
            pending = self._beliefs.pending
        digest = self._beliefs.digest
        agreed = self._agreement.reached(digest)
        if agreed != self._agreed:
            self._agreed = agreed
            self._events.append(Agreed() if agreed else Doubted())
        voice = self._voice
        silent_for = now - voice.last_spoken
        heartbeat = silent_for >= self.heartbeat
        speak = (
            heartbeat
            or (not agreed and silent_for >= self.idle_every * self.period)
            or voice.has_news(digest)
            or self._agreement.has_news(digest)
            or bool(pending & TO_SEND)
        )
        if self._leaving:
            speak = voice.full_for > 0  # a last word, a few times over; then silence
        self._busy = voice.full_for > 1 or not (agreed or self._leaving)
        if not speak:
            if not self._busy:
                self._due = -np.inf
            return []
        return [
            voice.say(
                now, self._beliefs, self._agreement, self._left,
                own_stamps=not self._reception, settled=agreed, heartbeat=heartbeat,
            )
        ]  # fmt: skip

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

    def events(self) -> list[Event]:
        """Drain the events; see `Negotiator.events`."""
        drained, self._events = self._events, []
        return drained

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
    def agreed(self) -> bool:
        """See `Negotiator.agreed`; as of the last tick."""
        return self._agreed

    @property
    def digest(self) -> int:
        """See `Negotiator.digest`."""
        return self._beliefs.digest

    def beliefs(self) -> dict[str, tuple[str | None, float]]:
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
        self._left[self._me] = _last_stamp(self._voice.stamp)
        self._voice.repeat(FULL_AFTER_ASKED)
        self._change()

    def lose_agent(self, agent_id: str) -> None:
        """See `Negotiator.lose_agent`. It counts as gone until it speaks as a new incarnation."""
        if agent_id not in self._arrays.agent_row:
            raise ValueError(f"agent {agent_id} is not in the mission")
        row = self._arrays.agent_row[agent_id]
        self._note_left(row, _last_stamp(max(self._newest(row), INCARNATION)))
        self._open_what_is_left()

    def _note_left(self, row: int, stamp: int) -> None:
        """An agent is gone, with all that it said up to `stamp`."""
        if row == self._me:
            if stamp >= self._voice.stamp and not self._leaving:
                # Somebody gave us up, but we are here: speak on as a new incarnation.
                self._voice.reincarnate(stamp)
        elif stamp > self._left.get(row, 0):
            self._left[row] = stamp
            self._voice.repeat()
        self._busy = True

    def _open_what_is_left(self) -> None:
        """What agents that are gone had won is open again, whoever still says otherwise."""
        for row, stamp in self._left.items():
            gone = self._newest(row) <= stamp
            self._agreement.wait_for(row, not gone)
            if gone and row != self._me:
                self._beliefs.open_all_of(row)

    def _newest(self, row: int) -> int:
        """The newest stamp that an agent is known to have given itself."""
        newest = max(int(self._received[row]), self._agreement.newest(row))
        return newest if self._reception else max(newest, int(self._beliefs.heard[row]))

    @property
    def _leaving(self) -> bool:
        return self._me in self._left

    def _row(self, task_id: str) -> int:
        if task_id not in self._arrays.task_row:
            raise ValueError(f"task {task_id} is not known to {self.agent_id}; call add_task first")
        return self._arrays.task_row[task_id]

    def _change(self) -> None:
        self._must_build = True
        self._busy = True


def _last_stamp(stamp: int) -> int:
    """The last stamp of the incarnation that `stamp` belongs to."""
    return (stamp // INCARNATION + 1) * INCARNATION - 1
