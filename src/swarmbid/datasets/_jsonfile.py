"""Instance files in JSON: every fault with the path of its field, before anything is made of them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from swarmbid.errors import Fault, InputError

MAX_BYTES = 10_000_000
LARGEST = 1e9
"""Bound of every number; the public instances stay below 1000."""


def read_text(path: Path) -> str:
    """Return the text of an instance file.

    Raises
    ------
    InputError : it cannot be read, is no text, or is too large.
    """
    try:
        if path.stat().st_size > MAX_BYTES:
            size = f"has {path.stat().st_size:,} bytes"
            raise InputError([Fault(str(path), "", size, f"Give at most {MAX_BYTES:,}.")])
        return path.read_text(encoding="utf-8")
    except OSError as error:
        why = f"cannot be read: {error.strerror}"
        raise InputError([Fault(str(path), "", why, "Name a readable file.")]) from None
    except UnicodeDecodeError:
        raise InputError([Fault(str(path), "", "is not text", "Give an instance in JSON.")]) from None


class JsonFile:
    """The object that a file holds, and what is wrong with it.

    Each method that looks at a value notes a fault and returns a harmless stand-in if the value is not
    what it should be, so that one reading finds all faults; `done` raises them.
    """

    def __init__(self, text: str, where: str) -> None:
        self.where = where
        self.faults: list[Fault] = []
        try:
            data = json.loads(text)
        except json.JSONDecodeError as error:
            place = f"{where}:{error.lineno}:{error.colno}"
            raise InputError([Fault(place, "", f"is no JSON: {error.msg}", "Mend it there.")]) from None
        except (RecursionError, ValueError):
            raise InputError([Fault(where, "", "is no JSON of an instance", "Give an instance.")]) from None
        if not isinstance(data, dict):
            found = f"holds {_kind(data)}"
            raise InputError([Fault(where, "", found, "Give one object with the instance's fields.")])
        self.data: dict[str, Any] = data

    def fault(self, field: str, why: str, mend: str) -> None:
        """Note one fault."""
        self.faults.append(Fault(self.where, field, why, mend))

    def done(self) -> None:
        """Raise InputError with every fault noted, if any."""
        if self.faults:
            raise InputError(self.faults)

    def has(self, field: str) -> bool:
        """Whether the file has the field; if not, that is a fault."""
        if field in self.data:
            return True
        self.fault(field, "is missing", "Add it.")
        return False

    def number(
        self, field: str, value: object, *, low: float = -LARGEST, above: float | None = None
    ) -> float:
        """Return a finite number of at least `low`, or greater than `above`."""
        if isinstance(value, bool) or not isinstance(value, int | float):
            self.fault(field, f"is {_kind(value)}", "Give a number.")
        elif not -LARGEST <= value <= LARGEST:  # also false for what is no number, and for any int
            self.fault(field, f"is {str(value)[:30]}", f"Give a number within ±{LARGEST:g}.")
        elif above is not None and value <= above:
            self.fault(field, f"is {value:g}", f"Give more than {above:g}.")
        elif value < low:
            self.fault(field, f"is {value:g}", f"Give {low:g} or more.")
        else:
            return float(value)
        return 1.0

    def count(self, field: str, value: object, *, low: int, high: int) -> int:
        """Return a whole number from `low` to `high`."""
        if isinstance(value, bool) or not isinstance(value, int):
            self.fault(field, f"is {_kind(value)}", f"Give a whole number, {low} to {high}.")
        elif not low <= value <= high:
            self.fault(field, f"is {str(value)[:30]}", f"Give {low} to {high}.")
        else:
            return value
        return low

    def items(self, field: str, value: object, *, length: int | None = None, what: str) -> list[Any]:
        """Return a list, of `length` if that is given.

        Parameters
        ----------
        what : what the list should hold, for the mend, such as "two numbers".
        """
        if not isinstance(value, list):
            self.fault(field, f"is {_kind(value)}", f"Give a list of {what}.")
        elif length is not None and len(value) != length:
            self.fault(field, f"has {len(value)} entries", f"Give {what}.")
        else:
            return value
        return []

    def place(self, field: str, value: object) -> tuple[float, float]:
        """Return the two coordinates of a place."""
        pair = self.items(field, value, length=2, what="two numbers, x and y")
        if not pair:
            return (0.0, 0.0)
        return (self.number(f"{field}[0]", pair[0]), self.number(f"{field}[1]", pair[1]))


def _kind(value: object) -> str:
    names = {bool: "true or false", dict: "an object", list: "a list", str: "text", float: "a fraction"}
    if value is None:
        return "null"
    return names.get(type(value), "a number")
