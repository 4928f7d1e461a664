"""What every negotiator that agrees by digests does alike: the door in, the door out, who has left.

How an agent speaks. At most once a `period`, it broadcasts what its neighbours may not know yet. While
it does not know that all agree, it speaks every `idle_every` periods even without news, for what was
lost on the way; once it has seen every live agent hold its digest it is silent but for a heartbeat.

An algorithm says what its messages mean (`_understand`, `_absorb`), how it decides (`_decide`), and what
it says (`_news`, `_say`); everything around that stands here, once.
"""

from __future__ import annotations

from abc import abstractmethod
from typing import Generic, TypeVar

import numpy as np

from swarmbid.algorithms._agreement import Agreement
from swarmbid.algorithms._bundle import RULES
from swarmbid.algorithms._voice import FULL_AFTER_ASKED, Voice
from swarmbid.arrays import MissionArrays, StampArray
from swarmbid.errors import Fault, InputError
from swarmbid.messages import INCARNATION, Message, MessageError
from swarmbid.model import Mission
from swarmbid.negotiator import Agreed, Doubted, Event, MessageDropped, Negotiator

V = TypeVar("V", bound=Voice)


class Conversation(Negotiator, Generic[V]):
    """One agent's side of a conversation that ends when all digests are equal.

    Parameters
    ----------
    agent_id : which agent of the mission.
    arrays : of the mission.
    voice : makes its messages.
    period : s between two messages at most. heartbeat : s between messages when all agree.
    idle_every : periods between two messages of an agent that has no news but does not know yet that all
        agree; 1 speaks every period, as the papers do.
    """

    def __init__(
        self,
        agent_id: str,
        arrays: MissionArrays,
        voice: V,
        *,
        period: float,
        heartbeat: float,
        idle_every: int,
    ) -> None:
        self.agent_id = agent_id
        self.period = period
        self.heartbeat = heartbeat
        self.idle_every = idle_every
        self._arrays = arrays
        self._me = arrays.agent_row[agent_id]
        self._agreement = Agreement(arrays.num_agents, self._me)
        self._received: StampArray = np.zeros(arrays.num_agents, np.int64)
        self._voice = voice
        self._left: dict[int, int] = {}
        self._agreed = False
        self._must_build = True
        self._events: list[Event] = []
        self._due = -np.inf
        self._busy = True

    # --- what an algorithm adds

    @abstractmethod
    def _understand(self, message: Message) -> Message:
        """Return a message in the agent's own rows; MessageError if it is none of this algorithm's."""

    def _missed(self, sender: int, message: Message) -> str | None:
        """Return why a message cannot be built upon, or None."""
        return None

    @abstractmethod
    def _absorb(self, sender: int, message: Message, now: float) -> None:
        """Take in what a message says."""

    def _hear_from_gone(self, message: Message, now: float) -> None:
        """Take in what stands even if it is said by one that is gone: nothing, for most."""

    @abstractmethod
    def _decide(self, now: float) -> None:
        """Weigh what was taken in and change the agent's own plan, if anything changed."""

    def _news(self) -> bool:
        """Whether the neighbours may not know something that the voice does not know of."""
        return False

    @abstractmethod
    def _say(self, now: float, *, heartbeat: bool) -> Message:
        """Return the next message, and remember what it told."""

    @abstractmethod
    def _open_what_is_left(self) -> None:
        """What agents that are gone had won is open again, whoever still says otherwise."""

    def _satisfied(self, now: float) -> bool:
        """Whether the agent leaves it at that, now that all agree."""
        return True

    # --- the door in

    def receive(self, message: Message, now: float) -> None:
        """Take in one message; see `Negotiator.receive`."""
        reason = self._take_in(message, now)
        if reason is not None:
            self._events.append(MessageDropped(str(getattr(message, "sender", "?")), reason))

    def _take_in(self, message: Message, now: float) -> str | None:
        """Return why the message was dropped, or None."""
        if not isinstance(message, Message):
            return "malformed"
        sender = self._arrays.agent_row.get(message.sender)
        if sender is None:
            return "unknown_sender"
        if sender == self._me:
            return "own"
        if message.sequence <= self._received[sender]:
            return "stale"
        try:
            message = self._understand(message)
        except MessageError as error:
            return error.reason
        self._busy = True
        # What is said of digests stands on its own, so it counts even where the rest cannot.
        self._agreement.hear(sender, message)
        if message.sequence <= self._left.get(sender, 0):
            # Two that gave each other up would stay deaf to each other for ever.
            for row, stamp in zip(message.left.tolist(), message.left_at.tolist(), strict=True):
                if row == self._me:
                    self._note_left(row, stamp)
            self._hear_from_gone(message, now)
            return "gone"
        reason = self._missed(sender, message)
        if reason is not None:
            return reason
        self._received[sender] = message.sequence
        if message.left.size:
            for row, stamp in zip(message.left.tolist(), message.left_at.tolist(), strict=True):
                self._note_left(row, stamp)
        self._absorb(sender, message, now)
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
        """Decide if something changed, then speak if there is something to say; see `Negotiator.tick`."""
        if now < self._due:
            return []
        self._due = now + self.period
        if not self._leaving:
            self._decide(now)
        agreed = self._agreement.reached(self.digest) and (self._leaving or self._satisfied(now))
        digest = self.digest
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
            or self._news()
        )
        if self._leaving:
            speak = voice.full_for > 0  # a last word, a few times over; then silence
        self._busy = voice.full_for > 1 or not (agreed or self._leaving)
        if not speak:
            if not self._busy:
                self._due = -np.inf
            return []
        return [self._say(now, heartbeat=heartbeat)]

    # --- what the driver may ask

    def events(self) -> list[Event]:
        """Drain the events; see `Negotiator.events`."""
        drained, self._events = self._events, []
        return drained

    @property
    def agreed(self) -> bool:
        """See `Negotiator.agreed`; as of the last tick."""
        return self._agreed

    # --- who has left

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

    def _leave(self) -> None:
        """Say for the last time, and a few times over, that this agent is gone."""
        self._left[self._me] = _last_stamp(self._voice.stamp)
        self._voice.repeat(FULL_AFTER_ASKED)
        self._change()

    def _gone(self, row: int) -> bool:
        """Whether nothing newer is known of an agent than that it is gone."""
        return self._newest(row) <= self._left.get(row, 0)

    def _newest(self, row: int) -> int:
        """The newest stamp that an agent is known to have given itself."""
        return max(int(self._received[row]), self._agreement.newest(row))

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


