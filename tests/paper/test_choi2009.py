"""Choi, Brunet, How 2009, and Johnson et al. 2012: what the papers say, on examples worked out by hand."""

from __future__ import annotations

import random

import pytest

from fleet import Fleet
from generators import graph_of, make_graph, random_mission
from naive import SCORES, Judge, sequential_greedy
from swarmbid.algorithms.cbaa import CBAA
from swarmbid.algorithms.cbba import CBBA
from swarmbid.model import Agent, Mission, Task
from swarmbid.scores import make_score


def line_of_three(**agent) -> Mission:
    """Tasks at 1, 2 and 3 km from agent a, which flies 10 m/s; 100 a task, fading by 0.01 per s."""
    return Mission(
        agents=(Agent(id="a", position=(0.0, 0.0, 0.0), speed=10.0, **agent),),
        tasks=tuple(
            Task(id=f"t{k}", position=(1000.0 * k, 0.0, 0.0), reward=100.0, discount=0.01) for k in (1, 2, 3)
        ),
    )


def test_a_bundle_is_in_order_of_taking_and_a_path_in_order_of_doing():
    """Section IV-A. Between a at 0 and far (30 m, worth 100) lies near (10 m, worth 50): far is taken first.

    At 1 m/s and 0.01 per s far earns 100 exp(-0.3) = 74.08 against 50 exp(-0.1) = 45.24. Then near goes
    in front of far, for it lies on the way and delays nothing.
    """
    mission = Mission(
        agents=(Agent(id="a", position=(0.0, 0.0, 0.0)),),
        tasks=(
            Task(id="far", position=(30.0, 0.0, 0.0), reward=100.0, discount=0.01),
            Task(id="near", position=(10.0, 0.0, 0.0), reward=50.0, discount=0.01),
        ),
    )
    agent = CBBA("a", mission)
    agent.tick(0.0)
    assert agent.bundle == ["far", "near"]
    assert agent.path == [("near", 10.0), ("far", 30.0)]
    assert agent.beliefs()["far"] == (("a", pytest.approx(74.0818, abs=1e-4)),)


def test_scores_follow_the_path_and_not_the_distance_from_the_start():
    """Served at 100, 200 and 300 s: 100 (0.367879 + 0.135335 + 0.049787) = 55.3002.

    A public port counts from the start and serves them backwards.
    """
    agent = CBBA("a", line_of_three())
    agent.tick(0.0)
    assert agent.path == [("t1", 100.0), ("t2", 200.0), ("t3", 300.0)]
    assert sum(bid for ((_, bid),) in agent.beliefs().values()) == pytest.approx(55.3002, abs=1e-4)


def test_the_bundle_limit_is_the_most_tasks_taken():
    agent = CBBA("a", line_of_three(bundle_limit=2))
    agent.tick(0.0)
    assert agent.bundle == ["t1", "t2"]


def test_a_bid_of_nothing_is_not_made():
    """Fuel of 0.1 per m costs 100 to t1, more than the 36.79 that it earns."""
    agent = CBBA("a", line_of_three(fuel_per_metre=0.1))
    agent.tick(0.0)
    assert agent.bundle == []


def test_equal_bids_go_to_the_highest_id():
    """Hunt 2014: "the agent with the highest ID gets priority"; as byte strings, so b9 is above b10."""
    mission = Mission(
        agents=tuple(Agent(id=i, position=(0.0, 0.0, 0.0)) for i in ("b10", "b9", "a")),
        tasks=(Task(id="t", position=(5.0, 0.0, 0.0), reward=1.0),),
    )
    for algorithm in (CBBA, CBAA):
        fleet = Fleet(mission, make_graph(["b10", "a", "b9"], "line"), algorithm)
        assert fleet.settle()
        assert fleet.bundles() == {"a": [], "b10": [], "b9": ["t"]}


def test_cbaa_gives_one_task_to_each():
    """Three agents on the spot of t1, three tasks: the highest id takes the best one, and so on down."""
    tasks = line_of_three().tasks
    mission = Mission(
        agents=tuple(Agent(id=i, position=(1000.0, 0.0, 0.0), speed=10.0) for i in "abc"), tasks=tasks
    )
    fleet = Fleet(mission, make_graph(["a", "b", "c"], "ring"), CBAA)
    assert fleet.settle()
    assert fleet.bundles() == {"a": ["t3"], "b": ["t2"], "c": ["t1"]}


def test_promised_times_with_fuel_from_the_start_have_diminishing_gains():
    """Eq. (10): what a task gains never grows as the bundle grows. 0 violations in every prefix."""
    prefixes = 0
    for seed in range(60):
        mission = random_mission(seed, ties=seed % 2 == 0)
        bundles, _ = sequential_greedy(mission, SCORES["time_discounted fuel=start"], "hold")
        for agent in mission.agents:
            judge = Judge(mission, agent, SCORES["time_discounted fuel=start"], "hold")
            path, before = [], {}
            for task_id in [*bundles[agent.id].tasks, None]:
                gains = {gain_id: gain for gain, gain_id, _ in judge.candidates(path, judge.tasks)}
                on_path = {visited for visited, _ in path}
                for other, gain in gains.items():
                    if other not in on_path and path:
                        prefixes += 1
                        assert gain <= before.get(other, float("-inf")) + 1e-12, (seed, agent.id, other)
                before = gains
                if task_id is not None:
                    best = judge.best_insertion(path, judge.tasks[task_id])
                    assert best is not None
                    path = best[2]
    assert prefixes > 300


def test_without_warping_scores_that_do_not_diminish_can_cycle_and_with_it_they_settle():
    """Johnson et al. 2012. Distance cost, grid, ring: some fleets never settle; warped, all do."""
    cycles = 0
    for seed in range(15):
        mission = random_mission(seed, ties=True, reward_scale=12.0)
        graph = graph_of(random.Random(seed), mission, "ring")
        options = {"score": make_score("distance_cost"), "insertion": "shift"}
        cycles += not Fleet(mission, graph, options={**options, "warp": False}).settle(120)
        assert Fleet(mission, graph, options=options).settle(120), seed
    assert cycles >= 3
