"""What the commands print, word for word: a file of commands and answers for each subject.

After ``$ swarmbid ...`` comes what it printed, ``! `` before a line of standard error, and the exit
status if it is not 0. ``mission NAME`` starts a file that is written first, up to the blank line. With
``pytest --rewrite`` the answers are written anew: read the difference before you commit it.
"""

from __future__ import annotations

from pathlib import Path

import pytest

FILES = sorted((Path(__file__).parents[1] / "testdata" / "cli").glob("*.txt"))


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_the_commands_print_what_the_file_says(swarmbid, path: Path, tmp_path: Path, rewrite: bool):
    text = path.read_text(encoding="utf-8")
    said = []
    for block in text.strip().split("\n\n$ "):
        command = block.removeprefix("$ ").split("\n")[0]
        if command.startswith("mission "):
            (tmp_path / command.split()[1]).write_text(block.split("\n", 1)[1] + "\n", encoding="utf-8")
            said.append("$ " + block.removeprefix("$ "))
            continue
        typed = swarmbid(*command.split()[1:])
        answer = typed.out + "".join(f"! {line}\n" for line in typed.err.splitlines())
        answer += f"(status {typed.status})\n" if typed.status else ""
        said.append(f"$ {command}\n{answer.rstrip()}")
    played = "\n\n".join(said) + "\n"
    if rewrite:
        path.write_text(played, encoding="utf-8")
    assert rewrite or played == text


def test_there_are_golden_files():
    assert len(FILES) >= 4
