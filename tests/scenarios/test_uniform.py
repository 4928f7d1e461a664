"""The uniform scenario: what its options do to a mission."""

from __future__ import annotations

import math
from dataclasses import fields

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmbid.errors import InputError
from swarmbid.network import Network, agent_positions, make_topology
from swarmbid.scenarios import uniform


def test_defaults_are_twenty_agents_and_a_hundred_tasks_in_a_square() -> None:
    mission = uniform.make(7)
    assert [agent.id for agent in mission.agents] == [f"a{row:03d}" for row in range(20)]
    assert [task.id for task in mission.tasks] == [f"t{row:04d}" for row in range(100)]
    assert mission.name == "uniform-20x100-seed7"
    for item in (*mission.agents, *mission.tasks):
        east, north, up = item.position
        assert 0.0 <= east < 1000.0
        assert 0.0 <= north < 1000.0
        assert up == 0.0
    assert all(10.0 <= task.reward < 100.0 for task in mission.tasks)
    assert all(task.start == 0.0 and math.isinf(task.end) for task in mission.tasks)
    assert all(agent.bundle_limit == 10 for agent in mission.agents)
    assert mission.compatible == {}


def test_positions_and_rewards_are_uniform() -> None:
    mission = uniform.make(1, tasks=4000)
    # A uniform number from a to b has mean (a + b) / 2 and spread (b - a) / sqrt(12).
    for values, low, high in (
        ([task.position[0] for task in mission.tasks], 0.0, 1000.0),
        ([task.position[1] for task in mission.tasks], 0.0, 1000.0),
        ([task.reward for task in mission.tasks], 10.0, 100.0),
    ):
        sigma = (high - low) / math.sqrt(12.0 * 4000)
        assert abs(np.mean(values) - (low + high) / 2.0) <= 4.0 * sigma


def test_ids_have_as_many_digits_as_the_last_one_needs() -> None:
    mission = uniform.make(0, agents=1001, tasks=10_001)
    assert (mission.agents[0].id, mission.agents[-1].id) == ("a0000", "a1000")
    assert (mission.tasks[7].id, mission.tasks[-1].id) == ("t00007", "t10000")
    mission = uniform.make(0, agents=1000, tasks=10_000)
    assert (mission.agents[-1].id, mission.tasks[-1].id) == ("a999", "t9999")


def test_same_seed_same_mission() -> None:
    assert uniform.make(7, types=3, window_max=50.0) == uniform.make(7, types=3, window_max=50.0)
    assert uniform.make(7).tasks != uniform.make(8).tasks


def test_an_option_changes_only_what_it_is_about() -> None:
    plain = uniform.make(7)
    more = uniform.make(7, tasks=150, window_max=50.0, horizon=100.0, duration_max=9.0, types=2)
    assert [task.position for task in more.tasks[:100]] == [task.position for task in plain.tasks]
    assert [task.reward for task in more.tasks[:100]] == [task.reward for task in plain.tasks]
    assert [agent.position for agent in more.agents] == [agent.position for agent in plain.agents]


def test_windows_and_durations_lie_in_their_bounds() -> None:
    mission = uniform.make(
        3, horizon=500.0, window_min=20.0, window_max=60.0, duration_min=5.0, duration_max=15.0
    )
    starts = [task.start for task in mission.tasks]
    assert 0.0 <= min(starts) < 50.0 < 450.0 < max(starts) <= 500.0
    assert all(20.0 - 1e-9 <= task.end - task.start <= 60.0 + 1e-9 for task in mission.tasks)
    assert all(5.0 <= task.duration <= 15.0 for task in mission.tasks)
    assert len({task.duration for task in mission.tasks}) == 100


def test_attributes_are_independent_of_each_other() -> None:
    mission = uniform.make(
        3, agents=1000, tasks=1000, height=1.0, horizon=1.0, window_max=1.0, duration_max=1.0
    )
    columns = [
        [agent.position[0] for agent in mission.agents],
        [agent.position[1] for agent in mission.agents],
        *zip(*(task.position for task in mission.tasks), strict=True),
        [task.reward for task in mission.tasks],
        [task.duration for task in mission.tasks],
        [task.start for task in mission.tasks],
        [task.end - task.start for task in mission.tasks],
    ]
    # Correlations of 1,000 independent pairs spread by 1 / sqrt(1000).
    correlations = np.corrcoef(columns) - np.eye(len(columns))
    assert np.abs(correlations).max() <= 4.0 / math.sqrt(1000)


def test_grid_and_equal_rewards_give_ties() -> None:
    mission = uniform.make(3, grid=5, reward_min=10.0, reward_max=10.0)
    steps = {0.0, 250.0, 500.0, 750.0, 1000.0}
    places = {item.position[:2] for item in (*mission.agents, *mission.tasks)}
    assert {east for east, _ in places} == steps
    assert {north for _, north in places} == steps
    assert {task.reward for task in mission.tasks} == {10.0}
    # A hundred tasks on 25 places: some share one.
    assert len({task.position for task in mission.tasks}) <= 25


