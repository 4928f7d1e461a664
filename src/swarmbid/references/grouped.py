"""Fixed groups, each planned for as one agent: how tasks for several are put to an algorithm for one.

"Simplify the problem by allocating agents into groups and solving it as a regular task allocation
problem, with groups of agents as individual agents" is what the authors of CBGA compare it with (Hunt
et al. 2014). Here is the mission that results, in which every task has one seat, and the way back from
its plan to one for the members.

A group meets where that is soonest, at the place of one of its members, and travels at the speed of its
slowest; the way to the meeting costs it time, not fuel. As a plan for members this is never too bold (for
distances that are not rounded): who goes straight to the first task is there no later.

Examples
--------
>>> from swarmbid.references.sequential_greedy import sequential_greedy
>>> here, there = (0.0, 0.0, 0.0), (8.0, 0.0, 0.0)
>>> mission = Mission(
...     agents=(Agent(id="a", position=here), Agent(id="b", position=here, speed=2.0)),
...     tasks=(Task(id="t", position=there, agents_required=2),),
... )
>>> teams = grouped(mission, 2)
>>> teams.members
{'group1': ('a', 'b')}
>>> teams.expand(sequential_greedy(teams.mission, "time_window").paths)
{'a': [('t', 8.0)], 'b': [('t', 8.0)]}
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

from swarmbid.errors import Fault, InputError
from swarmbid.model import Agent, Mission, Position, Task, fewest_sets
from swarmbid.timing import joint_starts

_LEAST = 1e-9
"""m or s of range or endurance that stand for none: a model's are greater than 0."""


@dataclass(frozen=True)
class Grouped:
    """A mission for groups.

    Parameters
    ----------
    original : the mission for the members.
    mission : the same tasks, for groups; a task's reward is what all its seats pay together.
    members : group id -> its agents' ids. An agent that is left over is a group of its own, by its name.
    """

    original: Mission
    mission: Mission
    members: dict[str, tuple[str, ...]]

    def crew(self, group: str, task: str) -> tuple[str, ...]:
        """Ids of the members that take the seats of `task`; () if the group cannot do it."""
        agents = {agent.id: agent for agent in self.original.agents}
        wanted = next(one for one in self.original.tasks if one.id == task)
        crew = _crew(self.original, wanted, [agents[name] for name in self.members[group]])
        return tuple(agent.id for agent in crew)

    def expand(self, paths: Mapping[str, Sequence[tuple[str, float]]]) -> dict[str, list[tuple[str, float]]]:
        """Return the members' paths: each goes straight to its tasks, and the crew of a task starts as one.

        Parameters
        ----------
        paths : group id -> (task id, start in s) in order of doing, a plan of `mission`. A start is kept
            where it waits for a scheduled revisit; all others are as soon as can be.

        Raises
        ------
        InputError : a group has a task that it cannot do, or the groups wait for each other in a circle.
        """
        orders: dict[str, list[str]] = {agent.id: [] for agent in self.original.agents}
        revisited = {task.id for task in self.original.tasks if task.revisit_at is not None}
        ready: dict[str, float] = {}
        for group, path in paths.items():
            for task_id, start in path:
                crew = self.crew(group, task_id)
                if not crew:
                    mend = "Give paths of the mission of groups."
                    raise InputError([Fault(f"path of {group}", task_id, "cannot be done by it", mend)])
                for name in crew:
                    orders[name].append(task_id)
                if task_id in revisited:
                    ready[task_id] = start
        starts = joint_starts(self.original, orders, ready)
        if starts is None:
            raise InputError([Fault("paths", "", "wait for each other in a circle", "Order them otherwise.")])
        return {name: [(task_id, starts[task_id]) for task_id in order] for name, order in orders.items()}


