"""Mission files: what is read equals what was meant, and what is wrong is named by line and column."""

from __future__ import annotations

import gc
import json
import math
import os
import subprocess
import sys
from dataclasses import fields
from pathlib import Path

import jsonschema
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

import swarmbid.missiontext as missiontext
from swarmbid.errors import InputError
from swarmbid.geodesy import to_geodetic, to_local
from swarmbid.missionfile import (
    load_mission,
    mission_from_dict,
    mission_schema,
    mission_to_dict,
)
from swarmbid.missionspec import AgentSpec, HeaderSpec, OriginSpec, TaskSpec
from swarmbid.missiontext import MAX_FAULTS, MAX_YAML_BYTES, read
from swarmbid.model import ALTITUDE_REFERENCES, Agent, Mission, Origin, Task

BAD_INPUT = Path(__file__).parent / "testdata" / "bad_input"
EXAMPLES = Path(__file__).parents[1] / "examples"
BAD_FILES = sorted(path.name for path in BAD_INPUT.iterdir() if path.suffix != ".txt")

MINIMAL = "agents:\n  - {id: uav1, position: [1, 2, 3]}\ntasks:\n  - {id: t1, position: [4, 5, 6]}\n"


def faults_of(path: str | Path) -> list[str]:
    with pytest.raises(InputError) as caught:
        load_mission(path)
    return [str(fault) for fault in caught.value.faults]


def write(tmp_path: Path, text: str, name: str = "mission.yaml") -> Path:
    path = tmp_path / name
    path.write_text(text, encoding="utf-8")
    return path


# -- bad input -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", BAD_FILES)
def test_bad_file_gets_its_golden_message(name, request, monkeypatch):
    """Every file under testdata/bad_input is refused in exactly the words of the .txt beside it."""
    monkeypatch.chdir(BAD_INPUT)
    message = "\n".join(faults_of(name)) + "\n"
    golden = BAD_INPUT / f"{name}.txt"
    if request.config.getoption("--rewrite", default=False):
        golden.write_text(message, encoding="utf-8")
    assert message == golden.read_text(encoding="utf-8")


def test_no_golden_message_without_its_file():
    assert sorted(f"{name}.txt" for name in BAD_FILES) == sorted(p.name for p in BAD_INPUT.glob("*.txt"))


@pytest.mark.parametrize("name", [name for name in BAD_FILES if name.endswith(".yaml")])
def test_bad_file_is_refused_without_the_c_parser_too(name, monkeypatch):
    """PyYAML may be built without libyaml; its own parser words syntax differently, nothing else.

    Marks of the two agree except at the end of a file that was cut short.
    """
    monkeypatch.chdir(BAD_INPUT)
    monkeypatch.setattr(yaml, "__with_libyaml__", False)
    golden = (BAD_INPUT / f"{name}.txt").read_text(encoding="utf-8")
    message = "\n".join(faults_of(name)) + "\n"
    syntax = ("of its YAML", "not YAML here", "tab where YAML", "nested too deeply")
    assert message == golden or any(part in golden for part in syntax)


def test_missing_file_is_named(tmp_path):
    path = tmp_path / "nowhere.yaml"
    assert faults_of(path) == [f"{path}: does not exist. Check the spelling of the path."]


def test_directory_is_no_mission(tmp_path):
    assert faults_of(tmp_path) == [f"{tmp_path}: is a directory. Give the mission file inside it."]


def test_path_through_a_file_cannot_be_read(tmp_path):
    path = write(tmp_path, MINIMAL) / "inner.yaml"
    assert faults_of(path) == [
        f"{path}: cannot be read: not a directory. Check the path and your rights to it."
    ]


def test_file_without_read_permission_cannot_be_read(tmp_path, monkeypatch):
    """The refusal is simulated: a superuser may read everything."""
    path = write(tmp_path, MINIMAL)

    def refuse(*args: object, **kwargs: object) -> None:
        raise PermissionError(13, os.strerror(13))

    monkeypatch.setattr(Path, "open", refuse)
    assert faults_of(path) == [
        f"{path}: cannot be read: permission denied. Check the path and your rights to it."
    ]


