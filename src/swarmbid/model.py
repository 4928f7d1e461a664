"""What a mission is: agents, tasks, and the rules that they must obey.

Everything is frozen and checked when it is made, so that nothing downstream has to doubt it. Units
are SI: metres, seconds, metres per second. Positions are local east-north-up.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, field

from swarmbid.errors import Fault, InputError

ID_PATTERN = re.compile(r"[A-Za-z0-9._-]{1,64}")
Position = tuple[float, float, float]


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
        check = _Checker("agent", self.id)
        check.position("position", self.position)
        if self.base is not None:
            check.position("base", self.base)
        check.number("speed", self.speed, low=0.0, low_open=True)
        check.number("available_at", self.available_at, low=0.0)
        check.number("fuel_per_metre", self.fuel_per_metre, low=0.0)
        check.number("range", self.range, low=0.0, low_open=True, infinite=True)
        check.number("endurance", self.endurance, low=0.0, low_open=True, infinite=True)
        if self.bundle_limit is not None and self.bundle_limit < 1:
            check.fault("bundle_limit", f"is {self.bundle_limit}", "Give 1 or more, or leave it out.")
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
    agents_required : seats (L_j).
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
        check = _Checker("task", self.id)
        check.position("position", self.position)
        check.number("reward", self.reward, low=0.0, low_open=True)
        check.number("start", self.start, low=0.0)
        check.number("end", self.end, low=0.0, infinite=True)
        check.number("duration", self.duration, low=0.0)
        check.number("discount", self.discount, low=0.0)
        if self.revisit_at is not None:
            check.number("revisit_at", self.revisit_at, low=0.0)
        check.number("revisit_width", self.revisit_width, low=0.0, low_open=True)
        if self.end < self.start:
            check.fault(
                "end", f"is {self.end} s, before start {self.start} s", "Let the window end after it starts."
            )
        if self.agents_required < 1:
            check.fault("agents_required", f"is {self.agents_required}", "Give 1 or more.")
        check.done()


@dataclass(frozen=True, kw_only=True)
class Mission:
    """A team and its work.

    Parameters
    ----------
    agents, tasks : in any order; ids are unique over both lists together.
    compatible : for each agent type the task types it may do; a type that is absent may do all.
    distance_step : m; travelled distances are rounded down to a multiple of it (0 for exact), as
        some public benchmarks prescribe.
    name : for reports.
    """

    agents: tuple[Agent, ...]
    tasks: tuple[Task, ...]
    compatible: dict[str, frozenset[str]] = field(default_factory=dict)
    distance_step: float = 0.0
    name: str = "mission"

    def __post_init__(self) -> None:
        faults = _duplicates(self) + _unknown_prerequisites(self)
        cycle = prerequisite_cycle(self.tasks) if not faults else None
        if cycle:
            faults.append(
                Fault(
                    f"task {cycle[0]}",
                    "prerequisites",
                    "wait for each other in a circle: " + " -> ".join(cycle),
                    "Remove one of them.",
                )
            )
        if faults:
            raise InputError(faults)

    def can_do(self, agent: Agent, task: Task) -> bool:
        """Whether `agent` may take a seat of `task`, by type and, for a single seat, equipment."""
        allowed = self.compatible.get(agent.type)
        if allowed is not None and task.type not in allowed:
            return False
        return task.agents_required > 1 or task.equipment <= agent.equipment


def distance(a: Position, b: Position) -> float:
    """Straight-line metres between two positions, the same bits on every machine."""
    dx, dy, dz = a[0] - b[0], a[1] - b[1], a[2] - b[2]
    return math.sqrt(dx * dx + dy * dy + dz * dz)


def prerequisite_cycle(tasks: tuple[Task, ...]) -> list[str] | None:
    """Return one circle of prerequisites as ids, its first repeated at the end, or None."""
    needs = {task.id: task.prerequisites for task in tasks}
    finished: dict[str, bool] = {}
    for root in needs:
        # An explicit stack: a chain of 10^5 prerequisites must not meet Python's recursion limit.
        trail: list[str] = []
        stack: list[tuple[str, bool]] = [(root, False)]
        while stack:
            task_id, leaving = stack.pop()
            if leaving:
                finished[task_id] = True
                trail.pop()
            elif task_id not in finished:
                finished[task_id] = False
                trail.append(task_id)
                stack.append((task_id, True))
                stack.extend((need, False) for need in reversed(needs.get(task_id, ())))
            elif not finished[task_id]:
                return [*trail[trail.index(task_id) :], task_id]
    return None


def _duplicates(mission: Mission) -> list[Fault]:
    seen: set[str] = set()
    faults = []
    for kind, items in (("agent", mission.agents), ("task", mission.tasks)):
        for item in items:
            if item.id in seen:
                faults.append(
                    Fault(f"{kind} {item.id}", "id", "is used twice", "Give every agent and task its own id.")
                )
            seen.add(item.id)
    return faults


def _unknown_prerequisites(mission: Mission) -> list[Fault]:
    known = {task.id for task in mission.tasks}
    return [
        Fault(
            f"task {task.id}",
            "prerequisites",
            f"names {need!r}, which is no task",
            "Name a task of this mission.",
        )
        for task in mission.tasks
        for need in task.prerequisites
        if need not in known
    ]


class _Checker:
    """Collects every fault of one object, then raises them together."""

    def __init__(self, kind: str, name: str) -> None:
        self.where = f"{kind} {name}"
        self.faults: list[Fault] = []
        if not ID_PATTERN.fullmatch(name):
            self.fault("id", f"is {name!r}", "Use 1 to 64 letters, digits, dots, underscores or hyphens.")

    def fault(self, name: str, why: str, mend: str) -> None:
        self.faults.append(Fault(self.where, name, why, mend))

    def number(
        self, name: str, value: float, *, low: float, low_open: bool = False, infinite: bool = False
    ) -> None:
        if math.isnan(value) or (math.isinf(value) and not infinite):
            self.fault(name, f"is {value}", "Give a finite number.")
        elif value < low or (low_open and value == low):
            bound = "more than" if low_open else "at least"
            self.fault(name, f"is {value}", f"Give {bound} {low:g}.")

    def position(self, name: str, value: Position) -> None:
        if len(value) != 3 or not all(math.isfinite(x) for x in value):
            self.fault(name, f"is {value}", "Give three finite numbers: east, north, up in m.")

    def done(self) -> None:
        if self.faults:
            raise InputError(self.faults)
