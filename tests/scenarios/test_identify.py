"""The identify scenario: groups that bring a camera and a rangefinder, beside the contracts."""

from __future__ import annotations

import math
from dataclasses import replace
from io import BytesIO

import numpy as np
import pytest

from swarmbid.algorithms.contract_net import ContractNet
from swarmbid.errors import InputError
from swarmbid.messages.survey import Contact, Status
from swarmbid.missions._contacts import Contacts
from swarmbid.missions._standing import EARLY, FRESH, Standing, StandingDone
from swarmbid.model import Task
from swarmbid.scenarios import identify
from swarmbid.searchmeasures import Watch
from swarmbid.trace import Ended, Pose, Trace, Truth, read_trace
from swarmbid.world.mission import SearchMission
from swarmbid.world.vehicle import VehicleState
from swarmbid.worldsim import Sortie, fly

SMALL = {"uavs": 4, "static": 3, "width": 1400.0, "hole": 0.0, "duration": 500.0, "dwell": 15.0}


def flown(mission: SearchMission, seed: int, **options: object) -> tuple[Sortie, bytes]:
    kept = BytesIO()
    return fly(mission, seed=seed, trace=kept, **options), kept.getvalue()  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def mission() -> SearchMission:
    return identify.make(1, **SMALL)


@pytest.fixture(scope="module")
def flight(mission: SearchMission) -> tuple[Sortie, bytes]:
    return flown(mission, 1)


def read(data: bytes) -> Trace:
    return read_trace(BytesIO(data))


# --- the scenario


def test_vehicles_carry_the_two_pieces_in_turn() -> None:
    mission = identify.make(3, uavs=5)
    assert mission.identify == ("camera", "rangefinder")
    assert [sorted(vehicle.equipment) for vehicle in mission.vehicles] == [
        ["camera"], ["rangefinder"], ["camera"], ["rangefinder"], ["camera"],
    ]  # fmt: skip
    assert [target.kind for target in mission.targets] == ["static"] * 6
    assert all(target.agents_required == 0 for target in mission.targets)


def test_same_seed_same_mission_and_another_seed_another() -> None:
    assert identify.make(3) == identify.make(3)
    assert identify.make(3).targets != identify.make(4).targets


@pytest.mark.parametrize(
    ("options", "field"),
    [
        ({"uavs": 1}, "uavs"),
        ({"dwell": -1.0}, "dwell"),
        ({"width": 0.0}, "width"),
        ({"hole": 2000.0}, "hole"),
        ({"moving": 1}, "moving"),
    ],
)
def test_bad_options_are_told(options: dict[str, float], field: str) -> None:
    with pytest.raises(InputError) as caught:
        identify.make(0, **options)
    assert field in [fault.field for fault in caught.value.faults]


# --- whole flights


def present(trace: Trace, target: str, begin: float, end: float) -> set[str]:
    """Equipment that was at work at a target at one and the same moment between two times."""
    assert trace.header.world is not None
    brings = {one["id"]: set(one["equipment"]) for one in trace.header.world["vehicles"]}
    reach = {one["id"]: one["radius"] for one in trace.header.world["vehicles"]}
    x, y = next((one.x, one.y) for one in trace.of(Truth) if one.target == target)
    at: dict[float, set[str]] = {}
    for pose in trace.of(Pose):
        near = math.hypot(pose.x - x, pose.y - y) <= reach[pose.agent]
        if begin <= pose.t <= end and pose.mode == "visit" and near:
            at.setdefault(pose.t, set()).update(brings[pose.agent])
    return max(at.values(), key=len, default=set())


def test_groups_complete_and_bring_both_pieces_at_one_time(
    mission: SearchMission, flight: tuple[Sortie, bytes]
) -> None:
    sortie, data = flight
    trace = read(data)
    places = {one.target: (one.x, one.y) for one in trace.of(Truth)}
    contacts = sortie.behaviours[0].contacts.known
    identified: dict[str, set[str]] = {}
    for record in trace.of(Ended):
        if not record.task.endswith(".identify") or record.outcome != "done":
            continue
        contact = contacts[record.task.removesuffix(".identify")]
        target = min(places, key=lambda name: math.dist(places[name], (contact.x, contact.y)))
        identified.setdefault(target, set()).add(record.by)
        assert present(trace, target, record.t - mission.dwell, record.t) == {"camera", "rangefinder"}
    carried = {vehicle.id: vehicle.equipment for vehicle in mission.vehicles}
    for members in identified.values():
        assert frozenset[str]().union(*(carried[name] for name in members)) == set(mission.identify)
    assert len(identified) == 3
    assert sortie.measures.identified == 1.0


