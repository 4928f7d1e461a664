"""What every command prints alike: tables, JSON, complaints, files."""

from __future__ import annotations

import json
import sys
from collections.abc import Collection, Iterable, Sequence
from pathlib import Path
from typing import Any

from swarmbid.errors import Fault, InputError


def complain(message: str, status: int) -> int:
    """Print a message to standard error and return `status`."""
    print(f"swarmbid: {message}", file=sys.stderr)
    return status


def say(*lines: str) -> None:
    """Print lines to standard output."""
    for line in lines:
        print(line)


def say_json(data: Any) -> None:
    """Print data as JSON; keys keep their order, so equal results print equal bytes."""
    print(json.dumps(data, indent=2, ensure_ascii=False))


def say_table(headings: Sequence[str], rows: Iterable[Sequence[str]], *, text: Collection[int]) -> None:
    """Print a table: with bold headings on a terminal, plain and of fixed width elsewhere.

    Parameters
    ----------
    text : the columns that are text, set left; the others are numbers, set right.
    """
    cells = [list(row) for row in rows]
    if sys.stdout.isatty():
        from rich.console import Console
        from rich.table import Table

        table = Table(header_style="bold", box=None, pad_edge=False, padding=(0, 2, 0, 0))
        for place, heading in enumerate(headings):
            table.add_column(heading, justify="left" if place in text else "right", overflow="fold")
        for row in cells:
            table.add_row(*row)
        Console(markup=False, highlight=False).print(table)
        return
    widths = [max(len(row[k]) for row in [list(headings), *cells]) for k in range(len(headings))]
    for row in [list(headings), *cells]:
        parts = [
            cell.ljust(width) if k in text else cell.rjust(width)
            for k, (cell, width) in enumerate(zip(row, widths, strict=True))
        ]
        print("  ".join(parts).rstrip())


def count_of(number: int, thing: str) -> str:
    """Return "1 task", "2 tasks", "1,000 tasks"."""
    return f"{number:,} {thing}" + ("" if number == 1 else "s")


def shortened(words: Iterable[str], width: int) -> str:
    """Return as many words as fit, and "..." for the rest."""
    line = ""
    for word in words:
        if len(line) + len(word) + 1 > width - 4:
            return f"{line} ...".strip()
        line = f"{line} {word}" if line else word
    return line


def write_text(path: Path, text: str) -> None:
    """Write a file whole or not at all.

    Raises
    ------
    InputError : it cannot be written; an older file of that name stays as it was.
    """
    partial = path.with_name(path.name + ".part")
    try:
        if path.exists() and not path.is_file():  # a pipe or a device
            path.write_text(text, encoding="utf-8")
            return
        partial.write_text(text, encoding="utf-8")
        partial.replace(path)
    except OSError as error:
        mend = "Give a path in a directory that exists and that you may write to."
        raise InputError(
            [Fault(str(path), "", f"cannot be written: {error.strerror or error}", mend)]
        ) from None


def check_writable(*paths: Path | None, given: Path) -> None:
    """Refuse output paths that cannot be written, or would overwrite the input, before any work is done.

    Parameters
    ----------
    given : the input.

    Raises
    ------
    InputError : naming each.
    """
    faults = []
    seen: set[Path] = set()
    for path in paths:
        if path is None:
            continue
        if path.resolve() == given.resolve():
            faults.append(Fault(str(path), "", "is the input", "Give the output a file of its own."))
        elif path.resolve() in seen:
            faults.append(Fault(str(path), "", "is named for two outputs", "Give each a file of its own."))
        seen.add(path.resolve())
        if path.is_dir():
            faults.append(Fault(str(path), "", "is a directory", "Give the path of a file in it."))
        elif not path.parent.is_dir():
            faults.append(
                Fault(str(path), "", f"lies in {path.parent}, which is no directory", "Make it first.")
            )
    if faults:
        raise InputError(faults)
