"""The model refuses what cannot be a mission, and says all of it at once."""

from __future__ import annotations

import math
from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmbid.errors import InputError
from swarmbid.model import (
    Agent,
    Mission,
    Origin,
    Task,
    distance,
    fewest_sets,
    find_circle,
    prerequisite_cycle,
)


def make_task(task_id: str, **fields: object) -> Task:
    return Task(id=task_id, position=(0.0, 0.0, 0.0), **fields)  # type: ignore[arg-type]


def test_distance_is_euclidean_in_three_dimensions():
    """2, 3, 6 -> 7."""
    assert distance((1.0, 1.0, 1.0), (3.0, 4.0, 7.0)) == 7.0


@pytest.mark.parametrize(
    ("field", "value"),
    [("reward", 0.0), ("reward", math.nan), ("start", -1.0), ("duration", math.inf), ("agents_required", -1)],
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


HERE = (0.0, 0.0, 0.0)


def faults_of(make, **fields: object) -> list[str]:
    with pytest.raises(InputError) as caught:
        make(**fields)
    return [fault.field for fault in caught.value.faults]


@pytest.mark.parametrize("value", ["fast", None, True, math.nan, math.inf, 0.0, -1.0, 1e-12, 1e13, 10**400])
def test_speed_must_be_a_sensible_number(value):
    """1e-12 m/s and 1e13 m/s would overflow a schedule; True is a number to Python, not to a reader."""
    assert faults_of(Agent, id="a", position=HERE, speed=value) == ["speed"]


@pytest.mark.parametrize("name", ["available_at", "fuel_per_metre", "range", "endurance"])
@pytest.mark.parametrize("value", ["1", math.nan, -math.inf, -1.0])
def test_number_of_an_agent_is_checked(name, value):
    assert faults_of(Agent, id="a", position=HERE, **{name: value}) == [name]


@pytest.mark.parametrize(
    "name", ["reward", "start", "duration", "discount", "end", "revisit_at", "revisit_width"]
)
@pytest.mark.parametrize("value", ["1", math.nan, -math.inf, -1.0, True])
def test_number_of_a_task_is_checked(name, value):
    assert faults_of(make_task, task_id="t", **{name: value}) == [name]


@pytest.mark.parametrize("name", ["range", "endurance"])
def test_unlimited_is_allowed_where_it_means_something(name):
    assert getattr(Agent(id="a", position=HERE, **{name: math.inf}), name) == math.inf


@pytest.mark.parametrize("value", [0, -1, True, 2.0, "2", math.nan])
def test_counts_are_whole_numbers(value):
    """True would pass for 1, and 2.0 for 2, in a comparison."""
    assert faults_of(Agent, id="a", position=HERE, bundle_limit=value) == ["bundle_limit"]
    assert faults_of(make_task, task_id="t", agents_required=value) == ["agents_required"]


def test_seats_may_be_left_to_the_equipment_if_there_is_some():
    """0 agents required: as many as bring the equipment; without equipment that would be nobody."""
    task = make_task("t", equipment=frozenset({"camera", "winch"}), agents_required=0)
    assert (task.agents_required, task.is_group) == (0, True)
    with pytest.raises(InputError) as caught:
        make_task("t", agents_required=0)
    (fault,) = caught.value.faults
    assert (fault.where, fault.field) == ("task t", "agents_required")
    assert "needs no equipment" in fault.why
    # What the equipment is is not known where it is faulty: one fault, not two.
    assert faults_of(make_task, task_id="t", agents_required=0, equipment="camera") == ["equipment"]


@pytest.mark.parametrize(("seats", "group"), [(0, True), (1, False), (2, True), (5, True)])
def test_a_group_is_any_number_of_agents_but_one(seats, group):
    """Of a group each may bring a part of the equipment; who is alone brings all of it."""
    task = make_task("t", equipment=frozenset({"camera", "winch"}), agents_required=seats)
    assert task.is_group == group
    mission = Mission(agents=(Agent(id="a", position=HERE, equipment=frozenset({"camera"})),), tasks=(task,))
    assert mission.can_do(mission.agents[0], task) == group


@pytest.mark.parametrize(
    ("needed", "sets", "count"),
    [
        ("", [], 0),
        ("a", [], -1),
        ("ab", ["a"], -1),
        ("ab", ["a", "b"], 2),
        ("ab", ["a", "b", "abc"], 1),
        # The largest set first would take three: bcde, then a, then f.
        ("abcdef", ["bcde", "abc", "def", "a", "f"], 2),
        ("abc", ["ax", "bx", "cx", "x"], 3),
    ],
)
def test_fewest_sets_that_bring_it_all(needed, sets, count):
    assert fewest_sets(frozenset(needed), [frozenset(one) for one in sets]) == count


names = st.frozensets(st.sampled_from("abcde"))


@given(names, st.lists(names, max_size=5))
def test_fewest_sets_are_those_of_trying_all(needed, sets):
    """No choice of fewer covers, some choice of as many does."""
    sizes = [
        sum(1 for one in choice if one)
        for choice in product(*[(one, frozenset()) for one in sets])
        if needed <= frozenset().union(*choice)
    ]
    assert fewest_sets(needed, sets) == min(sizes, default=-1)


def test_a_circle_is_found_among_things_of_any_kind():
    """2 waits for 3, 3 for 4, 4 for 2; 1 only leads there, and 5 stands alone."""
    assert find_circle({1: [2], 2: [3], 3: [4], 4: [2], 5: []}) == [2, 3, 4, 2]
    assert find_circle({1: [2, 3], 2: [3], 3: []}) is None
    assert find_circle({("a", "t"): [("a", "t")]}) == [("a", "t"), ("a", "t")]


@pytest.mark.parametrize("value", [(0.0, 0.0), (0.0, 0.0, math.inf), "abc", 5, (0.0, 0.0, "z"), (0, 0, 1e13)])
def test_position_is_three_finite_numbers(value):
    assert faults_of(Agent, id="a", position=value) == ["position"]
    assert faults_of(Agent, id="a", position=HERE, base=value) == ["base"]
    assert faults_of(Task, id="t", position=value) == ["position"]


@pytest.mark.parametrize("value", ["", ".", "..", "-rf", "a b", "a/b", "ä", "x" * 65, 7, "a\n"])
def test_id_that_could_not_be_a_file_name_is_refused(value):
    assert faults_of(Agent, id=value, position=HERE) == ["id"]
    assert faults_of(Task, id=value, position=HERE) == ["id"]


@pytest.mark.parametrize("value", ["camera", 5, ["camera", 4], [""], ["a\nb"]])
def test_equipment_is_a_collection_of_names(value):
    """A lone string would silently become a set of letters."""
    assert faults_of(Agent, id="a", position=HERE, equipment=value) == ["equipment"]
    assert faults_of(make_task, task_id="t", equipment=value) == ["equipment"]
    assert faults_of(make_task, task_id="t", prerequisites=value) == ["prerequisites"]


@pytest.mark.parametrize("value", ["", 5, None, "a\nb", "x" * 201])
def test_type_is_a_printable_name(value):
    assert faults_of(Agent, id="a", position=HERE, type=value) == ["type"]
    assert faults_of(make_task, task_id="t", type=value) == ["type"]
    assert faults_of(Mission, agents=(), tasks=(), name=value) == ["name"]


def test_neighbouring_types_become_plain_ones():
    """NumPy scalars, ints and lists are what notebooks hold; equal missions must compare and print equal."""
    loose = Agent(
        id="a",
        position=np.array([1, 2, 3]),  # type: ignore[arg-type]
        speed=np.float32(2.0),  # type: ignore[arg-type]
        available_at=3,
        equipment=["b", "a"],  # type: ignore[arg-type]
        bundle_limit=np.int64(4),  # type: ignore[arg-type]
    )
    plain = Agent(
        id="a",
        position=(1.0, 2.0, 3.0),
        speed=2.0,
        available_at=3.0,
        equipment=frozenset({"a", "b"}),
        bundle_limit=4,
    )
    assert repr(loose) == repr(plain).replace(repr(plain.equipment), repr(loose.equipment))
    assert loose == plain
    mission = Mission(agents=[loose], tasks=[], compatible={"agent": ["look"]})  # type: ignore
    assert mission == Mission(agents=(plain,), tasks=(), compatible={"agent": frozenset({"look"})})


def test_task_cannot_wait_for_itself():
    with pytest.raises(InputError, match="task t1: prerequisites: 't1' is the task itself"):
        Mission(agents=(), tasks=(make_task("t1", prerequisites=("t1",)),))


def test_prerequisite_is_named_once():
    with pytest.raises(InputError, match="names 'a' twice"):
        Mission(agents=(), tasks=(make_task("a"), make_task("b", prerequisites=("a", "a"))))


def test_all_faults_of_a_mission_come_together():
    """One duplicate, one unknown, one bad step."""
    tasks = (make_task("a"), make_task("a", prerequisites=("z",)))
    assert faults_of(Mission, agents=(), tasks=tasks, distance_step=-1.0) == [
        "distance_step",
        "id",
        "prerequisites",
    ]


@pytest.mark.parametrize(
    ("value", "name"),
    [("look", "compatible"), ({"quad": "look"}, "compatible.quad"), ({3: ["look"]}, "compatible")],
)
def test_compatible_is_a_table_of_names(value, name):
    assert faults_of(Mission, agents=(), tasks=(), compatible=value) == [name]


def test_nobody_and_nothing_is_a_mission():
    mission = Mission(agents=(), tasks=())
    assert (mission.agents, mission.tasks, mission.origin) == ((), (), None)


def test_distance_is_rounded_down_to_the_step():
    """3-4-5 and a bit: sqrt(25.1) = 5.0099 -> 5.0 by 0.1; 5 itself stays 5; without a step, exact."""
    a, b = (0.0, 0.0, 0.0), (3.0, 4.0, math.sqrt(0.1))
    stepped = Mission(agents=(), tasks=(), distance_step=0.1)
    assert stepped.distance(a, b) == pytest.approx(5.0, abs=1e-12)
    assert stepped.distance(a, (3.0, 4.0, 0.0)) == pytest.approx(5.0, abs=1e-12)
    assert Mission(agents=(), tasks=()).distance(a, b) == distance(a, b)


def test_length_that_is_a_multiple_keeps_its_last_step():
    """0.3 / 0.1 is 2.9999999999999996 in floating point; rounding that down would lose a step."""
    mission = Mission(agents=(), tasks=(), distance_step=0.1)
    assert mission.distance((0.0, 0.0, 0.0), (0.3, 0.0, 0.0)) == pytest.approx(0.3, abs=1e-12)


coordinates = st.tuples(st.floats(-1e5, 1e5), st.floats(-1e5, 1e5), st.floats(-1e3, 1e3))


@given(a=coordinates, b=coordinates, step=st.sampled_from([0.0, 0.1, 1.0, 0.01]))
def test_distance_has_the_bits_of_the_compiled_kernel(a, b, step):
    from swarmbid.kernels.lanes import distance_between

    mission = Mission(agents=(), tasks=(), distance_step=step)
    assert mission.distance(a, b) == distance_between(*a, *b, step) == mission.distance(b, a)


@pytest.mark.parametrize(
    ("fields", "wrong"),
    [
        ({"latitude": 90.5}, ["latitude"]),
        ({"longitude": -181.0}, ["longitude"]),
        ({"latitude": 0.0, "longitude": 0.0}, ["latitude"]),
        ({"latitude": math.nan, "altitude": "high"}, ["latitude", "altitude"]),
        ({"altitude_reference": "agl"}, ["altitude_reference"]),
        ({"altitude_reference": None}, ["altitude_reference"]),
    ],
)
def test_origin_is_a_place_on_earth(fields, wrong):
    good = {"latitude": 48.4, "longitude": 7.8, "altitude": 150.0, "altitude_reference": "amsl"}
    assert Origin(**good).altitude == 150.0
    assert faults_of(Origin, **(good | fields)) == wrong


def test_equator_and_greenwich_are_places():
    """Only both zeros together are the mark of a missing fix."""
    Origin(latitude=0.0, longitude=36.8, altitude=0.0, altitude_reference="amsl")
    Origin(latitude=51.5, longitude=0.0, altitude=0.0, altitude_reference="amsl")
