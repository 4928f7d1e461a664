"""The driver: same seed, same bytes; fuel, walls, radio, and what it refuses."""

from __future__ import annotations

import hashlib
import io
import itertools
import math
import os
import subprocess
import sys
from collections import Counter

import pytest

from smallworlds import flown, small_world
from swarmbid.errors import InputError
from swarmbid.scenarios import search_track
from swarmbid.trace import Act, Crashed, Detected, Pose, Sent, Trace, Truth
from swarmbid.world.area import Area
from swarmbid.worldsim import ALLOCATIONS, fly

SETTING = {
    "uavs": 3, "static": 3, "moving": 1, "width": 1200.0, "hole": 200.0, "duration": 200.0,
    "endurance": 140.0, "reserve": 20.0,
}  # fmt: skip
HARD = {"seed": 1, "loss": 0.2, "delay": 0.5, "crashes": {"uav02": 90.0}}
STRATEGIES = ("ours", "greedy", "lawnmower", "random_walk")

FLY = """
import hashlib, io
from swarmbid.scenarios import search_track
from swarmbid.worldsim import fly
record = io.StringIO()
fly(search_track.make(1, **{setting!r}), **{hard!r}, trace=record)
print(hashlib.sha256(record.getvalue().encode()).hexdigest())
"""


def bytes_of(seed: int = 1, **flight) -> bytes:
    record = io.BytesIO()
    fly(search_track.make(seed, **SETTING), seed=seed, trace=record, **flight)
    return record.getvalue()


def hashed(*hash_seeds: str) -> list[str]:
    """Fly in processes of their own; the hash of each trace."""
    program = [sys.executable, "-c", FLY.format(setting=SETTING, hard=HARD)]
    running = [
        subprocess.Popen(program, env=os.environ | {"PYTHONHASHSEED": one}, stdout=subprocess.PIPE, text=True)
        for one in hash_seeds
    ]
    return [one.communicate(timeout=120)[0].strip() for one in running]


class TestSameSeedSameBytes:
    def test_whatever_the_hash_seed(self):
        record = io.StringIO()
        fly(search_track.make(1, **SETTING), **HARD, trace=record)
        here = hashlib.sha256(record.getvalue().encode()).hexdigest()
        assert hashed("0", "1") == [here, here]

    def test_another_seed_flies_otherwise(self):
        assert bytes_of(1) != bytes_of(2)

    def test_through_bytes_changes_nothing(self):
        """What is not in the bytes of a message was not said."""
        assert bytes_of(loss=0.1, through_bytes=True) == bytes_of(loss=0.1)

    @pytest.mark.parametrize("allocation", ALLOCATIONS)
    def test_to_be_recorded_changes_nothing(self, allocation):
        mission = search_track.make(3, **SETTING)
        watched = fly(mission, seed=3, allocation=allocation, trace=io.StringIO())
        alone = fly(mission, seed=3, allocation=allocation)
        assert watched == alone

    def test_progress_is_told_in_seconds(self):
        told = []
        small = small_world("mission duration=35\nuav u1 100 100")
        fly(small.mission, progress=told.append)
        assert told == [0.0, 10.0, 20.0, 30.0]


def all_of(trace: Trace, kind: type) -> list:
    return list(trace.of(kind))


@pytest.fixture(scope="module", params=STRATEGIES)
def flight(request):
    """A flight whose vehicles must refuel, over an area with a hole."""
    small = small_world("uav u1 0 0")
    small.mission = search_track.make(2, **SETTING)
    small.flight = {"seed": 2, "strategy": request.param}
    return small.mission, *flown(small)


