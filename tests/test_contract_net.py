"""The Contract Net's parts: its tables, comparing bids, leases, acts on the wire, and its memory."""

from __future__ import annotations

import math

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmbid.algorithms._contract_bids import best, diagonal, with_take_overs
from swarmbid.algorithms._contract_lease import Leases, mark
from swarmbid.algorithms._contract_route import Route
from swarmbid.algorithms._contract_tables import (
    CONTRACTOR,
    CONTRACTOR_EVENTS,
    CONTRACTOR_STATES,
    MANAGER,
    MANAGER_EVENTS,
    MANAGER_STATES,
    NOTHING,
)
from swarmbid.algorithms.contract_net import ContractNet
from swarmbid.arrays import MissionArrays
from swarmbid.errors import InputError
from swarmbid.messages import INCARNATION, Acts, MessageError, decode, encode
from swarmbid.messages.acts import AS_CONTRACTOR, PERFORMATIVES, PROPOSE, Act, ActRun, Ending
from swarmbid.model import Agent, Mission, Task
from swarmbid.negotiator import Said
from swarmbid.rng import stream
from swarmbid.scores import make_score
from swarmbid.testing._team import Team

AT = (0.0, 0.0, 0.0)
TABLES = [
    ("manager", MANAGER, MANAGER_STATES, MANAGER_EVENTS),
    ("contractor", CONTRACTOR, CONTRACTOR_STATES, CONTRACTOR_EVENTS),
]
OVER = {
    "manager": ("done", "cancelled"),
    "contractor": ("done", "cancelled", "unserved"),
}


def pair(**options) -> Mission:
    return Mission(
        agents=(Agent(id="a", position=AT, **options), Agent(id="b", position=(30.0, 0.0, 0.0))), tasks=()
    )


# --- the tables


@pytest.mark.parametrize(("role", "table", "states", "events"), TABLES, ids=["manager", "contractor"])
def test_a_table_has_an_entry_for_every_state_and_whatever_comes(role, table, states, events):
    assert set(table) == {(state, event) for state in states for event in events}
    for (state, event), (action, after) in table.items():
        assert after in states
        assert action != NOTHING or after == state, (state, event)
        assert action == NOTHING or hasattr(ContractNet, f"_{role}_{action}"), action


@pytest.mark.parametrize(("role", "table", "states", "events"), TABLES, ids=["manager", "contractor"])
def test_what_is_over_stays_over(role, table, states, events):
    for (state, event), entry in table.items():
        if state in OVER[role]:
            assert entry == (NOTHING, state), (state, event)


@pytest.mark.parametrize(("role", "table", "states", "events"), TABLES, ids=["manager", "contractor"])
def test_every_state_can_be_reached_and_every_event_means_something(role, table, states, events):
    reached = {"idle"}
    for _ in states:
        reached |= {after for (state, _), (_, after) in table.items() if state in reached}
    assert reached == set(states)
    for event in events:
        assert any(table[state, event][0] != NOTHING for state in states), event


def test_what_has_been_started_is_taken_by_no_award():
    """Slides: a started task is not taken away by a better bid."""
    for event in ("awarded elsewhere", "award stands", "award stale", "can do", "cannot do"):
        assert CONTRACTOR["started", event] == (NOTHING, "started")


# --- comparing bids (slides, "Compare bids")


def proposal(bid: float, path: tuple[str, ...] = (), worth: float = 0.0) -> Act:
    return Act(1, PROPOSE, "t", AS_CONTRACTOR, bid=bid, path=tuple((task, 0.0) for task in path), worth=worth)


def test_a_manager_with_tasks_compares_the_diagonal():
    proposals = {0: proposal(5.0), 1: proposal(7.0, ("u",), 9.0), 2: proposal(7.0)}
    assert diagonal(proposals) == {(0, 0): 5.0, (1, 1): 7.0, (2, 2): 7.0}
    assert best(diagonal(proposals)) == (2, 2)  # ties go to the higher id
    assert best({}) == (-1, -1)


