"""The record of a run: what is written is read back, and a damaged file says what is wrong with it."""

from __future__ import annotations

import dataclasses
import io
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import jsonschema
import numpy as np
import pytest

from swarmbid import negotiator
from swarmbid.errors import InputError
from swarmbid.network import Network, Partition, make_topology
from swarmbid.scenarios import uniform
from swarmbid.simulator import simulate
from swarmbid.trace import (
    EVENT_RECORDS,
    RECORD_KINDS,
    Act,
    Agreed,
    Crashed,
    Detected,
    Divided,
    Doubted,
    Dropped,
    Ended,
    Header,
    Known,
    Other,
    Outbid,
    Pose,
    Quit,
    Released,
    Result,
    Sent,
    Stage,
    Taken,
    TraceWriter,
    Tracked,
    Truth,
    read_trace,
    trace_schema,
)

HEADER = Header(
    swarmbid="0.1",
    mission={"version": 1, "agents": [{"id": "a", "position": [0.0, 0.0, 0.0]}], "tasks": []},
    algorithm="cbba",
    options={"insertion": "hold"},
    score={"name": "time_discounted", "fuel": "start"},
    network={"topology": "ring"},
    seed=7,
    mode="asynchronous",
)
RECORDS: tuple[Known, ...] = (
    Sent(t=0.1, agent="a", sequence=3, entries=12, bytes=210, full=True, receivers=4, lost=1),
    Dropped(t=0.2, agent="a", sender="b", reason="gap"),
    Dropped(t=0.2, agent="a", reason="malformed"),
    Taken(t=0.3, agent="a", task="tü", bid=1 / 3, position=2, start=1e-300),
    Outbid(t=0.4, agent="a", task="t", bid=1.0, by="b", by_bid=1.7976931348623157e308),
    Released(t=0.5, agent="a", task="u", because="t"),
    Released(t=0.5, agent="a", task="v"),
    Agreed(t=0.6, agent="a"),
    Doubted(t=0.7, agent="a"),
    Quit(t=0.7, agent="a", task="v", filled=1),
    Act(
        t=0.7, agent="a", task="t", performative="propose", to="b", conversation="t/b/1", bid=2.5, detail="x"
    ),
    Stage(t=0.7, agent="a", task="t", role="manager", state="awarded"),
    Ended(t=0.7, agent="a", task="t", outcome="done", by="b", reason="r"),
    Pose(t=0.7, agent="a", x=1.0, y=-2.0, heading=0.5, mode="search", fuel=60.0),
    Truth(t=0.7, target="m", x=1.0, y=2.0),
    Detected(t=0.7, agent="a", task="t", x=1.0, y=2.0, moving=True, evidence="e", truth="m"),
    Tracked(t=0.7, agent="a", task="t", x=1.0, y=2.0, vx=0.1, vy=0.2, sigma=3.0),
    Divided(t=0.7, agent="a", searchers=["a", "b"], because="c"),
    Crashed(t=0.7, agent="a"),
    Result(
        t=0.8,
        status="not_converged",
        reason="cut",
        disagreements=[{"task": "t"}],
        rounds=3,
        last_bid_round=2,
        declared_round=None,
        plan={"kind": "plan"},
    ),
)
HEAD = b'{"kind":"trace","version":1,"swarmbid":"0.1","mission":{},"algorithm":"cbba"}\n'
AGREED = b'{"kind":"agreed","t":1.0,"agent":"a"}\n'
NO_JSON = "run.jsonl:1: is no swarmbid trace: its first line is no JSON object "
NO_HEADER = 'run.jsonl:1: is no swarmbid trace: its first line is not of kind "trace". '
GIVE = "Give a trace, as `swarmbid simulate --trace` writes it."


def stored(tmp_path: Path, content: bytes) -> Path:
    path = tmp_path / "run.jsonl"
    path.write_bytes(content)
    return path


