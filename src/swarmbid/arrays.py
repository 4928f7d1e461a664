"""Ids to rows, and a mission to the numbers that kernels read.

Rows follow the order of ids as byte strings, agents and tasks alike, so that "the highest id" and
"the smallest id" are comparisons of rows, and every agent gets the same rows from the same mission.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from swarmbid.model import Agent, Mission, Task

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

NO_AGENT = -1
"""Row of "nobody" (the papers' empty set)."""


class MissionArrays:
    """A mission's agents and tasks in order of id, with their rows.

    Attributes
    ----------
    agents, tasks : in order of id.
    agent_row, task_row : id -> row.
    """

    def __init__(self, mission: Mission) -> None:
        self.mission = mission
        self.agents: list[Agent] = sorted(mission.agents, key=lambda agent: agent.id.encode())
        self.tasks: list[Task] = sorted(mission.tasks, key=lambda task: task.id.encode())
        self.agent_row = {agent.id: row for row, agent in enumerate(self.agents)}
        self.task_row = {task.id: row for row, task in enumerate(self.tasks)}
        self._allowed: dict[tuple[str, frozenset[str]], NDArray[np.bool_]] = {}

    @property
    def num_agents(self) -> int:
        """How many agents the mission has (N_n)."""
        return len(self.agents)

    @property
    def num_tasks(self) -> int:
        """How many tasks the mission has (N_m)."""
        return len(self.tasks)

    def allowed(self, agent: Agent) -> NDArray[np.bool_]:
        """Return bool[num_tasks]: what `agent` may do, by type and equipment."""
        key = (agent.type, agent.equipment)
        if key not in self._allowed:
            self._allowed[key] = np.array(
                [self.mission.can_do(agent, task) for task in self.tasks], dtype=np.bool_
            )
        return self._allowed[key]

    def bundle_limit(self, agent: Agent) -> int:
        """Most tasks `agent` takes at once (L_t), never more than there are."""
        return self.num_tasks if agent.bundle_limit is None else min(agent.bundle_limit, self.num_tasks)
