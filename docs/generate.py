"""Write the parts of the documentation that the code knows best.

    python -m docs.generate

Each page or picture in `PAGES` is made from the tables, schemas and help texts of the package, so it
cannot say anything else than the program does. The tests make them again and compare.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterable, Mapping
from dataclasses import fields
from io import BytesIO
from pathlib import Path
from typing import Any, get_args, get_type_hints

from typer.models import ArgumentInfo

from swarmbid import registry
from swarmbid.algorithms import _contract_tables as contract
from swarmbid.algorithms.cbba import DECISION_RULES
from swarmbid.cli import app
from swarmbid.kernels import consensus
from swarmbid.missionfile import load_mission, mission_schema
from swarmbid.missions import charts
from swarmbid.plan import REASONS
from swarmbid.report import render_film_strip, render_map_svg
from swarmbid.scenarios import search_track
from swarmbid.scores import Score
from swarmbid.simulator import simulate
from swarmbid.trace import read_trace, trace_schema
from swarmbid.verify import RULES
from swarmbid.worldsim import fly

DOCS = Path(__file__).resolve().parent
EXAMPLES = DOCS.parent / "examples"
FILM_SEED, FILM_TARGET = 1, "m02"
NOTE = "<!-- Written by `python -m docs.generate`; do not edit. -->\n\n"


def main() -> None:
    """Write every generated page and picture."""
    for name, make in PAGES.items():
        path = DOCS / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(make(), encoding="utf-8")
        print(f"wrote docs/{name}")


def picture() -> str:
    """Draw the map of the demo's plan, the picture of the README."""
    mission = load_mission(EXAMPLES / "substations.yaml")
    return render_map_svg(mission, simulate(mission).plan) + "\n"


def film_strip() -> str:
    """Draw how one moving target of the default search is found, followed and handed over."""
    record = BytesIO()
    fly(search_track.make(seed=FILM_SEED), seed=FILM_SEED, trace=record)
    record.seek(0)
    return render_film_strip(read_trace(record), FILM_TARGET) + "\n"


# --- the decision table

_BELIEVES = {
    consensus.SENDER: "k, itself",
    consensus.RECEIVER: "i, itself",
    consensus.NOBODY: "nobody",
}
_FACTS = {
    consensus.BETTER: "k's bid outbids i's",
    consensus.NEWER_THEIRS: "k has newer news of {m}",
    consensus.NEWER_MINE: "k has newer news of {n}",
    consensus.OLDER_THEIRS: "i has newer news of {m}",
}
_ACTIONS = {consensus.UPDATE: "**update**", consensus.RESET: "**reset**"}


def decision_table() -> str:
    """Print `DECISION_RULES`, row by row."""
    rows = []
    for number, ((says, thinks), lines) in enumerate(DECISION_RULES.items(), start=1):
        sender = "i" if says == consensus.RECEIVER else _BELIEVES.get(says, "m")
        if thinks == consensus.SAME:
            receiver = "m, too"
        else:
            receiver = "k" if thinks == consensus.SENDER else _BELIEVES.get(thinks, "n")
        names = {"m": "m" if sender == "m" else "k", "n": "n" if receiver == "n" else receiver[0]}
        said = [_line(facts, action, names) for facts, action in lines]
        complete = bool(lines) and lines[-1][0] == 0
        rows.append((str(number), sender, receiver, "; else ".join(said) if said else "leave"))
        if said and not complete:
            rows[-1] = (*rows[-1][:3], rows[-1][3] + "; else leave")
    return (
        NOTE
        + "# The decision table of CBBA\n\n"
        + "A message from agent k reaches agent i. For each task that the message lists, k believes in one "
        "winner and i in another, or in the same, or in nobody. m is a third agent that k believes in, n a "
        "third agent that i believes in. What i does with its own belief:\n\n"
        + _table(("row", "k believes in", "i believes in", "i does"), rows)
        + "\n**Update**: take over k's winner and bid. **Reset**: believe in nobody, with no bid. **Leave**: "
        "keep the belief.\n\n"
        "A bid *outbids* another if it is higher, or equal and its agent's id is higher. *Newer news of an "
        "agent* means a higher stamp: the agent's own message counter, relayed unchanged. Stamps are raised "
        "after all rows of a message are applied.\n\n"
        "The table is data: `swarmbid.algorithms.cbba.DECISION_RULES` is what the compiled kernel looks up, "
        "and this page is printed from it. [The algorithms](algorithms.md) tells where it departs from the "
        "published one.\n"
    )


