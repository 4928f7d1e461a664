"""The slow twin of coalition forming: against numbers worked out by hand, and against itself."""

from __future__ import annotations

import math
import random

import pytest

import naive
from coalition_missions import FAMILIES, missions
from naive_coalition import Entry, Rumour, central, negotiate, plan, referee
from swarmbid.model import Agent, Mission, Task
from swarmbid.plan import make_plan
from swarmbid.scores import make_score
from swarmbid.verify import verify

PLAIN = make_score("time_window")  # the reward, less fuel, of which there is none unless said
FADING = make_score("time_discounted")
DISTANCE = make_score("distance_cost")  # the reward less metres flown
SCORES = [make_score(name) for name in ("time_discounted", "distance_cost", "time_window", "revisit")]
SEEDS = 12


def agent(name: str, x: float = 0.0, equipment: str = "", **fields: object) -> Agent:
    """An agent on a line, at 1 m/s, with one letter for each piece of equipment."""
    return Agent(id=name, position=(x, 0.0, 0.0), equipment=frozenset(equipment), **fields)


def task(name: str, x: float = 0.0, seats: int = 2, equipment: str = "", **fields: object) -> Task:
    return Task(
        id=name, position=(x, 0.0, 0.0), agents_required=seats, equipment=frozenset(equipment), **fields
    )


def team(*items: Agent | Task) -> Mission:
    return Mission(
        agents=tuple(item for item in items if isinstance(item, Agent)),
        tasks=tuple(item for item in items if isinstance(item, Task)),
    )


def took(task_id: str, bid: float, position: int = 0, founder: str | None = None) -> Entry:
    return Entry(task_id, bid, bid, position, founder)


# --- the referee, by hand


def test_a_pair_starts_when_the_later_one_is_there():
    """a is 10 m away, b 20 m, at 1 m/s: both start at 20 s. With an opening at 25 s both wait for that."""
    for opens, start in ((0.0, 20.0), (25.0, 25.0)):
        mission = team(agent("a"), agent("b", 30.0), task("t", 10.0, start=opens))
        outcome = referee(mission, PLAIN, {"a": [took("t", 9)], "b": [took("t", 8)]})
        assert outcome.members == {"t": ["a", "b"]}
        assert outcome.complete == {"t"}
        assert outcome.start == {"t": start}


@pytest.mark.parametrize(("end", "accepted"), [(60.0, True), (59.0, False)])
def test_a_late_member_delays_what_the_others_do_next(end: float, accepted: bool):
    """a: t1 at 10 s, 5 s of service, 15 m on to t2 at 30 s. b, 30 m from t1 and free at 10 s, makes t1 start
    at 40 s, and t2 at 40 + 5 + 15 = 60 s. If t2 must start by 59 s, b is refused, and so is what it adds.
    """
    mission = team(
        agent("a"),
        agent("b", 40.0, available_at=10.0),
        task("t1", 10.0, duration=5.0),
        task("t2", 25.0, seats=1, end=end),
        task("t3", 40.0, seats=1),
    )
    records = {"a": [took("t1", 9), took("t2", 8, 1)], "b": [took("t1", 7), took("t3", 6)]}
    outcome = referee(mission, PLAIN, records)
    if accepted:
        # t3 is where b starts from, and comes first: b is there at 10 s and at t1 at 40 s all the same.
        assert outcome.start == {"t1": 40.0, "t2": 60.0, "t3": 10.0}
        assert outcome.paths == {"a": ["t1", "t2"], "b": ["t3", "t1"]}
        assert outcome.refused == []
    else:
        assert outcome.start == {"t1": 10.0, "t2": 30.0}
        assert outcome.refused == [("b", "t1"), ("b", "t3")]
        assert outcome.complete == {"t2"}


def test_who_would_wait_for_each_other_in_a_circle_is_refused():
    """a does x, then y. b has y, and then x after it: x waits for b's y, which waits for a's x.

    Everything is in one place and takes no time, so only the order is in the way. Before y it is allowed.
    """
    mission = team(agent("a"), agent("b"), task("x"), task("y"))
    records = {"a": [took("x", 9), took("y", 8, 1)], "b": [took("y", 7), took("x", 6, 1)]}
    outcome = referee(mission, PLAIN, records)
    assert outcome.refused == [("b", "x")]
    assert outcome.complete == {"y"}
    records["b"][1] = took("x", 6, 0)
    outcome = referee(mission, PLAIN, records)
    assert outcome.refused == []
    assert outcome.paths == {"a": ["x", "y"], "b": ["x", "y"]}


