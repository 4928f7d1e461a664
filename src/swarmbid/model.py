"""What a mission is: agents, tasks, and the rules that they must obey.

Everything is frozen and checked when it is made, so that nothing downstream has to doubt it: numbers
are finite floats, counts are ints, names are text. Units are SI: metres, seconds, metres per second.
Positions are local east-north-up; `Mission.origin` says where on Earth, if anywhere, that is.
"""

from __future__ import annotations

import math
from collections.abc import Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TypeVar

from swarmbid.checks import Checker
from swarmbid.errors import Fault

ALTITUDE_REFERENCES = ("rel_home", "amsl", "terrain_agl", "wgs84_ellipsoid")
"""What an altitude is counted from: take-off point, mean sea level, ground below, WGS 84 ellipsoid."""

Position = tuple[float, float, float]
Node = TypeVar("Node", bound=Hashable)


@dataclass(frozen=True, kw_only=True)
class Agent:
    """A robot: where it is, how fast it moves, what it carries.

    Parameters
    ----------
    id : 1 to 64 letters, digits, dots, underscores or hyphens.
    type : any name; tasks may ask for it through `Task.type` and `Mission.can_do`.
    position : east, north, up in m at `available_at`.
    speed : m/s, greater than 0.
    available_at : s; the agent does not move before.
    fuel_per_metre : score units lost per m flown (slides, "fuel").
    range : m that it may fly in all, the way back to `base` included; infinite by default.
    endurance : s from `available_at` until it must be back at `base` (or done, without one).
    equipment : names of what it carries (e_i).
    bundle_limit : most tasks it takes at once (L_t); None for no limit.
    base : where it must be able to return to; None if it need not.
    """

    id: str
    position: Position
    type: str = "agent"
    speed: float = 1.0
    available_at: float = 0.0
    fuel_per_metre: float = 0.0
    range: float = math.inf
    endurance: float = math.inf
    equipment: frozenset[str] = frozenset()
    bundle_limit: int | None = None
    base: Position | None = None

    def __post_init__(self) -> None:
        check = Checker("agent", self, self.id)
        check.position("position")
        check.name("type")
        if self.base is not None:
            check.position("base")
        check.number("speed", above=0.0)
        check.number("available_at", low=0.0)
        check.number("fuel_per_metre", low=0.0)
        check.number("range", above=0.0, infinite=True)
        check.number("endurance", above=0.0, infinite=True)
        check.names("equipment", frozenset)
        if self.bundle_limit is not None:
            check.count("bundle_limit", "Give 1 or more, or leave it out.")
        check.done()


@dataclass(frozen=True, kw_only=True)
class Task:
    """A job: where, when, what it pays and what it needs.

    Parameters
    ----------
    id : as for `Agent`.
    type : any name.
    position : east, north, up in m.
    reward : score for doing it (r_j, value), greater than 0.
    start, end : s; the window bounds the START of service. Early arrivals wait.
    duration : s of service (t_j).
    discount : 1/s, how fast the reward fades after `start` (λ).
    agents_required : seats (L_j); 0 for as many as its equipment takes.
    equipment : names that the group must bring (e_j).
    prerequisites : ids of tasks that come first (P_j).
    revisit_at : s; when a repeated visit is wanted. None for an ordinary task.
    revisit_width : s; how far from `revisit_at` the reward falls to 1/e.
    """

    id: str
    position: Position
    type: str = "task"
    reward: float = 1.0
    start: float = 0.0
    end: float = math.inf
    duration: float = 0.0
    discount: float = 0.0
    agents_required: int = 1
    equipment: frozenset[str] = frozenset()
    prerequisites: tuple[str, ...] = ()
    revisit_at: float | None = None
    revisit_width: float = 60.0

    def __post_init__(self) -> None:
        check = Checker("task", self, self.id)
        check.position("position")
        check.name("type")
        check.number("reward", above=0.0)
        window = check.number("start", low=0.0)
        window = check.number("end", low=0.0, infinite=True) and window
        check.number("duration", low=0.0)
        check.number("discount", low=0.0)
        if self.revisit_at is not None:
            check.number("revisit_at", low=0.0)
        check.number("revisit_width", above=0.0)
        if window and self.end < self.start:
            check.fault(
                "end",
                f"is {self.end:g} s, before start {self.start:g} s",
                "Let the window end after it starts.",
            )
        seats = check.count(
            "agents_required", "Give 1 or more, or 0 for as many as its equipment takes.", low=0
        )
        check.names("equipment", frozenset)
        if seats and self.agents_required == 0 and self.equipment == frozenset():
            check.fault(
                "agents_required",
                "is 0, as many agents as its equipment takes, but it needs no equipment",
                "Name the equipment, or give 1 or more.",
            )
        check.names("prerequisites", tuple)
        check.done()

    @property
    def is_group(self) -> bool:
        """Whether a group does it, be it of one: its equipment may be divided among several agents."""
        return self.agents_required != 1