def grouped(mission: Mission, size: int, *, groups: Sequence[Sequence[str]] | None = None) -> Grouped:
    """Return the mission in which groups of `size` agents are one agent each.

    By default the first agent in order of id that has no group takes, one after the other, who adds most
    equipment, then who is nearest. With a score whose metre costs the same whoever flies
    (``distance_cost``) a group's way counts once, with fuel (`Agent.fuel_per_metre`) once for each member.

    Parameters
    ----------
    size : agents of a group; those left over act alone.
    groups : ids of the members of each group, instead; agents in none act alone.

    Raises
    ------
    InputError : `size` is less than 1, or `groups` names an agent twice or one that there is not.
    """
    agents = {agent.id: agent for agent in sorted(mission.agents, key=lambda agent: agent.id.encode())}
    if size < 1:
        raise InputError([Fault("grouped", "size", f"is {size}", "Give 1 or more.")])
    chosen = [list(group) for group in groups] if groups is not None else _nearby(mission, agents, size)
    named = [name for group in chosen for name in group]
    faults = [
        Fault("grouped", "groups", f"names {name!r}, {why}", "Name each agent of the mission at most once.")
        for name in dict.fromkeys(named)
        if (why := "no agent" if name not in agents else "twice" if named.count(name) > 1 else "")
    ]
    if faults:
        raise InputError(faults)
    taken = {*agents, *(task.id for task in mission.tasks)}
    members: dict[str, tuple[str, ...]] = {}
    for group in chosen:
        if len(group) > 1:
            number = len(members) + 1
            name = next(
                name for k in range(len(taken) + 1) if (name := "_" * k + f"group{number}") not in taken
            )
            members[name] = tuple(group)
    alone = agents.keys() - {name for group in members.values() for name in group}
    members |= {name: (name,) for name in agents if name in alone}
    teams = {name: [agents[one] for one in group] for name, group in members.items()}
    return Grouped(
        original=mission,
        mission=Mission(
            agents=tuple(_as_one(mission, name, team) for name, team in teams.items()),
            tasks=tuple(_for_one(mission, task) for task in mission.tasks),
            # Who may do what is settled here once, by seats, types and equipment.
            compatible={
                name: frozenset(task.id for task in mission.tasks if _crew(mission, task, team))
                for name, team in teams.items()
            },
            distance_step=mission.distance_step,
            name=mission.name,
            origin=mission.origin,
        ),
        members=members,
    )


def _nearby(mission: Mission, agents: Mapping[str, Agent], size: int) -> list[list[str]]:
    free = list(agents.values())
    groups = []
    while len(free) >= size:
        group = [free.pop(0)]
        while len(group) < size:
            carried = frozenset[str]().union(*(one.equipment for one in group))

            def worse(
                one: Agent, first: Agent = group[0], carried: frozenset[str] = carried
            ) -> tuple[float, float]:
                return -len(one.equipment - carried), mission.distance(one.position, first.position)

            group.append(free.pop(free.index(min(free, key=worse))))
        groups.append([one.id for one in group])
    return groups


def _crew(mission: Mission, task: Task, team: Sequence[Agent]) -> tuple[Agent, ...]:
    """The first of the team, in its order, that would be a complete group; () if there is none."""
    able = [agent for agent in team if mission.can_do(agent, task)]
    count = task.agents_required or max(0, fewest_sets(task.equipment, (one.equipment for one in able)))
    for crew in combinations(able, count):
        if count and task.equipment <= frozenset[str]().union(*(one.equipment for one in crew)):
            return crew
    return ()


def _as_one(mission: Mission, name: str, team: Sequence[Agent]) -> Agent:
    """The group as an agent: where and when it has met, and what its weakest member can do."""
    if len(team) == 1:
        return dataclasses.replace(team[0], type=name, equipment=frozenset())

    def met(place: Position) -> float:
        return max(one.available_at + mission.distance(one.position, place) / one.speed for one in team)

    place = min((one.position for one in team), key=met)
    limits = [one.bundle_limit for one in team if one.bundle_limit is not None]
    bases = [one.base for one in team if one.base is not None]
    base = bases[0] if bases else None

    def beyond(one: Agent) -> float:
        """Metres from the group's base to a member's own."""
        return 0.0 if one.base is None or base is None else mission.distance(base, one.base)

    metres = min(one.range - mission.distance(one.position, place) - beyond(one) for one in team)
    latest = min(one.available_at + one.endurance - beyond(one) / one.speed for one in team)
    return Agent(
        id=name,
        type=name,
        position=place,
        speed=min(one.speed for one in team),
        available_at=met(place),
        fuel_per_metre=math.fsum(one.fuel_per_metre for one in team),
        range=max(_LEAST, metres),
        endurance=max(_LEAST, latest - met(place)),
        bundle_limit=min(limits, default=None),
        base=base,
    )


def _for_one(mission: Mission, task: Task) -> Task:
    """The task with one seat, which pays for all."""
    seats = task.agents_required or fewest_sets(task.equipment, (one.equipment for one in mission.agents))
    return dataclasses.replace(
        task, type=task.id, reward=task.reward * max(1, seats), agents_required=1, equipment=frozenset()
    )
