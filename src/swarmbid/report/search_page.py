"""The report of a search mission: one HTML file with measures, map, timeline, film strip and replay."""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Iterator, Mapping
from itertools import pairwise
from typing import Any

from swarmbid import __version__
from swarmbid.report import search_film, search_map, search_replay, search_timeline
from swarmbid.report.search_map import render_search_map
from swarmbid.report.search_scene import SearchScene
from swarmbid.report.style import DRAWING, PAGE, SCRIPT, THEME
from swarmbid.report.svg import clock, dash, escape, metres, tag
from swarmbid.sightings import Life, explain_search
from swarmbid.trace import Trace

MOST_LISTED = 200
_UNITS = (("_seconds", " s"), ("_metres", " m"), ("_s", " s"), ("_m", " m"), ("_bytes", " B"))


def render_search_report(trace: Trace, *, target: str | None = None) -> str:
    """Build the page.

    Parameters
    ----------
    trace : of a search mission; one that was stopped will do.
    target : whose film strip to show, a task or true target; by default the one with most to tell.

    Returns
    -------
    A whole HTML document that loads nothing from anywhere.

    Raises
    ------
    InputError : there is no such target.
    """
    scene = SearchScene(trace)
    life = _told(scene, target)
    body = [
        _header(scene),
        _measures(scene),
        _section(
            "Map", _MAP_HINT, f'<div class="map"><div>{render_search_map(scene)}</div>{_key(scene)}</div>'
        ),
        _section("Replay", _REPLAY_HINT, search_replay.replay(scene)),
        _section(
            "Timeline",
            _TIME_HINT,
            f'<div class="scroll">{search_timeline.render_search_timeline(scene)}</div>',
        ),
        _film(scene, life),
        _targets(scene),
        f"<footer>Made by swarmbid {__version__} from the trace of the mission. "
        "This page is one file and needs no network.</footer>",
    ]
    style = THEME + DRAWING + search_map.STYLE + search_timeline.STYLE + PAGE
    style += search_replay.STYLE + _STYLE
    scripts = (SCRIPT, search_replay.SCRIPT)
    return (
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{_policy(scripts)}">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escape(_name(scene))} · search</title>\n<style>{style}</style>\n</head>\n"
        "<body>\n<main>\n" + "\n".join(part for part in body if part) + "\n</main>\n"
        + "".join(f"<script>{script}</script>\n" for script in scripts) + "</body>\n</html>\n"
    )  # fmt: skip


_STYLE = """
.measures tbody{display:grid;grid-template-columns:repeat(auto-fill,minmax(300px,1fr));column-gap:28px}
.measures tr{display:flex;justify-content:space-between;border-bottom:1px solid var(--grid)}
.measures td{border:0}
pre{font-size:12.5px;white-space:pre-wrap;overflow-wrap:anywhere}
summary{cursor:pointer;font-weight:600;margin-top:10px}
"""
_MAP_HINT = (
    "Seen from above, north up. Thin: searching and on the way; thick: tracking; dashed: flying home. "
    "Point at anything for more."
)
_REPLAY_HINT = (
    "Move the slider or play. Pale discs are what the sensors cover; dashed lines are announcements, "
    "thin lines bids, thick lines awards."
)
_TIME_HINT = (
    "UAVs: pale while searching, darker in transit, full while tracking, hatched on the way home, empty at "
    "base. Targets: dashed while undetected, grey once known, in the UAV's colour while tracked, red between "
    "two tracks. "
    "Ticks: detected (black), announced (blue), awarded (green)."
)


def _told(scene: SearchScene, target: str | None) -> Life | None:
    if target is not None:
        return scene.lives[explain_search(scene.trace, target).task]
    real = [life for life in scene.lives.values() if life.target]
    # A hand-over tells most, then a negotiation, then a long track.
    return max(
        real,
        key=lambda life: (
            len({spell.agent for spell in life.spells}) > 1,
            any(act.performative == "accept-proposal" for act in life.acts),
            len(life.spells),
            len(life.acts),
        ),
        default=None,
    )


def _name(scene: SearchScene) -> str:
    return str(scene.trace.header.mission.get("name") or "Search mission")


def _header(scene: SearchScene) -> str:
    found = {life.target for life in scene.lives.values() if life.target}
    result = scene.trace.result
    badges = [
        tag("li", f"{len(found)} of {len(scene.targets)} targets found",
            class_="badge" if len(found) == len(scene.targets) else "badge warn")
    ]  # fmt: skip
    if scene.crashes:
        badges.append(tag("li", f"{len(scene.crashes)} crashed", class_="badge bad"))
    if result is None:
        badges.append(tag("li", "stopped before its end", class_="badge bad"))
    strategy = str(scene.world.get("strategy", "")).replace("_", " ")
    method = f"Search mission by {escape(scene.trace.header.algorithm)}"
    method += f" · strategy {escape(strategy)}" if strategy else ""
    tracked = {life.target for life in scene.lives.values() if life.target and life.spells}
    handed = sum(
        1 for life in scene.lives.values() for one in pairwise(life.spells) if one[0].agent != one[1].agent
    )
    lead = (
        f"{len(scene.vehicles)} UAVs searched for {clock(scene.end)}. They found {len(found)} of "
        f"{len(scene.targets)} targets, tracked {len(tracked)} and handed a track over {_times(handed)}."
    )
    return (
        f'<header>\n<p class="over">{method} · seed {scene.trace.header.seed}</p>\n'
        f"<h1>{escape(_name(scene))}</h1>\n"
        f'<p class="lead">{lead}</p>\n<ul class="badges">{"".join(badges)}</ul>\n</header>'
    )


def _times(count: int) -> str:
    return {0: "never", 1: "once", 2: "twice"}.get(count, f"{count} times")


