"""The page of the documentation, and the tables that the command line prints."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

from swarmbid.experiments.hunt2014 import _curves, _paths
from swarmbid.experiments.hunt2014._cases import VARIANTS, Point
from swarmbid.experiments.hunt2014._paper import StatedEffect, StatedLevel, paper
from swarmbid.experiments.hunt2014._stats import VERDICTS, Effect, Level

if TYPE_CHECKING:
    from swarmbid.experiments.hunt2014 import Finding, Reproduction

MOST = 10.0
"""Differences of more pooled standard deviations are not told apart: the samples hardly spread."""
Table = tuple[list[str], list[list[str]]]


def page(found: Reproduction) -> str:
    """Write the page."""
    sizes = f"{found.sizes[0]} to {found.sizes[-1]}"
    parts = [_INTRODUCTION, f"20 tasks, {sizes} agents, {found.runs} runs a point, seed {found.seed}.", ""]
    parts += [*_settings(), _COUNTING]
    steady = [one for one in found.findings() if one.stated.measure != "seconds"]
    parts += [
        "## In short", "", found.summary(), "",
        *markdown(*effect_rows(steady, _variants(steady))), "", _VERDICTS_HEAD,
        *(f"- *{word}*: {meaning}." for word, meaning in VERDICTS.items()), "",
    ]  # fmt: skip
    if found.levels():
        parts += [_LEVELS, *markdown(*level_rows(found.levels(), tuple(VARIANTS))), ""]
    for figure in found.figures:
        parts += ["", f"## Figure {figure}", "", *_figure(found, figure)]
    return "\n".join(parts).rstrip() + "\n"


def effect_rows(findings: Sequence[Finding], variants: Sequence[str], *, figure: bool = False) -> Table:
    """Return headings and cells: a line for each statement.

    Parameters
    ----------
    figure : whether the figure's number has a column (otherwise it stands with the words).
    """
    headings = ["figure"] if figure else []
    headings += ["what", "paper"]
    for variant in variants:
        headings += [variant, "verdict"]
    rows = []
    statements = {one.stated.name: one.stated for one in findings}
    for name, stated in statements.items():
        cells = [str(stated.figure)] if figure else []
        cells += [stated.what if figure else f"{stated.what} (Fig. {stated.figure})", _says(stated)]
        for variant in variants:
            one = next((x for x in findings if x.stated.name == name and x.variant == variant), None)
            cells += ["", ""] if one is None else [_shown(one.effect), one.verdict]
        rows.append(cells)
    return headings, rows


def level_rows(levels: Sequence[tuple[StatedLevel, str, Level]], variants: Sequence[str]) -> Table:
    """Return headings and cells: a line for each mean that the paper states."""
    rows = []
    for stated in dict.fromkeys(level[0].name for level in levels):
        mine = {variant: (one, level) for one, variant, level in levels if one.name == stated}
        first = next(iter(mine.values()))[0]
        cells = [str(first.figure), first.what, f"{first.level.mean:,.0f} ± {first.level.sd:,.0f}"]
        for variant in variants:
            level = mine[variant][1] if variant in mine else Level(math.nan, math.nan, 0)
            cells.append(f"{level.mean:,.0f} ± {level.sd:,.0f}" if level.count > 1 else "")
        rows.append(cells)
    return ["figure", "what", "paper", *variants], rows


def markdown(headings: Sequence[str], rows: Iterable[Sequence[str]]) -> list[str]:
    """Return a table in Markdown."""
    rule = ["---"] * len(headings)
    return ["| " + " | ".join(cells) + " |" for cells in (headings, rule, *rows)]


def _variants(findings: Sequence[Finding]) -> list[str]:
    return [name for name in VARIANTS if any(one.variant == name for one in findings)]


def _says(stated: StatedEffect) -> str:
    if stated.stated is None:
        return stated.says if stated.says != "similar" else f"similar, within {stated.within:g}"
    return (
        f"{_shown(stated.stated)}, stated p < {stated.p:g}"
        if stated.source == "text"
        else _shown(stated.stated)
    )


def _shown(one: Effect) -> str:
    """0.42 (0.39 to 0.45), d = -2.4, p < 0.001."""
    if math.isnan(one.ratio):
        return "-"
    p = "p < 0.001" if one.p < 0.001 else f"p = {one.p:.3f}"
    beyond = f"{'>' if one.size > 0.0 else '<'} {math.copysign(MOST, one.size):+.0f}"
    size = f", d {beyond}" if abs(one.size) > MOST else f", d = {one.size:+.1f}"
    size = "" if math.isnan(one.size) else size
    return f"{one.ratio:.2f} ({one.low:.2f} to {one.high:.2f}){size}, {p}"


def _settings() -> list[str]:
    rows = [[item["what"], item["taken"], item["why"]] for item in paper().settings]
    return [
        "## What the paper leaves open",
        "",
        _SETTINGS,
        *markdown(["what", "taken", "how sure"], rows),
        "",
    ]


def _figure(found: Reproduction, figure: int) -> list[str]:
    lines = [f"![Figure {figure}](images/hunt2014-{figure}.svg)", ""]
    if figure in paper().statements:
        lines += [f"> {paper().statements[figure]}", ""]
    lines += [_FIGURES[figure], ""]
    if figure == 6:
        times = [one for one in found.findings() if one.stated.figure == 6]
        lines += [*markdown(*effect_rows(times, _variants(times))), ""]
    headings, rows = found.figure_table(figure)
    if rows:
        lines += markdown(headings, rows)
        if figure == 5:
            lines += ["", _IN_TURN, *markdown(*_curves.table_in_turn(found.results))]
        return lines
    if figure == 4:
        return lines + _together(found)
    point = _paths.RUNS[figure]
    return [*lines, f"Run 0 of seed {found.seed}: {point.agents} agents, {point.tasks} tasks."]


def _together(found: Reproduction) -> list[str]:
    """How often groups stay together, if Fig. 5 was run too."""
    rows = []
    for agents in found.sizes:
        cells = [str(agents)]
        for variant in _curves.SHOWN:
            level = found.results.level(Point(variant, "pairs", agents), "together")
            cells.append("-" if level.count == 0 else f"{100.0 * level.mean:.0f} %")
        if agents > 2 and cells[1:] != ["-"] * len(_curves.SHOWN):
            rows.append(cells)
    if not rows:
        return []
    return [_TOGETHER, *markdown(["agents", *_curves.SHOWN], rows)]


_INTRODUCTION = """\
# The paper of CBGA, reproduced

