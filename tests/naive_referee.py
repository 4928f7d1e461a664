"""Slow twin of coalition forming (CBGA), first half: which entries of which records are accepted.

Written from the description of the algorithm alone and borrowing nothing from the code that it judges:
the mission's dataclasses and `Score.value` are all that is shared. Nothing is kept from one step to the
next that could be computed again. Units are SI throughout. The second half is `naive_coalition`.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Collection, Mapping, Sequence
from typing import NamedTuple

from swarmbid.model import Agent, Mission, Position, Task
from swarmbid.scores import Score

Barred = frozenset[tuple[str, str]]  # (agent id, task id)


class Entry(NamedTuple):
    """One task that an agent has taken; its record is a list of these in order of taking.

    Parameters
    ----------
    task : id.
    bid : what it ranks by. gain : what its owner claims to gain; above the bid if that was warped.
    position : of the task in the owner's path when it was inserted.
    founder : agent id of the founder of the group joined, under team rewards; else None.
    """

    task: str
    bid: float
    gain: float
    position: int
    founder: str | None = None


Records = Mapping[str, Sequence[Entry]]  # agent id -> its entries


class Outcome(NamedTuple):
    """What a set of records amounts to.

    Parameters
    ----------
    members : task id -> agent ids, in order of id. start : task id -> joint start of service, s.
    paths : agent id -> accepted task ids in order of doing, those of incomplete groups included.
    refused : entries that were refused or skipped, as (agent id, task id).
    complete : ids of tasks with a complete group.
    """

    members: dict[str, list[str]]
    start: dict[str, float]
    paths: dict[str, list[str]]
    refused: list[tuple[str, str]]
    complete: set[str]

    def complete_paths(self) -> dict[str, list[tuple[str, float]]]:
        """Agent id -> (task id, start in s) of its visits that will take place, as `make_plan` wants them."""
        return {
            agent: [(task, self.start[task]) for task in path if task in self.complete]
            for agent, path in self.paths.items()
        }


Key = tuple[int, float, tuple[int, ...], int, float, tuple[int, ...], int]


def falling(name: str) -> tuple[int, ...]:
    """What sorts in falling order of `name` as bytes: "b" < "ab" < "a"."""
    return (*(-byte for byte in name.encode()), 1)


def ready(score: Score, task: Task) -> float:
    """Start of service, s, that an early agent waits for; a revisit waits for its scheduled time."""
    if score.name == "revisit" and task.revisit_at is not None:
        return min(max(task.start, task.revisit_at), task.end)
    return task.start


class Scene:
    """A mission under one score and one insertion rule, with who is there and what is barred."""

    def __init__(
        self,
        mission: Mission,
        score: Score,
        insertion: str,
        barred: Barred = frozenset(),
        alive: frozenset[str] | None = None,
    ) -> None:
        if insertion not in ("shift", "append"):
            raise ValueError(insertion)
        self.mission, self.score, self.insertion, self.barred = mission, score, insertion, barred
        self.agents = {agent.id: agent for agent in mission.agents if alive is None or agent.id in alive}
        self.tasks = {task.id: task for task in mission.tasks}

    def stage(self, task_id: str) -> int:
        """Length of the longest chain of prerequisites below a task."""
        return max((1 + self.stage(need) for need in self.tasks[task_id].prerequisites), default=0)

    def key(self, agent_id: str, place: int, entry: Entry) -> Key:
        """Rank of the entry at `place` of a record; the smaller key ranks higher."""
        joins = entry.founder is not None
        return (
            self.stage(entry.task),
            -entry.bid,
            falling(entry.founder if entry.founder is not None else agent_id),
            int(joins),
            -entry.gain if joins else 0.0,
            falling(agent_id),
            place,
        )

    def allows(self, agent: Agent, task: Task) -> bool:
        """Whether the agent's type may do tasks of this type."""
        types = self.mission.compatible.get(agent.type)
        return types is None or task.type in types

    def carried_sets(self, task: Task) -> list[frozenset[str]]:
        """Different equipment sets of the agents that may do `task`."""
        sets = {tuple(sorted(a.equipment)) for a in self.agents.values() if self.allows(a, task)}
        return [frozenset(names) for names in sorted(sets)]

    def fewest_sets(self, task: Task, needed: frozenset[str]) -> float:
        """Least number of equipment sets, of agents that may do `task`, that cover `needed`."""
        sets = self.carried_sets(task)
        for count in range(len(sets) + 1):
            for chosen in itertools.combinations(sets, count):
                if needed <= frozenset(itertools.chain.from_iterable(chosen)):
                    return count
        return math.inf

    def can_complete(self, task: Task, group: Sequence[frozenset[str]]) -> bool:
        """Whether a group with these equipment sets is complete, or others could join and make it so.

        In it, and in what it grows to, everybody brings something needed that nobody else brings.
        """
        for one, mine in enumerate(group):
            others = frozenset[str]().union(*group[:one], *group[one + 1 :])
            if not (mine & task.equipment) - others:
                return False
        missing = task.equipment - frozenset(itertools.chain.from_iterable(group))
        return not missing or any(
            self.can_complete(task, [*group, more]) for more in self.carried_sets(task) if more & missing
        )

    def metres(self, agent: Agent, path: Sequence[str]) -> float:
        """Metres along `path`, the way back to base included."""
        stops = [agent.position, *(self.tasks[task_id].position for task_id in path)]
        if agent.base is not None and path:
            stops.append(agent.base)
        return sum(self.mission.distance(a, b) for a, b in itertools.pairwise(stops))

    def back(self, agent: Agent, path: Sequence[str], start: Mapping[str, float]) -> float:
        """When, s, the agent has done `path` and is at its base, if it has one."""
        if not path:
            return agent.available_at
        last = self.tasks[path[-1]]
        way = (
            self.mission.distance(last.position, agent.base) / agent.speed if agent.base is not None else 0.0
        )
        return start[last.id] + last.duration + way

    def fits(self, agent: Agent, path: Sequence[str], start: Mapping[str, float]) -> bool:
        """Whether windows, range and endurance allow `path` at these starts."""
        return (
            all(start[task_id] <= self.tasks[task_id].end for task_id in path)
            and self.metres(agent, path) <= agent.range
            and self.back(agent, path, start) <= agent.available_at + agent.endurance
        )

    def schedule(self, paths: Mapping[str, Sequence[str]]) -> dict[str, float] | None:
        """Joint start of every task on a path, s; None if tasks wait for each other in a circle.

        A task starts when it is ready, its prerequisites are done and the last of its members is there.
        """
        visits = {(task_id, m): place for m, path in paths.items() for place, task_id in enumerate(path)}
        waiting = sorted({task_id for task_id, _ in visits})
        start: dict[str, float] = {}
        while waiting:
            left = []
            for task_id in waiting:
                task = self.tasks[task_id]
                times = [ready(self.score, task)]
                known = True
                for need in task.prerequisites:
                    known = known and need in start
                    times += [start[need] + self.tasks[need].duration] if need in start else []
                for m, path in paths.items():
                    place = visits.get((task_id, m))
                    if place is None:
                        continue
                    agent = self.agents[m]
                    if place == 0:
                        position, free = agent.position, agent.available_at
                    elif path[place - 1] in start:
                        previous = self.tasks[path[place - 1]]
                        position, free = previous.position, start[previous.id] + previous.duration
                    else:
                        known = False
                        continue
                    times.append(free + self.mission.distance(position, task.position) / agent.speed)
                if known:
                    start[task_id] = max(times)
                else:
                    left.append(task_id)
            if len(left) == len(waiting):
                return None
            waiting = left
        return start


