"""The map: where the tasks are and who goes where, seen from above, north up."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from itertools import pairwise

from swarmbid.model import Mission, Position, Task
from swarmbid.plan import Plan
from swarmbid.report.labels import LabelPlacer
from swarmbid.report.scene import Row, Scene, count, has_window
from swarmbid.report.style import DRAWING, PICTURE_THEME
from swarmbid.report.svg import (
    CHARACTER_EM,
    clock,
    colour_class,
    dash,
    escape,
    metres,
    nice_step,
    number,
    shorten,
    tag,
)

WIDTH = 840.0
LOWEST, HIGHEST = 380.0, 820.0
MARGIN = 46.0
LEGEND_ROW = 22.0
MOST_LABELS = 160
MOST_ORDERS = 400
MOST_LEGEND = 24
NAME_SIZE = 10.5
WINDOW_GAP = 3.2  # px between a marker and the dashed outline of its window
POINTED = 1.22  # how much further a diamond or triangle reaches than a circle of the same weight
SMALL = 5.0  # px; smaller markers carry neither number nor window
SHAPES = ("circle", "square", "diamond", "triangle")


def render_map_svg(mission: Mission, plan: Plan, *, standalone: bool = True) -> str:
    """Draw the map.

    Parameters
    ----------
    mission, plan : what to draw.
    standalone : bring colours, a legend and the XML namespace, so that it is a picture by itself; the
        page, which has all that, leaves it out.

    Returns
    -------
    One ``<svg>`` element.
    """
    scene = Scene(mission, plan)
    frame = _Frame.around(mission)
    legend = _legend(scene) if standalone else ([], 0.0)
    height = frame.height + legend[1]
    parts = [
        tag("title", escape(f"Map of {mission.name}")),
        tag("style", PICTURE_THEME + DRAWING) if standalone else "",
        tag("rect", x=0, y=0, width=WIDTH, height=height, rx=10, class_="sheet"),
        _grid(frame),
    ]
    parts += [_path(frame, scene, row) for row in scene.rows if row.plan.visits]
    parts += _places(frame, scene)
    parts.append(_furniture(frame))
    if legend[0]:
        parts.append(tag("g", "".join(legend[0]), transform=f"translate(0 {number(frame.height)})"))
    return tag(
        "svg",
        "".join(parts),
        xmlns="http://www.w3.org/2000/svg" if standalone else None,
        viewBox=f"0 0 {number(WIDTH)} {number(height)}",
        class_="chart-map",
        role="img",
    )


def shape_of(scene: Scene) -> dict[str, str]:
    """Give each type of task a shape: the commonest the circle; beyond four the last one stands."""
    types = Counter(task.type for task in scene.mission.tasks)
    ranked = sorted(types, key=lambda name: (-types[name], name))
    return {name: SHAPES[min(place, len(SHAPES) - 1)] for place, name in enumerate(ranked)}


def marker(shape: str, x: float, y: float, radius: float, css: str) -> str:
    """Draw one task's marker, centred."""
    if shape == "circle":
        return tag("circle", cx=x, cy=y, r=radius, class_=css)
    if shape == "square":
        half = radius * 0.9
        return tag("rect", x=x - half, y=y - half, width=2 * half, height=2 * half, rx=2, class_=css)
    reach = radius * POINTED
    if shape == "diamond":
        points = [(x, y - reach), (x + reach, y), (x, y + reach), (x - reach, y)]
    else:
        points = [(x, y - reach), (x + reach, y + reach * 0.8), (x - reach, y + reach * 0.8)]
    joined = " ".join(f"{number(a)},{number(b)}" for a, b in points)
    return tag("polygon", points=joined, class_=css)


@dataclass(frozen=True)
class _Frame:
    """Metres to pixels: equal scale both ways, north up."""

    west: float
    north: float
    scale: float  # pixels per m
    height: float

    @classmethod
    def around(cls, mission: Mission) -> _Frame:
        places = [task.position for task in mission.tasks] + [agent.position for agent in mission.agents]
        places += [agent.base for agent in mission.agents if agent.base is not None]
        easts = [place[0] for place in places] or [0.0]
        norths = [place[1] for place in places] or [0.0]
        wide, high = max(easts) - min(easts), max(norths) - min(norths)
        # A single point, or a line of points, still gets a map around it.
        if max(wide, high) < 1.0:
            wide, high = 100.0, 40.0
        least = max(wide, high) * 0.02
        wide, high = max(wide, least), max(high, least)
        inner = WIDTH - 2 * MARGIN
        height = min(max(inner * high / wide + 2 * MARGIN, LOWEST), HIGHEST)
        scale = min(inner / wide, (height - 2 * MARGIN) / high)
        centre_east, centre_north = (max(easts) + min(easts)) / 2, (max(norths) + min(norths)) / 2
        return cls(
            west=centre_east - WIDTH / 2 / scale,
            north=centre_north + height / 2 / scale,
            scale=scale,
            height=height,
        )

    def at(self, place: Position) -> tuple[float, float]:
        """Pixels of a position in m."""
        return (place[0] - self.west) * self.scale, (self.north - place[1]) * self.scale