def test_an_idle_manager_counts_what_a_whole_proposal_would_be_worth_to_it():
    """It gains the proposal's worth to itself, and the team loses what the old path was worth."""
    proposals = {0: proposal(5.0), 1: proposal(7.0, ("u",), 9.0), 2: proposal(6.0)}
    table = with_take_overs(proposals, 0, lambda act: 20.0)
    assert table == diagonal(proposals) | {(0, 1): 11.0}
    assert best(table) == (0, 1)
    assert best(with_take_overs(proposals, 0, lambda act: 16.0)) == (1, 1)  # equal: nobody is disturbed
    assert best(with_take_overs(proposals, 0, lambda act: -math.inf)) == (1, 1)


# --- the route


@given(st.integers(0, 200))
def test_a_gain_is_what_the_path_is_worth_more(seed: int):
    """The naive twin: insert, and count the whole path anew."""
    rng = stream(seed, "route")
    tasks = tuple(
        Task(id=f"t{row}", position=(float(x), float(y), 0.0), reward=50.0, discount=0.01, duration=2.0)
        for row, (x, y) in enumerate(rng.uniform(0.0, 50.0, (6, 2)))
    )
    arrays = MissionArrays(Mission(agents=(Agent(id="a", position=AT),), tasks=tasks))
    route = Route(arrays, 0, make_score("time_discounted"), "shift")
    for task in tasks:
        before = route.worth
        gains, places, starts = route.gains([task.id])
        naive = []
        for place in range(len(route) + 1):
            ids = [name for name, _ in route.path]
            naive.append(route.worth_of([*ids[:place], task.id, *ids[place:]]) - before)
        assert gains[0] == pytest.approx(max(naive), abs=1e-9)
        if gains[0] > 0.0:
            route.insert(task.id, places[0], starts[0])
            assert route.worth - before == pytest.approx(gains[0], abs=1e-9)
            assert dict(route.path)[task.id] == pytest.approx(starts[0])


# --- leases


def test_a_lease_counts_from_when_the_word_was_said():
    leases = Leases(3, 0, 10.0, again=False)
    leases.say(INCARNATION + 1, 100.0)
    assert not leases.live(100.0)
    leases.answered(1, mark(INCARNATION + 1), 104.0)
    assert leases.live(104.0) and leases.live(109.9) and not leases.live(110.0)


def test_who_was_without_a_majority_for_a_lease_waits_one_more():
    leases = Leases(3, 0, 10.0, again=False)
    for number, said in ((1, 0.0), (2, 40.0), (3, 45.0), (4, 50.0)):
        leases.say(number, said)
        leases.answered(1, mark(number), said + 1.0)
    assert not leases.live(50.9) and leases.live(51.0)  # has it again since 41 s


def test_of_an_even_half_only_the_one_with_the_first_agent_begins():
    for me, live in ((0, True), (1, True), (2, False)):
        leases = Leases(4, me, 10.0, again=False)
        leases.say(1, 0.0)
        leases.answered({0: 1, 1: 0, 2: 3}[me], mark(1), 1.0)
        assert leases.live(1.0) is live


# --- acts on the wire


def message(*acts: Act, **changes) -> Acts:
    none, stamps = np.zeros(0, np.int32), np.zeros(0, np.int64)
    fields = {
        "sender": "a", "sequence": 3, "agent_ids": ("a", "b"), "known": np.array([9, 4], np.int64),
        "runs": (ActRun(0, 0, 9, acts),) if acts else (), "near": none, "ended": (), "ended_hash": 5,
        "digest": 1, "digest_at": 2, "agreed": none, "agreed_at": stamps, "settled": False, "left": none,
        "left_at": stamps,
    }  # fmt: skip
    return Acts(**(fields | changes))


