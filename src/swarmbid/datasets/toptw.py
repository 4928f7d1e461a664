"""Team orienteering with time windows: 37 public instances, each for 1 to 4 vehicles.

A fleet leaves a depot, collects rewards that open and close, and is back before the horizon. In our
words: one agent per vehicle, speed 1, base at the depot, endurance up to the horizon; one task per
vertex, worth its reward whenever it is served (score ``time_window``). The benchmark rounds distances
down to one decimal or two, and a window bounds the start of service.

Source: KU Leuven's instances; `swarmbid/datasets/data/toptw/README.md` says where they come from.
"""

from __future__ import annotations

import csv
import math
from dataclasses import dataclass
from importlib import resources
from importlib.resources.abc import Traversable
from pathlib import Path

from swarmbid.errors import Fault, InputError, did_you_mean
from swarmbid.model import Agent, Mission, Task

MAX_BYTES = 10_000_000
"""Largest file read; the largest public instance has 11 kB."""


@dataclass(frozen=True)
class Known:
    """What is known of one instance with one number of vehicles; all in units of reward.

    Parameters
    ----------
    best : the best result known.
    leuven_best, leuven_mean : best and mean of KU Leuven's 10 runs (2010).
    total : sum of all rewards, a bound that no plan exceeds.
    """

    best: float
    leuven_best: float
    leuven_mean: float
    total: float


def instances() -> list[str]:
    """Return the names of the instances carried along, such as ``"c101"``, in order."""
    return sorted(item.name.removesuffix(".txt") for item in _data().iterdir() if item.name.endswith(".txt"))


def load(instance: str, vehicles: int) -> Mission:
    """Return one of the public instances as a mission.

    Parameters
    ----------
    instance : one of `instances`.
    vehicles : how many agents there are; the published results are for 1 to 4.

    Raises
    ------
    InputError : there is no such instance, or no vehicle.
    """
    _check_name(instance)
    text = (_data() / f"{instance}.txt").read_text(encoding="ascii")
    return parse(text, vehicles, name=instance, where=f"{instance}.txt")


def read(path: Path | str, vehicles: int, *, distance_step: float | None = None) -> Mission:
    """Return the mission of a file of your own in the same format.

    Parameters
    ----------
    distance_step : m to which distances are rounded down, 0 for exact ones; None for the benchmark's
        rule, 0.01 for files whose name starts with "pr", 0.1 for others.

    Raises
    ------
    InputError : it cannot be read; the message names every faulty line.
    """
    path = Path(path)
    try:
        if path.stat().st_size > MAX_BYTES:
            size = f"has {path.stat().st_size:,} bytes"
            raise InputError([Fault(str(path), "", size, f"Give at most {MAX_BYTES:,}.")])
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise InputError(
            [Fault(str(path), "", f"cannot be read: {error.strerror}", "Name a readable file.")]
        ) from None
    except UnicodeDecodeError:
        raise InputError(
            [Fault(str(path), "", "is not text", "Give an instance in KU Leuven's text format.")]
        ) from None
    return parse(text, vehicles, name=path.stem, where=str(path), distance_step=distance_step)


def best_known(instance: str, vehicles: int) -> float:
    """Return the best result known, in units of reward; see `known` for more."""
    return known(instance, vehicles).best


def known(instance: str, vehicles: int) -> Known:
    """Return what is known of `instance` with 1 to 4 vehicles.

    Raises
    ------
    InputError : nothing is known of it.
    """
    _check_name(instance)
    table = (_data() / "bks.csv").read_text(encoding="ascii")
    for row in csv.DictReader(table.splitlines()):
        if row["instance"] == instance and row["m"] == str(vehicles):
            return Known(
                best=float(row["best_known"]),
                leuven_best=float(row["kuleuven_best"]),
                leuven_mean=float(row["kuleuven_avg"]),
                total=float(row["total_score"]),
            )
    raise InputError(
        [Fault(f"instance {instance}", "vehicles", f"is {vehicles}", "Results are known for 1 to 4.")]
    )


@dataclass(frozen=True)
class _Vertex:
    number: int
    x: float
    y: float
    duration: float
    reward: float
    opens: float
    closes: float


def parse(text: str, vehicles: int, *, name: str, where: str, distance_step: float | None = None) -> Mission:
    """Return the mission that the text of an instance describes.

    Vertex 7 becomes task ``t007``; vehicles are agents ``v1``, ``v2`` and so on, with as many digits
    as keep the order of ids that of the numbers. A vertex without reward is left out.

    Parameters
    ----------
    name : of the mission.
    where : the file's name, for error messages.
    distance_step : as for `read`.

    Raises
    ------
    InputError : with every faulty line.
    """
    if vehicles < 1:
        raise InputError([Fault(name, "vehicles", f"is {vehicles}", "Give 1 or more.")])
    vertices = _Lines(text, where).vertices()
    if distance_step is None:
        distance_step = 0.01 if name.startswith("pr") else 0.1
    depot, others = vertices[0], vertices[1:]
    place = (depot.x, depot.y, 0.0)
    digits = max(3, len(str(len(others))))
    return Mission(
        name=f"{name}-{vehicles}",
        distance_step=distance_step,
        agents=tuple(
            Agent(
                id=f"v{vehicle:0{len(str(vehicles))}d}",
                type="vehicle",
                position=place,
                base=place,
                available_at=depot.opens,
                endurance=depot.closes - depot.opens,
            )
            for vehicle in range(1, vehicles + 1)
        ),
        tasks=tuple(
            Task(
                id=f"t{vertex.number:0{digits}d}",
                type="vertex",
                position=(vertex.x, vertex.y, 0.0),
                reward=vertex.reward,
                start=vertex.opens,
                end=vertex.closes,
                duration=vertex.duration,
            )
            for vertex in others
            if vertex.reward > 0.0
        ),
    )


