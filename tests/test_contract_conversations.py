"""More ways that a task may go in a Contract Net, one golden conversation each (see `contract_conversation`).

Besides its commands a file may say ``cut A>B`` (B does not hear A any more, until the next `graph`) and
``states TASK`` (what every agent is, as manager and as contractor).
"""

from __future__ import annotations

from pathlib import Path

import pytest

import contract_conversation
import datadriven

FILES = sorted((Path(__file__).parent / "testdata" / "contract_paths").glob("*.txt"))


class Conversation(contract_conversation.Conversation):
    """The commands of `contract_conversation`, and two more."""

    def do_cut(self, words: list[str], details: list[str]) -> None:
        self.links.remove(tuple(words[0].split(">")))

    def do_states(self, words: list[str], details: list[str]) -> list[str]:
        return [
            f"{agent_id} manager {states[0]}, contractor {states[1]}"
            for agent_id, agent in self.agents.items()
            if (states := agent.conversations().get(words[0])) is not None
        ] or ["nobody has it on its books"]


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_the_agents_say_what_the_file_says(path: Path, rewrite: bool):
    written, played = datadriven.run_file(path, Conversation(), rewrite=rewrite)
    assert "no agreement" not in played  # --rewrite must not bury it
    assert rewrite or played == written
