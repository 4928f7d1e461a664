"""Why a task is left over, worked out from the mission and the final paths by plain code.

Nothing here asks the auction: each reason is recomputed from distances, windows, range and the score,
so it holds whatever the agents believed. The first reason that applies, in the order of `REASONS`, is
given, with a sentence for people.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from swarmbid.model import Agent, Mission, Task, fewest_sets
from swarmbid.places import OutOfSteps, Places
from swarmbid.timing import Path

if TYPE_CHECKING:
    from swarmbid.scores import Score

REASONS = {
    "no_capable_agent": "no agent has the type or the equipment for it",
    "too_few_agents": "fewer agents may do it than it needs",
    "missing_equipment": "no group of as many as it takes has the equipment for it",
    "window": "nobody, or too small a group, can be there in time, even doing nothing else",
    "range": "nobody, or too small a group, can fly there and back, even doing nothing else",
    "prerequisite": "a task that must come first is not served, or ends too late",
    "no_gain": "it is worth nothing to anybody, or to too few for a group: the best offer is 0 or less",
    "no_group": "enough agents could each join it with a gain, but no group came together",
    "no_room": "bundles are full, or it fits at no place of anybody's path, or of too few for a group",
    "other": "somebody could still take it with a gain, or the mission is too large to tell",
}
"""Reason -> what it means; the order is the order of judging."""

MOST_STEPS = 300_000
"""Most flights and path steps tried per plan, about a second of plain Python; then the rest is `other`."""

MOST_NAMES = 6
"""Most agents named in one sentence."""

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
    places = Places(mission, paths, score, insertion=insertion, steps=MOST_STEPS)
    judge = _Judge(places, algorithm)
    return tuple(
        Unserved(task.id, *judge.reason(task))
        for task in sorted(mission.tasks, key=lambda task: task.id.encode())
        if task.id not in places.ends
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
    # One task only, so every agent can be asked.
    places = Places(mission, paths, score, insertion=insertion, steps=MOST_STEPS * 10)
    judge = _Judge(places, algorithm)
    holders = {agent for agent, path in places.paths.items() if any(step.id == task.id for step, _ in path)}
    found = []
    for agent in places.agents:
        if agent.id not in holders:
            try:
                found.append(judge.offer(agent, task))
            except OutOfSteps:
                found.append(Offer(agent.id, None, None, "other", "not examined: there are too many places"))
    return found


class _Judge:
    def __init__(self, places: Places, algorithm: str) -> None:
        self.places, self.algorithm = places, algorithm
        self.mission, self.agents = places.mission, places.agents
        self.full = {agent.id for agent in self.agents if self.is_full(agent)}
        self._capable: dict[tuple[str, frozenset[str]], list[Agent]] = {}

    def is_full(self, agent: Agent) -> bool:
        limit = 1 if self.algorithm in _SINGLE_ASSIGNMENT else agent.bundle_limit
        return limit is not None and len(self.places.paths[agent.id]) >= limit

    def capable(self, task: Task) -> list[Agent]:
        key = (task.type, frozenset[str]() if task.is_group else task.equipment)
        if key not in self._capable:
            self._capable[key] = [agent for agent in self.agents if self.mission.can_do(agent, task)]
        return self._capable[key]

    def reason(self, task: Task) -> tuple[str, str]:
        capable = self.capable(task)
        fault = self.capability_fault(task, capable)
        if fault is not None:
            return fault
        try:
            return self.examine(task, capable)
        except OutOfSteps:
            return "other", "Not examined: the mission has too many tasks left over to try every place."

    def capability_fault(self, task: Task, capable: Sequence[Agent]) -> tuple[str, str] | None:
        if not self.agents:
            return "no_capable_agent", "The mission has no agents."
        if not any(
            task.type in self.mission.compatible.get(agent.type, {task.type}) for agent in self.agents
        ):
            return "no_capable_agent", f"No agent is of a type that may do {task.type!r} tasks."
        needs = ", ".join(sorted(task.equipment))
        if not task.is_group:
            if capable:
                return None
            return "no_capable_agent", f"It needs {needs}; no agent that may do it carries all of that."
        if len(capable) < task.agents_required:
            return (
                "too_few_agents",
                f"It needs {task.agents_required} agents; only {len(capable)} may do {task.type!r} tasks.",
            )
        missing = ", ".join(sorted(task.equipment.difference(*(agent.equipment for agent in capable))))
        if missing:
            return (
                "missing_equipment",
                f"It needs {needs}; the agents that may do it have no {missing} between them.",
            )
        fewest = fewest_sets(task.equipment, (agent.equipment for agent in capable))
        if 0 < task.agents_required < fewest:
            return (
                "missing_equipment",
                f"It needs {needs} of {task.agents_required} agents; to bring that takes {fewest}.",
            )
        return None

    def examine(self, task: Task, capable: Sequence[Agent]) -> tuple[str, str]:
        in_time = [agent for agent in capable if self.places.lateness(agent, task) <= 0.0]
        if not self.suffice(task, in_time):
            return "window", self.window_detail(task, capable, in_time)
        reaching = [agent for agent in in_time if self.places.reaches(agent, task)]
        if not self.suffice(task, reaching):
            return "range", self.range_detail(task, in_time, reaching)
        fault = self.prerequisite_fault(task)
        if fault:
            return "prerequisite", fault
        if task.is_group:
            return self.judge_joining(task, reaching)
        return self.judge_offers(task, reaching)

    def suffice(self, task: Task, agents: Sequence[Agent]) -> bool:
        """Whether some of `agents` would be a complete group; for a single seat, whether there are any."""
        if not task.is_group:
            return bool(agents)
        fewest = fewest_sets(task.equipment, (agent.equipment for agent in agents))
        return fewest >= 0 and (task.agents_required == 0 or fewest <= task.agents_required <= len(agents))

    def offer(self, agent: Agent, task: Task) -> Offer:
        """What `agent` could gain by adding `task` now, or what is in the way."""

        def cannot(obstacle: str, detail: str) -> Offer:
            return Offer(agent.id, None, None, obstacle, detail)

        if task.type not in self.mission.compatible.get(agent.type, {task.type}):
            return cannot("no_capable_agent", f"its type, {agent.type}, does no {task.type} tasks")
        if not self.mission.can_do(agent, task):
            missing = ", ".join(sorted(task.equipment - agent.equipment))
            return cannot("no_capable_agent", f"it carries no {missing}")
        if task.agents_required == 0 and not task.equipment & agent.equipment:
            return cannot("no_capable_agent", f"it carries nothing of {', '.join(sorted(task.equipment))}")
        late = self.places.lateness(agent, task)
        if late > 0.0:
            return cannot("window", f"it would be {late:.6g} s late even doing nothing else")
        if not self.places.reaches(agent, task):
            return cannot("range", "it cannot fly there and back even doing nothing else")
        if agent.id in self.full:
            held = len(self.places.paths[agent.id])
            return cannot("no_room", f"its bundle is full with {held} tasks")
        best = self.places.best(agent, task)
        if best is None:
            return cannot("no_room", "it fits at no place of its path (windows, range or endurance)")
        gain, place = best
        return Offer(agent.id, gain, place, "", f"as stop {place + 1} it would gain {gain:.6g}")

    def window_detail(self, task: Task, capable: Sequence[Agent], in_time: Sequence[Agent]) -> str:
        if task.is_group:
            return (
                f"{self.needs(task)} by {task.end:.6g} s; those in time, even doing nothing else:"
                f" {self.shortfall(task, in_time)}."
            )
        best = min(capable, key=lambda agent: self.places.lateness(agent, task))
        arrival = task.end + self.places.lateness(best, task)
        return (
            f"Service must start by {task.end:.6g} s; {best.id} would be there first,"
            f" at {arrival:.6g} s, even doing nothing else."
        )

    def range_detail(self, task: Task, in_time: Sequence[Agent], reaching: Sequence[Agent]) -> str:
        if task.is_group:
            return (
                f"{self.needs(task)}; those with the range and endurance, even doing nothing else:"
                f" {self.shortfall(task, reaching)}."
            )
        best = min(in_time, key=lambda agent: self.places.trip(agent, task)[0] / agent.range)
        metres, finish = self.places.trip(best, task)
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

    def prerequisite_fault(self, task: Task) -> str | None:
        ends = self.places.ends
        missing = [need for need in task.prerequisites if need not in ends]
        if missing:
            return f"It comes after {', '.join(missing)}, which nobody does."
        last = max(task.prerequisites, key=lambda need: ends[need], default=None)
        if last is not None and ends[last] > task.end:
            return (
                f"It comes after {last}, done at {ends[last]:.6g} s; service must start by {task.end:.6g} s."
            )
        return None

    def judge_offers(self, task: Task, reaching: Sequence[Agent]) -> tuple[str, str]:
        """Tell no_gain, no_room and other apart by trying every place of every path with room."""
        free = [agent for agent in reaching if agent.id not in self.full]
        best, bidder = -math.inf, ""
        for agent in free:
            place = self.places.best(agent, task)
            if place is not None and place[0] > best:
                best, bidder = place[0], agent.id
        if best > 0.0:
            # Where others' groups have delayed a path, there may be time on it for one more task.
            why = "bids never rise, gains may" if self.places.coupled else "the run ended without settling it"
            return "other", f"{bidder} could still take it for a gain of {best:.6g}; {why}."
        if bidder:
            return "no_gain", f"The best offer left, by {bidder}, is {best:.6g}; only gains above 0 are bid."
        alone = [(self.places.worth_alone(agent, task), agent.id) for agent in reaching]
        if max(alone)[0] <= 0.0:
            worth, name = max(alone)
            return "no_gain", f"Even with nothing else to do it is worth {worth:.6g}, to {name}."
        return "no_room", f"Agents able to do it: {_crowded(len(reaching) - len(free), len(free))}."

    def judge_joining(self, task: Task, reaching: Sequence[Agent]) -> tuple[str, str]:
        """Tell no_gain, no_group and no_room apart, each agent asked as if the others came of themselves."""
        paying = [agent for agent in reaching if self.places.worth_alone(agent, task) > 0.0]
        if not self.suffice(task, paying):
            return "no_gain", (
                f"{self.needs(task)}; those who would gain by it, even with nothing else to do:"
                f" {self.shortfall(task, paying)}."
            )
        full = [agent for agent in reaching if agent.id in self.full]
        gains: dict[str, float] = {}
        for agent in reaching:
            place = self.places.best(agent, task) if agent.id not in self.full else None
            if place is not None:
                gains[agent.id] = place[0]
        fitting = [agent for agent in reaching if agent.id in gains]
        gaining = [agent for agent in fitting if gains[agent.id] > 0.0]
        if self.suffice(task, gaining):
            joiners = _some([f"{agent.id} (gain {gains[agent.id]:.6g})" for agent in gaining])
            return "no_group", (
                f"{self.needs(task)}; {joiners} could each join,"
                f" but {self.algorithm} formed no group of them."
            )
        if self.suffice(task, fitting):
            return (
                "no_gain",
                f"{self.needs(task)}; those who would gain by it now: {self.shortfall(task, gaining)}.",
            )
        crowded = _crowded(len(full), len(reaching) - len(full) - len(fitting))
        return "no_room", (
            f"{self.needs(task)}; those with room for it: {self.shortfall(task, fitting)};"
            f" the others: {crowded}."
        )

    def needs(self, task: Task) -> str:
        """What a group must be, as the start of a sentence."""
        with_it = f" with {', '.join(sorted(task.equipment))}" if task.equipment else ""
        return f"It needs {f'{task.agents_required} ' if task.agents_required else ''}agents{with_it}"

    def shortfall(self, task: Task, agents: Sequence[Agent]) -> str:
        """`agents`, who cannot be a complete group, and what they lack."""
        if not agents:
            return "nobody"
        names = _some([agent.id for agent in agents])
        missing = task.equipment.difference(*(agent.equipment for agent in agents))
        if missing:
            return f"{names}, without {', '.join(sorted(missing))}"
        if len(agents) < task.agents_required:
            return f"only {names}"
        return f"{names}, of whom no {task.agents_required} bring it all"


def _some(names: Sequence[str]) -> str:
    """List names, not too many."""
    if len(names) > MOST_NAMES:
        return f"{', '.join(names[:MOST_NAMES])} and {len(names) - MOST_NAMES} more"
    return " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)


def _crowded(full: int, placeless: int) -> str:
    """Say why agents have no room."""
    parts = (full, "with a full bundle"), (placeless, "with no place on the path")
    return ", ".join(f"{count} {what}" for count, what in parts if count)
