"""What is left of a negotiation that did not end in agreement: who differs, and what nobody disputes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from swarmbid.model import Mission
from swarmbid.negotiator import Negotiator

MOST_DISAGREEMENTS = 100


def disagreements(negotiators: Sequence[Negotiator]) -> list[dict[str, Any]]:
    """Return the tasks on which beliefs differ, with who believes in whom; at most MOST_DISAGREEMENTS."""
    if len({one.digest for one in negotiators}) <= 1:
        return []
    held = [(one.agent_id, one.beliefs()) for one in negotiators]
    found: list[dict[str, Any]] = []
    for task_id in held[0][1]:
        camps: dict[tuple[str, ...], list[str]] = {}
        for agent_id, beliefs in held:
            camps.setdefault(tuple(name for name, _ in beliefs.get(task_id, ())), []).append(agent_id)
        if len(camps) > 1 and len(found) < MOST_DISAGREEMENTS:
            holders = [{"holders": list(camp), "agents": camps[camp]} for camp in sorted(camps)]
            found.append({"task": task_id, "beliefs": holders})
    return found


def undisputed(mission: Mission, negotiators: Sequence[Negotiator]) -> dict[str, list[tuple[str, float]]]:
    """Leave each seat to the best of the agents that plan to take it, so that no task is counted twice.

    A group that is then not complete, or not of one mind about when it starts, is no group; nor is one
    whose prerequisites are not done.
    """
    paths = {one.agent_id: one.path for one in negotiators}
    plans: dict[str, list[tuple[float, str, float]]] = {}
    for one in negotiators:
        beliefs = one.beliefs()
        for task_id, start in paths[one.agent_id]:
            bid = dict(beliefs[task_id]).get(one.agent_id, -math.inf)
            plans.setdefault(task_id, []).append((bid, one.agent_id, start))
    crews: dict[str, set[str]] = {}
    tasks = {task.id: task for task in mission.tasks}
    for task_id, plan in plans.items():
        seats = tasks[task_id].agents_required or len(plan)
        best = sorted(plan, reverse=True)[:seats]
        if len(best) == seats and len({start for _, _, start in best}) == 1:
            crews[task_id] = {agent_id for _, agent_id, _ in best}
    while True:
        waiting = [name for name in crews if any(need not in crews for need in tasks[name].prerequisites)]
        if not waiting:
            break
        for name in waiting:
            del crews[name]
    return {
        agent_id: [(task_id, start) for task_id, start in path if agent_id in crews.get(task_id, ())]
        for agent_id, path in paths.items()
    }
