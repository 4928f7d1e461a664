"""CBBA on team orienteering with time windows: how far from the best known results.

Every one of the 37 public instances with 1 to 4 vehicles, one agent per vehicle, all within hearing of
each other. Nothing is tuned. Each plan is verified, and each run has to end in agreement.

Source: the instances and yardsticks of `swarmbid.datasets.toptw`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from swarmbid.datasets import toptw
from swarmbid.errors import Fault, InputError
from swarmbid.scores import Score, make_score
from swarmbid.simulator import simulate
from swarmbid.verify import verify

VEHICLES = (1, 2, 3, 4)
FAMILIES = ("c1", "c2", "r1", "r2", "rc1", "rc2", "pr")
ALGORITHM = "cbba"
INSERTION = "shift"
SCORES: dict[str, Score] = {
    "time_window": make_score("time_window"),
    "distance_cost": make_score("distance_cost", metre_cost=1.0, second_cost=0.0),
}
"""What the agents bid by. The first is the benchmark's own objective, the reward alone; the second takes
off a metre's cost. Both are judged by the reward that they collect."""
HEADLINE, SECOND = SCORES

Progress = Callable[[int, int], None]


@dataclass(frozen=True)
class Trial:
    """One instance with one number of vehicles, planned by one score.

    Parameters
    ----------
    score : what the agents bid by, a key of `SCORES`.
    reward : collected. best, leuven_mean : the yardsticks (`toptw.Known`), in the same units.
    served : tasks served. rounds : until all agreed.
    converged : whether they did. violations : what `verify` found, normally nothing.
    """

    instance: str
    vehicles: int
    score: str
    reward: float
    best: float
    leuven_mean: float
    served: int
    rounds: int
    converged: bool
    violations: tuple[str, ...]

    @property
    def gap(self) -> float:
        """Share of the best known reward that is missing."""
        return 1.0 - self.reward / self.best

    @property
    def leuven_gap(self) -> float:
        """The same of KU Leuven's mean of ten runs."""
        return 1.0 - self.leuven_mean / self.best


@dataclass(frozen=True)
class Row:
    """One line of the table: a family, or an instance, with one number of vehicles.

    Parameters
    ----------
    name : of the family or the instance. instances : how many there are in it.
    served : tasks, the mean over them. reward, best : means, in units of reward.
    gap, worst_gap, leuven_gap : shares of the best known reward; means, but for the worst.
    second_gap : mean when the agents bid by `SECOND`.
    verified, converged : whether all were.
    """

    name: str
    vehicles: int
    instances: int
    served: float
    reward: float
    best: float
    gap: float
    worst_gap: float
    leuven_gap: float
    second_gap: float
    verified: bool
    converged: bool


