"""``swarmbid simulate``: rehearse a mission or a made-up scenario on a network with faults."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path
from typing import Annotated, Any

import typer

from swarmbid.cli.plan import AsJson, Insertion, PlanFile, Report, ScoreName, Seed, TraceFile, With
from swarmbid.errors import Fault, InputError, did_you_mean


def simulate(
    what: Annotated[
        str, typer.Argument(metavar="MISSION|SCENARIO", help="A mission file, or a scenario's name.")
    ],
    algorithm: Annotated[
        str | None,
        typer.Option("-a", "--algorithm", help="See `swarmbid list`; cbba, or contract_net for a search."),
    ] = None,
    score: ScoreName = None,
    insertion: Insertion = None,
    algorithm_option: With = None,
    seed: Seed = 0,
    agents: Annotated[int | None, typer.Option(min=0, help="Agents of a scenario.")] = None,
    tasks: Annotated[int | None, typer.Option(min=0, help="Tasks of a scenario.")] = None,
    agents_required: Annotated[
        int | None, typer.Option(min=1, help="Agents for each task of a scenario with groups.")
    ] = None,
    option: Annotated[
        list[str] | None, typer.Option("--set", metavar="NAME=VALUE", help="Further options of a scenario.")
    ] = None,
    graph: Annotated[
        str,
        typer.Option(help="complete, ring, line, star, tree, geometric or range (over the agents' places)."),
    ] = "complete",
    mean_degree: Annotated[
        float | None, typer.Option(help="Neighbours of each agent, geometric or range.")
    ] = None,
    communication_range: Annotated[
        float | None, typer.Option("--range", help="m, for the range graph.")
    ] = None,
    loss: Annotated[float, typer.Option(help="Share of messages lost, 0 to 1.")] = 0.0,
    burst: Annotated[float | None, typer.Option(help="Mean messages lost in a row.")] = None,
    delay: Annotated[float, typer.Option(help="Mean extra delay in rounds; messages overtake.")] = 0.0,
    duplicate: Annotated[float, typer.Option(help="Share of messages that arrive twice.")] = 0.0,
    partition: Annotated[
        list[str] | None,
        typer.Option(metavar="START:END:IDS", help="Cut agents IDS (comma) off from START to END s."),
    ] = None,
    asynchronous: Annotated[bool, typer.Option(help="Every agent has a clock phase of its own.")] = False,
    max_rounds: Annotated[int | None, typer.Option(min=1, help="Give up after so many rounds.")] = None,
    output: PlanFile = None,
    report: Report = None,
    trace: TraceFile = None,
    as_json: AsJson = False,
) -> None:
    """Rehearse a mission file or a scenario (`swarmbid list`) on a network with faults, all from one seed."""
    from swarmbid.cli.options import algorithm_options
    from swarmbid.cli.output import check_writable
    from swarmbid.cli.running import carry_out
    from swarmbid.model import Mission
    from swarmbid.network import Network, agent_positions, make_topology

    check_writable(output, report, trace, given=Path(what))
    counts = {"agents": agents, "tasks": tasks, "agents_required": agents_required}
    mission = _mission(what, seed, counts, option or [])
    if not isinstance(mission, Mission):
        given = {
            "--score": score, "--insertion": insertion, "--mean-degree": mean_degree, "--burst": burst,
            "--range": communication_range, "--duplicate": duplicate or None, "--partition": partition,
            "--asynchronous": asynchronous or None, "--max-rounds": max_rounds, "--output": output,
            "--graph": None if graph == "complete" else graph,
        }  # fmt: skip
        raise typer.Exit(
            _search(
                mission,
                what,
                given,
                algorithm,
                algorithm_option or [],
                seed,
                loss,
                delay,
                trace,
                report,
                as_json,
            )
        )
    algorithm = algorithm or "cbba"
    num_agents = max(len(mission.agents), 1)
    network = Network(
        make_topology(
            graph,
            num_agents,
            seed=seed,
            mean_degree=mean_degree,
            positions=agent_positions(mission) if mission.agents else None,
            communication_range=communication_range,
        ),
        seed=seed,
        loss=loss,
        burst=burst,
        delay=delay,
        duplicate=duplicate,
        partitions=[_partition(text, mission) for text in partition or []],
    )
    status = carry_out(
        mission,
        algorithm=algorithm,
        score=score,
        insertion=insertion,
        options=algorithm_options(algorithm, algorithm_option or []),
        network=network,
        seed=seed,
        mode="asynchronous" if asynchronous else "rounds",
        trace=trace,
        plan_file=output,
        report=report,
        as_json=as_json,
        max_rounds=max_rounds,
    )
    raise typer.Exit(status)


def _search(
    mission: Any,
    what: str,
    given: dict[str, Any],
    allocation: str | None,
    settings: list[str],
    seed: int,
    loss: float,
    delay: float,
    trace: Path | None,
    report: Path | None,
    as_json: bool,
) -> int:
    """Fly a scenario that is a search; `given` holds options that only a negotiation has."""
    from swarmbid.cli.searching import fly_and_tell, search_options

    faults = [
        Fault(name, "", f"is for negotiations, and {what} is a search", "Leave it out; see --set and --with.")
        for name, value in given.items()
        if value is not None
    ]
    if faults:
        raise InputError(faults)
    return fly_and_tell(
        mission, allocation=allocation or "contract_net", options=search_options(settings, mission),
        seed=seed, loss=loss, delay=delay, trace=trace, report=report, as_json=as_json,
    )  # fmt: skip


def _mission(what: str, seed: int, counts: dict[str, int | None], settings: list[str]) -> Any:
    """Load a file, or make a scenario.

    Parameters
    ----------
    counts : options of a scenario that have an option of the command line of their own; None if not given.
    settings : others, each as NAME=VALUE.
    """
    from swarmbid import registry
    from swarmbid.missionfile import load_mission

    known = registry.names("scenarios")
    if what not in known:
        path = Path(what)
        if not path.exists() and path.suffix == "" and len(path.parts) == 1:
            mend = did_you_mean(what, known) or "Scenarios: " + ", ".join(known) + "."
            raise InputError([Fault(what, "", "is neither a file nor a scenario", mend)])
        given = {**{_typed(name): count for name, count in counts.items()}, "--set": settings or None}
        faults = [
            Fault(name, "", f"is for scenarios, and {what} is a mission file", "Leave it out.")
            for name, value in given.items()
            if value is not None
        ]
        if faults:
            raise InputError(faults)
        return load_mission(path)
    module = registry.load("scenarios", what)
    options: dict[str, Any] = {item.name: item.default for item in fields(module.OPTIONS)}
    chosen: dict[str, Any] = {}
    for name, count in counts.items():
        if count is None:
            continue
        if name not in options:
            mend = "It has: " + ", ".join(options) + "."
            raise InputError([Fault(_typed(name), "", f"is no option of {what}", mend)])
        chosen[name] = count
    for setting in settings:
        name, equals, text = setting.partition("=")
        if not equals or name not in options:
            mend = did_you_mean(name, options) or "It has: " + ", ".join(options) + "."
            raise InputError([Fault(f"--set {setting}", "", f"names no option of {what}", mend)])
        kind = type(options[name])
        try:
            chosen[name] = kind(text)
        except ValueError:
            raise InputError(
                [Fault(f"--set {setting}", "", f"{text!r} is no {kind.__name__}", "Give a number.")]
            ) from None
    return module.make(seed, **chosen)


def _typed(name: str) -> str:
    """Return an option as it is typed: ``--agents-required``."""
    return "--" + name.replace("_", "-")


def _partition(text: str, mission: Any) -> Any:
    """Read START:END:IDS."""
    from swarmbid.network import Partition

    rows = {
        agent.id: row for row, agent in enumerate(sorted(mission.agents, key=lambda one: one.id.encode()))
    }
    parts = text.split(":")
    where = f"--partition {text}"
    if len(parts) != 3:
        raise InputError(
            [Fault(where, "", "is not of the form START:END:IDS", "Write for example 5:40:a1,a2.")]
        )
    try:
        start, end = float(parts[0]), float(parts[1])
    except ValueError:
        raise InputError([Fault(where, "", "START and END are not numbers", "Give seconds.")]) from None
    strangers = [name for name in parts[2].split(",") if name not in rows]
    if strangers:
        mend = did_you_mean(strangers[0], rows) or "Name agents of the mission."
        raise InputError([Fault(where, "", f"there is no agent {strangers[0]!r}", mend)])
    return Partition(groups=(tuple(rows[name] for name in parts[2].split(",")),), start=start, end=end)
