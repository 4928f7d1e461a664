"""One agent's view of everybody's records: who is accepted, when things start, and its own bundle."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from swarmbid.algorithms._bundle import RULES
from swarmbid.algorithms._groups import incomplete, is_complete, members
from swarmbid.algorithms._terms import cover_of, make_terms
from swarmbid.arrays import AGENT_X, AGENT_Z, AVAILABLE, NO_AGENT, RANGE, IntArray, MissionArrays, RowArray
from swarmbid.kernels import coalition
from swarmbid.kernels.joint import empty_joint
from swarmbid.kernels.offers import LENGTH, empty_own
from swarmbid.kernels.ranks import AGENT, BID, GAIN, JOINS, KEY_SLOTS, LEAD, PLACE, STAGE, rearrange
from swarmbid.messages.records import BIDDING, Place, Record, empty_record
from swarmbid.scores import Score

FIRST_WIDTH = 8
JOURNAL_PER_ITEM = 8
NEVER_CHANGED = 1 << 62


class JointPlan:
    """Records in, the agent's own bundle and the state of every group out.

    Parameters
    ----------
    me : the agent's row; NO_AGENT for one who judges records and bids on nothing.
    score : of everybody. insertion : "shift" or "append". team : whether who joins an open group ranks
        behind its founder.
    """

    def __init__(self, arrays: MissionArrays, me: int, score: Score, *, insertion: str, team: bool) -> None:
        self.arrays = arrays
        self.me = me
        self.score = score
        self.insertion = insertion
        self.team = team
        self._terms = make_terms(arrays, score)
        num_slots = int(self._terms.slot_at[-1])
        self._joint = empty_joint(arrays.num_agents, arrays.num_tasks, num_slots)
        owner = arrays.agents[me] if me != NO_AGENT else None
        fixed = None if owner is None else score.fixed(arrays, owner)
        limit = 0 if owner is None else arrays.bundle_limit(owner)
        vector = np.zeros(0) if owner is None else self._terms.agents[me].copy()
        self._own = empty_own(
            self._terms.tasks.copy(), np.zeros(0) if fixed is None else fixed, vector, limit
        )
        self.records: list[Record] = [empty_record() for _ in arrays.agents]
        self._dirty: dict[int, int] = {}  # rows with new records -> entries of the old one that still stand
        self._again = True
        self._first = NEVER_CHANGED  # entries of the order before this one have not changed
        self._make_room(FIRST_WIDTH)

    def _make_room(self, width: int) -> None:
        """Lay records out in rows of `width` entries."""
        num_agents = self.arrays.num_agents
        room = num_agents * width
        self._width = width
        none = np.zeros(0, np.int64)
        self._scanned = coalition.Records(
            task=np.zeros(room, np.int64),
            position=np.zeros(room, np.int64),
            key=np.zeros((room, KEY_SLOTS)),
            order=np.zeros(room, np.int64),
            entries=np.zeros(1, np.int64),
            held_agent=none,
            held_task=none,
            held_start=np.zeros(0),
        )
        self._lengths = np.zeros(num_agents, np.int64)  # of the rows that are in the order
        self._stale: NDArray[np.bool_] = np.zeros(room, np.bool_)
        self._spare = np.zeros(room, np.int64)
        limit = self._own.task.shape[0]
        self._log = coalition.empty_log(room + limit, JOURNAL_PER_ITEM * (room + limit))
        self._dirty = dict.fromkeys(range(num_agents), 0)
        self._dirty.pop(self.me, None)
        self._again = True

    # --- what changes

    def put(self, row: int, record: Record) -> None:
        """Take in an agent's newer record; the agent's own bundle is its own choice and not read."""
        old = self.records[row]
        self.records[row] = record
        if record.place != old.place:
            self._move(row, record.place)
        if record.wanted < record.tasks.size or old.wanted < old.tasks.size:
            self._again = True
        if row == self.me:
            return
        shortest = min(record.wanted, old.wanted)
        differs = (record.bundle[:shortest] != old.bundle[:shortest]).any(axis=1)
        stands = int(differs.argmax()) if differs.any() else shortest
        if stands < max(record.wanted, old.wanted):
            self._dirty[row] = min(self._dirty.get(row, stands), stands)
        if record.wanted > self._width:
            self._make_room(2 * record.wanted)

    def _move(self, row: int, place: Place | None) -> None:
        """Count an agent's times and metres from where it is."""
        agents = self._terms.agents.copy()
        if place is None:
            agents[row] = self.arrays.agent_vector(
                self.arrays.agents[row], self.score.cost_per_metre(self.arrays.agents[row])
            )
        else:
            agents[row, AGENT_X : AGENT_Z + 1] = place[:3]
            agents[row, AVAILABLE] = place[3]
            agents[row, RANGE] = place[4]
        self._terms = self._terms._replace(agents=agents)
        if row == self.me:
            self._own.vector[:] = agents[row]
        self._again = True

    def allow(self, present: NDArray[np.bool_], barred: set[tuple[int, int]], closed: set[int]) -> None:
        """Set who is on the roster, who must not bid on what (agent, task), and which tasks are closed."""
        terms = make_terms(self.arrays, self.score)
        allowed = terms.allowed
        if barred or closed or not present.all():
            allowed = allowed.copy()
            for agent, task in barred:
                allowed[agent, task] = False
            allowed[:, sorted(closed)] = False
            allowed[~present] = False
        cover, spare, cover_at = terms.cover, terms.spare, terms.cover_at
        if not present.all():
            cover, spare, cover_at = cover_of(self.arrays, present)
        self._terms = self._terms._replace(allowed=allowed, cover=cover, spare=spare, cover_at=cover_at)
        self._again = True

    def bar(self, barred: set[tuple[int, int]]) -> None:
        """Let some agents bid on some tasks no more: (agent, task), besides those barred already."""
        allowed = self._terms.allowed
        if allowed is make_terms(self.arrays, self.score).allowed:
            allowed = allowed.copy()
            self._terms = self._terms._replace(allowed=allowed)
        log, items = self._log, int(self._log.sizes[coalition.ITEMS])
        for agent, task in barred:
            allowed[agent, task] = False
            # What ranks before the agent's entry is as it was; who has none there was not admitted anyway.
            there = (log.agent[:items] == agent) & (log.task[:items] == task)
            self._first = min(self._first, *log.at[:items][there].tolist(), self._first)

    # --- what follows

    @property
    def stale(self) -> bool:
        """Whether something has changed since the last `scan`."""
        return self._again or bool(self._dirty) or self._first < NEVER_CHANGED

    def scan(self) -> None:
        """Judge everybody's entries and choose the agent's own."""
        first = min(self._rearrange(), self._first)
        self._first = NEVER_CHANGED
        if self._again:
            first = -1
            self._hold()
        coalition.scan(
            self._terms, self._joint, self._log, self._scanned, self._own, self.me,
            RULES[self.insertion], self.team, first,
        )  # fmt: skip
        self._again = False

    def _rearrange(self) -> int:
        """Bring the order up to date; return the first entry that changed."""
        scanned, width = self._scanned, self._width
        fresh: list[NDArray[np.int64]] = []
        for row in sorted(self._dirty):
            stands, record = self._dirty[row], self.records[row]
            begin = row * width
            self._stale[begin + stands : begin + self._lengths[row]] = True
            wanted = record.wanted
            self._lengths[row] = wanted
            fresh.append(np.arange(begin + stands, begin + wanted))
            entries = slice(begin + stands, begin + wanted)
            tasks, bids, gains, positions, leads = record.bundle[stands:].T
            rows = tasks.astype(np.int64)
            scanned.task[entries] = rows
            scanned.position[entries] = positions
            key = scanned.key[entries]
            key[:, STAGE] = self._terms.stage[rows]
            key[:, BID] = bids
            key[:, LEAD] = np.where(leads == NO_AGENT, row, leads)
            key[:, JOINS] = leads != NO_AGENT
            key[:, GAIN] = gains
            key[:, AGENT] = row
            key[:, PLACE] = np.arange(stands, wanted)
        self._dirty.clear()
        refs = np.concatenate([*fresh, np.zeros(0, np.int64)]).astype(np.int64)
        count, first = rearrange(
            scanned.order, int(scanned.entries[0]), self._stale, refs, refs.size, scanned.key, self._spare
        )
        scanned.entries[0] = count
        self._stale[:] = False
        return int(first)

    def _hold(self) -> None:
        """Collect what is under way or done, in order of task and agent."""
        found = [
            (int(task), row, float(start))
            for row, record in enumerate(self.records)
            for task, start, state in zip(record.tasks, record.bids, record.states, strict=True)
            if state != BIDDING
        ]
        found.sort()
        self._scanned = self._scanned._replace(
            held_agent=np.array([row for _, row, _ in found], np.int64),
            held_task=np.array([task for task, _, _ in found], np.int64),
            held_start=np.array([start for _, _, start in found], np.float64),
        )

    # --- what to read

    def bundle(self, stamp: int) -> Record:
        """Return the agent's own record: what it holds already, then what the last scan chose."""
        mine, own = self.records[self.me], self._own
        length = int(own.sizes[LENGTH])
        held = mine.states != BIDDING
        return Record(
            stamp=stamp,
            states=np.concatenate([mine.states[held], np.full(length, BIDDING, np.int8)]),
            tasks=_joined(mine.tasks[held], own.task[:length]),
            bids=np.concatenate([mine.bids[held], own.bid[:length]]),
            gains=np.concatenate([mine.gains[held], own.gain[:length]]),
            positions=_joined(mine.positions[held], own.position[:length]),
            leads=_joined(mine.leads[held], own.lead[:length]),
            place=mine.place,
        )

    def members(self, task: int) -> list[int]:
        """Rows of the agents that have a seat at a task, in order of id."""
        return members(self._terms, self._joint, task)

    def complete(self, task: int) -> bool:
        """Whether a task's group has all its members and equipment."""
        return is_complete(self._terms, self._joint, task)

    def limit(self, row: int) -> int:
        """Most tasks that an agent may take (L_t)."""
        return int(self._terms.limits[row])

    def full(self, task: int) -> bool:
        """Whether every seat of a task is taken."""
        terms = self._terms
        return bool(terms.slot_at[task] + self._joint.filled[task] == terms.slot_at[task + 1])

    def start(self, task: int) -> float:
        """When a group's service starts, s."""
        return float(self._joint.start[task])

    def path(self, row: int) -> list[int]:
        """Tasks that an agent has a seat at, in order of visit, those under way or done left out."""
        found = []
        seat = int(self._joint.first[row])
        while seat >= 0:
            found.append(int(self._terms.slot_task[seat]))
            seat = int(self._joint.after[seat])
        return found

    def incomplete(self) -> list[int]:
        """Tasks that have members, but not all that they need, the worst first."""
        return incomplete(self._terms, self._joint, self.gain)

    def gain(self, row: int, task: int) -> float:
        """What an agent's record says that a task gains it; 0 if it says nothing."""
        if row == self.me:
            place = np.flatnonzero(self._own.task[: self._own.sizes[LENGTH]] == task)
            return float(self._own.gain[place[0]]) if place.size else 0.0
        record = self.records[row]
        place = np.flatnonzero(record.tasks == task)
        return float(record.gains[place[0]]) if place.size else 0.0

    def bid(self, row: int, task: int) -> float:
        """What an agent's record bids on a task; 0 if it says nothing."""
        record = self.records[row]
        place = np.flatnonzero(record.tasks == task)
        return float(record.bids[place[0]]) if place.size else 0.0


def _joined(held: IntArray, chosen: RowArray) -> IntArray:
    return np.concatenate([held, chosen]).astype(np.int32)
