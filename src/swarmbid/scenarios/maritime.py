"""Search and rescue at sea: a raft drifts from its last known position, and is followed until help comes.

Everything afloat drifts with the current, which is known, and each by its own leeway, which is not but for
its mean and spread (3 to 4 % of the wind for a raft). So the longer it takes, the wider the search: the
last known position is moved on by current and mean leeway, its variance grows by that of the leeway
(Stone, Theory of Optimal Search; the IAMSAR manual's datum). Aircraft and a ship set out from one harbour.

Examples
--------
>>> from swarmbid.scenarios import maritime
>>> mission = maritime.make(seed=1)
>>> [target.kind for target in mission.targets], mission.kind, len(mission.vehicles)
(['drifting'], 'one', 4)
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from swarmbid.errors import Fault, InputError
from swarmbid.rng import stream
from swarmbid.scenarios._options import chosen, option
from swarmbid.scenarios._search import Point, check
from swarmbid.world.area import Area
from swarmbid.world.mission import SearchMission
from swarmbid.world.sensor import Sensor
from swarmbid.world.targets import Target
from swarmbid.world.vehicle import Vehicle

LOOKOUT = 20.0
"""m above the water, of those who keep a lookout from a ship."""
TURNAROUND = 300.0
"""s on the ground to fill up."""
MARGIN = 0.05
"""Share of the width that whatever drifts keeps from the edge at the start."""


@dataclass(frozen=True, kw_only=True)
class Options:
    """What `make` understands; each field tells its meaning and unit in ``metadata["help"]``."""

    uavs: int = option(3, "how many UAVs, 1 or more")
    ships: int = option(1, "how many ships: slow, but not short of fuel")
    rafts: int = option(1, "how many drift, 1 or more; of one, it is known that there is one")
    width: float = option(10000.0, "side of the square of sea, m; the harbour is amid its south edge")
    duration: float = option(3600.0, "how long the mission lasts, s")
    elapsed: float = option(1800.0, "s since the last known position when the search begins")
    sigma: float = option(600.0, "standard deviation of the last known position, m")
    current: float = option(0.8, "speed of the current, m/s, towards the north-east")
    leeway: float = option(0.4, "mean speed of the leeway, m/s, towards the east")
    leeway_sigma: float = option(0.12, "its standard deviation on either axis, m/s")
    speed: float = option(22.0, "speed of every UAV, m/s")
    turn_radius: float = option(60.0, "tightest turn of a UAV, m")
    altitude: float = option(150.0, "of the UAVs above the water, m")
    reach: float = option(220.0, "how far a UAV or a lookout sees a raft, m")
    detection: float = option(0.6, "probability to detect a raft within reach in one look, 0 to 1")
    endurance: float = option(2400.0, "s in the air with full tanks")
    reserve: float = option(180.0, "s of fuel that are never used")
    ship_speed: float = option(12.0, "speed of a ship, m/s")
    radio_range: float = option(0.0, "m; 0 for one without limit")

    def __post_init__(self) -> None:
        zero = (
            "ships",
            "elapsed",
            "current",
            "leeway",
            "leeway_sigma",
            "turn_radius",
            "detection",
            "reserve",
        )
        lowest = {"uavs": 1.0, "rafts": 1.0, "radio_range": 0.0} | dict.fromkeys(zero, 0.0)
        positive = ("width", "duration", "sigma", "speed", "altitude", "reach", "endurance", "ship_speed")
        check("maritime", self, lowest, positive)
        far = max(_drift(self)) * (self.elapsed + self.duration)
        if far > 0.6 * self.width:
            why = f"is {self.width:g}, but what drifts may go {far:.0f} m"
            mend = f"Give at least {far / 0.6:.0f}, so that it stays inside."
            raise InputError([Fault("maritime", "width", why, mend)])


def _drift(options: Options) -> Point:
    """Current and mean leeway together, m/s."""
    each = options.current * math.sqrt(0.5)
    return each + options.leeway, each


OPTIONS = Options()
"""The defaults, and through `dataclasses.fields` the name and meaning of every option."""


def make(seed: int = 0, **options: Any) -> SearchMission:
    """Make a search mission.

    Parameters
    ----------
    seed : same seed, same mission.
    options : fields of `Options`.
    """
    picked = chosen("maritime", Options, options)
    width, elapsed = picked.width, picked.elapsed
    area = Area(((0.0, 0.0), (width, 0.0), (width, width), (0.0, width)))
    drift = _drift(picked)
    # Half of what will be drifted before the middle, half behind it: far from the edges all the time.
    half = 0.5 * (elapsed + picked.duration)
    known = (0.5 * width - drift[0] * half, 0.55 * width - drift[1] * half)
    spread = math.hypot(picked.sigma, picked.leeway_sigma * elapsed)
    # The leeway's share of the variance is s^2 t^2; a diffusion that grows as much by the mission's end.
    diffusion = picked.leeway_sigma**2 * (elapsed + 0.5 * picked.duration)
    radio = picked.radio_range or math.inf
    return SearchMission(
        name=f"maritime-{picked.uavs}+{picked.ships}x{picked.rafts}-seed{seed}",
        area=area,
        vehicles=(*_uavs(picked, radio), *_ships(picked, radio)),
        targets=_rafts(seed, picked, known, drift),
        duration=picked.duration,
        cell=width / 80.0,
        kind="one" if picked.rafts == 1 else "independent",
        expected=float(picked.rafts),
        datum=(known[0] + drift[0] * elapsed, known[1] + drift[1] * elapsed, spread),
        drift=drift,
        diffusion=diffusion,
        radio_range=radio,
    )


def _harbour(options: Options, row: int, count: int) -> Point:
    return 0.5 * options.width + 100.0 * (row - (count - 1) / 2.0), 0.02 * options.width


def _sensor(options: Options, height: float) -> Sensor:
    half_angle = math.atan(options.reach / height)
    return Sensor(half_angle=half_angle, detection=options.detection, fall_off="definite", sigma=5.0)


def _uavs(options: Options, radio: float) -> list[Vehicle]:
    count = options.uavs + options.ships
    return [
        Vehicle(
            id=f"uav{row + 1:02d}",
            position=(*_harbour(options, row, count), options.altitude),
            speed=options.speed,
            turn_radius=options.turn_radius,
            endurance=options.endurance,
            reserve=options.reserve,
            turnaround=TURNAROUND,
            base=_harbour(options, row, count),
            sensor=_sensor(options, options.altitude),
            radio_range=radio,
        )
        for row in range(options.uavs)
    ]


def _ships(options: Options, radio: float) -> list[Vehicle]:
    count = options.uavs + options.ships
    return [
        Vehicle(
            id=f"ship{row + 1:02d}",
            type="ship",
            position=(*_harbour(options, options.uavs + row, count), LOOKOUT),
            speed=options.ship_speed,
            base=_harbour(options, options.uavs + row, count),
            sensor=_sensor(options, LOOKOUT),
            radio_range=radio,
        )
        for row in range(options.ships)
    ]


def _rafts(seed: int, options: Options, known: Point, drift: Point) -> tuple[Target, ...]:
    """Draw where each was, and how far its leeway is off the mean; let it drift until the search begins."""
    low, high = MARGIN * options.width, (1.0 - MARGIN) * options.width
    found = []
    for row in range(options.rafts):
        rng = stream(seed, "search", "raft", row)
        at, off = [], []
        for axis in (0, 1):
            own = options.leeway_sigma * float(rng.standard_normal())
            place = known[axis] + options.sigma * float(rng.standard_normal())
            place += (drift[axis] + own) * options.elapsed
            at.append(min(max(place, low), high))
            off.append(own)
        velocity = (off[0], off[1])
        found.append(Target(id=f"raft{row + 1}", kind="drifting", position=(at[0], at[1]), velocity=velocity))
    return tuple(found)
