"""Skills, groups and sequences are read as published, and judged by the benchmark's own rules."""

from __future__ import annotations

import json
import math
from importlib import resources
from typing import Any

import pytest

from swarmbid.datasets import sadcher
from swarmbid.errors import InputError
from swarmbid.experiments.sadcher import earliest_completion
from swarmbid.plan import make_plan
from swarmbid.scores import make_score
from swarmbid.verify import verify

PUBLISHED = [f"1p_00000{number}" for number in range(6)]

# Start (0, 0), end (10, 0); task 1 at (3, 4) needs skill 0, task 2 at (6, 8) needs both and waits for task 1.
GOOD: dict[str, Any] = {
    "Q": [[1, 0], [0, 1]],
    "R": [[0, 0], [1, 0], [1, 1], [0, 0]],
    "T_e": [0, 2, 7, 0],
    "task_locations": [[0, 0], [3, 4], [6, 8], [10, 0]],
    "precedence_constraints": [[1, 2]],
    "optimal_makespan": 25.9,
    "schedule": {"0": [{"task": 1}, {"task": 2}], "1": [{"task": 2}]},
}


def raw(name: str) -> dict[str, Any]:
    """The file itself."""
    path = resources.files("swarmbid.datasets") / "data" / "sadcher" / f"{name}.json"
    return json.loads(path.read_text())


def parse(data: object) -> sadcher.Instance:
    return sadcher.parse(json.dumps(data), name="x", where="x.json")


def changed(field: str, value: object) -> dict[str, Any]:
    """GOOD with one field, such as ``R.1.0``, set to another value."""
    data: Any = json.loads(json.dumps(GOOD))
    *path, last = field.split(".")
    place = data
    for step in path:
        place = place[int(step) if isinstance(place, list) else step]
    place[int(last) if isinstance(place, list) else last] = value
    return data


def test_all_instances_are_carried_and_say_where_they_come_from():
    """6 published ones with a schedule, 20 + 10 made since without."""
    names = sadcher.instances()
    assert [sum(name.startswith(kind) for name in names) for kind in ("1p", "8t", "9t")] == [6, 20, 10]
    for name in names:
        found = sadcher.instance(name)
        published = name in PUBLISHED
        assert found.optimum is not None and found.optimum > 300.0
        assert (found.routes is not None) == published
        assert ("CSC445_project" in raw(name)["source"]) == published
        assert ("not part of the published set" in raw(name)["source"]) == (not published)


def test_an_instance_is_read_as_its_file_has_it():
    """1p_000000: robot 0 has skill 2; task 2 at (4, 70) takes 95 and needs skills 0 and 2; 7 precedes 3."""
    mission = sadcher.load("1p_000000")
    assert [(agent.id, agent.equipment) for agent in mission.agents] == [
        ("r1", {"s3"}),
        ("r2", {"s2"}),
        ("r3", {"s1"}),
    ]
    robot = mission.agents[0]
    assert (robot.position, robot.base, robot.speed) == ((34.0, 17.0, 0.0), (91.0, 26.0, 0.0), 1.0)
    assert math.isinf(robot.endurance) and math.isinf(robot.range)
    assert [task.id for task in mission.tasks] == [f"t{number}" for number in range(1, 9)]
    task = mission.tasks[1]
    assert (task.position, task.duration, task.equipment) == ((4.0, 70.0, 0.0), 95.0, {"s1", "s3"})
    assert (task.agents_required, task.reward, task.start, task.end) == (0, 1.0, 0.0, math.inf)
    assert [task.prerequisites for task in mission.tasks if task.prerequisites] == [("t7",)]
    assert mission.tasks[2].prerequisites == ("t7",)


@pytest.mark.parametrize("name", PUBLISHED)
def test_the_published_schedules_give_the_published_makespan_and_starts(name: str):
    """Both are printed with five decimals and more, summed from rounded travel times."""
    found = sadcher.instance(name)
    assert found.routes is not None
    judged = found.replay(found.routes)
    assert judged.problems == ()
    assert judged.makespan == pytest.approx(found.optimum, abs=1e-3)
    stops = [stop for stops in raw(name)["schedule"].values() for stop in stops]
    assert stops
    for stop in stops:
        assert judged.starts[stop["task"]] == pytest.approx(stop["start"], abs=1e-3)


