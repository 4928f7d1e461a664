"""Options of a scenario: each with its default and its meaning, and what is none refused."""

from __future__ import annotations

from dataclasses import field, fields
from typing import Any, TypeVar

from swarmbid.errors import Fault, InputError, did_you_mean

Options = TypeVar("Options")


def option(default: Any, meaning: str) -> Any:
    """Return a field of an options class.

    Parameters
    ----------
    meaning : what it means, with its unit; found again in ``metadata["help"]``.
    """
    return field(default=default, metadata={"help": meaning})


def chosen(where: str, kind: type[Options], given: dict[str, Any]) -> Options:
    """Return the options of a scenario.

    Raises
    ------
    InputError : for every name in `given` that is no option.
    """
    known = [one.name for one in fields(kind)]  # type: ignore[arg-type]
    unknown = [
        Fault(where, name, "is no option", did_you_mean(name, known) or f"Use some of {', '.join(known)}.")
        for name in given
        if name not in known
    ]
    if unknown:
        raise InputError(unknown)
    return kind(**given)
