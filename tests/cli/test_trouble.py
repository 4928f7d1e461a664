"""What goes wrong around a command: full disks, odd terminals, broken scores; and who is kept informed."""

from __future__ import annotations

import io
import json
import os
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

from swarmbid.cli import waiting

BROKEN = {
    "score = 3": "is not defined. Define a function: def score(visit): ...",
    "def score(:": "cannot be run: SyntaxError",
    "def score(visit):\n    return 1 / 0": "score: fails: ZeroDivisionError: division by zero. It may use",
    "def score(visit):\n    return 'x'": "score: fails: TypingError: ",
    "import nothing_at_all": "cannot be run: ModuleNotFoundError: No module named 'nothing_at_all'",
}


@pytest.mark.parametrize("text", BROKEN)
def test_a_score_of_ones_own_that_fails_is_the_user_s_to_mend(swarmbid, tmp_path: Path, text: str):
    (tmp_path / "mine.py").write_text(text + "\n")
    typed = swarmbid("plan", "quickstart.yaml", "-s", "mine.py")
    assert typed.status == 2
    assert typed.err.startswith("swarmbid: mine.py: ")
    assert BROKEN[text] in typed.err
    assert "nopython" not in typed.err


def test_names_too_long_for_the_disk_are_said_to_be(swarmbid):
    for words in (["plan", "a" * 300], ["plan", "quickstart.yaml", "-o", "a" * 300], ["simulate", "a" * 300]):
        typed = swarmbid(*words)
        assert typed.status == 2
        assert "file name too long" in typed.err.lower()
        assert "fault of swarmbid" not in typed.err


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs the device that is always full")
def test_a_full_disk_is_reported_without_a_traceback():
    """Also when what could not be written is still in the buffer as the program ends."""
    buffered = {name: value for name, value in os.environ.items() if name != "PYTHONUNBUFFERED"}
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(
            [sys.executable, "-m", "swarmbid", "list"], stdout=full, stderr=subprocess.PIPE, text=True,
            check=False, env=buffered,
        )  # fmt: skip
    assert done.stderr == "swarmbid: the output: No space left on device\n"
    assert done.returncode == 2


def test_names_that_the_terminal_cannot_show_are_shown_by_their_code_points(tmp_path: Path):
    (tmp_path / "m.yaml").write_text('name: "ø"\nagents: []\ntasks: []\n', encoding="utf-8")
    done = subprocess.run(
        [sys.executable, "-m", "swarmbid", "plan", "m.yaml"], cwd=tmp_path, capture_output=True, text=True,
        check=False, env={**os.environ, "PYTHONIOENCODING": "ascii"},
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith("\\xf8: 0 of 0 tasks")


def test_a_device_gets_the_plan_and_no_trace_beside_it(swarmbid):
    typed = swarmbid("plan", "quickstart.yaml", "-o", "/dev/null")
    assert typed.status == 0
    assert "trace:" not in typed.out
    assert not Path("/dev/null.trace.jsonl").exists()


def test_the_report_of_a_rehearsal_tells_how_they_agreed_without_a_trace_file(swarmbid, tmp_path: Path):
    typed = swarmbid("simulate", "quickstart.yaml", "--graph", "line", "--report", "r.html")
    assert typed.status == 0
    page = (tmp_path / "r.html").read_text(encoding="utf-8")
    assert "How they agreed" in page
    assert sorted(path.name for path in tmp_path.iterdir()) == ["quickstart.yaml", "r.html"]


def test_json_has_the_metrics_without_a_trace_file(swarmbid, tmp_path: Path):
    found = json.loads(swarmbid("simulate", "quickstart.yaml", "--json").out)
    assert found["metrics"]["messages"] == found["run"]["messages"] > 0
    assert [path.name for path in tmp_path.iterdir()] == ["quickstart.yaml"]


def test_output_does_not_depend_on_the_hash_seed(tmp_path: Path):
    words = [
        "simulate",
        "uniform",
        "--agents",
        "5",
        "--tasks",
        "12",
        "--graph",
        "ring",
        "--loss",
        "0.2",
        "--json",
    ]
    said = set()
    for seed in ("1", "2"):
        trace = tmp_path / seed
        done = subprocess.run(
            [sys.executable, "-m", "swarmbid", *words, "--trace", str(trace), "--report", f"{trace}.html"],
            capture_output=True, text=True, check=True, env={**os.environ, "PYTHONHASHSEED": seed},
        )  # fmt: skip
        said.add((done.stdout, trace.read_bytes(), Path(f"{trace}.html").read_bytes()))
    assert len(said) == 1


# --- progress


class Terminal(io.StringIO):
    """A standard error that is a terminal."""

    def isatty(self) -> bool:
        return True


@pytest.fixture
def terminal(monkeypatch: pytest.MonkeyPatch) -> Terminal:
    """Sixteen columns, and a clock that is as late as it is asked often: every change is shown."""
    found, asked = Terminal(), iter(range(1000))
    monkeypatch.setattr(waiting, "sys", SimpleNamespace(stderr=found))
    monkeypatch.setattr(waiting.time, "monotonic", lambda: float(next(asked)))
    monkeypatch.setenv("COLUMNS", "16")
    return found


def test_on_a_terminal_rounds_are_counted_in_one_line_that_vanishes(terminal: Terminal):
    with waiting.rounds_shown("field") as show:
        show(0.0)
        show(11.5)
    assert terminal.getvalue().split(waiting.WIPE) == [
        "", "field: ...", "field: round 1", "field: round 12", "",
    ]  # fmt: skip


def test_the_line_is_never_wider_than_the_terminal_and_vanishes_after_an_error(terminal: Terminal):
    with pytest.raises(ZeroDivisionError), waiting.cases_shown("a very long name indeed") as show:
        show(1, 2000)
        raise ZeroDivisionError
    lines = terminal.getvalue().split(waiting.WIPE)
    assert max(map(len, lines)) == 15
    assert lines[-1] == ""


def test_changes_that_follow_at_once_are_not_shown(terminal: Terminal, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(waiting.time, "monotonic", lambda: 5.0)
    with waiting.rounds_shown("field") as show:
        for now in range(1000):
            show(float(now))
    assert terminal.getvalue().split(waiting.WIPE) == ["", "field: ...", ""]


def test_off_a_terminal_nothing_is_shown(capsys: pytest.CaptureFixture[str]):
    for shown in (waiting.rounds_shown, waiting.cases_shown):
        with shown("field") as show:
            assert show is None
    assert capsys.readouterr() == ("", "")


def test_a_simulation_on_a_terminal_tells_how_far_it_is(swarmbid, terminal: Terminal):
    assert swarmbid("simulate", "quickstart.yaml", "--graph", "line").status == 0
    assert "quickstart: rou" in terminal.getvalue()