def refusal(path: Path, *, partial: bool = False) -> str:
    """What reading the file is refused with, without the directory's name."""
    with pytest.raises(InputError) as caught:
        read_trace(path, partial=partial)
    return str(caught.value).replace(f"{path.parent}/", "")


# --- what is written is read


def test_every_kind_of_record_comes_back_as_it_was_written(tmp_path: Path):
    assert {HEADER.__class__, *(record.__class__ for record in RECORDS)} == set(RECORD_KINDS)
    path = tmp_path / "run.jsonl"
    with TraceWriter(path) as writer:
        for record in (HEADER, *RECORDS):
            writer.write(record)
    trace = read_trace(path)
    assert trace.source == str(path)
    assert trace.header == HEADER
    assert trace.records == RECORDS
    assert list(trace.of(Dropped)) == list(RECORDS[1:3])
    assert trace.result == trace.finished() == RECORDS[-1]
    assert [agent.id for agent in trace.mission().agents] == ["a"]


def test_each_record_is_one_line_that_starts_with_its_kind_and_time():
    file = io.BytesIO()
    with TraceWriter(file) as writer:
        for record in RECORDS:
            writer.write(record)
    lines = file.getvalue().splitlines()
    assert len(lines) == len(RECORDS)
    for line, record in zip(lines, RECORDS, strict=True):
        first, second = list(json.loads(line).items())[:2]
        assert first == ("kind", type(record).__name__.lower())
        assert second == ("t", record.t)


def test_the_bytes_are_the_same_for_a_path_a_text_and_a_binary_file_which_stay_open(tmp_path: Path):
    path = tmp_path / "run.jsonl"
    text, binary = io.StringIO(), io.BytesIO()
    with tempfile.NamedTemporaryFile("w", encoding="utf-8", dir=tmp_path) as wrapper:
        for target in (path, str(tmp_path / "other.jsonl"), text, binary, wrapper):
            with TraceWriter(target) as writer:
                writer.write(HEADER)
                writer.write(RECORDS[3])
        expected = path.read_bytes()
        assert expected.count(b"\n") == 2
        assert (tmp_path / "other.jsonl").read_bytes() == expected
        assert text.getvalue().encode() == binary.getvalue() == expected
        assert Path(wrapper.name).read_bytes() == expected
    text.write("after")  # still open: it was the caller's to close


def test_a_file_that_takes_a_few_bytes_at_a_time_still_gets_them_all():
    class Slow(io.RawIOBase):
        got = b""

        def writable(self) -> bool:
            return True

        def write(self, data) -> int:
            self.got += bytes(data[:5])
            return min(5, len(data))

    slow = Slow()
    with TraceWriter(slow) as writer:
        writer.write(RECORDS[7])
    assert slow.got == b'{"kind":"agreed","t":0.6,"agent":"a"}\n'


def test_numpy_numbers_are_written_as_plain_ones_and_other_objects_are_refused():
    file = io.StringIO()
    with TraceWriter(file) as writer:
        writer.write_fields("mine", 1.0, number=np.float64(0.5), row=np.int32(3), many=np.arange(2))
        with pytest.raises(TypeError, match="a trace cannot hold object"):
            writer.write_fields("mine", 1.0, thing=object())
    assert file.getvalue() == '{"kind":"mine","t":1.0,"number":0.5,"row":3,"many":[0,1]}\n'


def test_unknown_kinds_are_kept_and_unknown_fields_are_skipped(tmp_path: Path):
    path = tmp_path / "run.jsonl"
    with TraceWriter(path) as writer:
        writer.write(HEADER)
        writer.write_fields("weather", 2.5, wind=3.0)
        writer.write_fields("agreed", 3.0, agent="a", mood="good")
    with path.open("ab") as file:
        file.write(b'{"kind":"timeless"}\n\n{"kind":"endless","t":1' + b"0" * 400 + b"}\n")
    weather, agreed, timeless, endless = read_trace(path).records
    assert weather == Other("weather", 2.5, {"kind": "weather", "t": 2.5, "wind": 3.0})
    assert agreed == Agreed(t=3.0, agent="a")
    # Without a time that is a number, a record happened when the one before it did.
    assert (timeless.t, endless.t) == (3.0, 3.0)


