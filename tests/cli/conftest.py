"""The command line, run in the tests' own process."""

from __future__ import annotations

import shutil
import signal
import sys
from pathlib import Path

import pytest

from swarmbid import cli

EXAMPLES = Path(__file__).parents[2] / "examples"
QUICKSTART = "quickstart.yaml"


class Typed:
    """What a command printed, and its exit status."""

    def __init__(self, status: int, out: str, err: str) -> None:
        self.status, self.out, self.err = status, out, err


@pytest.fixture
def swarmbid(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path):
    """Run one command in this process, in a directory that holds a copy of the small mission only."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(signal, "signal", lambda *_: None)  # this process is the tests'
    shutil.copy(EXAMPLES / QUICKSTART, tmp_path)

    def run(*words: str) -> Typed:
        monkeypatch.setattr(sys, "argv", ["swarmbid", *words])
        with pytest.raises(SystemExit) as stopped:
            cli.main()
        shown = capsys.readouterr()
        assert "Traceback" not in shown.out + shown.err
        assert isinstance(stopped.value.code, int)
        return Typed(stopped.value.code, shown.out, shown.err)

    return run