def _line(facts: int, action: int, names: dict[str, str]) -> str:
    needed = [text.format(**names) for fact, text in _FACTS.items() if facts & fact]
    done = _ACTIONS[action]
    return f"{done} if {' and '.join(needed)}" if needed else done


# --- the Contract Net, and the charts of a search

_MANAGER_DOES = {
    "announce": "calls for proposals, under a new epoch",
    "reopen": "calls for proposals again, under the next epoch",
    "resume": "calls again under the next epoch; answers that were given still count",
    "award": "offers the task to the best proposal",
    "next_best": "moves to the next epoch, for the next best proposal",
    "revoke": "takes the award back; the late confirmation will mean nothing",
    "contract": "puts the contract in force, and so tells the losers",
    "take": "takes the task itself, at once",
    "take_over": "takes the task, and claims the rest of the best bidder's path",
    "claim": "awards itself what another holds and has not started",
    "adopt": "leaves the task with who holds it, under its own next epoch",
    "lift": "lets the contract stand, under an epoch above all that it heard of",
    "keep": "goes on with the task itself: nobody takes it over",
    "park": "lets the task rest, with the reasons that were given",
    "inherit": "leaves the task at rest, as the manager before it did",
    "back_off": "waits, twice as long each time",
    "give_up": "ends the task for good, with the reasons",
    "withdraw": "leaves the task to the other manager",
    "close": "lets go of the conversation",
}
_CONTRACTOR_DOES = {
    "propose": "sends its bid, with the path and the start that it rests on",
    "refuse": "sends the reason why it cannot",
    "confirm": "confirms, and keeps the place in its path",
    "decline": "says that the proposal has been withdrawn",
    "take": "is under contract, and says so",
    "renew": "stays under contract, under the newer epoch",
    "drop": "thinks no more of it; what was proposed was only proposed",
    "release": "takes it out of its path, and says so",
    "give_back": "gives it back, with the reason",
    "hand_over": "lets go of it: its successor has begun",
    "start": "says that it has begun",
    "finish": "says that it is done",
    "fail": "says that it failed, and why",
    "close": "lets go of the conversation",
}


def contract_tables() -> str:
    """Print the two tables of the Contract Net, row by row."""
    return (
        NOTE + "# The tables of the Contract Net\n\n"
        "What an agent does about whatever comes, for each task and each of its two roles. [The Contract "
        "Net](contract-net.md) explains the words. The tables are data that agents look up, and this page "
        "is printed from them. They are total: what is not listed here changes nothing.\n\n"
        "Where several things have come, they are looked for in the order of the table, and the first that "
        "means anything is acted upon.\n\n"
        "## The manager\n\nStates: "
        + _words(contract.MANAGER_STATES)
        + ".\n\n"
        + _transitions(contract.MANAGER, contract.MANAGER_EVENTS, _MANAGER_DOES)
        + "\n## The contractor\n\nStates: "
        + _words(contract.CONTRACTOR_STATES)
        + ".\n\n"
        + _transitions(contract.CONTRACTOR, contract.CONTRACTOR_EVENTS, _CONTRACTOR_DOES)
    )


def _transitions(table: contract.Table, events: tuple[str, ...], does: dict[str, str]) -> str:
    """One row for each event and what it leads to, the states from which it does so together."""
    rows = []
    for event in events:
        found: dict[tuple[str, str], list[str]] = {}
        for (state, what), (action, after) in table.items():
            if what == event and action != contract.NOTHING:
                found.setdefault((action, after), []).append(state)
        for (action, after), states in found.items():
            rows.append((event, ", ".join(states), does[action], f"**{after}**"))
    return _table(("what came", "in state", "the agent", "next state"), rows)


def search_charts() -> str:
    """Print the two statecharts of the search-and-track mission."""
    return (
        NOTE + "# The statecharts of a search\n\n"
        "What the words of the Contract Net mean to a UAV of a [search](search-and-track.md), for each "
        'target, after the slides\' "Manager statecharts" and "Potential contractors statecharts". This '
        "page is printed from `swarmbid.missions.charts`, by which the UAVs go. What is not listed leaves "
        "the state as it is.\n\n## A manager: the UAV that found the target\n\n"
        + _moves(charts.MANAGER_CHART, charts.MANAGER_STATES)
        + "\n## A potential contractor: a UAV that hears of it\n\n"
        + _moves(charts.CONTRACTOR_CHART, charts.CONTRACTOR_STATES)
    )


