"""The optimum is the optimum: hand examples, and brute force written another way."""

from __future__ import annotations

import itertools
import math

import pytest

from generators import random_mission
from swarmbid.errors import InputError
from swarmbid.model import Agent, Mission, Task
from swarmbid.plan import make_plan
from swarmbid.references.optimum import optimum
from swarmbid.scores import Score, make_score
from swarmbid.verify import verify

METRES = make_score("distance_cost", second_cost=0.0)


def at(x: float, y: float = 0.0) -> tuple[float, float, float]:
    return (x, y, 0.0)


def brute_force(mission: Mission, score: Score) -> float:
    """Give every task to an agent or to nobody, order each agent's tasks in every way, keep the best."""

    def best_order(agent: Agent, tasks: list[Task]) -> float:
        if agent.bundle_limit is not None and len(tasks) > agent.bundle_limit:
            return -math.inf
        return max(fly(agent, order) for order in itertools.permutations(tasks))

    def fly(agent: Agent, order: tuple[Task, ...]) -> float:
        here, clock, metres, worth = agent.position, agent.available_at, 0.0, 0.0
        for task in order:
            leg = mission.distance(here, task.position)
            clock = max(clock + leg / agent.speed, task.start)
            if clock > task.end:
                return -math.inf
            worth += score.value(mission, agent, task, clock, leg)
            clock, here, metres = clock + task.duration, task.position, metres + leg
        if order and agent.base is not None:
            home = mission.distance(here, agent.base)
            metres, clock = metres + home, clock + home / agent.speed
        fits = metres <= agent.range and clock <= agent.available_at + agent.endurance
        return worth if fits else -math.inf

    best = 0.0
    for owners in itertools.product([None, *mission.agents], repeat=len(mission.tasks)):
        total = 0.0
        for agent in mission.agents:
            mine = [task for task, owner in zip(mission.tasks, owners, strict=True) if owner is agent]
            total += best_order(agent, mine)
        best = max(best, total)
    return best


@pytest.mark.parametrize("name", ["time_discounted", "time_window", "distance_cost"])
def test_equal_to_brute_force(name, effort):
    """Windows, ranges, bases, bundle limits, ties; 30 missions a score."""
    score = make_score(name)
    positive = 0
    for seed in range(30 * effort):
        mission = random_mission(
            seed, ties=seed % 2 == 0, agents=(1, 3), tasks=(1, 4), ranges=True, reward_scale=8.0
        )
        found = optimum(mission, score)
        assert found.proven
        assert found.value == pytest.approx(brute_force(mission, score), rel=1e-9, abs=1e-9)
        plan = make_plan(mission, found.paths, score, "optimum", "shift")
        assert verify(mission, plan, score) == []
        assert plan.total_score == pytest.approx(found.value, rel=1e-9)
        positive += found.value > 0.0
    assert positive >= 20 * effort


def test_greedy_is_beaten_where_it_should_be():
    """Agents at 0 and 10 m, tasks at 4 m and at -6 m, both of reward 10 less metres.

    t1 at 4 m: worth 10 - 4 = 6 to a, 10 - 6 = 4 to b. t2 at -6 m, reward 10: 4 to a, -6 to b.
    Bundle limit 1: greedy takes t1 with a for 6 and is done; the optimum is b t1, a t2: 4 + 4 = 8.
    """
    mission = Mission(
        agents=(
            Agent(id="a", position=at(0), bundle_limit=1),
            Agent(id="b", position=at(10), bundle_limit=1),
        ),
        tasks=(
            Task(id="t1", position=at(4), reward=10.0),
            Task(id="t2", position=at(-6), reward=10.0),
        ),
    )
    found = optimum(mission, METRES)
    assert found.value == 8.0
    assert found.paths == {"a": [("t2", 6.0)], "b": [("t1", 6.0)]}


def test_the_better_order_of_two_is_kept():
    """From 0: 1 m then 3 m is 3 m of way, the other order 3 + 2 = 5 m; rewards 10 each: 20 - 3 = 17."""
    mission = Mission(
        agents=(Agent(id="a", position=at(0)),),
        tasks=(Task(id="far", position=at(3), reward=10.0), Task(id="near", position=at(1), reward=10.0)),
    )
    found = optimum(mission, METRES)
    assert (found.value, found.paths) == (17.0, {"a": [("near", 1.0), ("far", 3.0)]})
    # (), far, near, far-near, near-far
    assert found.num_paths == 5


def test_a_worthless_stop_on_the_way_is_left_out():
    """near pays 1 but lies 5 m aside; far pays 20 at 3 m."""
    mission = Mission(
        agents=(Agent(id="a", position=at(0)),),
        tasks=(Task(id="far", position=at(3), reward=20.0), Task(id="near", position=at(0, 5), reward=1.0)),
    )
    assert optimum(mission, METRES).paths == {"a": [("far", 3.0)]}


def test_nothing_worth_doing_is_a_plan_too():
    mission = Mission(
        agents=(Agent(id="a", position=at(0)),), tasks=(Task(id="t", position=at(5), reward=1.0),)
    )
    found = optimum(mission, METRES)
    assert (found.paths, found.value, found.proven) == ({"a": []}, 0.0, True)
    assert optimum(Mission(agents=(), tasks=mission.tasks), METRES).value == 0.0


def test_types_and_equipment_are_respected():
    """Only b carries the winch; a may not do 'lift' at all."""
    mission = Mission(
        agents=(
            Agent(id="a", type="scout", position=at(0), equipment=frozenset({"winch"})),
            Agent(id="b", type="lifter", position=at(5), equipment=frozenset({"winch"})),
            Agent(id="c", type="lifter", position=at(0)),
        ),
        tasks=(Task(id="t", type="lift", position=at(0), reward=9.0, equipment=frozenset({"winch"})),),
        compatible={"scout": frozenset({"look"})},
    )
    assert optimum(mission, METRES).paths == {"a": [], "b": [("t", 5.0)], "c": []}


