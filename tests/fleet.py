"""The least driver that can be: negotiators, a graph, and a bad link. For tests; borrows no simulator.

Time goes by in rounds of one second: everybody ticks, then what is due is delivered.
"""

from __future__ import annotations

import random
from dataclasses import dataclass, field
from typing import Any

from naive_consensus import Beliefs, Graph
from swarmbid.algorithms.cbba import CBBA
from swarmbid.arrays import MissionArrays
from swarmbid.messages import Message
from swarmbid.model import Mission


@dataclass
class Link:
    """What the network does to every message on its way to every receiver.

    Parameters
    ----------
    loss, duplicate : probabilities. delay : most rounds that a message is late (uniform, so reordered).
    cut : rounds [first, last) in which agents of even and odd place in the roster hear nothing of each other.
    """

    loss: float = 0.0
    duplicate: float = 0.0
    delay: int = 0
    cut: tuple[int, int] = (0, 0)


@dataclass
class Fleet:
    """Negotiators on a graph.

    Attributes
    ----------
    round : rounds so far. last_change : the last round in which a belief changed.
    """

    mission: Mission
    graph: Graph
    algorithm: Any = CBBA
    seed: int = 0
    link: Link = field(default_factory=Link)
    options: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.arrays = MissionArrays(self.mission)
        self.agents = {i: self.algorithm(i, self.arrays, **self.options) for i in self.arrays.agent_ids}
        self.rng = random.Random(self.seed)
        self.under_way: list[tuple[int, str, Message]] = []  # (round when due, receiver, message)
        self.round = self.last_change = 0

    def state(self) -> dict[str, Beliefs]:
        """Who wins what, in the twins' words: one winner a task, or None."""
        return {
            i: {task: holders[0] if holders else (None, 0.0) for task, holders in agent.beliefs().items()}
            for i, agent in self.agents.items()
        }

    def play_round(self) -> None:
        """Everybody ticks, in order of id, then everything due is delivered, in order of arrival."""
        before = self.state()
        self.round += 1
        now = float(self.round)
        for sender, agent in self.agents.items():
            for message in agent.tick(now):
                self._send(sender, message)
        due = [item for item in self.under_way if item[0] <= self.round]
        self.under_way = [item for item in self.under_way if item[0] > self.round]
        for _, receiver, message in due:
            if receiver in self.agents:
                self.agents[receiver].receive(message, now)
        if self.state() != before:
            self.last_change = self.round

    def _send(self, sender: str, message: Message) -> None:
        order = self.arrays.agent_row
        for receiver in self.graph[sender]:
            apart = (order[sender] - order[receiver]) % 2 == 1
            if apart and self.link.cut[0] <= self.round < self.link.cut[1]:
                continue
            for _ in range(2 if self.rng.random() < self.link.duplicate else 1):
                if self.rng.random() >= self.link.loss:
                    late = self.rng.randint(0, self.link.delay)
                    self.under_way.append((self.round + late, receiver, message))

    def all_agree(self) -> bool:
        return all(agent.agreed for agent in self.agents.values())

    def settle(self, most: int = 400) -> bool:
        """Play until all agree; False if they do not within `most` rounds."""
        for _ in range(most):
            self.play_round()
            if self.all_agree():
                return True
        return False

    def bundles(self) -> dict[str, list[str]]:
        return {i: agent.bundle for i, agent in self.agents.items()}

    def paths(self) -> dict[str, list[tuple[str, float]]]:
        return {i: agent.path for i, agent in self.agents.items()}

    def crash(self, agent_id: str) -> None:
        """It is gone: it neither speaks nor hears any more, and nobody has been told yet."""
        del self.agents[agent_id]
