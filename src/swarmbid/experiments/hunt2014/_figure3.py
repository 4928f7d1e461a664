"""Fig. 3: how much data a message holds, step by step, in old vectors and in triples; and in bytes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from swarmbid.experiments.hunt2014._cases import TASKS, Outcome, Point
from swarmbid.experiments.hunt2014._pictures import COLOURS, legend_below, panels
from swarmbid.experiments.hunt2014._runs import Results

if TYPE_CHECKING:
    from matplotlib.figure import Figure

AGENTS = 10
LINES = {"single": 1, "pairs": 2, "fours": 4}
"""Experiment -> agents a task."""
STEPS = 15
"""Rounds shown; few runs talk longer."""
NUMBER_BYTES = 8
INDEX_BYTES = 2
"""How tightly the paper's two storages are coded here: a bid or a stamp, an index of an agent or a task."""


@dataclass(frozen=True)
class Storage:
    """One way to write down what a message holds.

    Parameters
    ----------
    numbers : pieces of data a message, as the paper counts, by step; nan where nobody spoke.
    bytes : a message, by step.
    run_bytes : all messages of a run, the mean over the runs.
    """

    numbers: tuple[float, ...]
    bytes: tuple[float, ...]
    run_bytes: float


def points() -> list[Point]:
    """Return where runs are needed."""
    return [Point(variant, experiment, AGENTS) for experiment in LINES for variant in ("printed", "repaired")]


def vectors(seats: int) -> int:
    """Pieces of data in the old storage: a bid and a winner for each seat (2·N_m·L)."""
    return 2 * TASKS * seats


def vector_bytes(seats: int) -> int:
    """Bytes of the old storage, stamps included."""
    return TASKS * seats * (NUMBER_BYTES + INDEX_BYTES) + AGENTS * NUMBER_BYTES


def triple_bytes(assignments: float) -> float:
    """Bytes of the new storage, stamps included."""
    return assignments * (2 * INDEX_BYTES + NUMBER_BYTES) + AGENTS * NUMBER_BYTES


def triples(runs: Sequence[Outcome]) -> Storage:
    """Return what the paper's protocol sends: all known assignments, each a triple, in every message."""
    entries = _by_step(runs, "entries")
    return Storage(
        numbers=tuple(3.0 * each for each in entries),
        bytes=tuple(triple_bytes(each) for each in entries),
        run_bytes=_mean([sum(_triples_sent(one)) for one in runs]),
    )


def old_vectors(runs: Sequence[Outcome], seats: int) -> Storage:
    """Return what the same messages would be in the old storage."""
    return Storage(
        numbers=tuple(float(vectors(seats)) for _ in range(STEPS)),
        bytes=tuple(float(vector_bytes(seats)) for _ in range(STEPS)),
        run_bytes=_mean([sum(step.messages for step in one.steps) * vector_bytes(seats) for one in runs]),
    )


def measured(runs: Sequence[Outcome]) -> Storage:
    """Return what messages take on our wire: ids as text, digests and stamps included."""
    return Storage(
        numbers=_by_step(runs, "entries"),
        bytes=_by_step(runs, "bytes"),
        run_bytes=_mean([sum(step.bytes for step in one.steps) for one in runs]),
    )


def draw(results: Results) -> Figure:
    """Draw numbers a message (as the paper) and bytes a message, by step."""
    from matplotlib.lines import Line2D

    drawn, (left, right) = panels(["numbers a message, as the paper counts", "bytes a message"], sharey=False)
    steps = range(1, STEPS + 1)
    handles = []
    for colour, (experiment, seats) in zip(COLOURS, LINES.items(), strict=False):
        printed, ours = _settled(results, experiment, "printed"), _settled(results, experiment, "repaired")
        old, new = old_vectors(printed, seats), triples(printed)
        left.plot(steps, old.numbers, color=colour)
        left.plot(steps, new.numbers, color=colour, linestyle="", marker="x", markersize=5)
        right.plot(steps, old.bytes, color=colour)
        right.plot(steps, new.bytes, color=colour, linestyle="", marker="x", markersize=5)
        right.plot(steps, measured(ours).bytes, color=colour, linestyle=":", marker="o", markersize=3)
        handles.append(Line2D([], [], color=colour, label=f"L = {seats}"))
    for one in (left, right):
        one.set_xlabel("step (round)")
        one.set_ylim(bottom=0.0)
    left.set_ylabel("data sent by one agent")
    right.set_ylabel("bytes")
    handles += [
        Line2D([], [], color="black", label="old vectors"),
        Line2D([], [], color="black", linestyle="", marker="x", label="triples, as printed"),
        Line2D(
            [], [], color="black", linestyle=":", marker="o", markersize=3, label="owned records, measured"
        ),
    ]
    legend_below(drawn, handles)
    return drawn


def table(results: Results) -> tuple[list[str], list[list[str]]]:
    """Return headings and cells: numbers a message at the first and the last step, bytes of a run."""
    headings = [
        "agents a task", "old vectors, numbers", "triples, first step", "triples, last step",
        "old vectors, kB a run", "triples, kB a run", "triples measured, kB a run",
        "owned records measured, kB a run",
    ]  # fmt: skip
    rows = []
    for experiment, seats in LINES.items():
        printed, ours = _settled(results, experiment, "printed"), _settled(results, experiment, "repaired")
        new = triples(printed)
        seen = [each for each in new.numbers if not math.isnan(each)] or [math.nan]
        sizes = [old_vectors(printed, seats), new, measured(printed), measured(ours)]
        rows.append(
            [
                str(seats),
                str(vectors(seats)),
                f"{seen[0]:.0f}",
                f"{seen[-1]:.0f}",
                *(f"{each.run_bytes / 1000.0:.1f}" for each in sizes),
            ]
        )
    return headings, rows


def _settled(results: Results, experiment: str, variant: str) -> list[Outcome]:
    """Runs that ended; the others would count until patience was lost."""
    return [one for one in results.runs.get(Point(variant, experiment, AGENTS), ()) if one.settled]


def _triples_sent(run: Outcome) -> list[float]:
    """Bytes of all messages of each round, in the new storage."""
    return [
        step.entries * (2 * INDEX_BYTES + NUMBER_BYTES) + step.messages * AGENTS * NUMBER_BYTES
        for step in run.steps
    ]


def _by_step(runs: Sequence[Outcome], what: str) -> tuple[float, ...]:
    """Mean of something a message over the runs in which somebody spoke, by step."""
    found = []
    for place in range(STEPS):
        said = [run.steps[place] for run in runs if place < len(run.steps) and run.steps[place].messages]
        found.append(_mean([getattr(step, what) / step.messages for step in said]))
    return tuple(found)


def _mean(values: Sequence[float]) -> float:
    return math.fsum(values) / len(values) if values else math.nan