def _moves(chart: Mapping[tuple[str, str], str], states: tuple[str, ...]) -> str:
    rows = []
    for state in states:
        found: dict[str, list[str]] = {}
        for (before, event), after in chart.items():
            if before == state and after != state:
                found.setdefault(after, []).append(event)
        rows += [(state, "; or ".join(events), f"**{after}**") for after, events in found.items()]
    return _table(("in state", "what happens", "next state"), rows)


def _words(names: Iterable[str]) -> str:
    return ", ".join(f"`{name}`" for name in names)


# --- the mission file


def mission_file() -> str:
    """Print the fields of a mission file from its JSON Schema."""
    schema = mission_schema()
    kinds = schema["$defs"]
    parts = [
        NOTE + "# Mission file\n\n"
        "YAML or JSON, version 1. Units are SI. `swarmbid schema` prints the JSON Schema from which these "
        "tables are made; [Write a mission file](../how-to/mission-file.md) shows the fields in use.\n",
        "\n## The file\n\n" + _fields(schema),
    ]
    for name, title in (
        ("AgentSpec", "An agent"),
        ("TaskSpec", "A task"),
        ("OriginSpec", "The origin"),
        ("GeodeticSpec", "A position on Earth"),
    ):
        parts.append(f"\n## {title}\n\n{kinds[name]['description']}\n\n{_fields(kinds[name])}")
    return "".join(parts)


def _fields(schema: dict[str, Any]) -> str:
    needed = schema.get("required", [])
    rows = []
    for name, found in schema["properties"].items():
        default = "required" if name in needed else _default(found.get("default"))
        text = found.get("description", "").rstrip(".")
        limits = [
            f"{word} {found[key]}"
            for key, word in (("exclusiveMinimum", "above"), ("minimum", "at least"), ("maximum", "at most"))
            if key in found
        ]
        rows.append((f"`{name}`", _type(found), default, "; ".join([text, *limits]) + "."))
    return _table(("field", "type", "default", "meaning"), rows)


def _default(value: Any) -> str:
    if value in (None, [], {}):
        return ""
    return f"`{value:g}`" if isinstance(value, float) else f"`{value}`"


def _type(schema: dict[str, Any]) -> str:
    """Name a JSON Schema type in a word or two."""
    if "$ref" in schema:
        name = schema["$ref"].rpartition("/")[2]
        return {"GeodeticSpec": "{latitude, longitude, altitude}"}.get(name, "mapping")
    if "enum" in schema:
        return " or ".join(f"`{item}`" for item in schema["enum"])
    if "const" in schema:
        return f"`{schema['const']}`"
    choices = schema.get("anyOf") or schema.get("oneOf")
    if choices:
        return " or ".join(_type(choice) for choice in choices if choice.get("type") != "null")
    kind = schema.get("type", "any")
    if kind == "array":
        if schema.get("maxItems") == 3:
            return "[east, north, up]"
        return f"list of {_plural(schema.get('items', {}))}"
    if kind == "object":
        return "mapping"
    return {"string": "text", "integer": "whole number", "boolean": "true or false"}.get(kind, kind)


def _plural(schema: dict[str, Any]) -> str:
    if "$ref" in schema:
        return {"AgentSpec": "agents", "TaskSpec": "tasks"}.get(schema["$ref"].rpartition("/")[2], "mappings")
    return {"string": "texts", "number": "numbers"}.get(schema.get("type", ""), "items")


# --- the trace


def trace_format() -> str:
    """Print the records of a trace from its JSON Schema."""
    parts = [
        NOTE + "# Trace format\n\n"
        "A trace is the record of one run: JSON lines, version 1, written by `swarmbid simulate --trace` and "
        "`swarmbid plan --trace`. The first line is of kind `trace`, the last of kind `result`. The format "
        "grows by appending: readers keep kinds that they do not know and skip fields that they do not know. "
        "`swarmbid schema --trace` prints the JSON Schema from which these tables are made.\n"
    ]
    for found in trace_schema()["$defs"].values():
        kind = found["properties"]["kind"]["enum"][0]
        rows = [
            (
                f"`{field}`",
                _type(item),
                "" if field in found.get("required", ()) else _trace_default(item),
                item.get("description", ""),
            )
            for field, item in found["properties"].items()
            if field != "kind"
        ]
        parts.append(f"\n## `{kind}`\n\n{found['description']}\n\n")
        parts.append(_table(("field", "type", "default", "meaning"), rows))
    return "".join(parts)


