"""Golden conversations of small search missions, a file for each path of the charts (`smallworlds`)."""

from __future__ import annotations

from pathlib import Path

import pytest

from smallworlds import missing, play

TESTDATA = Path(__file__).parents[1] / "testdata" / "search_track"
FILES = sorted(TESTDATA.glob("*.txt"))


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_the_uavs_say_what_the_file_says(path: Path, rewrite: bool):
    written, said, small = play(path, rewrite=rewrite)
    assert missing(said, small) == []  # --rewrite must not bury it
    assert rewrite or said == written
