"""The search mission: its faults, what is believed at first, what a trace says of it."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest

from swarmbid.errors import InputError
from swarmbid.world.area import Area
from swarmbid.world.grid import Grid
from swarmbid.world.mission import LIKELIEST, SearchMission
from swarmbid.world.sensor import Sensor
from swarmbid.world.targets import Target
from swarmbid.world.vehicle import Vehicle

BLOCK = ((400.0, 400.0), (600.0, 400.0), (600.0, 600.0), (400.0, 600.0))
HOLED = Area.square(1000.0, (BLOCK,))


def uav(**fields) -> Vehicle:
    return Vehicle(
        **{"id": "u", "position": (50.0, 50.0, 100.0), "sensor": Sensor(), "base": (0.0, 0.0), **fields}
    )


def mission(**fields) -> SearchMission:
    return SearchMission(
        **{"area": HOLED, "vehicles": [uav()], "targets": [Target(id="t", position=(9.0, 9.0))]} | fields
    )


def named(**fields) -> set[str]:
    with pytest.raises(InputError) as caught:
        mission(**fields)
    return {fault.field for fault in caught.value.faults}


def test_all_faults_are_told_at_once():
    wrong = {
        "name": "", "duration": 0.0, "cell": 0.0, "kind": "many", "expected": 0.0, "drift": (1.0,),
        "diffusion": -1.0, "radio_range": 0.0, "ground_station": (math.nan, 0.0), "dwell": -1.0,
        "reward": 0.0, "revisit": -1.0, "vehicles": (),
    }  # fmt: skip
    assert named(**wrong) == set(wrong)
    assert named(cell=1e-3) == {"cell"}
    assert named(datum=(0.0, 0.0, 0.0)) == named(datum=(0.0, 0.0)) == {"datum"}


def test_team_and_targets_are_in_the_free_area_and_can_come_home():
    inside = (500.0, 500.0, 100.0)
    assert named(vehicles=[uav(position=inside)]) == {"vehicles.u.position"}
    assert named(vehicles=[uav(base=(-1.0, 0.0))]) == {"vehicles.u.base"}
    assert named(targets=[Target(id="t", position=(500.0, 500.0))]) == {"targets.t.position"}
    assert named(vehicles=[uav(id="t")]) == {"vehicles, targets"}
    # 1000 m at 15 m/s are 67 s; with the reserve of 30 s more than 96 s.
    far = {"position": (1000.0, 0.0, 100.0), "reserve": 30.0}
    assert named(vehicles=[uav(**far, endurance=96.0)]) == {"vehicles.u.endurance"}
    assert mission(vehicles=[uav(**far, endurance=97.0)]).vehicles[0].endurance == 97.0


def test_somebody_must_bring_what_identifies():
    team = [uav(equipment=["camera"]), uav(id="v", equipment=["radar"])]
    assert mission(vehicles=team, identify=["camera", "radar"]).identify == ("camera", "radar")
    assert named(vehicles=team, identify=["lidar"]) == {"identify"}


def test_what_is_believed_at_first():
    grid = Grid(HOLED, 50.0)
    even = mission(expected=3.0).belief(grid).probability
    assert even.sum() == pytest.approx(3.0) and np.ptp(even[grid.mask]) == pytest.approx(0.0, abs=1e-12)
    assert not even[~grid.mask].any()
    near = mission(kind="one", datum=(225.0, 125.0, 80.0)).belief(grid).probability
    assert near.sum() == pytest.approx(1.0) and np.unravel_index(near.argmax(), grid.shape) == (2, 4)
    # exp(-1/2) one deviation away; cells are 50 m.
    assert near[2, 6] / near[2, 4] == pytest.approx(math.exp(-(100.0**2) / (2.0 * 80.0**2)))
    sure = mission(expected=1e6, datum=(1e5, 1e5, 10.0)).belief(grid).probability
    assert sure.max() == pytest.approx(LIKELIEST)


def test_roster_and_trace_head():
    world = mission(vehicles=[uav(), uav(id="v", endurance=500.0, radio_range=300.0, equipment=["b", "a"])])
    roster = world.roster()
    assert [agent.id for agent in roster.agents] == ["u", "v"] and not roster.tasks
    head = json.loads(json.dumps(world.to_dict(), allow_nan=False))
    assert Area.from_dict(head["area"]) == HOLED
    first, second = head["vehicles"]
    assert (first["endurance"], first["radio_range"], first["base"]) == (None, None, [0.0, 0.0])
    assert (second["endurance"], second["radio_range"], second["equipment"]) == (500.0, 300.0, ["a", "b"])
    assert first["radius"] == pytest.approx(100.0)
