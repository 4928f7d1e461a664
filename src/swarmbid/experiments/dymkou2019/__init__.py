"""Dymkou's slides: the paths of a run in x, y and time, and UAVs that divide locations among themselves.

The slides ("Distributed tasking problem for track and search") show two results as pictures and state no
numbers, so there is nothing to compare ours with: what is reproduced is the setting, from the author's
public sample code (see `swarmbid.scenarios.dymkou2019`), and what is judged is judged against the exact
optimum and against the rules.

- Figure 1, "Simulation": one run of the sample's setting, each agent's path in x, y and time, the windows
  of the tasks as vertical bars.
- Figure 2, self-assignment: 7 UAVs, 7 locations, one each; over many missions, by each algorithm.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

from swarmbid.errors import Fault, InputError
from swarmbid.experiments.dymkou2019._runs import ALGORITHMS, Assigned, assign, fly

if TYPE_CHECKING:
    from swarmbid.simulator import Run

__all__ = ["FIGURES", "Reproduction", "run"]

FIGURES = (1, 2)
RUNS, QUICK_RUNS = 100, 5
_HEADINGS = ["Algorithm", "Optimal", "Mean share of optimum", "Least share", "Conflict-free", "Rounds",
             "Messages", "kB"]  # fmt: skip


@dataclass(frozen=True)
class Reproduction:
    """All runs, and what follows from them.

    Parameters
    ----------
    figures : their numbers. runs : missions of figure 2. seed : of all of it.
    flown : the run of figure 1; None without it.
    assigned : algorithm -> what became of each mission of figure 2.
    """

    figures: tuple[int, ...]
    runs: int
    seed: int
    flown: Run | None
    assigned: dict[str, list[Assigned]]

    def problems(self) -> list[str]:
        """What must not be: a run that did not settle, a location with two UAVs, more than the optimum."""
        found = []
        if self.flown is not None and not self.flown.converged:
            found.append("figure 1: the agents did not agree")
        for name, outcomes in self.assigned.items():
            for words, count in (
                ("did not agree", sum(not one.settled for one in outcomes)),
                ("gave a location to two or to none", sum(not one.conflict_free for one in outcomes)),
                ("scored above the optimum", sum(one.share > 1.0 + 1e-9 for one in outcomes)),
            ):
                if count:
                    found.append(f"{name}: {count} of {len(outcomes)} runs {words}")
        return found

    def table(self) -> tuple[list[str], list[list[str]]]:
        """Return headings and cells, ready to print: a line for each algorithm of figure 2."""
        rows = []
        for name, outcomes in self.assigned.items():
            count = len(outcomes)
            shares = [one.share for one in outcomes]
            rows.append(
                [
                    name,
                    f"{sum(share > 1.0 - 1e-9 for share in shares)} of {count}",
                    f"{sum(shares) / count:.4f}",
                    f"{min(shares):.4f}",
                    f"{sum(one.conflict_free for one in outcomes)} of {count}",
                    f"{sum(one.rounds for one in outcomes) / count:.1f}",
                    f"{sum(one.messages for one in outcomes) / count:.1f}",
                    f"{sum(one.bytes for one in outcomes) / count / 1000.0:.1f}",
                ]
            )
        return list(_HEADINGS), rows

    def level_table(self) -> tuple[list[str], list[list[str]]]:
        """No means are stated."""
        return [], []

    def figure_table(self, figure: int) -> tuple[list[str], list[list[str]]]:
        """Return headings and cells: the visits of figure 1; figure 2 is in `table`."""
        if figure != 1 or self.flown is None:
            return [], []
        rows = [
            [plan.agent, visit.task, f"{visit.arrival:.1f}", f"{visit.start:.1f}", f"{visit.end:.1f}",
             f"{visit.score:.1f}"]
            for plan in self.flown.plan.agents
            for visit in plan.visits
        ]  # fmt: skip
        return ["Agent", "Task", "Arrives, s", "Starts, s", "Ends, s", "Score"], rows

    def summary(self) -> str:
        """What came of it, in a few sentences."""
        parts = ["The slides state no numbers; these are ours."]
        if self.flown is not None:
            visits = sum(len(plan.visits) for plan in self.flown.plan.agents)
            total = len(self.flown.mission.tasks)
            parts.append(f"Simulation: {visits} of {total} tasks served after {self.flown.rounds} rounds.")
        for name, outcomes in self.assigned.items():
            best = sum(one.share > 1.0 - 1e-9 for one in outcomes)
            mean = sum(one.share for one in outcomes) / len(outcomes)
            parts.append(f"{name}: optimal in {best} of {len(outcomes)}, {100.0 * mean:.1f} % on average.")
        return " ".join(parts)

    def pictures(self) -> dict[str, str]:
        """File name -> SVG, of the chosen figures."""
        from swarmbid.experiments.dymkou2019._pictures import pictures

        return pictures(self.flown, self.assigned)

    def page(self) -> str:
        """The page of the documentation, in Markdown; its pictures are in ``images/`` beside it."""
        from swarmbid.experiments.dymkou2019._page import page

        return page(self)

    def to_dict(self) -> dict[str, Any]:
        """Everything but missions, JSON-ready."""
        return {
            "experiment": "dymkou2019",
            "seed": self.seed,
            "runs": self.runs,
            "figures": list(self.figures),
            "simulation": None if self.flown is None else self.flown.plan.to_dict(),
            "self_assignment": {
                name: [asdict(one) for one in outcomes] for name, outcomes in self.assigned.items()
            },
            "summary": self.summary(),
            "problems": self.problems(),
        }


def run(
    *,
    quick: bool = False,
    figures: Sequence[int] | None = None,
    runs: int | None = None,
    seed: int = 0,
    progress: Callable[[int, int], None] | None = None,
) -> Reproduction:
    """Run both figures.

    Parameters
    ----------
    quick : 5 missions of figure 2 rather than 100.
    figures : which; all by default. runs : missions of figure 2. seed : same seed, same numbers.
    progress : called with how many runs are done, and how many there are.

    Raises
    ------
    InputError : a figure that is not one of `FIGURES`, or no runs.
    """
    chosen = tuple(dict.fromkeys(figures)) if figures else FIGURES
    faults = [
        Fault("dymkou2019", "figure", f"is {figure}", f"Choose some of {', '.join(map(str, FIGURES))}.")
        for figure in chosen
        if figure not in FIGURES
    ]
    number = runs if runs is not None else QUICK_RUNS if quick else RUNS
    if number < 1:
        faults.append(Fault("dymkou2019", "runs", f"is {number}", "Give 1 or more."))
    if faults:
        raise InputError(faults)
    assigned: dict[str, list[Assigned]] = {name: [] for name in ALGORITHMS} if 2 in chosen else {}
    for mission in range(number if assigned else 0):
        for name, outcome in assign(seed + mission).items():
            assigned[name].append(outcome)
        if progress is not None:
            progress(mission + 1, number)
    return Reproduction(chosen, number, seed, fly(seed) if 1 in chosen else None, assigned)
