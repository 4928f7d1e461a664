"""Run the benchmarks: `python -m benchmarks [--quick] [--write PAGE] [name ...]`.

The names are insertion, runs, scale, startup and coalitions, all by default, and quality.
Exit status 1 if a promise was missed.
"""

from __future__ import annotations

import argparse
import sys
from importlib import import_module
from pathlib import Path

from benchmarks.measure import Table, describe_machine

NAMES = ("insertion", "runs", "scale", "startup", "coalitions")
ON_REQUEST = ("quality",)
"""Run only when named: it takes an hour."""

INTRODUCTION = """# Benchmarks

Figures of one machine on one day; `make bench` measures them again, and `python -m benchmarks --write
PAGE`, with the names of the tables wanted, rewrites this page. The machine is shared and noisy: figures are
medians, the sides of a comparison take turns in one run, and ratios mean more than seconds.
"""


def main() -> int:
    """Run what the command line asks for."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description="Measure swarmbid's speed.")
    parser.add_argument(
        "names",
        nargs="*",
        metavar="name",
        help=f"{', '.join(NAMES)} (the default), or {', '.join(ON_REQUEST)}",
    )
    parser.add_argument(
        "--quick", action="store_true", help="fewer repeats, and a tenth of the largest mission"
    )
    parser.add_argument("--write", type=Path, metavar="PAGE", help="also write the figures to this page")
    options = parser.parse_args()
    unknown = [name for name in options.names if name not in NAMES + ON_REQUEST]
    if unknown:
        parser.error(
            f"no benchmark is called {', '.join(unknown)}; there are {', '.join(NAMES + ON_REQUEST)}"
        )
    machine = describe_machine()
    print("\n".join(machine))
    tables: list[Table] = []
    for name in options.names or NAMES:
        table = import_module(f"benchmarks.{name}").run(quick=options.quick)
        print(f"\n{table.text()}", flush=True)
        tables.append(table)
    if options.write:
        page = [INTRODUCTION, "\n".join(f"- {line}" for line in machine) + "\n"]
        options.write.write_text(
            "\n".join([*page, *[table.markdown() for table in tables]]), encoding="utf-8"
        )
    missed = [bar for table in tables for bar, kept in table.bars if not kept]
    print(f"\n{len(missed)} of {sum(len(table.bars) for table in tables)} promises missed.")
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