def _trace_default(schema: dict[str, Any]) -> str:
    value = schema.get("default")
    if value is None:
        return "`null`"
    return f"`{str(value).lower()}`" if isinstance(value, bool) else f"`{value!r}`".replace("'", '"')


# --- the command line


def command_line() -> str:
    """Print every command from the signature that it is made of."""
    parts = [
        NOTE + "# Command line\n\n"
        "`swarmbid COMMAND --help` shows the same. Exit status: 0 done; 1 the mission is not fully served, "
        "the agents did not agree, or a check failed; 2 the input or the command is wrong.\n"
    ]
    for command in app.registered_commands:
        function: Any = command.callback
        text = "\n\n".join(" ".join(part.split()) for part in inspect.getdoc(function).split("\n\n"))
        hints = get_type_hints(function, include_extras=True)
        rows = [
            _parameter(name, hints[name], found.default)
            for name, found in inspect.signature(function).parameters.items()
        ]
        table = _table(("argument or option", "value", "default", "meaning"), rows)
        parts.append(f"\n## `swarmbid {command.name}`\n\n{text}\n\n{table}")
    return "".join(parts)


def _parameter(name: str, hint: Any, default: Any) -> tuple[str, str, str, str]:
    kind, info = get_args(hint)
    shown = "" if default is None or default is False else f"`{default}`"
    meaning = info.help
    if isinstance(info, ArgumentInfo):
        required = default is inspect.Parameter.empty
        return f"`{info.metavar or name.upper()}`", _value(kind), "required" if required else shown, meaning
    # Within Annotated, the first of the names that are given stands in the place of a default.
    given = [each for each in (info.default, *(info.param_decls or ())) if isinstance(each, str)]
    names = given or [f"--{name.replace('_', '-')}"]
    value = f"`{info.metavar}`" if info.metavar else _value(kind)
    if "list" in str(kind):
        meaning += " May be given several times."
    return ", ".join(f"`{each}`" for each in names), value, shown, meaning


def _value(kind: Any) -> str:
    """Name a Python type in a word or two."""
    kinds = [each for each in get_args(kind) if each is not type(None)] or [kind]
    return {bool: "", int: "whole number", float: "number", Path: "path", str: "text"}[kinds[0]]


# --- plug-ins, reasons, rules


def plug_ins() -> str:
    """Print what can be chosen by name, and the words that a plan and its check use."""
    parts = [
        NOTE + "# Names\n\nWhat `swarmbid list` lists, and the words of a plan and of its check.\n",
    ]
    for folder in ("algorithms", "scores", "scenarios", "references", "datasets"):
        found = [(f"`{name}`", registry.summary(folder, name)) for name in registry.names(folder)]
        parts.append(f"\n## {folder.capitalize()}\n\n" + _table(("name", "what it is"), found))
        if folder == "scores":
            parts.append("\n" + _table(("score", "option", "default"), _score_options()))
    parts.append("\n## Why a task is not served\n\n")
    parts.append(_table(("reason", "meaning"), ((f"`{key}`", text) for key, text in REASONS.items())))
    parts.append("\n## What `verify` proves\n\n")
    parts.append(_table(("rule", "what must hold"), ((f"`{key}`", text) for key, text in RULES.items())))
    return "".join(parts)


def _score_options() -> list[tuple[str, str, str]]:
    rows = []
    for name in registry.names("scores"):
        cls: Any = registry.load_class("scores", name, Score)
        rows += [(f"`{name}`", f"`{option.name}`", f"`{option.default}`") for option in fields(cls)]
    return rows


def _table(head: tuple[str, ...], rows: Iterable[tuple[str, ...]]) -> str:
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    lines += ["| " + " | ".join(cell.replace("|", "\\|") for cell in row) + " |" for row in rows]
    return "\n".join(lines) + "\n"


PAGES: dict[str, Callable[[], str]] = {
    "images/substations.svg": picture,
    "images/search-film.svg": film_strip,
    "explanation/decision-table.md": decision_table,
    "explanation/contract-tables.md": contract_tables,
    "explanation/search-charts.md": search_charts,
    "reference/command-line.md": command_line,
    "reference/mission-file.md": mission_file,
    "reference/trace.md": trace_format,
    "reference/names.md": plug_ins,
}
"""Path below ``docs/`` -> what makes it."""

if __name__ == "__main__":
    main()
