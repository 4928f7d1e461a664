"""What `plan` and `simulate` have in common: run, check, tell, write."""

from __future__ import annotations

import json
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

from swarmbid.cli.output import (
    complain,
    count_of,
    say,
    say_json,
    say_table,
    shortened,
    write_text,
)
from swarmbid.cli.waiting import rounds_shown
from swarmbid.errors import Fault, InputError
from swarmbid.model import Mission

if TYPE_CHECKING:
    from swarmbid.simulator import Run
    from swarmbid.trace import Trace

PATH_WIDTH = 60
MOST_UNSERVED = 20


def carry_out(
    mission: Mission,
    *,
    algorithm: str,
    score: str | None,
    insertion: str | None,
    options: dict[str, Any],
    network: Any,
    seed: int,
    mode: str,
    trace: Path | None,
    plan_file: Path | None,
    report: Path | None,
    as_json: bool,
    max_rounds: int | None = None,
) -> int:
    """Run a negotiation, print what came of it, write what was asked for; return the exit status."""
    from swarmbid.verify import verify

    run, record = _run(
        mission,
        trace,
        recorded=report is not None or as_json,
        algorithm=algorithm,
        score=score,
        insertion=insertion,
        **options,
        network=network,
        seed=seed,
        mode=mode,
        max_rounds=max_rounds,
    )
    plan = run.plan
    violations = verify(mission, plan, run.score)
    if plan_file is not None:
        write_text(plan_file, json.dumps(plan.to_dict(), indent=1) + "\n")
    if report is not None:
        from swarmbid.report import render_report

        write_text(report, render_report(mission, plan, record, violations))
    problems = []
    if not run.converged:
        problems.append(f"the agents did not agree: {run.reason}")
    if plan.unserved:
        tasks = count_of(len(mission.tasks), "task")
        problems.append(
            f"{len(plan.unserved)} of {tasks} {'is' if len(plan.unserved) == 1 else 'are'} not served"
        )
    if violations:
        problems.append(f"the plan breaks {count_of(len(violations), 'rule')}; the first: {violations[0]}")
    figures = {
        "status": run.status,
        "reason": run.reason,
        "rounds": run.rounds,
        "last_bid_round": run.last_bid_round,
        "declared_round": run.declared_round,
        "messages": run.messages,
        "bytes": run.bytes,
        "dropped": run.dropped,
    }
    if as_json:
        from swarmbid.metrics import measure

        say_json(
            {
                "run": figures,
                "metrics": measure(record).to_dict() if record is not None else None,
                "plan": plan.to_dict(),
                "disagreements": run.disagreements,
                "violations": [str(violation) for violation in violations],
                "problems": problems,
            }
        )
    else:
        _tell(mission, run, plan)
        _tell_files(plan_file, report, trace, plan)
    for problem in problems:
        complain(problem, 1)
    return 1 if problems else 0


def _run(
    mission: Mission, trace: Path | None, *, recorded: bool, score: str | None, **options: Any
) -> tuple[Run, Trace | None]:
    """Simulate; also return the record if `recorded`, even where no file of it is to be kept."""
    from swarmbid.simulator import simulate
    from swarmbid.trace import read_trace

    kept = BytesIO() if trace is None and recorded else trace
    with rounds_shown(mission.name) as show:
        try:
            run = simulate(mission, score=score, trace=kept, progress=show, **options)
        except InputError:
            raise
        except Exception as error:
            if score is None or not score.endswith(".py"):
                raise
            # Numba names itself first and the cause after it.
            said = [line.strip() for line in str(error).splitlines() if "nopython" not in line]
            why = f"fails: {type(error).__name__}: {next(filter(None, said), '')}"
            mend = "It may use arithmetic and `math`, and returns a number for every visit."
            raise InputError([Fault(score, "score", why, mend)]) from None
    if isinstance(kept, BytesIO):
        kept.seek(0)
    return run, read_trace(kept) if kept is not None and recorded else None


def _tell(mission: Mission, run: Any, plan: Any) -> None:
    served = len(mission.tasks) - len(plan.unserved)
    agreed = (
        f"agreed in {count_of(run.rounds, 'round')}, known to all after {run.declared_round}"
        if run.converged
        else "NOT AGREED"
    )
    team = f"{served} of {count_of(len(mission.tasks), 'task')} served by"
    say(f"{mission.name}: {team} {count_of(len(mission.agents), 'agent')}; {agreed}.")
    honest = (
        "" if plan.honest_score == plan.total_score else f" ({plan.honest_score:,.6g} with every leg once)"
    )
    say(
        f"Score {plan.total_score:,.6g}{honest} by {run.algorithm}, {run.score.name}, {run.insertion}; "
        f"{count_of(run.messages, 'message')}, {count_of(run.bytes, 'byte')}."
    )
    if plan.agents:
        say("")
        say_table(
            ["agent", "tasks", "km", "done at s", "score", "path"],
            [
                [
                    one.agent,
                    str(len(one.visits)),
                    f"{one.distance / 1000.0:.2f}",
                    f"{one.finish:.0f}" if one.visits else "-",
                    f"{one.score:.2f}",
                    shortened((visit.task for visit in one.visits), PATH_WIDTH),
                ]
                for one in plan.agents
            ],
            text=(0, 5),
        )
    if plan.unserved:
        say("", "Not served:")
        say_table(
            ["task", "reason", "detail"],
            [[left.task, left.reason, left.detail] for left in plan.unserved[:MOST_UNSERVED]],
            text=(0, 1, 2),
        )
        if len(plan.unserved) > MOST_UNSERVED:
            say(f"and {len(plan.unserved) - MOST_UNSERVED} more; the plan and the report have them all.")


def _tell_files(plan_file: Path | None, report: Path | None, trace: Path | None, plan: Any) -> None:
    if plan_file is None and report is None and trace is None:
        return
    say("")
    for what, path in (("plan", plan_file), ("report", report), ("trace", trace)):
        if path is not None:
            say(f"{what + ':':<8}{path}")
    first = next((visit.task for one in plan.agents for visit in one.visits), None)
    if trace is not None and first is not None:
        say(f"{'next:':<8}swarmbid why {trace} {first}")
