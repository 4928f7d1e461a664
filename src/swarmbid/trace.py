"""The record of a run: one JSON object a line, written by every driver, read by everything else.

The first line is the `Header` (the whole mission, the options, the seed), the last the `Result`;
between them stands what happened, in order. Each record is a frozen struct below, so the file's
schema is written once: `trace_schema` prints it.

The format is version 1 and grows by appending only: new kinds of record and new fields with a
default. A reader keeps kinds that it does not know (`Other`) and skips fields that it does not know.
"""

from __future__ import annotations

import io
import sys
from collections.abc import Iterator
from contextlib import nullcontext
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from types import TracebackType
from typing import IO, TYPE_CHECKING, Any, TypeVar

import msgspec
from msgspec import Struct

from swarmbid.errors import Fault, InputError
from swarmbid.tracerecords import RECORD_KINDS as RECORD_KINDS
from swarmbid.tracerecords import TRACE_VERSION as TRACE_VERSION
from swarmbid.tracerecords import Act as Act
from swarmbid.tracerecords import Agreed as Agreed
from swarmbid.tracerecords import Crashed as Crashed
from swarmbid.tracerecords import Detected as Detected
from swarmbid.tracerecords import Divided as Divided
from swarmbid.tracerecords import Doubted as Doubted
from swarmbid.tracerecords import Dropped as Dropped
from swarmbid.tracerecords import Ended as Ended
from swarmbid.tracerecords import Header as Header
from swarmbid.tracerecords import Known as Known
from swarmbid.tracerecords import Outbid as Outbid
from swarmbid.tracerecords import Pose as Pose
from swarmbid.tracerecords import Quit as Quit
from swarmbid.tracerecords import Released as Released
from swarmbid.tracerecords import Result as Result
from swarmbid.tracerecords import Sent as Sent
from swarmbid.tracerecords import Stage as Stage
from swarmbid.tracerecords import Taken as Taken
from swarmbid.tracerecords import Tracked as Tracked
from swarmbid.tracerecords import Truth as Truth

if TYPE_CHECKING:
    from swarmbid.model import Mission

PARTIAL_SUFFIX = ".part"
_BUFFER_BYTES = 1 << 20

Kind = TypeVar("Kind", bound="Struct")


@dataclass(frozen=True)
class Other:
    """A record of a kind that this version does not know, kept as it came."""

    kind: str
    t: float
    fields: dict[str, Any]


Record = Known | Other


@dataclass(frozen=True)
class Trace:
    """A trace in memory.

    Parameters
    ----------
    source : file that it was read from, for messages.
    header : the first line.
    records : everything after it, in order.
    """

    source: str
    header: Header
    records: tuple[Record, ...]

    @property
    def result(self) -> Result | None:
        """How the run ended; None if it was stopped before."""
        for record in reversed(self.records):
            if isinstance(record, Result):
                return record
        return None

    def finished(self) -> Result:
        """Return `result`; when you cannot do without, for it raises InputError if there is none."""
        result = self.result
        if result is None:
            why = "has no result record: the run was stopped before its end"
            raise _fault(self.source, why, "Run it again to its end.")
        return result

    def of(self, kind: type[Kind]) -> Iterator[Kind]:
        """Yield the records of one kind, in order."""
        for record in self.records:
            if isinstance(record, kind):
                yield record

    def mission(self) -> Mission:
        """Return the mission that the header carries."""
        from swarmbid.missionfile import mission_from_dict

        return mission_from_dict(self.header.mission, where=f"{self.source}: mission")


