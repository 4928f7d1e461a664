"""Reward that fades after a task opens, less fuel: the slides' score.

value = r_j exp(-λ (t - start_j)) - fuel * metres   (Dymkou's slides, "Score function")

Fuel is counted in one of two ways. ``path``: along the path that is flown, which is the truth.
``start``: from the agent's initial position to each task, as the slides declare it. That counts
some fuel twice, but the gains then diminish as the bundle grows (under promised times), on which the
theorems of CBBA rest; so it is kept, and the true path score is reported beside it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from swarmbid.arrays import DECAY, OPEN, REFERENCE, REWARD, FloatArray, MissionArrays
from swarmbid.errors import Fault, InputError
from swarmbid.model import Agent, Mission, Task
from swarmbid.scores import Score, task_values


@dataclass(frozen=True)
class TimeDiscounted(Score):
    """r_j exp(-λ (t - start_j)) less fuel.

    Parameters
    ----------
    fuel : "path" (metres flown) or "start" (metres from the agent's initial position, declared).
    """

    fuel: str = "path"

    def __post_init__(self) -> None:
        if self.fuel not in ("path", "start"):
            raise InputError(
                [Fault("score time_discounted", "fuel", f"is {self.fuel!r}", "Give 'path' or 'start'.")]
            )

    def value(self, mission: Mission, agent: Agent, task: Task, start: float, leg: float) -> float:
        """Score units of one visit."""
        metres = leg if self.fuel == "path" else mission.distance(agent.position, task.position)
        return task.reward * math.exp(-task.discount * (start - task.start)) - agent.fuel_per_metre * metres

    def fill(self, table: FloatArray, arrays: MissionArrays) -> None:
        """Reward that decays from the opening of the window."""
        table[REWARD] = task_values(arrays, "reward")
        table[DECAY] = task_values(arrays, "discount")
        table[REFERENCE] = table[OPEN]

    def cost_per_metre(self, agent: Agent) -> float:
        """Fuel along the path; nothing when it is counted from the start."""
        return agent.fuel_per_metre if self.fuel == "path" else 0.0

    def fixed(self, arrays: MissionArrays, agent: Agent) -> FloatArray | None:
        """Fuel from the agent's initial position to each task, when it is counted so."""
        if self.fuel == "path" or agent.fuel_per_metre == 0.0:
            return None
        metres = [arrays.mission.distance(agent.position, task.position) for task in arrays.tasks]
        return agent.fuel_per_metre * np.array(metres, dtype=np.float64)

    def diminishing(self, insertion: str) -> bool:
        """True under promised times with fuel from the start (a gap only shrinks as tasks come in)."""
        return insertion == "hold" and self.fuel == "start"

    def honest(self) -> Score:
        """The same with fuel along the path."""
        return TimeDiscounted(fuel="path")
