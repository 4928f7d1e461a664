"""``swarmbid plan``: allocate a mission, check the plan, show it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

Mission = Annotated[Path, typer.Argument(metavar="MISSION", help="Mission file, YAML or JSON.")]
Algorithm = Annotated[str, typer.Option("-a", "--algorithm", help="See `swarmbid list`.")]
ScoreName = Annotated[
    str | None, typer.Option("-s", "--score", help="A score's name, or a .py file that defines score(visit).")
]
Insertion = Annotated[
    str | None,
    typer.Option(
        help="hold (promised times stay), shift (later visits may slip) or append; the score's own."
    ),
]
With = Annotated[
    list[str] | None,
    typer.Option("--with", metavar="NAME=VALUE", help="Options of the algorithm, e.g. team_rewards=true."),
]
Seed = Annotated[int, typer.Option(min=0, help="Seed of everything that is random.")]
PlanFile = Annotated[Path | None, typer.Option("-o", "--output", help="Write the plan here, JSON.")]
Report = Annotated[Path | None, typer.Option(help="Write one self-contained HTML page here.")]
TraceFile = Annotated[
    Path | None, typer.Option("--trace", help="Write the record of the run here, JSON lines.")
]
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON instead of tables.")]


def plan(
    mission: Mission,
    algorithm: Algorithm = "cbba",
    score: ScoreName = None,
    insertion: Insertion = None,
    option: With = None,
    seed: Seed = 0,
    output: PlanFile = None,
    report: Report = None,
    trace: TraceFile = None,
    as_json: AsJson = False,
) -> None:
    """Allocate MISSION among its agents, check the plan and show it.

    With -o or --report and no --trace, the trace is written beside that file, for `swarmbid why`.
    """
    from swarmbid.cli.options import algorithm_options
    from swarmbid.cli.output import check_writable
    from swarmbid.cli.running import carry_out
    from swarmbid.missionfile import load_mission

    check_writable(output, report, given=mission)
    first = output or report
    if trace is None and first is not None and not first.is_char_device():
        trace = first.with_suffix(".trace.jsonl")
    check_writable(output, report, trace, given=mission)
    status = carry_out(
        load_mission(mission),
        algorithm=algorithm,
        score=score,
        insertion=insertion,
        options=algorithm_options(algorithm, option or []),
        network=None,
        seed=seed,
        mode="rounds",
        trace=trace,
        plan_file=output,
        report=report,
        as_json=as_json,
    )
    raise typer.Exit(status)