def test_path_that_no_system_allows_cannot_be_read():
    assert "cannot be read: embedded null byte" in faults_of("a\0b.yaml")[0]


@pytest.mark.parametrize("suffix", [".json", ".yaml"])
def test_million_tasks_are_refused_before_they_are_parsed(tmp_path, suffix, monkeypatch):
    """30 to 45 MB of text; a parser that saw any of it would fail this test."""
    monkeypatch.setattr("swarmbid.missionfile.read", lambda *args, **kwargs: pytest.fail("was parsed"))
    monkeypatch.setattr("swarmbid.missionfile.MAX_YAML_BYTES", 2**26)
    if suffix == ".json":
        tasks = ",".join(f'{{"id":"t{i}","position":[1,2,3]}}' for i in range(10**6))
        text = f'{{"agents":[],"tasks":[{tasks}]}}'
    else:
        text = "agents: []\ntasks:\n" + "".join(f"- {{id: t{i}, position: [1,2,3]}}\n" for i in range(10**6))
    path = write(tmp_path, text, f"mission{suffix}")
    assert faults_of(path) == [f"{path}: has more than 100,000 agents and tasks. Split the mission."]


def test_too_many_items_are_refused_by_number_as_well(monkeypatch):
    """Plain data of a program is not counted as text before."""
    monkeypatch.setattr("swarmbid.missionfile.MAX_ITEMS", 2)
    with pytest.raises(InputError, match=r"mission: tasks: are 3, more than 2\. Split the mission"):
        mission_from_dict({"agents": [], "tasks": [{"id": f"t{i}", "position": [0, 0, 0]} for i in range(3)]})


def test_large_yaml_is_sent_to_json(tmp_path):
    path = write(tmp_path, MINIMAL + "#" * MAX_YAML_BYTES)
    assert faults_of(path) == [
        f"{path}: is larger than 8 MiB. Write it as JSON, which may be larger, or split it."
    ]


def test_large_json_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr("swarmbid.missionfile.MAX_JSON_BYTES", 2**20)
    path = write(tmp_path, "{" + " " * 2**20, "mission.json")
    assert faults_of(path) == [f"{path}: is larger than 1 MiB. Split the mission."]


def test_endless_faults_are_counted_not_printed():
    """MAX_FAULTS + 3 tasks lack a position: that many faults, the last three only counted."""
    data = {"agents": [], "tasks": [{"id": f"t{i}"} for i in range(MAX_FAULTS + 3)]}
    with pytest.raises(InputError) as caught:
        mission_from_dict(data)
    assert len(caught.value.faults) == MAX_FAULTS + 1
    assert str(caught.value.faults[-1]) == "mission: has 3 more faults. Mend these first."


def test_faults_of_plain_data_name_where_it_came_from():
    with pytest.raises(InputError, match=r"^run\.jsonl:1: agents\[0\]\.speed: is 0\. Give more than 0\.$"):
        mission_from_dict(
            {"agents": [{"id": "a", "position": [0, 0, 0], "speed": 0}], "tasks": []}, "run.jsonl:1"
        )


@given(st.text(alphabet="{}[]:,-&*!|>'\"#% \n\tabc019.<", max_size=60) | st.text(max_size=30))
def test_any_text_is_read_or_refused(text):
    """Garbage is never a crash: the only exception is InputError."""
    for as_json in (False, True):
        try:
            read(text or " ", "f", as_json=as_json)
        except InputError as error:
            assert all(fault.where.startswith("f") for fault in error.faults)


json_values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=8), inner, max_size=4),
    max_leaves=8,
)
some_spec_fields = st.sampled_from(sorted({*AgentSpec.model_fields, *TaskSpec.model_fields}))


