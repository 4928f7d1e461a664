"""CBGA as printed: golden conversations, its messages, its options, and where it meets CBBA.

The rules themselves, one by one, are in `paper/test_hunt2014.py`.
"""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import datadriven
from swarmbid import registry
from swarmbid.algorithms._printed import terms_of
from swarmbid.algorithms.cbba import CBBA
from swarmbid.algorithms.cbga_printed import CBGAPrinted
from swarmbid.arrays import MissionArrays
from swarmbid.errors import InputError
from swarmbid.kernels.printed import complete
from swarmbid.messages import INCARNATION, NOT_LISTED, MessageError, decode, encode
from swarmbid.messages.assignments import Assignments
from swarmbid.model import Agent, Mission, Task
from swarmbid.negotiator import MessageDropped
from swarmbid.network import Network, make_topology
from swarmbid.rng import stream
from swarmbid.scores import make_score
from swarmbid.simulator import simulate
from swarmbid.testing._team import Team

FILES = sorted((Path(__file__).parent / "testdata" / "cbga_printed").glob("*.txt"))
SCORE = make_score("distance_cost")
NO_ROWS = np.zeros(0, np.int32)
NO_STAMPS = np.zeros(0, np.int64)


class Conversation(datadriven.Conversation):
    """The commands of `datadriven`, where a message is a matrix.

    tell AGENT from SENDER [@STAMP]    lines ``TASK AGENT BID [ARRIVAL]`` and ``heard AGENT@STAMP ...``
    intends AGENT                      its path, with groups that are not complete
    """

    def __init__(self) -> None:
        self.algorithm = CBGAPrinted
        self.now = 0.0

    def do_intends(self, words: list[str], details: list[str]) -> list[str]:
        return [" ".join(self.agents[words[0]].intended) or "nothing"]

    def do_tell(self, words: list[str], details: list[str]) -> list[str]:
        receiver, _, sender, *more = words
        before = self.agents[receiver].beliefs()
        self.agents[receiver].receive(self._written(sender, more, details), self.now)
        after = self.agents[receiver].beliefs()
        lines = [
            f"{name}: {datadriven.belief_text(before[name])} -> {datadriven.belief_text(after[name])}"
            if before[name] != after[name]
            else f"{name}: stays {datadriven.belief_text(after[name])}"
            for name in after
        ]
        return lines + self._events(receiver)

    def _written(self, sender: str, words: list[str], details: list[str]) -> Assignments:
        sequence = self.told.get(sender, INCARNATION) + 1
        if words:
            sequence = datadriven.stamp_of(words[0].removeprefix("@"))
        self.told[sender] = sequence
        rows = self.arrays
        heard = np.full(rows.num_agents, NOT_LISTED, np.int64)
        heard[rows.agent_row[sender]] = sequence
        cells = []
        for detail in details:
            first, *rest = detail.split()
            if first == "heard":
                for word in rest:
                    name, _, stamp = word.partition("@")
                    heard[rows.agent_row[name]] = datadriven.stamp_of(stamp)
            else:
                cells.append((rows.task_row[first], rows.agent_row[rest[0]], *map(float, rest[1:])))
        return assignments(
            rows,
            sender=sender,
            sequence=sequence,
            heard=heard,
            cells=[(*cell, 0.0)[:4] for cell in cells],
        )

    def _message_text(self, message: Assignments) -> str:
        parts = [
            f"{message.task_ids[row]} {message.agent_ids[who]} {bid:.6g}" + f" at {when:g} s" * (when > 0.0)
            for row, who, bid, when in zip(
                message.tasks.tolist(), message.holders.tolist(), message.bids.tolist(),
                message.arrivals.tolist(), strict=True,
            )
        ]  # fmt: skip
        stamps = [
            f"{name}@{datadriven.stamp_text(stamp)}"
            for name, stamp in zip(message.agent_ids, message.heard.tolist(), strict=True)
            if stamp != NOT_LISTED
        ]
        parts.append("heard " + " ".join(stamps))
        if message.settled:
            parts.append("settled")
        return f"{datadriven.stamp_text(message.sequence)}: " + "; ".join(parts)


