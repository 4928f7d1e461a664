"""What one agent of the printed CBGA knows and plans: the matrix, its bundle and its path."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from swarmbid.algorithms._beliefs import DONE_BID
from swarmbid.algorithms._bundle import RULES
from swarmbid.algorithms._terms import MOST_EQUIPMENT, make_terms, too_much_equipment
from swarmbid.arrays import (
    AGENT_X,
    AGENT_Z,
    AVAILABLE,
    DURATION,
    END,
    NO_AGENT,
    OPEN,
    RANGE,
    READY,
    SLOWNESS,
    FloatArray,
    IntArray,
    MissionArrays,
    StampArray,
)
from swarmbid.kernels import printed
from swarmbid.kernels.bundle import outbids
from swarmbid.kernels.insertion import evaluate, first_position, path_state
from swarmbid.kernels.lanes import BLOCK
from swarmbid.kernels.printed import PrintedTerms
from swarmbid.messages import NOT_LISTED, MessageError
from swarmbid.messages.assignments import Assignments
from swarmbid.model import Mission, Position, distance
from swarmbid.scores import Score


class PrintedState:
    """Matrix, stamps, times, bundle and path of one agent (Hunt 2014, "Local Data").

    Parameters
    ----------
    insertion : "shift" or "append". warp : whether bids never rise along the bundle.
    charitable : the reading. teams : whether groups are valued by the whole group's bids.

    Attributes
    ----------
    bids : float64[num_tasks, num_agents], 0 for no bid (X_i).
    arrivals : float64[num_tasks, num_agents], s: when each arrives where it bids; 0 in the literal reading.
    heard : int64[num_agents], how new the news of each agent is (s_i).
    joined_at : float64[num_tasks], s (T_j).
    bundle : rows in order of taking (b_i), with the bids that they were taken for.
    path : rows in order of visit (p_i).
    quit : rows of tasks that were quit, with the members since: when another joins it is open again.
    served : rows of tasks that were started, with their starts in s.
    """

    def __init__(
        self,
        arrays: MissionArrays,
        me: int,
        score: Score,
        *,
        insertion: str,
        warp: bool,
        charitable: bool,
        teams: bool,
    ) -> None:
        agent = arrays.agents[me]
        shape = (arrays.num_tasks, arrays.num_agents)
        self.arrays = arrays
        self.me = me
        self.score = score
        self.insertion = insertion
        self.warp = warp
        self.charitable = charitable
        self.teams = teams
        self.limit = arrays.bundle_limit(agent)
        self.terms = terms_of(arrays, score)
        self.bids: FloatArray = np.zeros(shape)
        self.arrivals: FloatArray = np.zeros(shape)
        self.heard: StampArray = np.full(arrays.num_agents, NOT_LISTED, np.int64)
        self.joined_at: FloatArray = np.zeros(arrays.num_tasks)
        self.bundle: dict[int, float] = {}
        self.path: list[int] = []
        self.quit: dict[int, frozenset[int]] = {}
        self.closed: NDArray[np.bool_] = np.zeros(arrays.num_tasks, np.bool_)
        self.cancelled: set[int] = set()
        self.served: dict[int, float] = {}
        self.moved = False
        self._told: FloatArray = np.zeros(shape)
        # The task table is shared with equal agents; here the times to wait for differ by agent.
        self._table = arrays.task_table(agent, score, lambda table: score.fill(table, arrays)).copy()
        self._ready = self._table[READY].copy()
        self._vector = arrays.agent_vector(agent, score.cost_per_metre(agent))
        fixed = score.fixed(arrays, agent)
        self._fixed: FloatArray = np.zeros(arrays.num_tasks) if fixed is None else fixed
        self.refresh_digest()

    # --- what it knows

    def refresh_digest(self) -> None:
        """Count the digest of the bids anew."""
        arrays = self.arrays
        self.digest = int(printed.digest_of(self.bids, arrays.task_hash, arrays.agent_hash))

    def merge(self, table: NDArray[np.int8], sender: int, message: Assignments) -> None:
        """Take in a neighbour's matrix (Algorithm 2). `table` : the decision table of CBBA."""
        their_bids, their_arrivals = np.zeros_like(self.bids), np.zeros_like(self.bids)
        their_bids[message.tasks, message.holders] = message.bids
        their_arrivals[message.tasks, message.holders] = message.arrivals
        printed.merge(
            self.terms, table, self.charitable, self.me, sender, self.bids, self.arrivals, self.heard,
            their_bids, their_arrivals, message.heard,
        )  # fmt: skip
        self.bids[list(self.cancelled)] = 0.0

    def untold(self) -> bool:
        """Whether arrivals have changed since they were last told."""
        return not np.array_equal(self._told, self.arrivals * (self.bids > 0.0))

    def columns(self) -> tuple[IntArray, IntArray, FloatArray, FloatArray]:
        """Return tasks, holders, bids and arrivals of every bid, to be told."""
        tasks, holders = np.nonzero(self.bids)
        self._told = self.arrivals * (self.bids > 0.0)
        return (
            tasks.astype(np.int32), holders.astype(np.int32),
            self.bids[tasks, holders], self.arrivals[tasks, holders],
        )  # fmt: skip

    def holders(self, row: int) -> list[int]:
        """Rows of the agents that bid for a task."""
        return np.flatnonzero(self.bids[row]).tolist()

    def others(self, row: int) -> frozenset[int]:
        """Rows of the other agents that bid for a task."""
        return frozenset(self.holders(row)) - {self.me}

    def complete(self, row: int) -> bool:
        """Whether a task's group is complete: seats, and equipment where that is looked at."""
        if self.charitable:
            return bool(printed.complete(self.terms, self.bids, row))
        return len(self.holders(row)) >= int(self.terms.seats[row])

    def outbid_by(self, row: int, bid: float) -> int:
        """Who took the agent's place at `bid`: the least of those that are better, or NO_AGENT."""
        better = [
            (float(self.bids[row, m]), m)
            for m in self.others(row)
            if outbids(self.bids[row, m], m, bid, self.me)
        ]
        return min(better)[1] if better else NO_AGENT

    # --- what it plans

    def drop(self, row: int) -> None:
        """Take a task out of bundle and path; the bid goes with it."""
        self.bundle.pop(row, None)
        if row in self.path:
            self.path.remove(row)
        self.bids[row, self.me] = 0.0

    def take(self, now: float) -> bool:
        """Take the best task, if there is one (one turn of Algorithm 1's loop)."""
        if len(self.bundle) >= self.limit:
            return False
        gain, position = self._gains()
        ceiling = min(self.bundle.values(), default=math.inf) if self.warp else math.inf
        closed = self.closed.copy()
        closed[list(self.quit)] = True
        row = printed.choose(
            self.terms, self.charitable, self.teams, self.me, self.bids, closed, gain,
            self._table[OPEN], ceiling,
        )  # fmt: skip
        if row == NO_AGENT:
            return False
        bid = min(float(gain[row]), ceiling)
        printed.seat(self.terms, self.charitable, self.bids, row, self.me, bid)
        self.bundle[row] = bid
        self.path.insert(int(position[row]), row)
        self.joined_at[row] = now
        self.times()
        return True

    def _gains(self) -> tuple[FloatArray, NDArray[np.int64]]:
        """What each task would gain, and where in the path (line 6); -inf where it fits nowhere."""
        num_tasks, length, rule = self.arrays.num_tasks, len(self.path), RULES[self.insertion]
        path = np.array([*self.path, 0], np.int64)
        starts, legs, values = np.empty((3, length + 1))
        total = path_state(self._table, self._vector, path, length, starts, rule, starts, legs, values)
        gain, position = np.full(num_tasks, -np.inf), np.zeros(num_tasks, np.int64)
        gains, start_time, places = np.empty(BLOCK), np.empty(BLOCK), np.empty(BLOCK, np.int64)
        for earliest, rows in self._candidates(first_position(rule, length)).items():
            for begin in range(0, len(rows), BLOCK):
                columns = np.array(rows[begin : begin + BLOCK], np.int64)
                count = columns.size
                evaluate(
                    self._table, columns, count, self._vector, path, length, starts, legs, values, total,
                    rule, earliest, length, gains, places, start_time,
                )  # fmt: skip
                gain[columns] = gains[:count] - self._fixed[columns]
                position[columns] = places[:count]
        return gain, position

    def _candidates(self, earliest: int) -> dict[int, list[int]]:
        """Position in the path -> rows of tasks that may be inserted there or later.

        In the charitable reading a task does not go before what its agent itself must do first.
        """
        terms = self.terms
        found: dict[int, list[int]] = {}
        free = ~self.closed & (self.bids[:, self.me] == 0.0) & (self._table[END] >= 0.0)
        for row in np.flatnonzero(free).tolist():
            first = earliest
            if self.charitable and terms.begin[row] < terms.begin[row + 1]:
                needs = terms.prerequisites[terms.begin[row] : terms.begin[row + 1]].tolist()
                first = max([earliest, *(1 + self.path.index(need) for need in needs if need in self.path)])
            found.setdefault(first, []).append(row)
        return found

    def times(self) -> None:
        """Count anew when the agent arrives where."""
        if not self.charitable:
            return
        printed.wait_for_others(
            self.terms, self.me, self.bids, self.arrivals, self._ready, self._table[DURATION],
            self._table[READY],
        )  # fmt: skip
        starts, legs = self._flight()
        free = float(self._vector[AVAILABLE])
        mine = self.arrivals[:, self.me]
        mine[:] = 0.0
        mine[list(self.served)] = list(self.served.values())
        for row, start, leg in zip(self.path, starts, legs, strict=True):
            mine[row] = free + leg * self._vector[SLOWNESS]
            free = start + float(self._table[DURATION, row])

    def _flight(self) -> tuple[list[float], list[float]]:
        """Return starts, s, and legs, m, along the path."""
        length = len(self.path)
        starts, legs, values = np.empty((3, length + 1))
        rows = np.array([*self.path, 0], np.int64)
        path_state(
            self._table, self._vector, rows, length, starts, RULES[self.insertion], starts, legs, values
        )
        return starts[:length].tolist(), legs[:length].tolist()

    def flown(self) -> list[tuple[int, float]]:
        """The path that counts: tasks whose group is complete, with their starts in s."""
        return [
            (row, start)
            for row, start in zip(self.path, self._flight()[0], strict=True)
            if self.complete(row) and self.bids[row, self.me] > 0.0
        ]

    def start_of(self, row: int) -> float:
        """Planned start of service of a task in the path, s."""
        return self._flight()[0][self.path.index(row)]

    def late(self) -> int:
        """The first task in the bundle that would be started after its window, or NO_AGENT."""
        starts = dict(zip(self.path, self._flight()[0], strict=True))
        return next((row for row in self.bundle if starts[row] > self._table[END, row]), NO_AGENT)

    # --- what its vehicle tells it

    def move(self, position: Position, free_at: float) -> None:
        """Count from `position` (m) and `free_at` (s) on; what was flown to it is spent."""
        here = self._vector[AGENT_X : AGENT_Z + 1]
        flown = distance((float(here[0]), float(here[1]), float(here[2])), position)
        self._vector[RANGE] -= flown
        self._vector[AGENT_X : AGENT_Z + 1] = position
        self._vector[AVAILABLE] = free_at
        self.moved = True

    def open_all_of(self, agent: int) -> None:
        """Forget every bid of an agent that is gone, but for what is done."""
        column = self.bids[:, agent]
        column[column < DONE_BID] = 0.0

    def moved_to(self, arrays: MissionArrays) -> PrintedState:
        """Return the same state in the rows of a mission that has tasks added."""
        moved = PrintedState(
            arrays, self.me, self.score, insertion=self.insertion, warp=self.warp,
            charitable=self.charitable, teams=self.teams,
        )  # fmt: skip
        rows = [arrays.task_row[task_id] for task_id in self.arrays.task_ids]
        moved.bids[rows] = self.bids
        moved.arrivals[rows] = self.arrivals
        moved.joined_at[rows] = self.joined_at
        moved.closed[rows] = self.closed
        moved.heard[:] = self.heard
        moved.bundle = {rows[row]: bid for row, bid in self.bundle.items()}
        moved.path = [rows[row] for row in self.path]
        moved.quit = {rows[row]: others for row, others in self.quit.items()}
        moved.served = {rows[row]: start for row, start in self.served.items()}
        moved.cancelled = {rows[row] for row in self.cancelled}
        moved.moved = self.moved
        moved._vector[:] = self._vector
        moved.refresh_digest()
        return moved


