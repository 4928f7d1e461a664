"""Robots with skills, tasks that take several of them, tasks that wait for others: 36 instances with optima.

Three robots leave one place, do all tasks, and meet at another as early as they can. A task needs one or
more skills. Whoever goes there stays until it ends; together they must have its skills, and each must
have one that it needs and nobody else there has. It starts when the last of them has arrived, and not
before the tasks that precede it have ended.

In our words: the base of every agent is the meeting place, skills are equipment, a task takes as many
agents as its equipment takes (``agents_required`` 0), speed is 1, and every task is worth 1. The number
to be made small is the makespan, which is no score: see `swarmbid.experiments.sadcher`.

Source: Bichler's MRTA benchmark and instances made like it; `swarmbid/datasets/data/sadcher/README.md`.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import resources
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Any

from swarmbid.datasets._jsonfile import JsonFile, read_text
from swarmbid.datasets._routes import Replay, follow
from swarmbid.errors import Fault, InputError, did_you_mean
from swarmbid.model import Agent, Mission, Task, prerequisite_cycle

MOST = 1000
"""Most robots, tasks or skills of an instance that is read."""


@dataclass(frozen=True)
class Work:
    """One task of an instance.

    Parameters
    ----------
    number : 1 for the first. place : x, y. duration : of service. skills : numbers from 0.
    before : numbers of the tasks that have to end first.
    """

    number: int
    place: tuple[float, float]
    duration: float
    skills: frozenset[int]
    before: tuple[int, ...]


@dataclass(frozen=True)
class Instance:
    """An instance as its file has it; lengths and times share a unit, for the speed is 1.

    Parameters
    ----------
    name : of the file. robots : the skills of each, by number from 0.
    start, end : where all leave, where all meet.
    work : the tasks, in order of number.
    optimum : the least makespan there is, proved; None if the file does not say.
    routes : of the published schedule, as task numbers for each robot; None without one.
    """

    name: str
    robots: tuple[frozenset[int], ...]
    start: tuple[float, float]
    end: tuple[float, float]
    work: tuple[Work, ...]
    optimum: float | None
    routes: tuple[tuple[int, ...], ...] | None

    @property
    def mission(self) -> Mission:
        """The same in our words: robot 1 is agent ``r1``, task 1 is ``t1``, skill 0 is ``s1``."""
        digits = len(str(len(self.work)))
        ids = {one.number: f"t{one.number:0{digits}d}" for one in self.work}
        return Mission(
            name=self.name,
            agents=tuple(
                Agent(
                    id=f"r{number:0{len(str(len(self.robots)))}d}",
                    type="robot",
                    position=(*self.start, 0.0),
                    base=(*self.end, 0.0),
                    equipment=_equipment(skills),
                )
                for number, skills in enumerate(self.robots, 1)
            ),
            tasks=tuple(
                Task(
                    id=ids[one.number],
                    position=(*one.place, 0.0),
                    duration=one.duration,
                    agents_required=0,
                    equipment=_equipment(one.skills),
                    prerequisites=tuple(ids[first] for first in one.before),
                )
                for one in self.work
            ),
        )

    def replay(self, routes: Sequence[Sequence[int]]) -> Replay:
        """Follow routes by the benchmark's rules alone, apart from everything else in this package.

        Parameters
        ----------
        routes : for each robot the numbers of the tasks that it goes to, in order.
        """
        places = {one.number: one.place for one in self.work}
        found = follow(
            routes,
            {one.number: one.duration for one in self.work},
            lambda robot, a, b: math.dist(
                self.start if a is None else places[a], self.end if b is None else places[b]
            ),
            {one.number: one.before for one in self.work},
        )
        problems = list(found.problems)
        if len(routes) != len(self.robots):
            problems.append(f"there are {len(routes)} routes for {len(self.robots)} robots")
            return Replay(math.inf, {}, found.crews, tuple(problems))
        for one in self.work:
            crew = found.crews.get(one.number, ())
            brought = [self.robots[robot] & one.skills for robot in crew]
            if crew and frozenset[int]().union(*brought) != one.skills:
                problems.append(f"task {one.number} lacks a skill")
            for row, robot in enumerate(crew):
                others = frozenset[int]().union(*brought[:row], *brought[row + 1 :])
                if brought[row] <= others:
                    problems.append(f"robot {robot + 1} brings nothing of its own to task {one.number}")
        return Replay(found.makespan, found.starts, found.crews, tuple(problems))


def instances() -> list[str]:
    """Return the names of the instances carried along, such as ``"1p_000000"``, in order."""
    return sorted(
        item.name.removesuffix(".json") for item in _data().iterdir() if item.name.endswith(".json")
    )


def instance(name: str) -> Instance:
    """Return one of `instances` as its file has it.

    Raises
    ------
    InputError : there is none of that name.
    """
    known = instances()
    if name not in known:
        mend = did_you_mean(name, known) or f"There are {known[0]} to {known[-1]}."
        raise InputError([Fault("sadcher", "instance", f"there is no {name!r}", mend)])
    return parse((_data() / f"{name}.json").read_text(encoding="ascii"), name=name, where=f"{name}.json")


def load(name: str) -> Mission:
    """Return one of `instances` as a mission.

    Raises
    ------
    InputError : there is none of that name.
    """
    return instance(name).mission


def read(path: Path | str) -> Instance:
    """Return the instance of a file of your own in the same format.

    Raises
    ------
    InputError : it cannot be read; the message names every faulty field.
    """
    path = Path(path)
    return parse(read_text(path), name=path.stem, where=str(path))


def parse(text: str, *, name: str, where: str) -> Instance:
    """Return the instance that a text describes.

    Parameters
    ----------
    name : of the instance. where : the file's name, for error messages.

    Raises
    ------
    InputError : with every faulty field.
    """
    file = JsonFile(text, where)
    for field in ("Q", "R", "T_e", "task_locations", "precedence_constraints"):
        file.has(field)
    file.done()
    data = file.data
    places = [
        file.place(f"task_locations[{row}]", value)
        for row, value in enumerate(file.items("task_locations", data["task_locations"], what="places"))
    ]
    if not 3 <= len(places) <= MOST + 2:
        mend = f"Give the start, 1 to {MOST} tasks, and the end."
        file.fault("task_locations", f"has {len(places)} entries", mend)
        file.done()
    tasks = len(places) - 2
    robots, needs = _table(file, "Q", None), _table(file, "R", len(places))
    widths = Counter(len(values) for _, values in robots + needs)
    skills = widths.most_common(1)[0][0] if widths else 0
    for field, rows in (("Q", robots), ("R", needs)):
        for row, (ones, values) in enumerate(rows):
            if len(values) != skills or not 1 <= skills <= MOST:
                mend = f"Give every row of Q and R the same number of skills, 1 to {MOST}."
                file.fault(f"{field}[{row}]", f"has {len(values)} entries", mend)
            elif field == "R" and (row in (0, tasks + 1)) == bool(ones):
                mend = "The start and the end need no skill, every task needs one."
                file.fault(f"R[{row}]", "needs a skill" if ones else "needs none", mend)
    times = file.items("T_e", data["T_e"], length=len(places), what=f"{len(places)} durations, one a place")
    durations = [file.number(f"T_e[{row}]", value, low=0.0) for row, value in enumerate(times)]
    before = _precedence(file, tasks)
    optimum = data.get("optimal_makespan")
    if optimum is not None:
        optimum = file.number("optimal_makespan", optimum, above=0.0)
    routes = _routes(file, len(robots), tasks) if robots and "schedule" in data else None
    file.done()
    return Instance(
        name=name,
        robots=tuple(ones for ones, _ in robots),
        start=places[0],
        end=places[-1],
        work=tuple(
            Work(number, places[number], durations[number], needs[number][0], tuple(before[number]))
            for number in range(1, tasks + 1)
        ),
        optimum=optimum,
        routes=routes,
    )


def _table(file: JsonFile, field: str, length: int | None) -> list[tuple[frozenset[int], list[Any]]]:
    """A table of 0 and 1: for each row the columns that have a 1, and the row itself."""
    what = "rows" if length is None else f"{length} rows, one a place"
    rows = file.items(field, file.data[field], length=length, what=what)
    if length is None and not 1 <= len(rows) <= MOST and isinstance(file.data[field], list):
        file.fault(field, f"has {len(rows)} entries", f"Give 1 to {MOST} robots.")
    found = []
    for row, values in enumerate(rows):
        values = file.items(f"{field}[{row}]", values, what="0 and 1")
        marks = [
            file.count(f"{field}[{row}][{column}]", value, low=0, high=1)
            for column, value in enumerate(values)
        ]
        found.append((frozenset(column for column, mark in enumerate(marks) if mark), values))
    return found


def _precedence(file: JsonFile, tasks: int) -> dict[int, list[int]]:
    """Task number -> the tasks that have to end first."""
    field = "precedence_constraints"
    before: dict[int, list[int]] = {number: [] for number in range(1, tasks + 1)}
    for row, pair in enumerate(file.items(field, file.data[field], what="pairs [first, second]")):
        numbers = file.items(f"{field}[{row}]", pair, length=2, what="two task numbers")
        known = len(file.faults)
        first, second = (
            file.count(f"{field}[{row}][{side}]", value, low=1, high=tasks)
            for side, value in enumerate(numbers or (1, 1))
        )
        if not numbers or len(file.faults) > known:
            continue
        if first in before[second]:
            file.fault(f"{field}[{row}]", f"says again that {first} precedes {second}", "Remove it.")
        else:
            before[second].append(first)
    wait = tuple(
        Task(id=f"{number}", position=(0.0, 0.0, 0.0), prerequisites=tuple(map(str, firsts)))
        for number, firsts in before.items()
    )
    circle = prerequisite_cycle(wait)
    if circle is not None:
        mend = "Remove one of them."
        file.fault(field, "lets tasks wait for each other in a circle: " + " -> ".join(circle), mend)
    return before


def _routes(file: JsonFile, robots: int, tasks: int) -> tuple[tuple[int, ...], ...] | None:
    """The routes of a schedule: {"0": [{"task": 6, ...}, ...], ...}."""
    schedule = file.data["schedule"]
    if not isinstance(schedule, Mapping) or set(schedule) != {str(robot) for robot in range(robots)}:
        file.fault(
            "schedule", "does not have each robot once", f'Give "0" to "{robots - 1}", or leave it out.'
        )
        return None
    routes = []
    for robot in range(robots):
        field = f"schedule.{robot}"
        stops = file.items(field, schedule[str(robot)], what="stops")
        values = [stop.get("task") if isinstance(stop, Mapping) else stop for stop in stops]
        routes.append(
            tuple(
                file.count(f"{field}[{row}].task", value, low=1, high=tasks)
                for row, value in enumerate(values)
            )
        )
    return tuple(routes)


def _equipment(skills: frozenset[int]) -> frozenset[str]:
    return frozenset(f"s{skill + 1}" for skill in skills)


def _data() -> Traversable:
    return resources.files("swarmbid.datasets") / "data" / "sadcher"
