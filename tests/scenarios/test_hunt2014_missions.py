"""The missions of the CBGA paper: what it states about them, and what our options do."""

from __future__ import annotations

import math
from collections import Counter

import pytest

from swarmbid.errors import InputError
from swarmbid.scenarios import hunt2014


def test_defaults_are_ten_agents_on_the_floor_of_the_room_and_twenty_tasks_in_it() -> None:
    mission = hunt2014.make(3)
    assert [agent.id for agent in mission.agents] == [f"a{row:02d}" for row in range(10)]
    assert [task.id for task in mission.tasks] == [f"t{row:02d}" for row in range(20)]
    assert mission.name == "hunt2014-seats-10x20-seed3"
    assert all(agent.position[2] == 0.0 and agent.speed == 2.0 for agent in mission.agents)
    assert all(agent.bundle_limit is None and agent.fuel_per_metre == 1.0 for agent in mission.agents)
    for item in (*mission.agents, *mission.tasks):
        east, north, up = item.position
        assert 0.0 <= east < 4.5 and 0.0 <= north < 7.5 and 0.0 <= up < 2.0
    assert len({task.position[2] for task in mission.tasks}) == 20
    assert {task.reward for task in mission.tasks} == {100.0}


def test_windows_open_within_the_horizon_and_last_as_long_as_the_service() -> None:
    tasks = hunt2014.make(1, tasks=400).tasks
    assert all(task.end - task.start == pytest.approx(task.duration) for task in tasks)
    starts = [task.start for task in tasks]
    assert 0.0 <= min(starts) < 5.0 < 95.0 < max(starts) < 100.0
    # Two durations of one half each: 200 of 400, and a standard deviation of sqrt(400)/2 = 10.
    count = Counter(task.duration for task in tasks)
    assert set(count) == {5.0, 15.0} and abs(count[5.0] - 200) <= 40


@pytest.mark.parametrize(
    ("family", "agents_required", "seats"),
    [
        ("seats", 1, {1: 20}),
        ("seats", 4, {4: 20}),
        ("mixed", 2, {1: 10, 2: 10}),
        ("mixed", 4, {1: 10, 4: 10}),
    ],
)
def test_seats_are_what_the_family_says(family: str, agents_required: int, seats: dict[int, int]) -> None:
    tasks = hunt2014.make(0, family=family, agents_required=agents_required).tasks
    assert Counter(task.agents_required for task in tasks) == seats


@pytest.mark.parametrize(
    ("family", "kinds"),
    [
        ("a_b", {"A": 10, "B": 10}),
        ("a_b_ab", {"A": 7, "B": 7, "AB": 6}),
        ("a_ab_abc", {"A": 8, "AB": 6, "ABC": 6}),
    ],
)
def test_kinds_of_tasks_have_their_shares_and_one_seat_for_each_piece(
    family: str, kinds: dict[str, int]
) -> None:
    """Fig. 8: halves; a third type is added; a split of 8-6-6 (the second split is ours)."""
    tasks = hunt2014.make(0, family=family).tasks
    assert Counter(task.type for task in tasks) == kinds
    assert all(task.agents_required == len(task.type) for task in tasks)
    assert all(task.equipment == set(task.type) for task in tasks)


def test_agents_are_split_evenly_with_the_surplus_to_a_then_b() -> None:
    def split(agents: int, family: str) -> dict[str, int]:
        return dict(Counter(agent.type for agent in hunt2014.make(0, agents=agents, family=family).agents))

    assert split(10, "a_ab_abc") == {"A": 4, "B": 3, "C": 3}
    assert split(11, "a_ab_abc") == {"A": 4, "B": 4, "C": 3}
    assert split(5, "a_b") == {"A": 3, "B": 2}
    for agent in hunt2014.make(0, family="a_ab_abc").agents:
        assert agent.equipment == {agent.type}


def test_half_of_the_tasks_follow_another_and_some_of_them_a_follow_up() -> None:
    """Fig. 11: B follows T, C follows B. 10 of 20 follow, of these 0.3 * 10 = 3 a follow-up."""
    tasks = {task.id: task for task in hunt2014.make(0, family="follow_up").tasks}
    assert Counter(task.type for task in tasks.values()) == {"T": 10, "B": 7, "C": 3}
    before = {"T": [], "B": ["T"], "C": ["B"]}
    for task in tasks.values():
        assert [tasks[need].type for need in task.prerequisites] == before[task.type]
    needed = [need for task in tasks.values() for need in task.prerequisites]
    assert len(set(needed)) == len(needed) == 10


def test_windows_of_follow_ups_may_close_too_early_or_be_left_out() -> None:
    """ "In some cases, this meant a task with requirements was set before that of the requirement.\""""
    impossible = 0
    for seed in range(20):
        tasks = {task.id: task for task in hunt2014.make(seed, family="follow_up").tasks}
        impossible += sum(
            task.end < tasks[need].start + tasks[need].duration
            for task in tasks.values()
            for need in task.prerequisites
        )
        for task in hunt2014.make(seed, family="follow_up_open").tasks:
            if task.prerequisites:
                assert task.start == 0.0 and math.isinf(task.end)
            else:
                assert (task.start, task.end) == (tasks[task.id].start, tasks[task.id].end)
    # Of 200 follow-ups, those that close before their prerequisite ends: a bit under one half.
    assert 40 < impossible < 120


def test_families_of_one_seed_share_places_durations_and_agents() -> None:
    def shared(family: str, **options: int) -> list[object]:
        mission = hunt2014.make(5, family=family, **options)
        places = [(task.position, task.duration) for task in mission.tasks]
        return [*places, *(agent.position for agent in mission.agents)]

    first = shared("seats", agents_required=1)
    assert all(shared(family) == first for family in hunt2014.FAMILIES)
    assert hunt2014.make(5) == hunt2014.make(5)
    assert hunt2014.make(5).tasks != hunt2014.make(6).tasks
    assert hunt2014.make(5, agents=4).agents == hunt2014.make(5).agents[:4]


@pytest.mark.parametrize("family", hunt2014.FAMILIES)
@pytest.mark.parametrize("tasks", [0, 1, 3, 7])
def test_few_tasks_are_a_mission_too(family: str, tasks: int) -> None:
    assert len(hunt2014.make(2, family=family, tasks=tasks, agents=1).tasks) == tasks


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"agents": 0}, "agents"),
        ({"agents_required": 0}, "agents_required"),
        ({"speed": 0.0}, "speed"),
        ({"reward": math.inf}, "reward"),
        ({"horizon": -1.0}, "horizon"),
        ({"family": "a_b_c"}, "a_b"),
        ({"famly": "seats"}, "family"),
    ],
)
def test_options_out_of_range_and_unknown_ones_are_named(options: dict[str, object], words: str) -> None:
    with pytest.raises(InputError, match=words):
        hunt2014.make(0, **options)
