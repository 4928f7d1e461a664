"""CBGA on tasks that need one to five robots at once: makespans beside those of four published methods.

All fifty tasks must be done, and what counts is when the last robot is back at the depot. CBGA maximises
a sum of visit values, so the team bids by `early_finish`. Every plan is verified, and followed by the
benchmark's own rules.

Source: the instances and figures of `swarmbid.datasets.dcmrta`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any, cast

from swarmbid.datasets import dcmrta
from swarmbid.datasets.dcmrta import Instance
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

NEGOTIATIONS = (1, 8)
"""How many times a team negotiates; the first times are the same in each."""
SETTING = Setting(
    score=EarlyFinish(time_constant=40.0, tail=1.0, scarcity=3.0), insertion="append", spread=0.1
)
PUBLISHED = {
    "OR-Tools": "OR-Tools",
    "CTAS-D_300s": "CTAS-D",
    "REINFORCE_IA": "REINFORCE-IA",
    "REINFORCE_LF": "REINFORCE-LF",
}
"""Name in the files -> name in the tables, the longest makespan first."""
MIXED_INTEGER, BEST_PUBLISHED = "CTAS-D_300s", "REINFORCE_LF"
GREEDY = "central greedy"


@dataclass(frozen=True)
class Trial:
    """One instance; makespans in the benchmark's unit of time.

    Parameters
    ----------
    published : method, a key of `PUBLISHED` -> makespan. greedy : that of the central greedy.
    attempts : the negotiations; the first with the rewards as they are.
    """

    instance: str
    published: dict[str, float]
    greedy: float
    attempts: tuple[Attempt, ...]


@dataclass(frozen=True)
class Row:
    """One line of the table: a method, over all instances.

    Parameters
    ----------
    makespan : the mean. longest : the largest.
    against_exact, against_best : share by which the mean is above that of CTAS-D, of the best published.
    shorter : instances in which it is shorter than every published method.
    """

    name: str
    makespan: float
    longest: float
    against_exact: float
    against_best: float
    shorter: int


@dataclass(frozen=True)
class Comparison:
    """All trials, and the tables made of them.

    Parameters
    ----------
    negotiations : how many each team was allowed, those of `NEGOTIATIONS` that were run.
    """

    trials: tuple[Trial, ...]
    negotiations: tuple[int, ...]

    def columns(self) -> dict[str, list[float]]:
        """Method -> makespans, in order of `trials`."""
        found = {
            name: [trial.published[method] for trial in self.trials] for method, name in PUBLISHED.items()
        }
        found[GREEDY] = [trial.greedy for trial in self.trials]
        for count in self.negotiations:
            found[_ours(count)] = [best(trial.attempts, count) for trial in self.trials]
        return found

    def by_method(self) -> list[Row]:
        """One row for each method."""
        columns = self.columns()
        exact, leader = (mean(columns[PUBLISHED[method]]) for method in (MIXED_INTEGER, BEST_PUBLISHED))
        known = [min(trial.published.values()) for trial in self.trials]
        return [
            Row(
                name=name,
                makespan=mean(column),
                longest=max(column),
                against_exact=mean(column) / exact - 1.0,
                against_best=mean(column) / leader - 1.0,
                shorter=sum(value < least for value, least in zip(column, known, strict=True)),
            )
            for name, column in columns.items()
        ]

    def problems(self) -> list[str]:
        """What went wrong, in sentences: no agreement, tasks left, a plan that the judges refuse."""
        return [fault for trial in self.trials for fault in faults(trial.instance, trial.attempts)]

    def to_dict(self) -> dict[str, Any]:
        """Everything, JSON-ready."""
        found = {
            "experiment": "dcmrta",
            "setting": described(SETTING),
            "negotiations": list(self.negotiations),
            "methods": [asdict(row) for row in self.by_method()],
            "trials": [asdict(trial) for trial in self.trials],
            "problems": self.problems(),
        }
        return cast(dict[str, Any], in_json(found))

    def table(self, *, every_instance: bool = False) -> tuple[list[str], list[list[str]]]:
        """Return headings and cells, ready to print.

        Parameters
        ----------
        every_instance : a row for each instance instead of each method.
        """
        if not every_instance:
            return list(METHOD_COLUMNS), [_cells(row) for row in self.by_method()]
        columns = self.columns()
        rows = [
            [trial.instance, *(f"{column[place]:.2f}" for column in columns.values())]
            for place, trial in enumerate(self.trials)
        ]
        means = [f"{mean(column):.2f}" for column in columns.values()]
        return ["instance", *columns], [*rows, ["mean", *means]]

    def summary(self) -> str:
        """The result in one sentence."""
        rows = {row.name: row for row in self.by_method()}
        several = "".join(
            f", best of {count} {rows[_ours(count)].makespan:.2f}" for count in self.negotiations[1:]
        )
        attempts = [one for trial in self.trials for one in trial.attempts]
        done = "every task done" if not any(one.left for one in attempts) else "NOT every task done"
        checked = "every plan verified"
        if any(one.problems for one in attempts):
            checked = "NOT " + checked
        agreed = "every run agreed" if all(one.converged for one in attempts) else "NOT every run agreed"
        return (
            f"CBGA ends at {rows[_ours(1)].makespan:.2f} on average over {len(self.trials)} instances"
            f"{several}; {PUBLISHED[MIXED_INTEGER]} {rows[PUBLISHED[MIXED_INTEGER]].makespan:.2f}, "
            f"a central greedy {rows[GREEDY].makespan:.2f}, the best published "
            f"{rows[PUBLISHED[BEST_PUBLISHED]].makespan:.2f}; {done}, {checked}, {agreed}."
        )

    def page(self) -> str:
        """The page of the documentation, in Markdown."""
        parts = [_introduction(), self.summary(), "", "## By method", ""]
        parts += markdown(*self.table(), texts=0)
        parts += ["", _READING, "", "## Every instance", ""]
        parts += markdown(*self.table(every_instance=True), texts=0)
        return "\n".join(parts) + "\n"


METHOD_COLUMNS = (
    "method",
    "makespan",
    "longest",
    "against CTAS-D",
    "against REINFORCE-LF",
    "shorter than all published",
)


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
    quick : the first three instances only.
    instances : which ones; all by default.
    negotiations : how often each team negotiates at most.
    progress : called with how many negotiations are done, and how many there are.

    Raises
    ------
    InputError : an unknown instance, or none at all.
    """
    names = list(instances) if instances is not None else dcmrta.instances()
    if quick:
        names = names[:3]
    if not names or negotiations < 1:
        mend = "Name one, or leave it out for all; and let them negotiate once or more."
        raise InputError([Fault("dcmrta", "instances", "there is nothing to run", mend)])
    found = [dcmrta.instance(name) for name in names]
    attempts = negotiate_all(found, SETTING, negotiations, progress)
    return Comparison(
        tuple(
            Trial(
                instance=one.name,
                published=dict(one.published),
                greedy=one.replay(earliest_completion(one)).makespan,
                attempts=own,
            )
            for one, own in zip(found, attempts, strict=True)
        ),
        tuple(sorted({min(count, negotiations) for count in NEGOTIATIONS})),
    )