class TraceWriter:
    """Writes a trace; use it as a context manager, hand it the `Header` first.

    To a path, the lines go to a file beside it whose name ends in ``.part``, which takes the name of
    `target` when the run is over: an older trace is never half overwritten. A run that ends with an
    exception leaves all that it had written there; one that is killed, the header and what it had
    handed on since, a mebibyte at a time. Read it with ``read_trace(path, partial=True)``.

    Parameters
    ----------
    target : path, or an open text or binary file, which stays open.

    Examples
    --------
    >>> import io
    >>> file = io.StringIO()
    >>> with TraceWriter(file) as trace:
    ...     trace.write(Agreed(t=3.0, agent="uav1"))
    >>> file.getvalue()
    '{"kind":"agreed","t":3.0,"agent":"uav1"}\\n'
    """

    def __init__(self, target: str | PathLike[str] | IO[str] | IO[bytes]) -> None:
        self._encoder = msgspec.json.Encoder(enc_hook=_plain_number)
        self._lines: list[bytes] = []
        self._size = 0
        self._count = 0
        self._final: Path | None = None
        self._partial: Path | None = None
        self._file: Any
        if isinstance(target, str | PathLike):
            path = Path(target)
            try:
                # Pipes and devices have nothing to be renamed onto.
                if path.exists() and not path.is_file():
                    self._partial = path
                else:
                    self._final = path.resolve()
                    self._partial = self._final.with_name(self._final.name + PARTIAL_SUFFIX)
                self._file = self._partial.open("wb", buffering=0)
            except OSError as error:
                mend = "Give a path in a directory that exists and that you may write to."
                raise _fault(str(target), f"cannot be written: {error.strerror or error}", mend) from error
        else:
            self._file = target
        # Wrappers such as tempfile's are text files without being a TextIOBase.
        self._text = isinstance(self._file, io.TextIOBase) or hasattr(self._file, "encoding")

    def write(self, record: Header | Known) -> None:
        """Append one record."""
        self._append(self._encoder.encode(record))

    def write_fields(self, kind: str, t: float, **fields: Any) -> None:
        """Append a record of a kind of your own; readers that do not know it keep it."""
        self._append(self._encoder.encode({"kind": kind, "t": t, **fields}))

    def flush(self) -> None:
        """Hand what is buffered to the file."""
        if not self._lines:
            return
        block = b"".join(self._lines)
        self._lines.clear()
        self._size = 0
        if self._text:
            self._file.write(block.decode())
        else:
            # An unbuffered file may take less than it was given.
            view = memoryview(block)
            while view:
                written = self._file.write(view)
                view = view[len(view) if written is None else written :]

    def close(self) -> None:
        """Flush, and give the file its name. Calling it twice is harmless."""
        self._end(keep_name=True)

    def __enter__(self) -> TraceWriter:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._end(keep_name=error is None)

    def _append(self, line: bytes) -> None:
        if self._file is None:
            raise ValueError("this trace is closed; open another TraceWriter")
        self._lines.append(line)
        self._lines.append(b"\n")
        self._size += len(line) + 1
        self._count += 1
        # The header goes out at once, so that what a killed run leaves can be read.
        if self._size >= _BUFFER_BYTES or self._count == 1:
            self.flush()

    def _end(self, *, keep_name: bool) -> None:
        if self._file is None:
            return
        self.flush()
        if self._partial is None:
            self._file.flush()
        else:
            self._file.close()
        if self._final is not None and self._partial is not None:
            if keep_name:
                self._partial.replace(self._final)
            elif self._count == 0:
                self._partial.unlink()
        self._file = None


def read_trace(path: str | PathLike[str] | IO[bytes], *, partial: bool = False) -> Trace:
    """Read a trace.

    Parameters
    ----------
    path : the file; or one that is open, in binary, at its beginning, which stays open.
    partial : accept a file whose last line is cut, as a killed run leaves it; the cut line is left out.

    Raises
    ------
    InputError
        With file and line, if it cannot be read, is empty, no trace, of another version, or broken.
    """
    source = str(path) if isinstance(path, str | PathLike) else str(getattr(path, "name", "trace"))
    known = msgspec.json.Decoder(Known)
    records: list[Record] = []
    header: Header | None = None
    now = 0.0
    try:
        with Path(path).open("rb") if isinstance(path, str | PathLike) else nullcontext(path) as file:
            for number, line in enumerate(file, start=1):
                where = f"{source}:{number}"
                if header is None:
                    header = _read_header(line, where)
                    continue
                if not line.strip():
                    continue
                try:
                    record: Record = known.decode(line)
                except _UNREADABLE as error:
                    cut = not line.endswith(b"\n")
                    if cut and partial and not _is_json(line):
                        break
                    record = _read_other(line, now, where, str(error), cut)
                now = record.t
                records.append(record)
    except OSError as error:
        raise _fault(
            source, f"cannot be read: {error.strerror or error}", "Give the path of a trace file."
        ) from error
    if header is None:
        raise _fault(f"{source}:1", "is empty", "Give a trace, as `swarmbid simulate --trace` writes it.")
    return Trace(source, header, tuple(records))


