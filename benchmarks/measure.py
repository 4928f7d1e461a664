"""Measuring on a machine that is noisy: interleaved repeats, medians, children with their own peak memory."""

from __future__ import annotations

import json
import os
import platform
import resource
import statistics
import subprocess
import sys
import textwrap
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from importlib import metadata
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
MEBIBYTE = 2**20


@dataclass
class Table:
    """What one benchmark found, for the terminal and for the page.

    Attributes
    ----------
    rows : cells as printed. notes : sentences that belong under the table.
    bars : what was promised, in words, and whether it was kept.
    """

    title: str
    columns: Sequence[str]
    rows: list[Sequence[str]] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    bars: list[tuple[str, bool]] = field(default_factory=list)

    def note(self, text: str) -> None:
        """Add a sentence or two; line breaks in `text` are where the source has them only."""
        self.notes.append(" ".join(text.split()))

    def text(self) -> str:
        """Return the table with aligned columns."""
        cells = [list(self.columns), *[list(row) for row in self.rows]]
        widths = [max(len(row[c]) for row in cells) for c in range(len(self.columns))]
        lines = [self.title, ""]
        for row in cells if self.rows else []:
            padded = [cell.rjust(width) for cell, width in zip(row, widths, strict=True)]
            padded[0] = row[0].ljust(widths[0])
            lines.append("  ".join(padded).rstrip())
        lines += [textwrap.fill(note, 110) for note in self.notes]
        return "\n".join([*lines, *[f"[{verdict(kept)}] {bar}" for bar, kept in self.bars]])

    def markdown(self) -> str:
        """Return the table as a section of a page."""
        lines = [f"## {self.title}", ""]
        if self.rows:
            lines.append("| " + " | ".join(self.columns) + " |")
            rulers = ["---", *["---:"] * (len(self.columns) - 1)]
            lines.append("| " + " | ".join(rulers) + " |")
            lines += ["| " + " | ".join(row) + " |" for row in self.rows]
            lines.append("")
        lines += [f"{note}\n" for note in self.notes]
        lines += [f"- **{verdict(kept)}**: {bar}" for bar, kept in self.bars]
        return "\n".join(lines).rstrip() + "\n"


def verdict(kept: bool) -> str:
    """Say whether a promise was kept."""
    return "kept" if kept else "MISSED"


def interleave(
    contenders: Mapping[str, Callable[[], Any]],
    repeats: int,
    clock: Callable[[], float] = time.process_time,
) -> dict[str, list[float]]:
    """Return seconds of every repeat of every contender, taking turns so that noise hits all alike."""
    seconds: dict[str, list[float]] = {name: [] for name in contenders}
    for turn in range(repeats):
        names = list(contenders)[:: 1 if turn % 2 == 0 else -1]
        for name in names:
            begin = clock()
            contenders[name]()
            seconds[name].append(clock() - begin)
    return seconds


def median_ratio(numerator: Sequence[float], denominator: Sequence[float]) -> float:
    """Return the median over turns of one contender's time through the other's."""
    return statistics.median(a / b for a, b in zip(numerator, denominator, strict=True))


def in_child(module: str, *arguments: str, timeout: float = 600.0) -> Any:
    """Run ``python -m module arguments`` and return the JSON that it printed last.

    A child of its own, because peak memory never falls within a process.
    """
    done = subprocess.run(
        [sys.executable, "-m", module, *arguments],
        cwd=ROOT, stdout=subprocess.PIPE, text=True, timeout=timeout, check=True,
    )  # fmt: skip
    return json.loads(done.stdout.strip().splitlines()[-1])


def peak_memory() -> int:
    """Return the most resident bytes that this process has had."""
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak if sys.platform == "darwin" else peak * 1024


def describe_machine() -> list[str]:
    """Return what the figures were measured on, one fact a line."""
    cpu = platform.processor() or platform.machine()
    info = Path("/proc/cpuinfo")
    if info.exists():
        for line in info.read_text().splitlines():
            if line.startswith("model name"):
                cpu = line.partition(":")[2].strip()
                break
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    versions = ", ".join(f"{name} {metadata.version(name)}" for name in ("numpy", "numba", "llvmlite"))
    return [
        f"{cpu}, {cores} cores, {platform.system()} {platform.machine()}",
        f"Python {platform.python_version()}, {versions}",
    ]
