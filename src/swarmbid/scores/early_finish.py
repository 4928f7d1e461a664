"""A reward that fades from the start of the mission on, more slowly for urgent tasks: a short makespan.

    value = r_j exp(-(t - t_0 + slack_j) / time_constant) - fuel * metres

t_0 is when the first agent is available. Urgent is what much must follow (its tail) and what few can do
(its scarcity). An agent that appends to its path takes the task that it can start the earliest, less the
head start that urgency gives, whatever the time constant. Inserting weighs the delay of later tasks too.

A sum of values knows no makespan; this one leads to a short one as list scheduling does: nobody waits
for what can be done later, and the longest chains begin first. All rewards equal, it is the only thing
that decides; a reward larger by the factor e is worth one time constant.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from swarmbid.arrays import DECAY, REFERENCE, REWARD, FloatArray, MissionArrays
from swarmbid.model import Agent, Mission, Task, distance
from swarmbid.scores import Score, need_number, task_values


@dataclass(frozen=True)
class EarlyFinish(Score):
    """r_j exp(-(t - t_0 + slack_j) / time_constant), less fuel along the path.

    The urgency of a task, in s, is ``tail`` times the time that must follow it, plus ``scarcity`` times
    the share of the team that it takes. Its slack is how much less urgent it is than the most urgent
    task. What must follow: the longest chain of tasks that wait for it, and the way home from it of the
    agent that is home the soonest. What it takes: its seats, as a share of the agents that may do it by
    type, and for each equipment one over the number of those that carry it.

    Parameters
    ----------
    time_constant : s in which a reward falls to 1/e; about the makespan that is expected.
    tail : s of urgency per s that must follow.
    scarcity : s of urgency of a task that takes the whole team.
    """

    time_constant: float = 600.0
    tail: float = 1.0
    scarcity: float = 0.0

    def __post_init__(self) -> None:
        need_number(self, "time_constant", low=1e-3)
        need_number(self, "tail")
        need_number(self, "scarcity")

    def value(self, mission: Mission, agent: Agent, task: Task, start: float, leg: float) -> float:
        """Score units of one visit."""
        delay = start - self._references(mission)[task.id]
        return task.reward * math.exp(-delay / self.time_constant) - agent.fuel_per_metre * leg

    def fill(self, table: FloatArray, arrays: MissionArrays) -> None:
        """A decay that counts from the beginning less the slack."""
        references = self._references(arrays.mission)
        table[REWARD] = task_values(arrays, "reward")
        table[DECAY] = 1.0 / self.time_constant
        table[REFERENCE] = np.array([references[task.id] for task in arrays.tasks], dtype=np.float64)

    def _references(self, mission: Mission) -> dict[str, float]:
        """Task id -> the time, s, at which it is worth its whole reward: t_0 - slack_j."""
        compatible = frozenset(mission.compatible.items())
        return _references(mission.agents, mission.tasks, compatible, self.tail, self.scarcity)


@lru_cache(maxsize=8)  # a score is asked for every visit, and its mission is the same each time
def _references(
    agents: tuple[Agent, ...],
    tasks: tuple[Task, ...],
    compatible: frozenset[tuple[str, frozenset[str]]],
    tail: float,
    scarcity: float,
) -> dict[str, float]:
    begin = min((agent.available_at for agent in agents), default=0.0)
    chains = follow_ups(tasks)
    allowed = dict(compatible)
    urgency = {}
    for task in tasks:
        able = [agent for agent in agents if task.type in allowed.get(agent.type, (task.type,))]
        home = [distance(task.position, agent.base) / agent.speed for agent in able if agent.base is not None]
        follows = chains[task.id] + min(home, default=0.0)
        urgency[task.id] = tail * follows + scarcity * _share(task, able)
    most = max(urgency.values(), default=0.0)
    return {task_id: begin - (most - own) for task_id, own in urgency.items()}


def _share(task: Task, able: list[Agent]) -> float:
    """The share of the team that a task takes, seats and equipment; nothing if nobody can do it."""
    if not able:
        return 0.0
    bearers = [sum(name in agent.equipment for agent in able) for name in task.equipment]
    # In order of size: a set has no order that is the same in every process, and sums depend on it.
    return task.agents_required / len(able) + sum(1.0 / count for count in sorted(bearers) if count)


def follow_ups(tasks: tuple[Task, ...]) -> dict[str, float]:
    """Return task id -> s of service in the longest chain of tasks that wait for it, itself not counted.

    Examples
    --------
    >>> here = (0.0, 0.0, 0.0)
    >>> first = Task(id="first", position=here, duration=5.0)
    >>> then = Task(id="then", position=here, duration=7.0, prerequisites=("first",))
    >>> follow_ups((first, then))
    {'first': 7.0, 'then': 0.0}
    """
    waiting: dict[str, int] = {task.id: 0 for task in tasks}  # how many wait for it and are not settled
    for task in tasks:
        for first in task.prerequisites:
            if first in waiting:
                waiting[first] += 1
    by_id = {task.id: task for task in tasks}
    chains = {task.id: 0.0 for task in tasks}
    ready = [task for task in tasks if waiting[task.id] == 0]
    while ready:
        task = ready.pop()
        for first in task.prerequisites:
            if first not in chains:
                continue
            chains[first] = max(chains[first], task.duration + chains[task.id])
            waiting[first] -= 1
            if waiting[first] == 0:
                ready.append(by_id[first])
    return chains
