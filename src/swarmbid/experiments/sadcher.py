"""CBGA on robots with skills and tasks in sequence: how far from the proved least makespan.

All tasks must be done, and what counts is when the last robot is at the meeting place. CBGA maximises a
sum of visit values, so the team bids by `early_finish`. Every plan is verified, and followed by the
benchmark's own rules.

Source: the instances and optima of `swarmbid.datasets.sadcher`.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any, cast

from swarmbid.datasets import sadcher
from swarmbid.datasets.sadcher import Instance, Work
from swarmbid.errors import Fault, InputError
from swarmbid.experiments._makespan import (
    Attempt,
    Progress,
    Setting,
    best,
    described,
    faults,
    in_json,
    markdown,
    mean,
    negotiate_all,
)
from swarmbid.scores.early_finish import EarlyFinish

NEGOTIATIONS = (1, 8, 32)
"""How many times a team negotiates; the first times are the same in each."""
SETTING = Setting(
    score=EarlyFinish(time_constant=600.0, tail=1.0, scarcity=200.0), insertion="shift", spread=150.0
)
FAMILIES = {"1p": "published", "8t3r3s1p": "8 tasks", "9t3r3s2p": "9 tasks"}
"""What the names begin with -> what the family is called."""
SAME = 1e-5
"""Relative difference within which a makespan is the optimum, which is given to the third decimal."""


@dataclass(frozen=True)
class Trial:
    """One instance.

    Parameters
    ----------
    optimum : the least makespan, proved. greedy : that of the central greedy.
    attempts : the negotiations; the first with the rewards as they are.
    """

    instance: str
    optimum: float
    greedy: float
    attempts: tuple[Attempt, ...]

    def gap(self, count: int) -> float:
        """How much longer than the optimum the best of the first `count` negotiations is, as a share."""
        return best(self.attempts, count) / self.optimum - 1.0


@dataclass(frozen=True)
class Row:
    """One line of the table: a family, or an instance.

    Parameters
    ----------
    optimum, makespan : means, in the benchmark's unit; the makespan of one negotiation.
    gaps, worst_gaps : share above the optimum, mean and largest, for each number of `NEGOTIATIONS`.
    optimal : instances of which the optimum was found, for each number of `NEGOTIATIONS`.
    greedy_gap, worst_greedy_gap : the same of the central greedy.
    rounds : of one negotiation, the mean.
    done, verified, converged : whether all were, in every negotiation.
    """

    name: str
    instances: int
    optimum: float
    makespan: float
    gaps: tuple[float, ...]
    worst_gaps: tuple[float, ...]
    optimal: tuple[int, ...]
    greedy_gap: float
    worst_greedy_gap: float
    rounds: float
    done: bool
    verified: bool
    converged: bool


@dataclass(frozen=True)
class Comparison:
    """All trials, and the tables made of them.

    Parameters
    ----------
    negotiations : how many each team was allowed, those of `NEGOTIATIONS` that were run.
    """

    trials: tuple[Trial, ...]
    negotiations: tuple[int, ...]

    def by_family(self) -> list[Row]:
        """One row for each family."""
        found = []
        for prefix, name in FAMILIES.items():
            trials = [trial for trial in self.trials if family(trial.instance) == prefix]
            if trials:
                found.append(self._row(name, trials))
        return found

    def by_instance(self) -> list[Row]:
        """One row for each instance."""
        return [self._row(trial.instance, [trial]) for trial in self.trials]

    def overall(self) -> Row:
        """All of them in one row."""
        return self._row("all", self.trials)

    def _row(self, name: str, trials: Sequence[Trial]) -> Row:
        attempts = [one for trial in trials for one in trial.attempts]
        gaps = [[trial.gap(count) for trial in trials] for count in self.negotiations]
        greedy = [trial.greedy / trial.optimum - 1.0 for trial in trials]
        return Row(
            name=name,
            instances=len(trials),
            optimum=mean(trial.optimum for trial in trials),
            makespan=mean(trial.attempts[0].makespan for trial in trials),
            gaps=tuple(mean(column) for column in gaps),
            worst_gaps=tuple(max(column) for column in gaps),
            optimal=tuple(sum(gap < SAME for gap in column) for column in gaps),
            greedy_gap=mean(greedy),
            worst_greedy_gap=max(greedy),
            rounds=mean(trial.attempts[0].rounds for trial in trials),
            done=not any(one.left for one in attempts),
            verified=not any(one.problems for one in attempts),
            converged=all(one.converged for one in attempts),
        )

    def problems(self) -> list[str]:
        """What went wrong, in sentences: no agreement, tasks left, a plan that the judges refuse."""
        found = [fault for trial in self.trials for fault in faults(trial.instance, trial.attempts)]
        beaten = [trial for trial in self.trials if trial.gap(self.negotiations[-1]) < -SAME]
        return found + [f"{trial.instance}: shorter than the proved optimum" for trial in beaten]

    def to_dict(self) -> dict[str, Any]:
        """Everything, JSON-ready."""
        found = {
            "experiment": "sadcher",
            "setting": described(SETTING),
            "negotiations": list(self.negotiations),
            "families": [asdict(row) for row in self.by_family()],
            "overall": asdict(self.overall()),
            "trials": [asdict(trial) for trial in self.trials],
            "problems": self.problems(),
        }
        return cast(dict[str, Any], in_json(found))

    def table(self, *, every_instance: bool = False) -> tuple[list[str], list[list[str]]]:
        """Return headings and cells, ready to print.

        Parameters
        ----------
        every_instance : a row for each instance instead of each family.
        """
        rows = self.by_instance() if every_instance else self.by_family()
        columns = [name for name in self._columns() if not (every_instance and name.startswith(FAMILY_ONLY))]
        headings = ["instance" if every_instance else "family", *columns]
        cells = [self._cells(row) for row in [*rows, self.overall()]]
        return headings, [[found[name] for name in ("name", *columns)] for found in cells]

    def _columns(self) -> list[str]:
        several = [f"best of {count}" for count in self.negotiations[1:]]
        return [
            *("instances", "optimum", "makespan", "gap", "worst gap"),
            *several,
            *(f"optimal, {name}" for name in several),
            *("central greedy", "worst greedy", "rounds", "all done", "verified", "agreed"),
        ]

    def _cells(self, row: Row) -> dict[str, str]:
        """One printed line, by column."""
        several = [f"best of {count}" for count in self.negotiations[1:]]
        cells = {
            "name": row.name,
            "instances": str(row.instances),
            "optimum": f"{row.optimum:.1f}",
            "makespan": f"{row.makespan:.1f}",
            "gap": _percent(row.gaps[0]),
            "worst gap": _percent(row.worst_gaps[0]),
            "central greedy": _percent(row.greedy_gap),
            "worst greedy": _percent(row.worst_greedy_gap),
            "rounds": f"{row.rounds:.1f}" if row.instances > 1 else f"{row.rounds:.0f}",
        }
        for place, name in enumerate(several, 1):
            cells[name] = _percent(row.gaps[place])
            cells[f"optimal, {name}"] = str(row.optimal[place])
        checks = {"all done": row.done, "verified": row.verified, "agreed": row.converged}
        return cells | {name: "yes" if good else "NO" for name, good in checks.items()}

    def summary(self) -> str:
        """The result in one sentence."""
        row = self.overall()
        several = "".join(
            f", best of {count} {_percent(row.gaps[place])}"
            for place, count in enumerate(self.negotiations)
            if place
        )
        done = "every task done" if row.done else "NOT every task done"
        checked = "every plan verified" if row.verified else "NOT every plan verified"
        agreed = "every run agreed" if row.converged else "NOT every run agreed"
        return (
            f"CBGA ends {_percent(row.gaps[0])} later than the optimum on average over {row.instances} "
            f"instances (worst {_percent(row.worst_gaps[0])}){several}; a central greedy "
            f"{_percent(row.greedy_gap)}; {done}, {checked}, {agreed}."
        )

    def page(self) -> str:
        """The page of the documentation, in Markdown."""
        parts = [_introduction(), self.summary(), "", "## By family", ""]
        parts += markdown(*self.table(), texts=3)
        parts += ["", _READING, "", "## Every instance", ""]
        parts += markdown(*self.table(every_instance=True), texts=3)
        return "\n".join(parts) + "\n"


FAMILY_ONLY = ("instances", "worst", "optimal,")
"""What such columns begin with."""


def run(
    *,
    quick: bool = False,
    instances: Sequence[str] | None = None,
    negotiations: int = NEGOTIATIONS[-1],
    progress: Progress | None = None,
) -> Comparison:
    """Let the teams negotiate, and compare.

    Parameters
    ----------
    quick : the first two instances of each family only.
    instances : which ones; all by default.
    negotiations : how often each team negotiates at most.
    progress : called with how many negotiations are done, and how many there are.

    Raises
    ------
    InputError : an unknown instance, or none at all.
    """
    names = list(instances) if instances is not None else sadcher.instances()
    if quick:
        names = [
            name for prefix in FAMILIES for name in [name for name in names if family(name) == prefix][:2]
        ]
    if not names or negotiations < 1:
        mend = "Name one, or leave it out for all; and let them negotiate once or more."
        raise InputError([Fault("sadcher", "instances", "there is nothing to run", mend)])
    found = [sadcher.instance(name) for name in names]
    attempts = negotiate_all(found, SETTING, negotiations, progress)
    return Comparison(
        tuple(
            Trial(
                instance=one.name,
                optimum=one.optimum or math.nan,
                greedy=one.replay(earliest_completion(one)).makespan,
                attempts=own,
            )
            for one, own in zip(found, attempts, strict=True)
        ),
        tuple(sorted({min(count, negotiations) for count in NEGOTIATIONS})),
    )


def family(instance: str) -> str:
    """Return the key of `FAMILIES` of an instance: ``"1p"`` of ``"1p_000003"``."""
    return instance.partition("_")[0]


def earliest_completion(instance: Instance) -> list[list[int]]:
    """Return the routes of a central greedy, as task numbers for each robot.

    Of all tasks that may start and all groups that could do them, the one that ends first is taken,
    again and again. Ties go to the smaller task number, then to the smaller group.
    """
    routes: list[list[int]] = [[] for _ in instance.robots]
    free = [(0.0, instance.start) for _ in instance.robots]
    ends: dict[int, float] = {}
    left = list(instance.work)
    while left:
        offers = [
            (_end(one, crew, free, ends), one.number, len(crew), crew)
            for one in left
            if all(first in ends for first in one.before)
            for crew in _crews(instance, one)
        ]
        end, number, _, crew = min(offers)
        done = instance.work[number - 1]
        for robot in crew:
            free[robot] = (end, done.place)
            routes[robot].append(number)
        ends[number] = end
        left.remove(done)
    return routes


def _end(
    one: Work,
    crew: tuple[int, ...],
    free: Sequence[tuple[float, tuple[float, float]]],
    ends: dict[int, float],
) -> float:
    arrivals = [free[robot][0] + math.dist(free[robot][1], one.place) for robot in crew]
    return max([*arrivals, *(ends[first] for first in one.before)]) + one.duration


def _crews(instance: Instance, one: Work) -> list[tuple[int, ...]]:
    """Every group that has the skills of a task and nobody too many."""
    useful = [robot for robot, skills in enumerate(instance.robots) if skills & one.skills]

    def enough(crew: tuple[int, ...]) -> bool:
        return one.skills <= frozenset[int]().union(*(instance.robots[robot] for robot in crew))

    return [
        crew
        for size in range(1, len(one.skills) + 1)
        for crew in itertools.combinations(useful, size)
        if enough(crew) and not any(enough(crew[:row] + crew[row + 1 :]) for row in range(size))
    ]


def _percent(share: float) -> str:
    return f"{100.0 * share:.1f} %".replace("-0.0 %", "0.0 %")


def _introduction() -> str:
    return _INTRODUCTION.format(score=SETTING.score, spread=SETTING.spread)


_INTRODUCTION = """\
# Skills, groups and sequences (Sadcher's benchmark)

