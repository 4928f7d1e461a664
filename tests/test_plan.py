"""A plan states what is flown, in numbers that a hand can follow, and why tasks are left over."""

from __future__ import annotations

import json
import math

import pytest

from generators import random_mission
from swarmbid.errors import InputError
from swarmbid.model import Agent, Mission, Task
from swarmbid.plan import Plan, make_plan
from swarmbid.scores import make_score
from swarmbid.simulator import simulate
from swarmbid.unserved import MOST_STEPS, REASONS, explain_unserved
from swarmbid.verify import verify

REWARD = make_score("time_window")


def at(x: float, y: float = 0.0) -> tuple[float, float, float]:
    return (x, y, 0.0)


def two_stop_mission() -> Mission:
    """One agent with 2 m/s, free at 1 s, two tasks on a line, the base where it stands."""
    return Mission(
        name="line",
        agents=(
            Agent(
                id="a",
                position=at(0),
                base=at(0),
                speed=2.0,
                available_at=1.0,
                fuel_per_metre=0.1,
                range=50.0,
            ),
            Agent(id="b", position=at(0, 9), available_at=3.0),
        ),
        tasks=(
            Task(id="t1", position=at(10), reward=50.0, duration=4.0),
            Task(id="t2", position=at(22), reward=30.0, start=20.0, end=60.0),
            Task(id="t3", position=at(900), reward=5.0, end=10.0),
        ),
    )


def two_stop_plan() -> Plan:
    paths = {"a": [("t1", 6.0), ("t2", 20.0)]}
    return make_plan(two_stop_mission(), paths, REWARD, "hand", "hold")


def test_times_legs_and_scores_of_a_path():
    """t1: 10 m at 2 m/s from 1 s -> 6 s, 4 s of service, 50 - 1; t2: 12 m -> 16 s, waits to 20, 30 - 1.2."""
    first, second = two_stop_plan().agents[0].visits
    assert (first.task, first.arrival, first.start, first.end, first.leg) == ("t1", 6.0, 6.0, 10.0, 10.0)
    assert (second.task, second.arrival, second.start, second.end, second.leg) == (
        "t2",
        16.0,
        20.0,
        20.0,
        12.0,
    )
    assert (first.score, second.score) == (49.0, pytest.approx(28.8))


def test_the_way_back_counts_in_distance_and_finish():
    """10 + 12 + 22 back = 44 m; 20 s + 22 m at 2 m/s = 31 s."""
    plan = two_stop_plan()
    assert (plan.agents[0].distance, plan.agents[0].finish) == (44.0, 31.0)
    assert plan.agents[0].score == plan.total_score == plan.honest_score == pytest.approx(77.8)


def test_an_idle_agent_stays():
    """b is free at 3 s and flies nowhere."""
    idle = two_stop_plan().agents[1]
    assert (idle.agent, idle.visits, idle.distance, idle.finish, idle.score) == ("b", (), 0.0, 3.0, 0.0)


def test_fuel_from_the_start_is_reported_beside_the_path():
    """t2 is 22 m from where the agent began but 12 m from t1: 30 - 2.2 as bid, 30 - 1.2 along the path."""
    paths = {"a": [("t1", 6.0), ("t2", 20.0)]}
    score = make_score("time_discounted", fuel="start")
    plan = make_plan(two_stop_mission(), paths, score, "cbba", "hold")
    assert plan.total_score == pytest.approx(76.8)
    assert plan.honest_score == pytest.approx(77.8)
    assert "score 76.8 as bid, 77.8 along the paths" in plan.summary()


def test_distances_are_rounded_as_the_mission_says():
    """10 and 12 m in steps of 7 m are 7 and 7; back 22 is 21."""
    mission = two_stop_mission()
    mission = Mission(agents=mission.agents, tasks=mission.tasks, distance_step=7.0)
    plan = make_plan(mission, {"a": [("t1", 6.0), ("t2", 20.0)]}, REWARD, "hand", "hold")
    assert [visit.leg for visit in plan.agents[0].visits] == [7.0, 7.0]
    assert plan.agents[0].distance == 35.0


def test_ids_that_do_not_exist_are_refused_together():
    with pytest.raises(InputError) as caught:
        make_plan(two_stop_mission(), {"z": [], "a": [("t9", 0.0)]}, REWARD, "hand", "hold")
    assert [fault.why for fault in caught.value.faults] == [
        "is no agent of this mission",
        "visits 't9', which is no task",
    ]


