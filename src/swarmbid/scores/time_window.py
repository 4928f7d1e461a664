"""The whole reward for service that starts within the window, nothing outside it; fuel along the path.

Windows are physics and hold under every score; this one makes nothing else of time. It is the score of
team orienteering, where a task is worth the same whenever it is done.
"""

from __future__ import annotations

from dataclasses import dataclass

from swarmbid.arrays import REWARD, FloatArray, MissionArrays
from swarmbid.model import Agent, Mission, Task
from swarmbid.scores import Score, task_values


@dataclass(frozen=True)
class TimeWindow(Score):
    """r_j within [start_j, end_j], less fuel along the path."""

    def value(self, mission: Mission, agent: Agent, task: Task, start: float, leg: float) -> float:
        """Score units of one visit."""
        if not task.start <= start <= task.end:
            return 0.0
        return task.reward - agent.fuel_per_metre * leg

    def fill(self, table: FloatArray, arrays: MissionArrays) -> None:
        """The reward; the kernel holds the window."""
        table[REWARD] = task_values(arrays, "reward")