def test_waiting_for_a_revisit_is_tried_and_not_called_proven():
    """There at 5 s, wanted at 100 s: waiting earns the whole 8; other starts in between were not tried."""
    mission = Mission(
        agents=(Agent(id="a", position=at(0)),),
        tasks=(Task(id="t", position=at(5), reward=8.0, revisit_at=100.0, revisit_width=10.0),),
    )
    found = optimum(mission, make_score("revisit"))
    assert (found.paths, found.value, found.proven) == ({"a": [("t", 100.0)]}, 8.0, False)


def test_waiting_is_not_always_best():
    """r (revisit at 100 s, pays 8), t pays 50 and closes at 20 s: t first, then r at 100 s."""
    mission = Mission(
        agents=(Agent(id="a", position=at(0)),),
        tasks=(
            Task(id="r", position=at(5), reward=8.0, revisit_at=100.0, revisit_width=10.0),
            Task(id="t", position=at(10), reward=50.0, end=20.0),
        ),
    )
    assert optimum(mission, make_score("revisit")).paths == {"a": [("t", 10.0), ("r", 100.0)]}


def test_a_detour_may_be_shorter_when_distances_are_rounded_down():
    """Steps of 1 m: 0 to 2.8 m is 2 m, back over 1.9 m (0.9 -> 0, 1.9 -> 1) is 1 m. Range 3 m: both tasks."""
    mission = Mission(
        agents=(Agent(id="a", position=at(0), base=at(0), range=3.0),),
        tasks=(Task(id="far", position=at(2.8), reward=9.0), Task(id="mid", position=at(1.9), reward=9.0)),
        distance_step=1.0,
    )
    found = optimum(mission, make_score("time_window"))
    assert found.value == 18.0
    assert (
        verify(
            mission,
            make_plan(mission, found.paths, make_score("time_window"), "x", "shift"),
            make_score("time_window"),
        )
        == []
    )


@pytest.mark.parametrize(("end", "value"), [(5.0, 9.0), (4.999, 0.0)])
def test_just_in_time_is_in_time(end, value):
    """5 m at 1 m/s."""
    mission = Mission(
        agents=(Agent(id="a", position=at(0)),), tasks=(Task(id="t", position=at(5), reward=9.0, end=end),)
    )
    assert optimum(mission, make_score("time_window")).value == value


@pytest.mark.parametrize("limits", [{"range": 10.0}, {"endurance": 11.0}])
def test_limits_that_are_just_met_are_met(limits):
    """5 m there, 1 s of service, 5 m back, free at 3 s: 10 m and 11 s."""
    for slack, value in ((0.0, 9.0), (-0.001, 0.0)):
        less = {name: limit + slack for name, limit in limits.items()}
        mission = Mission(
            agents=(Agent(id="a", position=at(0), base=at(0), available_at=3.0, **less),),
            tasks=(Task(id="t", position=at(5), reward=9.0, duration=1.0),),
        )
        assert optimum(mission, make_score("time_window")).value == value


@pytest.mark.parametrize("gives_plan", [True, False])
def test_a_solver_that_stops_early_proves_nothing(monkeypatch, gives_plan):
    """With a plan in hand it is returned, without one nobody does anything; neither is called proven."""
    import scipy.optimize

    class Stopped:
        status = 1
        x = [1.0] if gives_plan else None

    monkeypatch.setattr(scipy.optimize, "milp", lambda **_: Stopped)
    mission = Mission(
        agents=(Agent(id="a", position=at(0)),), tasks=(Task(id="t", position=at(5), reward=9.0),)
    )
    found = optimum(mission, make_score("time_window"))
    assert (found.value, found.proven) == (9.0 if gives_plan else 0.0, False)


def test_too_large_a_mission_is_refused_with_the_count():
    """7 tasks, no limit: 1 + 7 + 42 + 210 + 840 + 2,520 + 5,040 + 5,040 = 13,700 orders."""
    mission = Mission(
        agents=(Agent(id="a", position=at(0)),),
        tasks=tuple(Task(id=f"t{k}", position=at(k)) for k in range(7)),
        name="big",
    )
    assert optimum(mission, make_score("time_window"), max_paths=13_700).num_paths == 13_700
    with pytest.raises(InputError) as caught:
        optimum(mission, make_score("time_window"), max_paths=13_699)
    assert "mission big: is too large for the exact optimum: more than 13,699 feasible paths, 13,700" in str(
        caught.value
    )


def test_an_enormous_mission_is_refused_at_once():
    """300 tasks without limits have more orders than a float can hold."""
    mission = Mission(
        agents=(Agent(id="a", position=at(0)),),
        tasks=tuple(Task(id=f"t{k}", position=at(k)) for k in range(300)),
    )
    with pytest.raises(InputError, match="over 1e308"):
        optimum(mission, make_score("time_window"), max_paths=10)


def test_coupled_tasks_are_refused_each_by_name():
    mission = Mission(
        agents=(Agent(id="a", position=at(0)),),
        tasks=(
            Task(id="t1", position=at(1), agents_required=2),
            Task(id="t2", position=at(2), prerequisites=("t1",)),
            Task(id="t3", position=at(3), agents_required=0, equipment=frozenset({"winch"})),
        ),
    )
    with pytest.raises(InputError) as caught:
        optimum(mission, METRES)
    assert [(fault.where, fault.field) for fault in caught.value.faults] == [
        ("task t1", "agents_required"),
        ("task t2", "prerequisites"),
        ("task t3", "agents_required"),
    ]