def test_the_summary_is_compact():
    assert two_stop_plan().summary().splitlines() == [
        "line: 2 of 3 tasks served by 1 of 2 agents (hand, time_window), score 77.8",
        "  a  t1 at 6.0 s, t2 at 20.0 s; 44.0 m, done at 31.0 s, score 77.8",
        "  b  idle",
        "not served:",
        "  t3  window: Service must start by 10 s; a would be there first, at 451 s,"
        " even doing nothing else.",
    ]


# --- the file ---------------------------------------------------------------------------------------


def test_a_plan_survives_json():
    plan = two_stop_plan()
    text = json.dumps(plan.to_dict(), allow_nan=False)
    assert Plan.from_dict(json.loads(text)) == plan
    assert json.loads(text)["version"] == 1


def broken(change) -> list[tuple[str, str]]:
    data = two_stop_plan().to_dict()
    change(data)
    with pytest.raises(InputError) as caught:
        Plan.from_dict(data, where="p.json")
    assert {fault.where for fault in caught.value.faults} == {"p.json"}
    return [(fault.field, fault.why) for fault in caught.value.faults]


def test_a_bad_plan_file_names_every_fault():
    """A missing field, a wrong type, NaN, an unknown field and an unknown reason, all at once."""

    def change(data):
        del data["mission"]
        data["agents"][0]["visits"][1]["start"] = "20"
        data["agents"][1]["finish"] = math.nan
        data["agents"][1]["speed"] = 2.0
        data["unserved"][0]["reason"] = "laziness"
        data["total_score"] = True

    assert sorted(broken(change)) == [
        ("agents[0].visits[1].start", "is a text, not a number"),
        ("agents[1].finish", "is nan, not a finite number"),
        ("agents[1].speed", "is no field of a plan"),
        ("mission", "is missing"),
        ("total_score", "is true or false, not a number"),
        ("unserved[0].reason", "is 'laziness'"),
    ]


@pytest.mark.parametrize(
    ("change", "field", "why"),
    [
        (lambda d: d.update(version=2), "version", "is 2; this swarmbid reads version 1"),
        (lambda d: d.pop("version"), "version", "is None; this swarmbid reads version 1"),
        (lambda d: d.update(kind="trace"), "", "is not a plan"),
        (lambda d: d.update(agents={}), "agents", "is an object, not a list"),
        (lambda d: d.update(agents=None), "agents", "is missing"),
        (lambda d: d.update(agents=[None]), "agents[0]", "is null, not an object"),
        (lambda d: d.update(mission=7), "mission", "is a number, not a text"),
        (lambda d: d.update(total_score=10**400), "total_score", "is not a finite number"),
    ],
)
def test_a_bad_plan_file_is_refused(change, field, why):
    assert broken(change) == [(field, why)]


@pytest.mark.parametrize("data", [None, [], "plan", 3, {}])
def test_what_is_no_plan_at_all_is_refused(data):
    with pytest.raises(InputError, match="is not a plan"):
        Plan.from_dict(data)


# --- what is left over ------------------------------------------------------------------------------


def reason_of(
    task: Task, *agents: Agent, others: tuple[Task, ...] = (), paths=None, score=REWARD, **options
) -> tuple[str, str]:
    """Why `task` is left over when `agents` follow `paths` (agent id -> [(task id, start)])."""
    rule = {"algorithm": "cbba", "insertion": "shift"} | {
        name: options.pop(name) for name in ("algorithm", "insertion") if name in options
    }
    mission = Mission(agents=agents, tasks=(task, *others), **options)
    tasks = {item.id: item for item in mission.tasks}
    steps = {
        agent: [(tasks[task_id], start) for task_id, start in path] for agent, path in (paths or {}).items()
    }
    (left,) = (item for item in explain_unserved(mission, steps, score, **rule) if item.task == task.id)
    return left.reason, left.detail


PLAIN = Agent(id="a", position=at(0))
FAR = Task(id="t", position=at(10), reward=5.0)


def test_nobody_there():
    assert reason_of(FAR) == ("no_capable_agent", "The mission has no agents.")


def test_no_agent_of_the_type():
    found = reason_of(
        Task(id="t", position=at(1), type="lift"), PLAIN, compatible={"agent": frozenset({"look"})}
    )
    assert found == ("no_capable_agent", "No agent is of a type that may do 'lift' tasks.")


