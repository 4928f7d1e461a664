"""Golden conversations of the Contract Net, one for each way that a task may go.

Besides the commands of `datadriven` a file may say::

    announce AGENT TASK EAST NORTH [keep=True] [fields]   it has found a task
    start|finish|sub AGENT TASK | fail AGENT TASK REASON | cancel AGENT TASK | leave AGENT
    outcomes            how far each task has come, and who of the agents thinks so
    states TASK         who is what, as manager and as contractor
    cut A>B             B does not hear A any more, until the next `graph`

A line ``A > B: PERFORMATIVE CONVERSATION`` is an act: conversations are task/manager/epoch. Rounds in which
nothing happens are left out, and so is what messages carry but for `tick`.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

import datadriven
from swarmbid.algorithms.contract_net import ContractNet
from swarmbid.arrays import MissionArrays
from swarmbid.messages import Acts
from swarmbid.model import Task
from swarmbid.negotiator import Event, Said, Stage, TaskEnded

FOLDER = Path(__file__).parent / "testdata" / "contract_net"
FILES = sorted(FOLDER.glob("*.txt"))


def agent_of(
    agent_id: str, arrays: MissionArrays, may_not: dict[str, str] | None = None, **options: Any
) -> ContractNet:
    """An agent; `may_not` says who refuses everything, and why."""
    reason = (may_not or {}).get(agent_id)
    return ContractNet(agent_id, arrays, may=lambda task: reason, **options)


class Conversation(datadriven.Conversation):
    """The commands of `datadriven`, where a message is a set of acts."""

    def __init__(self) -> None:
        self.algorithm = agent_of
        self.now = 0.0

    def command(self, line: str, details: list[str]) -> list[str]:
        try:
            return super().command(line, details)
        except ValueError as error:
            return [f"error: {error}"]

    # --- what the driver tells

    def do_announce(self, words: list[str], details: list[str]) -> list[str]:
        agent_id, task_id, east, north, *more = words
        options = datadriven.options_of(more)
        keep = options.pop("keep", False)
        task = Task(id=task_id, position=(float(east), float(north), 0.0), **{"discount": 0.1, **options})
        self.agents[agent_id].announce(task, self.now, keep=keep)
        return self._events(agent_id)

    def do_start(self, words: list[str], details: list[str]) -> list[str]:
        self.agents[words[0]].start_task(words[1], self.now)
        return self._events(words[0])

    def do_finish(self, words: list[str], details: list[str]) -> list[str]:
        self.agents[words[0]].finish_task(words[1], self.now)
        return self._events(words[0])

    def do_fail(self, words: list[str], details: list[str]) -> list[str]:
        self.agents[words[0]].fail_task(words[1], " ".join(words[2:]), self.now)
        return self._events(words[0])

    def do_give_back(self, words: list[str], details: list[str]) -> list[str]:
        self.agents[words[0]].give_back(words[1], " ".join(words[2:]), self.now)
        return self._events(words[0])

    def do_sub(self, words: list[str], details: list[str]) -> list[str]:
        self.agents[words[0]].sub_contract(words[1], self.now)
        return self._events(words[0])

    def do_cancel(self, words: list[str], details: list[str]) -> list[str]:
        self.agents[words[0]].cancel_task(words[1])
        return self._events(words[0])

    def do_leave(self, words: list[str], details: list[str]) -> list[str]:
        self.agents[words[0]].leave()
        return self._events(words[0])

    def do_cut(self, words: list[str], details: list[str]) -> None:
        self.links.remove(tuple(words[0].split(">")))

    # --- looking

    def do_outcomes(self, words: list[str], details: list[str]) -> list[str]:
        found: dict[str, list[str]] = {}
        for agent_id, agent in self.agents.items():
            for task_id, outcome in agent.outcomes().items():
                by = f" with {outcome.agent}" if outcome.agent else ""
                why = f" ({outcome.reason})" if outcome.reason else ""
                text = f"{task_id} is {outcome.state}{by}{why}, epoch {outcome.epoch}"
                found.setdefault(text, []).append(agent_id)
        return [f"{text}: say {' '.join(who)}" for text, who in sorted(found.items())] or ["none"]

    def do_states(self, words: list[str], details: list[str]) -> list[str]:
        return [
            f"{agent_id} is {' as manager, '.join(states)} as contractor"
            for agent_id, agent in self.agents.items()
            if (states := agent.conversations().get(words[0])) is not None
        ] or ["nobody has it on its books"]

    # --- how it reads

    def _round(self) -> list[str]:
        lines: list[str] = []
        for agent_id, agent in self.agents.items():
            messages = agent.tick(self.now)
            lines += self._events(agent_id)
            for message in messages:
                self._send(agent_id, message)
        for link in sorted(self.waiting):
            for message in self.waiting.pop(link):
                lines += self._receive(link[1], message)
        lines = ["  " + line for line in lines]
        if lines:
            lines.insert(0, f"at {self.now:g} s")
        self.now += 1.0
        return lines

    def _send(self, agent_id: str, message: Acts) -> None:
        for link in self.links:
            if link[0] == agent_id:
                self.waiting.setdefault(link, []).append(datadriven.decode(datadriven.encode(message)))

    def _receive(self, receiver: str, message: Acts) -> list[str]:
        self.agents[receiver].receive(message, self.now)
        return self._events(receiver)

    def _events(self, agent_id: str) -> list[str]:
        return [event_text(agent_id, event) for event in self.agents[agent_id].events()]

    def _message_text(self, message: Acts) -> str:
        parts = []
        for run in message.runs:
            acts = ", ".join(f"{act.performative} {act.conversation}" for act in run.acts)
            upto = datadriven.stamp_text(run.upto)
            parts.append(f"{message.agent_ids[run.owner]}@{upto} {acts or 'nothing'}")
        parts += [f"{ending.task} is {ending.state}" for ending in message.ended]
        return f"{datadriven.stamp_text(message.sequence)}: " + ("; ".join(parts) or "nothing")


def event_text(agent_id: str, event: Event) -> str:
    match event:
        case Said(_, performative, to, conversation, bid, detail):
            worth = "" if bid is None else f", bid {bid:.4g}"
            why = f" ({detail.strip()})" if detail.strip() else ""
            return f"{agent_id} > {to or 'all'}: {performative} {conversation}{worth}{why}"
        case Stage(task, role, state):
            return f"{agent_id}, {role} of {task}: {state}"
        case TaskEnded(task, outcome, by, reason):
            by = f" by {by}" if by else ""
            return f"{agent_id} knows that {task} is {outcome}{by}" + (f" ({reason})" if reason else "")
    return f"{agent_id} {datadriven.event_text(event)}"


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_the_agents_say_what_the_file_says(path: Path, rewrite: bool):
    written, played = datadriven.run_file(path, Conversation(), rewrite=rewrite)
    assert "no agreement" not in played  # --rewrite must not bury it
    assert rewrite or played == written
