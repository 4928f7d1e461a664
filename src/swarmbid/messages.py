"""Every wire message, its version and its limits.

In memory a message holds rows of two id tables, so that agents of one process read it without looking
up a single name. On the wire it holds the ids themselves, only those that it mentions: nothing there
depends on anybody's order. A message that exists has been checked; `decode` refuses what cannot be one
with a `MessageError` that names the reason.

Wire format (MessagePack, one array; new fields are appended, with defaults)::

    ["beliefs", version, sender, sequence, since, agents, heard, tasks, winners, bids, digest, digest_at,
     agreed, agreed_at, asked, left, left_at, settled]

`agents` and `tasks` are ids joined by newlines, the agents with a stamp first. Columns of rows are
little-endian unsigned integers as wide as the number of agents needs; a winner's row one past the last
is nobody. Stamps are written as their least, a width and the differences. Bids are float64, for tasks
with a winner only.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from swarmbid.checks import ID_PATTERN
from swarmbid.errors import SwarmbidError

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int32]
StampArray = NDArray[np.int64]
IntColumn = NDArray[Any]

VERSION = 1
MAX_BYTES = 4 * 1024 * 1024
"""Largest message taken in: a full state of 10^5 tasks with long ids fits, a flood does not."""
MAX_IDS = 1 << 18
INCARNATION = 1 << 32
"""A stamp is incarnation * 2^32 + sequence, so that an agent that restarts outranks its past."""
MAX_STAMP = 1 << 62
NOBODY = -1
NOT_LISTED = -1

_ID_LIST = re.compile(rf"{ID_PATTERN.pattern}(\n{ID_PATTERN.pattern})*")


class MessageError(SwarmbidError):
    """A message that cannot be taken in.

    Parameters
    ----------
    reason : one word, counted by the receiver ("malformed", "oversize", "version", "bid" ...).
    detail : what exactly was found.
    """

    def __init__(self, reason: str, detail: str) -> None:
        self.reason = reason
        self.detail = detail
        super().__init__(f"{reason}: {detail}")


@dataclass(frozen=True, eq=False)
class Beliefs:
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


Message = Beliefs
"""What negotiators exchange; an outsider's algorithm brings message classes of its own."""


class _Wire(msgspec.Struct, array_like=True, tag="beliefs", frozen=True):
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


_encoder = msgspec.msgpack.Encoder()
_decoder = msgspec.msgpack.Decoder(_Wire)