def terms_of(arrays: MissionArrays, score: Score) -> PrintedTerms:
    """What the tasks of a mission ask for: what CBGA's referee knows of it, with one row a task."""

    def make() -> PrintedTerms:
        terms = make_terms(arrays, score)
        return PrintedTerms(
            seats=terms.seats,
            need=terms.full[terms.kind],
            brings=terms.brings[terms.kind],
            first=terms.cover_at[terms.kind],
            least=terms.cover,
            able=terms.allowed.sum(axis=0, dtype=np.int64),
            begin=terms.need_at,
            prerequisites=terms.needs,
            order=np.argsort(terms.stage, kind="stable"),
        )

    return arrays.shared(("printed terms", score), make)


def translated(message: Assignments, arrays: MissionArrays) -> Assignments:
    """Return `message` in the rows of `arrays`; itself if it is in them already.

    Raises
    ------
    MessageError : it names a task or an agent that is not known here.
    """
    if message.task_ids is arrays.task_ids and message.agent_ids is arrays.agent_ids:
        return message
    try:
        agents = np.array([arrays.agent_row[name] for name in message.agent_ids], np.int32)
        tasks = np.array([arrays.task_row[name] for name in message.task_ids], np.int32)
    except KeyError as error:
        raise MessageError("unknown_id", f"{error.args[0]!r} is not known here") from None
    heard = np.full(arrays.num_agents, NOT_LISTED, np.int64)
    heard[agents] = message.heard
    return replace(
        message,
        agent_ids=arrays.agent_ids,
        task_ids=arrays.task_ids,
        heard=heard,
        tasks=tasks[message.tasks],
        holders=agents[message.holders],
        agreed=agents[message.agreed],
        left=agents[message.left],
    )


def why_not(mission: Mission) -> list[str]:
    """Return what of a mission the printed algorithm has no rule for, in sentences."""
    reasons = []
    free = [task.id for task in mission.tasks if task.agents_required < 1]
    many = too_much_equipment(mission)
    if free:
        reasons.append(f"task {free[0]} leaves open how many agents do it")
    if many:
        reasons.append(f"task {many[0]} needs more than {MOST_EQUIPMENT} kinds of equipment")
    return reasons
