"""Hunt et al. 2014, "A Consensus-Based Grouping Algorithm ...": one test for each rule of CBGA as printed.

Every test names the equation, or the line of Algorithm 1 (Fig. 1) or 2 (Fig. 2). Where the print and the
text say different things there are two readings, and both are shown. All agents stand at (0, 0) and fly
1 m/s unless said otherwise; by eq. (7) a task 20 m away that pays 100 is worth 80.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from swarmbid.algorithms.cbga_printed import CBGAPrinted
from swarmbid.arrays import MissionArrays
from swarmbid.messages import INCARNATION, NOT_LISTED
from swarmbid.messages.assignments import Assignments
from swarmbid.model import Agent, Mission, Task
from swarmbid.negotiator import TaskOutbid, TaskReleased
from swarmbid.scores import make_score

BOTH = pytest.mark.parametrize("reading", ["literal", "charitable"])
SCORE = make_score("distance_cost")
FAR = 20.0


def mission_of(
    *tasks: Task, agents: str = "abcd", equipment: dict[str, str] | None = None, **changes: Any
) -> Mission:
    """Agents a, b, c ... at (0, 0); `equipment` names what each carries, a letter an item."""
    carried = equipment or {}
    return Mission(
        agents=tuple(
            Agent(id=name, position=(0.0, 0.0, 0.0), equipment=frozenset(carried.get(name, "")), **changes)
            for name in agents
        ),
        tasks=tasks,
    )


def task(name: str, east: float = FAR, *, seats: int = 2, reward: float = 100.0, **fields: Any) -> Task:
    return Task(id=name, position=(east, 0.0, 0.0), agents_required=seats, reward=reward, **fields)


def agent(mission: Mission, name: str = "a", **options: Any) -> CBGAPrinted:
    return CBGAPrinted(name, MissionArrays(mission), SCORE, **options)


def say(
    one: CBGAPrinted,
    sender: str,
    bids: dict[str, dict[str, Any]],
    heard: dict[str, int],
    *,
    sequence: int = 1,
) -> None:
    """Let `one` receive X_k and s_k. `bids` : task -> agent -> bid, or (bid, arrival in s)."""
    arrays = one._arrays
    entries = [
        (arrays.task_row[name], arrays.agent_row[who], *(bid if isinstance(bid, tuple) else (bid, 0.0)))
        for name, row in bids.items()
        for who, bid in row.items()
    ]
    stamps = np.full(arrays.num_agents, NOT_LISTED, np.int64)
    for who, stamp in {**heard, sender: sequence}.items():
        stamps[arrays.agent_row[who]] = INCARNATION + stamp
    nothing = np.zeros(0, np.int32)
    one.receive(
        Assignments(
            sender=sender, sequence=INCARNATION + sequence, agent_ids=arrays.agent_ids,
            task_ids=arrays.task_ids, heard=stamps,
            tasks=np.array([entry[0] for entry in entries], np.int32),
            holders=np.array([entry[1] for entry in entries], np.int32),
            bids=np.array([entry[2] for entry in entries], float),
            arrivals=np.array([entry[3] for entry in entries], float),
            digest=0, digest_at=INCARNATION + sequence, agreed=nothing, agreed_at=nothing.astype(np.int64),
            left=nothing, left_at=nothing.astype(np.int64),
        ),
        0.0,
    )  # fmt: skip
    assert not [event for event in one.events() if event.kind == "dropped"]


def holders(one: CBGAPrinted, name: str = "t") -> dict[str, float]:
    return dict(one.beliefs()[name])


# --- the task: eq. (4), (5)


@BOTH
def test_eq_4_a_group_is_as_many_agents_as_there_are_seats(reading: str):
    """{i | X_ij > 0} = L_j. The agent plans only what it believes complete: with one of two, nothing."""
    one = agent(mission_of(task("t")), reading=reading)
    one.tick(0.0)
    assert holders(one) == {"a": 80.0}
    assert one.path == []
    say(one, "b", {"t": {"b": 70.0}}, {})
    one.tick(1.0)
    assert holders(one) == {"a": 80.0, "b": 70.0}
    assert one.path == [("t", 20.0)]


def test_eq_4_the_group_covers_the_equipment_though_the_print_says_that_it_must_not():
    """Printed: e_j \\ {e_i | X_ij > 0} is NOT empty. The text: "with the correct equipment" (charitable).

    a and b both carry camera only. Two seats are taken and the winch is missing: no group.
    """
    lift = task("t", equipment=frozenset({"k", "w"}))
    equipment = {"a": "k", "b": "k", "c": "w"}
    crews = {}
    for reading in ("literal", "charitable"):
        one = agent(mission_of(lift, agents="abc", equipment=equipment), reading=reading)
        one.tick(0.0)
        say(one, "b", {"t": {"b": 70.0}}, {})
        one.tick(1.0)
        crews[reading] = holders(one), [name for name, _ in one.path]
    assert crews["literal"] == ({"a": 80.0, "b": 70.0}, ["t"])
    assert crews["charitable"] == ({"a": 80.0}, [])


def test_eq_5_any_prerequisite_will_do_as_printed_and_all_must_be_complete_as_the_text_says():
    """The sum of (Y_im > 0) over P_j is positive as soon as one of them has one bid."""
    mission = mission_of(task("p"), task("q", 500.0, seats=1), task("t", seats=1, prerequisites=("p", "q")))
    # Nobody can gain on q, 500 m away, and p has one of two members: the agent itself.
    held = {}
    for reading in ("literal", "charitable"):
        one = agent(mission, reading=reading)
        one.tick(0.0)
        held[reading] = sorted(one.bundle)
    assert held == {"literal": ["p", "t"], "charitable": ["p"]}


def test_eq_5_one_complete_prerequisite_of_two_is_not_all():
    mission = mission_of(
        task("p", seats=1), task("q", 500.0, seats=1), task("t", seats=1, prerequisites=("p", "q"))
    )
    one = agent(mission)
    one.tick(0.0)
    assert one.bundle == ["p"]
    say(one, "b", {"q": {"b": 5.0}}, {})
    one.tick(1.0)
    assert one.bundle == ["p", "t"]


def test_eq_5_a_task_starts_after_what_others_do_first():
    """b and c meet at p, 500 m away, at 44 s, and take 5 s. t waits for them, though nobody sees them.

    p has one seat in the second case; b says first that it comes at 30 s and then at 40 s.
    """
    tasks = task("p", 500.0, duration=5.0), task("t", seats=1, prerequisites=("p",))
    one = agent(mission_of(*tasks))
    say(one, "b", {"p": {"b": (70.0, 30.0), "c": (60.0, 44.0)}}, {"c": 1})
    one.tick(0.0)
    assert one.path == [("t", 49.0)]
    alone = task("p", 500.0, duration=5.0, seats=1)
    one = agent(mission_of(alone, tasks[1]))
    say(one, "b", {"p": {"b": (70.0, 30.0)}}, {}, sequence=1)
    one.tick(0.0)
    assert one.path == [("t", 35.0)]
    say(one, "b", {"p": {"b": (70.0, 40.0)}}, {}, sequence=2)
    one.tick(1.0)
    assert one.path == [("t", 45.0)]


def test_eq_5_with_all_prerequisites_complete_the_task_may_be_bid_for_and_starts_after_them():
    """p starts at 20 s and takes 5 s, so t, at the same place, starts at 25 s."""
    mission = mission_of(task("p", duration=5.0), task("t", seats=1, prerequisites=("p",)))
    one = agent(mission)
    one.tick(0.0)
    assert one.bundle == ["p"]
    say(one, "b", {"p": {"b": (70.0, 12.0)}}, {})
    one.tick(1.0)
    assert one.bundle == ["p", "t"]
    assert one.path == [("p", 20.0), ("t", 25.0)]


# --- scores: eq. (1), (6), (7), (8)


def test_eq_1_a_task_is_inserted_where_the_path_gains_most():
    """First far (100 - 30 = 70), then near on the way: the path stays 30 m long, so near gains all of 50."""
    one = agent(mission_of(task("far", 30.0, seats=1), task("near", 10.0, seats=1, reward=50.0)))
    one.tick(0.0)
    assert one.bundle == ["far", "near"]
    assert one.intended == ["near", "far"]
    assert holders(one, "near") == {"a": 50.0}


def test_eq_7_a_bid_is_the_reward_less_metres_and_seconds():
    """100 - (20 m + 5 s) = 75."""
    one = agent(mission_of(task("t", duration=5.0)))
    one.tick(0.0)
    assert holders(one) == {"a": 75.0}


def test_eq_8_service_starts_with_the_latest_member_where_arrivals_are_sent():
    """a arrives after 20 s, b after 44 s. The triples of the print do not say when (literal)."""
    starts = {}
    for reading in ("literal", "charitable"):
        one = agent(mission_of(task("t")), reading=reading)
        one.tick(0.0)
        say(one, "b", {"t": {"b": (70.0, 44.0)}}, {})
        one.tick(1.0)
        starts[reading] = one.path
    assert starts == {"literal": [("t", 20.0)], "charitable": [("t", 44.0)]}


def test_eq_8_who_waits_for_the_latest_member_may_miss_the_next_window():
    """t starts at 44 s, when b comes. near (10 m further) closes at 40 s: only before t is there time.

    Alone the agent would go on to near at 30 s. It goes to t by way of near at 30 s and back: it loses
    2 * 10 m, 50 - 20 = 30.
    """
    mission = mission_of(task("t"), task("u", 30.0, seats=1, reward=50.0, end=40.0))
    one = agent(mission)
    say(one, "b", {"t": {"b": (70.0, 44.0)}}, {})
    one.tick(0.0)
    assert one.path == [("u", 30.0), ("t", 44.0)]
    assert holders(one, "u") == {"a": 30.0}


def test_eq_6_team_rewards_look_at_the_whole_groups_bids():
    """Alone u is better (100 - 10) than t (80). With b's 60 on t the group is worth 140.

    "Prioritises agents into completing team-based tasks that already have assignments despite it
    rewarding less for the individual". The bid itself stays the agent's own.
    """
    mission = mission_of(task("t"), task("u", 10.0), bundle_limit=1)
    taken = {}
    for team_rewards in (False, True):
        one = agent(mission, team_rewards=team_rewards)
        say(one, "b", {"t": {"b": 60.0}}, {})
        one.tick(0.0)
        taken[team_rewards] = one.bundle, holders(one, one.bundle[0])["a"]
    assert taken == {False: (["u"], 90.0), True: (["t"], 80.0)}


# --- Algorithm 1


@BOTH
def test_algorithm_1_adds_tasks_until_none_improves_the_path(reading: str):
    """Line 5: the loop. Three tasks pay, the fourth, 200 m away, does not."""
    tasks = [task(f"t{k}", 10.0 * k) for k in (1, 2, 3)]
    one = agent(mission_of(*tasks, task("t4", 200.0)), reading=reading)
    one.tick(0.0)
    assert sorted(one.bundle) == ["t1", "t2", "t3"]


@BOTH
def test_algorithm_1_line_9_a_free_seat_is_open_to_any_bid(reading: str):
    one = agent(mission_of(task("t")), reading=reading)
    say(one, "b", {"t": {"b": 99.0}}, {})
    one.tick(0.0)
    assert holders(one) == {"a": 80.0, "b": 99.0}


def test_algorithm_1_line_11_the_minimum_over_all_agents_is_zero_while_one_has_not_bid():
    """A full task, held for 95 and 99. The agent's 80 beats neither, but it beats the 0 of d.

    It takes the place of the weakest in its own matrix ("displaces"); in the charitable reading the
    minimum is over the members, and it does not bid.
    """
    crews = {}
    for reading in ("literal", "charitable"):
        one = agent(mission_of(task("t")), reading=reading)
        say(one, "b", {"t": {"b": 95.0, "c": 99.0}}, {"c": 1})
        one.tick(0.0)
        crews[reading] = holders(one)
    assert crews == {"literal": {"a": 80.0, "c": 99.0}, "charitable": {"b": 95.0, "c": 99.0}}


@BOTH
def test_algorithm_1_line_11_a_higher_bid_takes_the_place_of_the_weakest(reading: str):
    one = agent(mission_of(task("t")), reading=reading)
    say(one, "b", {"t": {"b": 75.0, "c": 99.0}}, {"c": 1})
    one.tick(0.0)
    assert holders(one) == {"a": 80.0, "c": 99.0}


@BOTH
def test_algorithm_1_line_17_a_single_seat_goes_to_the_higher_bid_as_in_cbba(reading: str):
    """y is the sum of the row: 85 is not beaten by 80, 75 is."""
    for bid, winner in ((85.0, {"b": 85.0}), (75.0, {"a": 80.0})):
        one = agent(mission_of(task("t", seats=1)), reading=reading)
        say(one, "b", {"t": {"b": bid}}, {})
        one.tick(0.0)
        assert holders(one) == winner


@BOTH
def test_equal_bids_go_to_the_highest_id(reading: str):
    """ "The agent with the highest ID gets priority." a does not displace b for 80, d displaces it."""
    mission = mission_of(task("t", seats=1))
    for name, winner in (("a", {"b": 80.0}), ("d", {"d": 80.0})):
        one = agent(mission, name, reading=reading)
        say(one, "b", {"t": {"b": 80.0}}, {})
        one.tick(0.0)
        assert holders(one) == winner


def test_the_bidding_process_will_not_let_a_group_fill_up_without_its_equipment():
    """Two seats, k and w needed; b brings k. Algorithm 1 has no line for this: the literal agent bids."""
    lift = task("t", equipment=frozenset({"k", "w"}))
    for name, carried, expected in (("a", "k", False), ("a", "w", True)):
        for reading in ("literal", "charitable"):
            mission = mission_of(lift, agents="abc", equipment={name: carried, "b": "k", "c": "w"})
            one = agent(mission, name, reading=reading)
            say(one, "b", {"t": {"b": 99.0}}, {})
            one.tick(0.0)
            assert ("a" in holders(one)) is (expected or reading == "literal")


def test_nobody_bids_where_no_agent_that_exists_could_complete_the_group():
    mission = mission_of(task("t", equipment=frozenset("kw")), agents="ab", equipment={"a": "k", "b": "k"})
    one = agent(mission)
    one.tick(0.0)
    assert holders(one) == {}
    few = agent(mission_of(task("t", seats=3), agents="ab"))
    few.tick(0.0)
    assert holders(few) == {}


# --- Algorithm 2


def test_algorithm_2_line_8_a_withdrawn_bid_travels_two_hops_only_if_others_may_relay_it():
    """b has heard from c more lately than a has, and c holds nothing any more. As printed, k = m."""
    believed = {}
    for reading in ("literal", "charitable"):
        one = agent(mission_of(task("t")), reading=reading)
        say(one, "c", {"t": {"c": 70.0}}, {}, sequence=1)
        say(one, "b", {}, {"c": 2})
        believed[reading] = holders(one)
    assert believed == {"literal": {"c": 70.0}, "charitable": {}}


@BOTH
def test_algorithm_2_line_9_what_an_agent_says_of_itself_counts(reading: str):
    one = agent(mission_of(task("t"), task("u", 500.0)), reading=reading)
    say(one, "c", {"t": {"c": 70.0}, "u": {"c": 3.0}}, {}, sequence=1)
    say(one, "c", {"t": {"c": 65.0}}, {}, sequence=2)
    assert holders(one) == {"c": 65.0}
    assert holders(one, "u") == {}


@BOTH
def test_algorithm_2_line_13_old_news_is_no_news(reading: str):
    """b still tells of a bid by c that a knows to be withdrawn: s_km is not greater than s_im."""
    one = agent(mission_of(task("t")), reading=reading)
    say(one, "c", {}, {}, sequence=2)
    say(one, "b", {"t": {"c": 70.0}}, {"c": 1})
    assert holders(one) == {}


@BOTH
def test_algorithm_2_line_13_nobody_is_told_of_its_own_bids(reading: str):
    """i is not m: what b believes of a's bids does not become a's bid."""
    one = agent(mission_of(task("t", 500.0)), reading=reading)
    say(one, "b", {"t": {"a": 70.0}}, {"a": 9})
    one.tick(0.0)
    assert holders(one) == {}


def test_algorithm_2_line_13_a_member_that_repeats_its_bid_ousts_another_as_printed():
    """The text adds "nor assigned by i to the given task". Without it c, known already, replaces b.

    The group is full with 90 (b) and 95 (c): min = 90 < 95, so line 18 sets b's bid to 0.
    """
    crews = {}
    for reading in ("literal", "charitable"):
        one = agent(mission_of(task("t", 500.0)), reading=reading)
        say(one, "b", {"t": {"b": 90.0}}, {})
        say(one, "c", {"t": {"c": 95.0}}, {}, sequence=1)
        assert holders(one) == {"b": 90.0, "c": 95.0}
        say(one, "c", {"t": {"c": 95.0}}, {}, sequence=2)
        crews[reading] = holders(one)
    assert crews == {"literal": {"c": 95.0}, "charitable": {"b": 90.0, "c": 95.0}}


@BOTH
def test_algorithm_2_line_15_a_free_seat_takes_whoever_is_new(reading: str):
    one = agent(mission_of(task("t", 500.0, seats=3)), reading=reading)
    say(one, "b", {"t": {"b": 5.0, "c": 1.0}}, {"c": 1})
    assert holders(one) == {"b": 5.0, "c": 1.0}


@BOTH
def test_algorithm_2_line_17_in_a_full_group_the_higher_bid_replaces_the_lowest(reading: str):
    one = agent(mission_of(task("t", 500.0)), reading=reading)
    say(one, "b", {"t": {"b": 90.0, "c": 80.0}}, {"c": 1})
    say(one, "d", {"t": {"d": 85.0}}, {})
    assert holders(one) == {"b": 90.0, "d": 85.0}
    # And one that is no higher does not.
    other = agent(mission_of(task("t", 500.0)), reading=reading)
    say(other, "b", {"t": {"b": 90.0, "c": 80.0}}, {"c": 1})
    say(other, "d", {"t": {"d": 75.0}}, {})
    assert holders(other) == {"b": 90.0, "c": 80.0}


def test_eq_9_only_a_member_with_the_same_equipment_may_be_replaced():
    """c is the lowest (w), d brings k: eq. (9) lets it replace b, who brings k too, and never c.

    Line 17 as printed takes the lowest of all, and the winch is gone.
    """
    lift = task("t", 500.0, equipment=frozenset("kw"))
    crews = {}
    for reading in ("literal", "charitable"):
        one = agent(mission_of(lift, equipment={"b": "k", "c": "w", "d": "k"}), reading=reading)
        say(one, "b", {"t": {"b": 90.0, "c": 80.0}}, {"c": 1})
        say(one, "d", {"t": {"d": 95.0}}, {})
        crews[reading] = holders(one)
    assert crews == {"literal": {"b": 90.0, "d": 95.0}, "charitable": {"c": 80.0, "d": 95.0}}


@BOTH
def test_algorithm_2_line_17_equal_bids_go_to_the_highest_id(reading: str):
    one = agent(mission_of(task("t", 500.0)), reading=reading)
    say(one, "d", {"t": {"b": 80.0, "d": 90.0}}, {"b": 1})
    say(one, "c", {"t": {"c": 80.0}}, {})
    assert holders(one) == {"c": 80.0, "d": 90.0}


@BOTH
def test_algorithm_2_line_17_of_two_that_are_equally_low_the_lower_id_goes(reading: str):
    one = agent(mission_of(task("t", 500.0)), reading=reading)
    say(one, "c", {"t": {"b": 80.0, "c": 80.0}}, {"b": 1})
    say(one, "d", {"t": {"d": 90.0}}, {})
    assert holders(one) == {"c": 80.0, "d": 90.0}


def test_algorithm_2_line_24_stamps_are_set_after_all_tasks():
    """Set inside the loop over tasks, news would count for the first task only. Here it counts for both."""
    one = agent(mission_of(task("t", 500.0), task("u", 500.0)), reading="literal")
    say(one, "b", {"t": {"b": 5.0}, "u": {"b": 6.0}}, {})
    assert holders(one) == {"b": 5.0}
    assert holders(one, "u") == {"b": 6.0}


def test_algorithm_2_line_24_only_direct_news_moves_a_stamp_as_printed():
    """CBBA sets s_im to the newest stamp that a neighbour relays; the print only s_ik = t."""
    stamps = {}
    for reading in ("literal", "charitable"):
        one = agent(mission_of(task("t", 500.0)), reading=reading)
        say(one, "b", {}, {"c": 7})
        stamps[reading] = one.heard()["c"]
    assert stamps == {"literal": NOT_LISTED, "charitable": INCARNATION + 7}


# --- what follows a loss; eq. (10)


def test_a_lost_seat_takes_later_tasks_with_it_where_cbba_is_followed():
    """b and c take both seats of t; u, which a took after it, is released only in the charitable reading."""
    mission = mission_of(task("t", 20.0), task("u", 60.0))
    events, bundles = {}, {}
    for reading in ("literal", "charitable"):
        one = agent(mission, reading=reading)
        one.tick(0.0)
        assert one.bundle == ["t", "u"]
        one.events()
        say(one, "b", {"t": {"b": 90.0, "c": 95.0}}, {"c": 1})
        one._state.limit = 0  # nothing new is taken, so that what is left can be seen
        one.tick(1.0)
        events[reading] = [event for event in one.events() if isinstance(event, TaskOutbid | TaskReleased)]
        bundles[reading] = one.bundle
    assert bundles == {"literal": ["u"], "charitable": []}
    lost = TaskOutbid("t", 80.0, "b", 90.0)
    assert events["literal"] == [lost]
    assert events["charitable"] == [lost, TaskReleased("u", "t")]


@BOTH
def test_a_lost_single_seat_takes_later_tasks_with_it_in_either_reading(reading: str):
    """Line 5: "Consensus from CBBA", which releases all that was added after the outbid task."""
    one = agent(mission_of(task("t", 20.0, seats=1), task("u", 60.0)), reading=reading)
    one.tick(0.0)
    assert one.bundle == ["t", "u"]
    say(one, "b", {"t": {"b": 90.0}}, {})
    one._state.limit = 0
    one.tick(1.0)
    assert one.bundle == []


@BOTH
def test_eq_10_a_member_leaves_a_group_that_is_not_filled_in_time(reading: str):
    """t - T_j > δ: taken at 0 s with δ = 3 s, held at 3 s, left at 4 s, and not taken again."""
    one = agent(mission_of(task("t")), reading=reading, quitting=True, quit_after=3.0)
    held = []
    for now in range(7):
        one.tick(float(now))
        held.append(bool(one.bundle))
    assert held == [True, True, True, True, False, False, False]


@BOTH
def test_eq_10_a_filled_group_stays(reading: str):
    one = agent(mission_of(task("t")), reading=reading, quitting=True, quit_after=3.0)
    one.tick(0.0)
    say(one, "b", {"t": {"b": 70.0}}, {})
    for now in range(1, 9):
        one.tick(float(now))
    assert one.bundle == ["t"]


@BOTH
def test_eq_10_a_task_that_was_quit_is_open_again_once_another_joins(reading: str):
    """ "Mark the task unfeasible until other agents assign themselves"."""
    one = agent(mission_of(task("t")), reading=reading, quitting=True, quit_after=3.0)
    for now in range(6):
        one.tick(float(now))
    assert one.bundle == []
    say(one, "b", {"t": {"b": 70.0}}, {})
    one.tick(6.0)
    assert one.bundle == ["t"]


@BOTH
def test_eq_10_a_task_that_was_quit_stays_so_when_another_leaves_and_not_when_it_comes_back(reading: str):
    """b leaves, as a has: nobody has assigned itself. b comes back: now somebody has."""
    one = agent(mission_of(task("t", seats=3)), reading=reading, quitting=True, quit_after=3.0)
    say(one, "b", {"t": {"b": 70.0}}, {}, sequence=1)
    for now in range(6):
        one.tick(float(now))
    assert one.bundle == []
    say(one, "b", {}, {}, sequence=2)
    one.tick(6.0)
    assert one.bundle == []
    say(one, "b", {"t": {"b": 70.0}}, {}, sequence=3)
    one.tick(7.0)
    assert one.bundle == ["t"]


# --- local data and communication


def test_assignments_are_sent_as_triples_of_what_is_known_and_nothing_else():
    """Fig. 3: [i j x_ij]. Of two tasks and four agents one bid is known: one triple, not eight cells."""
    one = agent(mission_of(task("t"), task("u", 500.0)))
    (message,) = one.tick(0.0)
    assert isinstance(message, Assignments)
    assert message.entries == 1
    assert (message.tasks.tolist(), message.holders.tolist(), message.bids.tolist()) == ([0], [0], [80.0])


def test_each_agent_may_keep_its_tasks_and_agents_in_an_order_of_its_own():
    """ "We cannot use the matrix index of X as a reliable identifier": ids are, whatever rows they have."""
    said = agent(mission_of(task("t"), task("u", 60.0)), "b").tick(0.0)[0]
    assert isinstance(said, Assignments)
    turned = Assignments(
        **{**vars(said), "agent_ids": said.agent_ids[::-1], "task_ids": said.task_ids[::-1],
           "heard": said.heard[::-1], "tasks": 1 - said.tasks, "holders": 3 - said.holders}
    )  # fmt: skip
    straight, other = (
        agent(mission_of(task("t"), task("u", 60.0))),
        agent(mission_of(task("t"), task("u", 60.0))),
    )
    straight.receive(said, 0.0)
    other.receive(turned, 0.0)
    assert straight.beliefs() == other.beliefs() == {"t": (("b", 80.0),), "u": (("b", 60.0),)}


def test_the_whole_matrix_is_sent_every_time_as_the_paper_does():
    one = agent(mission_of(task("t"), task("u", 60.0)))
    sizes = [message.entries for now in range(4) for message in one.tick(float(now))]
    assert sizes == [2, 2, 2, 2]