def assignments(
    arrays: MissionArrays,
    *,
    sender: str = "b",
    sequence: int = INCARNATION + 1,
    heard: Any = None,
    cells: list[Any] = (),  # type: ignore[assignment]
    **changes: Any,
) -> Assignments:
    """A message written by hand; `cells` : (task row, agent row, bid, arrival)."""
    columns = list(zip(*cells, strict=True)) or [(), (), (), ()]
    stamps = np.full(arrays.num_agents, NOT_LISTED, np.int64) if heard is None else heard
    stamps[arrays.agent_row[sender]] = sequence
    message: dict[str, Any] = {
        "sender": sender, "sequence": sequence, "agent_ids": arrays.agent_ids, "task_ids": arrays.task_ids,
        "heard": stamps, "tasks": np.array(columns[0], np.int32), "holders": np.array(columns[1], np.int32),
        "bids": np.array(columns[2], float), "arrivals": np.array(columns[3], float),
        "digest": 7, "digest_at": sequence, "agreed": NO_ROWS, "agreed_at": NO_STAMPS,
        "left": NO_ROWS, "left_at": NO_STAMPS,
    }  # fmt: skip
    return Assignments(**{**message, **changes})


# --- golden conversations


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_the_agents_say_what_the_file_says(path: Path, rewrite: bool):
    text, played = datadriven.run_file(path, Conversation(), rewrite=rewrite)
    assert "no agreement" not in played  # --rewrite must not bury it
    assert rewrite or played == text


# --- messages


def two_agents(**fields: Any) -> Mission:
    """Agents a and b, 10 m from each other, and a task for both between them; t2 is far away."""
    return Mission(
        agents=(Agent(id="a", position=(0.0, 0.0, 0.0)), Agent(id="b", position=(10.0, 0.0, 0.0))),
        tasks=(
            Task(id="t1", position=(5.0, 0.0, 0.0), reward=20.0, agents_required=2, **fields),
            Task(id="t2", position=(500.0, 0.0, 0.0), reward=20.0, agents_required=2),
        ),
    )


@given(st.data())
def test_a_message_comes_back_from_its_bytes(data: st.DataObject):
    """Cells, stamps and times, whatever they are; on the wire are only ids that are mentioned."""
    num_tasks, num_agents = data.draw(st.integers(1, 5)), data.draw(st.integers(1, 5))
    cells = data.draw(
        st.lists(
            st.tuples(
                st.integers(0, num_tasks - 1), st.integers(0, num_agents - 1),
                st.floats(0.0, 1e12, exclude_min=True), st.floats(0.0, 1e6),
            ),
            unique_by=lambda cell: cell[:2],
        )
    )  # fmt: skip
    stamps = st.one_of(st.just(NOT_LISTED), st.integers(0, 1 << 40))
    heard = np.array(data.draw(st.lists(stamps, min_size=num_agents, max_size=num_agents)), np.int64)
    agreed = np.array(sorted(data.draw(st.sets(st.integers(0, num_agents - 1)))), np.int32)
    columns = list(zip(*cells, strict=True)) or [(), (), (), ()]
    said = Assignments(
        sender="a0", sequence=INCARNATION + 9, agent_ids=tuple(f"a{row}" for row in range(num_agents)),
        task_ids=tuple(f"t{row}" for row in range(num_tasks)), heard=heard,
        tasks=np.array(columns[0], np.int32), holders=np.array(columns[1], np.int32),
        bids=np.array(columns[2], float), arrivals=np.array(columns[3], float), digest=2**64 - 1,
        digest_at=3, agreed=agreed, agreed_at=np.arange(agreed.size, dtype=np.int64),
        left=NO_ROWS, left_at=NO_STAMPS, settled=data.draw(st.booleans()),
    )  # fmt: skip
    read = decode(encode(said))
    assert isinstance(read, Assignments)
    assert encode(read) == encode(said)
    assert read.full and read.entries == len(cells)
    assert matrix(read) == matrix(said)
    assert heard_by_id(read) == heard_by_id(said)
    for name in ("sender", "sequence", "digest", "digest_at", "settled"):
        assert getattr(read, name) == getattr(said, name)
    assert [read.agent_ids[row] for row in read.agreed] == [said.agent_ids[row] for row in said.agreed]
    assert set(read.task_ids) == {said.task_ids[row] for row in said.tasks}


