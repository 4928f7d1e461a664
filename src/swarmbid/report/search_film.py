"""The film strip of one target: small maps at the instants that tell its story, each with a sentence."""

from __future__ import annotations

from itertools import pairwise

from swarmbid.report.search_map import STYLE, cross, diamond
from swarmbid.report.search_scene import Frame, SearchScene, ground
from swarmbid.report.style import DRAWING, PICTURE_THEME
from swarmbid.report.svg import CHARACTER_EM, clock, escape, number, tag
from swarmbid.sightings import ACCEPT, ANNOUNCE, BID, Life, Moment, key_moments, life_of
from swarmbid.trace import Trace

COLUMNS, WIDTH, GAP = 4, 1120.0, 14.0
MOST_FRAMES = 8
_CAPTION = 11.5
_LINES = 4
_TITLES = {
    "before": "Search",
    "detection": "Detection",
    "announcement": "Announcement",
    "bids": "Bids",
    "award": "Award",
    "track": "Track",
    "hand-over": "Hand-over",
    "later": "Later",
    "end": "End",
}
_TAIL = 120.0
"""How much of its way each UAV trails behind it, s."""


def render_film_strip(trace: Trace, target: str) -> str:
    """Draw the film strip as a picture that stands alone.

    Parameters
    ----------
    trace : of a search mission. target : id of a true target or of a task.

    Raises
    ------
    InputError : the trace mentions no such target or task.
    """
    return film_strip(SearchScene(trace), life_of(trace, target), standalone=True)


