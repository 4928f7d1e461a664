"""``swarmbid bench``: published benchmarks, with the gap to the best known."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from swarmbid.cli.plan import AsJson


def bench(
    name: Annotated[str, typer.Argument(metavar="NAME", help="An experiment, see `swarmbid list`.")],
    quick: Annotated[bool, typer.Option(help="A few cases only.")] = False,
    every: Annotated[bool, typer.Option("--all", help="A line for each instance.")] = False,
    write: Annotated[Path | None, typer.Option(help="Write the page of the documentation here.")] = None,
    as_json: AsJson = False,
) -> None:
    """Run a benchmark and print it beside the published results."""
    from swarmbid import registry
    from swarmbid.cli.output import check_writable, complain, say, say_json, say_table, write_text
    from swarmbid.cli.waiting import cases_shown

    check_writable(write, given=Path(name))
    experiment = registry.load("experiments", name)
    with cases_shown(name) as show:
        result = experiment.run(quick=quick, progress=show)
    if as_json:
        say_json(result.to_dict())
    else:
        headings, rows = result.table(every_instance=every)
        say_table(headings, rows, text=(0,))
        say("", result.summary())
    if write is not None:
        write_text(write, result.page())
    problems = result.problems()
    for problem in problems:
        complain(problem, 1)
    raise typer.Exit(1 if problems else 0)
