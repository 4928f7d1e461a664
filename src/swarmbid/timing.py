"""When everything starts, once it is settled who does what in which order: plain Python, from the mission.

A visit waits for the agent's visit before it and the way, for the task's window, for whoever else is in
its group, and for what must come first. The times that result are the earliest there are, and the only
ones in which nobody waits without a reason.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from swarmbid.model import Agent, Mission, Task

Path = list[tuple[Task, float]]
"""Visits in order: the task and its start of service, s."""


def joint_starts(
    mission: Mission, orders: Mapping[str, Sequence[str]], ready: Mapping[str, float] | None = None
) -> dict[str, float] | None:
    """Return the earliest start of every task visited, s; None if agents wait for each other in a circle.

    Windows, ranges and seats are not judged: a start may lie after the end of its window.

    Parameters
    ----------
    orders : agent id -> task ids in order of doing. Who has the same task starts it at the same time.
    ready : task id -> s before which it may not start, where that is later than its window opens.

    Examples
    --------
    >>> here, there = (0.0, 0.0, 0.0), (8.0, 0.0, 0.0)
    >>> mission = Mission(
    ...     agents=(Agent(id="a", position=here), Agent(id="b", position=here, speed=2.0)),
    ...     tasks=(Task(id="t", position=there, agents_required=2),),
    ... )
    >>> joint_starts(mission, {"a": ["t"], "b": ["t"]})
    {'t': 8.0}
    """
    tasks = {task.id: task for task in mission.tasks}
    agents = {agent.id: agent for agent in mission.agents}
    starts: dict[str, float] = {}
    # What waits for a task, with the seconds from its start on; and how much each task still waits for.
    after: dict[str, list[tuple[str, float]]] = {}
    waiting: dict[str, int] = {}
    for order in orders.values():
        for task_id in order:
            if task_id not in after:
                after[task_id], waiting[task_id] = [], 0
                starts[task_id] = max(tasks[task_id].start, (ready or {}).get(task_id, 0.0))
    for agent_id, order in orders.items():
        agent = agents[agent_id]
        place, before = agent.position, ""
        for task_id in order:
            task = tasks[task_id]
            travel = mission.distance(place, task.position) / agent.speed
            if before:
                after[before].append((task_id, tasks[before].duration + travel))
                waiting[task_id] += 1
            else:
                starts[task_id] = max(starts[task_id], agent.available_at + travel)
            place, before = task.position, task_id
    for task_id in after:
        for need in tasks[task_id].prerequisites:
            if need in after:
                after[need].append((task_id, tasks[need].duration))
                waiting[task_id] += 1
    startable = [task_id for task_id, count in waiting.items() if count == 0]
    settled = 0
    while startable:
        first = startable.pop()
        settled += 1
        for task_id, seconds in after[first]:
            starts[task_id] = max(starts[task_id], starts[first] + seconds)
            waiting[task_id] -= 1
            if waiting[task_id] == 0:
                startable.append(task_id)
    return starts if settled == len(after) else None


def flight(mission: Mission, agent: Agent, path: Sequence[tuple[Task, float]]) -> tuple[float, float]:
    """Return metres flown and the time of being done, s, the way back to base included.

    An agent with no task stays where it is: 0 m, done at `available_at`.
    """
    metres, finish, place = 0.0, agent.available_at, agent.position
    for task, start in path:
        metres += mission.distance(place, task.position)
        finish = start + task.duration
        place = task.position
    if path and agent.base is not None:
        back = mission.distance(place, agent.base)
        metres += back
        finish += back / agent.speed
    return metres, finish
