"""Ids to rows, and a mission to the numbers that kernels read.

Rows follow the order of ids as byte strings, agents and tasks alike, so that "the highest id" and
"the smallest id" are comparisons of rows, and every agent gets the same rows from the same mission.
The layout of the kernels' tables is written down here, once; `swarmbid.kernels` reads it.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable, Hashable
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from swarmbid.messages import FloatArray as FloatArray
from swarmbid.messages import IntArray as IntArray
from swarmbid.messages import StampArray as StampArray
from swarmbid.model import Agent, Mission, Task

HashArray = NDArray[np.uint64]
RowArray = NDArray[np.int64]
"""Rows and counts in kernels: one integer type, so that each function is compiled once."""
Shared = TypeVar("Shared")

NO_AGENT = -1
"""Row of "nobody" (the papers' empty set)."""

# Rows of the task table, float64[NUM_TASK_ROWS, num_tasks]: one column a task.
X, Y, Z = 0, 1, 2  # position, m
END = 3  # latest start of service, s; -inf where the agent may not do the task
READY = 4  # earliest start of service an agent would choose, s
OPEN = 5  # earliest start of service allowed, s
DURATION = 6  # s
REWARD = 7
REFERENCE = 8  # s, where the decay counts from
DECAY = 9  # 1/s
PEAK = 10  # s
INVERSE_WIDTH = 11  # 1/s, 0 for no peak
NUM_TASK_ROWS = 12

# Slots of the agent vector, float64[NUM_AGENT_SLOTS].
AGENT_X, AGENT_Y, AGENT_Z = 0, 1, 2  # m
SLOWNESS = 3  # s/m
AVAILABLE = 4  # s
COST_PER_METRE = 5  # score units
RANGE = 6  # m, the way back included
LATEST_RETURN = 7  # s
HAS_BASE, BASE_X, BASE_Y, BASE_Z = 8, 9, 10, 11
DISTANCE_STEP = 12  # m, 0 for exact distances
NUM_AGENT_SLOTS = 13


class VisitRecord(NamedTuple):
    """What a user's own score may look at (`swarmbid.scores._custom`).

    Parameters
    ----------
    reward : of the task. discount : 1/s.
    window_start, window_end, duration : s. start : s, when service starts.
    revisit_at : s, 0 if none. revisit_rate : 1/s, one over the revisit's width, 0 if none.
    leg : m flown from the previous stop. fuel_per_metre : of the agent.
    """

    reward: float
    discount: float
    window_start: float
    window_end: float
    duration: float
    revisit_at: float
    revisit_rate: float
    start: float
    leg: float
    fuel_per_metre: float


class MissionArrays:
    """A mission's agents and tasks in order of id, with their rows, physics and hashes.

    Attributes
    ----------
    agents, tasks : in order of id.
    agent_ids, task_ids : their ids, as tuples that messages share.
    agent_row, task_row : id -> row.
    agent_lengths, task_lengths : bytes of each id.
    agent_hash, task_hash : uint64 per row, the same for the same id on every machine.
    """

    def __init__(self, mission: Mission) -> None:
        self.mission = mission
        self.agents: list[Agent] = sorted(mission.agents, key=lambda agent: agent.id.encode())
        self.tasks: list[Task] = sorted(mission.tasks, key=lambda task: task.id.encode())
        self.agent_ids = tuple(agent.id for agent in self.agents)
        self.task_ids = tuple(task.id for task in self.tasks)
        self.agent_row = {agent_id: row for row, agent_id in enumerate(self.agent_ids)}
        self.task_row = {task_id: row for row, task_id in enumerate(self.task_ids)}
        self.agent_lengths = np.array([len(name) for name in self.agent_ids], np.int64)
        self.task_lengths = np.array([len(name) for name in self.task_ids], np.int64)
        self.agent_hash = _hashes("agent", self.agent_ids)
        self.task_hash = _hashes("task", self.task_ids)
        self._physics = _physics(self.tasks)
        self._shared: dict[Hashable, Any] = {}

    @property
    def num_agents(self) -> int:
        """How many agents the mission has (N_n)."""
        return len(self.agents)

    @property
    def num_tasks(self) -> int:
        """How many tasks the mission has (N_m)."""
        return len(self.tasks)

    def bundle_limit(self, agent: Agent) -> int:
        """Most tasks `agent` takes at once (L_t), never more than there are."""
        return self.num_tasks if agent.bundle_limit is None else min(agent.bundle_limit, self.num_tasks)

    def shared(self, key: Hashable, make: Callable[[], Shared]) -> Shared:
        """Return what `make` gives, made once for all the agents of this process."""
        if key not in self._shared:
            self._shared[key] = make()
        found: Shared = self._shared[key]
        return found

    def value_table(self, owner: Hashable, fill: Callable[[FloatArray], None]) -> FloatArray:
        """Return the task table with the value rows of a score, whoever may do what.

        Parameters
        ----------
        owner : whose value rows these are (a score): part of the key.
        fill : writes the value rows of a table whose physics rows are filled.
        """

        def make() -> FloatArray:
            table = self._physics.copy()
            fill(table)
            return table

        return self.shared(("values", owner), make)

    def task_table(self, agent: Agent, owner: Hashable, fill: Callable[[FloatArray], None]) -> FloatArray:
        """Return the task table for `agent`; equal agents share one.

        Agents of one type and equipment may do the same tasks, so a thousand of them share a table.

        Parameters
        ----------
        owner, fill : as for `value_table`.
        """

        def make() -> FloatArray:
            table = self.value_table(owner, fill).copy()
            for row, task in enumerate(self.tasks):
                if not self.mission.can_do(agent, task):
                    table[END, row] = -math.inf
            return table

        return self.shared((agent.type, agent.equipment, owner), make)

    def agent_vector(self, agent: Agent, cost_per_metre: float) -> FloatArray:
        """Return the slots above for `agent`."""
        vector = np.zeros(NUM_AGENT_SLOTS)
        vector[AGENT_X : AGENT_Z + 1] = agent.position
        vector[SLOWNESS] = 1.0 / agent.speed
        vector[AVAILABLE] = agent.available_at
        vector[COST_PER_METRE] = cost_per_metre
        vector[RANGE] = agent.range
        vector[LATEST_RETURN] = agent.available_at + agent.endurance
        if agent.base is not None:
            vector[HAS_BASE] = 1.0
            vector[BASE_X : BASE_Z + 1] = agent.base
        vector[DISTANCE_STEP] = self.mission.distance_step
        return vector


def _physics(tasks: list[Task]) -> FloatArray:
    table = np.zeros((NUM_TASK_ROWS, len(tasks)))
    for row, task in enumerate(tasks):
        table[X : Z + 1, row] = task.position
        table[END, row] = task.end
        table[READY, row] = task.start
        table[OPEN, row] = task.start
        table[DURATION, row] = task.duration
    return table


def _hashes(kind: str, ids: tuple[str, ...]) -> HashArray:
    return np.array(
        [
            int.from_bytes(hashlib.blake2b(f"{kind}\x1f{name}".encode(), digest_size=8).digest(), "little")
            for name in ids
        ],
        dtype=np.uint64,
    )