def check_options(
    agent_id: str,
    mission: Mission | MissionArrays,
    insertion: str | None,
    *,
    insertions: tuple[str, ...] = tuple(RULES),
    period: float,
    heartbeat: float,
    faults: list[Fault],
    **counts: int,
) -> MissionArrays:
    """Return the mission's arrays; InputError with all that is wrong, `faults` included.

    Parameters
    ----------
    insertions : the rules that the algorithm knows.
    counts : options that must be 1 or more, by name.
    """
    arrays = mission if isinstance(mission, MissionArrays) else MissionArrays(mission)
    where = f"agent {agent_id}"
    found = []
    if agent_id not in arrays.agent_row:
        found.append(Fault(where, "id", "is not in the mission", "Name one of its agents."))
    if insertion is not None and insertion not in insertions:
        mend = "Choose one of: " + ", ".join(insertions) + "."
        found.append(Fault(where, "insertion", f"is {insertion!r}", mend))
    found += faults
    if min(counts.values()) < 1 or not period > 0.0 or not heartbeat >= period:
        names = " and ".join(counts)
        mend = f"Give {names} of 1 or more, a period above 0 s, a heartbeat no shorter."
        found.append(Fault(where, ", ".join(["period, heartbeat", *counts]), "do not fit", mend))
    if found:
        raise InputError(found)
    return arrays


def _last_stamp(stamp: int) -> int:
    """The last stamp of the incarnation that `stamp` belongs to."""
    return (stamp // INCARNATION + 1) * INCARNATION - 1