def _measures(scene: SearchScene) -> str:
    result = scene.trace.result
    rows = list(_flat(result.measures)) if result is not None else []
    if not rows:
        return ""
    cells = "".join(
        f'<tr><td>{escape(name)}</td><td class="n">{escape(value)}</td></tr>' for name, value in rows
    )
    return _section("Measures", "", f'<div class="measures"><table><tbody>{cells}</tbody></table></div>')


def _flat(measures: Mapping[str, Any], before: str = "") -> Iterator[tuple[str, str]]:
    """Yield names in words and values with units; curves and other lists are left to the trace."""
    for key, value in measures.items():
        if isinstance(value, Mapping):
            yield from _flat(value, f"{before}{key.replace('_', ' ')}: ")
        elif not isinstance(value, list | tuple):
            unit = next((unit for ending, unit in _UNITS if key.endswith(ending)), "")
            name = next((key.removesuffix(ending) for ending, _ in _UNITS if key.endswith(ending)), key)
            yield before + name.replace("_", " "), _written(value) + (unit if value is not None else "")


def _written(value: Any) -> str:
    if value is None:
        return "–"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, int):
        return f"{value:,}"
    return f"{value:,.4g}" if isinstance(value, float) and abs(value) < 1e4 else (
        f"{value:,.0f}" if isinstance(value, float) else str(value)
    )  # fmt: skip


def _section(title: str, hint: str, content: str) -> str:
    told = f'<p class="hint">{hint}</p>\n' if hint else ""
    return f"<section>\n<h2>{title}</h2>\n{told}{content}\n</section>"


def _key(scene: SearchScene) -> str:
    types = {str(one["id"]): str(one.get("type", "")) for one in scene.world.get("vehicles", ())}
    items = []
    for vehicle, line in list(scene.vehicles.items())[:MOST_LISTED]:
        stroke = tag(
            "line", x1=1, y1=6, x2=25, y2=6, class_="leg", stroke_dasharray=dash(scene.colours[vehicle])
        )
        swatch = tag("svg", stroke, viewBox="0 0 26 12", aria_hidden="true")
        flown = sum(((b[0] - a[0]) ** 2 + (b[1] - a[1]) ** 2) ** 0.5 for a, b in pairwise(line.places))
        words = " · ".join(filter(None, (types.get(vehicle, ""), metres(flown))))
        items.append(
            tag("li", f"{swatch}<b>{escape(vehicle)}</b><span>{escape(words)}</span>",
                class_=scene.colour(vehicle),
                data_agent=vehicle, tabindex=0)
        )  # fmt: skip
    signs = [
        (search_map.diamond((13.0, 8.0)), "true target, at the beginning"),
        (tag("path", d="M1 8h24", class_="truth"), "its way"),
        (tag("circle", cx=13, cy=8, r=5.5, class_="found shared"), "detection, in the finder's colour"),
        (tag("circle", cx=13, cy=8, r=5.5, class_="false"), "false alarm"),
        (tag("path", d="M1 8h24", class_="awarded shared"), "award: from the winner to its target"),
        (tag("rect", x=3, y=2, width=20, height=12, class_="zone"), "exclusion zone"),
        (tag("path", d="M4 8l9-8 9 8h-2.5v7h-13v-7z", class_="base"), "base"),
    ]
    legend = "".join(
        f"<li>{tag('svg', drawing, viewBox='0 0 26 16', aria_hidden='true')}{name}</li>"
        for drawing, name in signs
    )
    return (
        f'<div class="key"><h3>UAVs <span class="screen hint">(click to single one out)</span></h3>'
        f'<ul class="agents">{"".join(items)}</ul><h3>Signs</h3><ul class="legend">{legend}</ul></div>'
    )


def _film(scene: SearchScene, life: Life | None) -> str:
    if life is None:
        return ""
    title = f"The story of {escape(life.target or life.task)}"
    hint = f"Task {escape(life.task)}; the other targets are pale. Behind each UAV, its last two minutes."
    story = escape(str(explain_search(scene.trace, life.task)))
    told = f"<details><summary>All of it, in words</summary><pre>{story}</pre></details>"
    return _section(title, hint, f'<div class="scroll">{search_film.film_strip(scene, life)}</div>{told}')


def _targets(scene: SearchScene) -> str:
    rows = []
    for life in list(scene.lives.values())[:MOST_LISTED]:
        told = explain_search(scene.trace, life.task)
        tracked = ", ".join(dict.fromkeys(spell.agent for spell in life.spells)) or "–"
        rows.append(
            f"<tr><td><b>{escape(life.task)}</b></td><td>{escape(life.target or 'none')}</td>"
            f'<td class="wide">{escape(told.found)}</td><td>{escape(tracked)}</td>'
            f'<td class="n">{told.untracked:.0f} s</td><td class="wide">{escape(told.outcome)}</td></tr>'
        )
    if not rows:
        return ""
    names = ("Task", "Target", "Found", "Tracked by", "Gaps", "Outcome")
    head = "<tr>" + "".join(f"<th>{name}</th>" for name in names) + "</tr>"
    table = f'<div class="scroll"><table><thead>{head}</thead><tbody>{"".join(rows)}</tbody></table></div>'
    return _section("Tasks", "Each becomes of a contact that was confirmed.", table)


def _policy(scripts: tuple[str, ...]) -> str:
    """The page's security policy: nothing is loaded, no script runs but ours."""
    digests = [base64.b64encode(hashlib.sha256(script.encode()).digest()).decode() for script in scripts]
    allowed = " ".join(f"'sha256-{digest}'" for digest in digests)
    return f"default-src 'none'; style-src 'unsafe-inline'; script-src {allowed}"
