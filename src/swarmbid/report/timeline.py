"""The timeline: one row an agent, from the start of the mission to the last return."""

from __future__ import annotations

import math

from swarmbid.report.scene import Row, Scene, count, has_window
from swarmbid.report.svg import (
    CHARACTER_EM,
    clock,
    colour_class,
    escape,
    metres,
    number,
    shorten,
    span_of,
    tag,
    time_step,
)

WIDTH = 1120.0
LEFT, RIGHT = 118.0, 112.0
TOP, BOTTOM = 26.0, 8.0
MOST_ROWS = 80

HATCH = (
    '<defs><pattern id="hatch" width="5" height="5" patternUnits="userSpaceOnUse" '
    'patternTransform="rotate(45)"><line x1="0" y1="0" x2="0" y2="5" class="hatch"/></pattern></defs>'
)


def render_timeline_svg(scene: Scene) -> str:
    """Draw travel thin, service thick, waiting hatched, windows pale beneath.

    Of more than `MOST_ROWS` agents with work, those that finish last are shown.
    """
    rows = timeline_rows(scene)
    pitch = 34.0 if len(rows) <= 20 else 24.0
    height = TOP + pitch * max(len(rows), 1) + BOTTOM
    scale = (WIDTH - LEFT - RIGHT) / scene.horizon
    parts = [HATCH, tag("title", "Timeline of every agent"), _axis(scene.horizon, scale, height)]
    for place, row in enumerate(rows):
        parts.append(_row(scene, row, TOP + pitch * (place + 0.5), pitch, scale))
    if not rows:
        parts.append(tag("text", "Nobody has anything to do.", x=LEFT, y=TOP + pitch * 0.6, class_="soft"))
    return tag(
        "svg",
        "".join(parts),
        viewBox=f"0 0 {number(WIDTH)} {number(height)}",
        class_="chart-time",
        role="img",
    )


def timeline_rows(scene: Scene) -> list[Row]:
    """Return the agents with work, in order of id; of too many, those that finish last."""
    busy = [row for row in scene.rows if row.plan.visits]
    if len(busy) > MOST_ROWS:
        last = sorted(busy, key=lambda row: (-row.plan.finish, row.index))[:MOST_ROWS]
        busy = sorted(last, key=lambda row: row.index)
    return busy


def _axis(horizon: float, scale: float, height: float) -> str:
    step = time_step(horizon, 10)
    parts = []
    for place in range(int(horizon / step + 1e-9) + 1):
        x = LEFT + place * step * scale
        parts.append(tag("line", x1=x, y1=TOP, x2=x, y2=height - BOTTOM, class_="grid"))
        parts.append(tag("text", clock(place * step), x=x, y=TOP - 9, class_="soft", text_anchor="middle"))
    parts.append(tag("line", x1=LEFT, y1=TOP, x2=WIDTH - RIGHT, y2=TOP, class_="axis"))
    return "".join(parts)


def _row(scene: Scene, row: Row, y: float, pitch: float, scale: float) -> str:
    """Draw one agent; `y` is the middle of its row, px."""
    thick = pitch * 0.44
    parts = [
        tag("title", escape(f"{row.agent.id} ({row.agent.type})")),
        tag("text", escape(shorten(row.agent.id, 16)), x=LEFT - 12, y=y + 4, text_anchor="end", class_="row"),
        tag("line", x1=LEFT, y1=y + pitch / 2, x2=WIDTH - RIGHT, y2=y + pitch / 2, class_="grid"),
    ]
    free = row.agent.available_at
    for place, visit in enumerate(row.plan.visits):
        task = scene.tasks[visit.task]
        if has_window(task):
            opens, closes = LEFT + task.start * scale, LEFT + min(task.end, scene.horizon) * scale
            parts.append(
                tag(
                    "rect",
                    x=opens,
                    y=y + thick / 2 + 2,
                    width=max(closes - opens, 1.5),
                    height=3,
                    rx=1.5,
                    class_="open",
                )
            )
        parts.append(_stretch("travel", LEFT + free * scale, LEFT + visit.arrival * scale, y))
        start, end = LEFT + visit.start * scale, LEFT + visit.end * scale
        arrival = LEFT + visit.arrival * scale
        told = f"{visit.task} ({task.type}), stop {place + 1}\n{clock(visit.start)} to {clock(visit.end)}"
        told += f"\nafter {metres(visit.leg)}"
        if start - arrival > 0.8:
            told += f", waits {span_of(visit.start - visit.arrival)}"
            parts.append(
                tag(
                    "rect",
                    x=arrival,
                    y=y - thick * 0.32,
                    width=start - arrival,
                    height=thick * 0.64,
                    class_="waiting",
                )
            )
        if has_window(task):
            told += f"\nstart of service from {clock(task.start)}"
            told += f" to {clock(task.end)}" if math.isfinite(task.end) else " on"
        # A visit without duration is still a visit: it stays visible.
        width = max(end - start, 2.5)
        box = tag("title", escape(told)) + tag(
            "rect", x=start, y=y - thick / 2, width=width, height=thick, rx=2.5, class_="service"
        )
        # The name where it fits, else the number that the map shows, else nothing.
        for name in (visit.task, str(place + 1)):
            if width - 4.0 >= len(name) * 10.0 * CHARACTER_EM:
                box += tag("text", escape(name), x=start + width / 2, y=y + 0.5, class_="inside")
                break
        parts.append(tag("g", box))
        free = visit.end
    parts.append(_stretch("back", LEFT + free * scale, LEFT + row.plan.finish * scale, y))
    load = f"{count(len(row.plan.visits), 'task')}, {metres(row.plan.distance)}"
    parts.append(tag("text", load, x=WIDTH - RIGHT + 10, y=y + 4, class_="soft"))
    return tag("g", "".join(parts), class_=colour_class(row.index), data_agent=row.agent.id)


def _stretch(css: str, x1: float, x2: float, y: float) -> str:
    return tag("line", x1=x1, y1=y, x2=x2, y2=y, class_=css) if x2 - x1 > 0.3 else ""
