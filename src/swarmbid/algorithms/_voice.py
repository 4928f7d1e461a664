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
    """Makes an agent's messages, each built on the last or holding the full state.

    Parameters
    ----------
    agent_id : the sender. num_agents : of the roster.
    incarnation : of the sender; its stamps begin with it.
    full_every : messages between two full states.

    Attributes
    ----------
    stamp : of the last message, and of all that the agent believes of itself.
    asked : rows of agents whose full state is wanted, because a message of theirs was missed.
    full_for : full states still to be sent.
    last_spoken : s.
    """

    def __init__(self, agent_id: str, num_agents: int, *, incarnation: int, full_every: int) -> None:
        self.agent_id = agent_id
        self.full_every = full_every
        self.stamp = incarnation * INCARNATION
        self.asked: set[int] = set()
        self.full_for = 0
        self.last_spoken = -math.inf
        self._previous = 0
        self._since_full = 0
        self._told_heard: StampArray = np.full(num_agents, NOT_LISTED, np.int64)
        self._told_digest = -1
        self._digest_at = 0

    def has_news(self, digest: int) -> bool:
        """Whether something is wanted or untold, changed beliefs aside."""
        return self.full_for > 0 or bool(self.asked) or digest != self._told_digest

    def repeat(self, times: int = 1) -> None:
        """Send the full state in the next messages."""
        self.full_for = max(self.full_for, times)

    def reincarnate(self, after: int) -> None:
        """Speak on with stamps above `after`."""
        self.stamp = after + 1
        self.repeat()

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
        self.stamp += 1
        if own_stamps:
            beliefs.heard[beliefs.me] = self.stamp
        digest = beliefs.digest
        if digest != self._told_digest:
            self._told_digest = digest
            self._digest_at = self.stamp
        tasks, winners, bids, heard = beliefs.compose(full, self._told_heard)
        holders, held_at = agreement.tell(digest, everything=full)
        message = Beliefs(
            sender=self.agent_id,
            sequence=self.stamp,
            since=0 if full else self._previous,
            agent_ids=arrays.agent_ids,
            task_ids=arrays.task_ids,
            heard=heard,
            tasks=tasks,
            winners=winners,
            bids=bids,
            digest=digest,
            digest_at=self._digest_at,
            agreed=holders,
            agreed_at=held_at,
            asked=np.array(sorted(self.asked), np.int32) if self.asked else NO_ROWS,
            left=np.array(list(left), np.int32) if left else NO_ROWS,
            left_at=np.array(list(left.values()), np.int64) if left else NO_STAMPS,
            settled=settled,
        )
        self._previous = self.stamp
        self._since_full = 0 if full else self._since_full + 1
        self.full_for = max(self.full_for - 1, 0)
        self.last_spoken = now
        return message