def test_a_circle_through_a_prerequisite_is_refused():
    """y comes after x, so a may not do y before x, though it is at y already."""
    mission = team(agent("a"), task("x", 10.0, seats=1), task("y", seats=1, prerequisites=("x",)))
    assert referee(mission, PLAIN, {"a": [took("x", 5), took("y", 9, 0)]}).refused == [("a", "y")]
    # 10 m to x, 10 m back to y.
    assert referee(mission, PLAIN, {"a": [took("x", 5), took("y", 9, 1)]}).start == {"x": 10.0, "y": 20.0}
    assert [entry.position for entry in plan(mission, PLAIN, "a", {})] == [0, 1]


def test_the_last_seat_is_for_what_is_still_missing():
    """Two seats, A and B needed: after a, who has A, c has only A again and is refused; b brings B."""
    mission = team(agent("a", equipment="A"), agent("b", equipment="B"), agent("c", equipment="A"))
    mission = team(*mission.agents, task("t", equipment="AB"), task("alone", seats=1, equipment="AB"))
    records = {"a": [took("t", 9)], "c": [took("t", 8)], "b": [took("t", 7), took("alone", 6)]}
    outcome = referee(mission, PLAIN, records)
    assert outcome.members == {"t": ["a", "b"]}
    # A single seat needs all of it in one agent, and nobody has that.
    assert outcome.refused == [("c", "t"), ("b", "alone")]


def test_with_as_many_seats_as_the_equipment_takes_everybody_brings_something():
    """A and B needed. After a (A): c (A) brings nothing; d (AB) would make a needless; b (B) completes it.

    A second mission needs C, which nobody has: then nobody may begin.
    """
    crew = [agent("a", equipment="A"), agent("b", equipment="B"), agent("c", equipment="A")]
    crew.append(agent("d", equipment="AB"))
    records = {"a": [took("t", 9)], "c": [took("t", 8)], "d": [took("t", 7)], "b": [took("t", 6)]}
    outcome = referee(team(*crew, task("t", seats=0, equipment="AB")), PLAIN, records)
    assert outcome.members == {"t": ["a", "b"]}
    assert outcome.refused == [("c", "t"), ("d", "t")]
    assert outcome.complete == {"t"}
    assert referee(team(*crew, task("t", seats=0, equipment="ABC")), PLAIN, records).members == {}


def test_nobody_joins_who_would_leave_no_room_for_what_is_still_missing():
    """A, B and C needed, of A, BC and C: with A and C seated, BC would make C needless, and B stays missing.

    So C is refused and BC completes the group. Where somebody carries B alone, C may stay and B comes.
    """
    crew = [agent("a", equipment="A"), agent("c", equipment="C"), agent("x", equipment="BC")]
    whole = task("t", seats=0, equipment="ABC")
    records = {"a": [took("t", 9)], "c": [took("t", 8)], "x": [took("t", 7)]}
    outcome = referee(team(*crew, whole), PLAIN, records)
    assert outcome.members == {"t": ["a", "x"]}
    assert outcome.refused == [("c", "t")]
    assert outcome.complete == {"t"}
    # d need not bid for the others to count on it, as long as it is there.
    full = team(*crew, agent("d", equipment="B"), whole)
    assert referee(full, PLAIN, records).members == {"t": ["a", "c"]}
    assert referee(full, PLAIN, records | {"d": [took("t", 6)]}).complete == {"t"}
    assert referee(full, PLAIN, records, alive=frozenset("acx")).members == {"t": ["a", "x"]}