@given(
    item=st.dictionaries(some_spec_fields, json_values, max_size=5),
    header=st.dictionaries(st.sampled_from(sorted(HeaderSpec.model_fields)), json_values, max_size=3),
)
def test_any_value_in_any_field_is_read_or_refused(item, header):
    good = {"id": "x", "position": [0, 0, 0]}
    for kind in ("agents", "tasks"):
        try:
            mission_from_dict({"agents": [], "tasks": [], **header, kind: [item, good | item]})
        except InputError as error:
            assert all(fault.why and fault.mend for fault in error.faults)


@given(item=st.dictionaries(st.sampled_from(sorted(TaskSpec.model_fields)), json_values, max_size=5))
def test_yaml_and_json_agree_on_faults_and_fields(item):
    """One text, read as JSON and as YAML: the same faults at the same lines and columns."""
    text = json.dumps({"agents": [], "tasks": [{"id": "x", "position": [0, 0, 0]} | item]}, indent=1)
    if "NaN" in text or "Infinity" in text or "\\" in text or "\x7f" in text:
        return  # JSON writes these in ways that YAML has not
    told = []
    for as_json in (True, False):
        source = read(text, "f", as_json=as_json)
        try:
            told.append(str(mission_to_dict(mission_from_source(source))))
        except InputError as error:
            told.append(str(error))
    assert told[0] == told[1]


def mission_from_source(source: missiontext.Source) -> Mission:
    from swarmbid.missionfile import _Reading

    return _Reading(source).mission(servable=True)


# -- places in the text --------------------------------------------------------------------------------


def test_every_value_is_found_where_it_stands():
    """JSON and YAML places, counted by hand; line and column start at 1."""
    text = '{\n  "a": [10, {"b c": "]}"},\n\t[]],\n  "d": {"e": null}}'
    wanted = {
        ("a",): (2, 8),
        ("a", 0): (2, 9),
        ("a", 1, "b c"): (2, 21),
        ("a", 2): (3, 2),
        ("d", "e"): (4, 14),
        ("d", "missing"): (4, 8),
        (): (1, 1),
    }
    source = read(text, "f", as_json=True)
    assert {path: source.place(path, of_key=False) for path in wanted} == wanted
    assert source.place(("d", "e"), of_key=True) == (4, 9)


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1e5", 100000.0),
        ("1_000", "1_000"),
        ("12:30", "12:30"),
        ("007", "007"),
        ("-5", -5),
        (".5", 0.5),
        ("5.", 5.0),
        (".", "."),
        ("e5", "e5"),
        ("no", "no"),
        ("true", True),
        ("'true'", "true"),
        ("~", None),
        ("-.inf", -math.inf),
        ("2026-01-01", "2026-01-01"),
        ("99999999999999999999", 1e20),
    ],
)
def test_plain_words_are_read_as_yaml_1_2_reads_them(text, value):
    """PyYAML alone reads YAML 1.1: 12:30 as 750, no as false, 007 as 7, 1e5 as text, a date as an object."""
    read_value = read(f"a: {text}", "f", as_json=False).data["a"]
    assert read_value == value
    assert type(read_value) is type(value)


def test_templates_merge_and_own_fields_win():
    """The later of two merged templates gives way to the earlier, and both to the item's own fields."""
    text = (
        "a: &a {x: 1, y: 1, z: 1}\nb: &b {y: 2, w: 2}\nc:\n  <<: [*a, *b]\n  z: 3\n"
        "d: {z: 4, <<: *b, '<<': quoted}\n"
    )
    data = read(text, "f", as_json=False).data
    assert data["c"] == {"x": 1, "y": 1, "z": 3, "w": 2}
    assert data["d"] == {"y": 2, "w": 2, "z": 4, "<<": "quoted"}


