"""Static targets that are identified by groups: one UAV of each brings the camera, another the rangefinder.

Whoever finds a target announces it, as in `search_track`; to identify it a group must be there together
(coalition formation, Hunt et al. 2014). The numbers are ours, of a small fixed-wing fleet.

Examples
--------
>>> from swarmbid.scenarios import identify
>>> mission = identify.make(seed=1, uavs=3, static=2)
>>> [sorted(vehicle.equipment) for vehicle in mission.vehicles]
[['camera'], ['rangefinder'], ['camera']]
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from swarmbid.scenarios._options import chosen, option
from swarmbid.scenarios._search import check, free_places, square_with_hole, vehicles
from swarmbid.world.mission import SearchMission
from swarmbid.world.sensor import Sensor
from swarmbid.world.targets import Target

EQUIPMENT = ("camera", "rangefinder")
"""What a group must bring; the UAVs carry one each, in turn."""


@dataclass(frozen=True, kw_only=True)
class Options:
    """What `make` understands; each field tells its meaning and unit in ``metadata["help"]``."""

    uavs: int = option(6, "how many UAVs, 2 or more")
    static: int = option(6, "how many targets, all at rest")
    width: float = option(3000.0, "side of the square, m")
    hole: float = option(400.0, "side of the no-fly zone, m; 0 for none")
    duration: float = option(1500.0, "how long the mission lasts, s")
    speed: float = option(20.0, "speed of every UAV, m/s")
    turn_radius: float = option(40.0, "tightest turn, m; 0 for one that can hover")
    altitude: float = option(120.0, "above ground, m")
    view: float = option(90.0, "field of view of the sensor that searches, degrees")
    detection: float = option(0.8, "probability to detect a target below in one look, 0 to 1")
    endurance: float = option(1800.0, "s in the air with full tanks")
    reserve: float = option(120.0, "s of fuel that are never used")
    radio_range: float = option(0.0, "m; 0 for one without limit")
    dwell: float = option(20.0, "how long a group looks at a target, s")
    revisit: float = option(0.0, "s between further visits to a target; 0 for none")

    def __post_init__(self) -> None:
        lowest: dict[str, float]
        lowest = {"uavs": len(EQUIPMENT), "static": 0, "hole": 0, "turn_radius": 0, "reserve": 0,
                  "radio_range": 0, "dwell": 0, "detection": 0, "revisit": 0}  # fmt: skip
        check("identify", self, lowest, ("width", "duration", "speed", "altitude", "view", "endurance"))


OPTIONS = Options()
"""The defaults, and through `dataclasses.fields` the name and meaning of every option."""


def make(seed: int = 0, **options: Any) -> SearchMission:
    """Make a search mission.

    Parameters
    ----------
    seed : same seed, same mission.
    options : fields of `Options`.
    """
    picked = chosen("identify", Options, options)
    area = square_with_hole("identify", picked.width, picked.hole)
    sensor = Sensor(
        half_angle=math.radians(picked.view) / 2.0,
        detection=picked.detection,
        fall_off="inverse_cube",
        sigma=5.0,
    )
    radio = picked.radio_range or math.inf
    places = free_places(seed, "static", picked.static, area)
    return SearchMission(
        name=f"identify-{picked.uavs}x{picked.static}-seed{seed}",
        area=area,
        vehicles=vehicles(
            picked.uavs, picked.width, sensor, altitude=picked.altitude, speed=picked.speed,
            turn_radius=picked.turn_radius, endurance=picked.endurance, reserve=picked.reserve,
            radio_range=radio, equipment=tuple(frozenset([name]) for name in EQUIPMENT),
        ),
        targets=tuple(
            Target(id=f"s{row + 1:02d}", kind="static", position=place, agents_required=0,
                   equipment=frozenset(EQUIPMENT), duration=picked.dwell)
            for row, place in enumerate(places)
        ),
        duration=picked.duration,
        cell=picked.width / 50.0,
        kind="independent",
        expected=8.0,
        radio_range=radio,
        dwell=picked.dwell,
        revisit=picked.revisit,
        identify=EQUIPMENT,
    )  # fmt: skip
