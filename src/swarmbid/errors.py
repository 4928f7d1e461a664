"""The one base error, and what a user's own mistake looks like.

A mistake of the caller raises; a mistake of a peer never does (it is counted and dropped with a
reason). Failing to converge is a status of the result, not an error.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from dataclasses import dataclass


class SwarmbidError(Exception):
    """Base of everything that swarmbid raises on purpose."""


class InputError(SwarmbidError):
    """The user's input cannot be used; the message says what, where, why and the mend.

    Parameters
    ----------
    faults : every fault found, so that one run reports them all.
    """

    def __init__(self, faults: list[Fault]) -> None:
        if not faults:
            raise ValueError("InputError needs at least one fault")
        self.faults = faults
        super().__init__("\n".join(str(fault) for fault in faults))


@dataclass(frozen=True)
class Fault:
    """One thing that is wrong with an input.

    Parameters
    ----------
    where : file with line and column, or the name of the object.
    field : dotted path of the field, such as ``tasks[3].start``; empty for the whole file.
    why : what is wrong, with the value found.
    mend : what to write instead.
    """

    where: str
    field: str
    why: str
    mend: str

    def __str__(self) -> str:
        place = f"{self.where}: {self.field}" if self.field else self.where
        return f"{place}: {self.why}. {self.mend}"


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """Return "Did you mean 'x'?" for the nearest of `known`, or an empty string."""
    near = nearest(name, known)
    return "" if near is None else f"Did you mean {near!r}?"


def nearest(name: str, known: Iterable[str]) -> str | None:
    """Return the one of `known` that `name` was most likely meant to be, if any."""
    names = sorted(known)
    # What was cut short is more likely meant than what looks alike.
    near = [one for one in names if name and one.startswith(name)]
    near = near or difflib.get_close_matches(name, names, n=1)
    return near[0] if near else None