def test_what_comes_after_waits_for_a_complete_group():
    """t1 is 10 m from a and b, service 5 s: done at 15 s. c is at t2, 20 m out, at 5 s, and starts at 15 s.

    However high c bids, it ranks behind everything of an earlier stage; without b, t1 is incomplete.
    """
    mission = team(
        agent("a"),
        agent("b"),
        agent("c", 25.0),
        task("t1", 10.0, duration=5.0),
        task("t2", 20.0, seats=1, prerequisites=("t1",)),
    )
    records = {"a": [took("t1", 5)], "b": [took("t1", 4)], "c": [took("t2", 99)]}
    assert referee(mission, PLAIN, records).start == {"t1": 10.0, "t2": 15.0}
    assert referee(mission, PLAIN, records | {"b": []}).refused == [("c", "t2")]


@pytest.mark.parametrize(
    "fields",
    [{"range": 19.0}, {"endurance": 29.0}, {"bundle_limit": 1}],
)
def test_an_agent_that_could_not_come_home_is_refused(fields: dict[str, float]):
    """a has t1 at home, then t2, 10 m out: 20 m in all. b holds t2 back until 20 s: a is home at 30 s."""
    for limits, refused in (({}, []), (fields, [("a", "t2")])):
        mission = team(
            agent("a", base=(0.0, 0.0, 0.0), **limits),
            agent("b", 30.0),
            task("t1", seats=1),
            task("t2", 10.0),
        )
        records = {"b": [took("t2", 9)], "a": [took("t1", 8), took("t2", 7, 1)]}
        assert referee(mission, PLAIN, records).refused == refused


def test_bars_strangers_and_the_dead_count_for_nothing():
    mission = team(agent("a"), agent("b"), task("t", seats=1))
    records = {"b": [took("t", 9)], "a": [took("t", 8)]}
    assert referee(mission, PLAIN, records).members == {"t": ["b"]}
    assert referee(mission, PLAIN, records, barred=frozenset({("b", "t")})).members == {"t": ["a"]}
    assert referee(mission, PLAIN, records, alive=frozenset({"a"})).members == {"t": ["a"]}
    # The append rule adds at the end of a path only.
    two = team(agent("a"), task("t", seats=1), task("u", seats=1))
    ahead = {"a": [took("t", 9), took("u", 8, 0)]}
    assert referee(two, PLAIN, ahead).refused == []
    assert referee(two, PLAIN, ahead, insertion="append").refused == [("a", "u")]


# --- plans, by hand


def test_a_bid_never_exceeds_the_one_before():
    """Reward 30 each, less metres: t1 at 10 m gains 20, t2 at 11 m only 19. After t1, t2 gains 30 - 1 = 29,
    and is bid for with 20.
    """
    mission = team(agent("a"), task("t1", 10.0, seats=1, reward=30.0), task("t2", 11.0, seats=1, reward=30.0))
    assert plan(mission, DISTANCE, "a", {}) == [
        Entry("t1", 20.0, 20.0, 0, None),
        Entry("t2", 20.0, 29.0, 1, None),
    ]


# Everything in one place. x is worth 100 e^(-0.1 t) and takes 1 s; y is worth 50, must start at 0 s and takes
# 5 s, so it goes before x and delays it to 5 s. Whoever joins y first pays for that: 50 - 100 (1 - e^-0.5).
# To the second the delay is free, for its x waits for the first: 50.
DELAY = team(
    agent("a"),
    agent("b"),
    task("x", reward=100.0, discount=0.1, duration=1.0),
    task("y", reward=50.0, end=0.0, duration=5.0),
)
FIRST = 50.0 - 100.0 * (1.0 - math.exp(-0.5))  # 10.65


def test_a_claim_does_not_rise_when_another_pays_for_the_delay():
    """Of equals the higher id ranks higher: b founds both groups."""
    records = negotiate(DELAY, FADING).records
    for name in "ab":
        assert [entry.task for entry in records[name]] == ["x", "y"]
        assert [entry.bid for entry in records[name]] == pytest.approx([100.0, FIRST])


def test_stale_entries_do_not_hold_each_other_up():
    """Each has y for 40 on the table, which only the other's entry could justify. Three rounds end that.

    If the second's bid were its gain of 50 then, kept just below the first's, the two would go down in
    turns by the smallest number there is.
    """
    stale = {name: [took("x", 100.0), took("y", 40.0)] for name in "ab"}
    agreed = negotiate(DELAY, FADING, records=stale, rounds=20)
    assert agreed.settled
    assert agreed.rounds <= 3
    assert agreed.records == central(DELAY, FADING).records


