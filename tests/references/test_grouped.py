"""A group as one agent: what it can do, and that its plan is one for its members."""

from __future__ import annotations

import dataclasses
import math
import random

import pytest

from generators import random_mission
from swarmbid.errors import InputError
from swarmbid.model import Agent, Mission, Task
from swarmbid.plan import make_plan
from swarmbid.references.coalition_optimum import coalition_optimum
from swarmbid.references.grouped import grouped
from swarmbid.references.sequential_greedy import sequential_greedy
from swarmbid.scores import make_score
from swarmbid.simulator import simulate
from swarmbid.verify import verify

REWARD = make_score("time_window")
A, B = frozenset({"A"}), frozenset({"B"})


def at(x: float, y: float = 0.0) -> tuple[float, float, float]:
    return (x, y, 0.0)


def test_a_group_is_as_slow_as_its_slowest_and_as_late_as_its_last():
    """b (free at 3 s) needs 8 / 2 = 4 s to a's place: met at 7 s; a to b's: 8 / 1 = 8 s. So they meet at a's.

    Fuel is paid by both: 0.1 + 0.2. Range: a 50 m, b 40 - 8 = 32 m. Endurance: a until 30 s, b until 53 s.
    """
    mission = Mission(
        agents=(
            Agent(id="a", position=at(0), range=50.0, endurance=30.0, fuel_per_metre=0.1),
            Agent(
                id="b", position=at(8), speed=2.0, available_at=3.0, range=40.0, endurance=50.0,
                fuel_per_metre=0.2, bundle_limit=4,
            ),
        ),
        tasks=(Task(id="t", position=at(1), reward=10.0, agents_required=2),),
    )  # fmt: skip
    (one,) = grouped(mission, 2).mission.agents
    assert (one.position, one.speed, one.available_at) == (at(0), 1.0, 7.0)
    assert (one.range, one.endurance, one.bundle_limit) == (32.0, 23.0, 4)
    assert one.fuel_per_metre == pytest.approx(0.3)
    (task,) = grouped(mission, 2).mission.tasks
    assert (task.reward, task.agents_required) == (20.0, 1)


def test_a_base_of_ones_own_is_farther():
    """The group's base is a's; b has 6 m from there to its own: 6 m less range, 3 s less time."""
    a = Agent(id="a", position=at(0), base=at(0), range=50.0, endurance=50.0)
    b = Agent(id="b", position=at(0), base=at(6), range=50.0, endurance=50.0, speed=2.0)
    (one,) = grouped(Mission(agents=(a, b), tasks=()), 2).mission.agents
    assert (one.base, one.range, one.endurance) == (at(0), 44.0, 47.0)
    b = dataclasses.replace(b, range=5.0)
    (one,) = grouped(Mission(agents=(a, b), tasks=()), 2).mission.agents
    assert 0.0 < one.range < 1e-6  # it can go nowhere


def test_agents_are_grouped_by_what_they_add_then_by_nearness():
    """a takes c, who adds B, though b is nearer; of b, d, e (A, A, B), b takes e, and d is left over."""
    kits = {"a": A, "b": A, "c": B, "d": A, "e": B}
    agents = tuple(Agent(id=name, position=at(row), equipment=kits[name]) for row, name in enumerate("abcde"))
    mission = Mission(agents=agents, tasks=(Task(id="group1", position=at(0)),))
    assert grouped(mission, 2).members == {"_group1": ("a", "c"), "group2": ("b", "e"), "d": ("d",)}
    plain = Mission(
        agents=tuple(Agent(id=one, position=at(x)) for one, x in zip("abcd", (0, 9, 5, 7), strict=True)),
        tasks=(),
    )
    assert grouped(plain, 2).members == {"group1": ("a", "c"), "group2": ("b", "d")}
    assert grouped(plain, 3).members == {"group1": ("a", "c", "d"), "b": ("b",)}
    assert grouped(plain, 1).members == {name: (name,) for name in "abcd"}
    assert grouped(plain, 2, groups=[("d", "a")]).members == {"group1": ("d", "a"), "b": ("b",), "c": ("c",)}