def _grid(frame: _Frame) -> str:
    step = nice_step(WIDTH / frame.scale, 8)
    parts, labels = [], []
    east = -(-frame.west // step) * step
    while (x := (east - frame.west) * frame.scale) <= WIDTH:
        parts.append(tag("line", x1=x, y1=0, x2=x, y2=frame.height, class_="grid"))
        if MARGIN < x < WIDTH - 130:
            label = _coordinate(east, step)
            labels.append(tag("text", label, x=x, y=frame.height - 8, class_="soft", text_anchor="middle"))
        east += step
    north = (frame.north // step) * step
    while (y := (frame.north - north) * frame.scale) <= frame.height:
        parts.append(tag("line", x1=0, y1=y, x2=WIDTH, y2=y, class_="grid"))
        if 20 < y < frame.height - 24:
            labels.append(tag("text", _coordinate(north, step), x=8, y=y + 4, class_="soft"))
        north -= step
    return "".join(parts + labels)


def _coordinate(value: float, step: float) -> str:
    """Write a coordinate in the unit of the grid."""
    if step >= 1000.0:
        text = f"{value / 1000 + 0.0:,.0f} km"
    elif step >= 100.0 and abs(value) >= 1000.0:
        text = f"{value / 1000:.1f} km"
    else:
        text = f"{value + 0.0:.{0 if step >= 1.0 else 1}f} m"
    return text.replace("-", "−")


def _path(frame: _Frame, scene: Scene, row: Row) -> str:
    points = [frame.at(row.agent.position)]
    points += [frame.at(scene.tasks[visit.task].position) for visit in row.plan.visits]
    joined = " ".join(f"{number(x)},{number(y)}" for x, y in points)
    shown = f"{row.agent.id}: {count(len(row.plan.visits), 'stop')}, {metres(row.plan.distance)}"
    parts = [
        tag("title", escape(shown)),
        tag("polyline", points=joined, class_="halo"),
    ]
    if row.agent.base is not None:
        x1, y1 = points[-1]
        x2, y2 = frame.at(row.agent.base)
        parts.append(tag("line", x1=x1, y1=y1, x2=x2, y2=y2, class_="home"))
    parts.append(tag("polyline", points=joined, class_="leg", stroke_dasharray=dash(row.index)))
    for (x1, y1), (x2, y2) in pairwise(points):
        parts.append(_arrow(x1, y1, x2, y2))
    return tag("g", "".join(parts), class_=colour_class(row.index), data_agent=row.agent.id)


def _arrow(x1: float, y1: float, x2: float, y2: float) -> str:
    length = ((x2 - x1) ** 2 + (y2 - y1) ** 2) ** 0.5
    if length < 44.0:
        return ""
    along_x, along_y = (x2 - x1) / length, (y2 - y1) / length
    # A little beyond the middle, so that crossing legs do not hide each other's arrows.
    x, y = x1 + (x2 - x1) * 0.56, y1 + (y2 - y1) * 0.56
    corners = [
        (x + 6 * along_x, y + 6 * along_y),
        (x - 4 * along_x - 4.6 * along_y, y - 4 * along_y + 4.6 * along_x),
        (x - 4 * along_x + 4.6 * along_y, y - 4 * along_y - 4.6 * along_x),
    ]
    return tag("polygon", points=" ".join(f"{number(a)},{number(b)}" for a, b in corners), class_="arrow")


def _places(frame: _Frame, scene: Scene) -> list[str]:
    """Draw bases, agents, tasks, and as many names as find room."""
    num_tasks = len(scene.mission.tasks)
    radius = (
        8.5 if num_tasks <= 80 else 6.5 if num_tasks <= MOST_LABELS else 4.0 if num_tasks <= 1000 else 2.5
    )
    shapes = shape_of(scene)
    placer = LabelPlacer(WIDTH, frame.height)
    # The corners that the furniture takes, and the edges with the coordinates.
    placer.block(0, 0, MARGIN, frame.height)
    placer.block(0, frame.height - 20, WIDTH, frame.height)
    placer.block(WIDTH - 130, frame.height - 44, WIDTH, frame.height)
    placer.block(WIDTH - 44, 0, WIDTH, 64)
    for row in scene.rows:
        stops = [frame.at(scene.tasks[visit.task].position) for visit in row.plan.visits]
        for (x1, y1), (x2, y2) in pairwise([frame.at(row.agent.position), *stops]):
            placer.avoid(x1, y1, x2, y2)
    parts = []
    reach = {task.id: _reach(scene, task, shapes[task.type], radius) for task in scene.mission.tasks}
    for task in scene.mission.tasks:
        (x, y), room = frame.at(task.position), reach[task.id]
        placer.block(x - room, y - room, x + room, y + room)
    for task in scene.mission.tasks:
        parts.append(_task(frame, scene, task, shapes[task.type], radius, numbered=num_tasks <= MOST_ORDERS))
    names: list[tuple[float, float, float, str, str]] = []
    for (x, y), home in sorted(_homes(frame, scene).items()):
        placer.block(x - 9, y - 9, x + 9, y + 9)
        parts.append(_home(x, y, home))
        names.append((x, y, 9.0, home.name, "name place"))
    if num_tasks <= MOST_LABELS:
        for task in scene.mission.tasks:
            x, y = frame.at(task.position)
            css = "name" if task.id in scene.served else "name missed-name"
            names.append((x, y, reach[task.id], shorten(task.id, 22), css))
    for x, y, room, text, css in names:
        spot = placer.place(x, y, room, _width(text), NAME_SIZE)
        if spot is not None:
            parts.append(_name(x, spot, text, css))
    return parts


def _reach(scene: Scene, task: Task, shape: str, radius: float) -> float:
    """Return how far a task's marker reaches out, px, its dashed window included."""
    if has_window(task) and radius > SMALL and task.id in scene.served:
        radius += WINDOW_GAP
    return radius * POINTED if shape in ("diamond", "triangle") else radius


def _name(x: float, spot: tuple[float, float], text: str, css: str) -> str:
    """Write a name; one to the left of its point ends there, so that larger type grows away from it."""
    left, base = spot
    width = _width(text)
    ends = left + width < x
    return tag(
        "text",
        escape(text),
        x=left + width if ends else left,
        y=base,
        text_anchor="end" if ends else None,
        class_=css,
    )


def _width(name: str) -> float:
    return len(name) * NAME_SIZE * CHARACTER_EM


def _task(frame: _Frame, scene: Scene, task: Task, shape: str, radius: float, *, numbered: bool) -> str:
    x, y = frame.at(task.position)
    told = [f"{task.id} ({task.type}), reward {task.reward:g}"]
    if has_window(task):
        closes = f" to {clock(task.end)}" if task.end < float("inf") else " on"
        told.append(f"start of service from {clock(task.start)}{closes}")
    visits = scene.served.get(task.id, [])
    if not visits:
        left = scene.reasons.get(task.id)
        told.append(f"not served. {left.detail if left else ''}".rstrip())
        reach = radius * 0.42
        inner = tag("title", escape("\n".join(told))) + marker(shape, x, y, radius * 0.95, "missed")
        inner += tag(
            "path",
            d=f"M{number(x - reach)} {number(y - reach)}L{number(x + reach)} {number(y + reach)}"
            f"M{number(x - reach)} {number(y + reach)}L{number(x + reach)} {number(y - reach)}",
            class_="cross",
        )
        return tag("g", inner)
    told += [
        f"{row.agent.id}, stop {place + 1}: {clock(visit.start)} to {clock(visit.end)}"
        for row, place, visit in visits
    ]
    row, place, _ = visits[0]
    inner = tag("title", escape("\n".join(told)))
    if has_window(task) and radius > SMALL:
        inner += marker(shape, x, y, radius + WINDOW_GAP, "window")
    inner += marker(shape, x, y, radius, "stop")
    if numbered and radius > SMALL:
        shown = str(place + 1) if len(visits) == 1 else f"×{len(visits)}"
        size = radius + 1.5 if len(shown) < 2 else radius
        middle = y + (radius * 0.22 if shape == "triangle" else 0.0)
        inner += tag("text", shown, x=x, y=middle, class_="order", style=f"font-size:{number(size)}px")
    css = colour_class(row.index) if len(visits) == 1 else "shared"
    return tag("g", inner, class_=css, data_agent=row.agent.id if len(visits) == 1 else None)


@dataclass
class _Home:
    """Who starts from a place and who returns to it."""

    starts: list[Row]
    returns: list[Row]

    @property
    def name(self) -> str:
        who = self.starts or self.returns
        shown = shorten(who[0].agent.id, 22) if len(who) == 1 else f"{len(who)} agents"
        return f"Base, {shown}" if self.returns else shown


def _homes(frame: _Frame, scene: Scene) -> dict[tuple[float, float], _Home]:
    """Gather the agents that start from, or return to, the same pixel."""
    homes: dict[tuple[float, float], _Home] = {}

    def home(place: Position) -> _Home:
        x, y = frame.at(place)
        return homes.setdefault((round(x, 1), round(y, 1)), _Home([], []))

    for row in scene.rows:
        home(row.agent.position).starts.append(row)
        if row.agent.base is not None:
            home(row.agent.base).returns.append(row)
    return homes


def _home(x: float, y: float, home: _Home) -> str:
    who = home.starts or home.returns
    told = "\n".join(f"{row.agent.id} ({row.agent.type}), {row.agent.speed:g} m/s" for row in who[:12])
    if len(who) > 12:
        told += f"\nand {len(who) - 12} more"
    title = tag("title", escape(told))
    if home.returns:
        # A house: here they return.
        roof = f"M{number(x - 9)} {number(y)}L{number(x)} {number(y - 9)}L{number(x + 9)} {number(y)}"
        return tag("g", title + tag("path", d=roof + "h-2.5v8h-13v-8z", class_="base"))
    css = f"origin {colour_class(who[0].index)}" if len(who) == 1 else "origin shared"
    return tag("g", title + tag("circle", cx=x, cy=y, r=5.5, class_=css))


def _furniture(frame: _Frame) -> str:
    """Draw the scale bar and the north arrow."""
    length = nice_step(44.0 / frame.scale, 1)  # a round number, 44 to 110 px long
    pixels = length * frame.scale
    right, low = WIDTH - 16.0, frame.height - 12.0
    left = right - pixels
    bar = tag("path", d=f"M{number(left)} {number(low - 5)}v5H{number(right)}v-5", class_="rule")
    bar += tag("text", metres(length), x=(left + right) / 2, y=low - 8, text_anchor="middle")
    x, y = WIDTH - 24.0, 14.0
    arrow = tag(
        "path",
        d=f"M{number(x)} {number(y)}l7 22-7-5-7 5z",
        class_="ink",
    ) + tag("text", "N", x=x, y=y + 36, text_anchor="middle", class_="place")
    return bar + arrow


def _legend(scene: Scene) -> tuple[list[str], float]:
    """Lay out the agents' names under a picture that stands alone."""
    busy = [row for row in scene.rows if row.plan.visits]
    texts = [
        f"{shorten(row.agent.id, 18)}: {count(len(row.plan.visits), 'task')}, {metres(row.plan.distance)}"
        for row in busy[:MOST_LEGEND]
    ]
    notes = [f"and {count(len(busy) - MOST_LEGEND, 'more agent')}"] * (len(busy) > MOST_LEGEND)
    if scene.unserved:
        notes.append(f"crossed out: {count(len(scene.unserved), 'task')} not served")
    widest = max((len(text) for text in [*texts, *notes]), default=0) * 11 * CHARACTER_EM + 50.0
    columns = max(1, int((WIDTH - 16.0) // widest))
    parts = []
    for place, text in enumerate([*texts, *notes]):
        x = 16.0 + place % columns * widest
        y = 20.0 + place // columns * LEGEND_ROW
        if place >= len(texts):
            parts.append(tag("text", escape(text), x=x, y=y, class_="soft"))
            continue
        index = busy[place].index
        line = tag("line", x1=x, y1=y - 4, x2=x + 26, y2=y - 4, class_="leg", stroke_dasharray=dash(index))
        label = tag("text", escape(text), x=x + 33, y=y)
        parts.append(tag("g", line + label, class_=colour_class(index)))
    return parts, 20.0 + (len(parts) - 1) // columns * LEGEND_ROW + 12.0 if parts else 0.0
