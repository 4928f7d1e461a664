"""Columns of numbers and lists of ids, as every message packs them; and what no message may be.

Columns of rows are little-endian unsigned integers as wide as their largest value needs. Stamps are
written as their least, a width and the differences. Ids are joined by newlines.
"""

from __future__ import annotations

import re
from typing import Any

import numpy as np
from numpy.typing import NDArray

from swarmbid.checks import ID_PATTERN
from swarmbid.errors import SwarmbidError

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int32]
StampArray = NDArray[np.int64]
IntColumn = NDArray[Any]

VERSION = 1
MAX_BYTES = 4 * 1024 * 1024
"""Largest message taken in: a full state of 10^5 tasks with long ids fits, a flood does not."""
MAX_IDS = 1 << 18
INCARNATION = 1 << 32
"""A stamp is incarnation * 2^32 + sequence, so that an agent that restarts outranks its past."""
MAX_STAMP = 1 << 62
NOBODY = -1
NOT_LISTED = -1

_ID_LIST = re.compile(rf"{ID_PATTERN.pattern}(\n{ID_PATTERN.pattern})*")


class MessageError(SwarmbidError):
    """A message that cannot be taken in.

    Parameters
    ----------
    reason : one word, counted by the receiver ("malformed", "oversize", "version", "bid" ...).
    detail : what exactly was found.
    """

    def __init__(self, reason: str, detail: str) -> None:
        self.reason = reason
        self.detail = detail
        super().__init__(f"{reason}: {detail}")


def check_head(version: int, sender: str, sequence: int, digest: int, digest_at: int) -> None:
    """Refuse what no message of any kind may have in its first fields."""
    if version != VERSION:
        raise MessageError("version", f"is {version}, not {VERSION}")
    if not ID_PATTERN.fullmatch(sender):
        raise MessageError("id", "the sender's id is none")
    if not 0 < sequence <= MAX_STAMP or not 0 <= digest_at <= sequence:
        raise MessageError("stamp", "a stamp is out of order or out of range")
    if not 0 <= digest < 1 << 64:
        raise MessageError("malformed", "the digest is not of 64 bits")


def ids(joined: str) -> tuple[str, ...]:
    """Return the ids of a list, each once."""
    found = tuple(joined.split("\n")) if joined else ()
    if len(found) > MAX_IDS:
        raise MessageError("oversize", f"{len(found)} ids, more than {MAX_IDS}")
    if joined and not _ID_LIST.fullmatch(joined):
        raise MessageError("id", "an id is not 1 to 64 letters, digits, dots, underscores or hyphens")
    if len(set(found)) != len(found):
        raise MessageError("malformed", "an id is listed twice")
    return found


def width(top: int) -> int:
    """Bytes that hold every whole number from 0 to `top`."""
    return 1 if top < 1 << 8 else 2 if top < 1 << 16 else 4 if top < 1 << 32 else 8


def pack(values: IntColumn, top: int) -> bytes:
    """Return whole numbers as wide as `top` needs."""
    return values.astype(f"<u{width(top)}").tobytes()


def unpack(data: bytes, top: int, end: int) -> IntColumn:
    """Return whole numbers below `end`, as wide as `top` needs."""
    wide = width(top)
    if len(data) % wide:
        raise MessageError("malformed", "a column is cut off")
    values = np.frombuffer(data, f"<u{wide}").astype(np.int64)
    if values.size and int(values.max()) >= end:
        raise MessageError("malformed", "a row lies outside its table")
    return values


def pack_stamps(stamps: IntColumn) -> bytes:
    """Eight bytes for the least, one for the width, then the differences from the least."""
    if not stamps.size:
        return b""
    least, spread = int(stamps.min()), int(stamps.max() - stamps.min())
    return least.to_bytes(8, "little") + bytes([width(spread)]) + pack(stamps - least, spread)


def unpack_stamps(data: bytes) -> IntColumn:
    """Return what `pack_stamps` packed."""
    if not data:
        return np.zeros(0, np.int64)
    if len(data) < 10 or data[8] not in (1, 2, 4, 8) or (len(data) - 9) % data[8]:
        raise MessageError("malformed", "a column of stamps is cut off")
    least = int.from_bytes(data[:8], "little")
    spread = np.frombuffer(data[9:], f"<u{data[8]}")
    if least + int(spread.max()) > MAX_STAMP:
        raise MessageError("stamp", "a stamp is out of range")
    return spread.astype(np.int64) + least
