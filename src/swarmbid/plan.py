"""The answer: who does what, when; what is left over, and why.

A plan states every number that somebody has to fly by or is judged by, so that `swarmbid.verify` can
recompute all of it from the mission alone. Times are s, distances m.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from swarmbid.errors import Fault, InputError
from swarmbid.model import Agent, Mission, Task
from swarmbid.timing import Path, flight
from swarmbid.unserved import REASONS, Unserved, explain_unserved

if TYPE_CHECKING:
    from swarmbid.scores import Score

PLAN_VERSION = 1
"""Version of the dictionary that `Plan.to_dict` writes; raised when its fields change."""


@dataclass(frozen=True)
class Visit:
    """One task on one agent's path.

    Parameters
    ----------
    task : its id.
    arrival : s, going there as soon as the visit before is done.
    start, end : s, of service; between arrival and start the agent waits.
    leg : m from the stop before.
    score : what this visit is worth.
    """

    task: str
    arrival: float
    start: float
    end: float
    leg: float
    score: float


@dataclass(frozen=True)
class AgentPlan:
    """What one agent does, in order.

    Parameters
    ----------
    agent : its id.
    visits : in order of doing; empty for an idle agent, which stays where it is.
    distance : m in all, the way back to base included.
    finish : s, back at base if it has one, else the end of the last visit.
    score : sum over its visits.
    """

    agent: str
    visits: tuple[Visit, ...]
    distance: float
    finish: float
    score: float


@dataclass(frozen=True)
class Plan:
    """Who does what, when.

    Parameters
    ----------
    mission : its name.
    algorithm, score_name : what made the plan and by which score.
    agents : in order of id.
    unserved : tasks that nobody does, in order of id.
    total_score : sum over the agents, by the score that was bid with.
    honest_score : the same visits by `Score.honest`; equal to `total_score` for all but declared
        substitutes such as fuel counted from the start.
    """

    mission: str
    algorithm: str
    score_name: str
    agents: tuple[AgentPlan, ...]
    unserved: tuple[Unserved, ...]
    total_score: float
    honest_score: float

    def to_dict(self) -> dict[str, Any]:
        """Return plain dictionaries, lists, strings and numbers, ready for JSON."""
        return {
            "kind": "plan",
            "version": PLAN_VERSION,
            "mission": self.mission,
            "algorithm": self.algorithm,
            "score_name": self.score_name,
            "total_score": self.total_score,
            "honest_score": self.honest_score,
            "agents": [
                {
                    "agent": one.agent,
                    "distance": one.distance,
                    "finish": one.finish,
                    "score": one.score,
                    "visits": [{name: getattr(visit, name) for name in _VISIT} for visit in one.visits],
                }
                for one in self.agents
            ],
            "unserved": [{name: getattr(left, name) for name in _UNSERVED} for left in self.unserved],
        }

    @classmethod
    def from_dict(cls, data: object, *, where: str = "plan") -> Plan:
        """Read what `to_dict` wrote.

        Parameters
        ----------
        data : the decoded JSON.
        where : the file's name, for error messages.

        Raises
        ------
        InputError
            With every fault found, each with the path of its field.
        """
        reader = _Reader(where)
        plan = _read_plan(reader, data)
        if reader.faults or plan is None:
            raise InputError(reader.faults)
        return plan

    def summary(self) -> str:
        """Return the plan in a few lines of plain text."""
        served = len({visit.task for one in self.agents for visit in one.visits})
        busy = sum(1 for one in self.agents if one.visits)
        score = f"score {self.total_score:.6g}"
        if self.honest_score != self.total_score:
            score += f" as bid, {self.honest_score:.6g} along the paths"
        lines = [
            f"{self.mission}: {served} of {served + len(self.unserved)} tasks served by {busy} of"
            f" {len(self.agents)} agents ({self.algorithm}, {self.score_name}), {score}"
        ]
        width = max((len(one.agent) for one in self.agents), default=0)
        for one in self.agents:
            stops = ", ".join(f"{visit.task} at {visit.start:.1f} s" for visit in one.visits)
            facts = f"{one.distance:.1f} m, done at {one.finish:.1f} s, score {one.score:.6g}"
            lines.append(f"  {one.agent:<{width}}  " + (f"{stops}; {facts}" if stops else "idle"))
        if self.unserved:
            lines.append("not served:")
            width = max(len(left.task) for left in self.unserved)
            lines += [f"  {left.task:<{width}}  {left.reason}: {left.detail}" for left in self.unserved]
        return "\n".join(lines)


def make_plan(
    mission: Mission,
    paths: Mapping[str, Sequence[tuple[str, float]]],
    score: Score,
    algorithm: str,
    insertion: str,
) -> Plan:
    """Write out the plan that agreed paths amount to.

    It computes, it does not judge: a path that cannot be flown becomes a plan that `verify` faults.

    Parameters
    ----------
    paths : agent id -> (task id, start of service in s) in order of doing.
    score : what the agents bid with.
    algorithm : name of what made the paths.
    insertion : ``"hold"``, ``"shift"`` or ``"append"``, the rule they were built by; used to explain
        what is left over.

    Raises
    ------
    InputError
        If a path names an agent or a task that the mission does not have.
    """
    tasks = {task.id: task for task in mission.tasks}
    _check_ids(mission, paths, tasks)
    honest = score.honest()
    steps: dict[str, Path] = {
        agent: [(tasks[task_id], start) for task_id, start in path] for agent, path in paths.items()
    }
    agents = []
    honest_score = 0.0
    for agent in sorted(mission.agents, key=lambda agent: agent.id.encode()):
        path = steps.get(agent.id, [])
        agents.append(_agent_plan(mission, agent, path, score))
        honest_score += _agent_plan(mission, agent, path, honest).score
    return Plan(
        mission=mission.name,
        algorithm=algorithm,
        score_name=score.name,
        agents=tuple(agents),
        unserved=explain_unserved(mission, steps, score, algorithm=algorithm, insertion=insertion),
        total_score=sum((one.score for one in agents), 0.0),
        honest_score=honest_score,
    )


def _agent_plan(mission: Mission, agent: Agent, path: Path, score: Score) -> AgentPlan:
    visits = []
    place, departure = agent.position, agent.available_at
    for task, start in path:
        leg = mission.distance(place, task.position)
        visits.append(
            Visit(
                task=task.id,
                arrival=departure + leg / agent.speed,
                start=start,
                end=start + task.duration,
                leg=leg,
                score=score.value(mission, agent, task, start, leg),
            )
        )
        place, departure = task.position, start + task.duration
    metres, finish = flight(mission, agent, path)
    return AgentPlan(agent.id, tuple(visits), metres, finish, sum((visit.score for visit in visits), 0.0))


def _check_ids(
    mission: Mission, paths: Mapping[str, Sequence[tuple[str, float]]], tasks: Mapping[str, Task]
) -> None:
    agents = {agent.id for agent in mission.agents}
    faults = [
        Fault("paths", agent_id, "is no agent of this mission", "Name an agent of the mission.")
        for agent_id in paths
        if agent_id not in agents
    ]
    faults += [
        Fault("paths", agent_id, f"visits {task_id!r}, which is no task", "Name a task of the mission.")
        for agent_id, path in paths.items()
        for task_id, _ in path
        if task_id not in tasks
    ]
    if faults:
        raise InputError(faults)


_VISIT = ("task", "arrival", "start", "end", "leg", "score")
_AGENT = ("agent", "distance", "finish", "score", "visits")
_UNSERVED = ("task", "reason", "detail")
_PLAN = ("mission", "algorithm", "score_name", "total_score", "honest_score", "agents", "unserved")
_REDO = "Let `swarmbid plan` write the file anew."


class _Reader:
    """Takes fields out of decoded JSON and collects every fault on the way."""

    def __init__(self, where: str) -> None:
        self.where = where
        self.faults: list[Fault] = []

    def fault(self, path: str, why: str, mend: str = _REDO) -> None:
        self.faults.append(Fault(self.where, path, why, mend))

    def fields(self, data: object, path: str, names: tuple[str, ...]) -> dict[str, Any]:
        """Return `data` as a dictionary of exactly `names`; what is missing is None."""
        if not isinstance(data, dict):
            self.fault(path, f"is {_kind(data)}, not an object")
            return dict.fromkeys(names)
        prefix = f"{path}." if path else ""
        for name in names:
            if data.get(name) is None:
                self.fault(prefix + name, "is missing")
        for name in data:
            if name not in names:
                self.fault(f"{prefix}{name}", "is no field of a plan", "Remove it.")
        return {name: data.get(name) for name in names}

    def text(self, data: dict[str, Any], name: str, path: str) -> str:
        value = data[name]
        if isinstance(value, str):
            return value
        if value is not None:
            self.fault(f"{path}{name}", f"is {_kind(value)}, not a text")
        return ""

    def number(self, data: dict[str, Any], name: str, path: str) -> float:
        value = data[name]
        if isinstance(value, (int, float)) and not isinstance(value, bool):
            # An integer may be too long for a float, so it is compared before it is converted.
            if isinstance(value, int) and abs(value) >= 2**1023:
                self.fault(f"{path}{name}", "is not a finite number")
            elif math.isfinite(value):
                return float(value)
            else:
                self.fault(f"{path}{name}", f"is {value}, not a finite number")
        elif value is not None:
            self.fault(f"{path}{name}", f"is {_kind(value)}, not a number")
        return 0.0

    def items(self, data: dict[str, Any], name: str, path: str) -> list[tuple[str, Any]]:
        value = data[name]
        if isinstance(value, list):
            return [(f"{path}{name}[{number}]", item) for number, item in enumerate(value)]
        if value is not None:
            self.fault(f"{path}{name}", f"is {_kind(value)}, not a list")
        return []


def _read_plan(reader: _Reader, data: object) -> Plan | None:
    if not isinstance(data, dict) or data.get("kind") != "plan":
        reader.fault("", "is not a plan", 'A plan is a JSON object with "kind": "plan".')
        return None
    if data.get("version") != PLAN_VERSION or isinstance(data["version"], bool):
        reader.fault(
            "version", f"is {data.get('version')!r}; this swarmbid reads version {PLAN_VERSION}", _REDO
        )
        return None
    top = reader.fields({k: v for k, v in data.items() if k not in ("kind", "version")}, "", _PLAN)
    unserved = []
    for path, item in reader.items(top, "unserved", ""):
        left = reader.fields(item, path, _UNSERVED)
        found = Unserved(*(reader.text(left, name, f"{path}.") for name in _UNSERVED))
        if found.reason and found.reason not in REASONS:
            reader.fault(f"{path}.reason", f"is {found.reason!r}", f"Use one of {', '.join(REASONS)}.")
        unserved.append(found)
    return Plan(
        mission=reader.text(top, "mission", ""),
        algorithm=reader.text(top, "algorithm", ""),
        score_name=reader.text(top, "score_name", ""),
        agents=tuple(_read_agent(reader, item, path) for path, item in reader.items(top, "agents", "")),
        unserved=tuple(unserved),
        total_score=reader.number(top, "total_score", ""),
        honest_score=reader.number(top, "honest_score", ""),
    )


def _read_agent(reader: _Reader, item: object, path: str) -> AgentPlan:
    fields = reader.fields(item, path, _AGENT)
    visits = []
    for place, entry in reader.items(fields, "visits", f"{path}."):
        visit = reader.fields(entry, place, _VISIT)
        task = reader.text(visit, "task", f"{place}.")
        visits.append(Visit(task, *(reader.number(visit, name, f"{place}.") for name in _VISIT[1:])))
    return AgentPlan(
        agent=reader.text(fields, "agent", f"{path}."),
        visits=tuple(visits),
        distance=reader.number(fields, "distance", f"{path}."),
        finish=reader.number(fields, "finish", f"{path}."),
        score=reader.number(fields, "score", f"{path}."),
    )


def _kind(value: object) -> str:
    if value is None:
        return "null"
    names = {dict: "an object", list: "a list", str: "a text", bool: "true or false"}
    return names.get(type(value), "a number")
