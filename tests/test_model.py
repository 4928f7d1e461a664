"""The model refuses what cannot be a mission, and says all of it at once."""

from __future__ import annotations

import math

import pytest

from swarmbid.errors import InputError
from swarmbid.model import Agent, Mission, Task, distance, prerequisite_cycle


def make_task(task_id: str, **fields: object) -> Task:
    return Task(id=task_id, position=(0.0, 0.0, 0.0), **fields)  # type: ignore[arg-type]


def test_distance_is_euclidean_in_three_dimensions():
    """2, 3, 6 -> 7."""
    assert distance((1.0, 1.0, 1.0), (3.0, 4.0, 7.0)) == 7.0


@pytest.mark.parametrize(
    ("field", "value"),
    [("reward", 0.0), ("reward", math.nan), ("start", -1.0), ("duration", math.inf), ("agents_required", 0)],
)
def test_bad_task_field_is_named(field, value):
    """The error names the task and the field."""
    with pytest.raises(InputError) as caught:
        make_task("t1", **{field: value})
    assert [(fault.where, fault.field) for fault in caught.value.faults] == [("task t1", field)]


def test_all_faults_of_an_agent_come_together():
    """Three mistakes, three faults."""
    with pytest.raises(InputError) as caught:
        Agent(id="a b", position=(0.0, 0.0, math.nan), speed=0.0)
    assert [fault.field for fault in caught.value.faults] == ["id", "position", "speed"]


def test_window_must_not_end_before_it_starts():
    with pytest.raises(InputError, match="before start 9"):
        make_task("t1", start=9.0, end=8.0)


def test_duplicate_ids_are_refused_across_agents_and_tasks():
    with pytest.raises(InputError, match="used twice"):
        Mission(agents=(Agent(id="x", position=(0.0, 0.0, 0.0)),), tasks=(make_task("x"),))


def test_unknown_prerequisite_is_refused():
    with pytest.raises(InputError, match="'t9', which is no task"):
        Mission(agents=(), tasks=(make_task("t1", prerequisites=("t9",)),))


def test_prerequisite_circle_is_shown():
    tasks = (
        make_task("a", prerequisites=("b",)),
        make_task("b", prerequisites=("c",)),
        make_task("c", prerequisites=("b",)),
    )
    assert prerequisite_cycle(tasks) == ["b", "c", "b"]
    with pytest.raises(InputError, match="b -> c -> b"):
        Mission(agents=(), tasks=tasks)


def test_shared_prerequisite_is_no_circle():
    """A diamond: d needs b and c, both need a."""
    tasks = (
        make_task("d", prerequisites=("b", "c")),
        make_task("b", prerequisites=("a",)),
        make_task("c", prerequisites=("a",)),
        make_task("a"),
    )
    assert prerequisite_cycle(tasks) is None


def test_long_prerequisite_chain_does_not_recurse():
    tasks = tuple(
        make_task(f"t{i}", prerequisites=(f"t{i + 1}",) if i < 20_000 else ()) for i in range(20_001)
    )
    assert prerequisite_cycle(tasks) is None


def test_can_do_by_type_and_equipment():
    camera = Agent(id="a", position=(0.0, 0.0, 0.0), type="quad", equipment=frozenset({"camera"}))
    mission = Mission(agents=(camera,), tasks=(), compatible={"quad": frozenset({"look"})})
    assert mission.can_do(camera, make_task("t", type="look", equipment=frozenset({"camera"})))
    assert not mission.can_do(camera, make_task("t", type="look", equipment=frozenset({"laser"})))
    assert mission.can_do(
        camera, make_task("t", type="look", equipment=frozenset({"laser"}), agents_required=2)
    )
    assert not mission.can_do(camera, make_task("t", type="lift"))