class State:
    """What has been accepted so far of a scan over entries in order of rank."""

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self.members: dict[str, list[str]] = {}  # in order of acceptance
        self.groups: dict[str, tuple[float, str]] = {}  # task id -> (founding bid, founder)
        self.paths: dict[str, list[str]] = {agent_id: [] for agent_id in scene.agents}
        self.start: dict[str, float] = {}

    def carried(self, task_id: str) -> frozenset[str]:
        """What the group has between it of what the task needs."""
        equipment = [self.scene.agents[m].equipment for m in self.members.get(task_id, [])]
        return self.scene.tasks[task_id].equipment & frozenset(itertools.chain.from_iterable(equipment))

    def is_complete(self, task_id: str) -> bool:
        task = self.scene.tasks[task_id]
        crew = self.members.get(task_id, [])
        if not crew or self.carried(task_id) != task.equipment:
            return False
        return task.agents_required in (0, len(crew))

    def seats_taken(self) -> int:
        """How many entries have been accepted."""
        return sum(len(crew) for crew in self.members.values())

    def is_full(self, task_id: str) -> bool:
        """Whether every seat is taken; where equipment decides, there are as many as pieces."""
        task = self.scene.tasks[task_id]
        return len(self.members.get(task_id, [])) == (task.agents_required or len(task.equipment))

    def may_join(self, agent_id: str, task_id: str) -> bool:
        """Rules 1 to 3: type, bars, bundle limit, seats, equipment, prerequisites."""
        scene, agent, task = self.scene, self.scene.agents[agent_id], self.scene.tasks[task_id]
        crew = self.members.get(task_id, [])
        path = self.paths[agent_id]
        if not scene.allows(agent, task) or (agent_id, task_id) in scene.barred or agent_id in crew:
            return False
        if agent.bundle_limit is not None and len(path) >= agent.bundle_limit:
            return False
        if task.agents_required == 0:
            if not scene.can_complete(task, [scene.agents[m].equipment for m in [*crew, agent_id]]):
                return False
        else:
            missing = task.equipment - self.carried(task_id) - agent.equipment
            if scene.fewest_sets(task, missing) > task.agents_required - len(crew) - 1:
                return False
        return all(self.is_complete(need) for need in task.prerequisites)

    def joined(
        self, agent_id: str, task_id: str, position: int
    ) -> tuple[dict[str, list[str]], dict[str, float]] | None:
        """Rule 4: all paths and starts with the task inserted; None if the joint schedule forbids it."""
        path = self.paths[agent_id]
        if not 0 <= position <= len(path) or (self.scene.insertion == "append" and position != len(path)):
            return None
        paths = {**self.paths, agent_id: [*path[:position], task_id, *path[position:]]}
        start = self.scene.schedule(paths)
        if start is None or not all(self.scene.fits(self.scene.agents[m], paths[m], start) for m in paths):
            return None
        return paths, start

    def admit(self, agent_id: str, entry: Entry) -> bool:
        """Take an entry if all rules allow it; who joins by a founder's rank needs that founder."""
        if entry.founder is not None and self.groups.get(entry.task, (0.0, None))[1] != entry.founder:
            return False
        if not self.may_join(agent_id, entry.task):
            return False
        changed = self.joined(agent_id, entry.task, entry.position)
        if changed is None:
            return False
        self.paths, self.start = changed
        self.members.setdefault(entry.task, []).append(agent_id)
        self.groups.setdefault(entry.task, (entry.bid, agent_id))
        return True

    def best_insertion(
        self, agent_id: str, task_id: str, refused: Collection[tuple[str, int]]
    ) -> tuple[float, int] | None:
        """(gain, position) of the best place by the agent's own path; of equals the earliest.

        Rules 1 to 3 hold. What the others' paths have to say shows when the entry is put to `admit`;
        `refused` are (task id, position) of those that were in vain.
        """
        if not self.may_join(agent_id, task_id):
            return None
        last = len(self.paths[agent_id])
        found = []
        for position in range(last if self.scene.insertion == "append" else 0, last + 1):
            gain = None if (task_id, position) in refused else self.gain(agent_id, task_id, position)
            if gain is not None:
                found.append((gain, position))
        return max(found, key=lambda item: (item[0], -item[1]), default=None)

    def gain(self, agent_id: str, task_id: str, position: int) -> float | None:
        """What the agent's own path is worth more with the task at `position`; None if it cannot be flown.

        By its own path alone: what stands on it keeps its joint start as a floor, the new task waits
        for the group as it stands and for its prerequisites. Only visits that change are summed, the
        new one first, then the later ones in order.
        """
        scene, agent = self.scene, self.scene.agents[agent_id]
        old = self.paths[agent_id]
        new = [*old[:position], task_id, *old[position:]]
        task = scene.tasks[task_id]
        floor = dict(self.start)
        ends = [self.start[need] + scene.tasks[need].duration for need in task.prerequisites]
        floor[task_id] = max(ready(scene.score, task), self.start.get(task_id, -math.inf), *ends, -math.inf)

        start: dict[str, float] = {}
        place, free = agent.position, agent.available_at
        for stop in new:
            arrival = free + scene.mission.distance(place, scene.tasks[stop].position) / agent.speed
            start[stop] = max(arrival, floor[stop])
            place, free = scene.tasks[stop].position, start[stop] + scene.tasks[stop].duration
        if not scene.fits(agent, new, start):
            return None
        gained = self.visit_value(agent, new, position, start)
        for later in range(position, len(old)):
            before = self.visit_value(agent, old, later, self.start)
            after = self.visit_value(agent, new, later + 1, start)
            if before != after:
                gained += after - before
        return gained

    def visit_value(self, agent: Agent, path: Sequence[str], place: int, start: Mapping[str, float]) -> float:
        task = self.scene.tasks[path[place]]
        came_from: Position = agent.position if place == 0 else self.scene.tasks[path[place - 1]].position
        leg = self.scene.mission.distance(came_from, task.position)
        return self.scene.score.value(self.scene.mission, agent, task, start[task.id], leg)

    def outcome(self, refused: list[tuple[str, str]]) -> Outcome:
        return Outcome(
            members={task: sorted(self.members[task], key=str.encode) for task in sorted(self.members)},
            start={task: self.start[task] for task in sorted(self.start)},
            paths=self.paths,
            refused=refused,
            complete={task for task in self.members if self.is_complete(task)},
        )


def ranked(scene: Scene, records: Records) -> list[tuple[Key, str, Entry]]:
    """(key, agent id, entry) of everybody who is there, best first."""
    found = [
        (scene.key(agent_id, place, entry), agent_id, entry)
        for agent_id, entries in records.items()
        if agent_id in scene.agents
        for place, entry in enumerate(entries)
        if entry.task in scene.tasks
    ]
    return sorted(found, key=lambda item: item[0])


def referee(
    mission: Mission,
    score: Score,
    records: Records,
    *,
    insertion: str = "shift",
    barred: Barred = frozenset(),
    alive: frozenset[str] | None = None,
) -> Outcome:
    """What all records together amount to: put each entry to the rules, the best first.

    A refused entry voids what its agent has added after it.
    """
    scene = Scene(mission, score, insertion, barred, alive)
    state = State(scene)
    voided: set[str] = set()
    refused = []
    for _, agent_id, entry in ranked(scene, records):
        if agent_id in voided or not state.admit(agent_id, entry):
            voided.add(agent_id)
            refused.append((agent_id, entry.task))
    return state.outcome(refused)
