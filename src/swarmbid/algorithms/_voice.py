"""What an agent has told its neighbours, and how it says what is new."""

from __future__ import annotations

import math

import numpy as np

from swarmbid.algorithms._agreement import Agreement
from swarmbid.algorithms._beliefs import BeliefTable
from swarmbid.arrays import IntArray, StampArray
from swarmbid.messages import INCARNATION, NOT_LISTED, Beliefs

FULL_AFTER_ASKED = 30
"""Full states sent in a row once one was asked for: a link that lost one message loses more."""
NO_ROWS: IntArray = np.zeros(0, np.int32)
NO_STAMPS: StampArray = np.zeros(0, np.int64)


class Voice:
    """What every kind of message needs: stamps, when to repeat, and since when the digest holds.

    Parameters
    ----------
    agent_id : the sender.
    incarnation : of the sender; its stamps begin with it.

    Attributes
    ----------
    stamp : of the last message.
    full_for : full states still to be sent.
    last_spoken : s.
    """

    def __init__(self, agent_id: str, *, incarnation: int) -> None:
        self.agent_id = agent_id
        self.stamp = incarnation * INCARNATION
        self.full_for = 0
        self.last_spoken = -math.inf
        self._told_digest = -1
        self._digest_at = 0

    def has_news(self, digest: int) -> bool:
        """Whether something is wanted or untold, the content aside."""
        return self.full_for > 0 or digest != self._told_digest

    def repeat(self, times: int = 1) -> None:
        """Send the full state in the next messages."""
        self.full_for = max(self.full_for, times)

    def reincarnate(self, after: int) -> None:
        """Speak on with stamps above `after`."""
        self.stamp = after + 1
        self.repeat()

    def next_stamp(self, now: float, digest: int) -> tuple[int, int]:
        """Count the next message; return its stamp, and the stamp since when `digest` holds."""
        self.stamp += 1
        self.last_spoken = now
        self.full_for = max(self.full_for - 1, 0)
        if digest != self._told_digest:
            self._told_digest = digest
            self._digest_at = self.stamp
        return self.stamp, self._digest_at


class BeliefsVoice(Voice):
    """Makes messages of beliefs, each built on the last or holding the full state.

    Parameters
    ----------
    num_agents : of the roster.
    full_every : messages between two full states.

    Attributes
    ----------
    asked : rows of agents whose full state is wanted, because a message of theirs was missed.
    """

    def __init__(self, agent_id: str, num_agents: int, *, incarnation: int, full_every: int) -> None:
        super().__init__(agent_id, incarnation=incarnation)
        self.full_every = full_every
        self.asked: set[int] = set()
        self._previous = 0
        self._since_full = 0
        self._told_heard: StampArray = np.full(num_agents, NOT_LISTED, np.int64)

    def has_news(self, digest: int) -> bool:
        """Whether something is wanted or untold, changed beliefs aside."""
        return bool(self.asked) or super().has_news(digest)

    def say(
        self,
        now: float,
        beliefs: BeliefTable,
        agreement: Agreement,
        left: dict[int, int],
        *,
        own_stamps: bool,
        settled: bool,
        heartbeat: bool,
    ) -> Beliefs:
        """Return the next message, and remember what it told.

        Parameters
        ----------
        left : rows of agents that are gone, with the last stamp that this covers.
        own_stamps : whether the sender stamps its news itself (or receivers do, by their clocks).
        settled : whether all agree. heartbeat : whether it is time for the full state anyway.
        """
        arrays = beliefs.arrays
        full = (
            self._previous == 0 or heartbeat or self.full_for > 0 or self._since_full >= self.full_every - 1
        )
        digest = beliefs.digest
        stamp, digest_at = self.next_stamp(now, digest)
        if own_stamps:
            beliefs.heard[beliefs.me] = stamp
        tasks, winners, bids, heard = beliefs.compose(full, self._told_heard)
        holders, held_at = agreement.tell(digest, everything=full)
        message = Beliefs(
            sender=self.agent_id,
            sequence=stamp,
            since=0 if full else self._previous,
            agent_ids=arrays.agent_ids,
            task_ids=arrays.task_ids,
            heard=heard,
            tasks=tasks,
            winners=winners,
            bids=bids,
            digest=digest,
            digest_at=digest_at,
            agreed=holders,
            agreed_at=held_at,
            asked=np.array(sorted(self.asked), np.int32) if self.asked else NO_ROWS,
            left=np.array(list(left), np.int32) if left else NO_ROWS,
            left_at=np.array(list(left.values()), np.int64) if left else NO_STAMPS,
            settled=settled,
        )
        self._previous = stamp
        self._since_full = 0 if full else self._since_full + 1
        return message