# --- how a file comes by its name


def test_the_file_gets_its_name_when_the_run_is_over(tmp_path: Path):
    path, part = tmp_path / "run.jsonl", tmp_path / "run.jsonl.part"
    path.write_text("older")
    with TraceWriter(path) as writer:
        writer.write(HEADER)
        writer.flush()
        assert path.read_text() == "older"
        assert part.exists()
    assert read_trace(path).header == HEADER
    assert not part.exists()


def test_an_exception_leaves_the_part_file_and_the_older_trace(tmp_path: Path):
    path, part = tmp_path / "run.jsonl", tmp_path / "run.jsonl.part"
    path.write_text("older")
    with pytest.raises(ZeroDivisionError), TraceWriter(path) as writer:
        for record in (HEADER, *RECORDS[:4]):
            writer.write(record)
        raise ZeroDivisionError
    assert path.read_text() == "older"
    trace = read_trace(part, partial=True)
    assert trace.records == RECORDS[:4]
    assert trace.result is None
    with pytest.raises(InputError, match="has no result record: the run was stopped"):
        trace.finished()


def test_an_exception_before_the_first_record_leaves_nothing(tmp_path: Path):
    with pytest.raises(ZeroDivisionError), TraceWriter(tmp_path / "run.jsonl"):
        raise ZeroDivisionError
    assert list(tmp_path.iterdir()) == []


KILLED = """
import os, sys
from swarmbid.trace import Agreed, Header, TraceWriter
writer = TraceWriter(sys.argv[1])
writer.write(Header(swarmbid="0.1", mission={}, algorithm="cbba"))
for number in range(int(sys.argv[2])):
    writer.write(Agreed(t=float(number), agent="a" * 64))
os._exit(9)
"""


@pytest.mark.parametrize("records", [1, 30_000])
def test_a_killed_run_leaves_its_header_and_the_records_handed_on(tmp_path: Path, records: int):
    """A line is 101 bytes or more, so 30,000 of them are 3 MB, of which less than 2^20 B are in memory."""
    path, part = tmp_path / "run.jsonl", tmp_path / "run.jsonl.part"
    done = subprocess.run([sys.executable, "-c", KILLED, str(path), str(records)], check=False)
    assert done.returncode == 9
    assert not path.exists()
    trace = read_trace(part, partial=True)
    assert trace.header.algorithm == "cbba"
    assert max(0, records - 2**20 // 101 - 1) <= len(trace.records) <= records


def test_a_closed_writer_closes_again_and_refuses_to_write(tmp_path: Path):
    path = tmp_path / "run.jsonl"
    writer = TraceWriter(path)
    writer.write(HEADER)
    writer.close()
    path.rename(tmp_path / "moved")
    writer.close()
    assert not path.exists()
    with pytest.raises(ValueError, match="this trace is closed"):
        writer.write(RECORDS[0])


def test_a_link_stays_a_link_and_its_target_is_replaced(tmp_path: Path):
    link, real = tmp_path / "latest.jsonl", tmp_path / "run7.jsonl"
    real.write_text("older")
    link.symlink_to(real)
    with TraceWriter(link) as writer:
        writer.write(HEADER)
    assert link.is_symlink()
    assert read_trace(real).header == HEADER


def test_a_pipe_is_written_to_and_not_replaced(tmp_path: Path):
    """A pipe of our own and never a device: were the guard broken, root would replace /dev/null."""
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)  # else opening it for writing waits for a reader
    try:
        with TraceWriter(pipe) as writer:
            writer.write(RECORDS[7])
        assert os.read(reader, 100) == b'{"kind":"agreed","t":0.6,"agent":"a"}\n'
    finally:
        os.close(reader)
    assert pipe.is_fifo()
    assert list(tmp_path.iterdir()) == [pipe]