@dataclass(frozen=True, kw_only=True)
class Origin:
    """Where on Earth the local position (0, 0, 0) is, and what altitudes are counted from.

    Parameters
    ----------
    latitude, longitude : degrees, WGS 84, north and east positive.
    altitude : m above what `altitude_reference` names.
    altitude_reference : one of `ALTITUDE_REFERENCES`. There is no default, for a wrong guess crashes
        aircraft; one mission has one reference.
    """

    latitude: float
    longitude: float
    altitude: float
    altitude_reference: str

    def __post_init__(self) -> None:
        check = Checker("origin", self)
        placed = check.number("latitude", low=-90.0, high=90.0)
        placed = check.number("longitude", low=-180.0, high=180.0) and placed
        check.number("altitude")
        if placed and abs(self.latitude) < 1e-6 and abs(self.longitude) < 1e-6:
            check.fault(
                "latitude", "and longitude are both 0, the mark of a missing fix", "Give the real place."
            )
        if self.altitude_reference not in ALTITUDE_REFERENCES:
            check.fault(
                "altitude_reference",
                f"is {self.altitude_reference!r}",
                f"Use one of {', '.join(ALTITUDE_REFERENCES)}.",
            )
        check.done()


@dataclass(frozen=True, kw_only=True)
class Mission:
    """A team and its work. A team without work, and work without a team, are missions too.

    Parameters
    ----------
    agents, tasks : in any order; ids are unique over both lists together.
    compatible : for each agent type the task types it may do; a type that is absent may do all.
    distance_step : m; travelled distances are rounded down to a multiple of it (0 for exact), as
        some public benchmarks prescribe.
    name : for reports.
    origin : where on Earth (0, 0, 0) is; None for a mission on paper.
    """

    agents: tuple[Agent, ...]
    tasks: tuple[Task, ...]
    compatible: dict[str, frozenset[str]] = field(default_factory=dict)
    distance_step: float = 0.0
    name: str = "mission"
    origin: Origin | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "agents", tuple(self.agents))
        object.__setattr__(self, "tasks", tuple(self.tasks))
        check = Checker("mission", self)
        check.name("name")
        check.number("distance_step", low=0.0)
        check.table("compatible")
        for finding in mission_findings(self.agents, self.tasks):
            kind, index, name = finding.path[:3]
            item = self.agents[int(index)] if kind == "agents" else self.tasks[int(index)]
            where = f"{str(kind).removesuffix('s')} {item.id}"
            check.faults.append(Fault(where, str(name), finding.why, finding.mend))
        check.done()

    def can_do(self, agent: Agent, task: Task) -> bool:
        """Whether `agent` may take a seat of `task`, by type and, unless a group does it, equipment."""
        allowed = self.compatible.get(agent.type)
        if allowed is not None and task.type not in allowed:
            return False
        return task.is_group or task.equipment <= agent.equipment

    def distance(self, a: Position, b: Position) -> float:
        """Metres travelled from `a` to `b`, rounded down to a multiple of `distance_step`.

        The same arithmetic as the compiled kernels, bit for bit. The 1e-9 keeps a length that is a
        multiple already from falling one step short.
        """
        metres = distance(a, b)
        if self.distance_step > 0.0:
            metres = math.floor(metres / self.distance_step + 1e-9) * self.distance_step
        return metres


