"""Groups of one to five are read as published, and judged by the benchmark's own rules."""

from __future__ import annotations

import json
import math
from typing import Any

import pytest

from swarmbid.datasets import dcmrta
from swarmbid.errors import InputError
from swarmbid.experiments.dcmrta import earliest_completion
from swarmbid.plan import make_plan
from swarmbid.scores import make_score
from swarmbid.verify import verify

# Depot (0, 0), speed 2; task 1 at (3, 4) needs two robots, task 2 at (6, 8) one.
GOOD: dict[str, Any] = {
    "agents": 3,
    "speed": 2.0,
    "depot": [0, 0],
    "tasks": [
        {"x": 3, "y": 4, "agents": 2, "duration": 1.5},
        {"x": 6, "y": 8, "agents": 1, "duration": 4},
    ],
    "published": {"CTAS-D_300s": 13.0},
    "ctas_d_routes": [[0, 1, 2, 0], [0, 1, 0]],
}


def parse(data: object) -> dcmrta.Instance:
    return dcmrta.parse(json.dumps(data), name="x", where="x.json")


def changed(field: str, value: object) -> dict[str, Any]:
    """GOOD with one field, such as ``tasks.0.x``, set to another value."""
    data: Any = json.loads(json.dumps(GOOD))
    *path, last = field.split(".")
    place = data
    for step in path:
        place = place[int(step) if isinstance(place, list) else step]
    place[int(last) if isinstance(place, list) else last] = value
    return data


def test_the_25_even_instances_are_carried_with_their_figures():
    """The means over these 25, as the files of the test set have them."""
    names = dcmrta.instances()
    assert names == [f"env_{number}" for number in range(0, 50, 2)]
    found = [dcmrta.instance(name) for name in names]
    means = {
        method: sum(one.published[method] for one in found) / 25
        for method in ("CTAS-D_300s", "OR-Tools", "REINFORCE_IA", "REINFORCE_LF")
    }
    assert means == pytest.approx(
        {"CTAS-D_300s": 36.69625, "OR-Tools": 41.89952, "REINFORCE_IA": 34.62891, "REINFORCE_LF": 34.54057},
        abs=1e-5,
    )
    assert {(one.robots, one.speed, len(one.work)) for one in found} == {(20, 0.2, 50)}


def test_an_instance_is_read_as_its_file_has_it():
    """env_0: depot at (0.637, 0.270); task 1 at (0.671, 0.647) takes 4 robots for 4.83."""
    mission = dcmrta.load("env_0")
    assert [agent.id for agent in mission.agents] == [f"r{number:02d}" for number in range(1, 21)]
    assert [task.id for task in mission.tasks] == [f"t{number:02d}" for number in range(1, 51)]
    robot, task = mission.agents[0], mission.tasks[0]
    assert robot.position == robot.base == (0.6369616873214543, 0.2697867137638703, 0.0)
    assert robot.speed == 0.2 and math.isinf(robot.endurance) and robot.equipment == frozenset()
    assert task.position == (0.6706244146936303, 0.6471895115742501, 0.0)
    assert (task.agents_required, task.duration, task.reward) == (4, 4.830310403920351, 1.0)
    assert (task.equipment, task.prerequisites, task.end) == (frozenset(), (), math.inf)


@pytest.mark.parametrize("name", dcmrta.instances())
def test_the_published_routes_give_the_published_makespan(name: str):
    found = dcmrta.instance(name)
    assert found.routes is not None and len(found.routes) == 20
    judged = found.replay(found.routes)
    assert judged.problems == ()
    assert judged.makespan == pytest.approx(found.published["CTAS-D_300s"], abs=1e-9)
    assert len(judged.starts) == 50


def test_a_group_starts_with_its_last_robot():
    """Task 1 is 5 m away, 2.5 s. Robot 2 goes to task 2 first: 5 s there, 4 s of work, 2.5 s back: 11.5 s.

    Robot 1 waits. Both work 1.5 s and go home in 2.5 s: 15.5 s. Robot 3 stays.
    """
    judged = parse(GOOD).replay([[1], [2, 1], []])
    assert judged.starts == {2: 5.0, 1: 11.5}
    assert judged.makespan == 15.5
    assert judged.problems == ()


@pytest.mark.parametrize(
    ("routes", "problem"),
    [
        ([[1], [2], []], "task 1 has 1 robots and needs 2"),
        ([[1, 2], [2, 1], []], "robot 1 waits at task 1 for ever"),
        ([[1], [1], []], "nobody goes to task 2"),
        ([[1, 2], [1], [0]], "robot 3 goes to 0, which is no task"),
        ([[1, 2, 1], [1], []], "robot 1 goes to a task twice"),
        ([[1, 2], [1]], "there are 2 routes for 3 robots"),
    ],
)
def test_routes_against_the_rules_are_refused(routes: list[list[int]], problem: str):
    assert problem in parse(GOOD).replay(routes).problems


