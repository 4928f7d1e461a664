"""What one agent believes about who wins what, and how messages change it."""

from __future__ import annotations

import sys
from typing import Any

import numpy as np
from numpy.typing import NDArray

from swarmbid.arrays import NO_AGENT, FloatArray, IntArray, MissionArrays, StampArray
from swarmbid.kernels import consensus, wire
from swarmbid.messages import NOT_LISTED, Beliefs, MessageError

DONE_BID = sys.float_info.max
"""Bid on a task that is done, or that its agent finishes as it leaves: it is never open again."""


class BeliefTable:
    """Winning agents, winning bids and stamps of one agent, with the digest of the first two.

    Attributes
    ----------
    winner : int32[num_tasks], rows (z_i). bid : float64[num_tasks] (y_i).
    heard : int64[num_agents], how new the news of each agent is (s_i).
    flags : uint8[num_tasks], TO_SEND and TO_WEIGH of `swarmbid.kernels.consensus`.
    """

    def __init__(self, arrays: MissionArrays, me: int) -> None:
        self.arrays = arrays
        self.me = me
        self.winner: IntArray = np.full(arrays.num_tasks, NO_AGENT, np.int32)
        self.bid = np.zeros(arrays.num_tasks)
        self.heard: StampArray = np.full(arrays.num_agents, NOT_LISTED, np.int64)
        self.flags: NDArray[np.uint8] = np.zeros(arrays.num_tasks, np.uint8)
        self._bits = self.bid.view(np.uint64)
        self._digest = np.zeros(1, np.uint64)
        self.refresh_digest()

    @property
    def digest(self) -> int:
        """Hash of the beliefs; equal beliefs have equal digests at every agent."""
        return int(self._digest[0])

    def refresh_digest(self) -> None:
        """Count the digest anew from the beliefs."""
        arrays = self.arrays
        self._digest[0] = consensus.digest_of(arrays.task_hash, arrays.agent_hash, self.winner, self._bits)

    def resolve(self, rules: NDArray[np.int8], sender: int, message: Beliefs, heard: StampArray) -> None:
        """Apply a message. `heard` : the sender's stamps, by row."""
        arrays = self.arrays
        consensus.resolve(
            rules, self.me, sender, message.full, self.winner, self.bid, self._bits, self.heard, self.flags,
            arrays.task_hash, arrays.agent_hash, self._digest,
            message.tasks, message.winners, message.bids, heard,
        )  # fmt: skip

    def compose(self, full: bool, told: StampArray) -> tuple[IntArray, IntArray, FloatArray, StampArray]:
        """Return the columns of the next message; see `swarmbid.kernels.wire.compose`."""
        return wire.compose(full, self.winner, self.bid, self.flags, self.heard, told)  # type: ignore[no-any-return]

    @property
    def pending(self) -> int:
        """All flags of all tasks, joined."""
        return int(consensus.any_flags(self.flags))

    def take_flagged(self, flag: int) -> IntArray:
        """Return the rows that carry `flag`, and take it off them."""
        return consensus.take_flagged(self.flags, flag)  # type: ignore[no-any-return]

    def claim(self, before: NDArray[np.int64], order: Any, marks: Any, length: int) -> None:
        """Make the beliefs agree with the agent's new bundle."""
        arrays = self.arrays
        consensus.claim(
            self.me, before, order, marks, length, self.winner, self.bid, self._bits, self.flags,
            arrays.task_hash, arrays.agent_hash, self._digest,
        )  # fmt: skip

    def set(self, row: int, winner: int, bid: float) -> None:
        """Set one belief, to be sent and weighed."""
        arrays = self.arrays
        consensus.believe(
            row, winner, bid, self.winner, self.bid, self._bits,
            arrays.task_hash, arrays.agent_hash, self._digest,
        )  # fmt: skip
        self.flags[row] |= consensus.TO_SEND | consensus.TO_WEIGH

    def open_all_of(self, agent: int) -> None:
        """Forget every win of an agent that is gone, but for what is done."""
        rows = np.flatnonzero((self.winner == agent) & (self.bid < DONE_BID))
        for row in rows.tolist():
            self.set(row, NO_AGENT, 0.0)

    def as_dict(self) -> dict[str, tuple[tuple[str, float], ...]]:
        """Task id -> (winner's id, winning bid), or nothing."""
        ids = self.arrays.agent_ids
        return {
            task_id: () if winner == NO_AGENT else ((ids[winner], bid),)
            for task_id, winner, bid in zip(
                self.arrays.task_ids, self.winner.tolist(), self.bid.tolist(), strict=True
            )
        }

    def moved_to(self, arrays: MissionArrays) -> BeliefTable:
        """Return the same beliefs in the rows of a mission that has tasks added."""
        moved = BeliefTable(arrays, arrays.agent_row[self.arrays.agent_ids[self.me]])
        rows = [arrays.task_row[task_id] for task_id in self.arrays.task_ids]
        moved.winner[rows] = self.winner
        moved.bid[rows] = self.bid
        moved.flags[rows] = self.flags
        moved.heard[:] = self.heard
        moved.refresh_digest()
        return moved


def translated(message: Beliefs, arrays: MissionArrays) -> Beliefs:
    """Return `message` in the rows of `arrays`; itself if it is in them already.

    Raises
    ------
    MessageError : it names a task or an agent that is not known here.
    """
    if message.task_ids is arrays.task_ids and message.agent_ids is arrays.agent_ids:
        return message
    try:
        agents = np.array([arrays.agent_row[name] for name in message.agent_ids] + [NO_AGENT], np.int32)
        tasks = np.array([arrays.task_row[name] for name in message.task_ids], np.int32)
    except KeyError as error:
        raise MessageError("unknown_id", f"{error.args[0]!r} is not known here") from None
    heard = np.full(arrays.num_agents, NOT_LISTED, np.int64)
    heard[agents[:-1]] = message.heard
    return Beliefs(
        sender=message.sender,
        sequence=message.sequence,
        since=message.since,
        agent_ids=arrays.agent_ids,
        task_ids=arrays.task_ids,
        heard=heard,
        tasks=tasks[message.tasks],
        winners=agents[message.winners],
        bids=message.bids,
        digest=message.digest,
        digest_at=message.digest_at,
        agreed=agents[message.agreed],
        agreed_at=message.agreed_at,
        asked=agents[message.asked],
        left=agents[message.left],
        left_at=message.left_at,
        settled=message.settled,
    )