class TestPhysics:
    def test_the_reserve_is_never_touched(self, flight):
        _, _, trace = flight
        poses = all_of(trace, Pose)
        assert min(one.fuel for one in poses) >= SETTING["reserve"]
        modes = Counter(one.mode for one in poses)
        assert modes["return"] and modes["base"]  # they had to

    def test_they_refuel_and_fly_again(self, flight):
        mission, _, trace = flight
        risen = []
        for vehicle in mission.vehicles:
            fuel = [one.fuel for one in all_of(trace, Pose) if one.agent == vehicle.id]
            assert len(fuel) == 41 and max(fuel) <= vehicle.endurance
            risen += [vehicle.endurance - now for before, now in itertools.pairwise(fuel) if now > before]
        assert risen and max(risen) < 6.0  # full, or just off the ground

    def test_nobody_enters_the_no_fly_zone_beyond_a_turn(self, flight):
        """The arc of a turn may swing out by two turning radii (`vehicle.advance`), no farther."""
        mission, _, trace = flight
        allowance = 2.0 * mission.vehicles[0].turn_radius + mission.vehicles[0].speed
        west, south, east, north = mission.area.bounds
        for one in all_of(trace, Pose):
            assert depth(mission.area, one.x, one.y) <= allowance
            assert west - allowance <= one.x <= east + allowance
            assert south - allowance <= one.y <= north + allowance

    def test_nobody_is_faster_than_it_can_fly(self, flight):
        mission, _, trace = flight
        for vehicle in mission.vehicles:
            path = [one for one in all_of(trace, Pose) if one.agent == vehicle.id]
            for before, after in itertools.pairwise(path):
                way = math.dist((before.x, before.y), (after.x, after.y))
                landed = after.mode == "base" or before.mode == "return"
                landing = (2.0 * vehicle.turn_radius + 1.0) * landed
                assert way <= vehicle.speed * (after.t - before.t) + landing + 1e-6

    def test_the_truth_stays_in_the_area(self, flight):
        mission, _, trace = flight
        assert all(mission.area.inside((one.x, one.y)) for one in all_of(trace, Truth))

    def test_what_is_measured_is_what_is_recorded(self, flight):
        _, sortie, trace = flight
        assert trace.result.status == "flown"
        assert trace.result.measures["detections"] == list(sortie.measures.detections)
        sent = all_of(trace, Sent)
        assert sortie.messages == len(sent) and sortie.bytes == sum(one.bytes for one in sent)
        assert 0.0 <= sortie.measures.found <= 1.0
        first = {}
        for one in all_of(trace, Detected):
            if one.truth:
                first.setdefault(one.truth, one.t)
        assert sorted(first.values()) == list(sortie.measures.detections)


def depth(area: Area, x: float, y: float) -> float:
    """How deep a place lies in an exclusion zone, m; 0 outside all."""
    import shapely

    point = shapely.Point(x, y)
    return max(
        (
            polygon.exterior.distance(point)
            for polygon in map(shapely.Polygon, area.exclusions)
            if polygon.contains(point)
        ),
        default=0.0,
    )


class TestRadio:
    WORLD = """
mission duration=80 {options}
uav u1 200 400
uav u2 600 400
target s1 240 400
"""

    def flown(self, options: str):
        return flown(small_world(self.WORLD.format(options=options)))

    def test_out_of_reach_nobody_hears(self):
        _, trace = self.flown("radio_range=50")
        assert {one.receivers for one in all_of(trace, Sent)} == {0}
        assert {act.agent for act in all_of(trace, Act)} == {"u1"}

    def test_in_reach_the_other_bids(self):
        _, trace = self.flown("radio_range=1e5")
        assert {act.agent for act in all_of(trace, Act)} == {"u1", "u2"}

    def test_messages_are_lost_as_often_as_they_should(self):
        """Within three standard deviations of a binomial."""
        _, trace = self.flown("loss=0.5 radio_range=1e5")
        sent = sum(one.receivers for one in all_of(trace, Sent))
        lost = sum(one.lost for one in all_of(trace, Sent))
        assert abs(lost - 0.5 * sent) <= 3.0 * math.sqrt(0.25 * sent)

    @pytest.mark.parametrize("loss", [0.3, 0.6])
    def test_a_bad_radio_delays_but_the_target_is_served(self, loss):
        sortie, _ = self.flown(f"loss={loss} duration=150")
        assert sortie.measures.served == 1.0 and sortie.measures.unserved == 0

    def test_a_station_out_of_reach_is_not_linked(self):
        sortie, _ = self.flown("ground_station=(0,0) radio_range=1")
        assert sortie.measures.linked == 0.0
        sortie, _ = self.flown("ground_station=(200,400) radio_range=1e4")
        assert sortie.measures.linked == 1.0