def test_a_grid_of_one_place_puts_everything_there() -> None:
    assert {task.position for task in uniform.make(3, grid=1).tasks} == {(0.0, 0.0, 0.0)}


def test_types_match_tasks_to_agents() -> None:
    mission = uniform.make(3, types=3, agents=7)
    assert [agent.type for agent in mission.agents] == [
        "type1", "type2", "type3", "type1", "type2", "type3", "type1",
    ]  # fmt: skip
    assert {task.type for task in mission.tasks} == {"type1", "type2", "type3"}
    for agent in mission.agents:
        for task in mission.tasks:
            assert mission.can_do(agent, task) == (agent.type == task.type)


def test_plain_options_reach_the_mission() -> None:
    mission = uniform.make(
        3,
        agents=2,
        tasks=50,
        width=50.0,
        height=30.0,
        speed=3.0,
        fuel_per_metre=0.2,
        bundle_limit=4,
        discount=0.5,
    )
    for agent in mission.agents:
        assert (agent.speed, agent.fuel_per_metre, agent.bundle_limit) == (3.0, 0.2, 4)
        assert max(agent.position) < 50.0
    heights = [task.position[2] for task in mission.tasks]
    assert 0.0 <= min(heights) < 5.0 < 25.0 < max(heights) < 30.0
    assert {task.discount for task in mission.tasks} == {0.5}


def test_no_tasks_make_an_empty_mission() -> None:
    assert uniform.make(3, tasks=0).tasks == ()


def test_mean_degree_places_agents_that_the_range_topology_connects() -> None:
    mission = uniform.make(5, agents=200, tasks=1, width=5000.0, mean_degree=8.0)
    topology = make_topology("range", 200, positions=agent_positions(mission), mean_degree=8.0)
    assert Network(topology).components() == [list(range(200))]
    assert np.mean([len(near) for near in topology.links()]) == pytest.approx(8.0, rel=0.02)


def test_communication_range_places_agents_that_it_connects() -> None:
    mission = uniform.make(5, agents=40, tasks=1, communication_range=120.0)
    topology = make_topology("range", 40, positions=agent_positions(mission), communication_range=120.0)
    assert Network(topology).components() == [list(range(40))]
    # Without the option this seed leaves somebody alone.
    scattered = agent_positions(uniform.make(5, agents=40, tasks=1))
    apart = make_topology("range", 40, positions=scattered, communication_range=120.0)
    assert len(Network(apart).components()) > 1


@given(
    seed=st.integers(0, 2**63),
    agents=st.integers(1, 12),
    tasks=st.integers(0, 12),
    grid=st.integers(0, 3),
    types=st.integers(1, 14),
    window_max=st.floats(0.0, 1e4),
    horizon=st.floats(0.0, 1e4),
)
def test_every_choice_of_options_makes_a_valid_mission(seed: int, agents: int, tasks: int, **options) -> None:
    mission = uniform.make(seed, agents=agents, tasks=tasks, **options)
    assert (len(mission.agents), len(mission.tasks)) == (agents, tasks)
    assert all(task.end >= task.start for task in mission.tasks)


def test_every_option_says_what_it_means() -> None:
    assert uniform.Options() == uniform.OPTIONS
    for option in fields(uniform.OPTIONS):
        assert option.metadata["help"]
        # The type of the default is the type of the option.
        assert type(getattr(uniform.OPTIONS, option.name)).__name__ == option.type


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"agents": 0}, "agents: is 0. Give 1 or more."),
        ({"tasks": -1}, "tasks: is -1. Give 0 or more."),
        ({"types": 0}, "types: is 0. Give 1 or more."),
        ({"width": 0.0}, "width: is 0.0. Give more than 0."),
        ({"speed": math.inf}, "speed: is inf. Give more than 0."),
        ({"discount": math.nan}, "discount: is nan. Give 0 or more."),
        (
            {"reward_min": 20.0, "reward_max": 10.0},
            "reward_max: is 10.0, with reward_min 20.0. Give no less.",
        ),
        (
            {"grid": 3, "mean_degree": 4.0},
            "mean_degree: comes with grid. Give one way of placing the agents.",
        ),
        ({"mean_degree": 20.0}, "mean_degree: is 20.0. Give 1.9 to 19"),
        ({"robots": 3}, "robots: is no option. Use some of agents, tasks, width"),
    ],
)
def test_impossible_options_are_refused_with_the_mend(options: dict, said: str) -> None:
    with pytest.raises(InputError) as caught:
        uniform.make(7, **options)
    assert said in str(caught.value)
