"""The missions of Dymkou's slides."""

from __future__ import annotations

import math

import pytest

from swarmbid.errors import InputError
from swarmbid.scenarios import dymkou2019


def test_defaults_are_those_of_the_sample_code() -> None:
    mission = dymkou2019.make(seed=3)
    assert [agent.type for agent in mission.agents] == ["QUAD"] * 2 + ["CAR"] * 3
    assert [task.type for task in mission.tasks] == ["TRACK"] * 3 + ["RESCUE"] * 4
    for agent in mission.agents:
        assert (agent.speed, agent.fuel_per_metre, agent.bundle_limit) == (2.0, 1.0, 3)
    for task in mission.tasks:
        assert (task.reward, task.discount, task.duration) == (100.0, 0.1, 600.0)
        assert task.end == task.start + 600.0
        assert 0.0 <= task.start <= 1009.0


def test_only_the_matching_type_can_do_a_task() -> None:
    mission = dymkou2019.make(seed=0)
    able = {(a.type, t.type) for a in mission.agents for t in mission.tasks if mission.can_do(a, t)}
    assert able == {("QUAD", "TRACK"), ("CAR", "RESCUE")}


def test_depth_of_the_sample_is_height_here() -> None:
    heights = [task.position[2] for seed in range(30) for task in dymkou2019.make(seed).tasks]
    assert all(2.0 <= height <= 10.0 for height in heights)
    # 210 even draws over 8 m: the mean is 6 m, with a standard error of 8 / sqrt(12 * 210) = 0.16 m.
    assert sum(heights) / len(heights) == pytest.approx(6.0, abs=3 * 8.0 / math.sqrt(12 * len(heights)))


def test_positions_fill_the_arena() -> None:
    places = [agent.position for seed in range(40) for agent in dymkou2019.make(seed).agents]
    for axis in (0, 1):
        along = [place[axis] for place in places]
        assert -30.0 <= min(along) < -27.0
        assert 27.0 < max(along) <= 30.0


def test_self_assignment_has_one_type_no_windows_and_one_location_each() -> None:
    mission = dymkou2019.make(seed=0, agents=7, tasks=7, self_assignment=True)
    assert (len(mission.agents), len(mission.tasks)) == (7, 7)
    assert {agent.bundle_limit for agent in mission.agents} == {1}
    assert {(task.start, task.end, task.duration, task.discount) for task in mission.tasks} == {
        (0.0, math.inf, 0.0, 0.0)
    }
    assert all(mission.can_do(agent, task) for agent in mission.agents for task in mission.tasks)


def test_same_seed_same_mission_and_more_tasks_keep_the_first() -> None:
    assert dymkou2019.make(seed=5) == dymkou2019.make(seed=5)
    assert dymkou2019.make(seed=5) != dymkou2019.make(seed=6)
    few, many = dymkou2019.make(seed=5, tasks=4), dymkou2019.make(seed=5, tasks=9)
    assert [task.start for task in few.tasks] == [task.start for task in many.tasks[:4]]


def test_every_bad_option_is_told_at_once() -> None:
    with pytest.raises(InputError) as caught:
        dymkou2019.make(agents=0, speed=0.0, lowest=5.0, highest=1.0)
    assert {fault.field for fault in caught.value.faults} == {"agents", "speed", "highest"}
    with pytest.raises(InputError, match="agent"):
        dymkou2019.make(agnets=3)
