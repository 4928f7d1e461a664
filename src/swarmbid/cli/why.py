"""``swarmbid why``: explain what became of one task."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from swarmbid.cli.plan import AsJson
from swarmbid.errors import Fault, InputError


def why(
    trace: Annotated[Path, typer.Argument(metavar="TRACE", help="Record of a run, JSON lines.")],
    task: Annotated[str, typer.Argument(metavar="TASK", help="Id of a task, or of a target of a search.")],
    score: Annotated[
        str | None, typer.Option("-s", "--score", help="The .py file of a score of your own, if it was used.")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Tell who bid what for TASK, who won, who was outbid, and why the others do not do it."""
    from swarmbid.cli.output import say, say_json
    from swarmbid.sightings import explain_search
    from swarmbid.trace import read_trace
    from swarmbid.why import explain

    record = read_trace(trace)
    if record.header.world is not None and score is not None:
        mend = "Leave it out."
        raise InputError(
            [Fault("--score", "", "is for negotiations, and this is the trace of a search", mend)]
        )
    searched = record.header.world is not None
    explanation = explain_search(record, task) if searched else explain(record, task, score=score)
    if as_json:
        say_json(explanation.to_dict())
    else:
        say(str(explanation))