@dataclass(frozen=True)
class Comparison:
    """All trials, and the tables made of them.

    Examples
    --------
    >>> comparison = run(instances=["c101"], vehicles=[1])
    >>> [round(100 * row.gap, 1) for row in comparison.by_instance()]
    [6.2]
    """

    trials: tuple[Trial, ...]

    def by_family(self) -> list[Row]:
        """One row for each family and number of vehicles."""
        return self._rows(family, FAMILIES)

    def by_instance(self) -> list[Row]:
        """One row for each instance and number of vehicles."""
        names = list(dict.fromkeys(trial.instance for trial in self.trials))
        return self._rows(str, names)

    def overall(self) -> Row:
        """All of them in one row; `vehicles` is 0."""
        return _row("all", 0, self.trials)

    def _rows(self, name_of: Callable[[str], str], names: Iterable[str]) -> list[Row]:
        found = []
        for name in names:
            for vehicles in VEHICLES:
                trials = [
                    trial
                    for trial in self.trials
                    if trial.vehicles == vehicles and name_of(trial.instance) == name
                ]
                if trials:
                    found.append(_row(name, vehicles, trials))
        return found

    def problems(self) -> list[str]:
        """What went wrong, in sentences: a run without agreement, a plan that cannot be executed."""
        found = []
        for trial in self.trials:
            where = f"{trial.instance} with {trial.vehicles} vehicles by {trial.score}"
            if not trial.converged:
                found.append(f"{where}: the agents did not agree")
            found += [f"{where}: {violation}" for violation in trial.violations]
        return found

    def to_dict(self) -> dict[str, Any]:
        """Everything, JSON-ready."""
        return {
            "experiment": "toptw",
            "algorithm": ALGORITHM,
            "insertion": INSERTION,
            "scores": {name: {"name": score.name, **score.options} for name, score in SCORES.items()},
            "families": [asdict(row) for row in self.by_family()],
            "overall": asdict(self.overall()),
            "trials": [{**asdict(trial), "gap": trial.gap} for trial in self.trials],
            "problems": self.problems(),
        }

    def table(self, *, every_instance: bool = False) -> tuple[list[str], list[list[str]]]:
        """Return headings and cells, ready to print.

        Parameters
        ----------
        every_instance : a row for each instance instead of each family.
        """
        rows = self.by_instance() if every_instance else self.by_family()
        columns = [name for name in COLUMNS if not (every_instance and name in FAMILY_ONLY)]
        headings = ["instance" if every_instance else "family", *columns]
        cells = [_cells(row) for row in [*rows, self.overall()]]
        return headings, [[found[name] for name in ("name", *columns)] for found in cells]

    def summary(self) -> str:
        """The result in one sentence."""
        row = self.overall()
        checked = "every plan verified" if row.verified else "NOT every plan verified"
        agreed = "every run agreed" if row.converged else "NOT every run agreed"
        return (
            f"Plain {ALGORITHM.upper()} collects {100 * row.gap:.1f} % less than the best known on average "
            f"over {row.instances} cases (worst {100 * row.worst_gap:.1f} %); {checked}, {agreed}."
        )

    def page(self) -> str:
        """The page of the documentation, in Markdown."""
        parts = [_INTRODUCTION, self.summary(), "", "## By family", "", *_markdown(*self.table())]
        parts += ["", _READING, "", "## Every instance", ""]
        parts += _markdown(*self.table(every_instance=True))
        return "\n".join(parts) + "\n"


COLUMNS = (
    "vehicles",
    "instances",
    "served",
    "reward",
    "best known",
    "gap",
    "worst gap",
    "KU Leuven's gap",
    "gap, metres paid",
    "verified",
    "agreed",
)
FAMILY_ONLY = ("instances", "worst gap")


def run(
    *,
    quick: bool = False,
    instances: Sequence[str] | None = None,
    vehicles: Sequence[int] = VEHICLES,
    progress: Progress | None = None,
) -> Comparison:
    """Let CBBA plan every instance, and compare.

    Parameters
    ----------
    quick : the first instance of each family only.
    instances : which ones; all by default. vehicles : which sizes of the fleet, out of 1 to 4.
    progress : called with how many cases are done, and how many there are.

    Raises
    ------
    InputError : an unknown instance, or a size of the fleet without published results.
    """
    chosen = list(instances) if instances is not None else toptw.instances()
    if quick:
        firsts: dict[str, str] = {}
        for name in chosen:
            firsts.setdefault(family(name), name)
        chosen = list(firsts.values())
    cases = [(name, size) for name in chosen for size in vehicles]
    if not cases:
        raise InputError([Fault("toptw", "instances", "are none", "Name one, or leave it out for all.")])
    trials = []
    for done, (name, size) in enumerate(cases, 1):
        trials += [trial(name, size, score) for score in SCORES]
        if progress is not None:
            progress(done, len(cases))
    return Comparison(tuple(trials))


def trial(instance: str, vehicles: int, score: str) -> Trial:
    """Plan one instance and check the plan.

    Parameters
    ----------
    score : a key of `SCORES`.
    """
    known = toptw.known(instance, vehicles)
    mission = toptw.load(instance, vehicles)
    result = simulate(mission, algorithm=ALGORITHM, score=SCORES[score], insertion=INSERTION)
    plan = result.plan
    rewards = {task.id: task.reward for task in mission.tasks}
    visited = [visit.task for agent in plan.agents for visit in agent.visits]
    return Trial(
        instance=instance,
        vehicles=vehicles,
        score=score,
        reward=math.fsum(rewards[task] for task in visited),
        best=known.best,
        leuven_mean=known.leuven_mean,
        served=len(visited),
        rounds=result.rounds,
        converged=result.converged,
        violations=tuple(str(violation) for violation in verify(mission, plan, SCORES[score])),
    )


