"""Records of who bids for what, each written by its owner alone: what CBGA says.

A record is an agent's column of the assignment matrix X (Hunt 2014, Table 1) in sparse form. Everybody
relays it unchanged, and the newer one of two counts.

Wire format::

    ["records", version, sender, sequence, agents, tasks, owners, stamps, lengths, states, columns_of_tasks,
     bids, gains, positions, leads, moved, places, known, near, barred_tasks, barred_agents, context,
     digest, digest_at, agreed, agreed_at, settled, left, left_at]

`agents` and `tasks` are ids joined by newlines, those mentioned and no others. A lead's row one past the
last is nobody. Gains are left out if they all equal the bids.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import msgspec
import numpy as np
from numpy.typing import NDArray

from swarmbid.messages._base import Message
from swarmbid.messages._columns import (
    NOBODY,
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

BIDDING, STARTED, DONE = 0, 1, 2
"""States of an entry: wanted, under way, finished."""
NUM_STATES = 3
PLACE_SLOTS = 5
MAX_POSITION = 1 << 20

Place = tuple[float, float, float, float, float]
"""Where an agent is, m (three), from when on, s, and how far it may still fly, m."""

_encoder = msgspec.msgpack.Encoder()


@dataclass(frozen=True, eq=False)
class Record:
    """What one agent says of itself.

    Parameters
    ----------
    stamp : its own counter; the newer of two counts.
    states : int8[n], of each entry: BIDDING, STARTED or DONE; what it bids for comes last, in order of
        taking.
    tasks : int32[n], rows.
    bids : float64[n]; for what is under way or done the start of service, s.
    gains : float64[n], what the tasks were said to gain it. positions : int32[n], places in the path at
        the time of taking.
    leads : int32[n], rows of founders of groups joined; NOBODY if the entry ranks by its own bid.
    place : where the agent is, if it has moved since the mission began.
    """

    stamp: int
    states: NDArray[np.int8]
    tasks: IntArray
    bids: FloatArray
    gains: FloatArray
    positions: IntArray
    leads: IntArray
    place: Place | None = None

    def __post_init__(self) -> None:
        for column in (self.bids, self.gains):
            # One comparison for all: a NaN fails it, and so does an infinite or a negative number.
            if column.size and not (column.min() >= 0.0 and column.max() < np.inf):
                raise MessageError("bid", "a bid is not a finite number of at least 0")
        # How far an agent may fly has no limit unless it is given one.
        if self.place is not None and not (
            np.isfinite(self.place[:4]).all() and self.place[4] == self.place[4]
        ):
            raise MessageError("place", "a place or a time is not a finite number")

    @cached_property
    def wanted(self) -> int:
        """How many of the entries are bids; they stand at the end."""
        return int(np.count_nonzero(self.states == BIDDING))

    @cached_property
    def bundle(self) -> FloatArray:
        """float64[wanted, 5]: tasks, bids, gains, positions and leads of what it bids for."""
        begin = self.tasks.size - self.wanted
        columns = (self.tasks, self.bids, self.gains, self.positions, self.leads)
        return np.column_stack([column[begin:] for column in columns]).astype(np.float64)

    def same(self, other: Record) -> bool:
        """Whether another says the same, its stamp aside."""
        return (
            self.place == other.place
            and np.array_equal(self.states, other.states)
            and np.array_equal(self.tasks, other.tasks)
            and np.array_equal(self.bids, other.bids)
            and np.array_equal(self.bundle, other.bundle)
        )

    def only(self, stay: NDArray[np.bool_], stamp: int | None = None) -> Record:
        """Return the record with some of its entries, and another stamp if one is given."""
        return replace(
            self, stamp=self.stamp if stamp is None else stamp, states=self.states[stay],
            tasks=self.tasks[stay], bids=self.bids[stay], gains=self.gains[stay],
            positions=self.positions[stay], leads=self.leads[stay],
        )  # fmt: skip


def empty_record() -> Record:
    """Return the record of an agent that has said nothing."""
    none = np.zeros(0, np.int32)
    return Record(0, np.zeros(0, np.int8), none, np.zeros(0), np.zeros(0), none, none)


@dataclass(frozen=True, eq=False)
class Records(Message):
    """Records that changed, or whose holder a neighbour seems to lack.

    Parameters
    ----------
    sender, sequence, agent_ids, task_ids, digest, digest_at, agreed, agreed_at, settled, left, left_at :
        see `Message`.
    owners : int32[r], rows of agents whose records follow. records : as many.
    known : int64[len(agent_ids)], stamp of every record that the sender has, 0 for none; int64[0] if that
        is not told.
    near : int32[k], rows of agents that the sender hears directly; told with `known`.
    barred_tasks, barred_agents : int32[b], rows: who must not bid on what any more.
    context : hash of the roster and the tasks that these bars are for.
    """

    sender: str
    sequence: int
    agent_ids: tuple[str, ...]
    task_ids: tuple[str, ...]
    owners: IntArray
    records: tuple[Record, ...]
    known: StampArray
    near: IntArray
    barred_tasks: IntArray
    barred_agents: IntArray
    context: int
    digest: int
    digest_at: int
    agreed: IntArray
    agreed_at: StampArray
    settled: bool
    left: IntArray
    left_at: StampArray

    @property
    def full(self) -> bool:
        """Whether it tells of every agent's record, by its stamp at least."""
        return self.known.size > 0

    @property
    def entries(self) -> int:
        """Bids that it tells of."""
        return sum(record.tasks.size for record in self.records)

    def encode(self) -> bytes:
        """Return the bytes of a message, with the ids that it mentions and no others."""
        records = self.records
        states = np.concatenate([np.zeros(0, np.int8), *(record.states for record in records)])
        entries = np.concatenate([np.zeros(0, np.int32), *(record.tasks for record in records)])
        bids = np.concatenate([np.zeros(0), *(record.bids for record in records)])
        gains = np.concatenate([np.zeros(0), *(record.gains for record in records)])
        positions = np.concatenate([np.zeros(0, np.int32), *(record.positions for record in records)])
        leads = np.concatenate([np.zeros(0, np.int32), *(record.leads for record in records)])
        stamps = np.array([record.stamp for record in records], np.int64)
        lengths = np.array([record.tasks.size for record in records], np.int64)
        places = [(row, record.place) for row, record in enumerate(records) if record.place is not None]
        listed = np.arange(self.known.size)
        agents, agent_rank = _mentioned(
            len(self.agent_ids),
            [listed, self.owners, leads, self.near, self.barred_agents, self.agreed, self.left],
        )
        tasks, task_rank = _mentioned(len(self.task_ids), [entries, self.barred_tasks])
        top, task_top = agents.size, tasks.size
        return _encoder.encode(
            RecordsWire(
                version=VERSION,
                sender=self.sender,
                sequence=self.sequence,
                agents="\n".join([self.agent_ids[row] for row in agents.tolist()]),
                tasks="\n".join([self.task_ids[row] for row in tasks.tolist()]),
                owners=pack(agent_rank[self.owners], top),
                stamps=pack_stamps(stamps),
                lengths=pack(lengths, task_top),
                states=states.astype("u1").tobytes() if states.any() else b"",
                entries=pack(task_rank[entries], task_top),
                bids=bids.astype("<f8").tobytes(),
                gains=b"" if np.array_equal(bids, gains) else gains.astype("<f8").tobytes(),
                positions=pack(positions, MAX_POSITION if positions.max(initial=0) > 255 else 255),
                leads=pack(agent_rank[leads], top) if (leads != NOBODY).any() else b"",
                moved=pack(np.array([row for row, _ in places], np.int64), top),
                places=np.array([place for _, place in places], "<f8").tobytes(),
                known=pack_stamps(self.known),
                near=pack(agent_rank[self.near], top),
                barred_tasks=pack(task_rank[self.barred_tasks], task_top),
                barred_agents=pack(agent_rank[self.barred_agents], top),
                context=self.context,
                digest=self.digest,
                digest_at=self.digest_at,
                agreed=pack(agent_rank[self.agreed], top),
                agreed_at=pack_stamps(self.agreed_at),
                settled=self.settled,
                left=pack(agent_rank[self.left], top),
                left_at=pack_stamps(self.left_at),
            )
        )