def test_what_waits_for_whom_is_followed():
    """Robot 1 is at task 1 at 5, done at 7, at task 2 at 12; robot 2 is there at 10 and waits.

    Task 2 ends at 19, the way from (6, 8) to (10, 0) is sqrt(80) = 8.944.
    """
    judged = parse(GOOD).replay([[1, 2], [2]])
    assert judged.starts == {1: 5.0, 2: 12.0}
    assert judged.crews == {1: (0,), 2: (0, 1)}
    assert judged.makespan == pytest.approx(19.0 + math.sqrt(80.0), abs=1e-12)
    assert judged.problems == ()


@pytest.mark.parametrize(
    ("routes", "problem"),
    [
        ([[1], [2]], "task 2 lacks a skill"),
        ([[1, 2], []], "task 2 lacks a skill"),
        ([[1, 2], [1, 2]], "robot 2 brings nothing of its own to task 1"),
        ([[1], []], "nobody goes to task 2"),
        ([[2, 1], [2]], "robot 1 waits at task 2 for ever"),
        ([[1, 2, 3], [2]], "robot 1 goes to 3, which is no task"),
        ([[1, 2, 1], [2]], "robot 1 goes to a task twice"),
        ([[1, 2]], "there are 1 routes for 2 robots"),
    ],
)
def test_routes_against_the_rules_are_refused(routes: list[list[int]], problem: str):
    assert problem in parse(GOOD).replay(routes).problems


def test_a_robot_that_could_stay_away_is_named_even_when_another_is_needed():
    """Skills 0 and 1 are needed; robots have {0}, {1} and both: with the third the first two are too many."""
    data = changed("Q", [[1, 0], [0, 1], [1, 1]])
    del data["schedule"]
    found = parse(data)
    assert found.replay([[1, 2], [2], []]).problems == ()
    assert found.replay([[1], [], [2]]).problems == ()
    assert found.replay([[1, 2], [], [2]]).problems == ("robot 1 brings nothing of its own to task 2",)


@pytest.mark.parametrize("name", [*PUBLISHED[:2], "8t3r3s1p_014", "9t3r3s2p_012"])
def test_judge_and_verifier_agree(name: str):
    """The routes of a greedy, timed by the judge, are a plan without fault; one stop less, both object."""
    found = sadcher.instance(name)
    mission, score = found.mission, make_score("time_discounted")
    routes = earliest_completion(found)

    def planned(routes: list[list[int]], starts: dict[int, float]):
        paths = {
            agent.id: [(mission.tasks[task - 1].id, starts[task]) for task in route]
            for agent, route in zip(mission.agents, routes, strict=True)
        }
        return make_plan(mission, paths, score, "none", "shift")

    judged = found.replay(routes)
    plan = planned(routes, judged.starts)
    assert judged.problems == ()
    assert verify(mission, plan, score) == []
    assert max(one.finish for one in plan.agents) == pytest.approx(judged.makespan, abs=1e-9)

    task, crew = next((task, crew) for task, crew in judged.crews.items() if len(crew) > 1)
    fewer = [
        [stop for stop in route if (robot, stop) != (crew[0], task)] for robot, route in enumerate(routes)
    ]
    assert f"task {task} lacks a skill" in found.replay(fewer).problems
    rules = {violation.rule for violation in verify(mission, planned(fewer, judged.starts), score)}
    assert "equipment" in rules


def test_the_greedy_takes_what_ends_first():
    """Task 1 ends at 5 + 2 = 7, task 2 waits for it; both skills are needed there."""
    assert earliest_completion(parse(GOOD)) == [[1, 2], [2]]