def film_strip(scene: SearchScene, life: Life, *, standalone: bool = False) -> str:
    """Draw 6 to 8 frames where the trace has as many instants, in rows of 4."""
    frames = choose_frames(scene, life)
    columns = min(COLUMNS, len(frames)) or 1
    wide = (WIDTH - GAP * (COLUMNS - 1)) / COLUMNS
    high = scene.frame(0.0, 0.0, wide, wide).height
    row = 24.0 + high + 10.0 + _LINES * 15.0 + 10.0
    parts = [f"<style>{PICTURE_THEME}{DRAWING}{STYLE}</style>"] if standalone else []
    rows = -(-len(frames) // columns)
    if standalone:
        parts.append(tag("rect", x=0, y=0, width=WIDTH, height=row * rows, fill="var(--card)"))
    for place, moment in enumerate(frames):
        x, y = (place % columns) * (wide + GAP), (place // columns) * row
        parts.append(_frame(scene, life, moment, place + 1, x, y, wide, high))
    size = f"0 0 {number(WIDTH)} {number(row * rows)}"
    namespace = "http://www.w3.org/2000/svg" if standalone else None
    return tag("svg", "".join(parts), viewBox=size, class_="film", role="img", xmlns=namespace)


def choose_frames(scene: SearchScene, life: Life) -> list[Moment]:
    """Return the instants to draw: the key moments, one before them, and between where they are few."""
    chosen = list(key_moments(scene.trace, life))
    if not chosen:
        return []
    first = chosen[0]
    if first.t > 0.0:
        chosen.insert(0, Moment(max(0.0, first.t - _TAIL), "", "before", "Nobody knows of it yet."))
    while len(chosen) < 6 and life.spells:
        # Halve the longest time between two frames in which somebody tracks it.
        gaps = [(after.t - before.t, place) for place, (before, after) in enumerate(pairwise(chosen))]
        last = max(spell.end for spell in life.spells)
        gaps.append((last - chosen[-1].t, len(chosen) - 1))
        longest, place = max(gaps, key=lambda gap: (gap[0], -gap[1]))
        if longest <= 1.0:
            break
        t = chosen[place].t + longest / (1.0 if place == len(chosen) - 1 else 2.0)
        doer = next((spell.agent for spell in life.spells if spell.begin <= t <= spell.end), "")
        words = "tracks it" if doer else "Nobody tracks it."
        chosen.insert(place + 1, Moment(t, doer, "later", words))
    return chosen[:MOST_FRAMES]


def caption(moment: Moment) -> str:
    """The sentence below a frame."""
    return f"{moment.agent} {moment.what}." if moment.agent else moment.what


def _frame(
    scene: SearchScene, life: Life, moment: Moment, place: int, x: float, y: float, wide: float, high: float
) -> str:
    frame = scene.frame(x, y + 24.0, wide, high)
    title = f"{place}  {_TITLES[moment.kind]} · {clock(moment.t)}"
    parts = [
        tag("text", escape(title), x=x, y=y + 15.0, class_="step"),
        tag("rect", x=x, y=y + 24.0, width=wide, height=high, class_="sheet"),
        ground(scene, frame),
        _fleet(scene, moment.t, frame, x + wide),
        # Above the UAVs: who tracks a target is right over it.
        _targets(scene, life, moment.t, frame),
        _words_between(scene, life, moment, frame),
    ]
    lines = wrapped(caption(moment), int(wide / (_CAPTION * CHARACTER_EM * 0.92)))
    for line, text in enumerate(lines[:_LINES]):
        cut = "…" if line == _LINES - 1 and len(lines) > _LINES else ""
        height = y + 24.0 + high + 16.0 + 15.0 * line
        parts.append(tag("text", escape(text) + cut, x=x, y=height, class_="caption soft"))
    return tag("g", "".join(parts))


def _targets(scene: SearchScene, life: Life, t: float, frame: Frame) -> str:
    parts = []
    for target, line in scene.targets.items():
        now = line.at(t)
        if now is None:
            continue
        this = target == life.target
        if this:
            parts.append(tag("path", d=frame.path(line.between(max(0.0, t - 3 * _TAIL), t)), class_="truth"))
        parts.append(
            tag("g", diamond(frame(now), size=4.5 if this else 3.0), opacity=None if this else "0.35")
        )
    return "".join(parts)


def _fleet(scene: SearchScene, t: float, frame: Frame, right: float) -> str:
    radii = {str(one["id"]): one.get("radius") or 0.0 for one in scene.world.get("vehicles", ())}
    parts = []
    for vehicle, line in scene.vehicles.items():
        now = line.at(t)
        if now is None:
            continue
        x, y = frame(now)
        if scene.crashes.get(vehicle, t + 1.0) <= t:
            parts.append(cross((x, y)))
            continue
        tail = line.between(max(0.0, t - _TAIL), t)
        drawn = tag("path", d=frame.path(tail), class_="flown") if len(tail) > 1 else ""
        reach = float(radii.get(vehicle, 0.0)) * frame.scale
        drawn += tag("circle", cx=x, cy=y, r=reach, class_="reach") if reach > 0.0 else ""
        drawn += tag("circle", cx=x, cy=y, r=6.5, class_="vehicle")
        outside = x + 8 + len(vehicle) * 10.5 * CHARACTER_EM > right
        anchor = "end" if outside else None
        drawn += tag("text", escape(vehicle), x=x - 8 if outside else x + 8, y=y - 7, text_anchor=anchor,
                     class_="name")  # fmt: skip
        parts.append(tag("g", drawn, class_=scene.colour(vehicle)))
    return "".join(parts)


def _words_between(scene: SearchScene, life: Life, moment: Moment, frame: Frame) -> str:
    """Draw who speaks to whom at that instant: the announcement, all bids so far, the award."""
    wanted = {"announcement": ANNOUNCE, "bids": BID, "award": ACCEPT}.get(moment.kind)
    if wanted is None:
        return ""
    parts = []
    for act in life.acts:
        same = act.t == moment.t and act.agent == moment.agent
        earlier_bid = wanted == BID and act.t <= moment.t
        if act.performative != wanted or not (same or earlier_bid):
            continue
        speaker = scene.vehicles.get(act.agent)
        here = speaker.at(moment.t) if speaker else None
        receivers = [act.to] if act.to else [one for one in scene.vehicles if one != act.agent]
        for receiver in receivers:
            line = scene.vehicles.get(receiver)
            there = line.at(moment.t) if line else None
            if here is None or there is None:
                continue
            css = f"said {'strong ' if wanted == ACCEPT else ''}{scene.colour(act.agent)}"
            parts.append(tag("path", d=frame.path([here, there]), class_=css))
        if wanted == BID and here is not None and act.bid is not None:
            x, y = frame(here)
            parts.append(tag("text", f"{act.bid:.4g}", x=x + 7, y=y + 12, class_="name place"))
    return "".join(parts)


def wrapped(text: str, most: int) -> list[str]:
    """Break a sentence into lines of at most so many characters, at blanks."""
    lines = [""]
    for word in text.split():
        if lines[-1] and len(lines[-1]) + 1 + len(word) > most:
            lines.append(word)
        else:
            lines[-1] = f"{lines[-1]} {word}".strip()
    return lines