def test_a_message_comes_back_from_its_bytes():
    acts = [
        Act(number + 1, name, "t", AS_CONTRACTOR, to="b", manager="b", epoch=2, bid=3.5, at=7.0,
            path=(("u", 1.0),), place=1)
        for number, name in enumerate(PERFORMATIVES[:8])
    ]  # fmt: skip
    sent = message(*acts, ended=(Ending("v", "done", "a", "", 4, 2.0),))
    back = decode(encode(sent))
    assert isinstance(back, Acts)
    assert back.runs == sent.runs and back.ended == sent.ended
    assert back.known.tolist() == [9, 4] and encode(back) == encode(sent)


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"bid": math.nan}, "bid"),
        ({"bid": -1.0}, "bid"),
        ({"bid": math.inf}, "bid"),
        ({"at": math.inf}, "malformed"),
        ({"worth": math.nan}, "malformed"),
        ({"task": "no id"}, "id"),
        ({"to": "no id"}, "id"),
        ({"number": 10}, "stamp"),
        ({"epoch": -1}, "stamp"),
        ({"role": 3}, "malformed"),
        ({"reason": "x" * 201}, "oversize"),
        ({"place": 1}, "malformed"),
    ],
)
def test_what_no_agent_can_have_said_is_refused(change: dict, reason: str):
    act = Act(1, PROPOSE, "t", AS_CONTRACTOR, manager="b", bid=1.0)
    assert decode(encode(message(act))).entries == 1
    with pytest.raises(MessageError) as error:
        decode(encode(message(msgspec.structs.replace(act, **change))))
    assert error.value.reason == reason


def test_what_is_not_understood_is_said_so_once_and_never_in_reply_to_itself():
    """FIPA SC00037J: not-understood is not answered by not-understood."""
    one, other = ContractNet("a", pair()), ContractNet("b", pair())
    base = INCARNATION
    odd = Act(base + 1, "subscribe", "t", AS_CONTRACTOR, manager="a")
    known = np.array([0, base + 1], np.int64)
    words = [
        message(sender="b", sequence=base + number, known=known, runs=(ActRun(1, base, base + 1, (odd,)),))
        for number in (1, 2)
    ]
    for word in words:
        one.receive(word, 0.0)
    said = [event for event in one.events() if isinstance(event, Said)]
    assert [event.performative for event in said] == ["not-understood"]
    for reply in one.tick(0.0):
        other.receive(reply, 0.5)
    assert not [event for event in other.events() if isinstance(event, Said)]


# --- options, and the door


def test_all_wrong_options_are_told_at_once():
    with pytest.raises(InputError) as error:
        ContractNet("a", pair(), on_partition="pray", lease=-1.0, reply_within=math.inf, period=0.0)
    fields = [fault.field for fault in error.value.faults]
    assert [name for name in ("on_partition", "lease", "reply_within") if name not in fields] == []


def test_only_what_is_under_contract_is_started():
    one = ContractNet("a", pair())
    one.announce(Task(id="t", position=AT, reward=9.0), 0.0)
    with pytest.raises(ValueError, match="not under contract"):
        one.start_task("t", 0.0)


def test_who_gave_a_task_back_may_take_it_again_and_who_failed_does_not():
    for door, state in (("give_back", "contracted"), ("fail_task", "failed")):
        alone = Mission(agents=(Agent(id="a", position=AT),), tasks=())
        one = ContractNet("a", alone)
        one.announce(Task(id="t", position=AT, reward=9.0), 0.0)
        one.tick(0.0)
        getattr(one, door)("t", "want of fuel", 1.0)
        for now in range(1, 6):
            one.tick(float(now))
        assert one.outcomes()["t"].state == state


def test_memory_and_messages_stay_small_while_tasks_come_and_go():
    """Tasks that are over leave one line each, and none once they are forgotten."""
    team = Team(ContractNet, pair())
    sizes = []
    for number in range(60):
        finder = team.agents["ab"[number % 2]]
        finder.announce(Task(id=f"t{number}", position=(10.0, 0.0, 0.0), reward=500.0), team.now)
        for _ in range(8):
            team.round()
            for one in team.agents.values():
                for task_id, _ in one.path[:1]:
                    one.start_task(task_id, team.now)
                    one.finish_task(task_id, team.now)
        if number >= 20:
            for one in team.agents.values():
                one.forget(f"t{number - 20}")
        sizes.append(max(len(encode(word)) for _, _, word in team.sent[-6:]))
    for one in team.agents.values():
        assert len(one.outcomes()) == 20
        assert not one.conversations()
        assert sum(len(one._voice.live(row)) for row in range(2)) == 0
    assert max(sizes[40:]) <= max(sizes[20:40])
