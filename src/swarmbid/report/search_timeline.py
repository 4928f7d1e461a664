"""The timeline of a search mission: what every UAV did when, and what was known of every target."""

from __future__ import annotations

from swarmbid.report.search_scene import SearchScene
from swarmbid.report.svg import CHARACTER_EM, clock, escape, number, shorten, tag, time_step
from swarmbid.sightings import ACCEPT, ANNOUNCE, Life

WIDTH, ROW, TOP = 1120.0, 22.0, 26.0
_RIGHT = 14.0
_LONGEST = 22

STYLE = """
svg .m-search{fill:var(--c);opacity:.3}
svg .m-transit{fill:var(--c);opacity:.55}
svg .m-track,svg .m-visit{fill:var(--c)}
svg .m-return{fill:url(#homeward);stroke:var(--c);stroke-width:.8}
svg .m-base{fill:none;stroke:var(--line);stroke-width:1}
svg .t-hidden{fill:none;stroke:var(--line);stroke-dasharray:3 3}
svg .t-known{fill:var(--grid);stroke:var(--soft);stroke-width:.8}
svg .t-gap{fill:var(--bad-bg);stroke:var(--bad);stroke-width:.8}
svg .tick{stroke:var(--ink);stroke-width:1.6}
svg .tick.call{stroke:var(--accent)}
svg .tick.won{stroke:var(--good)}
"""


def render_search_timeline(scene: SearchScene) -> str:
    """Draw a bar for each UAV and each true target; false alarms have none."""
    names = [*scene.vehicles, *scene.targets]
    left = 18.0 + max((min(len(name), _LONGEST) for name in names), default=4) * 11 * CHARACTER_EM
    span = max(scene.end, 1.0)
    per_second = (WIDTH - left - _RIGHT) / span
    between = 20.0 if scene.targets else 0.0
    bottom = TOP + ROW * len(names) + between
    parts = [_defs(), _axis(span, left, per_second, bottom)]
    top = TOP
    for vehicle, line in scene.vehicles.items():
        bars = "".join(
            _bar(
                left + begin * per_second,
                top,
                (end - begin) * per_second,
                f"m-{mode}",
                f"{mode} {_span(begin, end)}",
            )
            for mode, begin, end in line.runs()
        )
        crashed = scene.crashes.get(vehicle)
        if crashed is not None:
            x, y = left + crashed * per_second, top + ROW / 2
            bars += tag("path", d=f"M{number(x - 5)} {number(y - 5)}l10 10m-10 0l10-10", class_="cross")
        name = _name(vehicle, left, top)
        parts.append(tag("g", name + bars, class_=scene.colour(vehicle), data_agent=vehicle))
        top += ROW
    top += between
    for target in scene.targets:
        parts.append(_name(target, left, top))
        parts.append(_target(scene, target, top, left, per_second))
        top += ROW
    size = f"0 0 {number(WIDTH)} {number(bottom + 8)}"
    return tag("svg", "".join(parts), viewBox=size, class_="chart-time bars", role="img")


def _target(scene: SearchScene, target: str, top: float, left: float, per_second: float) -> str:
    found = [life for life in scene.lives.values() if life.target == target]
    seen = min((life.detections[0].t for life in found), default=scene.end)
    bars = _bar(left, top, seen * per_second, "t-hidden", f"undetected {_span(0.0, seen)}")
    ended = [life.ended.t for life in found if life.ended is not None]
    end = max(ended) if found and len(ended) == len(found) else scene.end
    if found:
        bars += _bar(
            left + seen * per_second, top, (end - seen) * per_second, "t-known", f"known {_span(seen, end)}"
        )
    spells = sorted((spell for life in found for spell in life.spells), key=lambda one: (one.begin, one.end))
    until = None
    for spell in spells:
        if until is not None and spell.begin > until:
            x = left + until * per_second
            bars += _bar(
                x, top, (spell.begin - until) * per_second, "t-gap", f"untracked {_span(until, spell.begin)}"
            )
        until = spell.end if until is None else max(until, spell.end)
    for spell in spells:
        words = f"tracked by {spell.agent} {_span(spell.begin, spell.end)}"
        bar = _bar(
            left + spell.begin * per_second, top, (spell.end - spell.begin) * per_second, "m-track", words
        )
        bars += tag("g", bar, class_=scene.colour(spell.agent), data_agent=spell.agent)
    return bars + "".join(_ticks(life, top, left, per_second) for life in found)


def _ticks(life: Life, top: float, left: float, per_second: float) -> str:
    marks = [("tick", life.detections[0].t, "detected")]
    calls = sorted({act.t for act in life.acts if act.performative == ANNOUNCE})
    marks += [("tick call", t, "announced") for t in calls]
    marks += [("tick won", act.t, f"awarded to {act.to}") for act in life.acts if act.performative == ACCEPT]
    return "".join(
        tag("line", tag("title", escape(f"{life.task} {words} after {clock(t)}")), x1=left + t * per_second,
            x2=left + t * per_second, y1=top + 1, y2=top + ROW - 1, class_=css)
        for css, t, words in marks
    )  # fmt: skip


def _name(text: str, left: float, top: float) -> str:
    shown = escape(shorten(text, _LONGEST))
    return tag("text", shown, x=left - 8, y=top + ROW * 0.66, text_anchor="end", class_="row")


def _bar(x: float, top: float, width: float, css: str, title: str) -> str:
    if width <= 0.0:
        return ""
    return tag("rect", tag("title", escape(title)), x=float(x), y=top + 4, width=max(float(width), 0.6),
               height=ROW - 8, rx=1.5, class_=css)  # fmt: skip


def _span(begin: float, end: float) -> str:
    return f"from {clock(begin)} to {clock(end)}"


def _axis(span: float, left: float, per_second: float, bottom: float) -> str:
    step = time_step(span, 12)
    parts = []
    for mark in range(int(span / step) + 1):
        x = left + mark * step * per_second
        parts.append(tag("line", x1=x, x2=x, y1=TOP - 4, y2=bottom, class_="grid"))
        anchor = "start" if mark == 0 else "middle"
        parts.append(tag("text", clock(mark * step), x=x, y=TOP - 10, text_anchor=anchor, class_="soft"))
    return "".join(parts)


def _defs() -> str:
    lines = tag("path", d="M0 5L5 0", class_="hatch")
    pattern = tag("pattern", lines, id="homeward", width=5, height=5, patternUnits="userSpaceOnUse")
    return tag("defs", pattern)