def test_a_group_does_what_some_of_it_are_enough_for():
    """Two seats of three members, one seat, open seats; not four seats, nor equipment that it has not."""
    team = tuple(
        Agent(id=name, position=at(0), equipment=kit, type=kind)
        for name, kit, kind in (("a", A, "x"), ("b", A, "x"), ("c", B, "y"))
    )
    tasks = (
        Task(id="one", position=at(0), equipment=B),
        Task(id="two", position=at(0), agents_required=2, equipment=A | B),
        Task(id="open", position=at(0), agents_required=0, equipment=A | B),
        Task(id="x-only", position=at(0), agents_required=2, type="dig"),
        Task(id="four", position=at(0), agents_required=4),
        Task(id="lamp", position=at(0), agents_required=0, equipment=frozenset({"lamp"})),
        Task(id="three-x", position=at(0), agents_required=3, type="dig"),
    )
    mission = Mission(agents=team, tasks=tasks, compatible={"y": frozenset({"task"})})
    teams = grouped(mission, 3)
    crews = {task.id: teams.crew("group1", task.id) for task in tasks}
    assert crews == {
        "one": ("c",), "two": ("a", "c"), "open": ("a", "c"), "x-only": ("a", "b"),
        "four": (), "lamp": (), "three-x": (),
    }  # fmt: skip
    (one,) = teams.mission.agents
    assert {task.id for task in teams.mission.tasks if teams.mission.can_do(one, task)} == {
        name for name, crew in crews.items() if crew
    }


def test_members_go_straight_and_start_as_one():
    """They meet at a's place at 8 s and reach t, at 10 m, at 18 s; straight, b is there at 2, a at 10 s."""
    mission = Mission(
        agents=(Agent(id="a", position=at(0)), Agent(id="b", position=at(8))),
        tasks=(
            Task(id="t", position=at(10), agents_required=2, duration=1.0),
            Task(id="u", position=at(14)),
        ),
    )
    teams = grouped(mission, 2)
    assert teams.mission.agents[0].available_at == 8.0
    paths = {"group1": [("t", 18.0), ("u", 23.0)]}
    assert teams.expand(paths) == {"a": [("t", 10.0), ("u", 15.0)], "b": [("t", 10.0)]}


def test_waiting_for_a_revisit_is_kept():
    task = Task(id="t", position=at(5), agents_required=2, revisit_at=50.0)
    mission = Mission(agents=(Agent(id="a", position=at(0)), Agent(id="b", position=at(0))), tasks=(task,))
    assert grouped(mission, 2).expand({"group1": [("t", 50.0)]})["a"] == [("t", 50.0)]


@pytest.mark.parametrize("size", [2, 3])
def test_plans_of_groups_are_plans_of_members(size, effort):
    """Windows, ranges, bases, endurance, speeds: what CBBA agrees for groups, members can execute.

    And it is worth no more than the best that can be done, no less than the groups reckoned, but for the
    way on which they meet.
    """
    served = 0
    for seed in range(25 * effort):
        rng = random.Random(seed)
        plain = random_mission(seed, agents=(4, 5), tasks=(4, 5), ranges=seed % 2 == 0, reward_scale=10.0)
        tasks = tuple(
            dataclasses.replace(task, agents_required=rng.choice([1, 2, size])) for task in plain.tasks
        )
        mission = Mission(agents=plain.agents, tasks=tasks)
        teams = grouped(mission, size)
        run = simulate(teams.mission, algorithm="cbba", score=REWARD)
        assert run.paths == sequential_greedy(teams.mission, REWARD).paths
        plan = make_plan(mission, teams.expand(run.paths), REWARD, "grouped", "shift")
        assert verify(mission, plan, REWARD) == []
        served += sum(len(path) for path in run.paths.values())
        places = {one.id: one.position for one in teams.mission.agents}
        gathering = sum(
            agent.fuel_per_metre * mission.distance(agent.position, places[name])
            for name, group in teams.members.items()
            for agent in mission.agents
            if agent.id in group
        )
        assert plan.total_score >= run.plan.total_score - gathering - 1e-9
        if seed < 8:
            assert plan.total_score <= coalition_optimum(mission, REWARD).value + 1e-9
    assert served > 30 * effort


@pytest.mark.parametrize(
    ("size", "groups", "says"),
    [
        (0, None, "size: is 0"),
        (2, [("a", "z")], "names 'z', no agent"),
        (2, [("a", "b"), ("a",)], "names 'a', twice"),
    ],
)
def test_groups_that_cannot_be_are_refused(size, groups, says):
    mission = Mission(agents=(Agent(id="a", position=at(0)), Agent(id="b", position=at(0))), tasks=())
    with pytest.raises(InputError, match=says):
        grouped(mission, size, groups=groups)


def test_paths_of_another_mission_are_refused():
    tasks = (
        Task(id="s", position=at(0), agents_required=2, prerequisites=("t",)),
        Task(id="t", position=at(0), agents_required=2),
        Task(id="u", position=at(0), agents_required=3),
    )
    mission = Mission(agents=(Agent(id="a", position=at(0)), Agent(id="b", position=at(0))), tasks=tasks)
    teams = grouped(mission, 2)
    with pytest.raises(InputError, match="path of group1: u: cannot be done by it"):
        teams.expand({"group1": [("u", 0.0)]})
    with pytest.raises(InputError, match="in a circle"):
        teams.expand({"group1": [("s", 0.0), ("t", math.inf)]})
