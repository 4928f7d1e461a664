"""The whole matrix of bids, as triples [agent, task, bid]: what CBGA as printed says (Hunt 2014).

Wire format::

    ["assignments", version, sender, sequence, agents, heard, tasks, rows, holders, bids, arrivals, digest,
     digest_at, agreed, agreed_at, left, left_at, settled]

`agents` and `tasks` are ids joined by newlines, each once, the agents with a stamp first; `rows` and
`holders` say for each bid which of them it is about. Bids and times are float64. The times are absent
where they are all 0.
"""

from __future__ import annotations

from dataclasses import dataclass

import msgspec
import numpy as np

from swarmbid.messages._base import Message
from swarmbid.messages._columns import (
    NOT_LISTED,
    VERSION,
    FloatArray,
    IntArray,
    IntColumn,
    MessageError,
    StampArray,
    check_head,
    ids,
    pack,
    pack_stamps,
    unpack,
    unpack_stamps,
)

_encoder = msgspec.msgpack.Encoder()


@dataclass(frozen=True, eq=False)
class Assignments(Message):
    """Every bid that one agent knows of.

    Parameters
    ----------
    sender : id.
    sequence : stamp of this message, the sender's own counter (see `INCARNATION`).
    agent_ids, task_ids : the tables that rows below refer to.
    heard : int64[len(agent_ids)], how new the sender's news of each agent is (s_k); NOT_LISTED for none.
    tasks, holders : int32[n], rows: which task each bid is for, and whose it is.
    bids : float64[n] (x_ij).
    arrivals : float64[n], s: when the holder arrives at the task; 0 in the literal reading.
    digest : hash of all the sender's bids. digest_at : stamp since when it holds.
    agreed : int32[m], rows of agents known to have held the same digest; agreed_at : int64[m], since.
    left : int32[q], rows of agents that are gone; left_at : int64[q], the stamps of their last word.
    settled : whether the sender has seen every live agent hold its digest.
    """

    sender: str
    sequence: int
    agent_ids: tuple[str, ...]
    task_ids: tuple[str, ...]
    heard: StampArray
    tasks: IntArray
    holders: IntArray
    bids: FloatArray
    arrivals: FloatArray
    digest: int
    digest_at: int
    agreed: IntArray
    agreed_at: StampArray
    left: IntArray
    left_at: StampArray
    settled: bool = False

    def __post_init__(self) -> None:
        if not self.tasks.size == self.holders.size == self.bids.size == self.arrivals.size:
            raise MessageError("malformed", "the columns of the bids differ in length")
        # A NaN fails the comparison, and so does an infinite or a negative number.
        for reason, column in (("bid", self.bids), ("time", self.arrivals)):
            if column.size and not (column.min() >= 0.0 and column.max() < np.inf):
                raise MessageError(reason, f"a {reason} is not a finite number of at least 0")

    @property
    def full(self) -> bool:
        """It always is the sender's whole state."""
        return True

    @property
    def entries(self) -> int:
        """Triples that it tells of."""
        return self.bids.size

    def encode(self) -> bytes:
        """Return the bytes of a message, with the ids that it mentions and no others."""
        agents = _mentioned(self)
        tasks = np.unique(self.tasks)
        rank = np.zeros(len(self.agent_ids), np.int64)
        rank[agents] = np.arange(agents.size)
        top = agents.size
        return _encoder.encode(
            AssignmentsWire(
                version=VERSION,
                sender=self.sender,
                sequence=self.sequence,
                agents="\n".join([self.agent_ids[row] for row in agents.tolist()]),
                heard=pack_stamps(self.heard[self.heard != NOT_LISTED]),
                tasks="\n".join([self.task_ids[row] for row in tasks.tolist()]),
                rows=pack(np.searchsorted(tasks, self.tasks), tasks.size),
                holders=pack(rank[self.holders], top),
                bids=self.bids.astype("<f8").tobytes(),
                arrivals=self.arrivals.astype("<f8").tobytes() if self.arrivals.any() else b"",
                digest=self.digest,
                digest_at=self.digest_at,
                agreed=pack(rank[self.agreed], top),
                agreed_at=pack_stamps(self.agreed_at),
                left=pack(rank[self.left], top),
                left_at=pack_stamps(self.left_at),
                settled=self.settled,
            )
        )


class AssignmentsWire(msgspec.Struct, array_like=True, tag="assignments", frozen=True):
    """The fields in their order on the wire."""

    version: int
    sender: str
    sequence: int
    agents: str
    heard: bytes
    tasks: str
    rows: bytes
    holders: bytes
    bids: bytes
    arrivals: bytes
    digest: int
    digest_at: int
    agreed: bytes
    agreed_at: bytes
    left: bytes
    left_at: bytes
    settled: bool

    def message(self) -> Assignments:
        """Return the message; MessageError if it says what cannot be."""
        check_head(self.version, self.sender, self.sequence, self.digest, self.digest_at)
        agents, tasks = ids(self.agents), ids(self.tasks)
        top = len(agents)
        stamped = unpack_stamps(self.heard)
        if stamped.size > top:
            raise MessageError("malformed", "there are more stamps than agents")
        heard = np.full(top, NOT_LISTED, np.int64)
        heard[: stamped.size] = stamped
        rows = unpack(self.rows, len(tasks), len(tasks))
        holders = unpack(self.holders, top, top)
        if np.unique(rows * top + holders).size != rows.size:
            raise MessageError("malformed", "an agent bids twice for a task")
        agreed, left = unpack(self.agreed, top, top), unpack(self.left, top, top)
        agreed_at, left_at = unpack_stamps(self.agreed_at), unpack_stamps(self.left_at)
        if agreed.size != agreed_at.size or left.size != left_at.size:
            raise MessageError("malformed", "two columns that belong together differ in length")
        return Assignments(
            sender=self.sender,
            sequence=self.sequence,
            agent_ids=agents,
            task_ids=tasks,
            heard=heard,
            tasks=rows.astype(np.int32),
            holders=holders.astype(np.int32),
            bids=_numbers(self.bids),
            arrivals=_numbers(self.arrivals) if self.arrivals else np.zeros(rows.size),
            digest=self.digest,
            digest_at=self.digest_at,
            agreed=agreed.astype(np.int32),
            agreed_at=agreed_at,
            left=left.astype(np.int32),
            left_at=left_at,
            settled=self.settled,
        )


def _mentioned(message: Assignments) -> IntColumn:
    """Return the rows of all agents mentioned, those with a stamp first."""
    stamped = message.heard != NOT_LISTED
    rest = np.zeros(len(message.agent_ids), np.bool_)
    for column in (message.holders, message.agreed, message.left):
        rest[column] = True
    return np.concatenate([np.flatnonzero(stamped), np.flatnonzero(rest & ~stamped)])


def _numbers(data: bytes) -> FloatArray:
    if len(data) % 8:
        raise MessageError("malformed", "a column is cut off")
    return np.frombuffer(data, "<f8").copy()
