"""The score for a short makespan, by hand: what urgency is made of, and what the agents make of it."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from swarmbid.errors import InputError
from swarmbid.model import Agent, Mission, Task
from swarmbid.scores import make_score
from swarmbid.scores.early_finish import EarlyFinish, follow_ups
from swarmbid.simulator import simulate
from swarmbid.testing import check_score

HERE = (0.0, 0.0, 0.0)


def at(x: float, **fields: object) -> Task:
    """A task x m from here."""
    name = fields.pop("id", f"t{x:g}")
    return Task(id=str(name), position=(float(x), 0.0, 0.0), **fields)  # type: ignore[arg-type]


def value(score: EarlyFinish, mission: Mission, task: str, start: float, leg: float = 0.0) -> float:
    found = {one.id: one for one in mission.tasks}
    return score.value(mission, mission.agents[0], found[task], start, leg)


def test_without_urgency_a_reward_fades_from_when_the_first_agent_is_available():
    """10 exp(-(30 - 20) / 50) less 0.5 * 8 m; the second agent comes later and does not matter."""
    agents = (
        Agent(id="a", position=HERE, available_at=20.0, fuel_per_metre=0.5),
        Agent(id="b", position=HERE, available_at=40.0),
    )
    mission = Mission(agents=agents, tasks=(at(8, reward=10.0),))
    assert value(EarlyFinish(time_constant=50.0), mission, "t8", 30.0, 8.0) == pytest.approx(
        10.0 * math.exp(-0.2) - 4.0, rel=1e-12
    )


def test_the_way_home_counts_by_whoever_is_home_first():
    """From 60 m, a is home in 60 / 2 = 30 s, b with its base at 100 m in 40 s; from 0 m in 0 and 100 s.

    30 s against 0 s: t0 has 30 s of slack. Half a tail, half the slack.
    """
    mission = Mission(
        agents=(
            Agent(id="a", position=HERE, base=HERE, speed=2.0),
            Agent(id="b", position=HERE, base=(100.0, 0.0, 0.0)),
        ),
        tasks=(at(0), at(60)),
    )
    for tail, slack in ((1.0, 30.0), (0.5, 15.0), (0.0, 0.0)):
        score = EarlyFinish(time_constant=100.0, tail=tail)
        assert value(score, mission, "t60", 7.0) == pytest.approx(math.exp(-0.07), rel=1e-12)
        assert value(score, mission, "t0", 7.0) == pytest.approx(math.exp(-0.07 - slack / 100.0), rel=1e-12)


def test_the_longest_chain_that_waits_counts():
    """first -> short 3 -> last 4, first -> long 9: 9 s follow the first, 4 the short one."""
    tasks = (
        at(1, id="last", duration=4.0, prerequisites=("short",)),
        at(1, id="first", duration=100.0),
        at(1, id="short", duration=3.0, prerequisites=("first",)),
        at(1, id="long", duration=9.0, prerequisites=("first",)),
    )
    assert follow_ups(tasks) == {"first": 9.0, "short": 4.0, "long": 0.0, "last": 0.0}
    mission = Mission(agents=(Agent(id="a", position=HERE),), tasks=tasks)
    score = EarlyFinish(time_constant=10.0)
    assert value(score, mission, "first", 0.0) == 1.0
    assert value(score, mission, "short", 0.0) == pytest.approx(math.exp(-0.5), rel=1e-12)
    assert value(score, mission, "last", 0.0) == pytest.approx(math.exp(-0.9), rel=1e-12)


def test_a_chain_of_many_tasks_is_followed():
    """10,000 tasks of 1 s, each waiting for the one before, listed backwards."""
    tasks = [
        at(1, id=f"t{k:05d}", duration=1.0, prerequisites=(f"t{k - 1:05d}",) if k else ())
        for k in reversed(range(10_000))
    ]
    assert follow_ups(tuple(tasks))["t00000"] == 9999.0


def test_scarcity_counts_seats_and_who_carries_what():
    """Four agents, two with a saw, one with a rope, which may not do type "far".

    both: two of 4 seats, 1/2 for the saw, 1 for the rope: 2. saw: one seat of 4 and 1/2: 3/4. far: one of
    3 seats; nobody of those who may go has a rope, which adds nothing: 1/3. Scarcity 12 s: 24, 9 and 4 s.
    """
    kit = {"a": {"saw"}, "b": {"saw"}, "c": set(), "d": {"rope"}}
    mission = Mission(
        agents=tuple(
            Agent(id=name, position=HERE, equipment=frozenset(items), type="tied" if "rope" in items else "x")
            for name, items in kit.items()
        ),
        tasks=(
            at(0, id="both", agents_required=2, equipment=frozenset({"saw", "rope"})),
            at(0, id="saw", equipment=frozenset({"saw"})),
            at(0, id="far", type="far", equipment=frozenset({"rope"})),
            at(0, id="open", agents_required=0, equipment=frozenset({"rope"})),
        ),
        compatible={"tied": frozenset({"task"})},
    )
    score = EarlyFinish(time_constant=10.0, scarcity=12.0)
    for task, slack in (("both", 0.0), ("saw", 15.0), ("far", 20.0), ("open", 12.0)):
        assert value(score, mission, task, 0.0) == pytest.approx(math.exp(-slack / 10.0), rel=1e-12)


def test_tasks_that_nobody_may_do_and_missions_without_agents_have_a_value_too():
    mission = Mission(
        agents=(Agent(id="a", position=HERE, type="tied"),),
        tasks=(at(5),),
        compatible={"tied": frozenset({"other"})},
    )
    score = EarlyFinish(time_constant=10.0, scarcity=5.0)
    assert value(score, mission, "t5", 10.0) == pytest.approx(math.exp(-1.0), rel=1e-12)
    empty = Mission(agents=(), tasks=mission.tasks)
    assert score.value(empty, mission.agents[0], empty.tasks[0], 10.0, 0.0) == pytest.approx(math.exp(-1.0))


def test_a_reward_larger_by_e_is_worth_one_time_constant():
    mission = Mission(agents=(Agent(id="a", position=HERE),), tasks=(at(1), at(2, reward=math.e)))
    score = EarlyFinish(time_constant=25.0)
    assert value(score, mission, "t1", 10.0) == pytest.approx(value(score, mission, "t2", 35.0), rel=1e-12)


def test_appending_takes_what_can_start_first_whatever_the_time_constant():
    """From 0: t4 is nearer than t-5; from 4 on, t7 at 7 s, t-5 at 13 s. With its way home t-5 comes first."""
    tasks = tuple(at(x) for x in (4, -5, 7))
    agent = Agent(id="a", position=HERE)
    for constant in (5.0, 5000.0):
        score = make_score("early_finish", time_constant=constant, tail=1.0)
        run = simulate(Mission(agents=(agent,), tasks=tasks), score=score, insertion="append")
        assert run.paths == {"a": [("t4", 4.0), ("t7", 7.0), ("t-5", 19.0)]}
        # Home is at 10: from -5 it is 15 m, from 4 6 m, from 7 3 m. Starts less ways home: -10, -2, 4.
        homely = replace(agent, base=(10.0, 0.0, 0.0))
        run = simulate(Mission(agents=(homely,), tasks=tasks), score=score, insertion="append")
        assert run.paths == {"a": [("t-5", 5.0), ("t4", 14.0), ("t7", 17.0)]}


@pytest.mark.parametrize("field", ["time_constant", "tail", "scarcity"])
def test_a_parameter_that_is_no_number_is_refused(field: str):
    for bad in (math.nan, -1.0, "much"):
        with pytest.raises(InputError, match=f"score early_finish: {field}: is "):
            make_score("early_finish", **{field: bad})
    if field == "time_constant":
        with pytest.raises(InputError, match=r"Give a finite number, 0\.001 or more"):
            make_score("early_finish", time_constant=0.0)


def test_it_keeps_what_scores_promise():
    check_score(make_score("early_finish", time_constant=200.0, scarcity=50.0))