class _Lines:
    """The lines of one instance file and their faults."""

    def __init__(self, text: str, where: str) -> None:
        self.where = where
        self.faults: list[Fault] = []
        self.lines = [
            (number, line.split()) for number, line in enumerate(text.splitlines(), 1) if line.strip()
        ]

    def fault(self, line: int, field: str, why: str, mend: str) -> None:
        self.faults.append(Fault(f"{self.where}:{line}", field, why, mend))

    def vertices(self) -> list[_Vertex]:
        """Return the depot and the other vertices, in order of the file."""
        count = self.count()
        vertices: list[_Vertex] = []
        seen: set[int] = set()
        for line, words in self.lines[2:]:
            vertex = self.vertex(line, words, is_depot=not seen)
            # A number that was read is remembered even if its line is faulty: one mistake, one message.
            number = int(words[0]) if words[0].isdecimal() and len(words[0]) <= 9 else None
            if number is not None and number in seen:
                self.fault(line, "vertex", f"{number} appears twice", "Give every vertex its own number.")
            elif not seen and number not in (0, None):
                self.fault(line, "vertex", f"is {number}", "The first vertex is the depot, number 0.")
            seen.add(-1 - line if number is None else number)
            if vertex is not None:
                vertices.append(vertex)
        if count is not None and len(self.lines) - 2 != count + 1:
            last = self.lines[-1][0]
            found = f"the file ends after {max(0, len(self.lines) - 3)} vertices, line 1 promises {count}"
            self.fault(last, "", found, "Complete the file, or mend its first line.")
        if self.faults:
            raise InputError(self.faults)
        return vertices

    def count(self) -> int | None:
        """Return how many vertices line 1 promises, the depot not counted."""
        if not self.lines:
            self.fault(1, "", "the file is empty", "Give an instance in KU Leuven's text format.")
            raise InputError(self.faults)
        line, words = self.lines[0]
        if len(words) != 4 or not words[2].isdecimal() or len(words[2]) > 9:
            self.fault(
                line,
                "",
                f"is {' '.join(words)[:60]!r}",
                "Line 1 has four numbers, the third is the number of vertices.",
            )
            return None
        return int(words[2])

    def vertex(self, line: int, words: list[str], *, is_depot: bool) -> _Vertex | None:
        """Read: number x y service reward - a (a numbers) opening closing."""
        before = len(self.faults)
        if len(words) < 7 or not words[0].isdecimal() or not words[6].isdecimal() or len(words[6]) > 9:
            shape = "A vertex has: number x y service reward f a, then a numbers, opening, closing."
            self.fault(line, "", f"is {' '.join(words)[:60]!r}", shape)
            return None
        times = words[7 + int(words[6]) :]
        # Some copies give the depot its closing time only.
        if is_depot and len(times) == 1:
            times = ["0", *times]
        if len(times) != 2:
            why = f"has {len(words)} numbers, {9 + int(words[6])} are due after a = {words[6]}"
            self.fault(line, "", why, "End the line with the opening and the closing of the window.")
            return None
        names = ("x", "y", "service", "reward", "opening", "closing")
        values = [
            self.number(line, name, word) for name, word in zip(names, (*words[1:5], *times), strict=True)
        ]
        for name, value in zip(names[2:], values[2:], strict=True):
            if value < 0.0:
                self.fault(line, name, f"is {value:g}", "Give 0 or more.")
        if values[5] < values[4]:
            why = f"is {values[5]:g}, before the opening {values[4]:g}"
            self.fault(line, "closing", why, "Let the window close after it opens.")
        if is_depot and values[5] == values[4]:
            self.fault(line, "closing", f"is {values[5]:g}: no time is left", "Give a later horizon.")
        return _Vertex(int(words[0]), *values) if len(self.faults) == before else None

    def number(self, line: int, name: str, word: str) -> float:
        try:
            value = float(word)
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            self.fault(line, name, f"is {word[:60]!r}", "Give a finite number.")
        return value


def _check_name(instance: str) -> None:
    if instance not in instances():
        mend = did_you_mean(instance, instances()) or "`instances()` lists those that there are."
        raise InputError([Fault("instance", "", f"there is no {instance!r}", mend)])


def _data() -> Traversable:
    return resources.files("swarmbid.datasets") / "data" / "toptw"
