"""Golden conversations: text files of commands and of what the agents really said.

A file is a row of blocks with a blank line between them: a command (its first line), its details (more
lines), ``----``, and the expected answer. Lines that begin with ``#`` are for the reader. With
``pytest --rewrite`` the answers are written anew: read the difference before you commit it.

    mission [algorithm options]        agents and tasks, a line each; starts everything afresh
    graph line a b c                   who hears whom: complete, line or edges; complete at first
    tick AGENT|all                     let it weigh and speak; what it says waits on its links
    deliver A>B [drop|dup|hold]        hand over the oldest message that waits; lose it, hand it over
                                       twice, or put it behind the others
    deliver all                        hand over everything that waits, in order of sender and receiver
    rounds N | stabilize               N rounds, or until all agree: everybody ticks, all is delivered
    wait SECONDS                       let time pass
    tell AGENT from SENDER [full] [@STAMP] [on STAMP]
                                       a message written by hand: lines ``TASK WINNER BID`` or ``TASK
                                       nobody``, and ``heard AGENT@STAMP ...``; says which row applied
    beliefs AGENT | heard AGENT | bundle AGENT | path AGENT | agreed
    crash AGENT                        it neither speaks nor hears any more
    restart AGENT INCARNATION          it comes back with nothing remembered
    lose AGENT by AGENT                a failure detector's verdict, told to one agent

A stamp is written as its sequence, with its incarnation in front unless that is 1: ``3``, ``2.1``.
"""

from __future__ import annotations

import ast
import dataclasses
import itertools
from pathlib import Path
from typing import Any

import numpy as np

from naive_consensus import row_of
from swarmbid.algorithms.cbaa import CBAA
from swarmbid.algorithms.cbba import CBBA
from swarmbid.arrays import MissionArrays
from swarmbid.messages import INCARNATION, NOBODY, NOT_LISTED, Beliefs, decode, encode
from swarmbid.model import Agent, Mission, Task
from swarmbid.negotiator import Event, MessageDropped, TaskOutbid, TaskReleased, TaskTaken
from swarmbid.scores import make_score

ALGORITHMS = {"cbba": CBBA, "cbaa": CBAA}
MOST_ROUNDS = 30

Holders = tuple[tuple[str, float], ...]


def run_file(
    path: Path, conversation: Conversation | None = None, *, rewrite: bool = False
) -> tuple[str, str]:
    """Play the conversation in `path`; return (what the file says, what was really said).

    `conversation` : how its messages read; those of the algorithm that the folder names by default.
    """
    text = path.read_text(encoding="utf-8")
    conversation = conversation or Conversation(path.parent.name)
    played = "\n\n".join(_play(conversation, block) for block in text.strip().split("\n\n")) + "\n"
    if rewrite and played != text:
        path.write_text(played, encoding="utf-8")
    return text, played


def _play(conversation: Conversation, block: str) -> str:
    said, _, _ = block.partition("\n----")
    lines = [line for line in said.split("\n") if not line.startswith("#")]
    if not lines:
        return block
    return said + "\n----\n" + "\n".join(conversation.command(lines[0], lines[1:]) or ["ok"])


def stamp_text(stamp: int) -> str:
    incarnation, sequence = divmod(stamp, INCARNATION)
    return f"{sequence}" if incarnation == 1 else f"{incarnation}.{sequence}"


def stamp_of(text: str) -> int:
    incarnation, dot, sequence = text.partition(".")
    return int(incarnation) * INCARNATION + int(sequence) if dot else INCARNATION + int(incarnation)


def options_of(words: list[str]) -> dict[str, Any]:
    """``["limit=1", "score=revisit"]`` as a dictionary."""
    found: dict[str, Any] = {}
    for word in words:
        name, _, value = word.partition("=")
        try:
            found[name] = ast.literal_eval(value)
        except (ValueError, SyntaxError):
            found[name] = value
    return found


