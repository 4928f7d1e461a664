"""Hunt et al. 2014, the paper of CBGA: every figure, as printed and repaired, beside what it reports.

The paper states 100 runs a point. Runs of one number share their missions over all experiments and
algorithms, every draw comes from a stream named after what it is for, and so the order in which runs are
carried out changes nothing. What the paper does not state is assumed or calibrated, and marked so; levels
of calibrated quantities prove nothing, so ratios and effect sizes are what is compared.

Source: `swarmbid/experiments/data/hunt2014.yaml`, the paper's statements as data.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

from swarmbid.errors import Fault, InputError
from swarmbid.experiments.hunt2014 import _curves, _figure3, _figure7, _paths
from swarmbid.experiments.hunt2014._cases import JUDGED, PATIENCE, PLAIN, VARIANTS, Point, algorithm_of
from swarmbid.experiments.hunt2014._paper import StatedEffect, StatedLevel, paper
from swarmbid.experiments.hunt2014._runs import Progress, Results, play_all
from swarmbid.experiments.hunt2014._stats import VERDICTS, Effect, Level, effect, verdict

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["FIGURES", "Finding", "Reproduction", "run"]

FIGURES = (3, 4, 5, 6, 7, 8, 9, 10, 11)
"""The figures with results; 1 and 2 are the algorithms."""
RUNS = 100
QUICK_RUNS = 5
TIMED_RUNS = 20
"""Most runs of which the computing time is measured."""
SIZES = tuple(range(1, 11))
QUICK_SIZES = (1, 2, 5, 10)
"""Numbers of agents; the second has those that the paper's statements are about."""
COMPARED = ("printed", "repaired")
TIMES = 6
"""The figure whose numbers depend on the machine."""


@dataclass(frozen=True)
class Finding:
    """One statement of the paper, and what became of it by one algorithm.

    Parameters
    ----------
    variant : a key of `_cases.VARIANTS`. verdict : a key of `_stats.VERDICTS`.
    """

    stated: StatedEffect
    variant: str
    effect: Effect
    verdict: str


@dataclass(frozen=True)
class Reproduction:
    """All runs, and what follows from them.

    Parameters
    ----------
    figures : their numbers. sizes : numbers of agents. runs : a point. seed : of all of it.
    """

    figures: tuple[int, ...]
    sizes: tuple[int, ...]
    runs: int
    seed: int
    results: Results

    def findings(self) -> list[Finding]:
        """Every statement of the chosen figures, for each algorithm that was run for it."""
        return [
            self._finding(stated, variant)
            for stated in paper().effects
            if stated.figure in self.figures
            for variant in VARIANTS
            if all(point in self.results.runs for point in stated.sides(variant))
        ]

    def levels(self) -> list[tuple[StatedLevel, str, Level]]:
        """Every mean that the paper states, with ours by each algorithm that was run for it."""
        return [
            (stated, variant, self.results.level(stated.at(variant), stated.measure))
            for stated in paper().levels
            if stated.figure in self.figures
            for variant in VARIANTS
            if stated.at(variant) in self.results.runs
        ]

    def problems(self) -> list[str]:
        """What must not be: a run of an algorithm of ours that did not settle, or in an unsound plan."""
        found = []
        for point in self.results.runs:
            if VARIANTS[point.variant].algorithm != "cbga" and algorithm_of(point)[0] != PLAIN.algorithm:
                continue
            where = f"{point.variant}, {point.experiment}, {point.agents} agents, {point.mode}"
            for fact, words in (
                ("settled", "did not agree"),
                ("sound", "ended in a plan that breaks a rule"),
            ):
                share = self.results.share(point, fact)
                if share < 1.0:
                    found.append(f"{where}: {100.0 * (1.0 - share):.0f} % of the runs {words}")
        return found

    def drawings(self) -> dict[int, Figure]:
        """Draw the chosen figures."""
        from swarmbid.experiments.hunt2014._pictures import styled

        with styled():
            return {figure: self._draw(figure) for figure in self.figures}

    def pictures(self) -> dict[str, str]:
        """File name -> SVG, of the chosen figures."""
        from swarmbid.experiments.hunt2014._pictures import as_svg

        return {f"hunt2014-{figure}.svg": as_svg(drawn) for figure, drawn in self.drawings().items()}

    def table(self, *, every_instance: bool = False) -> tuple[list[str], list[list[str]]]:
        """Return headings and cells, ready to print: a line for each statement.

        Parameters
        ----------
        every_instance : by the literal reading, too.
        """
        from swarmbid.experiments.hunt2014._page import effect_rows

        return effect_rows(self.findings(), list(VARIANTS) if every_instance else COMPARED, figure=True)

    def level_table(self) -> tuple[list[str], list[list[str]]]:
        """Return headings and cells: a line for each mean that the paper states."""
        from swarmbid.experiments.hunt2014._page import level_rows

        levels = self.levels()
        return level_rows(levels, [name for name in VARIANTS if any(one[1] == name for one in levels)])

    def figure_table(self, figure: int) -> tuple[list[str], list[list[str]]]:
        """Return headings and cells: the numbers of one figure; no rows for paths."""
        if figure == 3:
            return _figure3.table(self.results)
        if figure == 7:
            return _figure7.table(self.results)
        if figure == TIMES:
            return _curves.table_of_times(self.results, self.sizes)
        if figure in _curves.LINES:
            return _curves.table(figure, self.results, self.sizes)
        return [], []

    def summary(self) -> str:
        """How many statements hold, in a sentence for each algorithm."""
        parts = []
        for variant in COMPARED:
            count = Counter(one.verdict for one in self.findings() if one.variant == variant)
            total = sum(count.values())
            said = ", ".join(f"{count[word]} {word}" for word in VERDICTS if count[word])
            if total:
                parts.append(f"{VARIANTS[variant].title}: of {total} comparisons {said}.")
        runs = f"{self.runs} run{'' if self.runs == 1 else 's'} a point."
        return " ".join([*parts, runs]) if parts else f"No comparison in these figures; {runs}"

    def page(self) -> str:
        """The page of the documentation, in Markdown; its pictures are in ``images/`` beside it."""
        from swarmbid.experiments.hunt2014._page import page

        return page(self)

    def to_dict(self) -> dict[str, Any]:
        """Everything but single runs, JSON-ready."""
        return {
            "experiment": "hunt2014",
            "seed": self.seed,
            "runs": self.runs,
            "agents": list(self.sizes),
            "figures": list(self.figures),
            "patience": PATIENCE,
            "algorithms": {
                name: {"title": one.title, "algorithm": one.algorithm, "options": dict(one.options)}
                for name, one in VARIANTS.items()
            },
            "effects": [_effect_data(one) for one in self.findings()],
            "levels": [
                {
                    "id": stated.name, "figure": stated.figure, "what": stated.what, "variant": variant,
                    "stated": asdict(stated.level), "found": _clean(asdict(level)),
                }
                for stated, variant, level in self.levels()
            ],
            "points": [self._point_data(point) for point in sorted(self.results.runs)],
            "summary": self.summary(),
            "problems": self.problems(),
        }  # fmt: skip

    def _finding(self, stated: StatedEffect, variant: str) -> Finding:
        of, against = stated.sides(variant)
        found = effect(
            self.results.sample(of, stated.measure), self.results.sample(against, stated.measure),
            self.seed, stated.name, variant,
        )  # fmt: skip
        word = verdict(found, stated.says, stated.p, stated.stated, stated.within)
        return Finding(stated, variant, found, word)

    def _draw(self, figure: int) -> Figure:
        if figure == 3:
            return _figure3.draw(self.results)
        if figure == 7:
            return _figure7.draw(self.results)
        if figure == TIMES:
            return _curves.draw_times(self.results, self.sizes)
        if figure in _curves.LINES:
            return _curves.draw(figure, self.results, self.sizes)
        return _paths.draw(figure, self.seed)

    def _point_data(self, point: Point) -> dict[str, Any]:
        measures = (
            ("seconds",) if point.timed else ("score", "completed", "steps", "own", "sent", "rounds", "bytes")
        )
        return {
            **asdict(point),
            "runs": len(self.results.runs[point]),
            "settled": self.results.share(point, "settled"),
            "sound": self.results.share(point, "sound"),
            "clean": self.results.share(point, "clean") if point.experiment == JUDGED else None,
            **{name: _clean(asdict(self.results.level(point, name))) for name in measures},
        }


