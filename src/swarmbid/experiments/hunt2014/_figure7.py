"""Fig. 7: what task quitting and team rewards add to the score."""

from __future__ import annotations

from typing import TYPE_CHECKING

from swarmbid.experiments.hunt2014._cases import MODES, VARIANTS, Point
from swarmbid.experiments.hunt2014._curves import mean_and_spread
from swarmbid.experiments.hunt2014._paper import paper
from swarmbid.experiments.hunt2014._pictures import COLOURS, PAPER, legend_below, panels
from swarmbid.experiments.hunt2014._runs import Results
from swarmbid.experiments.hunt2014._stats import Level

if TYPE_CHECKING:
    from matplotlib.figure import Figure

AGENTS = 10
SHOWN = ("literal", "printed", "repaired")
NAMES = {"base": "neither", "quitting": "task quitting", "team": "team rewards", "both": "both"}


def points() -> list[Point]:
    """Return where runs are needed."""
    return [Point(variant, "fours", AGENTS, mode) for variant in SHOWN for mode in MODES]


def stated() -> dict[str, Level]:
    """Return what the paper states, by mode."""
    return {found.place["mode"]: found.level for found in paper().levels if found.figure == 7}


def draw(results: Results) -> Figure:
    """Draw means and standard deviations side by side."""
    drawn, (axes,) = panels(
        ["10 agents, 20 tasks, four agents a task: mean and standard deviation"], width=8.0
    )
    series = [("paper", PAPER, [stated()[mode] for mode in MODES])]
    for name, colour in zip(SHOWN, COLOURS, strict=False):
        found = [results.level(Point(name, "fours", AGENTS, mode), "score") for mode in MODES]
        series.append((VARIANTS[name].title, colour, found))
    handles = []
    for place, (title, colour, levels) in enumerate(series):
        at = [group + 0.17 * (place - 1.5) for group in range(len(MODES))]
        handles.append(
            axes.errorbar(
                at, [level.mean for level in levels], [level.sd for level in levels],
                color=colour, marker="o", markersize=5, linestyle="", capsize=4, label=title,
            )
        )  # fmt: skip
    axes.set_xticks(range(len(MODES)), [NAMES[mode] for mode in MODES])
    axes.grid(False, axis="x")
    axes.set_ylabel("total score")
    legend_below(drawn, handles)
    return drawn


def table(results: Results) -> tuple[list[str], list[list[str]]]:
    """Return headings and cells: scores, and how many runs settled and ended clean."""
    headings = ["", "paper"]
    for name in SHOWN:
        headings += [f"score, {name}", f"tasks, {name}", f"settled, {name}", f"clean, {name}"]
    rows = []
    for mode, level in stated().items():
        cells = [NAMES[mode], f"{level.mean:,.0f} ± {level.sd:,.0f}"]
        for name in SHOWN:
            at = Point(name, "fours", AGENTS, mode)
            cells += [mean_and_spread(results, at, "score"), mean_and_spread(results, at, "completed")]
            cells += [f"{100.0 * results.share(at, fact):.0f} %" for fact in ("settled", "clean")]
        rows.append(cells)
    return headings, rows
