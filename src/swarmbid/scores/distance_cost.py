"""Reward less metres flown and seconds of service (Hunt 2014, eq. (7)).

The paper adds metres to seconds; the two weights say so openly. (Eq. (8), the wait for the latest
member of a group, belongs to tasks that need several agents.)
"""

from __future__ import annotations

from dataclasses import dataclass

from swarmbid.arrays import REWARD, FloatArray, MissionArrays
from swarmbid.model import Agent, Mission, Task
from swarmbid.scores import Score, need_number, task_values


@dataclass(frozen=True)
class DistanceCost(Score):
    """r_j - (metre_cost * d_ij + second_cost * t_j).

    Parameters
    ----------
    metre_cost : score units per m of leg.
    second_cost : score units per s of service.
    """

    metre_cost: float = 1.0
    second_cost: float = 1.0

    def __post_init__(self) -> None:
        need_number(self, "metre_cost")
        need_number(self, "second_cost")

    def value(self, mission: Mission, agent: Agent, task: Task, start: float, leg: float) -> float:
        """Score units of one visit."""
        return (task.reward - self.second_cost * task.duration) - self.metre_cost * leg

    def fill(self, table: FloatArray, arrays: MissionArrays) -> None:
        """What is left of the reward after the service is paid."""
        table[REWARD] = task_values(arrays, "reward") - self.second_cost * task_values(arrays, "duration")

    def cost_per_metre(self, agent: Agent) -> float:
        """The weight of a metre."""
        return self.metre_cost
