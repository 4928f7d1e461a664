"""The benchmark is read as published: checked by integer arithmetic that shares nothing with the model."""

from __future__ import annotations

import dataclasses
import math
import random
from importlib import resources

import pytest

from swarmbid.datasets import toptw
from swarmbid.errors import InputError
from swarmbid.plan import make_plan
from swarmbid.scores import make_score
from swarmbid.verify import verify

GOOD = "4 1 2 4\n0 0\n0 0 0 0 0 0 0 0 100\n1 3 4 10 20 1 2 1 2 5 60\n2 0 8 5 7 1 0 0 50\n"


def integer_rows(name: str) -> dict[int, tuple[int, ...]]:
    """Vertex -> x, y in thousandths, service, reward, opening, closing; read without the reader."""
    text = (resources.files("swarmbid.datasets") / "data" / "toptw" / f"{name}.txt").read_text()
    rows = {}
    for line in text.split("\n")[2:]:
        words = line.split()
        if words:
            x, y, service, reward = (round(1000 * float(word)) for word in words[1:5])
            rows[int(words[0])] = (x, y, service // 1000, reward // 1000, int(words[-2]), int(words[-1]))
    return rows


def integer_distance(name: str, a: tuple[int, ...], b: tuple[int, ...]) -> int:
    """Rounded down exactly, in hundredths for pr and in tenths for the others."""
    return math.isqrt((a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2) // (10 if name.startswith("pr") else 100)


def test_all_published_instances_are_carried_with_their_results():
    """9 + 12 + 8 + 8 = 37 instances, 4 fleet sizes each; the rewards add up to the published total."""
    names = toptw.instances()
    assert [sum(name.startswith(kind) for name in names) for kind in ("c", "r1", "r2", "rc", "pr")] == [
        9,
        6,
        6,
        8,
        8,
    ]
    for name in names:
        total = sum(task.reward for task in toptw.load(name, 1).tasks)
        for vehicles in (1, 2, 3, 4):
            known = toptw.known(name, vehicles)
            assert known.total == total
            assert known.leuven_mean <= known.leuven_best <= known.best <= total


def test_an_instance_is_read_as_printed():
    """c101, line 4: vertex 1 at (45, 68), service 90, reward 10, window 912 to 967; horizon 1236."""
    mission = toptw.load("c101", 2)
    assert [agent.id for agent in mission.agents] == ["v1", "v2"]
    assert len(mission.tasks) == 100
    vehicle, task = mission.agents[0], mission.tasks[0]
    assert (vehicle.position, vehicle.base) == ((40.0, 50.0, 0.0), (40.0, 50.0, 0.0))
    assert (vehicle.speed, vehicle.available_at, vehicle.endurance) == (1.0, 0.0, 1236.0)
    assert (task.id, task.position, task.duration, task.reward) == ("t001", (45.0, 68.0, 0.0), 90.0, 10.0)
    assert (task.start, task.end, task.discount) == (912.0, 967.0, 0.0)
    assert toptw.best_known("c101", 1) == 320.0


@pytest.mark.parametrize("name", ["c101", "r201", "rc104", "pr01", "pr13"])
def test_distances_are_rounded_down_exactly(name):
    """Every pair, against integer square roots; a tenth or a hundredth too many or too few is seen."""
    mission, rows = toptw.load(name, 1), integer_rows(name)
    parts = 100 if name.startswith("pr") else 10
    places = {int(task.id[1:]): task.position for task in mission.tasks} | {0: mission.agents[0].position}
    for a in places:
        for b in places:
            metres = mission.distance(places[a], places[b])
            assert metres * parts == pytest.approx(integer_distance(name, rows[a], rows[b]), abs=1e-6)


@pytest.mark.parametrize("name", ["c101", "c204", "r101", "r205", "rc103", "pr02", "pr11"])
def test_a_route_stands_exactly_when_the_integer_check_says_so(name):
    """Random routes, some too long: a violation if and only if a window or the horizon is missed."""
    rng = random.Random(name)
    rows = integer_rows(name)
    parts = 100 if name.startswith("pr") else 10
    horizon = rows[0][5] * parts
    mission = toptw.load(name, 1)
    score = make_score("time_window")
    verdicts = []
    for _ in range(40):
        time, here, steps, good, reward = 0, 0, [], True, 0
        for _ in range(rng.randrange(1, 12)):
            # The vertex that can be served soonest of a few drawn: routes long enough to be of interest.
            near = rng.sample([v for v in rows if v and v not in dict(steps)], 8)
            arrivals = {v: time + integer_distance(name, rows[here], rows[v]) for v in near}
            there = min(near, key=lambda v: max(arrivals[v], parts * rows[v][4]))
            start = max(arrivals[there], parts * rows[there][4])
            good = good and start <= parts * rows[there][5]
            steps.append((there, start / parts))
            time, here = start + parts * rows[there][2], there
            reward += rows[there][3]
        good = good and time + integer_distance(name, rows[here], rows[0]) <= horizon
        # A score blind to windows, so that only the flight is judged.
        blind = make_score("time_discounted")
        plan = make_plan(
            mission, {"v1": [(f"t{v:03d}", start) for v, start in steps]}, blind, "hand", "shift"
        )
        found = verify(mission, plan, blind)
        assert {violation.rule for violation in found} <= {"window", "endurance"}
        assert (found == []) == good
        if good:
            plan = make_plan(
                mission, {"v1": [(f"t{v:03d}", start) for v, start in steps]}, score, "hand", "shift"
            )
            assert plan.total_score == reward
        verdicts.append(good)
    assert any(verdicts)


def test_the_depot_line_may_have_its_closing_time_only():
    text = GOOD.replace("0 0 0 0 0 0 0 0 100", "0 0 0 0 0 0 0 100")
    two, one = toptw.parse(GOOD, 2, name="x", where="x.txt"), toptw.parse(text, 2, name="x", where="x.txt")
    assert text != GOOD
    assert one == two
    assert one.agents[0].endurance == 100.0


def test_a_depot_that_opens_later_holds_the_vehicles_back():
    """Open from 10 to 100 s: 90 s of endurance from 10 s on."""
    text = GOOD.replace("0 0 0 0 0 0 0 0 100", "0 0 0 0 0 0 0 10 100")
    (vehicle,) = toptw.parse(text, 1, name="x", where="x.txt").agents
    assert (vehicle.available_at, vehicle.endurance) == (10.0, 90.0)


def test_lists_of_any_length_are_skipped_and_worthless_vertices_left_out():
    """Vertex 1 has a list of two numbers, vertex 2 none."""
    mission = toptw.parse(GOOD, 1, name="x", where="x.txt")
    assert [(task.id, task.start, task.end) for task in mission.tasks] == [
        ("t001", 5.0, 60.0),
        ("t002", 0.0, 50.0),
    ]
    mission = toptw.parse(GOOD.replace("2 0 8 5 7", "2 0 8 5 0"), 1, name="x", where="x.txt")
    assert [task.id for task in mission.tasks] == ["t001"]


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (GOOD, "", "x.txt:1: the file is empty"),
        ("4 1 2 4", "hello", "x.txt:1: is 'hello'. Line 1 has four numbers"),
        ("1 3 4 10", "1 3 nan 10", "x.txt:4: y: is 'nan'. Give a finite number"),
        ("1 3 4 10", "1 3 4 ten", "x.txt:4: service: is 'ten'"),
        ("1 3 4 10 20", "1 3 4 10 -20", "x.txt:4: reward: is -20. Give 0 or more"),
        ("1 2 5 60\n", "1 2 60\n", "x.txt:4: has 10 numbers, 11 are due after a = 2"),
        ("5 60", "5 4", "x.txt:4: closing: is 4, before the opening 5"),
        ("2 0 8 5", "1 0 8 5", "x.txt:5: vertex: 1 appears twice"),
        ("\n0 0 0 0 0 0", "\n3 0 0 0 0 0", "x.txt:3: vertex: is 3. The first vertex is the depot"),
        ("0 100\n", "0 0\n", "x.txt:3: closing: is 0: no time is left"),
        ("2 0 8 5 7 1 0 0 50\n", "", "x.txt:4: the file ends after 1 vertices, line 1 promises 2"),
        ("2 0 8 5 7 1 0 0 50", "2 0 8", "x.txt:5: is '2 0 8'. A vertex has: number x y"),
    ],
)
def test_a_bad_file_is_refused_with_line_and_mend(old, new, message):
    assert old in GOOD
    with pytest.raises(InputError) as caught:
        toptw.parse(GOOD.replace(old, new, 1), 1, name="x", where="x.txt")
    assert str(caught.value).startswith(message)
    assert len(caught.value.faults) == 1


