"""CBGA: golden conversations, its messages, and what it refuses."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import datadriven
from coalition_missions import missions
from swarmbid.algorithms.cbba import CBBA
from swarmbid.algorithms.cbga import CBGA
from swarmbid.errors import InputError
from swarmbid.messages import NOBODY, MessageError, Records, decode, encode
from swarmbid.messages.records import DONE, STARTED, Record
from swarmbid.model import Agent, Mission, Task
from swarmbid.negotiator import MessageDropped, TaskQuit
from swarmbid.network import Network, make_topology
from swarmbid.simulator import simulate

FILES = sorted((Path(__file__).parent / "testdata" / "cbga").glob("*.txt"))
AT = (0.0, 0.0, 0.0)
NO_ROWS = np.zeros(0, np.int32)
PAIRS = Mission(
    agents=tuple(Agent(id=name, position=AT) for name in "abc"),
    tasks=tuple(Task(id=name, position=(3.0, 4.0, 0.0), reward=9.0, agents_required=2) for name in "tu"),
)


class Conversation(datadriven.Conversation):
    """The commands of `datadriven`, where a message is a set of records."""

    def __init__(self) -> None:
        self.algorithm = CBGA
        self.now = 0.0

    def _message_text(self, message: Records) -> str:
        parts = []
        for owner, record in zip(message.owners.tolist(), message.records, strict=True):
            bids = [
                f"{message.task_ids[task]} {bid:.6g}"
                + (f" behind {message.agent_ids[lead]}" if lead != NOBODY else "")
                for task, bid, lead in zip(
                    record.tasks.tolist(), record.bids.tolist(), record.leads.tolist(), strict=True
                )
            ]
            stamp = datadriven.stamp_text(record.stamp)
            parts.append(f"{message.agent_ids[owner]}@{stamp} bids " + (", ".join(bids) or "nothing"))
        if message.full:
            known = [
                f"{name}@{datadriven.stamp_text(stamp)}"
                for name, stamp in zip(message.agent_ids, message.known.tolist(), strict=True)
                if stamp
            ]
            parts.append("knows " + " ".join(known))
        bars = [
            f"{message.agent_ids[agent]} from {message.task_ids[task]}"
            for agent, task in zip(message.barred_agents.tolist(), message.barred_tasks.tolist(), strict=True)
        ]
        if bars:
            parts.append("bars " + ", ".join(bars))
        for label, rows in (("agreeing", message.agreed), ("gone", message.left)):
            if rows.size:
                parts.append(label + " " + " ".join(message.agent_ids[row] for row in rows.tolist()))
        if message.settled:
            parts.append("settled")
        return f"{datadriven.stamp_text(message.sequence)}: " + ("; ".join(parts) or "nothing")


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_the_agents_say_what_the_file_says(path: Path, rewrite: bool):
    written, played = datadriven.run_file(path, Conversation(), rewrite=rewrite)
    assert "no agreement" not in played  # --rewrite must not bury it
    assert rewrite or played == written


def record(**changes) -> Record:
    fields = {
        "stamp": 7,
        "states": np.zeros(2, np.int8),
        "tasks": np.array([1, 0], np.int32),
        "bids": np.array([5.0, 3.0]),
        "gains": np.array([5.0, 4.0]),
        "positions": np.array([0, 1], np.int32),
        "leads": np.array([NOBODY, 1], np.int32),
    }
    return Record(**{**fields, **changes})


def message(*records: Record, **changes) -> Records:
    fields = {
        "sender": "b",
        "sequence": 9,
        "agent_ids": ("a", "b", "c"),
        "task_ids": ("t", "u"),
        "owners": np.arange(len(records), dtype=np.int32),
        "records": records,
        "known": np.zeros(0, np.int64),
        "near": NO_ROWS,
        "barred_tasks": NO_ROWS,
        "barred_agents": NO_ROWS,
        "context": 5,
        "digest": 2**64 - 1,
        "digest_at": 9,
        "agreed": NO_ROWS,
        "agreed_at": np.zeros(0, np.int64),
        "settled": False,
        "left": NO_ROWS,
        "left_at": np.zeros(0, np.int64),
    }
    return Records(**{**fields, **changes})


def told(one: Records) -> tuple:
    """Everything that a message says, by id."""

    def ids(rows) -> list[str]:
        return [one.agent_ids[row] for row in rows.tolist()]

    said = []
    for owner, item in zip(ids(one.owners), one.records, strict=True):
        leads = [None if row == NOBODY else one.agent_ids[row] for row in item.leads.tolist()]
        tasks = [one.task_ids[row] for row in item.tasks.tolist()]
        columns = (item.states.tolist(), item.bids.tolist(), item.gains.tolist(), item.positions.tolist())
        said.append((owner, item.stamp, tasks, leads, *columns, item.place))
    known = dict(zip(one.agent_ids, one.known.tolist(), strict=True)) if one.full else None
    bars = [
        (one.agent_ids[a], one.task_ids[t]) for a, t in zip(one.barred_agents, one.barred_tasks, strict=True)
    ]
    return (
        one.sender, one.sequence, said, known, ids(one.near), bars, one.context, one.digest, one.digest_at,
        ids(one.agreed), one.agreed_at.tolist(), one.settled, ids(one.left), one.left_at.tolist(),
    )  # fmt: skip


@pytest.mark.parametrize(
    "one",
    [
        message(),
        message(record()),
        message(record(leads=np.full(2, NOBODY, np.int32), gains=np.array([5.0, 3.0]))),
        message(record(), record(stamp=8, place=(1.0, 2.0, 3.0, 4.0, float("inf")))),
        message(record(states=np.array([DONE, STARTED], np.int8)), known=np.array([7, 0, 2**40])),
        message(record(positions=np.array([0, 700], np.int32)), near=np.array([0, 2], np.int32)),
        message(barred_tasks=np.array([1], np.int32), barred_agents=np.array([2], np.int32), settled=True),
        message(agreed=np.array([2, 0], np.int32), agreed_at=np.array([4, 2**33])),
        message(left=np.array([1], np.int32), left_at=np.array([2**33 - 1])),
    ],
)  # fmt: skip
def test_what_is_read_back_is_what_was_said(one: Records):
    assert told(decode(encode(one))) == told(one)


@given(data=st.data())
def test_mangled_bytes_are_refused_or_make_a_message(data):
    wire = bytearray(encode(message(record(), record(stamp=8), known=np.array([7, 8, 1]))))
    for _ in range(data.draw(st.integers(1, 4))):
        wire[data.draw(st.integers(0, len(wire) - 1))] = data.draw(st.integers(0, 255))
    try:
        found = decode(bytes(wire))
    except MessageError as error:
        assert error.reason
    else:
        agent = CBGA("a", PAIRS)
        agent.receive(found, 1.0)
        agent.tick(2.0)


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"bids": np.array([5.0, float("nan")])}, "bid"),
        ({"bids": np.array([5.0, -1.0])}, "bid"),
        ({"gains": np.array([5.0, float("inf")])}, "bid"),
        ({"place": (0.0, float("nan"), 0.0, 0.0, 1.0)}, "place"),
        ({"place": (0.0, 0.0, 0.0, 0.0, float("nan"))}, "place"),
    ],
)
def test_numbers_that_are_none_are_refused(changes, reason):
    with pytest.raises(MessageError) as error:
        record(**changes)
    assert error.value.reason == reason


def test_what_is_under_way_has_to_come_first():
    with pytest.raises(MessageError, match="does not come first"):
        decode(encode(message(record(states=np.array([0, STARTED], np.int8)))))


def test_a_record_of_more_than_its_agent_may_take_is_dropped():
    """Two tasks are all there are: a record of three would only make room that nobody needs."""
    agent = CBGA("a", PAIRS)
    rows = np.array([0, 1, 0], np.int32)
    three = record(
        states=np.zeros(3, np.int8), tasks=rows, bids=np.ones(3), gains=np.ones(3), positions=rows,
        leads=np.full(3, NOBODY, np.int32),
    )  # fmt: skip
    before = agent.digest
    agent.receive(message(three), 1.0)
    assert agent.events() == [MessageDropped("b", "bundle")]
    assert agent.digest == before


def test_a_message_of_another_algorithm_is_dropped():
    mission = missions(3, "single")
    said = CBBA("a1", mission).tick(0.0)[0]
    agent = CBGA("a0", mission)
    agent.receive(said, 1.0)
    assert agent.events() == [MessageDropped("a1", "malformed")]


@pytest.mark.parametrize(
    ("options", "field"),
    [
        ({"insertion": "hold"}, "insertion"),
        ({"quit_after": 0.0}, "quit_after"),
        ({"dissolve": 1.5}, "dissolve"),
        ({"idle_every": 0}, "idle_every"),
        ({"score": lambda visit: visit.reward}, "score"),
    ],
)
def test_options_that_mean_nothing_are_refused(options, field):
    with pytest.raises(InputError, match=field):
        CBGA("a0", missions(3, "single"), **options)


def test_more_kinds_of_equipment_than_the_referee_keeps_are_refused():
    everything = frozenset(f"piece{number}" for number in range(17))
    mission = Mission(
        agents=(Agent(id="a", position=AT, equipment=everything),),
        tasks=(Task(id="t", position=AT, equipment=everything),),
    )
    with pytest.raises(InputError, match="task t needs more than 16 kinds of equipment"):
        simulate(mission, algorithm="cbga")


def test_each_member_hears_that_its_group_is_dissolved():
    """Two agents, three seats: each quits once, and the group had two."""
    mission = Mission(
        agents=tuple(Agent(id=name, position=AT) for name in "ab"),
        tasks=(Task(id="t", position=AT, reward=9.0, agents_required=3),),
    )
    one, other = CBGA("a", mission), CBGA("b", mission)
    events = {"a": [], "b": []}
    for now in range(8):
        said = one.tick(float(now)), other.tick(float(now))
        for message_ in said[0]:
            other.receive(message_, now + 0.5)
        for message_ in said[1]:
            one.receive(message_, now + 0.5)
        events["a"] += one.events()
        events["b"] += other.events()
    for heard in events.values():
        assert [event for event in heard if isinstance(event, TaskQuit)] == [TaskQuit("t", 2)]
    assert one.agreed and other.agreed and one.bundle == [] and one.path == []


def test_the_bytes_make_no_difference():
    for seed in range(4):
        mission = missions(seed, "ABC")
        runs = [
            simulate(
                mission,
                algorithm="cbga",
                through_bytes=through,
                network=Network(make_topology("line", len(mission.agents)), loss=0.2, delay=1.0, seed=seed),
            )
            for through in (False, True)
        ]
        assert runs[0].paths == runs[1].paths
        assert (runs[0].messages, runs[0].bytes) == (runs[1].messages, runs[1].bytes)