def matrix(message: Assignments) -> dict[tuple[str, str], tuple[float, float]]:
    return {
        (message.task_ids[row], message.agent_ids[who]): (bid, when)
        for row, who, bid, when in zip(
            message.tasks, message.holders, message.bids.tolist(), message.arrivals.tolist(), strict=True
        )
    }


def heard_by_id(message: Assignments) -> dict[str, int]:
    return {
        name: stamp
        for name, stamp in zip(message.agent_ids, message.heard.tolist(), strict=True)
        if stamp != NOT_LISTED
    }


def test_a_triple_costs_ten_bytes_on_the_wire_without_times_and_eighteen_with():
    """A bid of 8, two rows of 1 each; a time is 8 more (b"" of 2 bytes becomes 2 + 16 for two triples).

    The ids stand once, however many triples mention them; both agents are mentioned in either message.
    """
    arrays = MissionArrays(two_agents())
    sizes = {
        (count, late): len(encode(assignments(arrays, cells=[(0, m, 5.0, late) for m in range(count)])))
        for count in (1, 2)
        for late in (0.0, 3.0)
    }
    assert sizes[1, 3.0] - sizes[1, 0.0] == 8
    assert sizes[2, 3.0] - sizes[2, 0.0] == 16
    assert sizes[2, 0.0] - sizes[1, 0.0] == 10


def broken(**changes: Any) -> bytes:
    arrays = MissionArrays(two_agents())
    message = assignments(arrays, cells=[(0, 0, 5.0, 1.0), (0, 1, 6.0, 2.0)])
    for name, value in changes.items():
        object.__setattr__(message, name, value)  # past the check, as a faulty peer would
    return encode(message)


@pytest.mark.parametrize(
    ("reason", "changes"),
    [
        ("bid", {"bids": np.array([np.nan, 1.0])}),
        ("bid", {"bids": np.array([-1.0, 1.0])}),
        ("time", {"arrivals": np.array([np.inf, 1.0])}),
        ("malformed", {"bids": np.array([1.0])}),
        ("malformed", {"holders": np.array([0, 0], np.int32)}),
        ("malformed", {"tasks": np.array([0], np.int32)}),
        ("malformed", {"left": np.array([0], np.int32)}),
        ("stamp", {"sequence": 0}),
        ("id", {"sender": "no id"}),
    ],
)
def test_bytes_that_cannot_be_a_message_are_refused_with_a_reason(reason: str, changes: dict[str, Any]):
    with pytest.raises(MessageError) as refused:
        decode(broken(**changes))
    assert refused.value.reason == reason


def test_columns_of_unequal_length_make_no_message():
    with pytest.raises(MessageError, match="differ in length"):
        assignments(MissionArrays(two_agents()), cells=[(0, 0, 5.0, 1.0)], bids=np.zeros(2))


def test_a_message_of_another_algorithm_is_dropped():
    arrays = MissionArrays(two_agents())
    one = CBGAPrinted("a", arrays)
    beliefs = CBBA("b", MissionArrays(dataclasses.replace(two_agents(), tasks=()))).tick(0.0)[0]
    one.receive(beliefs, 0.0)
    assert one.events() == [MessageDropped("b", "malformed")]