class Conversation:
    """Negotiators, the messages on their way, and the commands that move them."""

    def __init__(self, algorithm: str) -> None:
        self.algorithm = ALGORITHMS[algorithm]
        self.now = 0.0

    def command(self, line: str, details: list[str]) -> list[str]:
        """Do one command and return what it answers."""
        name, *words = line.split()
        return getattr(self, f"do_{name}")(words, details) or []

    # --- setting the scene

    def do_mission(self, words: list[str], details: list[str]) -> list[str]:
        agents, tasks = [], []
        for detail in details:
            kind, item_id, east, north, *more = detail.split()
            options = options_of(more)
            place = (float(east), float(north), 0.0)
            if kind == "agent":
                agents.append(Agent(id=item_id, position=place, **options))
            else:
                tasks.append(Task(id=item_id, position=place, **{"discount": 0.1, **options}))
        self.mission = Mission(agents=tuple(agents), tasks=tuple(tasks))
        self.arrays = MissionArrays(self.mission)
        options = options_of(words)
        self.options = {**options, "score": make_score(options.get("score"))}
        ids = list(self.arrays.agent_ids)
        self.agents = {agent_id: self.algorithm(agent_id, self.arrays, **self.options) for agent_id in ids}
        self.links = [(a, b) for a in ids for b in ids if a != b]
        self.waiting: dict[tuple[str, str], list[Beliefs]] = {}
        self.told: dict[str, int] = {}
        self.now = 0.0
        return []

    def do_graph(self, words: list[str], details: list[str]) -> None:
        shape, *ids = words
        if shape == "line":
            pairs = list(itertools.pairwise(ids))
        elif shape == "complete":
            pairs = [(a, b) for a in ids for b in ids if a < b]
        else:
            pairs = [tuple(word.split("-")) for word in ids]
        self.links = sorted([(a, b) for a, b in pairs] + [(b, a) for a, b in pairs])

    def do_wait(self, words: list[str], details: list[str]) -> None:
        self.now += float(words[0])

    def do_crash(self, words: list[str], details: list[str]) -> None:
        del self.agents[words[0]]
        self.links = [link for link in self.links if words[0] not in link]
        self.waiting = {link: queue for link, queue in self.waiting.items() if link[1] != words[0]}

    def do_restart(self, words: list[str], details: list[str]) -> None:
        agent_id, incarnation = words
        self.agents[agent_id] = self.algorithm(
            agent_id, self.arrays, incarnation=int(incarnation), **self.options
        )

    def do_lose(self, words: list[str], details: list[str]) -> list[str]:
        lost, _, by = words
        self.agents[by].lose_agent(lost)
        return self._events(by)

    # --- speaking and hearing

    def do_tick(self, words: list[str], details: list[str]) -> list[str]:
        ids = list(self.agents) if words == ["all"] else words
        lines = [line for agent_id in ids for line in self._tick(agent_id)]
        return lines or ["nobody speaks"]

    def do_deliver(self, words: list[str], details: list[str]) -> list[str]:
        if words == ["all"]:
            lines = []
            for link in sorted(self.waiting):
                for message in self.waiting.pop(link):
                    lines += self._hand_over(link, message)
            return lines
        link = tuple(words[0].split(">"))
        queue = self.waiting[link]
        message = queue.pop(0)
        if words[1:] == ["hold"]:
            queue.append(message)
            return [f"{words[0]} {stamp_text(message.sequence)} is held back"]
        if words[1:] == ["drop"]:
            return [f"{words[0]} {stamp_text(message.sequence)} is lost"]
        lines = self._hand_over(link, message)
        return lines + self._hand_over(link, message) if words[1:] == ["dup"] else lines

    def do_rounds(self, words: list[str], details: list[str]) -> list[str]:
        return [line for _ in range(int(words[0])) for line in self._round()]

    def do_stabilize(self, words: list[str], details: list[str]) -> list[str]:
        lines: list[str] = []
        for _ in range(MOST_ROUNDS):
            lines += self._round()
            if all(agent.agreed for agent in self.agents.values()):
                return [*lines, f"all agree at {self.now:g} s"]
        return [*lines, f"no agreement after {MOST_ROUNDS} rounds"]

    def do_tell(self, words: list[str], details: list[str]) -> list[str]:
        receiver, _, sender, *more = words
        before = self.agents[receiver].beliefs()
        message = self._written(sender, more, details)
        self.agents[receiver].receive(message, self.now)
        events = self._events(receiver)
        if events:  # it was dropped
            return events
        after = self.agents[receiver].beliefs()
        lines = []
        for task_id in self.arrays.task_ids:
            listed = self.arrays.task_row[task_id] in message.tasks.tolist()
            if listed or message.full:
                theirs = self._listed(message).get(task_id, ())
                row = row_of(receiver, sender, holder(theirs), holder(before[task_id]))
                change = f"{belief_text(before[task_id])} -> {belief_text(after[task_id])}"
                kept = "stays " + belief_text(after[task_id])
                lines.append(f"{task_id}: row {row}: {kept if before[task_id] == after[task_id] else change}")
        return lines

    def _written(self, sender: str, words: list[str], details: list[str]) -> Beliefs:
        previous = self.told.get(sender, 0)
        sequence = previous + 1 if previous else INCARNATION + 1
        since = previous
        words = list(words)
        while words:
            word = words.pop(0)
            if word == "full":
                since = 0
            elif word == "on":
                since = stamp_of(words.pop(0))
            else:
                sequence = stamp_of(word.removeprefix("@"))
        self.told[sender] = sequence
        heard = np.full(self.arrays.num_agents, NOT_LISTED, np.int64)
        heard[self.arrays.agent_row[sender]] = sequence
        rows, winners, bids = [], [], []
        for detail in details:
            first, *rest = detail.split()
            if first == "heard":
                for word in rest:
                    agent_id, _, stamp = word.partition("@")
                    heard[self.arrays.agent_row[agent_id]] = stamp_of(stamp)
            else:
                rows.append(self.arrays.task_row[first])
                winners.append(NOBODY if rest[0] == "nobody" else self.arrays.agent_row[rest[0]])
                bids.append(0.0 if rest[0] == "nobody" else float(rest[1]))
        nothing, no_stamps = np.zeros(0, np.int32), np.zeros(0, np.int64)
        return Beliefs(
            sender=sender, sequence=sequence, since=since,
            agent_ids=self.arrays.agent_ids, task_ids=self.arrays.task_ids, heard=heard,
            tasks=np.array(rows, np.int32), winners=np.array(winners, np.int32), bids=np.array(bids, float),
            digest=0, digest_at=sequence, agreed=nothing, agreed_at=no_stamps, asked=nothing,
            left=nothing, left_at=no_stamps,
        )  # fmt: skip

    def _tick(self, agent_id: str) -> list[str]:
        messages = self.agents[agent_id].tick(self.now)
        lines = self._events(agent_id)
        for message in messages:
            lines.append(f"{agent_id} says {self._message_text(message)}")
            for link in self.links:
                if link[0] == agent_id:
                    # Through the wire format and back: what is not in the bytes was not said.
                    self.waiting.setdefault(link, []).append(decode(encode(message)))
        return lines

    def _round(self) -> list[str]:
        lines = [f"at {self.now:g} s"]
        lines += ["  " + line for agent_id in self.agents for line in self._tick(agent_id)]
        for link in sorted(self.waiting):
            for message in self.waiting.pop(link):
                lines += ["  " + line for line in self._receive(link[1], message)]
        self.now += 1.0
        return lines

    def _hand_over(self, link: tuple[str, ...], message: Beliefs) -> list[str]:
        sender, receiver = link
        return [f"{sender}>{receiver} {stamp_text(message.sequence)}", *self._receive(receiver, message)]

    def _receive(self, receiver: str, message: Beliefs) -> list[str]:
        before = self.agents[receiver].beliefs()
        self.agents[receiver].receive(message, self.now)
        after = self.agents[receiver].beliefs()
        changes = [
            f"{receiver} believes {task_id} {belief_text(after[task_id])}, not {belief_text(before[task_id])}"
            for task_id in after
            if after[task_id] != before[task_id]
        ]
        return changes + self._events(receiver)

    def _events(self, agent_id: str) -> list[str]:
        return [f"{agent_id} {event_text(event)}" for event in self.agents[agent_id].events()]

    # --- looking

    def do_beliefs(self, words: list[str], details: list[str]) -> list[str]:
        return [f"{t} {belief_text(belief)}" for t, belief in self.agents[words[0]].beliefs().items()]

    def do_heard(self, words: list[str], details: list[str]) -> list[str]:
        stamps = self.agents[words[0]].heard()
        return [" ".join(f"{a}@{stamp_text(s)}" for a, s in stamps.items() if s != NOT_LISTED) or "nobody"]

    def do_bundle(self, words: list[str], details: list[str]) -> list[str]:
        return [" ".join(self.agents[words[0]].bundle) or "empty"]

    def do_path(self, words: list[str], details: list[str]) -> list[str]:
        return [" ".join(f"{t} at {start:g} s" for t, start in self.agents[words[0]].path) or "empty"]

    def do_agreed(self, _: list[str], details: list[str]) -> list[str]:
        words = {True: "agrees", False: "does not know yet"}
        return [f"{agent_id} {words[agent.agreed]}" for agent_id, agent in self.agents.items()]

    def _listed(self, message: Beliefs) -> dict[str, Holders]:
        return {
            message.task_ids[row]: () if winner == NOBODY else ((message.agent_ids[winner], bid),)
            for row, winner, bid in zip(
                message.tasks.tolist(), message.winners.tolist(), message.bids.tolist(), strict=True
            )
        }

    def _message_text(self, message: Beliefs) -> str:
        kind = "everything" if message.full else f"changes on {stamp_text(message.since)}"
        parts = [f"{t} {belief_text(belief)}" for t, belief in self._listed(message).items()]
        stamps = [
            f"{a}@{stamp_text(s)}"
            for a, s in zip(message.agent_ids, message.heard.tolist(), strict=True)
            if s != NOT_LISTED
        ]
        if stamps:
            parts.append("heard " + " ".join(stamps))
        for label, rows in (("agreeing", message.agreed), ("asks", message.asked), ("gone", message.left)):
            if rows.size:
                parts.append(label + " " + " ".join(message.agent_ids[row] for row in rows.tolist()))
        if message.settled:
            parts.append("settled")
        return f"{stamp_text(message.sequence)} ({kind}): " + ("; ".join(parts) or "nothing")


def holder(holders: Holders) -> str | None:
    """The one that holds a task of one seat."""
    return holders[0][0] if holders else None


def belief_text(holders: Holders) -> str:
    return " ".join(f"{holder} {bid:.6g}" for holder, bid in holders) or "nobody"


def event_text(event: Event) -> str:
    match event:
        case TaskTaken(task, bid, position, start):
            return f"takes {task} for {bid:.6g}, place {position}, start {start:g} s"
        case TaskOutbid(task, bid, by, by_bid):
            return f"is outbid on {task} ({bid:.6g}) by {belief_text(((by, by_bid),))}"
        case TaskReleased(task, because):
            return f"releases {task}" + (f" because of {because}" if because else "")
        case MessageDropped(sender, reason):
            return f"drops a message of {sender}: {reason}"
    values = dataclasses.astuple(event)
    return " ".join([event.kind, *map(str, values)])