def trace_schema() -> dict[str, Any]:
    """Return the JSON Schema of one line of a trace."""
    schemas, components = msgspec.json.schema_components(
        RECORD_KINDS, ref_template="#/$defs/{name}"
    )  # one reference for each kind, and their definitions
    for definition in components.values():
        definition.get("properties", {}).get("kind", {})["description"] = "kind of record"
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": f"One line of a swarmbid trace, version {TRACE_VERSION}",
        "anyOf": list(schemas),
        "$defs": components,
    }


def _read_header(line: bytes, where: str) -> Header:
    no_trace = "is no swarmbid trace"
    mend = "Give a trace, as `swarmbid simulate --trace` writes it."
    try:
        first = msgspec.json.decode(line)
    except _UNREADABLE as error:
        raise _fault(where, f"{no_trace}: its first line is no JSON object ({error})", mend) from error
    if not isinstance(first, dict) or first.get("kind") != "trace":
        raise _fault(where, f'{no_trace}: its first line is not of kind "trace"', mend)
    version = first.get("version")
    if version != TRACE_VERSION:
        raise _fault(
            where,
            f"is a trace of version {version!r}; this program reads version {TRACE_VERSION}",
            "Read it with the version of swarmbid that wrote it, or run it again.",
        )
    try:
        return msgspec.convert(first, Header)
    except msgspec.ValidationError as error:
        raise _fault(where, f"is broken: {error}", "Run it again.") from error


def _read_other(line: bytes, now: float, where: str, problem: str, cut: bool) -> Other:
    """Keep a record of an unknown kind; raise for a broken line."""
    try:
        fields = msgspec.json.decode(line)
    except _UNREADABLE:
        if cut:
            raise _fault(
                where,
                "ends in the middle of a record: the run was stopped or the file was cut",
                "Run it again, or read the whole lines with read_trace(path, partial=True).",
            ) from None
        raise _fault(where, f"is broken: {problem}", "Run it again.") from None
    kind = fields.get("kind") if isinstance(fields, dict) else None
    if not isinstance(kind, str) or kind in _KNOWN_KINDS:
        raise _fault(where, f"is broken: {problem}", "Run it again.")
    t = fields.get("t")
    timed = isinstance(t, int | float) and abs(t) <= sys.float_info.max
    return Other(kind, float(t) if timed else now, fields)


def _is_json(line: bytes) -> bool:
    try:
        msgspec.json.decode(line)
    except _UNREADABLE:
        return False
    return True


# No UTF-8, or nested beyond reason: msgspec lets these two through as they are.
_UNREADABLE = (msgspec.MsgspecError, UnicodeDecodeError, RecursionError)
_KNOWN_KINDS = frozenset(str(kind.__struct_config__.tag) for kind in RECORD_KINDS)


def _plain_number(value: Any) -> Any:
    """Let numpy's numbers and arrays pass as plain ones."""
    if hasattr(value, "tolist"):
        return value.tolist()
    raise TypeError(f"a trace cannot hold {type(value).__name__}")


def _fault(where: str, why: str, mend: str) -> InputError:
    return InputError([Fault(where, "", why, mend)])


_DRIVERS = (Header, Sent, Pose, Truth, Tracked, Crashed, Result)
EVENT_RECORDS: dict[str, type[Any]] = {
    str(kind.__struct_config__.tag): kind for kind in RECORD_KINDS if kind not in _DRIVERS
}
"""Kind of a negotiator's or a behaviour's event -> its record: the event's fields, time and agent.

What only a driver knows has records of its own."""