# -- good input ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "agents", "tasks"),
    [
        ("agents: []\ntasks: []\n", 0, 0),
        ("agents: []\ntasks:\n  - {id: t1, position: [0, 0, 0], equipment: [crane]}\n", 0, 1),
        ("agents:\n  - {id: uav1, position: [0, 0, 0]}\ntasks: []\n", 1, 0),
        (MINIMAL, 1, 1),
        ('{"agents": [], "tasks": []}', 0, 0),
    ],
)
@pytest.mark.parametrize("name", ["mission.yaml", "mission"])
def test_none_or_one_of_each_is_a_mission(tmp_path, text, agents, tasks, name):
    """A mission without agents is not refused for equipment: nobody is there to lack it."""
    mission = load_mission(write(tmp_path, text, name))
    assert (len(mission.agents), len(mission.tasks)) == (agents, tasks)


def test_every_field_arrives(tmp_path):
    text = """\
version: 1
name: everything
origin: {latitude: 48.4, longitude: 7.8, altitude: 150, altitude_reference: amsl}
compatible: {quad: [look, lift]}
distance_step: 0.1
agents:
  - id: uav1
    type: quad
    position: [1, 2, 3]
    speed: 12
    available_at: 5
    fuel_per_metre: 0.01
    range: 20e3
    endurance: 2400
    equipment: [camera, thermal]
    bundle_limit: 4
    base: [0, 0, 0]
  - {id: uav2, type: quad, position: [0, 0, 0], range: null, endurance: .inf, base: ~}
tasks:
  - id: t1
    type: look
    position: [4, 5, 6]
    reward: 10
    start: 60
    end: 600
    duration: 30
    discount: 1e-3
    agents_required: 2
    equipment: [camera]
    prerequisites: [t2]
    revisit_at: 300
    revisit_width: 20
  - {id: t2, type: look, position: [0, 0, 0]}
"""
    uav1 = Agent(
        id="uav1", type="quad", position=(1.0, 2.0, 3.0), speed=12.0, available_at=5.0, fuel_per_metre=0.01,
        range=20_000.0, endurance=2400.0, equipment=frozenset({"camera", "thermal"}), bundle_limit=4,
        base=(0.0, 0.0, 0.0),
    )  # fmt: skip
    t1 = Task(
        id="t1", type="look", position=(4.0, 5.0, 6.0), reward=10.0, start=60.0, end=600.0, duration=30.0,
        discount=0.001, agents_required=2, equipment=frozenset({"camera"}), prerequisites=("t2",),
        revisit_at=300.0, revisit_width=20.0,
    )  # fmt: skip
    assert load_mission(write(tmp_path, text)) == Mission(
        name="everything",
        origin=Origin(latitude=48.4, longitude=7.8, altitude=150.0, altitude_reference="amsl"),
        compatible={"quad": frozenset({"look", "lift"})},
        distance_step=0.1,
        agents=(uav1, Agent(id="uav2", type="quad", position=(0.0, 0.0, 0.0))),
        tasks=(t1, Task(id="t2", type="look", position=(0.0, 0.0, 0.0))),
    )


def test_byte_order_mark_and_foreign_letters_are_read(tmp_path):
    path = tmp_path / "mission.yaml"
    path.write_bytes(b"\xef\xbb\xbf" + f"name: Straße nach Süden\n{MINIMAL}".encode())
    assert load_mission(path).name == "Straße nach Süden"


def test_equipment_of_a_group_may_come_from_several_agents(tmp_path):
    """Two seats, camera and thermal: neither agent carries both, together they do."""
    text = (
        "agents:\n- {id: a, position: [0,0,0], equipment: [camera]}\n"
        "- {id: b, position: [0,0,0], equipment: [thermal]}\n"
        "tasks:\n- {id: t, position: [0,0,0], equipment: [camera, thermal], agents_required: 2}\n"
    )
    assert load_mission(write(tmp_path, text)).tasks[0].agents_required == 2


def test_seats_may_be_left_to_the_equipment(tmp_path):
    """0 agents: as many as it takes to bring camera and thermal."""
    text = (
        "agents:\n- {id: a, position: [0,0,0], equipment: [camera]}\n"
        "- {id: b, position: [0,0,0], equipment: [thermal]}\n"
        "tasks:\n- {id: t, position: [0,0,0], equipment: [camera, thermal], agents_required: 0}\n"
    )
    assert load_mission(write(tmp_path, text)).tasks[0].agents_required == 0