Three robots leave one place, do all tasks and meet at another as early as they can. A task needs one to
three skills; whoever goes there must together have them, and each must have one that nobody else there has.
It starts when the last has arrived, and not before the tasks that precede it have ended. It is the nearest
public benchmark to what CBGA is for, with optima that were proved.

This page is written by `swarmbid bench sadcher --write docs/sadcher.md`. Do not edit it.

## What is compared

**Ours** is CBGA with team rewards, everybody hears everybody. A task takes as many agents as its equipment
takes (`agents_required: 0`), and the meeting place is the base of every agent. The benchmark counts the
makespan, which is no sum of values; so the agents bid by the score [`early_finish`](reference/names.md): a
reward that fades from the start of the mission on (time constant {score.time_constant:g}), more slowly for
a task that much must follow (`tail` {score.tail:g}: a second of head start for each second of later tasks
and of the way home) and for a task of scarce skills (`scarcity` {score.scarcity:g}: that many seconds,
divided by the number of robots with the skill, for each skill). Later visits may slip when a task is
inserted (`shift`). Which parts the score has and how tasks are inserted was tried out on these 36
instances; the numbers were then chosen on random instances of the same kind.

- *gap*: of **one negotiation**, how much later than the optimum the last robot is at the meeting place.
- *best of 8*, *best of 32*: the team negotiates so many times and keeps the plan that ends the earliest.
  The first is the one above; in each later one, every task has a head start of its own, drawn from a normal
  distribution (standard deviation {spread:g}, seeds 1, 2, 3 and so on). When a team has agreed, everybody
  knows the whole plan and its makespan, so nobody is needed who chooses. *Optimal* counts the instances in
  which that plan is the optimum.
- *central greedy*: somebody who sees everything takes, again and again, the task and the group that end
  first.

Every plan is verified against the mission, and its routes are followed by a second program that knows the
benchmark's rules only; both must come to the same end. The optima are those of the benchmark's authors for
the 6 published instances, confirmed with OR-Tools CP-SAT; the other 30 were made for this comparison by the
published rules and their optima proved with CP-SAT ([where the data come
from](https://github.com/jakbichler/Sadcher)).
"""

_READING = """\
One negotiation never takes back what ranks first, as a greedy does not. Its order differs: what much must
follow and what needs rare skills is taken early, and a task may still be put in before others. Several
negotiations with other head starts do what a search would: they try other orders. The gap of one
negotiation varies much from instance to instance; the worst one says what a team has to expect."""