def distance(a: Position, b: Position) -> float:
    """Straight-line metres between two positions, the same bits on every machine."""
    dx, dy, dz = a[0] - b[0], a[1] - b[1], a[2] - b[2]
    return math.sqrt(dx * dx + dy * dy + dz * dz)


def fewest_sets(needed: frozenset[str], sets: Iterable[frozenset[str]]) -> int:
    """Return the least number of equipment sets, each as often as wanted, whose union holds `needed`.

    -1 if even all of them together do not.
    """
    useful = sorted({one & needed for one in sets} - {frozenset()}, key=lambda one: (-len(one), sorted(one)))
    # What brings no more than another is never needed.
    useful = [one for row, one in enumerate(useful) if not any(one < other for other in useful[:row])]
    if frozenset[str]().union(*useful) != needed:
        return -1
    bearers = {item: [one for one in useful if item in one] for item in needed}
    count, missing = 0, {needed}  # what may be missing after `count` sets
    while frozenset() not in missing:
        # Somebody must bring the item that the fewest bring, so nothing else need be tried first.
        rarest = {some: min(some, key=lambda item: (len(bearers[item]), item)) for some in missing}
        missing = {some - one for some in missing for one in bearers[rarest[some]]}
        count += 1
    return count


@dataclass(frozen=True)
class Finding:
    """A fault between the parts of a mission, by place: ``("tasks", 3, "prerequisites", 0)``."""

    path: tuple[str | int, ...]
    why: str
    mend: str


def mission_findings(agents: Iterable[Agent], tasks: Iterable[Task]) -> list[Finding]:
    """Everything wrong between agents and tasks that are each right: ids and prerequisites."""
    tasks = tuple(tasks)
    seen: set[str] = set()
    findings = []
    ids = {"agents": [agent.id for agent in agents], "tasks": [task.id for task in tasks]}
    for kind in ids:
        for index, item_id in enumerate(ids[kind]):
            if item_id in seen:
                findings.append(
                    Finding(
                        (kind, index, "id"), f"{item_id!r} is used twice", "Give each agent and task its own."
                    )
                )
            seen.add(item_id)
    known = {task.id for task in tasks}
    for index, task in enumerate(tasks):
        named: set[str] = set()
        for place, need in enumerate(task.prerequisites):
            path = ("tasks", index, "prerequisites", place)
            if need == task.id:
                findings.append(Finding(path, f"{need!r} is the task itself", "Remove it."))
            elif need not in known:
                findings.append(Finding(path, f"names {need!r}, which is no task", "Name a task."))
            elif need in named:
                findings.append(Finding(path, f"names {need!r} twice", "Remove one."))
            named.add(need)
    cycle = prerequisite_cycle(tasks)
    if cycle is not None and len(cycle) > 2:
        index = next(index for index, task in enumerate(tasks) if task.id == cycle[0])
        findings.append(
            Finding(
                ("tasks", index, "prerequisites"),
                "wait for each other in a circle: " + " -> ".join(cycle),
                "Remove one of them.",
            )
        )
    return findings


def prerequisite_cycle(tasks: tuple[Task, ...]) -> list[str] | None:
    """Return one circle of prerequisites as ids, its first repeated at the end, or None."""
    return find_circle({task.id: task.prerequisites for task in tasks})


def find_circle(needs: Mapping[Node, Sequence[Node]]) -> list[Node] | None:
    """Return one circle of things that each wait for the next, its first repeated at the end, or None.

    Parameters
    ----------
    needs : thing -> what it waits for.
    """
    finished: dict[Node, bool] = {}
    for root in needs:
        # An explicit stack: a chain of 10^5 prerequisites must not meet Python's recursion limit.
        trail: list[Node] = []
        stack: list[tuple[Node, bool]] = [(root, False)]
        while stack:
            node, leaving = stack.pop()
            if leaving:
                finished[node] = True
                trail.pop()
            elif node not in finished:
                finished[node] = False
                trail.append(node)
                stack.append((node, True))
                stack.extend((need, False) for need in reversed(needs.get(node, ())))
            elif not finished[node]:
                return [*trail[trail.index(node) :], node]
    return None