@pytest.mark.parametrize("equipment", [[], None])
def test_schema_and_reader_refuse_no_seats_without_equipment(equipment):
    task = {"id": "t", "position": [0, 0, 0], "agents_required": 0}
    data = {"agents": [], "tasks": [task if equipment is None else task | {"equipment": equipment}]}
    assert not jsonschema.Draft202012Validator(mission_schema()).is_valid(data)
    with pytest.raises(InputError) as caught:
        mission_from_dict(data)
    assert [fault.field for fault in caught.value.faults] == ["tasks[0].agents_required"]


@pytest.mark.parametrize("equipment", ["camera", [1], [""]])
def test_faulty_equipment_is_not_taken_for_none(equipment):
    """Of the shape or of the model: the one fault is that of the equipment."""
    task = {"id": "t", "position": [0, 0, 0], "agents_required": 0, "equipment": equipment}
    with pytest.raises(InputError) as caught:
        mission_from_dict({"agents": [], "tasks": [task]})
    (fault,) = caught.value.faults
    assert fault.field.startswith("tasks[0].equipment")


def test_seats_that_no_group_can_fill_are_refused(tmp_path):
    """Three of the four agents may lift; two of them cannot bring three things of which each has one."""
    text = (
        "compatible: {scout: [look]}\n"
        "agents:\n- {id: a, position: [0,0,0], equipment: [hook]}\n"
        "- {id: b, position: [0,0,0], equipment: [rope]}\n- {id: c, position: [0,0,0], equipment: [lamp]}\n"
        "- {id: d, type: scout, position: [0,0,0]}\n"
        "tasks:\n- {id: t, type: lift, position: [0,0,0], agents_required: 4}\n"
        "- {id: u, type: lift, position: [0,0,0], agents_required: 2, equipment: [hook, rope, lamp]}\n"
    )
    with pytest.raises(InputError) as caught:
        load_mission(write(tmp_path, text))
    assert [(fault.field, fault.why) for fault in caught.value.faults] == [
        ("tasks[0].agents_required", "is 4, but there are 4 agents, of whom 3 may do it"),
        ("tasks[1].agents_required", "is 2, but to bring hook, lamp, rope takes 3 agents"),
    ]


def test_program_may_make_what_a_file_may_not():
    """A running fleet may yet be joined by who carries a crane, so plain data passes."""
    data = {
        "agents": [{"id": "a", "position": [0, 0, 0]}],
        "tasks": [{"id": "t", "position": [0, 0, 0], "equipment": ["crane"]}],
    }
    assert mission_from_dict(data).tasks[0].equipment == {"crane"}


def test_reader_itself_is_light_to_import():
    """Pydantic, PyYAML, NumPy and pymap3d wait for the first file that needs them."""
    heavy = "{'pydantic', 'yaml', 'numpy', 'pymap3d'}"
    code = f"import sys, swarmbid.missionfile; print({heavy} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "set()\n"


def test_garbage_collection_rests_while_a_file_is_read(tmp_path, monkeypatch):
    """It would take most of the time; afterwards it is as it was."""
    path = write(tmp_path, MINIMAL)
    seen = []

    def spy(*args: object, **kwargs: object) -> missiontext.Source:
        seen.append(gc.isenabled())
        return read(*args, **kwargs)  # type: ignore[arg-type]

    monkeypatch.setattr("swarmbid.missionfile.read", spy)
    assert gc.isenabled()
    load_mission(path)
    assert seen == [False]
    assert gc.isenabled()
    gc.disable()
    try:
        load_mission(path)
        assert not gc.isenabled()
    finally:
        gc.enable()


# -- the round trip ------------------------------------------------------------------------------------

