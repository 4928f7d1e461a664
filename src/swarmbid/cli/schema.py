"""``swarmbid schema``: the JSON Schema of mission files, and of traces."""

from __future__ import annotations

from typing import Annotated

import typer


def schema(
    trace: Annotated[bool, typer.Option(help="The schema of one line of a trace instead.")] = False,
) -> None:
    """Print the JSON Schema of mission files, so that editors complete and check them."""
    from swarmbid.cli.output import say_json
    from swarmbid.missionfile import mission_schema
    from swarmbid.trace import trace_schema

    say_json(trace_schema() if trace else mission_schema())
