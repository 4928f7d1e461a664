"""One agent's bundle, path and times, and the geometry that its bids are counted from."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from swarmbid.arrays import (
    AGENT_X,
    AGENT_Z,
    AVAILABLE,
    END,
    RANGE,
    FloatArray,
    IntArray,
    MissionArrays,
)
from swarmbid.kernels.bundle import (
    BID,
    BUNDLE,
    NUM_MARK_ROWS,
    NUM_ORDER_ROWS,
    PATH,
    PROMISED,
    START,
    bounds,
    build_bundle,
    worth_weighing,
)
from swarmbid.kernels.insertion import APPEND, HOLD, SHIFT
from swarmbid.model import Position, distance
from swarmbid.scores import Score

RULES = {"hold": HOLD, "shift": SHIFT, "append": APPEND}
GAIN_BYTES = 64 * 2**20
"""Most memory for kept gains per agent; longer bundles count their last gains afresh each time."""


class Bundle:
    """What an agent has taken, in order of taking and in order of visit.

    Parameters
    ----------
    limit : most tasks (L_t). insertion : "hold", "shift" or "append". warp : whether bids never rise.
    """

    def __init__(
        self, arrays: MissionArrays, me: int, score: Score, *, limit: int, insertion: str, warp: bool
    ) -> None:
        agent = arrays.agents[me]
        self.arrays = arrays
        self.me = me
        self.score = score
        self.insertion = insertion
        self.warp = warp
        self.limit = limit
        self.length = 0
        self.order: NDArray[np.int64] = np.full((NUM_ORDER_ROWS, limit), -1, np.int64)
        self.marks: FloatArray = np.zeros((NUM_MARK_ROWS, limit))
        self._table = arrays.task_table(agent, score, lambda table: score.fill(table, arrays))
        fixed = score.fixed(arrays, agent)
        self._fixed: FloatArray = np.zeros(0) if fixed is None else fixed
        self._vector = arrays.agent_vector(agent, score.cost_per_metre(agent))
        rows = min(limit + 1, max(2, GAIN_BYTES // (8 * max(arrays.num_tasks, 1))))
        self._gain: FloatArray = np.empty((rows, arrays.num_tasks))
        self._extent: NDArray[np.int64] = np.zeros(rows, np.int64)
        self._known = 0
        self._build = _phase(score)
        self._closed: set[int] = set()
        self._moved = False
        self._bound()

    @property
    def tasks(self) -> NDArray[np.int64]:
        """Rows in order of taking (b_i)."""
        return self.order[BUNDLE, : self.length]

    @property
    def path(self) -> list[tuple[int, float]]:
        """Rows in order of visit (p_i) with their starts of service in s (τ_i)."""
        rows, starts = self.order[PATH, : self.length], self.marks[START, : self.length]
        return list(zip(rows.tolist(), starts.tolist(), strict=True))

    def to_weigh(
        self, changed: IntArray, bid_to_beat: FloatArray, rank_to_beat: IntArray
    ) -> tuple[NDArray[np.int64], bool]:
        """Which of the changed tasks could enter, and whether to build; see `worth_weighing`."""
        return worth_weighing(  # type: ignore[no-any-return]
            changed, self.me, bid_to_beat, rank_to_beat, self._bounds, self._place_of, self.order, self.length
        )

    def build(
        self, bid_to_beat: FloatArray, rank_to_beat: IntArray, changed: NDArray[np.int64], kept: int
    ) -> None:
        """Take tasks afresh (phase 1); the parameters are those of `build_bundle`."""
        if self._moved:  # places and promised times were counted from elsewhere: none may be kept
            self.length = kept = 0
            self._moved = False
        self.length, self._known = self._build(
            self._table, self._fixed, self._vector, self.me, RULES[self.insertion], self.warp,
            bid_to_beat, rank_to_beat, kept, self._known, self.length, changed,
            self._bounds, self._ranking, self._place_of, self._gain, self._extent, self.order, self.marks,
        )  # fmt: skip

    def _bound(self) -> None:
        """Rank the tasks by the most that each can gain from here; all gains are to be counted afresh."""
        self._known = 0
        bound = np.full(self.arrays.num_tasks, math.inf)
        if self.score.visit_function() is None:  # of a user's own score nothing is known
            bounds(self._table, self._fixed, self._vector, bound)
        self._ranking: NDArray[np.int64] = np.argsort(-bound, kind="stable")
        self._bounds = bound[self._ranking]
        self._place_of: NDArray[np.int64] = np.empty_like(self._ranking)
        self._place_of[self._ranking] = np.arange(bound.size)

    def close(self, row: int) -> None:
        """Never bid on this task again."""
        if not self._closed:
            self._table = self._table.copy()  # the table is shared with equal agents
        self._closed.add(row)
        self._table[END, row] = -math.inf
        self._bound()

    def move(self, position: Position, free_at: float) -> None:
        """Count bids from `position` (m) and `free_at` (s) on; what was flown to it is spent."""
        here = self._vector[AGENT_X : AGENT_Z + 1]
        flown = distance((float(here[0]), float(here[1]), float(here[2])), position)
        self._vector[RANGE] -= flown
        self._vector[AGENT_X : AGENT_Z + 1] = position
        self._vector[AVAILABLE] = free_at
        self._moved = True
        self._bound()

    def take_out(self, row: int) -> None:
        """Remove a task without giving it up: it has been started. The path is built afresh next time."""
        length = self.length
        for line, marks in ((BUNDLE, (BID, PROMISED)), (PATH, (START,))):
            stay = self.order[line, :length] != row
            self.length = int(np.count_nonzero(stay))
            self.order[line, : self.length] = self.order[line, :length][stay]
            for mark in marks:
                self.marks[mark, : self.length] = self.marks[mark, :length][stay]

    def drop_all(self) -> None:
        """Give up the whole bundle."""
        self.length = 0
        self._known = 0

    def moved_to(self, arrays: MissionArrays) -> Bundle:
        """Return the same bundle in the rows of a mission that has tasks added."""
        agent = arrays.agents[self.me]
        limit = self.limit if agent.bundle_limit is not None else arrays.bundle_limit(agent)
        moved = Bundle(arrays, self.me, self.score, limit=limit, insertion=self.insertion, warp=self.warp)
        moved._vector[:] = self._vector
        moved._moved = self._moved
        moved._bound()
        rows = np.array([arrays.task_row[task_id] for task_id in self.arrays.task_ids], np.int64)
        for row in sorted(self._closed):
            moved.close(int(rows[row]))
        moved.length = self.length
        moved.marks[:, : self.length] = self.marks[:, : self.length]
        moved.order[:, : self.length] = self.order[:, : self.length]
        for line in (BUNDLE, PATH):
            moved.order[line, : self.length] = rows[self.order[line, : self.length]]
        return moved


def _phase(score: Score) -> Callable[..., Any]:
    function = score.visit_function()
    if function is None:
        return build_bundle
    from swarmbid.kernels.custom import phase_with

    return phase_with(function)