def earliest_completion(instance: Instance) -> list[list[int]]:
    """Return the routes of a central greedy, as task numbers for each robot.

    Of all tasks, each done by the robots that can be there first, the one that ends first is taken, again
    and again. Ties go to the smaller task number, and to robots of smaller numbers.
    """
    routes: list[list[int]] = [[] for _ in range(instance.robots)]
    free = [(0.0, instance.depot)] * instance.robots
    left = dict(enumerate(instance.work, 1))
    while left:
        offers = []
        for number, one in left.items():
            arrivals = sorted(
                (when + math.dist(where, one.place) / instance.speed, robot)
                for robot, (when, where) in enumerate(free)
            )[: one.robots]
            offers.append((arrivals[-1][0] + one.duration, number, [robot for _, robot in arrivals]))
        end, number, crew = min(offers)
        for robot in crew:
            free[robot] = (end, left[number].place)
            routes[robot].append(number)
        del left[number]
    return routes


def _ours(count: int) -> str:
    return "CBGA" if count == 1 else f"CBGA, best of {count}"


def _cells(row: Row) -> list[str]:
    shares = [f"{100.0 * share:+.1f} %" for share in (row.against_exact, row.against_best)]
    return [row.name, f"{row.makespan:.2f}", f"{row.longest:.2f}", *shares, str(row.shorter)]


def _introduction() -> str:
    score = SETTING.score
    return _INTRODUCTION.format(score=score, spread=SETTING.spread, seat=score.scarcity / 20)


_INTRODUCTION = """\
# Groups of one to five (the DCMRTA test set)

Twenty robots leave a depot, do fifty tasks that need one to five of them at once, and come back. What
counts is when the last one is back. The instances and the figures of four other methods are those of
"Dynamic Coalition Formation and Routing for Multirobot Task Allocation via Reinforcement Learning" (ICRA
2024): 25 of its 50 instances with 20 robots and 50 tasks.

This page is written by `swarmbid bench dcmrta --write docs/dcmrta.md`. Do not edit it.

## What is compared

**Ours** is CBGA with team rewards, everybody hears everybody. The depot is the base of every agent, a
task's seats are the robots that it needs. The benchmark counts the makespan, which is no sum of values; so
the agents bid by the score [`early_finish`](reference/names.md): a reward that fades from the start of the
mission on (time constant {score.time_constant:g}), more slowly for a task from which the way home is long
(`tail` {score.tail:g}: a second of head start for each second of it) and for one that needs many
(`scarcity` {score.scarcity:g}: {seat:g} for each of its robots). Tasks are appended to the path (`append`).
Which parts the score has and how tasks are inserted was tried out on these 25 instances; the numbers were
then chosen on random instances of the same kind.

- *CBGA*: **one negotiation**.
- *best of 8*: the team negotiates eight times and keeps the plan that ends the earliest. The first is the
  one above; in each later one, every task has a head start of its own, drawn from a normal distribution
  (standard deviation {spread:g}, seeds 1, 2, 3 and so on). When a team has agreed, everybody knows the
  whole plan and its makespan, so nobody is needed who chooses.
- *central greedy*: somebody who sees everything takes, again and again, the task that can end first, done
  by the robots that can be there first.
- *CTAS-D*: the authors' run of a mixed-integer program, 300 s for each instance. *OR-Tools*, *REINFORCE-IA*
  and *REINFORCE-LF* (learned policies) are their figures too. All four do all tasks in all instances.

Every plan is verified against the mission, and its routes are followed by a second program that knows the
benchmark's rules only; both must come to the same end. That program gives the published makespan for the
published CTAS-D routes of all 25 instances.
"""

_READING = """\
Times are in the benchmark's unit, in which a robot crosses the square in 5. One negotiation compares with
the central greedy; the best of eight is a small search, and is to be read as one."""
