"""What the drawings share: a mission and its plan, looked up by id, and the order of agents."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

from swarmbid.model import Agent, Mission, Task
from swarmbid.plan import AgentPlan, Plan, Visit
from swarmbid.unserved import Unserved


@dataclass(frozen=True)
class Row:
    """One agent of the report.

    Parameters
    ----------
    index : its number in order of id, which decides its colour.
    agent, plan : who it is, what it does.
    """

    index: int
    agent: Agent
    plan: AgentPlan


@dataclass(frozen=True)
class Scene:
    """A mission with its plan."""

    mission: Mission
    plan: Plan

    @cached_property
    def tasks(self) -> dict[str, Task]:
        """Task by id."""
        return {task.id: task for task in self.mission.tasks}

    @cached_property
    def rows(self) -> list[Row]:
        """Agents in order of id; one that the plan leaves out stands idle."""
        plans = {one.agent: one for one in self.plan.agents}
        agents = sorted(self.mission.agents, key=lambda agent: agent.id.encode())
        return [
            Row(index, agent, plans.get(agent.id) or AgentPlan(agent.id, (), 0.0, agent.available_at, 0.0))
            for index, agent in enumerate(agents)
        ]

    @cached_property
    def served(self) -> dict[str, list[tuple[Row, int, Visit]]]:
        """Task id -> who visits it, as which stop of the path (0 for first)."""
        found: dict[str, list[tuple[Row, int, Visit]]] = {}
        for row in self.rows:
            for place, visit in enumerate(row.plan.visits):
                found.setdefault(visit.task, []).append((row, place, visit))
        return found

    @cached_property
    def unserved(self) -> list[Task]:
        """Tasks that nobody visits, in order of id."""
        left = [task for task in self.mission.tasks if task.id not in self.served]
        return sorted(left, key=lambda task: task.id.encode())

    @cached_property
    def reasons(self) -> dict[str, Unserved]:
        """Task id -> why the plan leaves it out."""
        return {left.task: left for left in self.plan.unserved}

    @cached_property
    def makespan(self) -> float:
        """When the last task ends, s; 0 without a visit."""
        return max((visit.end for row in self.rows for visit in row.plan.visits), default=0.0)

    @cached_property
    def horizon(self) -> float:
        """When the last agent is done, s; at least 1."""
        finish = max((row.plan.finish for row in self.rows if row.plan.visits), default=0.0)
        return max(finish, self.makespan, 1.0)

    @cached_property
    def windows(self) -> bool:
        """Whether any task has a window that closes, or opens late."""
        return any(has_window(task) for task in self.mission.tasks)


def has_window(task: Task) -> bool:
    """Whether the start of service is bounded from either side."""
    return task.start > 0.0 or math.isfinite(task.end)


def count(number: int, one: str, many: str | None = None) -> str:
    """Write a number with its noun: ``1 task``, ``3 tasks``."""
    return f"{number:,} {one if number == 1 else many or one + 's'}"
