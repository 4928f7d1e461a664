"""Beliefs about who wins which task, all of them or what changed: what CBAA and CBBA say.

Wire format::

    ["beliefs", version, sender, sequence, since, agents, heard, tasks, winners, bids, digest, digest_at,
     agreed, agreed_at, asked, left, left_at, settled]

`agents` and `tasks` are ids joined by newlines, the agents with a stamp first. A winner's row one past
the last is nobody. Bids are float64, for tasks with a winner only.
"""

from __future__ import annotations

from dataclasses import dataclass

import msgspec
import numpy as np

from swarmbid.messages._base import Message
from swarmbid.messages._columns import (
    NOBODY,
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
    width,
)

_encoder = msgspec.msgpack.Encoder()


@dataclass(frozen=True, eq=False)
class Beliefs(Message):
    """What one agent believes about who wins which task: all of it, or what changed.

    Parameters
    ----------
    sender : id.
    sequence : stamp of this message, the sender's own counter (see `INCARNATION`).
    since : stamp of the message that this one builds on; 0 if it holds the full state.
    agent_ids, task_ids : the tables that rows below refer to.
    heard : int64[len(agent_ids)], how new the sender's news of each agent is (s_k); NOT_LISTED where
        that has not changed since `since`.
    tasks : int32[n], rows. Tasks not listed are unchanged, or have no winner in a full state.
    winners : int32[n], rows of agents (z_k), NOBODY for none.
    bids : float64[n], winning bids (y_k), 0 where there is no winner.
    digest : hash of all the sender's beliefs. digest_at : stamp since when it holds.
    agreed : int32[m], rows of agents known to have held the same digest; agreed_at : int64[m], since.
    asked : int32[p], rows of agents whose full state the sender wants, having missed something.
    settled : whether the sender has seen every live agent hold its digest.
    left : int32[q], rows of agents that are gone; left_at : int64[q], the stamps of their last word.
    """

    sender: str
    sequence: int
    since: int
    agent_ids: tuple[str, ...]
    task_ids: tuple[str, ...]
    heard: StampArray
    tasks: IntArray
    winners: IntArray
    bids: FloatArray
    digest: int
    digest_at: int
    agreed: IntArray
    agreed_at: StampArray
    asked: IntArray
    left: IntArray
    left_at: StampArray
    settled: bool = False

    def __post_init__(self) -> None:
        bids = self.bids
        # One comparison for all: a NaN fails it, and so does an infinite or a negative bid.
        if bids.size and not (bids.min() >= 0.0 and bids.max() < np.inf):
            raise MessageError("bid", "a bid is not a finite number of at least 0")

    @property
    def full(self) -> bool:
        """Whether this is the sender's whole state."""
        return self.since == 0

    @property
    def entries(self) -> int:
        """Tasks that it tells of."""
        return self.tasks.size

    def encode(self) -> bytes:
        """Return the bytes of a message, with the ids that it mentions and no others."""
        stamped, mentioned = _mentioned(self)
        rank = np.zeros(len(self.agent_ids) + 1, np.int64)
        rank[mentioned] = np.arange(mentioned.size)
        rank[NOBODY] = mentioned.size
        top = mentioned.size
        return _encoder.encode(
            BeliefsWire(
                version=VERSION,
                sender=self.sender,
                sequence=self.sequence,
                since=self.since,
                agents="\n".join([self.agent_ids[row] for row in mentioned.tolist()]),
                heard=pack_stamps(self.heard[stamped]),
                tasks="\n".join([self.task_ids[row] for row in self.tasks.tolist()]),
                winners=pack(rank[self.winners], top),
                bids=self.bids[self.winners != NOBODY].astype("<f8").tobytes(),
                digest=self.digest,
                digest_at=self.digest_at,
                agreed=pack(rank[self.agreed], top),
                agreed_at=pack_stamps(self.agreed_at),
                asked=pack(rank[self.asked], top),
                left=pack(rank[self.left], top),
                left_at=pack_stamps(self.left_at),
                settled=self.settled,
            )
        )


