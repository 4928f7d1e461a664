"""Prove from the mission alone that a plan can be executed, or list everything that is wrong with it.

Nothing here is shared with the code that made the plan: distances, times, ranges and scores are
recomputed in plain Python, visit by visit, from the mission and the score's own definition. Call it on
every plan before anybody flies it; an empty list is the proof.
"""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

from swarmbid.model import Agent, Mission, Task, find_circle
from swarmbid.plan import AgentPlan, Plan, Visit

if TYPE_CHECKING:
    from swarmbid.scores import Score

_Step = tuple[str, str]
"""What starts at one time: the agent ("" for a group) and the task."""

TOLERANCE = 1e-9
"""Relative difference (absolute below 1) that is put down to rounding."""

RULES = {
    "mission": "the plan is for this mission",
    "score_name": "the plan was made by this score",
    "finite": "every number is finite",
    "unknown_agent": "every agent is one of the mission",
    "unknown_task": "every task is one of the mission",
    "agent_twice": "an agent has one path",
    "task_twice": "an agent visits a task once",
    "seats_overfilled": "a task has no more agents than seats",
    "seats_underfilled": "a task that is served has all its seats filled",
    "together": "agents on one task start it at the same time",
    "type": "an agent does only what its type may do",
    "equipment": "the agents on a task carry what it needs",
    "contribution": "where equipment decides how many, each agent brings something that no other brings",
    "available_at": "an agent leaves no sooner than it is available",
    "speed": "an agent arrives no sooner than its speed allows",
    "early_start": "service starts no sooner than the agent arrives",
    "window": "service starts within the task's window",
    "duration": "service lasts as long as the task takes",
    "leg": "each leg is the distance flown",
    "distance": "the distance is the sum of the legs and the way back",
    "finish": "the finish is when the agent is done, back at base if it has one",
    "range": "an agent flies no farther than its range, the way back included",
    "endurance": "an agent is done within its endurance, the way back included",
    "bundle_limit": "an agent has no more tasks than its bundle limit",
    "prerequisites": "what must come first is finished first",
    "circular_wait": "agents do not wait for each other in a circle",
    "visit_score": "a visit is worth what the score says",
    "agent_score": "an agent's score is the sum over its visits",
    "total_score": "the total score is the sum over the agents",
    "honest_score": "the honest score is the sum over all visits by the honest score",
    "unaccounted": "a task is either served or listed as unserved",
    "contradiction": "a task is not both served and listed as unserved",
    "unserved_twice": "a task is listed as unserved once",
}
"""Rule -> what must hold."""


@dataclass(frozen=True)
class Violation:
    """One thing about a plan that does not hold.

    Parameters
    ----------
    agent, task : ids, None where the fault belongs to no single one.
    rule : a key of `RULES`.
    detail : what was found and what would be right.
    """

    agent: str | None
    task: str | None
    rule: str
    detail: str

    def __str__(self) -> str:
        place = ", ".join(
            f"{kind} {name}" for kind, name in (("agent", self.agent), ("task", self.task)) if name
        )
        return f"{place or 'plan'}: {self.rule}: {self.detail}"


def verify(mission: Mission, plan: Plan, score: Score) -> list[Violation]:
    """Return every violation of `RULES`; none means that the plan can be executed as it stands.

    Parameters
    ----------
    mission : what the plan is for; the only source of what is true.
    score : what the plan was made with; each visit is worth ``score.value(...)``.
    """
    return list(_Verifier(mission, plan, score).violations())