Hunt, Meng, Hinde and Huang (2014) extend CBBA to tasks that require several agents, equipment and
prerequisites. Every figure with results is run again here, the algorithm as printed and as repaired side by
side.

This page is written by `swarmbid reproduce hunt2014 --write docs/hunt2014.md`. Do not edit it.

- **literal** is `cbga_printed` with Algorithms 1 and 2 to the letter. It is shown in Fig. 7 only.
- **printed** is `cbga_printed` in the charitable reading: where the print contradicts the text around it, the
  text is followed. Two things are added that the paper does not have, without which it seldom ends in a state
  worth comparing: bids are warped, and tasks that waiting for others has made too late are released.
- **repaired** is `cbga`, the default of this package: owned records and one referee.
  [Why CBGA settles](explanation/cbga.md) tells more. Half of the incomplete groups are dissolved at a
  time where task quitting is on. Tasks for one agent are given to `cbba`, as in the paper.

Only seats of completed tasks are paid, whatever state a run ends in. The paper's plots are not available to
us as numbers: what is compared is what its text states, and nothing is read off a plot.
"""

_SETTINGS = """\
These are not in the paper. The level of a score depends on them, so an equal level says nothing: many
rooms, speeds and windows reach the same. Ratios and effect sizes are less sensitive, and they are what the
verdicts are about.
"""

_COUNTING = """\
## What a communication step is

The paper: "Communication between agent i and agent k where allocation data are sent is counted as a single
communication step." It does not say when an agent sends. Four countings of the same runs are given:

- **steps**: once for each agent and round in which its beliefs changed, that is, a broadcast of something
  new, be it its own bid or one that it relays. Used in the pictures and the verdicts.
- **own only**: once for each agent and round in which its own bundle changed.
- **links**: steps times the agents that hear each.
- **all sent**: every broadcast of our implementation, with those by which agents learn that all agree.

Runs that did not settle within the patience of 100 rounds have no number of steps. They are left out of these
columns and counted under "settled".
"""

_VERDICTS_HEAD = """\
A cell has the ratio of the means with its 95 % interval, the difference in pooled standard deviations (d) and
p of Welch's t test. Intervals are bootstrapped; those of the paper follow from its means and spreads. Runs of
one number share their missions in all columns, so p is on the safe side where two columns are compared. The
verdicts:
"""

_LEVELS = """\
## The means that the paper states

Scores are calibrated by the reward of a seat and assumed in all else: **their level is no reproduction**. So
are steps, by what is counted as one.
"""

_IN_TURN = """\
Another reading: agents do not act in rounds but one after the other, in a drawn order, each with everything
that was said before it. Broadcasts of own changes, then:
"""

_TOGETHER = """\
How often a whole group goes on to its next task together (tasks of two agents, all runs of Fig. 5):
"""

_FIGURES = {
    3: """\
Numbers a message as the paper counts: the old vectors hold a bid and a winner for each seat, 2·20·L, all the
time; a triple holds agent, task and bid, so the new storage grows by 3 with each assignment. **Once the plan
is full, triples are larger than the vectors**, for 3 is more than 2; the paper's claim holds early in a run,
or for plans that stay sparse. The repaired algorithm sends the records that changed, which everybody relays
(dotted): much while all is new, little later. Vectors and triples are coded as tightly as can be, 8 bytes for
a bid or a stamp and 2 for an index; what is "measured" is on our wire, with ids as text, digests, and for
records the place in the path as well, so measured sizes compare with measured ones. Sums of a run are over
the rounds in which beliefs changed, and over settled runs.""",
    4: "Tasks of two agents. Grey bars are windows; tasks in red stay undone.",
    5: "Score (lines, left) and communication steps (crosses, right); diamonds: steps that the paper states.",
    6: """\
**The only numbers on this page that depend on the machine**, and so does the picture: computing time of all
agents of a run, at most 20 runs a point. In the second table they are multiples of the time that one agent a
task takes with the same column's algorithm.""",
    7: """\
Mean and standard deviation. "Tasks" are completed tasks of 20. "Clean" is a run whose final state could be
executed as it is: at rest, agreed, no seat too many or too few, no circle of waiting, no window missed.
Without task quitting, groups that never fill stay, so hardly any state is clean.""",
    8: "Agents are split evenly over the kinds, the surplus to A first, then B.",
    9: "Agents of three kinds, task quitting and team rewards. Grey bars: windows; red tasks stay undone.",
    10: "Tasks of two agents. In #2 some follow-ups close before what they follow is done; in #3 none does.",
    11: """\
B-tasks follow a T-task, C-tasks a B-task, and may start at any time after it; with task quitting and team
rewards. Tasks in red stay undone.""",
}
