"""Options of an algorithm as they are typed: ``--with NAME=VALUE``."""

from __future__ import annotations

import inspect
from typing import Any

from swarmbid.errors import Fault, InputError, did_you_mean

_WORDS = {"true": True, "yes": True, "false": False, "no": False, "none": None}


def algorithm_options(algorithm: str, settings: list[str]) -> dict[str, Any]:
    """Return the options of an algorithm, read by the kind of their defaults.

    Raises
    ------
    InputError : no such option, or a value that is none; with the options that there are.
    """
    if not settings:
        return {}
    from swarmbid import registry
    from swarmbid.negotiator import Negotiator

    cls = registry.load_class("algorithms", algorithm, Negotiator)  # type: ignore[type-abstract]
    known = {
        name: one.default
        for name, one in inspect.signature(cls).parameters.items()
        if one.kind is one.KEYWORD_ONLY and name != "insertion"
    }
    found: dict[str, Any] = {}
    for setting in settings:
        name, equals, text = setting.partition("=")
        where = f"--with {setting}"
        if not equals or name not in known:
            mend = did_you_mean(name, known) or "It has: " + ", ".join(known) + "."
            raise InputError([Fault(where, "", f"names no option of {algorithm}", mend)])
        found[name] = _read(where, text, known[name])
    return found


def _read(where: str, text: str, default: Any) -> Any:
    """Return what was typed, of the kind of the default; a number where that is None."""
    if isinstance(default, str):
        return text
    word = text.lower()
    if word in _WORDS and isinstance(_WORDS[word], bool) == isinstance(default, bool):
        return _WORDS[word]
    kind = int if isinstance(default, int) else float
    if not isinstance(default, bool):
        try:
            return kind(text)
        except ValueError:
            pass
    mend = "Give true or false." if isinstance(default, bool) else "Give a number."
    raise InputError([Fault(where, "", f"{text!r} is no value of it", mend)])