def test_no_agent_with_the_equipment():
    task = Task(id="t", position=at(1), equipment=frozenset({"winch", "camera"}))
    found = reason_of(task, Agent(id="a", position=at(0), equipment=frozenset({"camera"})))
    assert found == (
        "no_capable_agent",
        "It needs camera, winch; no agent that may do it carries all of that.",
    )


def test_too_few_agents_for_the_seats():
    found = reason_of(Task(id="t", position=at(1), agents_required=2), PLAIN)
    assert found == ("too_few_agents", "It needs 2 agents; only 1 may do 'task' tasks.")


def test_equipment_that_no_group_has():
    task = Task(id="t", position=at(1), agents_required=2, equipment=frozenset({"winch"}))
    found = reason_of(task, PLAIN, Agent(id="b", position=at(0)))
    assert found == (
        "missing_equipment",
        "It needs winch; the agents that may do it have no winch between them.",
    )


def test_a_task_for_several():
    """Both have nothing to do, and each would be paid its reward of 1."""
    found = reason_of(Task(id="t", position=at(1), agents_required=2), PLAIN, Agent(id="b", position=at(0)))
    assert found == (
        "no_group",
        "It needs 2 agents; a (gain 1) and b (gain 1) could each join, but cbba formed no group of them.",
    )


def test_out_of_reach_in_time_names_the_first_who_could():
    """10 m: a at 1 m/s from 0 s arrives at 10 s, b at 2 m/s from 4 s at 9 s; the window ends at 8 s."""
    b = Agent(id="b", position=at(0), speed=2.0, available_at=4.0)
    found = reason_of(Task(id="t", position=at(10), end=8.0), PLAIN, b)
    assert found == (
        "window",
        "Service must start by 8 s; b would be there first, at 9 s, even doing nothing else.",
    )


def test_just_in_time_is_in_time():
    """10 m at 1 m/s, window until 10 s: the reason is not the window."""
    reason, _ = reason_of(Task(id="t", position=at(10), end=10.0), PLAIN)
    assert reason == "other"


def test_out_of_range_counts_the_way_back():
    """10 m there, 10 m back, range 19.9 m; with 20 m it could be done."""
    short, long = (Agent(id="a", position=at(0), base=at(0), range=metres) for metres in (19.9, 20.0))
    assert reason_of(FAR, short) == (
        "range",
        "There and back is 20 m for a, whose range is 19.9 m; no other agent can either.",
    )
    assert reason_of(FAR, long)[0] == "other"


def test_out_of_endurance_counts_waiting_and_service():
    """Free at 2 s, there at 12, opens at 30, 5 s of service, 10 s back: 45 s; endurance 42 s ends at 44 s."""
    task = Task(id="t", position=at(10), start=30.0, duration=5.0)
    short, long = (
        Agent(id="a", position=at(0), base=at(0), available_at=2.0, endurance=s) for s in (42.0, 43.0)
    )
    assert reason_of(task, short) == (
        "range",
        "There and back would keep a until 45 s, its endurance ends at 44 s; no other agent can either.",
    )
    assert reason_of(task, long)[0] == "other"


def test_a_prerequisite_that_nobody_does():
    first = Task(id="p", position=at(1), end=0.5)
    found = reason_of(Task(id="t", position=at(1), prerequisites=("p",)), PLAIN, others=(first,))
    assert found == ("prerequisite", "It comes after p, which nobody does.")


@pytest.mark.parametrize(
    ("end", "found"),
    [
        (2.9, ("prerequisite", "It comes after p, done at 3 s; service must start by 2.9 s.")),
        (3.0, ("other", "a could still take it for a gain of 1; bids never rise, gains may.")),
    ],
)
def test_a_prerequisite_that_is_done(end, found):
    """p is done at 3 s: too late for a window until 2.9 s, just in time for one until 3 s."""
    first = Task(id="p", position=at(1), duration=2.0)
    task = Task(id="t", position=at(1), prerequisites=("p",), end=end)
    assert reason_of(task, PLAIN, others=(first,), paths={"a": [("p", 1.0)]}) == found


def test_worth_nothing():
    """5 - 10 m at 1 a metre = -5 to a; b is nearer, 5 - 6 = -1, and is named."""
    score = make_score("distance_cost", second_cost=0.0)
    found = reason_of(FAR, PLAIN, Agent(id="b", position=at(4)), score=score)
    assert found == ("no_gain", "The best offer left, by b, is -1; only gains above 0 are bid.")