@pytest.mark.parametrize("name", ["env_0", "env_24"])
def test_judge_and_verifier_agree(name: str):
    """The routes of a greedy, timed by the judge, are a plan without fault; one stop less, both object."""
    found = dcmrta.instance(name)
    mission, score = found.mission, make_score("time_discounted")
    routes = earliest_completion(found)

    def planned(routes: list[list[int]], starts: dict[int, float]):
        paths = {
            agent.id: [(mission.tasks[task - 1].id, starts[task]) for task in route]
            for agent, route in zip(mission.agents, routes, strict=True)
        }
        return make_plan(mission, paths, score, "none", "append")

    judged = found.replay(routes)
    plan = planned(routes, judged.starts)
    assert judged.problems == ()
    assert verify(mission, plan, score) == []
    assert max(one.finish for one in plan.agents) == pytest.approx(judged.makespan, abs=1e-9)

    task, crew = next((task, crew) for task, crew in judged.crews.items() if len(crew) == 3)
    fewer = [
        [stop for stop in route if (robot, stop) != (crew[0], task)] for robot, route in enumerate(routes)
    ]
    assert f"task {task} has 2 robots and needs 3" in found.replay(fewer).problems
    rules = {violation.rule for violation in verify(mission, planned(fewer, judged.starts), score)}
    assert "seats_underfilled" in rules


def test_the_greedy_takes_what_ends_first():
    """Task 1 ends at 2.5 + 1.5 = 4, by robots 1 and 2; task 2 at 9, for robot 3 is there first, at 5."""
    assert earliest_completion(parse(GOOD)) == [[1], [1], [2]]


@pytest.mark.parametrize(
    ("field", "value", "message"),
    [
        ("agents", 0, "x.json: agents: is 0. Give 1 to 1000"),
        ("agents", 2.5, "x.json: agents: is a fraction. Give a whole number, 1 to 1000"),
        ("agents", None, "x.json: agents: is null. Give a whole number"),
        ("speed", 0, "x.json: speed: is 0. Give more than 0"),
        ("speed", math.inf, "x.json: speed: is inf. Give a number within"),
        ("depot", [0], "x.json: depot: has 1 entries. Give two numbers, x and y"),
        ("depot", {"x": 1}, "x.json: depot: is an object. Give a list of two numbers"),
        ("tasks", [], "x.json: tasks: has 0 entries. Give 1 to 1000"),
        ("tasks", "many", "x.json: tasks: is text. Give a list of tasks"),
        ("tasks.1", {"x": 1, "y": 2}, 'x.json: tasks[1]: is no task. Give {"x": ...'),
        ("tasks.1.agents", 4, "x.json: tasks[1].agents: is 4. Give 1 to 3"),
        ("tasks.1.duration", -1, "x.json: tasks[1].duration: is -1. Give 0 or more"),
        ("tasks.0.x", "here", "x.json: tasks[0].x: is text. Give a number"),
        ("published", [1], "x.json: published: is no object"),
        ("published.CTAS-D_300s", 0, "x.json: published.CTAS-D_300s: is 0. Give more than 0"),
        ("ctas_d_routes", [[0, 0]] * 4, "x.json: ctas_d_routes: has 4 entries. Give at most 3"),
        ("ctas_d_routes.0", [1, 2, 0], "x.json: ctas_d_routes[0]: does not start and end with 0"),
        ("ctas_d_routes.0", [0], "x.json: ctas_d_routes[0]: does not start and end with 0"),
        ("ctas_d_routes.0", [0, 3, 0], "x.json: ctas_d_routes[0][1]: is 3. Give 1 to 2"),
    ],
)
def test_a_bad_file_is_refused_with_field_and_mend(field: str, value: object, message: str):
    with pytest.raises(InputError) as caught:
        parse(changed(field, value))
    assert str(caught.value).startswith(message)
    assert len(caught.value.faults) == 1


@pytest.mark.parametrize("field", ["agents", "speed", "depot", "tasks"])
def test_a_missing_field_is_named(field: str):
    with pytest.raises(InputError) as caught:
        parse({name: value for name, value in GOOD.items() if name != field})
    assert str(caught.value) == f"x.json: {field}: is missing. Add it."


def test_what_a_file_may_leave_out():
    data = {name: value for name, value in GOOD.items() if name not in ("published", "ctas_d_routes")}
    found = parse(data)
    assert (dict(found.published), found.routes) == ({}, None)
    assert found.mission == parse(GOOD).mission
    assert parse(GOOD).routes == ((1, 2), (1,), ())


def test_a_file_of_ones_own_is_read(tmp_path):
    path = tmp_path / "mine.json"
    path.write_text(json.dumps(GOOD))
    assert (dcmrta.read(path).name, dcmrta.read(str(path)).mission.name) == ("mine", "mine")
    with pytest.raises(InputError, match="cannot be read: No such file"):
        dcmrta.read(tmp_path / "none.json")


def test_an_unknown_name_is_refused():
    with pytest.raises(InputError, match=r"there is no 'env_1'\. Did you mean 'env_1"):
        dcmrta.load("env_1")
    with pytest.raises(InputError, match=r"There are env_0 to env_48\."):
        dcmrta.load("?")
