"""The map of a search mission: who flew where, where the targets were, what was found."""

from __future__ import annotations

from swarmbid.report.labels import LabelPlacer
from swarmbid.report.search_scene import Frame, Point, SearchScene, ground, parts_of, thin
from swarmbid.report.svg import CHARACTER_EM, dash, escape, metres, nice_step, number, tag
from swarmbid.sightings import ACCEPT

WIDTH, MOST_HEIGHT = 860.0, 820.0
_NAME = 10.5

STYLE = """
svg .area{fill:var(--sheet);stroke:var(--soft);stroke-width:1.4}
svg .zone{fill:var(--bad-bg);stroke:var(--bad);stroke-width:1;stroke-dasharray:5 3}
svg .flown{stroke:var(--c);stroke-width:1.3;fill:none;stroke-linejoin:round;opacity:.7}
svg .tracking{stroke:var(--c);stroke-width:2.8;fill:none;stroke-linejoin:round;stroke-linecap:round}
svg .homing{stroke:var(--c);stroke-width:1.3;fill:none;stroke-dasharray:6 4;opacity:.8}
svg .truth{stroke:var(--ink);stroke-width:1.4;fill:none;stroke-dasharray:1.5 3;stroke-linecap:round}
svg .target{fill:var(--ink);stroke:var(--sheet);stroke-width:1.5}
svg .found{fill:var(--sheet);stroke:var(--c);stroke-width:2.2}
svg .false{fill:none;stroke:var(--bad);stroke-width:1.6}
svg .awarded{stroke:var(--c);stroke-width:1.6;fill:none;stroke-dasharray:2 3}
svg .reach{fill:var(--c);opacity:.16}
svg .vehicle{fill:var(--c);stroke:var(--sheet);stroke-width:1.2}
svg .said{stroke:var(--c);stroke-width:1.4;fill:none}
svg .said.strong{stroke-width:2.8}
svg .caption{font-size:11.5px}
svg .step{font-size:12.5px;font-weight:650}
"""


def render_search_map(scene: SearchScene) -> str:
    """Draw the whole mission, seen from above, north up."""
    frame = scene.frame(0.0, 0.0, WIDTH, MOST_HEIGHT)
    height = frame.height
    placer = LabelPlacer(WIDTH, height)
    parts = [tag("rect", x=0, y=0, width=WIDTH, height=height, class_="sheet"), ground(scene, frame)]
    for vehicle, line in scene.vehicles.items():
        index = scene.colours[vehicle]
        drawn = [
            tag(
                "path",
                d=frame.path(places),
                class_=css,
                stroke_dasharray=None if css == "homing" else dash(index),
            )
            for css, places in parts_of(line, way_of_drawing)
            if len(places) > 1
        ]
        title = tag("title", escape(vehicle))
        parts.append(tag("g", title + "".join(drawn), class_=scene.colour(vehicle), data_agent=vehicle))
    for target, line in scene.targets.items():
        if line.places:
            shown = tag("path", d=frame.path(thin(line.places)), class_="truth")
            parts.append(
                shown + diamond(frame(line.places[0]), tag("title", escape(f"{target}, at the beginning")))
            )
    parts += [_awards(scene, frame), _detections(scene, frame), _crashes(scene, frame)]
    for target, line in scene.targets.items():
        if line.places:
            parts.append(_name(placer, frame(line.places[0]), target))
    parts.append(_scale(frame, height))
    return tag(
        "svg", "".join(parts), viewBox=f"0 0 {number(WIDTH)} {number(height)}", class_="chart-map", role="img"
    )


def way_of_drawing(mode: str) -> str:
    """CSS class of a part of a flight."""
    if mode in ("return", "base"):
        return "homing"
    return "tracking" if mode in ("track", "visit") else "flown"


def diamond(place: Point, inside: str = "", size: float = 5.0) -> str:
    """The sign of a true target."""
    x, y = place
    data = f"M{number(x)} {number(y - size)}l{number(size)} {number(size)}-{number(size)} {number(size)}"
    return tag("path", inside, d=f"{data}-{number(size)}-{number(size)}z", class_="target")


def cross(place: Point, css: str = "cross") -> str:
    """The sign of an end: a crash."""
    x, y = place
    return tag("path", d=f"M{number(x - 6)} {number(y - 6)}l12 12m-12 0l12-12", class_=css)


def _detections(scene: SearchScene, frame: Frame) -> str:
    parts = []
    for life in scene.lives.values():
        for number_, one in enumerate(life.detections):
            if number_ and one.truth:
                continue
            x, y = frame((one.x, one.y))
            words = f"{life.task}: {one.agent} finds {one.truth or 'a false alarm'} after {one.t:.0f} s"
            css = f"found {scene.colour(one.agent)}" if one.truth else "false"
            parts.append(tag("circle", tag("title", escape(words)), cx=x, cy=y, r=6.0, class_=css))
    return "".join(parts)


def _awards(scene: SearchScene, frame: Frame) -> str:
    """Join each winner, where it was at the award, with what it was awarded."""
    parts = []
    for life in scene.lives.values():
        for act in life.acts:
            if act.performative != ACCEPT or act.to not in scene.vehicles or not life.detections:
                continue
            winner = scene.vehicles[act.to].at(act.t)
            target = scene.targets.get(life.target)
            there = (target and target.at(act.t)) or (life.detections[0].x, life.detections[0].y)
            if winner is None:
                continue
            words = f"{life.task} is awarded to {act.to} after {act.t:.0f} s"
            line = tag("path", tag("title", escape(words)), d=frame.path([winner, there]), class_="awarded")
            parts.append(tag("g", line, class_=scene.colour(act.to)))
    return "".join(parts)


def _crashes(scene: SearchScene, frame: Frame) -> str:
    places = [scene.vehicles[one].at(t) for one, t in scene.crashes.items() if one in scene.vehicles]
    return "".join(cross(frame(place)) for place in places if place is not None)


def _name(placer: LabelPlacer, place: Point, text: str) -> str:
    width = len(text) * _NAME * CHARACTER_EM
    spot = placer.place(*place, 6.0, width, _NAME)
    return "" if spot is None else tag("text", escape(text), x=spot[0], y=spot[1], class_="name place")


def _scale(frame: Frame, height: float) -> str:
    length = nice_step(WIDTH / frame.scale, 8)
    wide = length * frame.scale
    rule = tag("path", d=f"M12 {number(height - 16)}v5h{number(wide)}v-5", class_="rule")
    return rule + tag(
        "text", metres(length), x=12 + wide / 2, y=height - 20, text_anchor="middle", class_="name"
    )
