"""Make `substations.yaml`, the demo mission, from the map in `data/`.

Run it as ``python examples/make_substations.py``. Every choice is a rule below and nothing is drawn by
lot, so the same map gives the same file, byte for byte.
"""

from __future__ import annotations

import json
import math
from collections import Counter
from pathlib import Path

HERE = Path(__file__).resolve().parent

SPACING = 400.0  # m; buses closer than this are one site, seen in one visit
HEIGHT = 40.0  # m above ground, from where a substation is looked at
METRES_PER_DEGREE = 111_200.0  # of latitude; good enough for choosing sites

HEAD = """\
# A 20 kV network in the Upper Rhine valley is inspected from the air. Made by make_substations.py from
# data/oberrhein_20kv.geojson (pandapower's "MV Oberrhein", BSD 3-Clause; see data/README.md).
#
# Eight UAVs wait at the two 110 kV substations that feed the network. Quadrotors carry a camera; the
# faster and more enduring VTOLs (wings that take off upright) carry a thermal camera as well. All must
# be back before their batteries are empty. Work is wanted soon: a reward fades by a fifth in about 37
# minutes (discount).
#
# branch-*    three or more lines meet: hot joints are looked for, so a thermal camera is needed
# station-*   lines pass through: a look with any camera
# customer-*  the end of a line: somebody must be on site to switch, hence a time window

name: substations

origin:
  latitude: {latitude}
  longitude: {longitude}
  altitude: 0
  altitude_reference: terrain_agl  # all altitudes are metres above the ground below

"""

QUADROTOR = """\
    type: quadrotor
    speed: 15             # m/s
    endurance: 2100       # s, landing at the base included
    fuel_per_metre: 0.0002
    equipment: [camera]
"""

VTOL = """\
    type: vtol
    speed: 21             # m/s
    endurance: 3000       # s
    fuel_per_metre: 0.0003
    equipment: [camera, thermal]
"""

# Somebody is on site early, in the middle, or late: start of service from ... to ..., s.
WINDOWS = ((0, 1200), (600, 1800), (1200, 2400))

Place = tuple[float, float]  # longitude, latitude, as GeoJSON has it


def read_map() -> tuple[dict[int, Place], list[int], Counter[int]]:
    """Return where the buses are, those of 110 kV, and how many lines meet at each."""
    features = json.loads((HERE / "data" / "oberrhein_20kv.geojson").read_text(encoding="utf-8"))["features"]
    places: dict[int, Place] = {}
    feeders: list[int] = []
    lines: Counter[int] = Counter()
    for feature in features:
        properties = feature["properties"]
        if properties["kind"] == "bus":
            longitude, latitude = feature["geometry"]["coordinates"]
            places[properties["id"]] = (longitude, latitude)
            if properties["vn_kv"] > 100:
                feeders.append(properties["id"])
        else:
            lines.update((properties["from_bus"], properties["to_bus"]))
    return places, sorted(feeders), lines


def metres(a: Place, b: Place) -> float:
    """Distance on a flat map, for choosing sites only."""
    east = (a[0] - b[0]) * math.cos(math.radians(a[1]))
    return METRES_PER_DEGREE * math.hypot(east, a[1] - b[1])


def choose(places: dict[int, Place], feeders: list[int], lines: Counter[int]) -> list[int]:
    """Buses to visit, each at least SPACING from the rest; branches and ends of lines go first."""
    chosen: list[int] = []
    for bus in sorted(places, key=lambda bus: (lines[bus] == 2, bus)):
        if all(metres(places[bus], places[other]) >= SPACING for other in [*feeders, *chosen]):
            chosen.append(bus)
    return sorted(chosen)


def position(place: Place, altitude: float) -> str:
    """One place as the mission file writes it; six decimals are 0.1 m."""
    longitude, latitude = place
    return f"{{latitude: {latitude:.6f}, longitude: {longitude:.6f}, altitude: {altitude:.0f}}}"


def make() -> str:
    """Return the text of the mission file."""
    places, feeders, lines = read_map()
    longitude, latitude = places[feeders[0]]
    text = HEAD.replace("{latitude}", f"{latitude:.6f}").replace("{longitude}", f"{longitude:.6f}")

    text += "agents:\n"
    for base_number, feeder in enumerate(feeders):
        for number in range(4):
            kind, form = ("quad", QUADROTOR) if number < 2 else ("vtol", VTOL)
            text += f"  - id: {kind}-{'ew'[base_number]}{number % 2 + 1}\n{form}"
            text += f"    position: {position(places[feeder], 0)}\n    base: {position(places[feeder], 0)}\n"

    text += "\ntasks:\n"
    customers = 0
    for bus in choose(places, feeders, lines):
        kind = "branch" if lines[bus] > 2 else "station" if lines[bus] == 2 else "customer"
        text += f"  - id: {kind}-{bus:03d}\n    position: {position(places[bus], HEIGHT)}\n"
        if kind == "branch":
            text += "    type: thermal_survey\n    equipment: [thermal]\n    reward: 30\n    duration: 120\n"
        elif kind == "station":
            text += "    type: visual_check\n    equipment: [camera]\n    reward: 15\n    duration: 60\n"
        else:
            start, end = WINDOWS[customers % len(WINDOWS)]
            customers += 1
            text += "    type: switching_check\n    equipment: [camera]\n    reward: 20\n    duration: 90\n"
            text += f"    start: {start}\n    end: {end}\n"
        text += "    discount: 0.0001\n"
    return text


if __name__ == "__main__":
    (HERE / "substations.yaml").write_text(make(), encoding="utf-8")
