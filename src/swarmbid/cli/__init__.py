"""The command line: one command per file, nothing heavy imported before a command runs.

Exit status: 0 done; 1 the mission cannot be fully served, the agents did not agree, or the plan breaks a
rule (said which); 2 bad input or usage.
"""

from __future__ import annotations

import io
import os
import signal
import sys

import typer

from swarmbid import __version__
from swarmbid.cli import bench, listing, plan, reproduce, schema, simulate, why
from swarmbid.cli.output import complain
from swarmbid.errors import InputError

app = typer.Typer(
    name="swarmbid",
    help="A team of robots divides its work among themselves, with no leader.",
    add_completion=True,
    no_args_is_help=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)
app.command("plan")(plan.plan)
app.command("simulate")(simulate.simulate)
app.command("why")(why.why)
app.command("bench")(bench.bench)
app.command("reproduce")(reproduce.reproduce)
app.command("schema")(schema.schema)
app.command("list")(listing.list_)


def _version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"swarmbid {__version__}")
        raise typer.Exit


@app.callback()
def _root(
    version: bool = typer.Option(
        False, "--version", callback=_version, is_eager=True, help="Print the version and stop."
    ),
) -> None:
    pass


def main() -> None:
    """Run the command line; every failure ends in words and a status, never in a traceback."""
    if hasattr(signal, "SIGPIPE"):
        # When the reader (say, `head`) has had enough, end as other tools do.
        signal.signal(signal.SIGPIPE, signal.SIG_DFL)
    # An interrupt ends the program at once, also in the middle of compiled code; what was written of a
    # trace stays, as after any kill.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            # A name that the terminal cannot show is shown by its code points.
            stream.reconfigure(errors="backslashreplace")
    try:
        status = app(standalone_mode=False)
        sys.stdout.flush()
    except InputError as error:
        status = complain(str(error), 2)
    except OSError as error:
        status = complain(f"{error.filename or 'the output'}: {error.strerror or error}", 2)
        if error.filename is None:
            # What standard output could not take must not be tried again on the way out.
            os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    except Exception as error:
        status = _unforeseen(error)
    sys.exit(status if isinstance(status, int) else 0)


def _unforeseen(error: Exception) -> int:
    """Usage errors of the command line library, and what nobody foresaw."""
    status = getattr(error, "exit_code", None)
    if isinstance(status, int):
        message = getattr(error, "format_message", lambda: "")()
        if message.startswith("Usage:"):  # nothing was typed: the help is the answer
            typer.echo(message)
            return status
        return complain(message, status) if message else status
    if os.environ.get("SWARMBID_DEBUG"):
        raise error
    what = f"{type(error).__name__}: {error}"
    return complain(
        f"this is a fault of swarmbid, not yours: {what}\n"
        "Please report it with what you typed; SWARMBID_DEBUG=1 shows where it happened.",
        1,
    )
