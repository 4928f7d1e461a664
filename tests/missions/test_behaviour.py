"""The behaviour aboard one UAV, driven by hand: what it announces, and that no peer can make it fall over."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from smallworlds import small_world
from swarmbid.messages import Survey
from swarmbid.messages.survey import MODES, Contact, Status
from swarmbid.missions._allocation import Allocation, ByConsensus, ByContract
from swarmbid.missions._charting import AreaDivided, TargetFound, TargetServed
from swarmbid.missions.search_track import BLINKS, LOST_AFTER, SearchTrack
from swarmbid.rng import stream
from swarmbid.world.grid import Grid
from swarmbid.world.vehicle import VehicleState, start

WORLD = "mission duration=400 dwell=10\nuav u1 400 400\nuav u2 600 400"


class Notes(Allocation):
    """Writes down what it is told, and does what the test says."""

    def __init__(self) -> None:
        self.announced: list[tuple[str, bool]] = []
        self.done: list[tuple[str, ...]] = []
        self.todo: list[str] = []
        self.open: set[str] = set()
        self.started: set[str] = set()

    def announce(self, task, now, keep=False):
        self.announced.append((task.id, keep))
        if keep:
            self.todo.append(task.id)

    def at(self, *_):
        pass

    @property
    def path(self):
        return [(task, 0.0) for task in self.todo]

    def is_open(self, task):
        return task in self.open

    def is_started(self, task):
        return task in self.started

    def served(self, task):
        return False

    def start(self, task, now):
        self.started.add(task)

    def finish(self, task, now):
        self.done.append(("finish", task))
        self.todo.remove(task)

    def give_back(self, task, now):
        self.done.append(("give_back", task))
        self.todo.remove(task)

    def cancel(self, task):
        self.done.append(("cancel", task))
        self.todo = [one for one in self.todo if one != task]

    def hand_over(self, task, now):
        self.done.append(("hand over", task))

    def lose(self, agent):
        self.done.append(("lose", agent))

    def receive(self, message, now):
        pass


def behaviour(allocation: Allocation | None = None, world: str = WORLD) -> SearchTrack:
    mission = small_world(world).mission
    grid = Grid(mission.area, mission.cell)
    return SearchTrack(mission, mission.vehicles[0], grid, allocation or Notes(), rng=stream(0, "test"))


def hover(
    one: SearchTrack, seconds: int, *targets, begin: int = 0, state: VehicleState | None = None
) -> Iterator:
    """Look at `targets`, (x, y, vx, vy) from second `begin` on, without moving; give what happens."""
    rng = stream(0, "test", "noise")
    here = state or start(one.vehicle)
    for now in range(begin, begin + seconds):
        places = [(x + vx * (now - begin), y + vy * (now - begin)) for x, y, vx, vy in targets]
        measured = np.array(places, dtype=float).reshape(-1, 2)
        measured += 3.0 * rng.standard_normal(measured.shape)
        one.sense(here, measured, float(now))
        one.tick(float(now))
        yield from one.events()


def survey(**changes: object) -> Survey:
    none = np.zeros(0, np.int64)
    usual = {
        "sender": "u2", "sequence": 1, "statuses": (), "contacts": (),
        "agents": (), "first": none, "counts": none, "floors": none,
        "glimpses": np.zeros((3, 0)), "known_agents": (), "known": none,
    }  # fmt: skip
    return Survey(**(usual | changes))


class TestAnnouncing:
    def test_a_static_target_is_announced_for_all(self):
        one = behaviour()
        told = list(hover(one, 60, (420.0, 400.0, 0.0, 0.0)))
        assert one.allocation.announced == [("u1-t1", False)]
        found = [event for event in told if isinstance(event, TargetFound)]
        assert [event.moving for event in found] == [False]

    def test_a_moving_target_is_kept(self):
        """ "Moving -> switch to track: the finder takes it itself"."""
        one = behaviour()
        told = list(hover(one, 25, (360.0, 400.0, 3.0, 0.0)))
        assert one.allocation.announced == [("u1-t1", True)]
        assert any(isinstance(event, TargetFound) and event.moving for event in told)
        assert one.following == "u1-t1" and one.mode == "track"

    @pytest.mark.parametrize("mode", ["return", "base"])
    def test_on_the_way_home_it_keeps_nothing(self, mode):
        one = behaviour()
        list(hover(one, 4, (360.0, 400.0, 4.0, 0.0)))
        one.mode = "return"
        list(hover(one, 20, (376.0, 400.0, 4.0, 0.0), begin=4))
        one.mode = mode
        assert all(not kept for _, kept in one.allocation.announced)

    def test_several_new_ones_beside_old_ones_are_separated(self):
        """Two old targets and two new ones: {1, k}, {2, n}, announced in that order."""
        one = behaviour()
        old = [
            Contact(f"u2-t{k}", "u2", 0.0, False, 0.0, x, 400.0, 0.0, 0.0, 1.0)
            for k, x in ((1, 100.0), (2, 700.0))
        ]
        one.receive(survey(contacts=tuple(old)), 0.0)
        one.allocation.open = {"u2-t1", "u2-t2"}
        told = list(hover(one, 60, (460.0, 400.0, 0.0, 0.0), (340.0, 400.0, 0.0, 0.0)))
        assert [name for name, _ in one.allocation.announced] == ["u1-t2", "u1-t1"]
        assert [
            event.because for event in told if isinstance(event, AreaDivided) and "separated" in event.because
        ] == ["targets separated: u2-t1 and u1-t2; u2-t2 and u1-t1"]

    def test_what_is_begun_or_done_is_not_separated(self):
        one = behaviour()
        old = [
            Contact(f"u2-t{k}", "u2", 0.0, False, 0.0, x, 400.0, 0.0, 0.0, 1.0)
            for k, x in ((1, 100.0), (2, 700.0))
        ]
        one.receive(survey(contacts=tuple(old)), 0.0)
        told = list(hover(one, 60, (460.0, 400.0, 0.0, 0.0), (340.0, 400.0, 0.0, 0.0)))
        assert len(one.allocation.announced) == 2
        assert not any("separated" in event.because for event in told if isinstance(event, AreaDivided))

    def test_the_later_finder_of_one_target_yields(self):
        one = behaviour()
        list(hover(one, 50, (420.0, 400.0, 0.0, 0.0)))
        earlier = Contact("u2-t1", "u2", 0.0, False, 49.0, 420.0, 400.0, 0.0, 0.0, 1.0)
        one.receive(survey(contacts=(earlier,)), 50.0)
        list(hover(one, 10, begin=50))
        assert ("cancel", "u1-t1") in one.allocation.done
        assert one.contacts.known["u1-t1"].over and not one.contacts.known["u2-t1"].over

    def test_the_earlier_finder_does_not(self):
        one = behaviour()
        list(hover(one, 50, (420.0, 400.0, 0.0, 0.0)))
        later = Contact("u2-t1", "u2", 45.0, False, 49.0, 420.0, 400.0, 0.0, 0.0, 1.0)
        one.receive(survey(contacts=(later,)), 50.0)
        list(hover(one, 10, begin=50))
        assert not one.contacts.known["u1-t1"].over and one.allocation.done == []


class TestDoing:
    def test_a_contract_is_flown_to_dwelt_on_and_finished(self):
        one = behaviour()
        there = Contact("u2-t1", "u2", 0.0, False, 0.0, 100.0, 100.0, 0.0, 0.0, 1.0)
        one.receive(survey(contacts=(there,)), 0.0)
        one.allocation.todo = ["u2-t1"]
        list(hover(one, 1))
        assert one.mode == "transit" and one.goal == (100.0, 100.0)
        at = VehicleState(100.0, 100.0)
        told = list(hover(one, 10, begin=1, state=at))
        assert one.mode == "visit" and one.allocation.started == {"u2-t1"} and one.allocation.done == []
        told += list(hover(one, 1, begin=11, state=at))
        assert one.allocation.done == [("finish", "u2-t1")]
        assert [event for event in told if isinstance(event, TargetServed)] == [
            TargetServed("u2-t1", 100.0, 100.0)
        ]
        list(hover(one, 1, begin=12, state=at))
        assert one.mode == "search"

    def test_a_contract_heard_of_before_its_contact_waits(self):
        one = behaviour()
        one.allocation.todo = ["u2-t1"]
        list(hover(one, 1))
        assert one.mode == "search" and one.allocation.done == []

    def test_what_is_over_is_cancelled(self):
        one = behaviour()
        over = Contact("u2-t1", "u2", 0.0, False, 0.0, 100.0, 100.0, 0.0, 0.0, 1.0, True)
        one.receive(survey(contacts=(over,)), 0.0)
        one.allocation.todo = ["u2-t1"]
        list(hover(one, 1))
        assert one.allocation.done == [("cancel", "u2-t1")] and one.mode == "search"

    def test_a_few_blinks_do_not_end_a_track_but_long_silence_does(self):
        one = behaviour()
        list(hover(one, 25, (360.0, 400.0, 3.0, 0.0)))
        list(hover(one, BLINKS, begin=25))
        assert one.mode == "track"
        list(hover(one, 5, begin=25 + BLINKS))
        assert one.mode == "transit" and one.following == "u1-t1"
        for now in range(30 + BLINKS, 30 + BLINKS + int(LOST_AFTER) + 10):  # it flies where it should be
            list(hover(one, 1, begin=now, state=VehicleState(*(one.goal or (400.0, 400.0)))))
        assert ("cancel", "u1-t1") in one.allocation.done and one.following is None
        assert one.contacts.known["u1-t1"].over

    def test_a_follower_looks_for_a_successor_in_time_then_gives_back_and_flies_home(self):
        one = behaviour(
            world=WORLD.replace("u1 400 400", "u1 400 400 endurance=300 base=(400,380) reserve=30")
        )
        state = start(one.vehicle)
        begun: dict[str, int] = {}
        for now in range(299):
            state.airborne = float(now)
            list(hover(one, 1, (400.0 + 0.001 * now, 400.0, 0.0, 0.0), begin=now, state=state))
            if now == 100:
                task = one.contacts.known["u1-t1"]
                moving = {name: getattr(task, name) for name in task.__struct_fields__} | {
                    "moving": True,
                    "t": 101.0,
                }
                one.contacts.merge([Contact(**moving)], 100.0)
                one.allocation.todo = ["u1-t1"]
            for what in one.allocation.done:
                begun.setdefault(" ".join(what), now)
        assert 100 <= begun["hand over u1-t1"] <= 130 < begun["give_back u1-t1"] < 270
        assert one.mode == "return" and one.goal == (400.0, 380.0)

    def test_on_the_ground_it_sees_nothing_and_takes_off_searching(self):
        one = behaviour()
        one.landed()
        list(hover(one, 60, (420.0, 400.0, 0.0, 0.0)))
        assert one.mode == "base" and not one.contacts.known
        one.refuelled()
        list(hover(one, 1, begin=60))
        assert one.mode == "search" and one.goal is not None


class TestOthers:
    def test_who_is_silent_for_long_is_lost_once_and_may_come_back(self):
        one = behaviour()
        for now in range(0, 400, 10):
            list(hover(one, 1, begin=now))
            if now == 300:
                one.receive(survey(statuses=(Status("u2", 300.0, "search", 600.0, 400.0),)), 300.0)
        assert one.allocation.done == [("lose", "u2")]

    def test_the_search_is_divided_among_those_who_search(self):
        one = behaviour()
        told = list(hover(one, 1))
        one.receive(survey(statuses=(Status("u2", 1.0, "track", 600.0, 400.0),)), 1.0)
        told += list(hover(one, 30, begin=1))
        assert one.searching.share.sum() == one.searching.grid.mask.sum()  # alone now
        one.receive(survey(statuses=(Status("u2", 31.0, "search", 600.0, 400.0),)), 31.0)
        told += list(hover(one, 30, begin=31))
        divided = [event.searchers for event in told if isinstance(event, AreaDivided)]
        assert divided == [("u1", "u2"), ("u1",), ("u1", "u2")]
        assert 0.4 < one.searching.share.sum() / one.searching.grid.mask.sum() < 0.6

    def test_an_older_status_does_not_count(self):
        one = behaviour()
        one.receive(survey(statuses=(Status("u2", 5.0, "track", 600.0, 400.0),)), 5.0)
        one.receive(survey(statuses=(Status("u2", 3.0, "search", 600.0, 400.0),)), 6.0)
        list(hover(one, 30, begin=6))
        assert one.searching.searchers == ("u1",)

    def test_strangers_and_itself_are_not_listened_to(self):
        one = behaviour()
        there = Contact("u2-t1", "u2", 0.0, False, 0.0, 100.0, 100.0, 0.0, 0.0, 1.0)
        for sender in ("u1", "u9"):
            one.receive(survey(sender=sender, contacts=(there,)), 0.0)
        assert one.contacts.known == {}


EXTREME = st.sampled_from([0.0, -1.0, 5.0, 400.0, 1e5, -1e9, 1e18, -1e300, 1e308, 5e-324]) | st.floats(
    -1e6, 1e6
)
STATUS = st.builds(
    Status, st.sampled_from(["u1", "u2", "u9"]), EXTREME, st.sampled_from(MODES), EXTREME, EXTREME
)
CONTACT = st.builds(
    Contact, st.sampled_from(["u1-t1", "u2-t1", "u2", "x"]), st.sampled_from(["u1", "u2", "u9"]), EXTREME,
    st.booleans(), *[EXTREME] * 6, st.booleans(),
)  # fmt: skip


@st.composite
def hostile(draw) -> Survey:
    size = draw(st.integers(0, 3))
    number = st.integers(0, 3) | st.just(2**50)
    return survey(
        statuses=tuple(draw(st.lists(STATUS, max_size=3))),
        contacts=tuple(draw(st.lists(CONTACT, max_size=3))),
        agents=("u2",),
        first=np.array([draw(number)]),
        counts=np.array([size]),
        floors=np.array([draw(number)]),
        glimpses=np.array([[draw(EXTREME) for _ in range(size)] for _ in range(3)]).reshape(3, size),
        known_agents=("u1", "u2"),
        known=np.array([draw(number), draw(number)]),
    )


@pytest.mark.parametrize("kind", ["contract_net", "cbba"])
@settings(max_examples=40)
@given(st.lists(hostile(), min_size=1, max_size=3))
def test_a_peer_may_say_anything(kind, told):
    """Whatever a well-formed survey says, the UAV goes on: `receive` "never raises on a peer's fault"."""
    roster = small_world(WORLD).mission.roster()
    if kind == "contract_net":
        one = behaviour(ByContract("u1", roster))
    else:
        one = behaviour(ByConsensus("u1", roster, lambda contact: one.task_of(contact)))
    list(hover(one, 2, (420.0, 400.0, 0.0, 0.0)))
    for number, message in enumerate(told):
        one.receive(message, 2.0 + number)
        list(hover(one, 1, (420.0, 400.0, 0.0, 0.0), begin=2 + number))
    if one.goal is not None and one.mode == "search":
        assert math.isfinite(one.goal[0]) and math.isfinite(one.goal[1])
    assert np.isfinite(one.searching.belief.probability).all()