# Reward 100 less metres, one task each. a: t1 at 10 m for 90 (t2 at 80 m for 20). b, at 60 m: t2 for 80,
# t1 at 50 m for 50.
APART = team(
    agent("a", bundle_limit=1),
    agent("b", 60.0, bundle_limit=1),
    task("t1", 10.0, reward=100.0),
    task("t2", 80.0, reward=100.0),
)


def test_team_rewards_fill_an_open_group_before_the_next_one_opens():
    """Alone, each opens a group of its own. With team rewards b claims the rank behind a, and joins t1."""
    own = negotiate(APART, DISTANCE, quitting=False)
    assert own.outcome.members == {"t1": ["a"], "t2": ["b"]}
    assert own.outcome.complete == set()
    shared = negotiate(APART, DISTANCE, quitting=False, team_rewards=True)
    assert shared.records == {
        "a": [Entry("t1", 90.0, 90.0, 0, None)],
        "b": [Entry("t1", 90.0, 50.0, 0, "a")],
    }
    assert shared.outcome.complete == {"t1"}


def test_a_claim_that_falls_never_lifts_an_entry():
    """Reward 100 less metres and 15 s of service. b gains 100 - 15 - 14.14 = 70.86 from t, 75 from u after
    it: it founds both groups for 70.86. a gains 70.86 from u and joins that; then 75 from t after u, but
    there each would wait for the other; before u it is 85 - (22.36 + 10 - 14.14) = 66.78. c gains 53.38.

    So the second seat at t is a's: it ranks behind b, as u does, and by 66.78 above c. Had a left b's rank
    because 75 was too much to claim behind u, the refusal would lift it back, after c has taken the seat.
    """
    places = {"a": (0.0, 0.0, 0.0), "b": (20.0, 30.0, 0.0), "c": (40.0, 30.0, 0.0)}
    mission = Mission(
        agents=tuple(Agent(id=name, position=place) for name, place in places.items()),
        tasks=tuple(
            Task(id=name, position=(10.0, y, 0.0), reward=100.0, duration=15.0, agents_required=2)
            for name, y in (("t", 20.0), ("u", 10.0))
        ),
    )
    agreed = negotiate(mission, DISTANCE, team_rewards=True, rounds=20)
    assert agreed.settled
    assert agreed.outcome.members == {"t": ["a", "b"], "u": ["a", "b"]}
    assert [entry.founder for entry in agreed.records["a"]] == ["b", "b"]
    assert [entry.gain for entry in agreed.records["a"]] == pytest.approx([70.86, 66.78], abs=0.01)


def test_who_joins_by_the_rank_of_a_founder_needs_that_founder():
    mission = team(agent("a"), agent("b"), agent("c"), task("t", seats=3))
    joins = {"b": [took("t", 90.0, 0, "a")], "c": [took("t", 80.0)]}
    assert referee(mission, PLAIN, joins).refused == [("b", "t")]
    assert referee(mission, PLAIN, joins | {"a": [took("t", 90.0)]}).refused == []
    # c founds the group now, and b named another.
    assert referee(mission, PLAIN, joins | {"a": [took("t", 70.0)]}).refused == [("b", "t")]


def test_the_worst_group_is_dissolved_first():
    """Both groups are half full. t2's gain of 80 is the smaller: b is barred from it and joins t1 for 50.

    All at once, a is barred from t1 as well: a takes t2 for 20, b t1 for 50, and both are alone again,
    the smaller gain goes first as ever; then nobody is left who may do anything.
    """
    agreed = negotiate(APART, DISTANCE)
    assert agreed.quits == [("t2", ("b",))]
    assert agreed.outcome.complete == {"t1"}
    assert [entry.gain for entry in agreed.records["b"]] == [50.0]
    everything = negotiate(APART, DISTANCE, dissolve=1.0)
    assert everything.quits == [("t2", ("b",)), ("t1", ("a",)), ("t2", ("a",)), ("t1", ("b",))]
    assert everything.outcome.members == {}


