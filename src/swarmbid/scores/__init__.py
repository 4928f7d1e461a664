"""What a visit is worth. One score per file; the file's name is the score's name.

A score says two things that must agree. `Score.value` is the definition, in plain Python: what one
visit earns, given when its service starts and how far the agent flew to it. `Score.fill` and
`Score.cost_per_metre` give the same as coefficients of one parametric family, which the compiled
kernel evaluates for many tasks side by side:

    value = reward * exp(-(decay * (t - reference) + ((t - peak) / width)^2)) - cost * leg - fixed

Timing is physics and not a score's business: the kernel owns travel, waiting, windows, service and range.
A function of your own is a score as well, see `custom`.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from swarmbid import registry
from swarmbid.arrays import FloatArray, MissionArrays
from swarmbid.errors import Fault, InputError, did_you_mean
from swarmbid.model import Agent, Mission, Task

INSERTIONS = ("hold", "shift", "append")
"""The insertion rules: promised times held; later visits may slip; only at the path's end."""


@dataclass(frozen=True)
class Score(ABC):
    """What one visit is worth to one agent.

    Examples
    --------
    >>> make_score("distance_cost").name
    'distance_cost'
    """

    insertion: ClassVar[str] = "shift"

    @property
    def name(self) -> str:
        """The file's name."""
        return type(self).__module__.rpartition(".")[2]

    @property
    def options(self) -> dict[str, Any]:
        """The parameters, as `make_score` takes them."""
        return asdict(self)

    @abstractmethod
    def value(self, mission: Mission, agent: Agent, task: Task, start: float, leg: float) -> float:
        """Score units earned by one visit.

        Parameters
        ----------
        start : s, when service starts.
        leg : m, flown from the previous stop.
        """

    @abstractmethod
    def fill(self, table: FloatArray, arrays: MissionArrays) -> None:
        """Write the value rows of a task table (`swarmbid.arrays`), which start as zeros."""

    def cost_per_metre(self, agent: Agent) -> float:
        """Score units lost per metre of leg."""
        return agent.fuel_per_metre

    def fixed(self, arrays: MissionArrays, agent: Agent) -> FloatArray | None:
        """Score units lost whenever `agent` takes a task, float64[num_tasks]; None for zeros."""
        return None

    def diminishing(self, insertion: str) -> bool:
        """Whether gains never rise as the bundle grows, so that the theorems of CBBA hold unwarped.

        For exact distances: a `Mission.distance_step` breaks the triangle inequality, and with it this.
        """
        return False

    def honest(self) -> Score:
        """The score to report beside this one; itself unless it is a declared approximation."""
        return self

    def visit_function(self) -> Callable[..., float] | None:
        """A function to compile in place of the coefficients; None for all but a user's own."""
        return None


def make_score(score: str | Score | Callable[..., float] | None = None, **options: Any) -> Score:
    """Return a score by name, from a file, or from a function.

    Parameters
    ----------
    score : a name (`swarmbid list`), the path of a Python file that defines ``score(visit)``, such a
        function itself, or a `Score`, which is returned unchanged. None for "time_discounted".
    options : the score's parameters.

    Raises
    ------
    InputError : no such score, or no such parameter.
    """
    if isinstance(score, Score):
        return score
    if callable(score):
        from swarmbid.scores._custom import Custom

        return Custom(score)
    name = score or "time_discounted"
    if name.endswith(".py"):
        from swarmbid.scores._custom import load_custom

        return load_custom(Path(name))
    cls = registry.load_class("scores", name, Score)  # type: ignore[type-abstract]
    known = [item.name for item in fields(cls)]
    faults = [
        Fault(f"score {name}", option, "is no parameter of it", did_you_mean(option, known) or _known(known))
        for option in options
        if option not in known
    ]
    if faults:
        raise InputError(faults)
    return cls(**options)


def need_number(score: Score, field: str, low: float = 0.0) -> None:
    """Raise InputError unless a parameter of `score` is a finite number of at least `low`."""
    value = getattr(score, field)
    if not isinstance(value, int | float) or not math.isfinite(value) or value < low:
        raise InputError(
            [Fault(f"score {score.name}", field, f"is {value!r}", f"Give a finite number, {low:g} or more.")]
        )


def task_values(arrays: MissionArrays, field: str) -> FloatArray:
    """Return float64[num_tasks]: one field of every task, in order of row."""
    return np.array([getattr(task, field) for task in arrays.tasks], dtype=np.float64)


def _known(known: list[str]) -> str:
    return "It has: " + ", ".join(known) + "." if known else "It has none."