def test_worth_nothing_to_agents_that_are_full():
    """b carries as much as it may, and FAR would have been worth 5 - 6 = -1 to it anyway."""
    near = Task(id="n", position=at(4), reward=9.0)
    found = reason_of(
        FAR,
        Agent(id="b", position=at(4), bundle_limit=1),
        others=(near,),
        paths={"b": [("n", 0.0)]},
        score=make_score("distance_cost"),
    )
    assert found == ("no_gain", "Even with nothing else to do it is worth -1, to b.")


def test_full_bundles_and_full_days():
    """a has one task of one; b could be there at 10 s but is at n until 15 s; the window ends at 20 s."""
    others = (Task(id="m", position=at(0)), Task(id="n", position=at(0), end=0.0, duration=15.0))
    found = reason_of(
        Task(id="t", position=at(10), end=20.0),
        Agent(id="a", position=at(0), bundle_limit=1),
        Agent(id="b", position=at(0)),
        others=others,
        paths={"a": [("m", 0.0)], "b": [("n", 0.0)]},
    )
    assert found == (
        "no_room",
        "Agents able to do it: 1 with a full bundle, 1 with no place on the path.",
    )


def test_cbaa_gives_one_task_an_agent():
    near = Task(id="n", position=at(4))
    found = reason_of(FAR, PLAIN, others=(near,), paths={"a": [("n", 4.0)]}, algorithm="cbaa")
    assert found == ("no_room", "Agents able to do it: 1 with a full bundle.")


def test_what_could_still_be_taken_is_said():
    """Nobody took it, yet a could for its reward of 5."""
    found = reason_of(FAR, PLAIN)
    assert found == (
        "other",
        "a could still take it for a gain of 5; the run ended without settling it.",
    )


@pytest.mark.parametrize(
    ("insertion", "reason"), [("hold", "no_room"), ("shift", "other"), ("append", "no_room")]
)
def test_the_insertion_rule_decides_what_fits(insertion, reason):
    """n (at 10 m, promised for 10 s, open until 30 s); t at 4 m, 3 s of service, open until 12 s.

    First t: 4 to 7 s, then n at 13 s: only where n may slip. After n: at 16 s, too late for t.
    """
    n = Task(id="n", position=at(10), end=30.0)
    t = Task(id="t", position=at(4), duration=3.0, end=12.0)
    found = reason_of(t, PLAIN, others=(n,), paths={"a": [("n", 10.0)]}, insertion=insertion)
    assert found[0] == reason


def test_a_gap_between_promised_times_is_found():
    """n is promised for 20 s: t at 4 m takes 4 to 7 s, and n's 6 m more are reached at 13 s."""
    n = Task(id="n", position=at(10), start=20.0, end=20.0)
    t = Task(id="t", position=at(4), duration=3.0, end=12.0)
    found = reason_of(t, PLAIN, others=(n,), paths={"a": [("n", 20.0)]}, insertion="hold")
    assert found == ("other", "a could still take it for a gain of 1; the run ended without settling it.")


def test_waiting_for_a_revisit_counts_as_its_worth():
    """At once (1 s) the revisit at 500 s is worth nothing, less fuel; waiting makes it 8 - 0.5."""
    t = Task(id="t", position=at(1), reward=8.0, revisit_at=500.0, revisit_width=10.0)
    agent = Agent(id="a", position=at(0), fuel_per_metre=0.5)
    found = reason_of(t, agent, score=make_score("revisit"))
    assert found == ("other", "a could still take it for a gain of 7.5; the run ended without settling it.")


def test_a_gain_of_exactly_nothing_is_no_gain():
    """10 - 10 m = 0: never bid, whether the agent has room or not."""
    task = Task(id="t", position=at(10), reward=10.0)
    metres = make_score("distance_cost", second_cost=0.0)
    assert reason_of(task, PLAIN, score=metres)[0] == "no_gain"
    near = Task(id="n", position=at(0))
    full = Agent(id="a", position=at(0), bundle_limit=1)
    found = reason_of(task, full, others=(near,), paths={"a": [("n", 0.0)]}, score=metres)
    assert found == ("no_gain", "Even with nothing else to do it is worth 0, to a.")


