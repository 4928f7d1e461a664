"""A reward that peaks at a scheduled time: come back in an hour, neither at once nor much later.

value = r_j exp(-((t - revisit_at) / revisit_width)^2) - fuel * metres

An agent that is early waits for the peak, as far as the window allows. A task without `revisit_at`
keeps its plain reward.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from swarmbid.arrays import INVERSE_WIDTH, PEAK, READY, REWARD, FloatArray, MissionArrays
from swarmbid.model import Agent, Mission, Task
from swarmbid.scores import Score, task_values


@dataclass(frozen=True)
class Revisit(Score):
    """r_j exp(-((t - revisit_at) / revisit_width)^2), less fuel along the path."""

    def value(self, mission: Mission, agent: Agent, task: Task, start: float, leg: float) -> float:
        """Score units of one visit."""
        fuel = agent.fuel_per_metre * leg
        if task.revisit_at is None:
            return task.reward - fuel
        off = (start - task.revisit_at) / task.revisit_width
        return task.reward * math.exp(-off * off) - fuel

    def fill(self, table: FloatArray, arrays: MissionArrays) -> None:
        """A peak at the scheduled time, for which an early agent waits."""
        table[REWARD] = task_values(arrays, "reward")
        for row, task in enumerate(arrays.tasks):
            if task.revisit_at is not None:
                table[PEAK, row] = task.revisit_at
                table[INVERSE_WIDTH, row] = 1.0 / task.revisit_width
                table[READY, row] = min(max(task.start, task.revisit_at), task.end)
