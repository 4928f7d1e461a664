"""Figs. 5, 6, 8 and 10: three experiments over the number of agents."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from swarmbid.experiments.hunt2014._cases import EXPERIMENTS, VARIANTS, Point
from swarmbid.experiments.hunt2014._paper import paper
from swarmbid.experiments.hunt2014._pictures import COLOURS, PAPER, legend_below, panels
from swarmbid.experiments.hunt2014._runs import Results

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SHOWN = ("printed", "repaired")
"""The variants, a panel each."""
LINES = {
    5: ("single", "pairs", "mix"),
    6: ("single", "pairs", "mix"),
    8: ("kits_1", "kits_2", "kits_3"),
    10: ("pairs", "follow_2", "follow_3"),
}
"""Figure -> its experiments."""
IN_TURN = (5, 10)
"""Numbers of agents at which Fig. 5 is also run in turn: those that the paper states steps for."""
_TITLES = {(10, "pairs"): "#1: no follow-ups"}


def points(figure: int, sizes: Sequence[int]) -> list[Point]:
    """Return where runs are needed."""
    found = [
        Point(variant, experiment, agents, timed=figure == 6)
        for experiment in LINES[figure]
        for agents in sizes
        for variant in SHOWN
    ]
    if figure == 5:
        found += [
            Point(variant, experiment, agents, in_turn=True)
            for experiment in LINES[figure]
            for agents in IN_TURN
            for variant in SHOWN
        ]
    return found


def title_of(figure: int, experiment: str) -> str:
    """Return the name of a line in the legend of a figure."""
    return _TITLES.get((figure, experiment), EXPERIMENTS[experiment].title)


def draw(figure: int, results: Results, sizes: Sequence[int]) -> Figure:
    """Draw score and communication steps (Figs. 5, 8, 10)."""
    from matplotlib.lines import Line2D

    drawn, axes = panels([f"{VARIANTS[variant].title}" for variant in SHOWN])
    right: list[Any] = []
    for variant, left in zip(SHOWN, axes, strict=True):
        other: Any = left.twinx()
        other.grid(False)
        other.spines["top"].set_visible(False)
        right.append(other)
        for colour, experiment in zip(COLOURS, LINES[figure], strict=False):
            at = [Point(variant, experiment, agents) for agents in sizes]
            scores = [results.level(point, "score").mean for point in at]
            steps = [results.level(point, "steps").mean for point in at]
            left.plot(sizes, scores, color=colour, linewidth=1.6)
            other.plot(sizes, steps, color=colour, linestyle="", marker="x", markersize=5)
        for stated in paper().levels:
            if stated.figure == figure:
                colour = COLOURS[LINES[figure].index(stated.place["experiment"])]
                other.errorbar(
                    [stated.place["agents"]], [stated.level.mean], [stated.level.sd],
                    color=colour, marker="D", markersize=5, markeredgecolor=PAPER, linewidth=1.2, capsize=3,
                )  # fmt: skip
        left.set_xlabel("agents")
        left.set_ylabel("total score (lines)")
        other.set_ylabel("communication steps (×)")
        left.set_xticks(list(sizes))
        left.set_ylim(bottom=0.0)
    top = max(one.get_ylim()[1] for one in right)
    for one in right:
        one.set_ylim(0.0, top)
    handles = [
        Line2D([], [], color=colour, marker="x", label=title_of(figure, experiment))
        for colour, experiment in zip(COLOURS, LINES[figure], strict=False)
    ]
    if any(stated.figure == figure for stated in paper().levels):
        handles.append(
            Line2D(
                [], [], color="white", marker="D", markerfacecolor="white", markeredgecolor=PAPER,
                label="steps stated in the paper",
            )
        )  # fmt: skip
    legend_below(drawn, handles)
    return drawn


def draw_times(results: Results, sizes: Sequence[int]) -> Figure:
    """Draw computing times (Fig. 6)."""
    from matplotlib.lines import Line2D

    drawn, axes = panels([f"{VARIANTS[variant].title}" for variant in SHOWN])
    for variant, one in zip(SHOWN, axes, strict=True):
        for colour, experiment in zip(COLOURS, LINES[6], strict=False):
            at = [Point(variant, experiment, agents, timed=True) for agents in sizes]
            times = [1000.0 * results.level(point, "seconds").mean for point in at]
            one.plot(sizes, times, color=colour, linewidth=1.6, marker="o", markersize=3)
        one.set_yscale("log")
        one.set_xlabel("agents")
        one.set_ylabel("computing time of a run, all agents, ms")
        one.set_xticks(list(sizes))
    handles = [
        Line2D([], [], color=colour, marker="o", markersize=3, label=title_of(6, experiment))
        for colour, experiment in zip(COLOURS, LINES[6], strict=False)
    ]
    legend_below(drawn, handles)
    return drawn


def table(figure: int, results: Results, sizes: Sequence[int]) -> tuple[list[str], list[list[str]]]:
    """Return headings and cells: score, steps in several countings, and how many runs settled."""
    headings = ["experiment", "agents"]
    for variant in SHOWN:
        headings += [
            f"score, {variant}", f"steps, {variant}", f"own only, {variant}", f"links, {variant}",
            f"all sent, {variant}", f"settled, {variant}",
        ]  # fmt: skip
    rows = []
    for experiment in LINES[figure]:
        for agents in sizes:
            cells = [title_of(figure, experiment), str(agents)]
            for variant in SHOWN:
                at = Point(variant, experiment, agents)
                cells.append(mean_and_spread(results, at, "score"))
                cells += [mean_and_spread(results, at, name) for name in ("steps", "own", "links", "sent")]
                cells.append(f"{100.0 * results.share(at, 'settled'):.0f} %")
            rows.append(cells)
    return headings, rows


def table_in_turn(results: Results) -> tuple[list[str], list[list[str]]]:
    """Return headings and cells: broadcasts of own changes where agents act one after the other."""
    stated = {
        (one.place["experiment"], one.place["agents"]): f"{one.level.mean:,.0f} ± {one.level.sd:,.0f}"
        for one in paper().levels
        if one.measure == "steps"
    }
    rows = []
    for experiment in LINES[5]:
        for agents in IN_TURN:
            cells = [title_of(5, experiment), str(agents), stated.get((experiment, agents), "")]
            at = [Point(variant, experiment, agents, in_turn=True) for variant in SHOWN]
            rows.append(cells + [mean_and_spread(results, point, "own") for point in at])
    return ["experiment", "agents", "paper", *SHOWN], rows


def mean_and_spread(results: Results, point: Point, measure: str) -> str:
    """Return "24 ± 8", or a dash if no run counts."""
    level = results.level(point, measure)
    if level.count == 0:
        return "-"
    return f"{level.mean:,.0f} ± {level.sd:,.0f}" if level.count > 1 else f"{level.mean:,.0f}"


def table_of_times(results: Results, sizes: Sequence[int]) -> tuple[list[str], list[list[str]]]:
    """Return headings and cells: computing time as a multiple of that with one agent a task."""
    headings = ["experiment", "agents", *(f"{variant}, times" for variant in SHOWN)]
    rows = []
    for experiment in LINES[6][1:]:
        for agents in sizes:
            cells = [title_of(6, experiment), str(agents)]
            for variant in SHOWN:
                top = results.level(Point(variant, experiment, agents, timed=True), "seconds").mean
                bottom = results.level(Point(variant, "single", agents, timed=True), "seconds").mean
                cells.append(f"{top / bottom:.2f}")
            rows.append(cells)
    return headings, rows
