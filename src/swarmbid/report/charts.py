"""How the agreement went: bids and messages over the rounds, as small bar charts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from swarmbid.report.svg import CHARACTER_EM, clock, nice_step, number, tag, time_step
from swarmbid.trace import Sent, Taken, Trace

WIDTH, HEIGHT = 540.0, 190.0
LEFT, RIGHT, TOP, BOTTOM = 44.0, 10.0, 26.0, 34.0
MOST_BARS = 60
WIDEST_BAR = 56.0


@dataclass(frozen=True)
class Bars:
    """Counts over equal stretches of a run.

    Parameters
    ----------
    counts : one for each stretch.
    width : s (in rounds mode: rounds) that each stretch lasts.
    rounds : whether the run went in rounds; then time 0 is the first.
    """

    counts: tuple[int, ...]
    width: float
    rounds: bool


def bids_over_time(trace: Trace) -> Bars:
    """Count the tasks that agents took."""
    return _count(trace, [record.t for record in trace.of(Taken)])


def messages_over_time(trace: Trace) -> Bars:
    """Count the broadcasts."""
    return _count(trace, [record.t for record in trace.of(Sent)])


def render_bars_svg(bars: Bars, *, css: str, told: str, marks: Sequence[tuple[float, str]] = ()) -> str:
    """Draw bars.

    Parameters
    ----------
    css : class of the bars. told : what is counted, for readers who cannot see it.
    marks : times to mark with an upright line, each with its name; in rounds, how many are over by then.
    """
    span = bars.width * len(bars.counts)
    pitch = (WIDTH - LEFT - RIGHT) / len(bars.counts)
    tallest = max(*bars.counts, 1)
    step = max(nice_step(tallest, 4), 1.0)
    top = -(-tallest // step) * step
    rise = (HEIGHT - TOP - BOTTOM) / top
    floor = HEIGHT - BOTTOM
    parts = [tag("title", told)]
    for line in range(int(top / step) + 1):
        y = floor - line * step * rise
        parts.append(tag("line", x1=LEFT, y1=y, x2=WIDTH - RIGHT, y2=y, class_="grid" if line else "axis"))
        parts.append(
            tag("text", f"{line * step:,.0f}", x=LEFT - 7, y=y + 4, text_anchor="end", class_="soft")
        )
    for place, value in enumerate(bars.counts):
        if value:
            width = min(pitch * 0.76, WIDEST_BAR)
            x = LEFT + (place + 0.5) * pitch - width / 2
            bar = tag("rect", x=x, y=floor - value * rise, width=width, height=value * rise, class_=css)
            when = _when(bars, place)
            parts.append(tag("g", tag("title", f"{when}: {value:,}") + bar))
    parts.append(_ticks(bars, pitch, floor))
    scale = (WIDTH - LEFT - RIGHT) / span
    for place, (instant, name) in enumerate(marks):
        x = LEFT + min(instant, span) * scale
        parts.append(tag("line", x1=x, y1=TOP - 18, x2=x, y2=floor, class_="mark"))
        left = x + len(name) * 11 * CHARACTER_EM > WIDTH - RIGHT
        y = TOP - 10 + 14 * place
        anchor = "end" if left else None
        parts.append(
            tag("text", name, x=x - 5 if left else x + 5, y=y, text_anchor=anchor, class_="mark-name")
        )
    return tag(
        "svg", "".join(parts), viewBox=f"0 0 {number(WIDTH)} {number(HEIGHT)}", class_="bars", role="img"
    )


def _ticks(bars: Bars, pitch: float, floor: float) -> str:
    parts = []
    if bars.rounds:
        every = max(1, int(nice_step(len(bars.counts), 12)))
        for place in range(0, len(bars.counts), every):
            x = LEFT + (place + 0.5) * pitch
            label = f"{place * bars.width + 1:.0f}"
            parts.append(tag("text", label, x=x, y=floor + 15, text_anchor="middle", class_="soft"))
    else:
        step = time_step(bars.width * len(bars.counts), 8)
        for place in range(int(bars.width * len(bars.counts) / step + 1e-9) + 1):
            x = LEFT + place * step / bars.width * pitch
            parts.append(
                tag("text", clock(place * step), x=x, y=floor + 15, text_anchor="middle", class_="soft")
            )
    name = "round" if bars.rounds else "time"
    middle = LEFT + (WIDTH - LEFT - RIGHT) / 2
    parts.append(tag("text", name, x=middle, y=floor + 29, text_anchor="middle", class_="soft"))
    return "".join(parts)


def _when(bars: Bars, place: int) -> str:
    first, last = place * bars.width, (place + 1) * bars.width
    if not bars.rounds:
        return f"{clock(first)} to {clock(last)}"
    return f"Round {first + 1:.0f}" if bars.width == 1.0 else f"Rounds {first + 1:.0f} to {last:.0f}"


def _count(trace: Trace, times: Sequence[float]) -> Bars:
    """Sort events into at most `MOST_BARS` stretches over the whole run."""
    end = max([record.t for record in trace.records], default=0.0)
    rounds = trace.header.mode == "rounds"
    if rounds:
        width = float(-(-(int(end) + 1) // MOST_BARS))
        bins = int(end // width) + 1
    else:
        bins = MOST_BARS // 2
        width = end / bins if end > 0.0 else 1.0
    counts = [0] * bins
    for t in times:
        counts[min(int(t / width), bins - 1)] += 1
    return Bars(tuple(counts), width, rounds)
