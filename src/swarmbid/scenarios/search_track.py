"""A few UAVs search a square for static and moving targets, visit the ones and follow the others.

The mission of Dymkou's slides, which give no numbers: these are ours, of a small fixed-wing fleet. How many
targets there are, and where, no UAV knows.

Examples
--------
>>> from swarmbid.scenarios import search_track
>>> mission = search_track.make(seed=1, uavs=3, static=2, moving=1)
>>> [target.kind for target in mission.targets]
['static', 'static', 'constant_velocity']
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from swarmbid.rng import stream
from swarmbid.scenarios._options import chosen, option
from swarmbid.scenarios._search import check, free_places, square_with_hole, vehicles
from swarmbid.world.mission import SearchMission
from swarmbid.world.sensor import Sensor
from swarmbid.world.targets import Target

KINDS = ("constant_velocity", "random_walk", "evasive")
"""Kinds of moving targets, in turn."""


@dataclass(frozen=True, kw_only=True)
class Options:
    """What `make` understands; each field tells its meaning and unit in ``metadata["help"]``."""

    uavs: int = option(6, "how many UAVs, 1 or more")
    static: int = option(6, "how many targets that rest")
    moving: int = option(3, "how many targets that move")
    width: float = option(4000.0, "side of the square, m")
    hole: float = option(600.0, "side of the no-fly zone, m; 0 for none")
    duration: float = option(1800.0, "how long the mission lasts, s")
    speed: float = option(20.0, "speed of every UAV, m/s")
    turn_radius: float = option(40.0, "tightest turn, m; 0 for one that can hover")
    altitude: float = option(120.0, "above ground, m")
    view: float = option(90.0, "field of view of the camera, degrees")
    detection: float = option(0.8, "probability to detect a target below in one look, 0 to 1")
    endurance: float = option(1800.0, "s in the air on the best battery; the oldest lasts 0.6 of it")
    reserve: float = option(120.0, "s of fuel that are never used")
    radio_range: float = option(0.0, "m; 0 for one without limit")
    target_speed: float = option(4.0, "of moving targets, m/s")
    dwell: float = option(20.0, "how long a static target is looked at, s")

    def __post_init__(self) -> None:
        lowest = {"uavs": 1, "static": 0, "moving": 0, "hole": 0, "turn_radius": 0, "reserve": 0,
                  "radio_range": 0,
                  "target_speed": 0, "dwell": 0, "detection": 0}  # fmt: skip
        check("search_track", self, lowest, ("width", "duration", "speed", "altitude", "view", "endurance"))


OPTIONS = Options()
"""The defaults, and through `dataclasses.fields` the name and meaning of every option."""


def make(seed: int = 0, **options: Any) -> SearchMission:
    """Make a search mission.

    Parameters
    ----------
    seed : same seed, same mission.
    options : fields of `Options`.
    """
    picked = chosen("search_track", Options, options)
    area = square_with_hole("search_track", picked.width, picked.hole)
    sensor = Sensor(
        half_angle=math.radians(picked.view) / 2.0,
        detection=picked.detection,
        fall_off="inverse_cube",
        sigma=5.0,
    )
    radio = picked.radio_range or math.inf
    return SearchMission(
        name=f"search_track-{picked.uavs}x{picked.static}+{picked.moving}-seed{seed}",
        area=area,
        vehicles=vehicles(
            picked.uavs, picked.width, sensor, altitude=picked.altitude, speed=picked.speed,
            turn_radius=picked.turn_radius, endurance=picked.endurance, reserve=picked.reserve,
            radio_range=radio,
        ),
        targets=(*_static(seed, picked, area), *_moving(seed, picked, area)),
        duration=picked.duration,
        cell=picked.width / 50.0,
        kind="independent",
        expected=10.0,
        diffusion=15.0 if picked.moving else 0.0,
        radio_range=radio,
        dwell=picked.dwell,
    )  # fmt: skip


def _static(seed: int, options: Options, area: Any) -> list[Target]:
    places = free_places(seed, "static", options.static, area)
    return [Target(id=f"s{row + 1:02d}", kind="static", position=place) for row, place in enumerate(places)]


def _moving(seed: int, options: Options, area: Any) -> list[Target]:
    found = []
    for row, place in enumerate(free_places(seed, "moving", options.moving, area)):
        heading = float(stream(seed, "search", "heading", row).uniform(-math.pi, math.pi))
        speed = options.target_speed
        velocity = (speed * math.cos(heading), speed * math.sin(heading))
        kind = KINDS[row % len(KINDS)]
        found.append(Target(id=f"m{row + 1:02d}", kind=kind, position=place, velocity=velocity, speed=speed))
    return found
