"""A score of your own: one function, in a file or in a notebook.

    def score(visit):
        return visit.reward * 0.5 ** (visit.start / 600.0) - 0.01 * visit.leg

It gets a `VisitRecord` and returns score units. It is compiled into the kernel, once a process and for some
seconds, so it may use arithmetic and `math`, nothing else; the same function runs uncompiled when a plan
is checked.
"""

from __future__ import annotations

import runpy
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from swarmbid.arrays import DECAY, INVERSE_WIDTH, PEAK, REWARD, FloatArray, MissionArrays, VisitRecord
from swarmbid.errors import Fault, InputError
from swarmbid.model import Agent, Mission, Task
from swarmbid.scores import Score, task_values


@dataclass(frozen=True)
class Custom(Score):
    """The score that `function` gives.

    Parameters
    ----------
    function : VisitRecord -> score units.
    source : the file that it came from, for the trace; empty for a function given in Python.
    """

    function: Callable[[VisitRecord], float]
    source: str = ""

    @property
    def name(self) -> str:
        """The same for every such score."""
        return "custom"

    @property
    def options(self) -> dict[str, Any]:
        """Where the function came from."""
        return {"function": getattr(self.function, "__name__", "score"), "source": self.source}

    def value(self, mission: Mission, agent: Agent, task: Task, start: float, leg: float) -> float:
        """Score units of one visit."""
        peaked = task.revisit_at is not None
        return float(
            self.function(
                VisitRecord(
                    reward=task.reward,
                    discount=task.discount,
                    window_start=task.start,
                    window_end=task.end,
                    duration=task.duration,
                    revisit_at=task.revisit_at or 0.0,
                    revisit_rate=1.0 / task.revisit_width if peaked else 0.0,
                    start=start,
                    leg=leg,
                    fuel_per_metre=agent.fuel_per_metre,
                )
            )
        )

    def fill(self, table: FloatArray, arrays: MissionArrays) -> None:
        """The fields of a `VisitRecord` that stand in the value rows."""
        table[REWARD] = task_values(arrays, "reward")
        table[DECAY] = task_values(arrays, "discount")
        for row, task in enumerate(arrays.tasks):
            if task.revisit_at is not None:
                table[PEAK, row] = task.revisit_at
                table[INVERSE_WIDTH, row] = 1.0 / task.revisit_width

    def visit_function(self) -> Callable[..., float] | None:
        """The function to compile."""
        return self.function


def load_custom(path: Path) -> Custom:
    """Return the score that the Python file at `path` defines as ``score(visit)``.

    The file is code, and it is run: give your own.

    Raises
    ------
    InputError : it cannot be read or run, or defines no function ``score``.
    """
    try:
        names = runpy.run_path(str(path))
    except OSError as error:
        raise InputError(
            [Fault(str(path), "", f"cannot be read: {error.strerror}", "Name a readable file.")]
        ) from None
    except Exception as error:
        raise InputError(
            [Fault(str(path), "", f"cannot be run: {type(error).__name__}: {error}", "Mend the file.")]
        ) from None
    function = names.get("score")
    if not callable(function):
        raise InputError(
            [Fault(str(path), "score", "is not defined", "Define a function: def score(visit): ...")]
        )
    return Custom(function, source=path.name)