def family(instance: str) -> str:
    """Return the family of an instance: ``"c1"`` of ``"c101"``, ``"pr"`` of ``"pr11"``."""
    return next(name for name in FAMILIES if instance.startswith(name))


def _row(name: str, vehicles: int, trials: Sequence[Trial]) -> Row:
    first = [trial for trial in trials if trial.score == HEADLINE]
    second = [trial for trial in trials if trial.score == SECOND]
    return Row(
        name=name,
        vehicles=vehicles,
        instances=len(first),
        served=_mean(trial.served for trial in first),
        reward=_mean(trial.reward for trial in first),
        best=_mean(trial.best for trial in first),
        gap=_mean(trial.gap for trial in first),
        worst_gap=max(trial.gap for trial in first),
        leuven_gap=_mean(trial.leuven_gap for trial in first),
        second_gap=_mean(trial.gap for trial in second),
        verified=not any(trial.violations for trial in trials),
        converged=all(trial.converged for trial in trials),
    )


def _mean(values: Iterable[float]) -> float:
    listed = list(values)
    return math.fsum(listed) / len(listed)


def _cells(row: Row) -> dict[str, str]:
    """One printed line, by column; see `COLUMNS`."""
    shares = (row.gap, row.worst_gap, row.leuven_gap, row.second_gap)
    places = 1 if row.instances > 1 else 0  # the means of several have a fraction
    numbers = [f"{value:.{places}f}" for value in (row.served, row.reward, row.best)]
    numbers += [f"{100.0 * share:.1f} %" for share in shares]
    checks = ["yes" if good else "NO" for good in (row.verified, row.converged)]
    cells = [str(row.vehicles or "1-4"), str(row.instances), *numbers, *checks]
    return {"name": row.name, **dict(zip(COLUMNS, cells, strict=True))}


def _markdown(headings: list[str], rows: list[list[str]]) -> list[str]:
    rule = ["---", *["---:"] * (len(headings) - 3), "---", "---"]
    return ["| " + " | ".join(cells) + " |" for cells in (headings, rule, *rows)]


_INTRODUCTION = """\
# Team orienteering with time windows (TOPTW)

A fleet leaves a depot, collects rewards that open and close, and is back before the horizon. It is the
closest public benchmark to a team that divides its work: 37 instances, each for 1 to 4 vehicles, with
results that others have published.

This page is written by `swarmbid bench toptw --write docs/toptw.md`. Do not edit it.

## What is compared

**Ours** is plain CBBA: one agent per vehicle, everybody hears everybody, later visits may slip when a task
is inserted (`shift`), nothing tuned, no search afterwards. An agent adds what gains most where it fits
best, and never exchanges two tasks or changes their order. Every plan is verified against the mission
alone: windows, travel, return before the horizon, no task twice. The agents bid by the benchmark's own
objective, the reward alone (score `time_window`). In the column "gap, metres paid" they bid by the reward
less the metres flown (score `distance_cost`, one unit a metre, no cost of time); what counts is again the
reward collected.

**The yardsticks** come from central planners that see everything and search, so a gap is the price of an
auction *and* of not searching:

- *best known*: the largest value with a route that passes an independent checker, or the published value if
  that is larger. Values published since may be slightly larger, mostly on large pr instances.
- *KU Leuven's gap*: that of the mean of KU Leuven's ten runs (their results workbook, 2010).

A gap is the share of the best known reward that is missing. Gaps, rewards and tasks served are means over
the instances of a family; the worst gap is that of one instance.
"""

_READING = """\
By the reward alone, the richest task that fits is taken first however far it lies, and the way there uses
up the horizon. That costs little where the fleet can serve nearly everything (c2, r2 and rc2 with 4
vehicles), and much elsewhere. When metres are paid, agents choose near tasks. That is better on r1, and on
rc1 with one or two vehicles; elsewhere it is worse: a task whose reward does not pay for the metres to it
is not bid on, so vehicles go home with time left."""