class BeliefsWire(msgspec.Struct, array_like=True, tag="beliefs", frozen=True):
    """The fields in their order on the wire."""

    version: int
    sender: str
    sequence: int
    since: int
    agents: str
    heard: bytes
    tasks: str
    winners: bytes
    bids: bytes
    digest: int
    digest_at: int
    agreed: bytes
    agreed_at: bytes
    asked: bytes = b""
    left: bytes = b""
    left_at: bytes = b""
    settled: bool = False

    def message(self) -> Beliefs:
        """Return the message; MessageError if it says what cannot be."""
        check_head(self.version, self.sender, self.sequence, self.digest, self.digest_at)
        if not 0 <= self.since < self.sequence:
            raise MessageError("stamp", "a message builds on a later one")
        agents, tasks = ids(self.agents), ids(self.tasks)
        top = len(agents)
        stamped = unpack_stamps(self.heard)
        if stamped.size > top:
            raise MessageError("malformed", "there are more stamps than agents")
        heard = np.full(top, NOT_LISTED, np.int64)
        heard[: stamped.size] = stamped
        winners = unpack(self.winners, top, top + 1)
        if winners.size != len(tasks):
            raise MessageError("malformed", "there is not one winner for each task")
        won = winners != top
        winners[~won] = NOBODY
        if len(self.bids) != 8 * int(np.count_nonzero(won)):
            raise MessageError("malformed", "there is not one bid for each winner")
        bids = np.zeros(len(tasks))
        bids[won] = np.frombuffer(self.bids, "<f8")
        agreed, left = unpack(self.agreed, top, top), unpack(self.left, top, top)
        agreed_at, left_at = unpack_stamps(self.agreed_at), unpack_stamps(self.left_at)
        if agreed.size != agreed_at.size or left.size != left_at.size:
            raise MessageError("malformed", "two columns that belong together differ in length")
        return Beliefs(
            sender=self.sender,
            sequence=self.sequence,
            since=self.since,
            agent_ids=agents,
            task_ids=tasks,
            heard=heard,
            tasks=np.arange(len(tasks), dtype=np.int32),
            winners=winners.astype(np.int32),
            bids=bids,
            digest=self.digest,
            digest_at=self.digest_at,
            agreed=agreed.astype(np.int32),
            agreed_at=agreed_at,
            asked=unpack(self.asked, top, top).astype(np.int32),
            left=left.astype(np.int32),
            left_at=left_at,
            settled=self.settled,
        )


@dataclass(frozen=True)
class Counts:
    """What the size of a message follows from, besides its own numbers.

    Parameters
    ----------
    agents : how many are mentioned. agent_bytes, task_bytes : of all ids, without separators.
    winners : tasks that have one.
    stamps, agreed_at, left_at : (largest less smallest, how many) of each column of stamps.
    """

    agents: int
    agent_bytes: int
    task_bytes: int
    winners: int
    stamps: tuple[int, int]
    agreed_at: tuple[int, int]
    left_at: tuple[int, int]


def encoded_size(message: Beliefs, counts: Counts) -> int:
    """Return ``len(encode(message))`` without encoding: what simulations count."""
    row_width = width(counts.agents)
    tasks = len(message.tasks)
    size = 3 + _text_size(len("beliefs")) + _int_size(VERSION)  # 3: an array of more than 15
    size += _text_size(len(message.sender))
    size += _text_size(counts.agent_bytes + max(counts.agents - 1, 0))
    size += _text_size(counts.task_bytes + max(tasks - 1, 0))
    for value in (message.sequence, message.since, message.digest, message.digest_at):
        size += _int_size(value)
    for spread, count in (counts.stamps, counts.agreed_at, counts.left_at):
        size += _bytes_size(9 + count * width(spread) if count else 0)
    for count in (tasks, len(message.agreed), len(message.asked), len(message.left)):
        size += _bytes_size(count * row_width)
    return size + _bytes_size(8 * counts.winners) + 1  # 1: settled


def _mentioned(message: Beliefs) -> tuple[IntColumn, IntColumn]:
    """Return the rows of agents with a stamp, and of all agents mentioned, those with a stamp first."""
    stamped = np.flatnonzero(message.heard != NOT_LISTED)
    rest = np.zeros(len(message.agent_ids) + 1, np.bool_)
    for column in (message.winners, message.agreed, message.asked, message.left):
        rest[column] = True
    rest[NOBODY] = False
    rest[stamped] = False
    return stamped, np.concatenate([stamped, np.flatnonzero(rest)])


def _int_size(value: int) -> int:
    """Bytes of a whole number in MessagePack."""
    return 1 if value < 1 << 7 else 1 + width(value)


def _text_size(length: int) -> int:
    return length + (1 if length < 32 else 2 if length < 1 << 8 else 3 if length < 1 << 16 else 5)


def _bytes_size(length: int) -> int:
    return length + (2 if length < 1 << 8 else 3 if length < 1 << 16 else 5)