ids = st.from_regex(r"[A-Za-z0-9_][A-Za-z0-9._-]{0,8}", fullmatch=True)
names = st.text(st.characters(exclude_categories=("C", "Z")), min_size=1, max_size=5)
metres = st.floats(-1e5, 1e5)
positions = st.tuples(metres, metres, metres)
times = st.floats(0.0, 1e5)
positive = st.floats(1e-6, 1e5)
equipment = st.frozensets(names, max_size=3)

agents = st.builds(
    Agent,
    id=ids,
    type=names,
    position=positions,
    speed=positive,
    available_at=times,
    fuel_per_metre=times,
    range=positive | st.just(math.inf),
    endurance=positive | st.just(math.inf),
    equipment=equipment,
    bundle_limit=st.none() | st.integers(1, 9),
    base=st.none() | positions,
)


@st.composite
def missions(draw: st.DrawFn) -> Mission:
    team = draw(st.lists(agents, max_size=3, unique_by=lambda agent: agent.id))
    taken = {agent.id for agent in team}
    tasks: list[Task] = []
    for task_id in draw(st.lists(ids.filter(lambda i: i not in taken), max_size=4, unique=True)):
        start = draw(times)
        earlier = [task.id for task in tasks]
        needs = draw(equipment)
        tasks.append(
            Task(
                id=task_id,
                type=draw(names),
                position=draw(positions),
                reward=draw(positive),
                start=start,
                end=draw(st.floats(start, 2e5) | st.just(math.inf)),
                duration=draw(times),
                discount=draw(times),
                agents_required=draw(st.integers(0 if needs else 1, 4)),
                equipment=needs,
                prerequisites=tuple(draw(st.lists(st.sampled_from(earlier), unique=True)) if earlier else ()),
                revisit_at=draw(st.none() | times),
                revisit_width=draw(positive),
            )
        )
    origin = st.builds(
        Origin,
        latitude=st.floats(1.0, 90.0),
        longitude=st.floats(-180.0, 180.0),
        altitude=metres,
        altitude_reference=st.sampled_from(ALTITUDE_REFERENCES),
    )
    return Mission(
        agents=tuple(team),
        tasks=tuple(tasks),
        compatible=draw(st.dictionaries(names, st.frozensets(names, max_size=3), max_size=3)),
        distance_step=draw(st.just(0.0) | positive),
        name=draw(names),
        origin=draw(st.none() | origin),
    )


@given(missions())
def test_mission_survives_json_exactly(mission):
    """Every field, to the last bit, through text that strict JSON readers accept."""
    text = json.dumps(mission_to_dict(mission), allow_nan=False)
    assert mission_from_dict(json.loads(text)) == mission


@given(missions())
def test_mission_survives_yaml_exactly(mission):
    text = yaml.safe_dump(mission_to_dict(mission), allow_unicode=True)
    assert mission_from_dict(read(text, "f", as_json=False).data) == mission


def test_plain_data_has_only_what_differs_from_defaults():
    """Sets come out in order of name, whatever the hash seed."""
    letters = list("abcdefgh")
    mission = Mission(
        agents=(Agent(id="a", position=(1.0, 2.0, 3.0), equipment=frozenset(letters)),),
        tasks=(Task(id="t", position=(0.0, 0.0, 0.0), end=9.0),),
        compatible={"z": frozenset(letters), "agent": frozenset({"task"})},
    )
    data = mission_to_dict(mission)
    assert list(data["compatible"]) == ["agent", "z"]
    assert data == {
        "version": 1,
        "compatible": {"agent": ["task"], "z": letters},
        "agents": [{"id": "a", "position": [1.0, 2.0, 3.0], "equipment": letters}],
        "tasks": [{"id": "t", "position": [0.0, 0.0, 0.0], "end": 9.0}],
    }


# -- places on Earth -----------------------------------------------------------------------------------