class RecordsWire(msgspec.Struct, array_like=True, tag="records", frozen=True):
    """The fields in their order on the wire."""

    version: int
    sender: str
    sequence: int
    agents: str
    tasks: str
    owners: bytes
    stamps: bytes
    lengths: bytes
    states: bytes
    entries: bytes
    bids: bytes
    gains: bytes
    positions: bytes
    leads: bytes
    moved: bytes
    places: bytes
    known: bytes
    near: bytes
    barred_tasks: bytes
    barred_agents: bytes
    context: int
    digest: int
    digest_at: int
    agreed: bytes
    agreed_at: bytes
    settled: bool
    left: bytes
    left_at: bytes

    def message(self) -> Records:
        """Return the message; MessageError if it says what cannot be."""
        check_head(self.version, self.sender, self.sequence, self.digest, self.digest_at)
        if not 0 <= self.context < 1 << 64:
            raise MessageError("malformed", "the context is not of 64 bits")
        agents, tasks = ids(self.agents), ids(self.tasks)
        top, task_top = len(agents), len(tasks)
        owners, stamps = unpack(self.owners, top, top), unpack_stamps(self.stamps)
        lengths = unpack(self.lengths, task_top, task_top + 1)
        entries = unpack(self.entries, task_top, task_top)
        count = entries.size
        bids = _floats(self.bids, count)
        states = np.frombuffer(self.states, "u1") if self.states else np.zeros(count, "u1")
        wide = len(self.positions) != count
        positions = unpack(self.positions, MAX_POSITION if wide else 255, MAX_POSITION)
        leads = unpack(self.leads, top, top + 1) if self.leads else np.full(count, top)
        moved = unpack(self.moved, top, max(len(owners), 1))
        known = unpack_stamps(self.known)
        barred_tasks = unpack(self.barred_tasks, task_top, task_top)
        barred_agents = unpack(self.barred_agents, top, top)
        agreed, left = unpack(self.agreed, top, top), unpack(self.left, top, top)
        agreed_at, left_at = unpack_stamps(self.agreed_at), unpack_stamps(self.left_at)
        same = [
            (owners, stamps), (owners, lengths), (entries, states), (entries, positions), (entries, leads),
            (barred_tasks, barred_agents), (agreed, agreed_at), (left, left_at),
        ]  # fmt: skip
        if known.size not in (0, top) or any(a.size != b.size for a, b in same):
            raise MessageError("malformed", "two columns that belong together differ in length")
        if np.unique(owners).size != owners.size:
            raise MessageError("malformed", "a record is there twice")
        if states.size and int(states.max()) >= NUM_STATES:
            raise MessageError("malformed", "an entry is in no state that there is")
        if int(lengths.sum()) != count:
            raise MessageError("malformed", "there are not as many entries as the records say")
        places = _floats(self.places, PLACE_SLOTS * moved.size).reshape(-1, PLACE_SLOTS)
        place_of = dict(zip(moved.tolist(), places.tolist(), strict=True))
        gains = _floats(self.gains, count) if self.gains else bids
        leads = np.where(leads == top, NOBODY, leads).astype(np.int32)
        records = []
        end = 0
        for row, (stamp, length) in enumerate(zip(stamps.tolist(), lengths.tolist(), strict=True)):
            part = slice(end, end + length)
            end += length
            if (np.diff((states[part] != BIDDING).astype(np.int8)) > 0).any():
                raise MessageError("malformed", "what is under way does not come first")
            records.append(
                Record(
                    stamp=stamp,
                    states=states[part].astype(np.int8),
                    tasks=entries[part].astype(np.int32),
                    bids=bids[part],
                    gains=gains[part],
                    positions=positions[part].astype(np.int32),
                    leads=leads[part],
                    place=tuple(place_of[row]) if row in place_of else None,
                )
            )
        return Records(
            sender=self.sender,
            sequence=self.sequence,
            agent_ids=agents,
            task_ids=tasks,
            owners=owners.astype(np.int32),
            records=tuple(records),
            known=known,
            near=unpack(self.near, top, top).astype(np.int32),
            barred_tasks=barred_tasks.astype(np.int32),
            barred_agents=barred_agents.astype(np.int32),
            context=self.context,
            digest=self.digest,
            digest_at=self.digest_at,
            agreed=agreed.astype(np.int32),
            agreed_at=agreed_at,
            settled=self.settled,
            left=left.astype(np.int32),
            left_at=left_at,
        )


def _mentioned(size: int, columns: list[IntColumn]) -> tuple[IntColumn, IntColumn]:
    """Return the rows that columns mention, in order, and the place of each row among them."""
    flags = np.zeros(size + 1, np.bool_)
    for column in columns:
        flags[column] = True
    flags[NOBODY] = False
    rows = np.flatnonzero(flags)
    rank = np.zeros(size + 1, np.int64)
    rank[rows] = np.arange(rows.size)
    rank[NOBODY] = rows.size
    return rows, rank


def _floats(data: bytes, count: int) -> FloatArray:
    if len(data) != 8 * count:
        raise MessageError("malformed", "a column of numbers is cut off")
    return np.frombuffer(data, "<f8").astype(np.float64)