def test_a_message_about_what_is_not_known_is_dropped_and_changes_nothing():
    arrays = MissionArrays(two_agents())
    one = CBGAPrinted("a", arrays)
    digest = one.digest
    for number, strange in enumerate(({"task_ids": ("t1", "x")}, {"agent_ids": ("x", "b")})):
        one.receive(
            assignments(arrays, sequence=INCARNATION + 1 + number, cells=[(0, 1, 9.0, 0.0)], **strange), 0.0
        )
        assert one.events() == [MessageDropped("b", "unknown_id")]
    assert one.digest == digest
    one.receive(assignments(arrays, cells=[(0, 1, 9.0, 0.0)]), 0.0)
    assert one.beliefs()["t1"] == (("b", 9.0),)


# --- the whole of it


def test_it_is_found_by_its_name():
    assert registry.load_class("algorithms", "cbga_printed", CBGAPrinted) is CBGAPrinted
    assert registry.summary("algorithms", "cbga_printed").startswith("CBGA as printed")


def single_seats(seed: int) -> Mission:
    rng = stream(seed, "single_seats")
    places = rng.uniform(0.0, 100.0, (16, 2)).tolist()
    return Mission(
        agents=tuple(Agent(id=f"a{row}", position=(*places[row], 0.0), speed=2.0) for row in range(5)),
        tasks=tuple(
            Task(id=f"t{row}", position=(*places[5 + row], 0.0), reward=150.0, duration=3.0)
            for row in range(11)
        ),
    )


@pytest.mark.parametrize("shape", ["complete", "line", "ring"])
def test_with_one_seat_a_task_it_is_cbba(shape: str):
    """The incremental, warped one that sends its full state every round: the same bids in the end."""
    for seed in range(4):
        mission = single_seats(seed)
        runs = [
            simulate(
                mission, algorithm=name, score="distance_cost", network=Network(make_topology(shape, 5)),
                **options,
            )
            for name, options in (
                ("cbba", {"rebuild": False, "full_every": 1, "idle_every": 1}),
                ("cbga_printed", {"warp": True}),
            )
        ]  # fmt: skip
        assert [run.status for run in runs] == ["converged", "converged"]
        assert runs[0].negotiators[0].beliefs() == runs[1].negotiators[0].beliefs()
        assert runs[0].paths == runs[1].paths


def test_without_warping_single_seats_cycle_and_with_it_they_do_not():
    """Gains of distance cost rise along a path: nothing bounds the bids of what is built on a lost task."""
    ends = {
        warp: [
            simulate(
                single_seats(seed), algorithm="cbga_printed", score="distance_cost", warp=warp, max_rounds=80
            ).status
            for seed in range(8)
        ]
        for warp in (False, True)
    }
    assert set(ends[True]) == {"converged"}
    assert "not_converged" in ends[False]


def test_the_literal_reading_cannot_agree_on_a_group_when_there_is_one_agent_more_than_seats():
    mission = Mission(
        agents=tuple(Agent(id=name, position=(float(k), 0.0, 0.0)) for k, name in enumerate("abc")),
        tasks=(Task(id="t", position=(9.0, 0.0, 0.0), reward=50.0, agents_required=2),),
    )
    ends = {
        reading: simulate(
            mission, algorithm="cbga_printed", score="distance_cost", reading=reading, max_rounds=60
        )
        for reading in ("literal", "charitable")
    }
    assert ends["literal"].status == "not_converged"
    assert ends["charitable"].status == "converged"
    # c is 7 m away, b 8 m and a 9 m.
    assert ends["charitable"].negotiators[0].beliefs() == {"t": (("b", 42.0), ("c", 43.0))}
    assert {name: [task for task, _ in path] for name, path in ends["charitable"].paths.items()} == {
        "a": [], "b": ["t"], "c": ["t"],
    }  # fmt: skip


def crowded(seed: int) -> Mission:
    """Six agents with equipment a or b, ten tasks for one to three of them, half of them after another."""
    rng = stream(seed, "crowded")
    places = rng.uniform(0.0, 60.0, (16, 2)).tolist()
    needs = [frozenset(), frozenset("a"), frozenset("ab")]
    kinds = rng.integers(0, 3, 10).tolist()
    return Mission(
        agents=tuple(
            Agent(id=f"a{row}", position=(*places[row], 0.0), equipment=frozenset("ab"[row % 2]))
            for row in range(6)
        ),
        tasks=tuple(
            Task(
                id=f"t{row}", position=(*places[6 + row], 0.0), reward=120.0,
                agents_required=1 + kinds[row], equipment=needs[kinds[row]],
                prerequisites=(f"t{row - 1}",) if row % 2 else (),
            )
            for row in range(10)
        ),
    )  # fmt: skip


