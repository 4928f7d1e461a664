"""Whether a negotiation ended in a state that can be executed, and if not, what is wrong with it.

Any algorithm can be judged; the printed CBGA is why it is here. Judged is what the agents hold and plan,
not what a plan made of it would say: an agent that waits for a group that never fills is a fault, though
no plan would show it.
"""

from __future__ import annotations

import copy
from collections import defaultdict
from collections.abc import Mapping, Sequence
from typing import Any, TypedDict

from swarmbid.messages import Message
from swarmbid.model import Agent, Mission, Task
from swarmbid.negotiator import Negotiator

LOOK_AHEAD = 5
"""Rounds of a full exchange in which nothing may change any more."""
TOLERANCE = 1e-6
"""s that a start may be late by: rounding."""


class State(TypedDict):
    """What was found; the lists hold task ids in order.

    Parameters
    ----------
    quiescent : whether no bid changes in some more rounds. agreed : whether all believe the same.
    overfilled : more agents plan or hold it than there are seats.
    underfilled : some agents hold it, but not as many as there are seats.
    equipment : all seats are taken, but something is missing.
    prerequisites : held, although something that must be done first has no complete group.
    circular : planned, but it waits for itself, or for something that does.
    late : planned, but its latest member comes after its window.
    clean : whether it is quiescent and agreed, and all lists are empty.
    """

    quiescent: bool
    agreed: bool
    overfilled: list[str]
    underfilled: list[str]
    equipment: list[str]
    prerequisites: list[str]
    circular: list[str]
    late: list[str]
    clean: bool


def judge_state(
    negotiators: Sequence[Negotiator],
    mission: Mission,
    neighbours: Mapping[str, Sequence[str]] | None = None,
) -> State:
    """Judge the state that `negotiators` are in, without changing it.

    Parameters
    ----------
    neighbours : agent id -> ids of those that hear it; everybody hears everybody by default.
    """
    tasks = {task.id: task for task in mission.tasks}
    agents = {agent.id: agent for agent in mission.agents}
    beliefs = [one.beliefs() for one in negotiators]
    paths = {one.agent_id: [task_id for task_id, _ in one.path] for one in negotiators}
    planners: dict[str, list[str]] = defaultdict(list)
    for agent_id, path in paths.items():
        for task_id in path:
            planners[task_id].append(agent_id)
    held = _held_by_themselves(negotiators)
    overfilled = [
        name for name, task in tasks.items()
        if max(len(held[name]), len(planners[name])) > _most_seats(task, len(agents))
    ]  # fmt: skip
    underfilled = [
        name
        for name, task in tasks.items()
        if 0 < len(held[name]) < task.agents_required or _short(task, held[name], agents)
    ]
    missing = {name: _missing(task, held[name], agents) for name, task in tasks.items() if held[name]}
    equipment = [name for name, names in missing.items() if names and name not in underfilled]
    complete = {name for name in missing if name not in {*overfilled, *underfilled, *equipment}}
    prerequisites = [
        name for name in missing if any(need not in complete for need in tasks[name].prerequisites)
    ]
    starts = joint_starts(mission, paths)
    circular = sorted(name for name in planners if planners[name] and name not in starts)
    late = sorted(name for name, start in starts.items() if start > tasks[name].end + TOLERANCE)
    quiescent = _rests(negotiators, neighbours)
    agreed = all(one == beliefs[0] for one in beliefs)
    faults = (overfilled, underfilled, equipment, prerequisites, circular, late)
    return State(
        quiescent=quiescent,
        agreed=agreed,
        overfilled=sorted(overfilled),
        underfilled=sorted(underfilled),
        equipment=sorted(equipment),
        prerequisites=sorted(prerequisites),
        circular=circular,
        late=late,
        clean=quiescent and agreed and not any(faults),
    )


def joint_starts(mission: Mission, paths: Mapping[str, Sequence[str]]) -> dict[str, float]:
    """When each planned task starts if all fly their paths and wait for each other, s.

    Service starts when the last of those that plan the task has arrived, its window is open and its
    prerequisites are done. A task that waits for itself never starts, nor does anything behind it: these
    are left out.
    """
    tasks = {task.id: task for task in mission.tasks}
    agents = {agent.id: agent for agent in mission.agents}
    progress = dict.fromkeys(paths, 0)
    free = {name: (agents[name].available_at, agents[name].position) for name in paths}
    crews: dict[str, set[str]] = defaultdict(set)
    for name, path in paths.items():
        for task_id in path:
            crews[task_id].add(name)
    starts: dict[str, float] = {}
    moving = True
    while moving:
        moving = False
        for task_id in sorted(crews):
            crew, task = crews[task_id], tasks[task_id]
            here = all(
                progress[name] < len(paths[name]) and paths[name][progress[name]] == task_id for name in crew
            )
            needs = [need for need in task.prerequisites if crews.get(need)]
            if task_id in starts or not here or any(need not in starts for need in needs):
                continue
            arrivals = [
                free[name][0] + mission.distance(free[name][1], task.position) / agents[name].speed
                for name in crew
            ]
            done = [starts[need] + tasks[need].duration for need in needs]
            starts[task_id] = max(task.start, *arrivals, *done)
            for name in crew:
                progress[name] += 1
                free[name] = (starts[task_id] + task.duration, task.position)
            moving = True
    return starts


def _held_by_themselves(negotiators: Sequence[Negotiator]) -> dict[str, list[str]]:
    """Task id -> agents that believe that they hold it: each is asked about itself."""
    held: dict[str, list[str]] = defaultdict(list)
    for one in negotiators:
        for task_id, holders in one.beliefs().items():
            if one.agent_id in dict(holders):
                held[task_id].append(one.agent_id)
    return held


def _most_seats(task: Task, num_agents: int) -> int:
    return task.agents_required or num_agents


def _missing(task: Task, crew: Sequence[str], agents: Mapping[str, Agent]) -> frozenset[str]:
    return task.equipment.difference(*(agents[name].equipment for name in crew))


def _short(task: Task, crew: Sequence[str], agents: Mapping[str, Agent]) -> bool:
    """Whether a group without a fixed number of seats lacks members."""
    return task.agents_required == 0 and bool(crew) and bool(_missing(task, crew, agents))


def _rests(negotiators: Sequence[Negotiator], neighbours: Mapping[str, Sequence[str]] | None) -> bool:
    """Whether copies of the negotiators, exchanging all they have to say, change no bid."""
    team: dict[str, Any] = {one.agent_id: one for one in copy.deepcopy(list(negotiators))}
    before = {name: one.digest for name, one in team.items()}
    # Late enough that those who are silent, because they agree, speak once more.
    now = max((one.next_tick() or 0.0 for one in team.values()), default=0.0)
    for _ in range(LOOK_AHEAD):
        said: list[tuple[str, Message]] = []
        for name, one in team.items():
            due = one.next_tick()
            if due is not None and due <= now:
                said += [(name, message) for message in one.tick(now)]
        for name, message in said:
            for other in neighbours[name] if neighbours is not None else team:
                if other != name:
                    team[other].receive(message, now)
        now += 1.0
        if any(one.digest != before[name] for name, one in team.items()):
            return False
    return True