def test_same_seed_same_bytes(mission: SearchMission, flight: tuple[Sortie, bytes]) -> None:
    assert flown(mission, 1)[1] == flight[1]


def test_through_bytes_and_with_loss_groups_still_complete(mission: SearchMission) -> None:
    sortie, _ = flown(mission, 1, loss=0.2, through_bytes=True)
    assert sortie.measures.found == 1.0
    assert sortie.measures.identified == 1.0


@pytest.mark.parametrize("allocation", ["contract_net", "cbba"])
def test_targets_are_visited_again_and_again(mission: SearchMission, allocation: str) -> None:
    """By CBBA beside the contracts, by CBGA where CBBA is busy already."""
    again = replace(mission, identify=(), revisit=120.0)
    sortie, _ = flown(again, 1, allocation=allocation)
    assert sortie.measures.identified == 0.0
    assert sortie.measures.revisited >= 0.75


# --- the standing negotiation of single UAVs


def known(mission: SearchMission, *, over: bool = False, moving: bool = False) -> Contacts:
    contacts = Contacts("uav01", 5.0, 50.0)
    contacts.merge(
        [Contact("uav01-t1", "uav01", 10.0, moving, 10.0, 700.0, 700.0, 0.0, 0.0, 2.0, over)], 10.0
    )
    return contacts


def team(mission: SearchMission, count: int = 2) -> list[Standing]:
    return [Standing(mission, vehicle, 120.0) for vehicle in mission.vehicles[:count]]


def talk(team: list[Standing], states: list[VehicleState], contacts: Contacts, begin: int, end: int) -> None:
    for now in range(begin, end):
        said = []
        for one, state in zip(team, states, strict=True):
            one.at(float(now), state, "search", contacts, [])
            said.append(one.tick(float(now)))
        for one in team:
            for messages in said:
                for message in messages:
                    one.receive(message, now + 0.5)


def test_a_member_waits_until_all_are_there_and_each_is_done_after_the_dwell(mission: SearchMission) -> None:
    pair = replace(mission, vehicles=mission.vehicles[:2])
    one, other = team(pair)
    there, away = VehicleState(705.0, 700.0), VehicleState(300.0, 300.0)
    talk([one, other], [there, away], known(pair), 11, 30)
    assert [task for task, _ in one.path] == [task for task, _ in other.path] == ["uav01-t1.identify"]
    now = 60.0
    far = {"uav02": Status("uav02", now, "transit", 300.0, 300.0)}
    passing = {"uav02": Status("uav02", now, "search", 700.0, 700.0)}
    stale = {"uav02": Status("uav02", now - FRESH - 1.0, "visit", 700.0, 700.0)}
    for statuses in ({}, far, passing, stale):
        assert one.step(now, there, statuses) == ("visit", (700.0, 700.0))
        assert one.begun is None
    assert other.step(now, away, {}) == ("transit", (700.0, 700.0))
    near = {"uav02": Status("uav02", now, "visit", 690.0, 700.0)}
    assert one.step(now, there, near) == ("visit", (700.0, 700.0))
    assert one.begun == ("uav01-t1.identify", now)
    one.events()
    one.step(now + pair.dwell - 1.0, there, {})
    assert one.events() == []
    one.step(now + pair.dwell, there, {})
    done = [event for event in one.events() if isinstance(event, StandingDone)]
    assert done == [StandingDone("uav01-t1.identify", 700.0, 700.0)]
    assert one.begun is None
    assert one.path == []


def test_without_the_other_piece_nobody_flies_there(mission: SearchMission) -> None:
    cameras = replace(mission, vehicles=(mission.vehicles[0], mission.vehicles[2], mission.vehicles[1]))
    pair = [Standing(cameras, vehicle, 120.0) for vehicle in cameras.vehicles[:2]]
    states = [VehicleState(705.0, 700.0), VehicleState(300.0, 300.0)]
    talk(pair, states, known(cameras), 11, 30)
    assert [one.path for one in pair] == [[], []]


def test_contracts_go_first(mission: SearchMission) -> None:
    """A UAV that follows a target to the end is not counted on for a group before that."""
    pair = replace(mission, vehicles=mission.vehicles[:2])
    contacts = known(pair)
    contacts.merge([Contact("uav01-t2", "uav01", 10.0, True, 10.0, 100.0, 100.0, 1.0, 0.0, 2.0)], 10.0)
    alone = team(pair)
    for now in range(11, 40):
        said = []
        for one, contracts in zip(alone, (["uav01-t2"], []), strict=True):
            one.at(float(now), VehicleState(700.0, 650.0), "search", contacts, contracts)
            said += one.tick(float(now))
        for one in alone:
            for message in said:
                one.receive(message, now + 0.5)
    assert [one.path for one in alone] == [[], []]


