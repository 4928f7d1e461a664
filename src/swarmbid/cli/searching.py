"""What `simulate` does with a search mission: fly it, tell how it went, write what was asked for."""

from __future__ import annotations

from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

from swarmbid.cli.output import complain, count_of, say, say_json, say_table, write_text
from swarmbid.cli.waiting import seconds_shown
from swarmbid.errors import Fault, InputError, did_you_mean
from swarmbid.trace import read_trace

if TYPE_CHECKING:
    from swarmbid.world.mission import SearchMission


def search_options(settings: list[str], mission: SearchMission) -> dict[str, Any]:
    """Return ``strategy=NAME`` and ``crash=ID@SECONDS`` as `swarmbid.worldsim.fly` takes them."""
    found: dict[str, Any] = {}
    crashes: dict[str, float] = {}
    for setting in settings:
        name, _, value = setting.partition("=")
        if name == "strategy":
            found["strategy"] = value
        elif name == "crash":
            agent, _, when = value.partition("@")
            try:
                crashes[agent] = float(when)
            except ValueError:
                mend = "Write for example --with crash=uav02@600."
                raise InputError([Fault(f"--with {setting}", "", "has no time in s", mend)]) from None
        else:
            mend = did_you_mean(name, ["strategy", "crash"]) or "A search mission has: strategy, crash."
            raise InputError([Fault(f"--with {setting}", "", f"names no option of {mission.name}", mend)])
    return found | {"crashes": crashes}


def fly_and_tell(
    mission: SearchMission,
    *,
    allocation: str,
    options: dict[str, Any],
    seed: int,
    loss: float,
    delay: float,
    trace: Path | None,
    report: Path | None,
    as_json: bool,
) -> int:
    """Fly a search mission, print what came of it, write what was asked for; return the exit status."""
    from swarmbid.worldsim import fly

    kept = BytesIO() if trace is None and report is not None else trace
    with seconds_shown(mission.name) as show:
        sortie = fly(
            mission,
            seed=seed,
            allocation=allocation,
            loss=loss,
            delay=delay,
            trace=kept,
            progress=show,
            **options,
        )
    if report is not None:
        from swarmbid.report import render_search_report

        if isinstance(kept, BytesIO):
            kept.seek(0)
        assert kept is not None
        write_text(report, render_search_report(read_trace(kept)))
    measures = sortie.measures
    if as_json:
        say_json({"mission": mission.name, "strategy": sortie.strategy, "allocation": sortie.allocation,
                  "measures": measures.to_dict()})  # fmt: skip
    else:
        still = measures.targets - measures.moving
        say(
            f"{mission.name}: {round(measures.found * measures.targets)} of "
            f"{count_of(measures.targets, 'target')} found by {count_of(len(mission.vehicles), 'UAV')} in "
            f"{mission.duration:.0f} s ({sortie.strategy}, {sortie.allocation})."
        )
        say("")
        rows = [
            ["first target found", f"{measures.first_detection:.0f} s"],
            ["mean time to find one", f"{measures.mean_detection:.0f} s"],
            ["static targets visited", f"{round(measures.served * still)} of {still}"],
            ["moving targets followed", f"{100 * measures.tracked:.0f} % of the time"],
            ["the same, once found", f"{100 * measures.tracked_since_found:.0f} %"],
            *(
                [["static targets identified", f"{round(measures.identified * still)} of {still}"]]
                if mission.identify
                else []
            ),
            *([["revisits made", f"{100 * measures.revisited:.0f} %"]] if mission.revisit else []),
            ["longest gap in following", f"{measures.longest_gap:.0f} s"],
            ["GOSPA, mean", f"{measures.gospa:.0f} m"],
            ["found and not served", str(measures.unserved)],
            ["false or double targets", str(measures.false_targets)],
            ["flown", f"{measures.metres / 1000.0:.1f} km"],
            ["messages", f"{measures.messages:,}, {measures.bytes / 1e6:.2f} MB"],
        ]
        say_table(["measure", "value"], rows, text=(0, 1))
        if trace is not None or report is not None:
            say("")
        for what, path in (("report", report), ("trace", trace)):
            if path is not None:
                say(f"{what + ':':<8}{path}")
        first = next((task for one in sortie.behaviours for task in sorted(one.contacts.known)), None)
        if trace is not None and first is not None:
            say(f"{'next:':<8}swarmbid why {trace} {first}")
    if measures.unserved:
        complain(f"{count_of(measures.unserved, 'target')} found and not served", 1)
    return 1 if measures.unserved else 0