def test_every_faulty_line_is_reported_at_once():
    text = GOOD.replace("1 3 4", "1 x y").replace("2 0 8 5", "2 0 8 -5")
    with pytest.raises(InputError) as caught:
        toptw.parse(text, 1, name="x", where="x.txt")
    assert [(fault.where, fault.field) for fault in caught.value.faults] == [
        ("x.txt:4", "x"),
        ("x.txt:4", "y"),
        ("x.txt:5", "service"),
    ]


def test_a_file_of_ones_own_is_read_with_a_step_of_ones_own(tmp_path):
    """(0, 0) to (3, 5): sqrt(34) = 5.8309..., rounded down to 5.8, 5.83 or not at all."""
    text = GOOD.replace("1 3 4", "1 3 5")
    for name, step, metres in (("x", None, 5.8), ("pr99", None, 5.83), ("x", 0.0, math.sqrt(34.0))):
        path = tmp_path / f"{name}.txt"
        path.write_text(text)
        mission = toptw.read(path, 1, distance_step=step)
        assert mission.distance((0.0, 0.0, 0.0), (3.0, 5.0, 0.0)) == pytest.approx(metres, abs=1e-12)
        assert mission.name == f"{name}-1"


def test_what_cannot_be_read_is_said(tmp_path):
    with pytest.raises(InputError, match="cannot be read: No such file"):
        toptw.read(tmp_path / "none.txt", 1)
    (tmp_path / "photo.txt").write_bytes(b"\xff\xd8\xff")
    with pytest.raises(InputError, match="is not text"):
        toptw.read(tmp_path / "photo.txt", 1)
    with (tmp_path / "huge.txt").open("wb") as file:
        file.truncate(toptw.MAX_BYTES + 1)
    with pytest.raises(InputError, match="has 10,000,001 bytes"):
        toptw.read(tmp_path / "huge.txt", 1)


def test_names_and_fleets_that_are_not_published_are_refused():
    with pytest.raises(InputError, match=r"there is no 'c1O1'\. Did you mean 'c101'"):
        toptw.load("c1O1", 1)
    with pytest.raises(InputError, match=r"vehicles: is 0\. Give 1 or more"):
        toptw.load("c101", 0)
    with pytest.raises(InputError, match=r"vehicles: is 5\. Results are known for 1 to 4"):
        toptw.best_known("c101", 5)


def test_ids_keep_the_order_of_numbers():
    """Ten vehicles: v01 to v10, in order as byte strings too."""
    ids = [agent.id for agent in toptw.load("c101", 10).agents]
    assert ids == sorted(ids) and ids[0] == "v01" and ids[-1] == "v10"
    assert dataclasses.is_dataclass(toptw.known("c101", 1))