class TestCrashes:
    WORLD = "mission duration=60\nuav u1 200 400\nuav u2 600 400\ncrash u2 {when}"

    @pytest.mark.parametrize("when", [0.0, 20.0, 33.5])
    def test_who_has_crashed_says_and_does_nothing_more(self, when):
        _, trace = flown(small_world(self.WORLD.format(when=when)))
        assert [(one.agent, one.t) for one in all_of(trace, Crashed)] == [("u2", math.ceil(when))]
        assert all(one.t < when for one in all_of(trace, Pose) if one.agent == "u2")
        assert all(one.t < when for one in all_of(trace, Sent) if one.agent == "u2")
        assert max(one.t for one in all_of(trace, Pose) if one.agent == "u1") == 60.0

    def test_after_the_end_nothing_happens(self):
        _, trace = flown(small_world(self.WORLD.format(when=61)))
        assert all_of(trace, Crashed) == []

    def test_all_may_crash(self):
        sortie, trace = flown(small_world(self.WORLD.format(when=10) + "\ncrash u1 10\ntarget s1 240 400"))
        assert len(all_of(trace, Crashed)) == 2 and sortie.measures.found == 0.0


class TestBadInput:
    @pytest.mark.parametrize(
        ("flight", "words"),
        [
            ({"strategy": "magic"}, "magic"),
            ({"allocation": "auction"}, "auction"),
            ({"crashes": {"u9": 10.0}}, "u9"),
            ({"crashes": {"u1": -1.0}}, "-1"),
            ({"crashes": {"u1": math.nan}}, "nan"),
            ({"crashes": {"u1": math.inf}}, "inf"),
            ({"loss": 1.5}, "loss"),
            ({"loss": math.nan}, "loss"),
            ({"delay": -1.0}, "delay"),
        ],
    )
    def test_it_is_refused_in_words(self, flight, words):
        mission = small_world("mission duration=10\nuav u1 100 100").mission
        with pytest.raises(InputError, match=words):
            fly(mission, **flight)

    def test_all_faults_at_once(self):
        mission = small_world("mission duration=10\nuav u1 100 100").mission
        with pytest.raises(InputError) as caught:
            fly(mission, allocation="auction", crashes={"u9": -1.0})
        assert len(caught.value.faults) == 3


@pytest.mark.parametrize("allocation", ALLOCATIONS)
def test_every_allocation_serves_what_is_found(allocation):
    small = small_world(f"mission duration=150 allocation={allocation}\nuav u1 200 400\nuav u2 400 400\n"
                        "target s1 240 400\ntarget s2 420 440\ntarget m1 400 340 vx=3")  # fmt: skip
    sortie, _ = flown(small)
    told = sortie.measures
    assert told.found >= 2 / 3 and told.served == 1.0 and told.unserved == 0
    assert sortie.allocation == allocation and sortie.seed == 0


@pytest.mark.parametrize("strategy", STRATEGIES)
def test_every_strategy_finds_what_lies_in_the_way(strategy):
    world = "mission duration=300 width=500 strategy={}\nuav u1 50 50\ntarget s1 300 300"
    small = small_world(world.format(strategy))
    assert flown(small)[0].measures.found == 1.0


def test_a_mission_without_targets_ends_quietly():
    sortie, trace = flown(small_world("mission duration=40\nuav u1 100 100"))
    assert sortie.measures.targets == 0 and all_of(trace, Detected) == []


def test_false_alarms_do_not_make_targets_by_themselves():
    """Half a false alarm a look: M of N confirmation lets few through, and none is a true target."""
    sortie, trace = flown(small_world("mission duration=200 width=600\nuav u1 100 100 false_alarms=0.3"))
    assert all(one.truth == "" for one in all_of(trace, Detected))
    assert sortie.measures.false_targets == len(all_of(trace, Detected)) <= 6
