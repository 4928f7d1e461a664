"""Many runs on all processors, in an order that does not matter."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from multiprocessing import get_context

import numpy as np

from swarmbid.arrays import FloatArray
from swarmbid.experiments.hunt2014._cases import Outcome, Point, outcomes, play
from swarmbid.experiments.hunt2014._stats import Level

Progress = Callable[[int, int], None]

MEASURES: dict[str, Callable[[Point, Outcome], float]] = {
    "score": lambda point, found: found.score,
    "completed": lambda point, found: found.completed,
    "steps": lambda point, found: found.changes,
    "own": lambda point, found: found.own,
    "links": lambda point, found: found.changes * (point.agents - 1),
    "sent": lambda point, found: found.sent,
    "rounds": lambda point, found: found.rounds,
    "bytes": lambda point, found: found.bytes,
    "seconds": lambda point, found: found.seconds,
    "together": lambda point, found: math.nan if found.together is None else found.together,
}
"""What can be asked of a point's runs; all but the score of settled runs alone (`Results.sample`)."""
OF_ALL_RUNS = ("score", "completed", "seconds", "together")
"""Measures that make sense of runs that were given up, too."""


@dataclass(frozen=True)
class Results:
    """The runs at every point, in order of run."""

    runs: Mapping[Point, Sequence[Outcome]]

    def sample(self, point: Point, measure: str) -> FloatArray:
        """Return one number of each run that counts.

        What it takes to settle cannot be said of runs that never did, so these are left out of all
        measures but those in `OF_ALL_RUNS`.
        """
        take = MEASURES[measure]
        found = [
            take(point, one) for one in self.runs.get(point, ()) if measure in OF_ALL_RUNS or one.settled
        ]
        values = np.array(found, dtype=np.float64)
        return values[~np.isnan(values)]

    def level(self, point: Point, measure: str) -> Level:
        """Return the mean, the spread and how many runs count."""
        return Level.of(self.sample(point, measure))

    def share(self, point: Point, fact: str) -> float:
        """Return the share of the runs that are ``"settled"``, ``"sound"`` or ``"clean"``."""
        found = [getattr(one, fact) for one in self.runs.get(point, ())]
        return sum(found) / len(found) if found else math.nan


def play_all(
    counts: Mapping[Point, int], *, seed: int, workers: int | None, progress: Progress | None
) -> Results:
    """Play so many runs at each point.

    Parameters
    ----------
    counts : point -> runs. seed : of all of it.
    workers : processes; as many as there are processors by default, 1 to stay in this one.
    """
    batches = list(_batches(counts))
    total = sum(counts.values())
    found: dict[tuple[Point, int], Outcome] = {}
    for run, pairs in _carried_out(batches, seed, workers or os.cpu_count() or 1):
        found.update({(point, run): outcome for point, outcome in pairs})
        if progress is not None:
            progress(len(found), total)
    return Results({point: tuple(found[point, run] for run in range(num)) for point, num in counts.items()})


def _batches(counts: Mapping[Point, int]) -> Iterator[tuple[int, list[Point]]]:
    """Yield pieces of work of a like length: one run each, at a few points."""
    for run in range(max(counts.values(), default=0)):
        wanted = [point for point, num in counts.items() if run < num]
        for first in range(0, len(wanted), 10):
            yield run, wanted[first : first + 10]


def _carried_out(
    batches: Iterable[tuple[int, list[Point]]], seed: int, workers: int
) -> Iterator[tuple[int, list[tuple[Point, Outcome]]]]:
    if workers == 1:
        _warm_up()
        for run, points in batches:
            yield run, outcomes(points, run, seed)
        return
    # Fresh interpreters: a fork would inherit the threads of compiled code in an unknown state.
    pool = ProcessPoolExecutor(workers, mp_context=get_context("spawn"), initializer=_warm_up)
    try:
        waiting = {pool.submit(outcomes, points, run, seed): run for run, points in batches}
        for done in as_completed(waiting):
            yield waiting[done], done.result()
    finally:
        pool.shutdown(cancel_futures=True)


def _warm_up() -> None:
    """Load or compile what runs need, so that no run's computing time includes it."""
    for variant in ("printed", "repaired"):
        for experiment in ("single", "pairs"):
            play(Point(variant, experiment, 2, tasks=2, timed=True), 0, 0)