@pytest.mark.parametrize(
    ("name", "why"),
    [
        ("missing/run.jsonl", "No such file or directory"),
        ("", "Is a directory"),
        ("x" * 300, "File name too long"),
    ],
)
def test_a_path_that_cannot_be_written_is_refused_with_the_mend(tmp_path: Path, name: str, why: str):
    with pytest.raises(InputError) as caught:
        TraceWriter(tmp_path / name)
    mend = "Give a path in a directory that exists and that you may write to."
    assert str(caught.value) == f"{tmp_path / name}: cannot be written: {why}. {mend}"


# --- what cannot be read


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (b"", f"run.jsonl:1: is empty. {GIVE}"),
        (b'{"version": 1}\n', NO_HEADER + GIVE),
        (b"[1, 2]\n", NO_HEADER + GIVE),
        (AGREED, NO_HEADER + GIVE),
        (b"agents:\n", NO_JSON + "(JSON is malformed"),
        (b"\x1f\x8b\x08", NO_JSON + "(JSON is malformed"),
        (b'{"kind":"tr\xffce"}\n', NO_JSON + "("),
        (b"[" * 100_000, NO_JSON + "(maximum recursion"),
        (HEAD[:40], NO_JSON + "(Input data was trunc"),
        (
            HEAD.replace(b":1,", b":2,"),
            "run.jsonl:1: is a trace of version 2; this program reads version 1."
            " Read it with the version of swarmbid that wrote it, or run it again.",
        ),
        (HEAD.replace(b'"version":1,', b""), "run.jsonl:1: is a trace of version None; this program reads"),
        (
            HEAD.replace(b"{}", b"3"),
            "run.jsonl:1: is broken: Expected `object`, got `int` - at `$.mission`. Run it again.",
        ),
        (HEAD + b"what?\n" + AGREED, "run.jsonl:2: is broken: JSON is malformed"),
        (HEAD + AGREED + b"\n" + b"[]\n", "run.jsonl:4: is broken: Expected `object`, got `array`. Run it"),
        (HEAD + b'{"t":1.0}\n', "run.jsonl:2: is broken: Object missing required field `kind`. Run it"),
        (HEAD + b'{"kind":7,"t":1.0}\n', "run.jsonl:2: is broken: Expected `str` - at `$.kind`. Run it"),
        (
            HEAD + AGREED + AGREED.replace(b'"a"', b"5"),
            "run.jsonl:3: is broken: Expected `str`, got `int` - at `$.agent`. Run it again.",
        ),
        (HEAD + AGREED.replace(b'"a"', b'"\xff"'), "run.jsonl:2: is broken: "),
        (HEAD + b'{"kind":"x","z":' + b"[" * 100_000 + b"\n", "run.jsonl:2: is broken: "),
        (
            HEAD + AGREED + AGREED[:20],
            "run.jsonl:3: ends in the middle of a record: the run was stopped or the file was cut."
            " Run it again, or read the whole lines with read_trace(path, partial=True).",
        ),
    ],
)  # fmt: skip
def test_what_cannot_be_read_is_refused_with_file_line_and_mend(tmp_path: Path, content: bytes, says: str):
    assert refusal(stored(tmp_path, content)).startswith(says)


def test_paths_that_cannot_be_read_are_refused_with_the_mend(tmp_path: Path):
    mend = "Give the path of a trace file."
    assert refusal(tmp_path / "none") == f"none: cannot be read: No such file or directory. {mend}"
    (tmp_path / "folder").mkdir()
    assert refusal(tmp_path / "folder") == f"folder: cannot be read: Is a directory. {mend}"


