"""Name to plug-in, on demand: a folder is an extension point, a file in it is a plug-in.

The file's name is the plug-in's name. Nothing is imported until it is asked for, and there is no list
to edit. Packages of other people join through the entry point group ``swarmbid.<folder>``.
"""

from __future__ import annotations

import ast
import importlib
import pkgutil
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from types import ModuleType
from typing import TypeVar

from swarmbid.errors import Fault, InputError, did_you_mean

T = TypeVar("T")

FOLDERS = ("algorithms", "datasets", "experiments", "references", "scenarios", "scores")


@cache
def _installed(folder: str) -> tuple[EntryPoint, ...]:
    """Plug-ins of other packages; looked for once, for it reads the metadata of all that is installed."""
    return tuple(entry_points(group=f"swarmbid.{folder}"))


def names(folder: str) -> list[str]:
    """Return the plug-ins of `folder`, in order of name, without importing any.

    Parameters
    ----------
    folder : one of `FOLDERS`.
    """
    package = importlib.import_module(f"swarmbid.{folder}")
    own = [found.name for found in pkgutil.iter_modules(package.__path__) if not found.name.startswith("_")]
    others = [found.name for found in _installed(folder)]
    return sorted({*own, *others})


def load(folder: str, name: str) -> ModuleType:
    """Import the plug-in `name` of `folder`.

    Raises
    ------
    InputError : there is none of that name; the message lists those that there are.
    """
    for found in _installed(folder):
        if found.name == name:
            module: ModuleType = found.load()
            return module
    known = names(folder)
    if name not in known:
        kind = folder.removesuffix("s")
        raise InputError(
            [Fault(kind, "", f"there is no {kind} {name!r}", did_you_mean(name, known) or _one_of(known))]
        )
    return importlib.import_module(f"swarmbid.{folder}.{name}")


def load_class(folder: str, name: str, base: type[T]) -> type[T]:
    """Import the one public class of plug-in `name` that derives from `base`."""
    module = load(folder, name)
    found = [
        item
        for item in vars(module).values()
        if isinstance(item, type) and issubclass(item, base) and item.__module__ == module.__name__
    ]
    if len(found) != 1:
        raise InputError(
            [
                Fault(
                    module.__name__,
                    "",
                    f"defines {len(found)} classes derived from {base.__name__}",
                    "Define exactly one.",
                )
            ]
        )
    return found[0]


def summary(folder: str, name: str) -> str:
    """Return the first line of the plug-in's docstring; one of our own is read, not imported."""
    base = Path(importlib.import_module(f"swarmbid.{folder}").__path__[0], name)
    file = base / "__init__.py" if base.is_dir() else base.with_suffix(".py")
    text = ast.get_docstring(ast.parse(file.read_text(encoding="utf-8"))) if file.is_file() else None
    if text is None:
        text = load(folder, name).__doc__
    return (text or "").strip().split("\n")[0]


def _one_of(known: list[str]) -> str:
    return "Choose one of: " + ", ".join(known) + "."