# --- the twin against itself, and against the other twin


def cases(seeds: range) -> list[tuple[str, int]]:
    return [(family, seed) for family in FAMILIES for seed in seeds]


def switches(seed: int) -> dict[str, object]:
    return {
        "team_rewards": seed // 4 % 2 == 1,
        "insertion": "append" if seed % 5 == 0 else "shift",
        "dissolve": 0.5 if seed % 3 == 0 else 0.0,
    }


@pytest.mark.parametrize("quitting", [False, True])
def test_what_all_agree_on_is_what_a_central_planner_would_do(quitting: bool, effort: int):
    """The same members, starts, paths, bids and quits; and what is complete can be executed."""
    for family, seed in cases(range(SEEDS * effort)):
        mission, score = missions(seed, family), SCORES[seed // 2 % len(SCORES)]
        options = switches(seed)
        agreed = negotiate(mission, score, quitting=quitting, **options)
        wanted = central(mission, score, quitting=quitting, **options)
        assert agreed.settled, (family, seed)
        assert agreed[:4] == wanted[:4], (family, seed)
        assert agreed.outcome.refused == [], (family, seed)
        if quitting:
            assert agreed.outcome.complete == set(agreed.outcome.members), (family, seed)
            pairs = sum(len(crew) for _, crew in agreed.quits)
            assert len(agreed.barred) == pairs <= len(mission.agents) * len(mission.tasks), (family, seed)
        else:
            entries = sum(len(bundle) for bundle in agreed.records.values())
            assert agreed.rounds <= entries + 1, (family, seed)
        paths = agreed.outcome.complete_paths()
        made = make_plan(mission, paths, score, "cbga", str(options["insertion"]))
        assert verify(mission, made, score) == [], (family, seed)


def test_neither_the_order_of_news_nor_what_was_said_before_matters(effort: int):
    """Agents sleep and hear of each other by chance, and begin with nonsense on the table."""
    for family, seed in cases(range(100, 100 + SEEDS // 2 * effort)):
        mission, score, rng = missions(seed, family), SCORES[seed % len(SCORES)], random.Random(seed)
        names = [agent.id for agent in mission.agents]
        nonsense = {
            name: [
                took(one.id, rng.choice([100.0, rng.uniform(0, 130)]), place // 2, rng.choice([None, *names]))
                for place, one in enumerate(rng.sample(mission.tasks, rng.randint(0, len(mission.tasks))))
            ]
            for name in names
        }
        options = switches(seed)
        agreed = negotiate(mission, score, records=nonsense, rumour=Rumour(rng), **options)
        assert agreed.settled, (family, seed)
        assert agreed[:4] == central(mission, score, **options)[:4], (family, seed)


def test_with_one_agent_a_task_it_is_warped_greedy(effort: int):
    """The same bundles, bids, paths and times as the slow twin of CBBA's central planner."""
    for seed in range(3 * SEEDS * effort):
        mission = missions(seed, "single")
        label = ("time_discounted", "distance_cost", "time_window", "revisit")[seed // 4 % 4]
        agreed = negotiate(mission, make_score(label))
        bundles, _ = naive.sequential_greedy(mission, naive.SCORES[label], "shift", warp=True)
        for name, bundle in bundles.items():
            assert [entry.task for entry in agreed.records[name]] == bundle.tasks, seed
            assert [entry.bid for entry in agreed.records[name]] == bundle.bids, seed
            assert agreed.outcome.complete_paths()[name] == bundle.path, seed


def test_every_family_forms_groups_and_quits_some():
    """What the other tests run on has what they are about; the guard against missions that test nothing."""
    for family in FAMILIES:
        results = [(missions(seed, family), seed) for seed in range(SEEDS)]
        ends = [central(mission, FADING) for mission, _ in results]
        assert sum(len(end.outcome.complete) for end in ends) >= SEEDS, family
        groups = sum(len(crew) > 1 for end in ends for crew in end.outcome.members.values())
        assert (groups > 0) == (family != "single"), family
        if family in ("L2", "L4", "ABC"):
            assert sum(len(end.quits) for end in ends) > 0, family
