"""The report: one HTML file that shows a plan, how it was agreed on, and whether it holds."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from swarmbid import __version__
from swarmbid.metrics import Metrics, measure
from swarmbid.model import Mission
from swarmbid.plan import Plan
from swarmbid.report.charts import bids_over_time, messages_over_time, render_bars_svg
from swarmbid.report.map import marker, render_map_svg, shape_of
from swarmbid.report.scene import Row, Scene, count
from swarmbid.report.style import DRAWING, PAGE, SCRIPT, THEME, content_policy
from swarmbid.report.svg import clock, colour_class, dash, escape, metres, octets, span_of, tag
from swarmbid.report.timeline import MOST_ROWS, render_timeline_svg
from swarmbid.trace import Trace

if TYPE_CHECKING:
    from swarmbid.verify import Violation

MOST_VISITS = 1000
MOST_LISTED = 200


def render_report(
    mission: Mission,
    plan: Plan,
    trace: Trace | None = None,
    violations: Sequence[Violation] | None = None,
) -> str:
    """Build the page.

    Parameters
    ----------
    mission, plan : what to show.
    trace : the run that made the plan; without it the page says nothing of the agreement.
    violations : what `swarmbid.verify.verify` found; None if nobody asked it.

    Returns
    -------
    A whole HTML document that loads nothing from anywhere.
    """
    scene = Scene(mission, plan)
    metrics = measure(trace) if trace is not None and trace.result is not None else None
    body = [
        _header(scene, metrics, violations),
        _figures(scene, metrics),
        _map(scene),
        _timeline(scene),
        _unserved(scene),
        _agreement(trace, metrics) if trace is not None and metrics is not None else "",
        _checks(violations),
        _schedule(scene),
        f"<footer>Made by swarmbid {__version__} from the plan and its trace. "
        "This page is one file and needs no network.</footer>",
    ]
    return (
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{content_policy()}">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escape(mission.name)} · plan</title>\n<style>{THEME}{DRAWING}{PAGE}</style>\n</head>\n"
        "<body>\n<main>\n" + "\n".join(part for part in body if part) + "\n</main>\n"
        f"<script>{SCRIPT}</script>\n</body>\n</html>\n"
    )


def _header(scene: Scene, metrics: Metrics | None, violations: Sequence[Violation] | None) -> str:
    left = len(scene.unserved)
    converged = metrics is None or metrics.status == "converged"
    badges = []
    if metrics is not None:
        badges.append(_badge("Agreed" if converged else "Not agreed", "" if converged else "bad"))
    if violations is not None:
        text = "can be flown as is" if converged else "breaks no rule"
        if violations:
            text = count(len(violations), "violation")
        badges.append(_badge(f"Checked: {text}", "bad" if violations else ""))
    badges.append(
        _badge(f"{count(left, 'task')} not served" if left else "Every task served", "warn" if left else "")
    )
    method = f"Plan by {escape(scene.plan.algorithm)} · score {escape(scene.plan.score_name)}"
    return (
        f'<header>\n<p class="over">{method}</p>\n<h1>{escape(scene.mission.name)}</h1>\n'
        f'<p class="lead">{_lead(scene, metrics)}</p>\n<ul class="badges">{"".join(badges)}</ul>\n</header>'
    )


def _lead(scene: Scene, metrics: Metrics | None) -> str:
    """Say in two or three sentences what came of it."""
    busy = [row for row in scene.rows if row.plan.visits]
    served, total = len(scene.served), len(scene.mission.tasks)
    if not total:
        return "There is nothing to do."
    if not busy:
        return f"Nobody does anything; {count(total, 'task')} left."
    agents = _of(len(busy), len(scene.rows), "agent")
    does = "does" if len(busy) == 1 else "do"
    parts = [f"{agents[0].upper()}{agents[1:]} {does} {_of(served, total, 'task')}."]
    ends = f"The last task ends after {_unbroken(scene.makespan)}"
    back = [row.plan.finish for row in busy if row.agent.base is not None]
    parts.append(f"{ends}; the last way home after {_unbroken(max(back))}." if back else f"{ends}.")
    if metrics is not None and metrics.status != "converged":
        parts.append(
            "They had not agreed when they were stopped; what several meant to do is shown with the "
            "highest bidder."
        )
    elif metrics is not None and metrics.rounds is not None and len(scene.rows) > 1:
        parts.append(
            f"They agreed on it among themselves, without a leader, in {count(metrics.rounds, 'round')}."
        )
    return " ".join(parts)


def _unbroken(seconds: float) -> str:
    """Write a length of time that no line break parts."""
    return span_of(seconds).replace(" ", "\u00a0")


def _of(part: int, whole: int, what: str) -> str:
    """Write ``all 8 agents``, ``both agents``, ``the only agent``, ``3 of 8 agents``."""
    if part < whole:
        return f"{part:,} of {count(whole, what)}"
    return f"the only {what}" if part == 1 else f"both {what}s" if part == 2 else f"all {count(part, what)}"


def _badge(text: str, css: str) -> str:
    return tag("li", escape(text), class_=f"badge {css}".strip())


def _figures(scene: Scene, metrics: Metrics | None) -> str:
    served, total = len(scene.served), len(scene.mission.tasks)
    score = f"{scene.plan.total_score:,.1f}"
    figures = [
        ("Tasks served", f"{served:,} <small>of {total:,}</small>"),
        ("Last task ends", clock(scene.makespan)),
        ("Distance, all agents", metres(sum(row.plan.distance for row in scene.rows))),
        ("Score", score),
    ]
    if scene.plan.honest_score != scene.plan.total_score:
        figures.append(("Score along the paths", f"{scene.plan.honest_score:,.1f}"))
    if metrics is not None:
        if metrics.status == "converged" and metrics.rounds is not None:
            figures.append(("Rounds to agreement", f"{metrics.rounds:,}"))
        figures.append(("Broadcasts", f"{metrics.messages:,} <small>{octets(metrics.bytes)}</small>"))
        figures.append(("Inequality of work", f"{metrics.gini:.2f} <small>Gini</small>"))
    cells = "".join(f"<div><dt>{name}</dt><dd>{value}</dd></div>" for name, value in figures)
    return f'<dl class="figures">{cells}</dl>'


def _map(scene: Scene) -> str:
    hint = (
        "Seen from above, north up. Numbers give the order of an agent's stops; point at anything for more."
    )
    origin = getattr(scene.mission, "origin", None)
    if origin is not None:
        north = f"{abs(origin.latitude):.5f}° {'N' if origin.latitude >= 0 else 'S'}"
        east = f"{abs(origin.longitude):.5f}° {'E' if origin.longitude >= 0 else 'W'}"
        hint += f" Distances east and north of the origin, {north}, {east}."
    return (
        f'<section>\n<h2>Map</h2>\n<p class="hint">{hint}</p>\n<div class="map">\n'
        f"<div>{render_map_svg(scene.mission, scene.plan, standalone=False)}</div>\n"
        f'<div class="key">{_agents(scene)}{_legend(scene)}</div>\n</div>\n</section>'
    )


def _agents(scene: Scene) -> str:
    if not scene.rows:
        return ""
    items = []
    for row in scene.rows[:MOST_LISTED]:
        line = tag("line", x1=1, y1=6, x2=25, y2=6, class_="leg", stroke_dasharray=dash(row.index))
        swatch = tag("svg", line, viewBox="0 0 26 12", aria_hidden="true")
        stops = len(row.plan.visits)
        load = f"{count(stops, 'task')} · {metres(row.plan.distance)}" if stops else "idle"
        items.append(
            tag(
                "li",
                f"{swatch}<b>{escape(row.agent.id)}</b><span>{load}</span>",
                class_=colour_class(row.index),
                data_agent=row.agent.id,
                tabindex=0,
            )
        )
    rest = len(scene.rows) - MOST_LISTED
    if rest > 0:
        items.append(f"<li><i></i><span>and {rest:,} more</span></li>")
    return (
        '<h3>Agents <span class="screen hint">(click to single one out)</span></h3>'
        f'<ul class="agents">{"".join(items)}</ul>'
    )


def _legend(scene: Scene) -> str:
    entries: list[tuple[str, str]] = []
    shapes = shape_of(scene)
    for name, shape in list(shapes.items())[:6]:
        entries.append((marker(shape, 13.0, 8.0, 6.0, "stop shared"), escape(name)))
    if scene.windows:
        window = marker("circle", 13.0, 8.0, 6.5, "window shared") + marker(
            "circle", 13.0, 8.0, 3.5, "stop shared"
        )
        entries.append((window, "has a time window"))
    if scene.unserved:
        cross = marker("circle", 13.0, 8.0, 6.0, "missed") + tag(
            "path", d="M10 5l6 6m-6 0l6-6", class_="cross"
        )
        entries.append((cross, "not served"))
    if any(row.agent.base != row.agent.position for row in scene.rows):
        entries.append((tag("circle", cx=13, cy=8, r=5, class_="origin shared"), "start of an agent"))
    if any(row.agent.base is not None for row in scene.rows):
        entries.append((tag("path", d="M4 8l9-8 9 8h-2.5v7h-13v-7z", class_="base"), "base"))
        home = tag("line", x1=1, y1=8, x2=25, y2=8, class_="home shared")
        entries.append((home, "way back to base"))
    items = "".join(
        f"<li>{tag('svg', drawing, viewBox='0 0 26 16', aria_hidden='true')}{name}</li>"
        for drawing, name in entries
    )
    return f'<h3>Signs</h3><ul class="legend">{items}</ul>' if items else ""


def _timeline(scene: Scene) -> str:
    hint = "Thin: on the way; thick: at work; hatched: waiting; dotted: on the way home."
    if scene.windows:
        hint += " The pale bar beneath is the window in which service may start."
    busy = sum(1 for row in scene.rows if row.plan.visits)
    if busy > MOST_ROWS:
        hint += f" Of {busy:,} agents with work, the {MOST_ROWS} that finish last."
    return (
        f'<section>\n<h2>Timeline</h2>\n<p class="hint">{hint}</p>\n'
        f'<div class="scroll">{render_timeline_svg(scene)}</div>\n</section>'
    )


def _unserved(scene: Scene) -> str:
    if not scene.unserved:
        return ""
    rows = []
    for task in scene.unserved[:MOST_LISTED]:
        left = scene.reasons.get(task.id)
        reason = escape(left.reason.replace("_", " ")) if left else ""
        detail = escape(left.detail) if left else ""
        rows.append(
            f"<tr><td><b>{escape(task.id)}</b></td><td>{escape(task.type)}</td>"
            f'<td class="n">{task.reward:,.6g}</td><td>{reason}</td><td class="wide">{detail}</td></tr>'
        )
    rest = len(scene.unserved) - MOST_LISTED
    more = f'<p class="hint">And {rest:,} more; the plan file has them all.</p>' if rest > 0 else ""
    return (
        f"<section>\n<h2>Not served</h2>\n"
        '<p class="hint">Worked out from the mission and the final paths, not from the auction.</p>\n'
        '<div class="scroll"><table><thead><tr><th>Task</th><th>Type</th><th class="n">Reward</th>'
        f"<th>Reason</th><th>Why</th></tr></thead><tbody>{''.join(rows)}</tbody></table></div>"
        f"{more}\n</section>"
    )


def _agreement(trace: Trace, metrics: Metrics) -> str:
    if not metrics.num_agents:
        return ""
    in_rounds = trace.header.mode == "rounds"
    marks = []
    if metrics.status == "converged" and metrics.rounds is not None:
        marks.append((float(metrics.rounds), "all agree"))
    per = "each round" if in_rounds else "over time"
    bids = render_bars_svg(bids_over_time(trace), css="bar", told=f"Bids won in {per}", marks=marks)
    sent = render_bars_svg(messages_over_time(trace), css="bar two", told=f"Broadcasts in {per}")
    told = [f"{count(metrics.messages, 'broadcast')}, {octets(metrics.bytes_per_broadcast)} each"]
    if metrics.lost:
        told.append(f"{count(metrics.lost, 'reception')} lost by the network")
    if metrics.dropped:
        reasons = ", ".join(f"{number:,} {escape(reason)}" for reason, number in metrics.dropped.items())
        told.append(f"refused by receivers: {reasons}")
    changes = sum(metrics.winner_changes.values())
    told.append(f"the leading bidder of a task changed {count(changes, 'time')}")
    result = trace.finished()
    trouble = ""
    if result.status != "converged":
        trouble = f"<p><b>They did not agree:</b> {escape(result.reason)}</p>"
    return (
        f'<section>\n<h2>How they agreed</h2>\n<p class="hint">{"; ".join(told)}.</p>\n{trouble}'
        f'<div class="charts"><div><h3>Tasks taken, {per}</h3>{bids}</div>'
        f"<div><h3>Broadcasts, {per}</h3>{sent}</div></div>\n</section>"
    )


def _checks(violations: Sequence[Violation] | None) -> str:
    if violations is None:
        return ""
    rules = "windows, speed, range and return, equipment, one agent a seat, order, and the score"
    if not violations:
        return (
            "<section>\n<h2>Check</h2>\n"
            f"<p>Recomputed from the mission alone by code that shares nothing with the auction: {rules}. "
            "No violation.</p>\n</section>"
        )
    rows = "".join(
        f"<tr><td>{escape(found.agent or '')}</td><td>{escape(found.task or '')}</td>"
        f'<td>{escape(found.rule)}</td><td class="wide">{escape(found.detail)}</td></tr>'
        for found in violations[:MOST_LISTED]
    )
    rest = len(violations) - MOST_LISTED
    more = f'<p class="hint">And {rest:,} more.</p>' if rest > 0 else ""
    return (
        f'<section>\n<h2>Check</h2>\n<p class="hint">The plan breaks rules ({rules}).</p>\n'
        '<div class="scroll"><table><thead><tr><th>Agent</th><th>Task</th><th>Rule</th>'
        f"<th>What is wrong</th></tr></thead><tbody>{rows}</tbody></table></div>{more}\n</section>"
    )


def _schedule(scene: Scene) -> str:
    rows, shown = [], 0
    for row in scene.rows:
        if row.plan.visits and shown < MOST_VISITS:
            rows.append(_schedule_rows(row))
            shown += len(row.plan.visits)
    if not rows:
        return ""
    total = sum(len(row.plan.visits) for row in scene.rows)
    more = f'<p class="hint">The first {shown:,} of {total:,} visits; the plan file has them all.</p>'
    return (
        '<section class="long">\n<h2>Who, what, when</h2>\n'
        '<p class="hint">Times from the start of the mission.</p>\n'
        '<div class="scroll"><table><thead><tr><th>Agent</th><th class="n">Stop</th><th>Task</th>'
        '<th class="n">Arrives</th><th class="n">Waits</th><th class="n">Starts</th><th class="n">Ends</th>'
        '<th class="n">Leg</th><th class="n">Score</th></tr></thead>'
        f"{''.join(rows)}</table></div>{more if shown < total else ''}\n</section>"
    )


def _schedule_rows(row: Row) -> str:
    lines = []
    for place, visit in enumerate(row.plan.visits):
        first = f'<td class="first">{escape(row.agent.id)}</td>' if place == 0 else '<td class="more"></td>'
        wait = visit.start - visit.arrival
        cells = (
            clock(visit.arrival),
            span_of(wait) if wait >= 0.05 else "",
            clock(visit.start),
            clock(visit.end),
            metres(visit.leg),
            f"{visit.score:,.1f}",
        )
        lines.append(
            f'<tr>{first}<td class="n">{place + 1}</td><td class="wide">{escape(visit.task)}</td>'
            + "".join(f'<td class="n">{cell}</td>' for cell in cells)
            + "</tr>"
        )
    home = "back at base" if row.agent.base is not None else "done"
    lines.append(
        f'<tr class="total"><td class="more"></td><td></td><td>{home}</td><td></td><td></td><td></td>'
        f'<td class="n">{clock(row.plan.finish)}</td><td class="n">{metres(row.plan.distance)}</td>'
        f'<td class="n">{row.plan.score:,.1f}</td></tr>'
    )
    who = escape(row.agent.id)
    return f'<tbody class="{colour_class(row.index)}" data-agent="{who}">{"".join(lines)}</tbody>'