def run(
    *,
    quick: bool = False,
    figures: Sequence[int] | None = None,
    runs: int | None = None,
    seed: int = 0,
    workers: int | None = None,
    progress: Progress | None = None,
) -> Reproduction:
    """Run the paper's experiments.

    Parameters
    ----------
    quick : a few runs, at a few numbers of agents.
    figures : which; all by default. runs : a point, if not the paper's 100.
    seed : same seed, same numbers, computing times apart.
    workers : processes; as many as there are processors by default, 1 to stay in this one.
    progress : called with how many runs are done, and how many there are.

    Raises
    ------
    InputError : a figure that is not one of `FIGURES`, or no runs.
    """
    chosen = tuple(dict.fromkeys(figures)) if figures else FIGURES
    faults = [
        Fault("hunt2014", "figure", f"is {figure}", f"Choose some of {', '.join(map(str, FIGURES))}.")
        for figure in chosen
        if figure not in FIGURES
    ]
    number = runs if runs is not None else QUICK_RUNS if quick else RUNS
    if number < 1:
        faults.append(Fault("hunt2014", "runs", f"is {number}", "Give 1 or more."))
    if faults:
        raise InputError(faults)
    sizes = QUICK_SIZES if quick else SIZES
    counts = {
        point: min(number, TIMED_RUNS) if point.timed else number
        for figure in chosen
        for point in points(figure, sizes)
    }
    results = play_all(counts, seed=seed, workers=workers, progress=progress)
    return Reproduction(chosen, sizes, number, seed, results)


def points(figure: int, sizes: Iterable[int]) -> list[Point]:
    """Return where a figure needs runs; none for paths, which are drawn from single runs."""
    if figure == 3:
        return _figure3.points()
    if figure == 7:
        return _figure7.points()
    return _curves.points(figure, list(sizes)) if figure in _curves.LINES else []


def _effect_data(found: Finding) -> dict[str, Any]:
    stated = found.stated
    return {
        "id": stated.name,
        "figure": stated.figure,
        "what": stated.what,
        "says": stated.says,
        "p_threshold": stated.p,
        "source": stated.source,
        "variant": found.variant,
        "stated": None if stated.stated is None else asdict(stated.stated),
        "found": _clean(asdict(found.effect)),
        "verdict": found.verdict,
    }


def _clean(numbers: Mapping[str, Any]) -> dict[str, Any]:
    """JSON knows no nan."""
    return {name: None if value != value else value for name, value in numbers.items()}
