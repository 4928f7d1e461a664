"""Tasks that need 1 to 5 robots at once, by one depot: 25 instances with the figures of four methods.

Twenty robots leave a depot, do fifty tasks and come back as early as they can. A task starts when as
many robots as it needs have arrived, and all of them stay until it ends. There are no skills, windows or
prerequisites.

In our words: the base of every agent is the depot, and a task's seats are its robots. Lengths are those
of a square of side 1, the speed is 0.2 of it per unit of time. Every task is worth 1. The number to be
made small is the makespan, which is no score: see `swarmbid.experiments.dcmrta`.

Source: the test set of DCMRTA (ICRA 2024); `swarmbid/datasets/data/dcmrta/README.md`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import resources
from importlib.resources.abc import Traversable
from pathlib import Path

from swarmbid.datasets._jsonfile import JsonFile, read_text
from swarmbid.datasets._routes import Replay, follow
from swarmbid.errors import Fault, InputError, did_you_mean
from swarmbid.model import Agent, Mission, Task

MOST = 1000
"""Most robots or tasks of an instance that is read."""


@dataclass(frozen=True)
class Work:
    """One task of an instance: where, how many robots at once, for how long."""

    place: tuple[float, float]
    robots: int
    duration: float


@dataclass(frozen=True)
class Instance:
    """An instance as its file has it.

    Parameters
    ----------
    name : of the file. robots : how many. speed : of each.
    depot : where all start and end.
    work : the tasks; the first is number 1.
    published : method -> makespan that its authors report.
    routes : of the CTAS-D solution, as task numbers for each robot; None if the file has none.
    """

    name: str
    robots: int
    speed: float
    depot: tuple[float, float]
    work: tuple[Work, ...]
    published: Mapping[str, float]
    routes: tuple[tuple[int, ...], ...] | None

    @property
    def mission(self) -> Mission:
        """The same in our words: robot 1 is agent ``r01``, task 1 is ``t01``."""
        depot = (*self.depot, 0.0)
        return Mission(
            name=self.name,
            agents=tuple(
                Agent(
                    id=f"r{number:0{len(str(self.robots))}d}",
                    type="robot",
                    position=depot,
                    base=depot,
                    speed=self.speed,
                )
                for number in range(1, self.robots + 1)
            ),
            tasks=tuple(
                Task(
                    id=f"t{number:0{len(str(len(self.work)))}d}",
                    position=(*one.place, 0.0),
                    duration=one.duration,
                    agents_required=one.robots,
                )
                for number, one in enumerate(self.work, 1)
            ),
        )

    def replay(self, routes: Sequence[Sequence[int]]) -> Replay:
        """Follow routes by the benchmark's rules alone, apart from everything else in this package.

        Parameters
        ----------
        routes : for each robot the numbers of the tasks that it goes to, in order.
        """
        places: dict[int | None, tuple[float, float]] = {None: self.depot}
        places |= {number: one.place for number, one in enumerate(self.work, 1)}
        found = follow(
            routes,
            {number: one.duration for number, one in enumerate(self.work, 1)},
            lambda robot, a, b: math.dist(places[a], places[b]) / self.speed,
            {},
        )
        problems = list(found.problems)
        if len(routes) != self.robots:
            problems.append(f"there are {len(routes)} routes for {self.robots} robots")
        for number, one in enumerate(self.work, 1):
            crew = found.crews.get(number, ())
            if crew and len(crew) < one.robots:  # more do no harm; CTAS-D sends more now and then
                problems.append(f"task {number} has {len(crew)} robots and needs {one.robots}")
        return Replay(found.makespan, found.starts, found.crews, tuple(problems))


def instances() -> list[str]:
    """Return the names of the instances carried along, ``"env_0"`` to ``"env_48"``, in order of number."""
    names = [item.name.removesuffix(".json") for item in _data().iterdir() if item.name.endswith(".json")]
    return sorted(names, key=lambda name: int(name.removeprefix("env_")))


def instance(name: str) -> Instance:
    """Return one of `instances` as its file has it.

    Raises
    ------
    InputError : there is none of that name.
    """
    known = instances()
    if name not in known:
        mend = did_you_mean(name, known) or f"There are {known[0]} to {known[-1]}."
        raise InputError([Fault("dcmrta", "instance", f"there is no {name!r}", mend)])
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
    for field in ("agents", "speed", "depot", "tasks"):
        file.has(field)
    file.done()
    data = file.data
    robots = file.count("agents", data["agents"], low=1, high=MOST)
    speed = file.number("speed", data["speed"], above=0.0)
    depot = file.place("depot", data["depot"])
    listed = file.items("tasks", data["tasks"], what="tasks")
    if isinstance(data["tasks"], list) and not 1 <= len(listed) <= MOST:
        file.fault("tasks", f"has {len(listed)} entries", f"Give 1 to {MOST}.")
    file.done()  # what follows counts robots and tasks: one mistake, one message
    work = tuple(_work(file, f"tasks[{row}]", value, robots) for row, value in enumerate(listed))
    published = data.get("published", {})
    if not isinstance(published, dict):
        file.fault("published", "is no object", 'Give {"method": makespan, ...}, or leave it out.')
        published = {}
    figures = {
        method: file.number(f"published.{method}", makespan, above=0.0)
        for method, makespan in published.items()
    }
    routes = _routes(file, robots, len(work)) if "ctas_d_routes" in data else None
    file.done()
    return Instance(name, robots, speed, depot, work, figures, routes)


def _work(file: JsonFile, field: str, value: object, robots: int) -> Work:
    if not isinstance(value, dict) or not {"x", "y", "agents", "duration"} <= set(value):
        file.fault(field, "is no task", 'Give {"x": ..., "y": ..., "agents": ..., "duration": ...}.')
        return Work((0.0, 0.0), 1, 0.0)
    return Work(
        place=(file.number(f"{field}.x", value["x"]), file.number(f"{field}.y", value["y"])),
        robots=file.count(f"{field}.agents", value["agents"], low=1, high=robots),
        duration=file.number(f"{field}.duration", value["duration"], low=0.0),
    )


def _routes(file: JsonFile, robots: int, tasks: int) -> tuple[tuple[int, ...], ...]:
    """The routes without the depot, number 0, at both ends; a robot that stays has none in the file."""
    listed = file.items("ctas_d_routes", file.data["ctas_d_routes"], what="routes")
    if len(listed) > robots:
        file.fault("ctas_d_routes", f"has {len(listed)} entries", f"Give at most {robots}, one a robot.")
    routes = []
    for row, value in enumerate(listed):
        field = f"ctas_d_routes[{row}]"
        stops = file.items(field, value, what="task numbers")
        if isinstance(value, list) and (len(stops) < 2 or stops[0] != 0 or stops[-1] != 0):
            file.fault(field, "does not start and end with 0", "The depot, number 0, is first and last.")
            stops = []
        inner = enumerate(stops[1:-1], 1)
        routes.append(
            tuple(file.count(f"{field}[{place}]", stop, low=1, high=tasks) for place, stop in inner)
        )
    return (*routes, *[()] * (robots - len(routes)))


def _data() -> Traversable:
    return resources.files("swarmbid.datasets") / "data" / "dcmrta"
