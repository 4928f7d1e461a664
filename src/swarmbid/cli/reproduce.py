"""``swarmbid reproduce``: a paper's figures, beside what the paper reports."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from swarmbid.cli.plan import AsJson, Seed
from swarmbid.errors import Fault, InputError, did_you_mean


def reproduce(
    name: Annotated[str, typer.Argument(metavar="PAPER", help="A paper: hunt2014 or dymkou2019.")],
    quick: Annotated[bool, typer.Option(help="Fewer runs, at fewer numbers of agents.")] = False,
    figure: Annotated[list[int] | None, typer.Option(metavar="N", help="One of its figures only.")] = None,
    runs: Annotated[int | None, typer.Option(min=1, help="Runs a point; the paper's by default.")] = None,
    seed: Seed = 0,
    write: Annotated[
        Path | None,
        typer.Option(help="Write the page of the documentation here, its pictures in images/ beside it."),
    ] = None,
    pictures: Annotated[
        Path | None, typer.Option(metavar="DIRECTORY", help="Write the figures here, as SVG.")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Run a paper's experiments and print them beside what it reports."""
    from swarmbid.cli.output import check_writable, complain, say, say_json, say_table, write_text
    from swarmbid.cli.waiting import cases_shown

    check_writable(write, given=Path(name))
    experiment = _paper(name)
    if write is not None and figure:
        mend = "Leave out --figure; --pictures writes single figures."
        raise InputError([Fault("--write", "", "needs every figure", mend)])
    if pictures is not None and (pictures.is_file() or not pictures.parent.is_dir()):
        raise InputError([Fault(str(pictures), "", "is no directory", "Name a directory to make or to use.")])
    with cases_shown(name) as show:
        result = experiment.run(quick=quick, figures=figure, runs=runs, seed=seed, progress=show)
    if as_json:
        say_json(result.to_dict())
    else:
        tables = [result.table(), result.level_table(), *(result.figure_table(one) for one in figure or ())]
        for headings, rows in tables:
            if rows:
                say_table(headings, rows, text=range(len(headings)))
                say("")
        say(result.summary())
    folders = [path for path in (pictures, write and write.parent / "images") if path is not None]
    drawn = result.pictures() if folders else {}
    for folder in folders:
        folder.mkdir(exist_ok=True)
        for file, text in drawn.items():
            write_text(folder / file, text)
    if write is not None:
        write_text(write, result.page())
    problems = result.problems()
    for problem in problems:
        complain(problem, 1)
    raise typer.Exit(1 if problems else 0)


def _paper(name: str) -> Any:
    """Load an experiment that has figures."""
    from swarmbid import registry

    experiment = registry.load("experiments", name)
    if not hasattr(experiment, "FIGURES"):
        known = registry.names("experiments")
        papers = [one for one in known if hasattr(registry.load("experiments", one), "FIGURES")]
        mend = did_you_mean(name, papers) or (
            f"Run `swarmbid bench {name}`, or reproduce {' or '.join(papers)}."
        )
        raise InputError([Fault(name, "", "is a benchmark, not a paper with figures", mend)])
    return experiment
