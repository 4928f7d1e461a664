"""Small change for drawing: escaped elements, round steps, colours, readable numbers."""

from __future__ import annotations

import html
import math

NUM_COLOURS = 8
# Told apart with every common colour blindness, and from white and near-black alike (after Okabe and Ito,
# with two of Tol's muted set instead of their yellow and black).
LIGHT_COLOURS = ("#0072b2", "#d55e00", "#009e73", "#b8569a", "#bf7e00", "#2e90c8", "#882255", "#7d7d1f")
DARK_COLOURS = ("#4aa8e0", "#f08545", "#2fc49a", "#dd8fc2", "#edb440", "#8fd0f5", "#d0709b", "#c2c25a")
# Beyond eight agents the colours come again with another dash.
DASHES = ("", "9 4", "2 4", "10 3 2 3")
# Width of a character in em, on average, in the sans-serif faces that the page asks for.
CHARACTER_EM = 0.57


def escape(text: object) -> str:
    """Make any text safe inside an element or a quoted attribute."""
    return html.escape(str(text), quote=True)


def number(value: float) -> str:
    """Write a coordinate with at most one decimal: enough for pixels, and stable."""
    text = f"{value:.1f}"
    return "0" if text in ("-0.0", "0.0") else text.removesuffix(".0")


def tag(name: str, content: str | None = None, /, **attributes: object) -> str:
    """Build one element; attribute names take ``_`` for ``-``, values are escaped, None is left out.

    Examples
    --------
    >>> tag("text", "A", x=1.25, class_="label", text_anchor="end")
    '<text x="1.2" class="label" text-anchor="end">A</text>'
    """
    parts = [name]
    for key, value in attributes.items():
        if value is None:
            continue
        shown = number(value) if isinstance(value, float) else escape(value)
        parts.append(f'{key.rstrip("_").replace("_", "-")}="{shown}"')
    opening = " ".join(parts)
    return f"<{opening}/>" if content is None else f"<{opening}>{content}</{name}>"


def colour_class(index: int) -> str:
    """Return the CSS class that sets the colour of agent number `index`."""
    return f"a{index % NUM_COLOURS}"


def dash(index: int) -> str | None:
    """Return the dash pattern of agent number `index`; None for a solid line."""
    return DASHES[index // NUM_COLOURS % len(DASHES)] or None


def nice_step(span: float, most: int) -> float:
    """Return the smallest of 1, 2, 5 times a power of ten that divides `span` into at most `most` parts."""
    if span <= 0.0:
        return 1.0
    raw = span / most
    power = 10.0 ** math.floor(math.log10(raw))
    for factor in (1.0, 2.0, 5.0, 10.0):
        if factor * power >= raw * (1.0 - 1e-9):
            return factor * power
    return 10.0 * power


_TIME_STEPS = (1, 2, 5, 10, 15, 30, 60, 120, 300, 600, 900, 1800, 3600, 7200, 10800, 21600, 43200, 86400)


def time_step(span: float, most: int) -> float:
    """Return a step in s that people count in, dividing `span` s into at most `most` parts."""
    if span < most:
        return nice_step(span, most)
    for step in _TIME_STEPS:
        if span / step <= most:
            return float(step)
    return 86400.0 * nice_step(span / 86400.0, most)


def clock(seconds: float) -> str:
    """Write a time of the mission: ``47.5 s``, ``12:30`` (min:s), ``1:02:30`` (h:min:s)."""
    if seconds < 60.0:
        text = f"{seconds:.1f}".removesuffix(".0")
        if text != "60":
            return f"{text} s"
    whole = round(seconds)
    minutes, rest = divmod(whole, 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02d}:{rest:02d}" if hours else f"{minutes}:{rest:02d}"


def span_of(seconds: float) -> str:
    """Write a length of time: ``47.5 s``, ``12 min 30 s``, ``1 h 2 min``."""
    if seconds < 60.0:
        text = f"{seconds:.1f}".removesuffix(".0")
        if text != "60":
            return f"{text} s"
    whole = round(seconds)
    if whole < 3600:
        minutes, rest = divmod(whole, 60)
        return f"{minutes} min {rest} s" if rest else f"{minutes} min"
    hours, minutes = divmod(round(whole / 60), 60)
    return f"{hours} h {minutes} min" if minutes else f"{hours} h"


def metres(length: float) -> str:
    """Write a length: ``8.5 m``, ``640 m``, ``12.4 km``."""
    if length < 100.0:
        return f"{length:.1f}".removesuffix(".0") + " m"
    if length < 999.5:
        return f"{length:.0f} m"
    if length < 99_950.0:
        return f"{length / 1000:.1f}".removesuffix(".0") + " km"
    return f"{length / 1000:,.0f} km"


def octets(size: float) -> str:
    """Write a number of bytes: ``640 B``, ``12.4 kB``, ``3.1 MB``."""
    if size < 1000.0:
        return f"{size:.0f} B"
    if size < 999_950.0:
        return f"{size / 1e3:.1f}".removesuffix(".0") + " kB"
    return f"{size / 1e6:,.1f}".removesuffix(".0") + " MB"


def shorten(text: str, most: int) -> str:
    """Cut `text` to at most `most` characters, with an ellipsis in the place of what is gone."""
    return text if len(text) <= most else text[: most - 1] + "…"
