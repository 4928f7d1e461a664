"""How the model checks its own fields, so that every object says all of its faults at once."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from numbers import Integral, Real
from typing import Any

from swarmbid.errors import Fault, InputError

ID_PATTERN = re.compile(r"[A-Za-z0-9_][A-Za-z0-9._-]{0,63}")
ID_RULE = "Use 1 to 64 letters, digits, dots, underscores or hyphens, the first no dot or hyphen."
"""Ids name files, wire keys and command line arguments, hence the narrow alphabet."""

LARGEST = 1e12
SMALLEST = 1e-9
"""Bounds of every number, wide of any real mission, so that no product of two overflows or divides by 0."""


class Checker:
    """Collects every fault of one object, then raises them together.

    A value that is right but of a neighbouring type (an int or a NumPy scalar for a float, a list for a
    set) is replaced by the plain one, so that equal missions compare and print equal.
    """

    def __init__(self, kind: str, owner: Any, name: object = None) -> None:
        self.owner = owner
        self.where = kind if name is None else f"{kind} {name}"
        self.faults: list[Fault] = []
        if name is not None and not (isinstance(name, str) and ID_PATTERN.fullmatch(name)):
            self.fault("id", f"is {name!r}", ID_RULE)

    def fault(self, name: str, why: str, mend: str) -> None:
        """Note one fault of the field `name`."""
        self.faults.append(Fault(self.where, name, why, mend))

    def put(self, name: str, value: object) -> None:
        """Replace a field of the frozen owner by its plain form."""
        object.__setattr__(self.owner, name, value)

    def number(
        self,
        name: str,
        *,
        low: float = -LARGEST,
        high: float = LARGEST,
        above: float | None = None,
        infinite: bool = False,
    ) -> bool:
        """Check one number against its bounds; True when it is right."""
        value = getattr(self.owner, name)
        number = _as_float(value)
        if number is None:
            self.fault(name, f"is {value!r}, not a number", "Give a number.")
        elif math.isnan(number) or (math.isinf(number) and not infinite):
            self.fault(name, f"is {number}", "Give a finite number.")
        elif above is not None and number <= above:
            self.fault(name, f"is {number:g}", f"Give more than {above:g}.")
        elif number < low or (above is not None and number < SMALLEST):
            self.fault(name, f"is {number:g}", f"Give at least {low if above is None else SMALLEST:g}.")
        elif number > high and not math.isinf(number):
            self.fault(name, f"is {number:g}", f"Give at most {high:g}.")
        else:
            if type(value) is not float:
                self.put(name, number)
            return True
        return False

    def count(self, name: str, mend: str, *, low: int = 1) -> bool:
        """Check that a field is an int of at least `low`; True is no int here."""
        value = getattr(self.owner, name)
        if not isinstance(value, Integral) or isinstance(value, bool):
            self.fault(name, f"is {value!r}, not a whole number", mend)
        elif value < low:
            self.fault(name, f"is {value}", mend)
        else:
            self.put(name, int(value))
            return True
        return False

    def position(self, name: str) -> None:
        """Check three finite numbers."""
        value = getattr(self.owner, name)
        try:
            numbers = [_as_float(x) for x in value]
        except TypeError:
            numbers = []
        if len(numbers) != 3 or any(x is None or not abs(x) <= LARGEST for x in numbers):
            self.fault(
                name, f"is {value!r}", f"Give three finite numbers up to {LARGEST:g}: east, north, up in m."
            )
        else:
            self.put(name, tuple(numbers))

    def name(self, name: str) -> None:
        """Check one name for people, such as a type."""
        value = getattr(self.owner, name)
        if not _is_name(value):
            self.fault(name, f"is {value!r}", "Give a name of 1 to 200 printable characters.")

    def names(self, name: str, kind: type) -> None:
        """Check a collection of names and keep it as `kind`."""
        value = getattr(self.owner, name)
        # A lone string is a set of letters to Python, never what was meant.
        if isinstance(value, str) or not isinstance(value, Iterable):
            self.fault(name, f"is {value!r}", "Give a list of names.")
            return
        items = list(value)
        wrong = [item for item in items if not _is_name(item)]
        if wrong:
            self.fault(name, f"holds {wrong[0]!r}", "Give names of 1 to 200 printable characters.")
        else:
            self.put(name, kind(items))

    def table(self, name: str) -> None:
        """Check a table from one name to several."""
        value = getattr(self.owner, name)
        if not isinstance(value, dict) or not all(_is_name(key) for key in value):
            self.fault(name, f"is {value!r}", "Give each agent type a list of task types.")
            return
        table = {}
        for agent_type, allowed in value.items():
            if isinstance(allowed, str) or not all(_is_name(item) for item in allowed):
                self.fault(f"{name}.{agent_type}", f"is {allowed!r}", "Give a list of task types.")
            else:
                table[agent_type] = frozenset(allowed)
        self.put(name, table)

    def done(self) -> None:
        """Raise what was found, if anything."""
        if self.faults:
            raise InputError(self.faults)


def _as_float(value: object) -> float | None:
    if type(value) is float:
        return value
    if not isinstance(value, Real) or isinstance(value, bool):
        return None
    try:
        return float(value)
    except OverflowError:  # an int of more than 308 digits
        return math.inf


def _is_name(value: object) -> bool:
    return isinstance(value, str) and 0 < len(value) <= 200 and value.isprintable()
