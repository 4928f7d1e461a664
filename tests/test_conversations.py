"""The golden conversations in testdata/, one test each (see `datadriven`)."""

from __future__ import annotations

from pathlib import Path

import pytest

from datadriven import run_file

TESTDATA = Path(__file__).parent / "testdata"
FILES = sorted(path for folder in ("cbaa", "cbba") for path in (TESTDATA / folder).glob("*.txt"))


@pytest.mark.parametrize("path", FILES, ids=lambda path: f"{path.parent.name}/{path.stem}")
def test_the_agents_say_what_the_file_says(path: Path, rewrite: bool):
    written, played = run_file(path, rewrite=rewrite)
    assert "no agreement" not in played  # --rewrite must not bury it
    assert rewrite or played == written


def test_every_row_of_the_decision_table_has_its_conversation():
    """And each really shows its row at work."""
    for row in range(1, 18):
        text = (TESTDATA / "cbba" / f"row_{row:02}.txt").read_text(encoding="utf-8")
        assert f": row {row}:" in text