@pytest.mark.parametrize("reading", ["literal", "charitable"])
def test_no_matrix_ever_holds_more_bids_for_a_task_than_it_has_seats(reading: str):
    """At every agent, in every round, settled or not; and in the charitable reading only groups that can
    still be completed, so that no seat is ever wasted on what somebody else brings already."""
    for seed in range(3):
        team = Team(lambda name, mission: CBGAPrinted(name, mission, SCORE, reading=reading), crowded(seed))
        carried = {one.id: one.equipment for one in team.mission.agents}
        for _ in range(25):
            team.round()
            for one in team.agents.values():
                for task in team.mission.tasks:
                    members = [name for name, _ in one.beliefs()[task.id]]
                    assert len(members) <= task.agents_required
                    missing = task.equipment.difference(*(carried[name] for name in members))
                    free = task.agents_required - len(members)
                    # Every agent carries one thing, so each thing that is missing takes a seat.
                    assert reading == "literal" or len(missing) <= free


@pytest.mark.parametrize("options", [{"reading": "literal"}, {"warp": True, "team_rewards": True}])
def test_the_same_run_says_the_same_bytes_twice(options: dict[str, Any]):
    mission = two_agents()
    said = []
    for through_bytes in (False, True):
        run = simulate(
            mission, algorithm="cbga_printed", score="distance_cost", through_bytes=through_bytes,
            max_rounds=20, **options,
        )  # fmt: skip
        said.append(
            (run.messages, run.bytes, run.entries, run.paths, [one.digest for one in run.negotiators])
        )
    assert said[0] == said[1]


def test_an_agent_that_will_quit_does_not_agree_yet():
    """t1 needs three, there are two: all hold the same bids, and still wait for δ = 6 s.

    At 7 s both quit; with nothing left they agree.
    """
    mission = two_agents()
    mission = dataclasses.replace(mission, tasks=(dataclasses.replace(mission.tasks[0], agents_required=3),))
    run = simulate(
        mission,
        algorithm="cbga_printed",
        score="distance_cost",
        quitting=True,
        quit_after=6.0,
        reading="literal",
    )
    assert run.status == "converged"
    assert run.negotiators[0].beliefs() == {"t1": ()}
    assert run.declared_round is not None and run.declared_round > 7
    stays = simulate(mission, algorithm="cbga_printed", score="distance_cost", reading="literal")
    assert stays.negotiators[0].beliefs() == {"t1": (("a", 15.0), ("b", 15.0))}
    assert stays.paths == {"a": [], "b": []}


def test_a_late_task_is_given_up_only_if_asked_for():
    """b comes to t1 after 400 s, and t1 closes at 300 s."""
    for release_late, bundle in ((False, ["t1"]), (True, [])):
        arrays = MissionArrays(two_agents(end=300.0))
        one = CBGAPrinted("a", arrays, "distance_cost", release_late=release_late)
        one.tick(0.0)
        assert one.bundle == ["t1"]
        one.receive(assignments(arrays, cells=[(0, 1, 9.0, 400.0)]), 0.0)
        one.tick(1.0)
        assert one.bundle == bundle


# --- what it refuses


def test_options_that_do_not_fit_are_all_named():
    with pytest.raises(InputError) as refused:
        CBGAPrinted(
            "x", two_agents(), "distance_cost", reading="loose", quit_after=0.0, insertion="hold", period=0.0
        )
    names = {fault.field for fault in refused.value.faults}
    assert {"id", "reading", "quit_after", "insertion"} <= names