def test_the_cut_last_line_is_left_out_when_asked_wherever_it_is_cut(tmp_path: Path):
    last = '{"kind":"agreed","t":1.0,"agent":"ü"}'.encode()
    for length in range(1, len(last)):
        path = stored(tmp_path, HEAD + AGREED + last[:length])
        assert "run.jsonl:3: ends in the middle of a record" in refusal(path)
        assert len(read_trace(path, partial=True).records) == 1
    for whole in (last, b'{"kind":"new","t":1.0}'):  # only the end of the line is missing
        path = stored(tmp_path, HEAD + AGREED + whole)
        assert len(read_trace(path).records) == len(read_trace(path, partial=True).records) == 2


def test_partial_forgives_the_last_line_only(tmp_path: Path):
    path = stored(tmp_path, HEAD + AGREED[:20] + b"\n" + AGREED)
    assert refusal(path, partial=True).startswith("run.jsonl:2: is broken: ")
    path = stored(tmp_path, HEAD + b'{"kind":"agreed","t":1.0}')
    assert refusal(path, partial=True).startswith("run.jsonl:2: is broken: Object missing required field")


# --- that it fits the negotiators and the schema


def test_every_event_of_a_negotiator_has_its_record_with_the_same_fields():
    events = [
        found
        for found in vars(negotiator).values()
        if isinstance(found, type) and issubclass(found, negotiator.Event) and found is not negotiator.Event
    ]
    assert len(events) >= 6
    assert {event.kind for event in events} == set(EVENT_RECORDS) - {"detected", "divided"}
    for event in events:
        fields = {field.name for field in dataclasses.fields(event)}
        assert set(EVENT_RECORDS[event.kind].__struct_fields__) == fields | {"t", "agent"}


def bad_weather_trace(mode: str) -> list[bytes]:
    """A real trace with every kind of record: losses for drops, a partition for doubts."""
    here = uniform.make(1, agents=6, tasks=24, bundle_limit=4)
    halves = Partition(groups=((0, 1, 2), (3, 4, 5)), start=1.0, end=40.0)
    network = Network(make_topology("ring", 6), seed=2, loss=0.3, delay=1.0, partitions=(halves,))
    file = io.BytesIO()
    simulate(here, network=network, seed=3, mode=mode, trace=file)
    return file.getvalue().splitlines(keepends=True)


@pytest.mark.parametrize("mode", ["rounds", "asynchronous"])
def test_real_traces_obey_the_schema_and_are_read_back_to_the_last_byte(tmp_path: Path, mode: str):
    validator = jsonschema.Draft202012Validator(trace_schema())
    lines = bad_weather_trace(mode)
    kinds = set()
    for line in lines:
        fields = json.loads(line)
        kinds.add(fields["kind"])
        validator.validate(fields)
    assert kinds >= {"trace", "sent", "dropped", "taken", "outbid", "released", "agreed", "result"}
    path = stored(tmp_path, b"".join(lines))
    trace = read_trace(path)
    copy = io.BytesIO()
    with TraceWriter(copy) as writer:
        writer.write(trace.header)
        for record in trace.records:
            assert not isinstance(record, Other)
            writer.write(record)
    assert copy.getvalue() == path.read_bytes()


@pytest.mark.parametrize(
    "wrong",
    [
        {"kind": "agreed", "t": 1.0},
        {"kind": "agreed", "agent": "a"},
        {"kind": "agreed", "t": "soon", "agent": "a"},
        {"kind": "unheard_of", "t": 1.0, "agent": "a"},
        {"t": 1.0, "agent": "a"},
        {"kind": "taken", "t": 1.0, "agent": "a", "task": "t", "bid": None, "position": 0, "start": 1.0},
        {"kind": "result", "t": 1.0, "status": "perhaps"},
        ["kind", "agreed"],
    ],
)
def test_the_schema_refuses_what_is_no_record(wrong: object):
    schema = trace_schema()
    jsonschema.Draft202012Validator.check_schema(schema)
    validator = jsonschema.Draft202012Validator(schema)
    assert validator.is_valid({"kind": "agreed", "t": 1.0, "agent": "a"})
    assert not validator.is_valid(wrong)