def earth_centred(latitude: float, longitude: float, altitude: float) -> tuple[float, float, float]:
    """Textbook WGS 84 to Earth-centred metres, independent of the library."""
    a, f = 6378137.0, 1 / 298.257223563
    e2 = f * (2 - f)
    phi, lam = math.radians(latitude), math.radians(longitude)
    n = a / math.sqrt(1 - e2 * math.sin(phi) ** 2)
    return (
        (n + altitude) * math.cos(phi) * math.cos(lam),
        (n + altitude) * math.cos(phi) * math.sin(lam),
        (n * (1 - e2) + altitude) * math.sin(phi),
    )


@given(
    latitude=st.floats(-80.0, 80.0).filter(lambda x: abs(x) > 0.01),
    longitude=st.floats(-180.0, 180.0),
    offsets=st.tuples(st.floats(-1e4, 1e4), st.floats(-1e4, 1e4), st.floats(-500.0, 5000.0)),
)
def test_places_return_within_a_micrometre(latitude, longitude, offsets):
    origin = Origin(latitude=latitude, longitude=longitude, altitude=150.0, altitude_reference="amsl")
    point = to_geodetic(offsets, origin)
    assert math.dist(to_local([point], origin)[0], offsets) < 1e-6
    # A distance in the local frame is the distance through space.
    straight = math.dist(earth_centred(*point), earth_centred(latitude, longitude, 150.0))
    assert math.isclose(straight, math.hypot(*offsets), abs_tol=1e-6)


def test_latitude_and_longitude_become_metres(tmp_path):
    """One minute of latitude is about 1,853 m at 48°, one of longitude cos(48°) · 1,855 · 1.0018 = 1,243 m.

    Up is 60 m less the curvature, d²/2R = 1853² / 12.74e6 = 0.27 m, and 0.12 m for the shorter.
    """
    text = """\
origin: {latitude: 48, longitude: 8, altitude: 100, altitude_reference: rel_home}
agents:
  - id: uav1
    position: {latitude: 48, longitude: 8, altitude: 100, altitude_reference: rel_home}
    base: {latitude: 48, longitude: 8.016666666666667, altitude: 160}
tasks:
  - {id: t1, position: {latitude: 48.016666666666667, longitude: 8, altitude: 160}}
  - {id: t2, position: [5, 6, 7]}
"""
    mission = load_mission(write(tmp_path, text))
    assert mission.agents[0].position == pytest.approx((0.0, 0.0, 0.0), abs=1e-6)
    assert mission.agents[0].base == pytest.approx((1243.3, 0.134, 59.88), abs=0.5)
    assert mission.tasks[0].position == pytest.approx((0.0, 1853.2, 59.73), abs=0.5)
    assert mission.tasks[1].position == (5.0, 6.0, 7.0)


# -- the schema ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(("spec", "kind"), [(AgentSpec, Agent), (TaskSpec, Task), (OriginSpec, Origin)])
def test_file_has_the_fields_and_defaults_of_the_model(spec, kind):
    """One field forgotten in either would be lost on the way. None in a file stands for the default."""
    model = {field.name: field for field in fields(kind)}
    assert list(spec.model_fields) == list(model) or set(spec.model_fields) == set(model)
    required = {name for name, field in spec.model_fields.items() if field.is_required()}
    item = dict.fromkeys(required, "x") | ({"position": (0.0, 0.0, 0.0)} if "position" in required else {})
    if kind is Origin:
        assert required == set(model)
        return
    made = kind(**item)
    for name, field in spec.model_fields.items():
        if name not in required and field.default is not None:
            assert getattr(made, name) == type(getattr(made, name))(field.default), name


def test_header_has_the_fields_of_a_mission():
    assert {*HeaderSpec.model_fields, "agents", "tasks"} == {field.name for field in fields(Mission)} | {
        "version"
    }


