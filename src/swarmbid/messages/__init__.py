"""Every wire message, its version and its limits. One kind per file.

In memory a message holds rows of two id tables, so that agents of one process read it without looking
up a single name. On the wire it holds the ids themselves, only those that it mentions: nothing there
depends on anybody's order. A message that exists has been checked; `decode` refuses what cannot be one
with a `MessageError` that names the reason.

A message is one MessagePack array that begins with its kind and `VERSION`; new fields are appended,
with defaults. An outsider's algorithm brings message classes of its own; only those named here can be
read back from bytes.
"""

from __future__ import annotations

import msgspec

from swarmbid.messages._base import Broadcast, Message
from swarmbid.messages._columns import (
    INCARNATION,
    MAX_BYTES,
    MAX_IDS,
    MAX_STAMP,
    NOBODY,
    NOT_LISTED,
    VERSION,
    FloatArray,
    IntArray,
    MessageError,
    StampArray,
)
from swarmbid.messages.acts import Acts, ActsWire
from swarmbid.messages.assignments import Assignments, AssignmentsWire
from swarmbid.messages.beliefs import Beliefs, BeliefsWire
from swarmbid.messages.records import Records, RecordsWire
from swarmbid.messages.survey import Survey, SurveyWire

__all__ = [
    "INCARNATION",
    "KINDS",
    "MAX_BYTES",
    "MAX_IDS",
    "MAX_STAMP",
    "NOBODY",
    "NOT_LISTED",
    "VERSION",
    "Acts",
    "Assignments",
    "Beliefs",
    "Broadcast",
    "FloatArray",
    "IntArray",
    "Message",
    "MessageError",
    "Records",
    "StampArray",
    "Survey",
    "decode",
    "encode",
]

KINDS: tuple[type[Broadcast], ...] = (Acts, Assignments, Beliefs, Records, Survey)
"""The kinds that `decode` can read back."""

Wire = ActsWire | AssignmentsWire | BeliefsWire | RecordsWire | SurveyWire
_decoder = msgspec.msgpack.Decoder(Wire)


def encode(message: Broadcast) -> bytes:
    """Return the bytes of a message."""
    return message.encode()


def decode(data: bytes) -> Broadcast:
    """Return the message in `data`.

    Raises
    ------
    MessageError : it is too large, of an unknown version, garbled, or says what cannot be.
    """
    if len(data) > MAX_BYTES:
        raise MessageError("oversize", f"{len(data)} bytes, more than {MAX_BYTES}")
    try:
        wire: Wire = _decoder.decode(data)
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        raise MessageError("malformed", str(error)) from None
    return wire.message()