def encode(message: Beliefs) -> bytes:
    """Return the bytes of a message, with the ids that it mentions and no others."""
    stamped, mentioned = _mentioned(message)
    rank = np.zeros(len(message.agent_ids) + 1, np.int64)
    rank[mentioned] = np.arange(mentioned.size)
    rank[NOBODY] = mentioned.size
    top = mentioned.size
    return _encoder.encode(
        _Wire(
            version=VERSION,
            sender=message.sender,
            sequence=message.sequence,
            since=message.since,
            agents="\n".join([message.agent_ids[row] for row in mentioned.tolist()]),
            heard=_pack_stamps(message.heard[stamped]),
            tasks="\n".join([message.task_ids[row] for row in message.tasks.tolist()]),
            winners=_pack(rank[message.winners], top),
            bids=message.bids[message.winners != NOBODY].astype("<f8").tobytes(),
            digest=message.digest,
            digest_at=message.digest_at,
            agreed=_pack(rank[message.agreed], top),
            agreed_at=_pack_stamps(message.agreed_at),
            asked=_pack(rank[message.asked], top),
            left=_pack(rank[message.left], top),
            left_at=_pack_stamps(message.left_at),
            settled=message.settled,
        )
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
    width = _width(counts.agents)
    tasks = len(message.tasks)
    size = 3 + _text_size(len("beliefs")) + _int_size(VERSION)  # 3: an array of more than 15
    size += _text_size(len(message.sender))
    size += _text_size(counts.agent_bytes + max(counts.agents - 1, 0))
    size += _text_size(counts.task_bytes + max(tasks - 1, 0))
    for value in (message.sequence, message.since, message.digest, message.digest_at):
        size += _int_size(value)
    for spread, count in (counts.stamps, counts.agreed_at, counts.left_at):
        size += _bytes_size(9 + count * _width(spread) if count else 0)
    for count in (tasks, len(message.agreed), len(message.asked), len(message.left)):
        size += _bytes_size(count * width)
    return size + _bytes_size(8 * counts.winners) + 1  # 1: settled


def decode(data: bytes) -> Beliefs:
    """Return the message in `data`.

    Raises
    ------
    MessageError : it is too large, of an unknown version, garbled, or says what cannot be.
    """
    if len(data) > MAX_BYTES:
        raise MessageError("oversize", f"{len(data)} bytes, more than {MAX_BYTES}")
    try:
        wire = _decoder.decode(data)
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        raise MessageError("malformed", str(error)) from None
    if wire.version != VERSION:
        raise MessageError("version", f"is {wire.version}, not {VERSION}")
    if not ID_PATTERN.fullmatch(wire.sender):
        raise MessageError("id", "the sender's id is none")
    agents, tasks = _ids(wire.agents), _ids(wire.tasks)
    top = len(agents)
    if not 0 <= wire.since < wire.sequence <= MAX_STAMP or not 0 <= wire.digest_at <= wire.sequence:
        raise MessageError("stamp", "a stamp is out of order or out of range")
    if not 0 <= wire.digest < 1 << 64:
        raise MessageError("malformed", "the digest is not of 64 bits")
    stamped = _unpack_stamps(wire.heard)
    if stamped.size > top:
        raise MessageError("malformed", "there are more stamps than agents")
    heard = np.full(top, NOT_LISTED, np.int64)
    heard[: stamped.size] = stamped
    winners = _unpack(wire.winners, top, top + 1)
    if winners.size != len(tasks):
        raise MessageError("malformed", "there is not one winner for each task")
    won = winners != top
    winners[~won] = NOBODY
    if len(wire.bids) != 8 * int(np.count_nonzero(won)):
        raise MessageError("malformed", "there is not one bid for each winner")
    bids = np.zeros(len(tasks))
    bids[won] = np.frombuffer(wire.bids, "<f8")
    agreed, left = _unpack(wire.agreed, top, top), _unpack(wire.left, top, top)
    agreed_at, left_at = _unpack_stamps(wire.agreed_at), _unpack_stamps(wire.left_at)
    if agreed.size != agreed_at.size or left.size != left_at.size:
        raise MessageError("malformed", "two columns that belong together differ in length")
    return Beliefs(
        sender=wire.sender,
        sequence=wire.sequence,
        since=wire.since,
        agent_ids=agents,
        task_ids=tasks,
        heard=heard,
        tasks=np.arange(len(tasks), dtype=np.int32),
        winners=winners.astype(np.int32),
        bids=bids,
        digest=wire.digest,
        digest_at=wire.digest_at,
        agreed=agreed.astype(np.int32),
        agreed_at=agreed_at,
        asked=_unpack(wire.asked, top, top).astype(np.int32),
        left=left.astype(np.int32),
        left_at=left_at,
        settled=wire.settled,
    )


def _mentioned(message: Beliefs) -> tuple[IntColumn, IntColumn]:
    """Return the rows of agents with a stamp, and of all agents mentioned, those with a stamp first."""
    stamped = np.flatnonzero(message.heard != NOT_LISTED)
    rest = np.zeros(len(message.agent_ids) + 1, np.bool_)
    for column in (message.winners, message.agreed, message.asked, message.left):
        rest[column] = True
    rest[NOBODY] = False
    rest[stamped] = False
    return stamped, np.concatenate([stamped, np.flatnonzero(rest)])


def _ids(joined: str) -> tuple[str, ...]:
    ids = tuple(joined.split("\n")) if joined else ()
    if len(ids) > MAX_IDS:
        raise MessageError("oversize", f"{len(ids)} ids, more than {MAX_IDS}")
    if joined and not _ID_LIST.fullmatch(joined):
        raise MessageError("id", "an id is not 1 to 64 letters, digits, dots, underscores or hyphens")
    if len(set(ids)) != len(ids):
        raise MessageError("malformed", "an id is listed twice")
    return ids


def _width(top: int) -> int:
    """Bytes that hold every whole number from 0 to `top`."""
    return 1 if top < 1 << 8 else 2 if top < 1 << 16 else 4 if top < 1 << 32 else 8


def _pack(values: IntColumn, top: int) -> bytes:
    return values.astype(f"<u{_width(top)}").tobytes()


def _unpack(data: bytes, top: int, end: int) -> IntColumn:
    """Return whole numbers below `end`, as wide as `top` needs."""
    width = _width(top)
    if len(data) % width:
        raise MessageError("malformed", "a column is cut off")
    values = np.frombuffer(data, f"<u{width}").astype(np.int64)
    if values.size and int(values.max()) >= end:
        raise MessageError("malformed", "a row lies outside its table")
    return values


def _pack_stamps(stamps: IntColumn) -> bytes:
    """Eight bytes for the least, one for the width, then the differences from the least."""
    if not stamps.size:
        return b""
    least, spread = int(stamps.min()), int(stamps.max() - stamps.min())
    return least.to_bytes(8, "little") + bytes([_width(spread)]) + _pack(stamps - least, spread)


def _unpack_stamps(data: bytes) -> IntColumn:
    if not data:
        return np.zeros(0, np.int64)
    if len(data) < 10 or data[8] not in (1, 2, 4, 8) or (len(data) - 9) % data[8]:
        raise MessageError("malformed", "a column of stamps is cut off")
    least = int.from_bytes(data[:8], "little")
    spread = np.frombuffer(data[9:], f"<u{data[8]}")
    if least + int(spread.max()) > MAX_STAMP:
        raise MessageError("stamp", "a stamp is out of range")
    return spread.astype(np.int64) + least


def _int_size(value: int) -> int:
    """Bytes of a whole number in MessagePack."""
    return 1 if value < 1 << 7 else 1 + _width(value)


def _text_size(length: int) -> int:
    return length + (1 if length < 32 else 2 if length < 1 << 8 else 3 if length < 1 << 16 else 5)


def _bytes_size(length: int) -> int:
    return length + (2 if length < 1 << 8 else 3 if length < 1 << 16 else 5)