def test_schema_describes_every_field():
    """Editors show the description; quantities name their unit."""
    schema = mission_schema()
    jsonschema.Draft202012Validator.check_schema(schema)
    objects = [schema, *schema["$defs"].values()]
    members = [(name, value) for item in objects for name, value in item["properties"].items()]
    assert {name for name, value in members if not value.get("description")} == set()
    units = {name: value["x-unit"] for name, value in members if "x-unit" in value}
    assert units == {
        "latitude": "degrees", "longitude": "degrees", "altitude": "m", "speed": "m/s", "available_at": "s",
        "fuel_per_metre": "score/m", "range": "m", "endurance": "s", "start": "s", "end": "s",
        "duration": "s", "discount": "1/s", "revisit_at": "s", "revisit_width": "s", "distance_step": "m",
    }  # fmt: skip


@given(missions())
def test_schema_accepts_every_mission(mission):
    jsonschema.validate(mission_to_dict(mission), mission_schema())


@pytest.mark.parametrize("path", sorted(EXAMPLES.glob("*.yaml")), ids=lambda path: path.name)
def test_schema_and_reader_accept_the_examples(path):
    jsonschema.validate(yaml.safe_load(path.read_text(encoding="utf-8")), mission_schema())
    assert load_mission(path).tasks


@pytest.mark.parametrize(
    ("kind", "name", "value"),
    [
        ("agents", "speed", 0),
        ("agents", "available_at", -1),
        ("agents", "range", 0),
        ("agents", "endurance", -1),
        ("agents", "fuel_per_metre", -1),
        ("agents", "bundle_limit", 0),
        ("agents", "position", [0, 0]),
        ("agents", "position", {"latitude": 91, "longitude": 0, "altitude": 0}),
        ("agents", "id", "a b"),
        ("agents", "colour", "red"),
        ("tasks", "reward", 0),
        ("tasks", "start", -1),
        ("tasks", "end", -1),
        ("tasks", "duration", -1),
        ("tasks", "discount", -1),
        ("tasks", "agents_required", -1),
        ("tasks", "revisit_at", -1),
        ("tasks", "revisit_width", 0),
        ("tasks", "equipment", "camera"),
    ],
)
def test_schema_and_reader_refuse_the_same(kind, name, value):
    """The bounds are stated twice, for editors and for the model; here they meet."""
    origin = {"latitude": 48, "longitude": 8, "altitude": 0, "altitude_reference": "amsl"}
    data = {
        "origin": origin,
        "agents": [],
        "tasks": [],
        kind: [{"id": "x", "position": [0, 0, 0], name: value}],
    }
    assert not jsonschema.Draft202012Validator(mission_schema()).is_valid(data)
    with pytest.raises(InputError):
        mission_from_dict(data)


# -- the examples --------------------------------------------------------------------------------------


def test_quickstart_is_three_agents_and_six_tasks():
    mission = load_mission(EXAMPLES / "quickstart.yaml")
    assert (len(mission.agents), len(mission.tasks)) == (3, 6)


def test_substations_are_made_from_the_carried_map(tmp_path):
    """The script and the map beside it give the demo mission, byte for byte."""
    import runpy

    script = runpy.run_path(str(EXAMPLES / "make_substations.py"))
    assert script["make"]() == (EXAMPLES / "substations.yaml").read_text(encoding="utf-8")


def test_substations_are_a_fair_demo():
    """Two kinds of UAV at two bases; each task can be reached and done by somebody, there and back."""
    mission = load_mission(EXAMPLES / "substations.yaml")
    assert 60 <= len(mission.tasks) <= 120
    assert 6 <= len(mission.agents) <= 8
    assert len({agent.type for agent in mission.agents}) == 2
    assert len({agent.base for agent in mission.agents}) == 2
    assert all(
        12.0 <= agent.speed <= 22.0 and 1800.0 <= agent.endurance <= 3600.0 for agent in mission.agents
    )
    assert any(math.isfinite(task.end) for task in mission.tasks)
    assert {name for task in mission.tasks for name in task.equipment} == {"camera", "thermal"}
    for task in mission.tasks:
        assert any(
            mission.can_do(agent, task)
            and mission.distance(agent.position, task.position) / agent.speed <= task.end
            and 2 * mission.distance(agent.position, task.position) / agent.speed + task.duration
            <= agent.endurance
            for agent in mission.agents
        ), task.id