def test_a_gap_that_is_just_long_enough_is_found():
    """t at 4 m: 4 to 7 s, n's 6 m more end at 13 s, just when n is promised."""
    n = Task(id="n", position=at(10), start=13.0, end=13.0)
    for duration, reason in ((3.0, "other"), (3.001, "no_room")):
        t = Task(id="t", position=at(4), duration=duration, end=4.0)
        found = reason_of(t, PLAIN, others=(n,), paths={"a": [("n", 13.0)]}, insertion="hold")
        assert found[0] == reason


def test_who_is_too_late_is_not_counted_as_able():
    """t closes at 10 s: a (there at 10 s, full) could do it, b (there at 20 s, idle) could not."""
    near = Task(id="n", position=at(0))
    found = reason_of(
        Task(id="t", position=at(10), end=10.0),
        Agent(id="a", position=at(0), bundle_limit=1),
        Agent(id="b", position=at(-10)),
        others=(near,),
        paths={"a": [("n", 0.0)]},
    )
    assert found == ("no_room", "Agents able to do it: 1 with a full bundle.")


def test_in_range_but_late_and_in_time_but_out_of_range():
    """a is there just in time at 10 s but may fly 5 m; b may fly for ever but is late: range, a's."""
    found = reason_of(
        Task(id="t", position=at(10), end=10.0),
        Agent(id="a", position=at(0), range=5.0),
        Agent(id="b", position=at(-10)),
    )
    assert found == (
        "range",
        "There is 10 m for a, whose range is 5 m; no other agent can either.",
    )


def test_a_single_seat_needs_all_the_equipment_in_one_agent():
    """Two tasks alike but for the seats: together a and b have what is needed, alone neither has."""
    needs = frozenset({"camera", "winch"})
    mission = Mission(
        agents=tuple(
            Agent(id=name, position=at(0), equipment=frozenset({item}))
            for name, item in (("a", "camera"), ("b", "winch"))
        ),
        tasks=(
            Task(id="t1", position=at(1), equipment=needs),
            Task(id="t2", position=at(1), equipment=needs, agents_required=2),
        ),
    )
    left = explain_unserved(mission, {}, REWARD, algorithm="cbba", insertion="hold")
    assert [item.reason for item in left] == ["no_capable_agent", "no_group"]


@pytest.mark.parametrize("end", [math.inf, 1.0])
def test_a_huge_mission_is_not_examined_for_ever(end):
    """1,000 agents with a useless offer, or too far away, for 1,000 tasks: more than is tried."""
    agents = tuple(Agent(id=f"a{k:03}", position=at(0), fuel_per_metre=1.0) for k in range(1000))
    tasks = tuple(Task(id=f"t{k:03}", position=at(10), end=end) for k in range(1000))
    assert len(agents) * len(tasks) > MOST_STEPS
    left = explain_unserved(
        Mission(agents=agents, tasks=tasks), {}, REWARD, algorithm="cbba", insertion="shift"
    )
    assert {item.reason for item in left} == {"no_gain" if math.isinf(end) else "window", "other"}
    assert left[-1].detail.startswith("Not examined")


def test_every_reason_given_is_declared():
    """Random missions with windows, ranges and limits and no paths at all: only known reasons come out."""
    seen = set()
    for seed in range(60):
        mission = random_mission(seed, ranges=True, agents=(1, 2))
        left = explain_unserved(mission, {}, REWARD, algorithm="cbba", insertion="hold")
        assert [item.task for item in left] == sorted(task.id for task in mission.tasks)
        seen |= {item.reason for item in left}
    assert {"window", "range", "other"} <= seen <= set(REASONS)


@pytest.mark.parametrize("insertion", ["hold", "shift", "append"])
@pytest.mark.parametrize("name", ["time_discounted", "time_window", "distance_cost", "revisit"])
def test_once_agreed_nobody_could_still_take_a_task(name, insertion, effort):
    """The auction stops when no bid is above 0: the plain code here, asked again, finds none either."""
    score = make_score(name)
    seen = set()
    for seed in range(12 * effort):
        mission = random_mission(seed, ranges=True, ties=seed % 2 == 0, reward_scale=8.0)
        run = simulate(mission, score=score, insertion=insertion)
        assert run.status == "converged"
        seen |= {left.reason for left in run.plan.unserved}
        assert verify(mission, run.plan, score) == []
    assert "other" not in seen
    assert {"no_room", "window"} <= seen