def test_a_score_of_ones_own_is_refused():
    with pytest.raises(InputError, match="of your own"):
        CBGAPrinted("a", two_agents(), make_score(lambda visit: visit.reward - visit.leg))


def test_a_task_that_leaves_its_seats_open_is_refused():
    task = Task(id="t", position=(0.0, 0.0, 0.0), agents_required=0, equipment=frozenset("k"))
    mission = dataclasses.replace(two_agents(), tasks=(task,))
    assert CBGAPrinted.unsupported(mission) == ["task t leaves open how many agents do it"]
    with pytest.raises(InputError, match="leaves open"):
        CBGAPrinted("a", mission)


def test_more_equipment_than_the_table_of_subsets_holds_is_refused():
    kinds = [frozenset(f"e{number}" for number in range(count)) for count in (16, 17)]
    missions = [
        dataclasses.replace(
            two_agents(), tasks=(Task(id="t", position=(0.0, 0.0, 0.0), agents_required=2, equipment=kind),)
        )
        for kind in kinds
    ]
    assert [len(CBGAPrinted.unsupported(mission)) for mission in missions] == [0, 1]


def test_a_full_group_is_complete_only_with_all_its_equipment():
    """The rules never fill a group without it; a vehicle that starts a task all the same can."""
    arrays = MissionArrays(
        Mission(
            agents=tuple(
                Agent(id=name, position=(0.0, 0.0, 0.0), equipment=frozenset(letters))
                for name, letters in (("a", "k"), ("b", "k"), ("c", "w"))
            ),
            tasks=(Task(id="t", position=(0.0, 0.0, 0.0), agents_required=2, equipment=frozenset("kw")),),
        )
    )
    terms = terms_of(arrays, make_score())
    assert not complete(terms, np.array([[1.0, 1.0, 0.0]]), 0)
    assert complete(terms, np.array([[1.0, 0.0, 1.0]]), 0)
    assert not complete(terms, np.array([[1.0, 0.0, 0.0]]), 0)


# --- local commands where a group is concerned


def group_in_hand() -> tuple[CBGAPrinted, MissionArrays]:
    arrays = MissionArrays(two_agents())
    one = CBGAPrinted("a", arrays, "distance_cost")
    one.tick(0.0)
    one.receive(assignments(arrays, cells=[(0, 1, 15.0, 9.0)]), 0.0)
    one.tick(1.0)
    assert one.path == [("t1", 9.0)]  # b is there at 9 s
    one.events()
    return one, arrays


def test_losing_a_member_opens_its_seat():
    one, _ = group_in_hand()
    one.lose_agent("b")
    assert one.beliefs()["t1"] == (("a", 15.0),)
    one.tick(2.0)
    assert one.path == []


def test_what_others_say_of_a_cancelled_task_is_not_believed():
    one, arrays = group_in_hand()
    one.cancel_task("t1")
    one.receive(assignments(arrays, sequence=INCARNATION + 2, cells=[(0, 1, 15.0, 5.0)]), 2.0)
    one.tick(2.0)
    assert one.beliefs()["t1"] == ()
    assert one.path == []


def test_a_task_started_by_a_group_stays_with_both():
    one, arrays = group_in_hand()
    one.start_task("t1", 9.5)
    one.receive(assignments(arrays, sequence=INCARNATION + 2, cells=[(0, 1, 15.0, 9.0)]), 9.5)
    (message,) = one.tick(10.0)
    assert one.path == [("t1", 9.5)]
    assert matrix(message)["t1", "a"][1] == 9.5  # type: ignore[arg-type]
    assert [name for name, _ in one.beliefs()["t1"]] == ["a", "b"]


def test_an_added_task_leaves_the_group_and_its_rows_as_they_were():
    one, _ = group_in_hand()
    one.add_task(Task(id="t0", position=(400.0, 0.0, 0.0), reward=1.0))
    one.tick(2.0)
    assert one.path == [("t1", 9.0)]
    assert one.beliefs() == {"t0": (), "t1": (("a", 15.0), ("b", 15.0)), "t2": ()}
