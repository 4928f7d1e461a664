"""Small search missions written as text, flown, and their conversations as text again.

A file has lines, ``----``, and what the trace of the flight says. Lines before:

    # for the reader
    mission [option=value ...]           of `SearchMission`, and of `fly` (seed, loss, strategy ...)
    uav ID EAST NORTH [option=value ...]   of `Vehicle`; view, detection, sigma and false_alarms of its sensor
    target ID EAST NORTH [option=value ...]   of `Target`; vx and vy, m/s, make it move straight
    crash ID SECONDS
    show KIND ...                        kinds of records to print, these by default: `SHOWN`
    must WORDS                           the flight says so: some line has these words, after the line of
                                         the `must` before; --rewrite cannot bury it
    never WORDS                          no line of the flight has these words
"""

from __future__ import annotations

import ast
import io
import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from swarmbid.trace import Trace, read_trace
from swarmbid.world.area import Area
from swarmbid.world.mission import SearchMission
from swarmbid.world.sensor import Sensor
from swarmbid.world.targets import Target
from swarmbid.world.vehicle import Vehicle
from swarmbid.worldsim import Sortie, fly

FLIGHT = ("seed", "loss", "delay", "strategy", "allocation", "through_bytes")
SHOWN = ("act", "stage", "detected", "ended")


@dataclass
class Small:
    """One small mission, and what must be heard of it."""

    mission: SearchMission
    flight: dict[str, Any]
    shown: tuple[str, ...] = SHOWN
    must: list[str] = field(default_factory=list)
    never: list[str] = field(default_factory=list)


def sensor(
    *, view: float = 90.0, detection: float = 1.0, sigma: float = 3.0, false_alarms: float = 0.0
) -> Sensor:
    """A camera that sees all within its view, degrees, unless it is told otherwise."""
    return Sensor(
        half_angle=math.radians(view) / 2.0, detection=detection, sigma=sigma, false_alarm_rate=false_alarms
    )


def small_world(text: str) -> Small:
    """Read a mission."""
    options: dict[str, Any] = {"duration": 120.0, "cell": 40.0, "dwell": 10.0}
    flight: dict[str, Any] = {"crashes": {}}
    width, uavs, targets = 800.0, [], []
    shown, must, never = SHOWN, [], []
    for line in text.strip().split("\n"):
        kind, _, rest = line.partition(" ")
        words = rest.split()
        if kind == "mission":
            for name, value in _options(words).items():
                if name == "width":
                    width = value
                else:
                    (flight if name in FLIGHT else options)[name] = value
        elif kind == "uav":
            uavs.append(_uav(words))
        elif kind == "target":
            targets.append(_target(words))
        elif kind == "crash":
            flight["crashes"][words[0]] = float(words[1])
        elif kind == "show":
            shown = tuple(words)
        elif kind == "must":
            must.append(rest)
        elif kind == "never":
            never.append(rest)
        else:
            assert kind == "#" or not line, line
    area = Area(((0.0, 0.0), (width, 0.0), (width, width), (0.0, width)))
    mission = SearchMission(area=area, vehicles=tuple(uavs), targets=tuple(targets), **options)
    return Small(mission, flight, shown, must, never)


def flown(small: Small) -> tuple[Sortie, Trace]:
    """Fly it; return how it went and what was recorded."""
    record = io.StringIO()
    sortie = fly(small.mission, trace=record, **small.flight)
    record.seek(0)
    return sortie, read_trace(record)


def told(trace: Trace, shown: tuple[str, ...] = SHOWN) -> list[str]:
    """The records of some kinds, a line each."""
    lines = []
    for record in trace.records:
        kind = record.__struct_config__.tag
        if kind in shown:
            lines.append(f"{record.t:g} s {record.agent} " + _words(kind, record))
    return lines


def play(path: Path, *, rewrite: bool) -> tuple[str, str, Small]:
    """Fly the mission in a file; return what the file says, what was really said, and the mission."""
    text = path.read_text(encoding="utf-8")
    head, _, _ = text.partition("\n----\n")
    small = small_world(head)
    _, trace = flown(small)
    said = head.rstrip("\n") + "\n----\n" + "\n".join(told(trace, small.shown)) + "\n"
    if rewrite and said != text:
        path.write_text(said, encoding="utf-8")
    return text, said, small


def missing(said: str, small: Small) -> list[str]:
    """What the flight should have said, in that order, and did not; or should not have said and did."""
    lines = said.partition("\n----\n")[2].split("\n")
    found, at = [], 0
    for words in small.must:
        place = next((row for row in range(at, len(lines)) if words in lines[row]), None)
        if place is None:
            found.append(f"must {words}")
        else:
            at = place + 1
    return found + [f"never {words}" for words in small.never if any(words in line for line in lines)]


def _words(kind: str, record: Any) -> str:
    match kind:
        case "act":
            to = record.to or "all"
            bid = "" if record.bid is None else f" {record.bid:.4g}"
            why = f" ({record.detail.strip()})" if record.detail.strip() else ""
            return f"{record.performative} {record.task} to {to}{bid}{why}"
        case "stage":
            return f"{record.role} of {record.task}: {record.state}"
        case "detected":
            what = "moving" if record.moving else "static"
            truth = record.truth or "nothing"
            return f"finds {record.task}, {what}, at {record.x:.0f} {record.y:.0f}, truly {truth}"
        case "ended":
            by = f" by {record.by}" if record.by else ""
            why = f" ({record.reason})" if record.reason else ""
            return f"knows {record.task} {record.outcome}{by}{why}"
        case "divided":
            return f"divides among {' '.join(record.searchers)} ({record.because})"
        case "crashed":
            return "crashes"
        case "pose":
            return f"{record.mode} at {record.x:.0f} {record.y:.0f}, {record.fuel:.0f} s left"
        case "tracked":
            return f"follows {record.task} at {record.x:.0f} {record.y:.0f}"
    return f"{kind} " + " ".join(f"{name}={getattr(record, name)}" for name in record.__struct_fields__[2:])


def _uav(words: list[str]) -> Vehicle:
    name, east, north, *more = words
    options = {"speed": 15.0, "altitude": 100.0, **_options(more)}
    eyes = {key: options.pop(key) for key in ("view", "detection", "sigma", "false_alarms") if key in options}
    place = (float(east), float(north), options.pop("altitude"))
    return Vehicle(id=name, position=place, sensor=sensor(**eyes), **options)


def _target(words: list[str]) -> Target:
    name, east, north, *more = words
    options = _options(more)
    velocity = (options.pop("vx", 0.0), options.pop("vy", 0.0))
    kind = options.pop("kind", "static" if velocity == (0.0, 0.0) else "constant_velocity")
    return Target(id=name, position=(float(east), float(north)), velocity=velocity, kind=kind, **options)


def _options(words: list[str]) -> dict[str, Any]:
    found = {}
    for word in words:
        name, _, value = word.partition("=")
        try:
            found[name] = ast.literal_eval(value)
        except (ValueError, SyntaxError):
            found[name] = value
    return found