class _Verifier:
    def __init__(self, mission: Mission, plan: Plan, score: Score) -> None:
        self.mission, self.plan, self.score = mission, plan, score
        self.honest = score.honest()
        self.agents = {agent.id: agent for agent in mission.agents}
        self.tasks = {task.id: task for task in mission.tasks}
        self.crews: dict[str, list[tuple[Agent, Visit]]] = defaultdict(list)
        for one in plan.agents:
            for visit in one.visits:
                if one.agent in self.agents and visit.task in self.tasks:
                    self.crews[visit.task].append((self.agents[one.agent], visit))

    def violations(self) -> Iterator[Violation]:
        plan = self.plan
        if plan.mission != self.mission.name:
            yield Violation(
                None, None, "mission", f"is for {plan.mission!r}, this mission is {self.mission.name!r}"
            )
        if plan.score_name != self.score.name:
            yield Violation(None, None, "score_name", f"is {plan.score_name!r}, not {self.score.name!r}")
        yield from self.roster()
        total = honest = 0.0
        for one in plan.agents:
            agent = self.agents.get(one.agent)
            if agent is not None:
                yield from self.path(agent, one)
                worths = self.worths(agent, one, self.score)
                yield from self.scores(one, worths)
                total += sum(worths)
                honest += sum(self.worths(agent, one, self.honest))
        yield from _compare(None, None, "total_score", plan.total_score, total)
        yield from _compare(None, None, "honest_score", plan.honest_score, honest)
        for task in self.mission.tasks:
            if task.id in self.crews:
                yield from self.crew(task, self.crews[task.id])
        yield from self.circles()
        yield from self.books()

    def roster(self) -> Iterator[Violation]:
        for name, count in Counter(one.agent for one in self.plan.agents).items():
            if name not in self.agents:
                yield Violation(name, None, "unknown_agent", "is no agent of the mission")
            elif count > 1:
                yield Violation(name, None, "agent_twice", f"has {count} paths")
        for one in self.plan.agents:
            for task, count in Counter(visit.task for visit in one.visits).items():
                if task not in self.tasks:
                    yield Violation(one.agent, task, "unknown_task", "is no task of the mission")
                elif count > 1:
                    yield Violation(one.agent, task, "task_twice", f"is visited {count} times")

    def path(self, agent: Agent, one: AgentPlan) -> Iterator[Violation]:
        """Fly the path: legs, times, windows, then the limits of the whole flight."""
        place, departure, metres = agent.position, agent.available_at, 0.0
        first = True
        for visit in one.visits:
            task = self.tasks.get(visit.task)
            yield from _finite(agent.id, visit.task, visit)
            if task is None:
                continue
            leg = self.mission.distance(place, task.position)
            yield from _compare(agent.id, task.id, "leg", visit.leg, leg, "m")
            yield from self.visit(agent, task, visit, departure, leg / agent.speed, first)
            place, departure, metres, first = task.position, visit.start + task.duration, metres + leg, False
        back = self.mission.distance(place, agent.base) if agent.base is not None and not first else 0.0
        metres += back
        finish = departure + back / agent.speed
        yield from _finite(agent.id, None, one)
        yield from _compare(agent.id, None, "distance", one.distance, metres, "m")
        yield from _compare(agent.id, None, "finish", one.finish, finish, "s")
        if _more(metres, agent.range):
            yield Violation(agent.id, None, "range", f"flies {metres!r} m, may fly {agent.range!r} m")
        latest = agent.available_at + agent.endurance
        if _more(finish, latest):
            yield Violation(agent.id, None, "endurance", f"is done at {finish!r} s, must be by {latest!r} s")
        if agent.bundle_limit is not None and len(one.visits) > agent.bundle_limit:
            detail = f"has {len(one.visits)} tasks, may have {agent.bundle_limit}"
            yield Violation(agent.id, None, "bundle_limit", detail)

    def visit(
        self, agent: Agent, task: Task, visit: Visit, departure: float, travel: float, first: bool
    ) -> Iterator[Violation]:
        earliest = departure + travel
        if _more(earliest, visit.arrival):
            # Fast enough if it had left at 0 s: then it is the departure that was too early.
            rule = "available_at" if first and not _more(travel, visit.arrival) else "speed"
            detail = f"arrives at {visit.arrival!r} s, {earliest!r} s is the soonest"
            yield Violation(agent.id, task.id, rule, detail)
        if _more(visit.arrival, visit.start):
            detail = f"starts at {visit.start!r} s, before arriving at {visit.arrival!r} s"
            yield Violation(agent.id, task.id, "early_start", detail)
        if _more(task.start, visit.start) or _more(visit.start, task.end):
            detail = f"starts at {visit.start!r} s, the window is {task.start!r} to {task.end!r} s"
            yield Violation(agent.id, task.id, "window", detail)
        yield from _compare(agent.id, task.id, "duration", visit.end, visit.start + task.duration, "s")
        allowed = self.mission.compatible.get(agent.type)
        if allowed is not None and task.type not in allowed:
            detail = f"type {agent.type!r} may not do {task.type!r}"
            yield Violation(agent.id, task.id, "type", detail)
        for need in task.prerequisites:
            ends = [other.start + self.tasks[need].duration for _, other in self.crews.get(need, ())]
            if not ends:
                yield Violation(agent.id, task.id, "prerequisites", f"comes after {need}, which nobody does")
            elif _more(max(ends), visit.start):
                detail = f"starts at {visit.start!r} s, before {need} is done at {max(ends)!r} s"
                yield Violation(agent.id, task.id, "prerequisites", detail)

    def crew(self, task: Task, crew: list[tuple[Agent, Visit]]) -> Iterator[Violation]:
        """Judge the agents on one task as a group."""
        names = sorted({agent.id for agent, _ in crew})
        who = f"has {len(names)} of {task.agents_required} agents: {', '.join(names)}"
        if task.agents_required == 0:
            yield from self.contributions(task, {agent.id: agent for agent, _ in crew})
        elif len(names) > task.agents_required:
            yield Violation(None, task.id, "seats_overfilled", who)
        elif len(names) < task.agents_required:
            yield Violation(None, task.id, "seats_underfilled", who)
        missing = task.equipment.difference(*(agent.equipment for agent, _ in crew))
        if missing:
            verb = "does not carry" if len(names) == 1 else "do not carry"
            detail = f"{', '.join(names)} {verb} {', '.join(sorted(missing))}"
            yield Violation(None, task.id, "equipment", detail)
        starts = [visit.start for _, visit in crew]
        if task.is_group and _more(max(starts), min(starts)):
            yield Violation(None, task.id, "together", f"starts at {sorted(starts)} s, must be at once")

    def contributions(self, task: Task, crew: dict[str, Agent]) -> Iterator[Violation]:
        """Find agents without whom the others would bring as much."""
        bearers = Counter(item for agent in crew.values() for item in agent.equipment)
        for name, agent in sorted(crew.items()):
            brought = sorted(task.equipment & agent.equipment)
            if all(bearers[item] > 1 for item in brought):
                detail = f"brings {', '.join(brought)}, as others do" if brought else "brings nothing needed"
                yield Violation(name, task.id, "contribution", detail)

    def circles(self) -> Iterator[Violation]:
        """Find agents that wait for each other: no start time helps, not even where nothing takes time."""
        # A group starts as one; agents in conflict over a single seat do not wait for each other.
        waits: dict[_Step, list[_Step]] = {}
        why: dict[tuple[_Step, _Step], str] = {}
        doings: dict[str, list[_Step]] = defaultdict(list)
        for one in self.plan.agents:
            before: _Step | None = None
            for task_id in dict.fromkeys(visit.task for visit in one.visits if visit.task in self.tasks):
                step = ("" if self.tasks[task_id].is_group else one.agent, task_id)
                if step not in waits:
                    waits[step] = []
                    doings[task_id].append(step)
                if before is not None:
                    waits[step].append(before)
                    why.setdefault((step, before), f"{one.agent} does that first")
                before = step
        for step, firsts in waits.items():
            for need in self.tasks[step[1]].prerequisites:
                firsts += doings[need]
                why |= {(step, first): "its prerequisite" for first in doings[need]}
        circle = find_circle(waits)
        if circle is not None:
            parts = [f"{a[1]} waits for {b[1]} ({why[a, b]})" for a, b in pairwise(circle)]
            yield Violation(None, circle[0][1], "circular_wait", ", ".join(parts))

    def worths(self, agent: Agent, one: AgentPlan, score: Score) -> list[float]:
        """What each visit is worth by the score's own definition; nothing for an unknown task."""
        worths = []
        place = agent.position
        for visit in one.visits:
            task = self.tasks.get(visit.task)
            if task is None:
                worths.append(0.0)
                continue
            leg = self.mission.distance(place, task.position)
            place = task.position
            try:
                worths.append(score.value(self.mission, agent, task, visit.start, leg))
            except (ArithmeticError, ValueError):
                # A start far outside anything sensible, or a user's own score that divides by zero.
                worths.append(math.nan)
        return worths

    def scores(self, one: AgentPlan, worths: list[float]) -> Iterator[Violation]:
        for visit, worth in zip(one.visits, worths, strict=True):
            if visit.task in self.tasks:
                yield from _compare(one.agent, visit.task, "visit_score", visit.score, worth)
            if math.isfinite(visit.start) and not math.isfinite(worth):
                yield Violation(one.agent, visit.task, "visit_score", f"the score gives {worth}")
        yield from _compare(one.agent, None, "agent_score", one.score, sum(worths))

    def books(self) -> Iterator[Violation]:
        """Every task is served or listed, never both."""
        yield from _finite(None, None, self.plan)
        listed = Counter(left.task for left in self.plan.unserved)
        for name, count in listed.items():
            if name not in self.tasks:
                yield Violation(None, name, "unknown_task", "listed as unserved, is no task of the mission")
            elif count > 1:
                yield Violation(None, name, "unserved_twice", f"is listed {count} times")
        for task in self.mission.tasks:
            if task.id in self.crews and task.id in listed:
                yield Violation(None, task.id, "contradiction", "is served and listed as unserved")
            if task.id not in self.crews and task.id not in listed:
                yield Violation(None, task.id, "unaccounted", "is neither served nor listed as unserved")


def _more(a: float, b: float) -> bool:
    """Whether `a` exceeds `b` by more than rounding; never if either is NaN (reported by `_finite`)."""
    return a - b > TOLERANCE * max(1.0, abs(a), abs(b))


def _compare(
    agent: str | None, task: str | None, rule: str, declared: float, right: float, unit: str = ""
) -> Iterator[Violation]:
    if _more(declared, right) or _more(right, declared):
        unit = f" {unit}" if unit else ""
        yield Violation(agent, task, rule, f"declared {declared!r}{unit}, is {right!r}{unit}")


def _finite(agent: str | None, task: str | None, item: Visit | AgentPlan | Plan) -> Iterator[Violation]:
    for name, value in vars(item).items():
        if isinstance(value, float) and not math.isfinite(value):
            yield Violation(agent, task, "finite", f"{name} is {value}")
