"""Every rule finds the plan that breaks it and no other; a plan that can be flown has no violation."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable

import pytest
from hypothesis import given
from hypothesis import strategies as st

from generators import random_mission
from swarmbid.model import Agent, Mission, Task
from swarmbid.plan import AgentPlan, Plan, make_plan
from swarmbid.scores import make_score
from swarmbid.scores._custom import Custom
from swarmbid.unserved import Unserved
from swarmbid.verify import RULES, Violation, verify

SCORE = make_score("time_discounted")
Case = tuple[Mission, Plan]


def at(x: float, y: float = 0.0) -> tuple[float, float, float]:
    return (x, y, 0.0)


# a: 2 m/s, free at 1 s; t1 10 m away at 6 s, 4 s of service; t2 12 m on at 16 s, waits until 20 s;
# 22 m back: 44 m in all, done at 20 + 11 = 31 s, 30 s after it became available.
# b: 1 m/s, t3 is 5 m away at 5 s. Nobody does t4, 900 m away.
A = Agent(
    id="a",
    type="scout",
    position=at(0),
    base=at(0),
    speed=2.0,
    available_at=1.0,
    fuel_per_metre=0.1,
    range=44.0,
    endurance=30.0,
    bundle_limit=3,
    equipment=frozenset({"camera"}),
)
B = Agent(id="b", type="lifter", position=at(0, 30))
T1 = Task(id="t1", type="look", position=at(10), reward=50.0, duration=4.0, equipment=frozenset({"camera"}))
T2 = Task(id="t2", type="look", position=at(22), reward=30.0, start=20.0, end=60.0)
T3 = Task(id="t3", type="lift", position=at(3, 34), reward=9.0)
T4 = Task(id="t4", type="lift", position=at(900), end=10.0)
PATHS = {"a": [("t1", 6.0), ("t2", 20.0)], "b": [("t3", 5.0)]}


def mission_with(**changes: object) -> Mission:
    """The mission above; ``a=dict(range=3)`` changes a field of agent a, ``name=...`` one of its own."""
    items = {"a": A, "b": B, "t1": T1, "t2": T2, "t3": T3, "t4": T4}
    for name in list(items):
        if name in changes:
            items[name] = dataclasses.replace(items[name], **changes.pop(name))
    compatible = {"scout": frozenset({"look"}), "lifter": frozenset({"look", "lift"})}
    fields = {"name": "yard", "compatible": compatible} | changes
    return Mission(
        agents=(items["a"], items["b"]),
        tasks=tuple(items[name] for name in ("t1", "t2", "t3", "t4")),
        **fields,
    )


def plan_of(paths: dict[str, list[tuple[str, float]]] | None = None, **changes: object) -> Plan:
    return make_plan(mission_with(**changes), paths or PATHS, SCORE, "hand", "hold")


def edit(agent: str | None = None, visit: int | None = None, **changes: object) -> Plan:
    """The good plan with some declared fields replaced, in one visit, one agent or the plan itself."""
    plan = plan_of()
    if agent is None:
        return dataclasses.replace(plan, **changes)
    agents = []
    for one in plan.agents:
        if one.agent == agent and visit is None:
            one = dataclasses.replace(one, **changes)
        elif one.agent == agent:
            visits = list(one.visits)
            visits[visit] = dataclasses.replace(visits[visit], **changes)
            one = dataclasses.replace(one, visits=tuple(visits))
        agents.append(one)
    return dataclasses.replace(plan, agents=tuple(agents))


def with_extra(agent: AgentPlan | None = None, unserved: Unserved | None = None) -> Plan:
    plan = plan_of()
    if agent is not None:
        plan = dataclasses.replace(plan, agents=(*plan.agents, agent))
    if unserved is not None:
        plan = dataclasses.replace(plan, unserved=(*plan.unserved, unserved))
    return plan


def mutual() -> Case:
    """t1 wants two agents; b flies to it from t3 (3, 34) as well, but starts 40 s later than a."""
    mission = mission_with(t1={"agents_required": 2})
    paths = PATHS | {"b": [("t3", 5.0), ("t1", 46.0)]}
    return mission, make_plan(mission, paths, SCORE, "hand", "hold")


def open_seats(needs: set[str], of_b: set[str]) -> Case:
    """t1 takes as many as bring what it needs: a with its camera, and b, both from 44 s on."""
    mission = mission_with(
        t1={"agents_required": 0, "equipment": frozenset(needs)},
        a={"endurance": 100.0},
        b={"equipment": frozenset(of_b)},
    )
    paths = {"a": [("t2", 20.0), ("t1", 44.0)], "b": [("t3", 5.0), ("t1", 44.0)]}
    return mission, make_plan(mission, paths, SCORE, "hand", "hold")


def at_once(
    orders: dict[str, list[str]], needs: dict[str, tuple[str, ...]] | None = None, seats: int = 1
) -> Case:
    """All at one place and at 0 s, nothing takes time: no clock shows who waits for whom."""
    ids = sorted({task_id for order in orders.values() for task_id in order})
    tasks = tuple(
        Task(id=one, position=at(0), agents_required=seats, prerequisites=(needs or {}).get(one, ()))
        for one in ids
    )
    mission = Mission(agents=tuple(Agent(id=name, position=at(0)) for name in orders), tasks=tasks)
    paths = {name: [(task_id, 0.0) for task_id in order] for name, order in orders.items()}
    return mission, make_plan(mission, paths, SCORE, "hand", "hold")


# rule -> a mission and a plan that breaks this rule and no other; the good mission if only a plan is given.
CASES: dict[str, list[Callable[[], Case | Plan]]] = {
    "mission": [lambda: (mission_with(name="garden"), plan_of())],
    "score_name": [lambda: edit(score_name="revisit")],
    "finite": [
        lambda: edit(honest_score=math.nan),
        lambda: edit("a", finish=math.inf),
        lambda: edit("a", 1, end=math.nan),
        lambda: edit("b", score=math.nan),
    ],
    "unknown_agent": [lambda: with_extra(AgentPlan("ghost", (), 0.0, 0.0, 0.0))],
    "unknown_task": [
        lambda: with_extra(unserved=Unserved("ghost", "other", "")),
        lambda: _ghost_visit(),
    ],
    "agent_twice": [lambda: with_extra(AgentPlan("b", (), 0.0, 0.0, 0.0))],
    # t2 again: 0 m on, at 20 s, and the bundle limit of 3 is kept.
    "task_twice": [lambda: plan_of(PATHS | {"a": [("t1", 6.0), ("t2", 20.0), ("t2", 20.0)]})],
    # b from (3, 34) to (22, 0): 38.95 m, there at 43.95 s.
    "seats_overfilled": [lambda: plan_of(PATHS | {"b": [("t3", 5.0), ("t2", 44.0)]})],
    "seats_underfilled": [lambda: (mission_with(t2={"agents_required": 2}), plan_of())],
    "together": [mutual],
    "type": [lambda: (mission_with(compatible={"scout": frozenset({"lift"})}), plan_of())],
    "equipment": [
        lambda: (mission_with(t2={"equipment": frozenset({"winch"})}), plan_of()),
        lambda: (mission_with(a={"equipment": frozenset()}), plan_of()),
    ],
    # Nothing needed; the camera that a brings as well; b needed beside a, but not a beside b.
    "contribution": [
        lambda: open_seats({"camera"}, of_b=set()),
        lambda: open_seats({"camera"}, of_b={"camera"}),
        lambda: open_seats({"camera", "winch"}, of_b={"camera", "winch"}),
    ],
    # 10 m at 2 m/s take 5 s: fast enough from 0 s, but a leaves at 1 s.
    "available_at": [lambda: edit("a", 0, arrival=5.0), lambda: edit("a", 0, arrival=5.999)],
    # 4.9 s for 10 m is too fast whenever it left; t2 needs until 10 + 6 = 16 s.
    "speed": [lambda: edit("a", 0, arrival=4.9), lambda: edit("a", 1, arrival=15.9)],
    # At t1 from 6 s, served from 5.5 s.
    "early_start": [lambda: plan_of({"a": [("t1", 5.5), ("t2", 20.0)], "b": PATHS["b"]})],
    "window": [
        lambda: (mission_with(t2={"end": 20.0 - 1e-6, "start": 0.0}), plan_of(t2={"start": 0.0})),
        lambda: (mission_with(t2={"start": 20.0 + 1e-6}), plan_of()),
    ],
    "duration": [lambda: edit("a", 0, end=9.0), lambda: edit("a", 1, end=20.001)],
    "leg": [lambda: edit("a", 1, leg=22.0)],
    "distance": [lambda: edit("a", distance=22.0), lambda: edit("b", distance=5.001)],
    "finish": [lambda: edit("a", finish=20.0), lambda: edit("b", finish=5.001)],
    "range": [lambda: (mission_with(a={"range": 44.0 - 1e-6}), plan_of())],
    "endurance": [lambda: (mission_with(a={"endurance": 30.0 - 1e-6}), plan_of())],
    "bundle_limit": [lambda: (mission_with(a={"bundle_limit": 1}), plan_of())],
    "prerequisites": [
        lambda: (mission_with(t2={"prerequisites": ("t4",)}), plan_of()),
        # t1 is done at 10 s, t3 starts at 5 s.
        lambda: (mission_with(t3={"prerequisites": ("t1",)}), plan_of()),
    ],
    "circular_wait": [
        # Two groups in opposite orders; one agent's order against a prerequisite; two agents' against two.
        lambda: at_once({"a": ["s", "t"], "b": ["t", "s"]}, seats=2),
        lambda: at_once({"a": ["s", "t"]}, {"s": ("t",)}),
        lambda: at_once({"a": ["s", "t"], "b": ["u", "v"]}, {"s": ("v",), "u": ("t",)}),
    ],
    "visit_score": [lambda: edit("a", 0, score=49.001)],
    "agent_score": [lambda: edit("a", score=77.801)],
    "total_score": [lambda: edit(total_score=0.0)],
    "honest_score": [lambda: edit(honest_score=0.0)],
    "unaccounted": [lambda: edit(unserved=())],
    "contradiction": [lambda: with_extra(unserved=Unserved("t2", "other", ""))],
    "unserved_twice": [lambda: with_extra(unserved=Unserved("t4", "other", ""))],
}


def _ghost_visit() -> Plan:
    """b visits a task that does not exist, on the way to t3, and is paid nothing for it."""
    plan = plan_of()
    ghost = dataclasses.replace(plan.agents[1].visits[0], task="t9", score=0.0)
    b = dataclasses.replace(plan.agents[1], visits=(ghost, *plan.agents[1].visits))
    return dataclasses.replace(plan, agents=(plan.agents[0], b))


def test_the_good_plan_stands_at_the_very_limits():
    """Range 44 m and endurance 30 s are used up to the last bit."""
    assert verify(mission_with(), plan_of(), SCORE) == []


def test_every_rule_has_a_case():
    assert list(CASES) and set(CASES) == set(RULES)


@pytest.mark.parametrize(
    ("rule", "number"), [(rule, number) for rule, cases in CASES.items() for number in range(len(cases))]
)
def test_a_broken_rule_is_found_and_no_other(rule, number):
    case = CASES[rule][number]()
    mission, plan = (mission_with(), case) if isinstance(case, Plan) else case
    assert {violation.rule for violation in verify(mission, plan, SCORE)} == {rule}


def test_a_prerequisite_just_finished_is_finished():
    """t1 ends at 10 s, t2 starts at 20 s."""
    mission = mission_with(t2={"prerequisites": ("t1",)})
    assert verify(mission, plan_of(), SCORE) == []


def test_a_group_at_one_time_with_its_equipment_together_stands():
    """Two agents on t1 from 44 s on: a brings the camera, b the winch, both wait for the later one."""
    changes = {
        "t1": {"agents_required": 2, "equipment": frozenset({"camera", "winch"})},
        "b": {"equipment": frozenset({"winch"})},
        "a": {"endurance": 100.0},
    }
    mission = mission_with(**changes)
    paths = {"a": [("t2", 20.0), ("t1", 44.0)], "b": [("t3", 5.0), ("t1", 44.0)]}
    assert verify(mission, make_plan(mission, paths, SCORE, "hand", "hold"), SCORE) == []
    mission = mission_with(**(changes | {"b": {}}))
    (found,) = verify(mission, make_plan(mission, paths, SCORE, "hand", "hold"), SCORE)
    assert (found.rule, found.detail) == ("equipment", "a, b do not carry winch")


def test_seats_left_to_the_equipment_take_who_brings_a_part():
    """a has the camera, b the winch; with a alone the winch is missing, whatever the number of seats."""
    assert verify(*open_seats({"camera", "winch"}, of_b={"winch"}), SCORE) == []
    mission, _ = open_seats({"camera", "winch"}, of_b={"winch"})
    plan = make_plan(mission, PATHS, SCORE, "hand", "hold")
    (found,) = verify(mission, plan, SCORE)
    assert (found.task, found.rule, found.detail) == ("t1", "equipment", "a does not carry winch")


def test_who_brings_nothing_of_its_own_is_named():
    (found,) = verify(*open_seats({"camera"}, of_b=set()), SCORE)
    assert found == Violation("b", "t1", "contribution", "brings nothing needed")
    found = verify(*open_seats({"camera"}, of_b={"camera"}), SCORE)
    assert [(one.agent, one.detail) for one in found] == [
        ("a", "brings camera, as others do"),
        ("b", "brings camera, as others do"),
    ]


def test_seats_left_to_the_equipment_start_together():
    mission, _ = open_seats({"camera", "winch"}, of_b={"winch"})
    late = make_plan(mission, {"a": [("t1", 6.0)], "b": [("t3", 5.0), ("t1", 44.0)]}, SCORE, "hand", "hold")
    assert [one.rule for one in verify(mission, late, SCORE)] == ["together"]


def test_the_circle_is_named():
    (found,) = verify(*at_once({"a": ["s", "t"], "b": ["t", "s"]}, seats=2), SCORE)
    assert found.detail == "s waits for t (b does that first), t waits for s (a does that first)"
    (found,) = verify(*at_once({"a": ["s", "t"]}, {"s": ("t",)}), SCORE)
    assert found.detail == "s waits for t (its prerequisite), t waits for s (a does that first)"


def test_orders_that_agree_are_no_circle():
    """The same order for both; and agents in conflict over single seats do not wait for each other."""
    assert verify(*at_once({"a": ["s", "t"], "b": ["s", "t"]}, seats=2), SCORE) == []
    assert verify(*at_once({"a": ["s", "t"], "b": ["u"]}, {"t": ("u", "s")}), SCORE) == []
    found = verify(*at_once({"a": ["s", "t"], "b": ["t", "s"]}), SCORE)
    assert [one.rule for one in found] == ["seats_overfilled", "seats_overfilled"]


def test_a_long_line_of_waiting_is_no_circle():
    """20,000 visits after each other must not meet a limit of recursion."""
    order = [f"t{row:05d}" for row in range(20_000)]
    assert verify(*at_once({"a": order}), SCORE) == []


def test_a_score_that_pays_for_a_conflict_is_seen():
    """Two agents on one seat, each declaring the full reward: the seat is what is wrong."""
    plan = plan_of(PATHS | {"b": [("t3", 5.0), ("t2", 44.0)]})
    (found,) = verify(mission_with(), plan, SCORE)
    assert found == Violation(None, "t2", "seats_overfilled", "has 2 of 1 agents: a, b")
    assert str(found) == "task t2: seats_overfilled: has 2 of 1 agents: a, b"


def test_nan_in_a_start_is_found_whatever_it_hides():
    plan = edit("a", 0, start=math.nan)
    assert ("a", "t1", "finite") in {(v.agent, v.task, v.rule) for v in verify(mission_with(), plan, SCORE)}


def test_a_start_that_overflows_the_score_is_a_violation_not_a_crash():
    """exp(0.02 * 1e9) is too large for a float."""
    mission = mission_with(t1={"discount": 0.02})
    rules = {violation.rule for violation in verify(mission, edit("a", 0, start=-1e9), SCORE)}
    assert {"window", "early_start", "visit_score"} <= rules


def test_a_score_of_ones_own_that_gives_no_number_is_found():
    score = Custom(lambda visit: math.nan)
    plan = make_plan(mission_with(), PATHS, score, "hand", "hold")
    rules = {violation.rule for violation in verify(mission_with(), plan, score)}
    assert {"finite", "visit_score"} <= rules


def test_the_honest_score_is_recomputed_by_the_honest_score():
    """Bid with fuel from the start: 22 m to t2 declared, 12 m flown; 1.0 apart, and both are checked."""
    score = make_score("time_discounted", fuel="start")
    plan = make_plan(mission_with(), PATHS, score, "hand", "hold")
    assert plan.honest_score - plan.total_score == pytest.approx(1.0)
    assert verify(mission_with(), plan, score) == []
    swapped = dataclasses.replace(plan, honest_score=plan.total_score)
    assert [violation.rule for violation in verify(mission_with(), swapped, score)] == ["honest_score"]


def greedy_paths(mission: Mission) -> dict[str, list[tuple[str, float]]]:
    """Hand out tasks in order, each to the first agent that can append it within all its limits."""
    paths: dict[str, list[tuple[str, float]]] = {agent.id: [] for agent in mission.agents}
    state = {agent.id: (agent.position, agent.available_at, 0.0) for agent in mission.agents}
    for task in mission.tasks:
        for agent in mission.agents:
            place, free, metres = state[agent.id]
            leg = mission.distance(place, task.position)
            start = max(free + leg / agent.speed, task.start)
            back = mission.distance(task.position, agent.base) if agent.base else 0.0
            done = start + task.duration
            if (
                start <= task.end
                and metres + leg + back <= agent.range
                and done + back / agent.speed <= agent.available_at + agent.endurance
                and len(paths[agent.id]) < (agent.bundle_limit or math.inf)
            ):
                paths[agent.id].append((task.id, start))
                state[agent.id] = (task.position, done, metres + leg)
                break
    return paths


@given(
    st.integers(0, 10_000), st.sampled_from(["time_window", "time_discounted", "distance_cost", "revisit"])
)
def test_a_correct_plan_has_no_violation(seed, name):
    mission = random_mission(seed, ranges=True, ties=seed % 2 == 0)
    score = make_score(name)
    plan = make_plan(mission, greedy_paths(mission), score, "hand", "append")
    assert verify(mission, plan, score) == []
    assert verify(mission, Plan.from_dict(plan.to_dict()), score) == []


@given(st.integers(0, 10_000), st.data())
def test_any_declared_number_that_is_off_is_found(seed, data):
    """One number of a correct plan, off by a millionth of itself and a thousandth."""
    mission = random_mission(seed, ranges=True, tasks=(3, 10))
    plan = make_plan(mission, greedy_paths(mission), SCORE, "hand", "append")
    tree = plan.to_dict()
    owners = [tree, *tree["agents"], *(visit for one in tree["agents"] for visit in one["visits"])]
    places = [(owner, name) for owner in owners for name, value in owner.items() if isinstance(value, float)]
    owner, name = data.draw(st.sampled_from(places))
    sign = data.draw(st.sampled_from([-1.0, 1.0]))
    # A later arrival is only a slower flight, allowed while service still starts after it.
    if name == "arrival":
        sign = -1.0
    owner[name] += sign * (1e-3 + 1e-6 * abs(owner[name]))
    assert verify(mission, Plan.from_dict(tree), SCORE) != []
