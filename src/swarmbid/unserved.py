"""Why a task is left over, worked out from the mission and the final paths by plain code.

Nothing here asks the auction: each reason is recomputed from distances, windows, range and the score,
so it holds whatever the agents believed. The first reason that applies, in the order of `REASONS`, is
given, with a sentence for people.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from swarmbid.model import Agent, Mission, Position, Task

if TYPE_CHECKING:
    from swarmbid.scores import Score

Path = list[tuple[Task, float]]
"""Visits in order: the task and its start of service, s."""

REASONS = {
    "no_capable_agent": "no agent has the type or the equipment for it",
    "needs_several_agents": "it needs more than one agent and no group was found for it",
    "window": "nobody can be there in time, even doing nothing else",
    "range": "nobody can fly there and back, even doing nothing else",
    "prerequisite": "a task that must come first is not served, or leaves no time for it",
    "no_gain": "it is worth nothing to anybody: the best offer is 0 or less",
    "no_room": "bundles are full, or it fits at no place of anybody's path",
    "other": "somebody could still take it with a gain, or the mission is too large to tell",
}
"""Reason -> what it means; the order is the order of judging."""

MOST_STEPS = 300_000
"""Most flights and path steps tried per plan, about a second of plain Python; then the rest is `other`."""

SLACK = 1e-9
"""Relative rounding allowed when a sum of legs or times just meets a limit."""

# CBAA gives an agent one task whatever its bundle limit (Choi 2009, single assignment).
_SINGLE_ASSIGNMENT = frozenset({"cbaa"})


@dataclass(frozen=True)
class Unserved:
    """A task that nobody does.

    Parameters
    ----------
    task : its id.
    reason : a key of `REASONS`.
    detail : one sentence for people.
    """

    task: str
    reason: str
    detail: str


def explain_unserved(
    mission: Mission, paths: Mapping[str, Path], score: Score, *, algorithm: str, insertion: str
) -> tuple[Unserved, ...]:
    """Return every task on no path, in order of id, with the reason.

    Parameters
    ----------
    paths : agent id -> its path; agents without one are idle.
    score : what a visit is worth.
    algorithm : its name, for the sentences; ``cbaa`` also limits an agent to one task.
    insertion : ``"hold"``, ``"shift"`` or ``"append"``: which places of a path are tried.
    """
    judge = _Judge(mission, paths, score, algorithm, insertion)
    return tuple(
        Unserved(task.id, *judge.reason(task))
        for task in sorted(mission.tasks, key=lambda task: task.id.encode())
        if task.id not in judge.ends
    )


@dataclass(frozen=True)
class Offer:
    """What an agent could still gain by adding a task to its final path.

    Parameters
    ----------
    agent : id.
    gain : score units at the best place; None if it can add the task nowhere.
    position : of that place in the path, from 0; None likewise.
    obstacle : a key of `REASONS` if it can add the task nowhere, else empty. detail : the same in words.
    """

    agent: str
    gain: float | None
    position: int | None
    obstacle: str
    detail: str


def offers(
    mission: Mission, paths: Mapping[str, Path], score: Score, task: Task, *, algorithm: str, insertion: str
) -> list[Offer]:
    """Return what each agent that does not do `task` could gain by it, in order of agent id.

    Parameters
    ----------
    paths, score, algorithm, insertion : as for `explain_unserved`.
    """
    judge = _Judge(mission, paths, score, algorithm, insertion)
    judge.steps = MOST_STEPS * 10  # one task only, so every agent can be asked
    holders = {agent for agent, path in judge.paths.items() if any(step.id == task.id for step, _ in path)}
    found = []
    for agent in judge.agents:
        if agent.id not in holders:
            try:
                found.append(judge.offer(agent, task))
            except _OutOfSteps:
                found.append(Offer(agent.id, None, None, "other", "not examined: there are too many places"))
    return found


class _OutOfSteps(Exception):
    """There are more places to try than `MOST_STEPS`."""


class _Judge:
    def __init__(
        self, mission: Mission, paths: Mapping[str, Path], score: Score, algorithm: str, insertion: str
    ) -> None:
        self.mission, self.score, self.algorithm, self.insertion = mission, score, algorithm, insertion
        self.agents = sorted(mission.agents, key=lambda agent: agent.id.encode())
        self.paths = {agent.id: list(paths.get(agent.id, ())) for agent in self.agents}
        self.ends: dict[str, float] = {}
        for path in self.paths.values():
            for task, start in path:
                self.ends[task.id] = max(self.ends.get(task.id, -math.inf), start + task.duration)
        self.worths = {agent.id: self.path_worth(agent, self.paths[agent.id]) for agent in self.agents}
        self.full = {agent.id for agent in self.agents if self.is_full(agent)}
        self.steps = MOST_STEPS
        self._capable: dict[tuple[str, frozenset[str], bool], list[Agent]] = {}

    def is_full(self, agent: Agent) -> bool:
        limit = 1 if self.algorithm in _SINGLE_ASSIGNMENT else agent.bundle_limit
        return limit is not None and len(self.paths[agent.id]) >= limit

    def capable(self, task: Task) -> list[Agent]:
        key = (task.type, task.equipment, task.agents_required > 1)
        if key not in self._capable:
            self._capable[key] = [agent for agent in self.agents if self.mission.can_do(agent, task)]
        return self._capable[key]

    def reason(self, task: Task) -> tuple[str, str]:
        capable = self.capable(task)
        fault = self.capability_fault(task, capable)
        if fault:
            return "no_capable_agent", fault
        if task.agents_required > 1:
            return (
                "needs_several_agents",
                f"It needs {task.agents_required} agents at once; {self.algorithm} found no group for it.",
            )
        try:
            return self.examine(task, capable)
        except _OutOfSteps:
            return "other", "Not examined: the mission has too many tasks left over to try every place."

    def examine(self, task: Task, capable: Sequence[Agent]) -> tuple[str, str]:
        if not any(self.lateness(agent, task) <= 0.0 for agent in capable):
            best = min(capable, key=lambda agent: self.lateness(agent, task))
            arrival = task.end + self.lateness(best, task)
            return (
                "window",
                f"Service must start by {task.end:.6g} s; {best.id} would be there first,"
                f" at {arrival:.6g} s, even doing nothing else.",
            )
        if not any(self.reaches(agent, task) for agent in capable):
            return "range", self.range_detail(task, capable)
        if task.prerequisites:
            return "prerequisite", self.prerequisite_detail(task)
        return self.judge_offers(task, [agent for agent in capable if self.reaches(agent, task)])

    def offer(self, agent: Agent, task: Task) -> Offer:
        """What `agent` could gain by adding `task` now, or what is in the way."""

        def cannot(obstacle: str, detail: str) -> Offer:
            return Offer(agent.id, None, None, obstacle, detail)

        if task.type not in self.mission.compatible.get(agent.type, {task.type}):
            return cannot("no_capable_agent", f"its type, {agent.type}, does no {task.type} tasks")
        if not self.mission.can_do(agent, task):
            missing = ", ".join(sorted(task.equipment - agent.equipment))
            return cannot("no_capable_agent", f"it carries no {missing}")
        late = self.lateness(agent, task)
        if late > 0.0:
            return cannot("window", f"it would be {late:.6g} s late even doing nothing else")
        if not self.reaches(agent, task):
            return cannot("range", "it cannot fly there and back even doing nothing else")
        if agent.id in self.full:
            return cannot("no_room", f"its bundle is full with {len(self.paths[agent.id])} tasks")
        path = self.paths[agent.id]
        best, place = -math.inf, -1
        for trial in self.insertions(agent, path, task):
            gain = self.path_worth(agent, trial) - self.worths[agent.id]
            if gain > best:
                best, place = gain, next(k for k, (step, _) in enumerate(trial) if step.id == task.id)
        if place < 0:
            return cannot("no_room", "it fits at no place of its path (windows, range or endurance)")
        return Offer(agent.id, best, place, "", f"as stop {place + 1} it would gain {best:.6g}")

    def spend(self, steps: int) -> None:
        self.steps -= steps
        if self.steps < 0:
            raise _OutOfSteps

    def capability_fault(self, task: Task, capable: Sequence[Agent]) -> str | None:
        if not self.agents:
            return "The mission has no agents."
        allowed = [
            agent
            for agent in self.agents
            if task.type in self.mission.compatible.get(agent.type, {task.type})
        ]
        if not allowed:
            return f"No agent is of a type that may do {task.type!r} tasks."
        if len(allowed) < task.agents_required:
            return f"It needs {task.agents_required} agents; only {len(allowed)} may do {task.type!r} tasks."
        needs = ", ".join(sorted(task.equipment))
        if not capable:
            return f"It needs {needs}; no agent that may do it carries all of that."
        carried = frozenset[str]().union(*(agent.equipment for agent in capable))
        if not task.equipment <= carried:
            missing = ", ".join(sorted(task.equipment - carried))
            return f"It needs {needs}; the agents that may do it have no {missing} between them."
        return None

    def lateness(self, agent: Agent, task: Task) -> float:
        """Seconds by which `agent`, going straight there, misses the window; 0 or less if it does not."""
        self.spend(1)
        travel = self.mission.distance(agent.position, task.position) / agent.speed
        late = agent.available_at + travel - task.end
        return 0.0 if 0.0 < late <= SLACK * max(1.0, task.end) else late

    def reaches(self, agent: Agent, task: Task) -> bool:
        """Whether `agent` can do `task` and come back, doing nothing else."""
        if self.lateness(agent, task) > 0.0:
            return False
        start = self.earliest(agent, agent.position, agent.available_at, task)
        return self.flight_fits(agent, [(task, start)])

    def earliest(self, agent: Agent, place: Position, departure: float, task: Task) -> float:
        travel = self.mission.distance(place, task.position) / agent.speed
        return max(departure + travel, task.start)

    def flight_fits(self, agent: Agent, path: Path) -> bool:
        metres, finish = flight(self.mission, agent, path)
        latest = agent.available_at + agent.endurance
        return metres <= agent.range * (1.0 + SLACK) and finish <= latest * (1.0 + SLACK)

    def range_detail(self, task: Task, capable: Sequence[Agent]) -> str:
        in_time = [agent for agent in capable if self.lateness(agent, task) <= 0.0]

        def trip(agent: Agent) -> tuple[float, float]:
            start = self.earliest(agent, agent.position, agent.available_at, task)
            return flight(self.mission, agent, [(task, start)])

        best = min(in_time, key=lambda agent: trip(agent)[0] / agent.range)
        metres, finish = trip(best)
        back = " and back" if best.base is not None else ""
        if metres > best.range:
            return (
                f"There{back} is {metres:.6g} m for {best.id}, whose range is {best.range:.6g} m;"
                f" no other agent can either."
            )
        latest = best.available_at + best.endurance
        return (
            f"There{back} would keep {best.id} until {finish:.6g} s, its endurance ends at {latest:.6g} s;"
            f" no other agent can either."
        )

    def prerequisite_detail(self, task: Task) -> str:
        missing = [need for need in task.prerequisites if need not in self.ends]
        if missing:
            return f"It comes after {', '.join(missing)}, which nobody does."
        last = max(task.prerequisites, key=lambda need: self.ends[need])
        return (
            f"It comes after {last}, done at {self.ends[last]:.6g} s; {self.algorithm} found no place for it."
        )

    def judge_offers(self, task: Task, reaching: Sequence[Agent]) -> tuple[str, str]:
        """Tell no_gain, no_room and other apart by trying every place of every path with room."""
        free = [agent for agent in reaching if agent.id not in self.full]
        best, bidder = -math.inf, ""
        for agent in free:
            path = self.paths[agent.id]
            for trial in self.insertions(agent, path, task):
                gain = self.path_worth(agent, trial) - self.worths[agent.id]
                if gain > best:
                    best, bidder = gain, agent.id
        if best > 0.0:
            return (
                "other",
                f"{bidder} could still take it for a gain of {best:.6g}; the run ended without settling it.",
            )
        if bidder:
            return "no_gain", f"The best offer left, by {bidder}, is {best:.6g}; only gains above 0 are bid."
        alone = [(self.worth_alone(agent, task), agent.id) for agent in reaching]
        if max(alone)[0] <= 0.0:
            worth, name = max(alone)
            return "no_gain", f"Even with nothing else to do it is worth {worth:.6g}, to {name}."
        counts = (len(reaching) - len(free), "with a full bundle"), (len(free), "with no place on the path")
        parts = [f"{count} {what}" for count, what in counts if count]
        return "no_room", f"Agents able to do it: {', '.join(parts)}."

    def insertions(self, agent: Agent, path: Path, task: Task) -> Iterator[Path]:
        """Yield every feasible path with `task` added, by the rule of `insertion`."""
        insert = self.held if self.insertion == "hold" else self.shifted
        for position in range(len(path) if self.insertion == "append" else 0, len(path) + 1):
            self.spend(len(path) + 1)
            trial = insert(agent, path, task, position)
            if trial is not None and self.flight_fits(agent, trial):
                yield trial

    def held(self, agent: Agent, path: Path, task: Task, position: int) -> Path | None:
        """Insert between promised times that do not move."""
        place, departure = self.left(agent, path[:position])
        latest = task.end
        if position < len(path):
            after, promised = path[position]
            travel = self.mission.distance(task.position, after.position) / agent.speed
            latest = min(latest, promised - task.duration - travel)
        start = self.start(agent, place, departure, task, latest)
        if start > latest:
            return None
        return [*path[:position], (task, start), *path[position:]]

    def shifted(self, agent: Agent, path: Path, task: Task, position: int) -> Path | None:
        """Insert and let later visits slip, as long as every window holds."""
        trial = path[:position]
        for step in (task, *(later for later, _ in path[position:])):
            place, departure = self.left(agent, trial)
            start = self.start(agent, place, departure, step, step.end)
            if start > step.end:
                return None
            trial.append((step, start))
        return trial

    def left(self, agent: Agent, path: Path) -> tuple[Position, float]:
        """Where and when, s, `agent` is free after `path`."""
        if not path:
            return agent.position, agent.available_at
        task, start = path[-1]
        return task.position, start + task.duration

    def start(self, agent: Agent, place: Position, departure: float, task: Task, latest: float) -> float:
        """As early as possible, or at the scheduled time of a repeated visit if that is worth more."""
        earliest = self.earliest(agent, place, departure, task)
        if task.revisit_at is None:
            return earliest
        leg = self.mission.distance(place, task.position)
        waited = max(earliest, min(task.revisit_at, latest))
        gain = self.score.value(self.mission, agent, task, waited, leg)
        return waited if gain > self.score.value(self.mission, agent, task, earliest, leg) else earliest

    def path_worth(self, agent: Agent, path: Path) -> float:
        total, place = 0.0, agent.position
        for task, start in path:
            leg = self.mission.distance(place, task.position)
            total += self.score.value(self.mission, agent, task, start, leg)
            place = task.position
        return total

    def worth_alone(self, agent: Agent, task: Task) -> float:
        start = self.start(agent, agent.position, agent.available_at, task, task.end)
        return self.path_worth(agent, [(task, start)])


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
