"""The command line as a user types it, right and wrong."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from swarmbid.plan import Plan
from swarmbid.trace import read_trace

QUICKSTART = "quickstart.yaml"


def test_plan_writes_the_plan_the_report_and_the_trace_and_says_what_next(swarmbid, tmp_path: Path):
    typed = swarmbid("plan", QUICKSTART, "-o", "plan.json", "--report", "report.html")
    assert (typed.status, typed.err) == (0, "")
    assert "6 of 6 tasks served by 3 agents; agreed in 3 rounds" in typed.out
    plan = Plan.from_dict(json.loads((tmp_path / "plan.json").read_text()))
    assert sum(len(one.visits) for one in plan.agents) == 6
    assert (tmp_path / "report.html").read_text().startswith("<!")
    following = typed.out.splitlines()[-1].split()
    assert following[:3] == ["next:", "swarmbid", "why"]
    explained = swarmbid(*following[2:])
    assert explained.status == 0
    assert f"{following[-1]}: type" in explained.out
    assert "its bid of" in explained.out


def test_plan_prints_json_that_says_the_same(swarmbid):
    typed = swarmbid("plan", QUICKSTART, "--json")
    found = json.loads(typed.out)
    assert typed.status == 0
    assert found["run"]["status"] == "converged"
    assert (found["problems"], found["violations"], found["disagreements"]) == ([], [], [])
    assert len(found["plan"]["agents"]) == 3


def test_simulate_a_scenario_with_faults_and_a_trace(swarmbid, tmp_path: Path):
    faults = ["--graph", "ring", "--loss", "0.3", "--delay", "1", "--duplicate", "0.1", "--seed", "7"]
    words = ["simulate", "uniform", "--agents", "5", "--tasks", "9", *faults, "--asynchronous"]
    typed = swarmbid(*words, "--trace", "run.jsonl", "--json")
    found = json.loads(typed.out)
    assert typed.status == 0
    assert found["metrics"]["messages"] == found["run"]["messages"]
    assert found["metrics"]["lost"] > 0
    again = swarmbid(*words, "--trace", "again.jsonl", "--json")
    assert again.out == typed.out
    assert (tmp_path / "again.jsonl").read_bytes() == (tmp_path / "run.jsonl").read_bytes()


def test_options_of_a_scenario_can_be_set(swarmbid):
    typed = swarmbid("simulate", "uniform", "--agents", "2", "--tasks", "3", "--set", "width=50", "--json")
    assert typed.status == 0
    assert max(one["distance"] for one in json.loads(typed.out)["plan"]["agents"]) < 3 * 71.0


def test_a_healed_partition_is_agreed_on(swarmbid):
    words = ["simulate", QUICKSTART, "--partition", "0:30:scout,mapper", "--json"]
    found = json.loads(swarmbid(*words).out)["run"]
    assert found["status"] == "converged"
    assert found["declared_round"] > 30


def test_no_agreement_ends_with_status_1_and_says_why(swarmbid):
    typed = swarmbid("simulate", QUICKSTART, "--graph", "line", "--max-rounds", "1")
    assert typed.status == 1
    assert "NOT AGREED" in typed.out
    assert "swarmbid: the agents did not agree: the beliefs still differed after 1 rounds" in typed.err


def test_tasks_not_served_end_with_status_1_and_their_reasons(swarmbid, tmp_path: Path):
    """One agent that may take one of two tasks."""
    (tmp_path / "m.yaml").write_text(
        "agents:\n- {id: a, position: [0, 0, 0], bundle_limit: 1}\n"
        "tasks:\n- {id: t1, position: [1, 0, 0]}\n- {id: t2, position: [2, 0, 0]}\n"
    )
    typed = swarmbid("plan", "m.yaml")
    assert typed.status == 1
    assert "Not served:\ntask  reason   detail\nt2    no_room" in typed.out
    assert typed.err == "swarmbid: 1 of 2 tasks is not served\n"


@pytest.mark.parametrize(
    ("text", "status"),
    [("agents: []\ntasks: []\n", 0), ("agents: [{id: a, position: [0, 0, 0]}]\ntasks: []\n", 0)],
)
def test_nobody_and_nothing_can_be_planned(swarmbid, tmp_path: Path, text: str, status: int):
    (tmp_path / "m.yaml").write_text(text)
    typed = swarmbid("plan", "m.yaml", "--report", "r.html")
    assert (typed.status, typed.err) == (status, "")
    assert "0 of 0 tasks served by" in typed.out


WRONG = {
    "nothing": "No such command 'nothing'.",
    "plan": "Missing argument 'MISSION'.",
    "plan nofile.yaml": "nofile.yaml: does not exist. Check the spelling of the path.",
    "plan .": ".: is a directory. Give the mission file inside it.",
    "plan QUICK -o no/p.json": "no/p.json: lies in no, which is no directory. Make it first.",
    "plan QUICK -o .": ".: is a directory. Give the path of a file in it.",
    "plan QUICK -o a.json --report a.json": "a.json: is named for two outputs.",
    "plan QUICK -o QUICK": "quickstart.yaml: is the input. Give the output a file of its own.",
    "simulate QUICK --trace QUICK": "quickstart.yaml: is the input.",
    "plan QUICK -s nothing": "there is no score 'nothing'. Choose one of: distance_cost, early_finish,",
    "plan QUICK -s none.py": "none.py: cannot be read: No such file or directory. Name a readable file.",
    "plan QUICK -a cbbaa": "there is no algorithm 'cbbaa'. Did you mean 'cbba'?",
    "plan QUICK --insertion push": "insertion: is 'push'. Choose one of: hold, shift, append.",
    "plan QUICK --seed -1": "Invalid value for '--seed'",
    "plan QUICK --colour": "No such option: --colour",
    "simulate unifrm": "unifrm: is neither a file nor a scenario. Did you mean 'uniform'?",
    "simulate QUICK --agents 3": "--agents: is for scenarios, and",
    "simulate uniform --graph rnig": "topology: is 'rnig'. Use one of complete, ring, line,",
    "simulate uniform --loss 2": "network: loss: is 2.0. Give a probability from 0 to 1.",
    "simulate uniform --delay -1": "network: delay: is -1.0 rounds. Give 0 or more.",
    "simulate uniform --set width=x": "--set width=x: 'x' is no float. Give a number.",
    "simulate uniform --set wdth=3": "--set wdth=3: names no option of uniform. Did you mean 'width'?",
    "simulate uniform --set reward_min=0": "uniform: reward_min: is 0.0. Give more than 0.",
    "plan QUICK --with full_evry=1": "names no option of cbba. Did you mean 'full_every'?",
    "plan QUICK --with full_every=x": "--with full_every=x: 'x' is no value of it. Give a number.",
    "plan QUICK -a cbga --with quitting=3": "'3' is no value of it. Give true or false.",
    "plan QUICK -a cbga --with dissolve=7": "dissolve: is 7.0. Give a share from 0 to 1.",
    "simulate QUICK --partition 3": "--partition 3: is not of the form START:END:IDS.",
    "simulate QUICK --partition a:3:scout": "--partition a:3:scout: START and END are not numbers.",
    "simulate QUICK --partition 1:3:scuot": "there is no agent 'scuot'. Did you mean 'scout'?",
    "why nofile x": "nofile: cannot be read: No such file or directory.",
    "why QUICK x": "is no swarmbid trace: its first line is no JSON object",
    "bench nothing": "there is no experiment 'nothing'. Choose one of: dcmrta,",
}


@pytest.mark.parametrize("line", WRONG)
def test_what_is_typed_wrong_ends_with_status_2_and_the_mend(swarmbid, line: str):
    typed = swarmbid(*[QUICKSTART if word == "QUICK" else word for word in line.split()])
    assert typed.status == 2
    assert typed.out == ""
    assert typed.err.startswith("swarmbid: ")
    assert WRONG[line] in typed.err


def test_an_older_file_is_kept_when_the_run_fails(swarmbid, tmp_path: Path):
    (tmp_path / "plan.json").write_text("precious")
    assert swarmbid("plan", QUICKSTART, "-s", "nothing", "-o", "plan.json").status == 2
    assert (tmp_path / "plan.json").read_text() == "precious"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["plan.json", QUICKSTART]


def test_a_task_that_is_not_there_is_said_to_be_misspelt(swarmbid):
    swarmbid("plan", QUICKSTART, "--trace", "t.jsonl")
    typed = swarmbid("why", "t.jsonl", "pilon")
    assert typed.status == 2
    assert typed.err == "swarmbid: t.jsonl: task: has no task 'pilon'. Did you mean 'pylon'?\n"


def test_why_prints_json(swarmbid):
    swarmbid("plan", QUICKSTART, "--trace", "t.jsonl")
    found = json.loads(swarmbid("why", "t.jsonl", "pylon", "--json").out)
    assert found["task"] == "pylon"
    assert found["winner"] == "courier"
    assert {other["agent"] for other in found["others"]} == {"mapper", "scout"}


def test_list_names_every_plug_in_with_what_it_is(swarmbid):
    found = json.loads(swarmbid("list", "--json").out)
    names = {(entry["kind"], entry["name"]) for entry in found}
    assert {("algorithm", "cbaa"), ("algorithm", "cbba"), ("score", "revisit"), ("dataset", "toptw")} <= names
    assert all(len(entry["summary"]) > 20 for entry in found)
    plain = swarmbid("list").out.splitlines()
    assert plain[0].split() == ["kind", "name", "what", "it", "is"]
    assert len(plain) == len(found) + 1


def test_schema_prints_json_schemas(swarmbid):
    mission, trace = (json.loads(swarmbid("schema", *more).out) for more in ([], ["--trace"]))
    assert mission["$schema"] == trace["$schema"] == "https://json-schema.org/draft/2020-12/schema"
    assert mission != trace


def test_bench_prints_the_table_and_writes_the_page(swarmbid, tmp_path: Path):
    typed = swarmbid("bench", "toptw", "--quick", "--write", "page.md")
    assert typed.status == 0
    assert typed.out.splitlines()[0].split()[:2] == ["family", "vehicles"]
    assert (tmp_path / "page.md").read_text().startswith("# Team orienteering")


def test_version_and_help(swarmbid):
    from swarmbid import __version__

    assert swarmbid("--version").out == f"swarmbid {__version__}\n"
    assert "simulate" in swarmbid("--help").out
    nothing = swarmbid()
    assert nothing.out.startswith("Usage: swarmbid")
    assert nothing.err == ""


def test_a_fault_of_our_own_is_owned_up_to_without_a_traceback(swarmbid, monkeypatch: pytest.MonkeyPatch):
    def broken(path: Path) -> None:
        raise ZeroDivisionError("no such luck")

    monkeypatch.setattr("swarmbid.missionfile.load_mission", broken)
    typed = swarmbid("plan", QUICKSTART)
    assert typed.status == 1
    assert typed.err.startswith(
        "swarmbid: this is a fault of swarmbid, not yours: ZeroDivisionError: no such luck"
    )


def test_help_list_schema_and_why_load_no_compiler(swarmbid):
    script = (
        "import sys; from swarmbid import cli; sys.argv[0] = 'swarmbid'\n"
        "try: cli.main()\nexcept SystemExit: pass\n"
        "assert 'numba' not in sys.modules, 'numba was imported'\n"
    )
    swarmbid("plan", QUICKSTART, "--trace", "t.jsonl")
    for words in (["--help"], ["list"], ["schema"], ["why", "t.jsonl", "pylon"]):
        done = subprocess.run(
            [sys.executable, "-c", script, *words], capture_output=True, text=True, check=False
        )
        assert (done.returncode, done.stderr) == (0, ""), words


def test_a_reader_that_has_had_enough_is_no_error(swarmbid):
    done = subprocess.run(
        ["bash", "-c", f"{sys.executable} -m swarmbid schema | head -n 1; exit ${{PIPESTATUS[0]}}"],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.stderr == ""
    assert done.returncode in (0, 128 + signal.SIGPIPE)


def test_an_interrupt_stops_at_once_without_a_word(tmp_path: Path):
    words = [
        "simulate",
        "uniform",
        "--agents",
        "60",
        "--tasks",
        "900",
        "--set",
        "bundle_limit=0",
        "--trace",
        "t.jsonl",
    ]
    running = subprocess.Popen(
        [sys.executable, "-m", "swarmbid", *words], cwd=tmp_path, stderr=subprocess.PIPE, text=True,
        stdout=subprocess.PIPE, env={**os.environ, "PYTHONUNBUFFERED": "1"},
    )  # fmt: skip
    partial = tmp_path / "t.jsonl.part"
    while running.poll() is None and not (partial.exists() and partial.stat().st_size > 0):
        time.sleep(0.05)
    running.send_signal(signal.SIGINT)
    out, err = running.communicate()
    assert (running.returncode, out, err) == (-signal.SIGINT, "", "")
    assert not (tmp_path / "t.jsonl").exists()
    assert read_trace(partial, partial=True).header.algorithm == "cbba"


def test_an_algorithm_takes_its_options_from_the_command_line(swarmbid):
    """Team rewards fill other groups than the agents' own gains do; both runs agree."""
    words = ["simulate", "hunt2014", "-a", "cbga", "--agents", "5", "--agents-required", "2", "--seed", "3"]
    own = swarmbid(*words, "--json")
    team = swarmbid(*words, "--json", "--with", "team_rewards=true", "--with", "quit_after=none")
    plans = [json.loads(typed.out)["plan"]["agents"] for typed in (own, team)]
    assert plans[0] != plans[1]