@pytest.mark.parametrize(
    ("field", "value", "message"),
    [
        ("Q", 3, "x.json: Q: is a number. Give a list of rows"),
        ("Q", [], "x.json: Q: has 0 entries. Give 1 to 1000 robots"),
        ("Q.0", [1], "x.json: Q[0]: has 1 entries. Give every row of Q and R the same number of skills, 1"),
        ("Q.1", [0, 1, 1], "x.json: Q[1]: has 3 entries. Give every row of Q and R the same number"),
        ("Q.0.0", 2, "x.json: Q[0][0]: is 2. Give 0 to 1"),
        ("Q.0.0", True, "x.json: Q[0][0]: is true or false. Give a whole number, 0 to 1"),
        ("R.1.0", 0, "x.json: R[1]: needs none. The start and the end need no skill, every task needs one"),
        ("R.0.0", 1, "x.json: R[0]: needs a skill. The start and the end need no skill"),
        ("R", [[0, 0], [1, 0], [0, 0]], "x.json: R: has 3 entries. Give 4 rows, one a place"),
        ("T_e.1", -2, "x.json: T_e[1]: is -2. Give 0 or more"),
        ("T_e.1", "2", "x.json: T_e[1]: is text. Give a number"),
        ("T_e.1", math.nan, "x.json: T_e[1]: is nan. Give a number within"),
        ("T_e.1", 10**400, "x.json: T_e[1]: is 1000"),
        ("T_e", [0, 2, 0], "x.json: T_e: has 3 entries. Give 4 durations"),
        ("task_locations.1", [3], "x.json: task_locations[1]: has 1 entries. Give two numbers, x and y"),
        ("task_locations", [[0, 0], [1, 1]], "x.json: task_locations: has 2 entries. Give the start, 1 to"),
        ("precedence_constraints.0", [1, 3], "x.json: precedence_constraints[0][1]: is 3. Give 1 to 2"),
        ("precedence_constraints.0", 1, "x.json: precedence_constraints[0]: is a number. Give a list of two"),
        ("precedence_constraints", [[1, 2], [1, 2]], "x.json: precedence_constraints[1]: says again that 1"),
        (
            "precedence_constraints",
            [[1, 2], [2, 1]],
            "x.json: precedence_constraints: lets tasks wait for each other in a circle: ",
        ),
        ("optimal_makespan", 0, "x.json: optimal_makespan: is 0. Give more than 0"),
        ("schedule", [], "x.json: schedule: does not have each robot once"),
        ("schedule.1.0", {"task": 9}, "x.json: schedule.1[0].task: is 9. Give 1 to 2"),
    ],
)
def test_a_bad_file_is_refused_with_field_and_mend(field: str, value: object, message: str):
    with pytest.raises(InputError) as caught:
        parse(changed(field, value))
    assert str(caught.value).startswith(message)
    assert len(caught.value.faults) == 1


def test_a_task_that_waits_for_itself_is_refused():
    with pytest.raises(InputError, match="wait for each other in a circle: 2 -> 2"):
        parse(changed("precedence_constraints", [[2, 2]]))


@pytest.mark.parametrize("field", ["Q", "R", "T_e", "task_locations", "precedence_constraints"])
def test_a_missing_field_is_named(field: str):
    data = {name: value for name, value in GOOD.items() if name != field}
    with pytest.raises(InputError) as caught:
        parse(data)
    assert str(caught.value) == f"x.json: {field}: is missing. Add it."


def test_what_a_file_may_leave_out():
    data = {name: value for name, value in GOOD.items() if name not in ("optimal_makespan", "schedule")}
    found = parse(data)
    assert (found.optimum, found.routes) == (None, None)
    assert found.mission == parse(GOOD).mission


def test_every_fault_is_reported_at_once():
    data = changed("T_e.1", -2)
    data["Q"][0][0] = 5
    with pytest.raises(InputError) as caught:
        parse(data)
    assert [fault.field for fault in caught.value.faults] == ["Q[0][0]", "T_e[1]"]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "x.json:1:1: is no JSON: Expecting value"),
        ('{"Q": [}', "x.json:1:8: is no JSON"),
        ("[]", "x.json: holds a list. Give one object"),
        ("[" * 100_000, "x.json: is no JSON of an instance"),
        ("{}", "x.json: Q: is missing"),
    ],
)
def test_what_is_no_instance_is_refused(text: str, message: str):
    with pytest.raises(InputError) as caught:
        sadcher.parse(text, name="x", where="x.json")
    assert str(caught.value).startswith(message)


def test_a_file_of_ones_own_is_read(tmp_path):
    path = tmp_path / "mine.json"
    path.write_text(json.dumps(GOOD))
    found = sadcher.read(path)
    assert (found.name, found.mission.name, found.optimum) == ("mine", "mine", 25.9)
    assert found.routes == ((1, 2), (2,))
    with pytest.raises(InputError, match="cannot be read: No such file"):
        sadcher.read(tmp_path / "none.json")
    (tmp_path / "photo.json").write_bytes(b"\xff\xd8\xff")
    with pytest.raises(InputError, match="is not text"):
        sadcher.read(tmp_path / "photo.json")
    with (tmp_path / "huge.json").open("wb") as file:
        file.truncate(10_000_001)
    with pytest.raises(InputError, match="has 10,000,001 bytes"):
        sadcher.read(tmp_path / "huge.json")


def test_an_unknown_name_is_refused():
    with pytest.raises(InputError, match=r"there is no '1p_00000'\. Did you mean '1p_000000'"):
        sadcher.load("1p_00000")
    with pytest.raises(InputError, match=r"There are 1p_000000 to 9t3r3s2p_018\."):
        sadcher.load("?")