def test_a_contact_that_is_over_stands_no_longer(mission: SearchMission) -> None:
    pair = replace(mission, vehicles=mission.vehicles[:2])
    both = team(pair)
    states = [VehicleState(705.0, 700.0), VehicleState(300.0, 300.0)]
    talk(both, states, known(pair), 11, 30)
    assert all(one.path for one in both)
    talk(both, states, known(pair, over=True), 30, 40)
    assert [one.path for one in both] == [[], []]


def test_moving_targets_do_not_stand(mission: SearchMission) -> None:
    both = team(mission)
    talk(both, [VehicleState(705.0, 700.0)] * 2, known(mission, moving=True), 11, 30)
    assert [one.path for one in both] == [[], []]


def test_messages_are_told_apart_by_their_class(mission: SearchMission) -> None:
    net = ContractNet("uav01", mission.roster())
    net.announce(Task(id="look", position=(3.0, 4.0, 0.0), reward=10.0), now=0.0)
    acts = net.tick(0.0)
    groups, single = team(mission)[0], Standing(replace(mission, identify=(), revisit=60.0),
                                                mission.vehicles[1], 120.0)  # fmt: skip
    groups.at(0.0, VehicleState(700.0, 650.0), "search", known(mission), [])
    single.at(0.0, VehicleState(700.0, 650.0), "search", known(mission), [])
    records, beliefs = groups.tick(0.0), single.tick(0.0)
    assert acts and records and beliefs
    assert not groups.receive(acts[0], 1.0) and not single.receive(acts[0], 1.0)
    assert not groups.receive(beliefs[0], 1.0) and not single.receive(records[0], 1.0)
    assert single.receive(beliefs[0], 1.0) and groups.receive(records[0], 1.0)


def test_revisits_are_due_at_whole_multiples_of_their_interval(mission: SearchMission) -> None:
    again = replace(mission, identify=(), revisit=150.0)
    standing = Standing(again, again.vehicles[0], 120.0)
    contact = known(again).known["uav01-t1"]
    tasks = standing.tasks_of(contact)
    assert [(task.id, task.revisit_at) for task in tasks] == [
        ("uav01-t1.r1", 160.0), ("uav01-t1.r2", 310.0), ("uav01-t1.r3", 460.0),
    ]  # fmt: skip
    assert all(task.end <= again.duration - again.dwell for task in tasks)


def test_until_it_must_leave_a_uav_searches_on(mission: SearchMission) -> None:
    again = replace(mission, identify=(), revisit=150.0, vehicles=mission.vehicles[:1])
    standing = Standing(again, again.vehicles[0], 120.0)
    state = VehicleState(300.0, 700.0)
    talk([standing], [state], known(again), 11, 13)
    leave = 160.0 - 400.0 / again.vehicles[0].speed - EARLY
    assert standing.step(leave - 1.0, state, {}) is None
    assert standing.step(leave + 1.0, state, {}) == ("transit", (700.0, 700.0))
    there = VehicleState(710.0, 700.0)
    assert standing.step(159.0, there, {}) == ("visit", (700.0, 700.0))
    assert standing.begun is None
    standing.step(160.0, there, {})
    assert standing.begun == ("uav01-t1.r1", 160.0)


# --- the measures


def test_identified_counts_only_what_has_both_pieces_at_one_time(mission: SearchMission) -> None:
    watch = Watch(mission)
    xy = np.array([target.position for target in mission.targets])
    x, y = mission.targets[1].position
    watch.stood(50.0, x, y, frozenset({"camera"}), xy)
    assert not watch.identified.any()
    watch.stood(60.0, x + 5.0, y, frozenset({"camera", "rangefinder"}), xy)
    assert watch.identified.tolist() == [False, True, False]


def test_revisited_counts_each_visit_once_and_only_near_its_time(mission: SearchMission) -> None:
    watch = Watch(replace(mission, identify=(), revisit=100.0))
    xy = np.array([target.position for target in mission.targets])
    watch.found[0] = 20.0  # visits due at 120, 220, 320 and 420 s of 500
    x, y = mission.targets[0].position
    for now in (60.0, 110.0, 125.0, 330.0, 480.0):
        watch.stood(now, x, y, frozenset(), xy)
    measures = watch.measures([0.0], messages=0, bytes=0, unserved=0)
    assert measures.revisited == 2 / 4
