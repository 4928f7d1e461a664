"""Drawing: one look for all figures, and SVG files whose bytes follow from what they show."""

from __future__ import annotations

import io
from collections.abc import Sequence
from contextlib import AbstractContextManager
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLOURS = ("#0072b2", "#d55e00", "#009e73", "#8a4f9e")
"""First, second, third, fourth series; told apart by the colour-blind as well."""
PAPER = "#222222"
"""What the paper states."""
PALE = "#d9d9d9"

_STYLE: dict[str, Any] = {
    "svg.hashsalt": "swarmbid",
    "svg.fonttype": "path",
    "font.family": "DejaVu Sans",
    "font.size": 9.0,
    "axes.spines.top": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#e6e6e6",
    "grid.linewidth": 0.6,
    "legend.frameon": False,
    "legend.fontsize": 8.0,
    "figure.facecolor": "white",
}


def styled() -> AbstractContextManager[None]:
    """Return the context within which figures are drawn and saved."""
    from matplotlib import rc_context

    style: Any = _STYLE  # releases of matplotlib disagree about the type
    return rc_context(style)


def panels(
    titles: Sequence[str], *, width: float = 4.6, height: float = 3.4, sharey: bool = True
) -> tuple[Figure, list[Axes]]:
    """Return a figure with a panel for each title, side by side with axes of one scale; inches."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width * len(titles), height), layout="constrained")
    axes = figure.subplots(1, len(titles), sharex=True, sharey=sharey, squeeze=False)[0]
    for one, title in zip(axes, titles, strict=True):
        one.set_title(title, fontsize=10)
        one.tick_params(labelleft=True)
    return figure, list(axes)


def legend_below(figure: Figure, handles: Sequence[Any]) -> None:
    """Put one legend below all panels."""
    figure.legend(
        handles=list(handles),
        loc="outside lower center",
        ncols=min(len(handles), 5),
        frameon=False,
        fontsize=8,
    )


def as_svg(figure: Figure) -> str:
    """Return a figure as SVG; the same figure gives the same bytes."""
    target = io.BytesIO()
    with styled():
        figure.savefig(target, format="svg", metadata={"Date": None, "Creator": "swarmbid"}, dpi=110)
    return target.getvalue().decode()
