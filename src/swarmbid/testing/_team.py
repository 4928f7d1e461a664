"""Negotiators on a graph, driven strictly by the contract, and what went wrong in words."""

from __future__ import annotations

import heapq
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from swarmbid.errors import SwarmbidError
from swarmbid.messages import KINDS, decode, encode
from swarmbid.model import Agent, Mission, Task
from swarmbid.negotiator import Event, Negotiator
from swarmbid.network import make_topology
from swarmbid.plan import make_plan
from swarmbid.rng import stream
from swarmbid.scores import make_score
from swarmbid.verify import verify

Make = Callable[[str, Mission], Negotiator]
"""Makes the negotiator of one agent: a class that takes the agent's id and the mission will do."""

SHAPES = ("complete", "ring", "line", "star")
MOST_ROUNDS = 400


class Broken(Exception):
    """One check found something; the argument says what, in a sentence without its full stop."""


@dataclass(frozen=True)
class Failure:
    """One check that did not hold.

    Parameters
    ----------
    check : its name. found : what was seen. lesson : what the contract asks, and the usual cause.
    """

    check: str
    found: str
    lesson: str

    def __str__(self) -> str:
        return f"{self.check}: {self.found}.\n    {self.lesson}"


class ConformanceError(SwarmbidError, AssertionError):
    """Something does not keep its contract.

    Parameters
    ----------
    failures : every check that did not hold.
    """

    def __init__(self, failures: list[Failure]) -> None:
        self.failures = failures
        super().__init__("\n".join(str(failure) for failure in failures))


@dataclass(frozen=True)
class Check:
    """One thing that must hold of every subject, callable with it.

    Parameters
    ----------
    name : of the check. lesson : what the contract asks, and the usual cause when it fails.
    examine : raises `Broken`.
    """

    name: str
    lesson: str
    examine: Callable[[Any], None]

    def failure(self, subject: Any) -> Failure | None:
        """Examine `subject`; return what was found, None if all is well."""
        try:
            self.examine(subject)
        except Broken as broken:
            return Failure(self.name, str(broken), self.lesson)
        except Exception as error:  # a subject may raise anything at all, and that is a finding too
            return Failure(self.name, f"raised {type(error).__name__}: {error}{_place(error)}", self.lesson)
        return None

    def __call__(self, subject: Any) -> None:
        failure = self.failure(subject)
        if failure is not None:
            raise ConformanceError([failure])


def _place(error: Exception) -> str:
    step = error.__traceback__
    while step is not None and step.tb_next is not None:
        step = step.tb_next
    return "" if step is None else f" ({step.tb_frame.f_code.co_filename}:{step.tb_lineno})"


def run_all(checks: Iterable[Check], subject: Any) -> None:
    """Run every check and raise one ConformanceError with all that failed."""
    failures = [failure for check in checks if (failure := check.failure(subject)) is not None]
    if failures:
        raise ConformanceError(failures)


def mission_of(seed: int, agents: int = 4, tasks: int = 6, *, windows: bool = False) -> Mission:
    """A small mission; those of even seeds are full of ties (a coarse grid, equal rewards)."""
    rng = stream(seed, "conformance")
    tied = seed % 2 == 0
    places = (
        rng.integers(0, 5, (agents + tasks, 2)) * 20.0
        if tied
        else rng.uniform(0.0, 80.0, (agents + tasks, 2))
    )
    rewards = np.full(tasks, 80.0) if tied else rng.uniform(60.0, 120.0, tasks)
    opens = rng.uniform(0.0, 100.0, tasks) if windows else np.zeros(tasks)
    points = [(float(x), float(y), 0.0) for x, y in places]
    return Mission(
        name=f"conformance-{seed}",
        agents=tuple(Agent(id=f"a{row}", position=points[row], speed=2.0) for row in range(agents)),
        tasks=tuple(
            Task(
                id=f"t{row}",
                position=points[agents + row],
                reward=float(rewards[row]),
                start=float(opens[row]),
                end=float(opens[row]) + 60.0 if windows else float("inf"),
                duration=5.0,
                discount=0.005,
            )
            for row in range(tasks)
        ),
    )


class Team:
    """All negotiators of a mission, in rounds of one second. A message arrives before the next round.

    Parameters
    ----------
    shape : of the graph. seed : of the bad link, if it is one.
    copies : how often each message arrives. loss : probability. delay : most rounds a message is late.
    wire : whether messages go through their bytes. extra_ticks : whether to tick more than asked.
    """

    def __init__(
        self,
        make: Make,
        mission: Mission,
        shape: str = "complete",
        *,
        seed: int = 0,
        copies: int = 1,
        loss: float = 0.0,
        delay: int = 0,
        wire: bool = False,
        extra_ticks: bool = False,
    ) -> None:
        self.mission = mission
        self.agents = {agent.id: make(agent.id, mission) for agent in mission.agents}
        ids = list(self.agents)
        topology = make_topology(shape, len(ids))
        self.neighbours = {
            name: [ids[other] for other in topology.neighbours(row, 0.0)] for row, name in enumerate(ids)
        }
        self.now = 0.0
        self.sent: list[tuple[float, str, Any]] = []
        self.events: dict[str, list[Event]] = {name: [] for name in ids}
        self._rng = stream(seed, "links")
        self._copies, self._loss, self._delay = copies, loss, delay
        self._wire, self._extra_ticks = wire, extra_ticks
        self._under_way: list[tuple[float, int, str, Any]] = []
        self._count = 0

    def round(self, *, extra: Callable[[Negotiator], None] | None = None) -> None:
        """Everybody whose tick is due ticks, then what is due arrives."""
        self.now += 1.0
        for name, one in self.agents.items():
            due = one.next_tick()
            if due is not None and due <= self.now:
                self._post(name, one.tick(self.now))
            if self._extra_ticks:
                self._post(name, one.tick(self.now))
                self._post(name, one.tick(self.now + 0.5))
            if extra is not None:
                extra(one)
            self.events[name] += one.events()
        while self._under_way and self._under_way[0][0] <= self.now:
            _, _, name, message = heapq.heappop(self._under_way)
            if name in self.agents:
                self.agents[name].receive(message, self.now + 0.75)
        for name, one in self.agents.items():
            self.events[name] += one.events()

    def _post(self, sender: str, messages: list[Any]) -> None:
        for message in messages:
            self.sent.append((self.now, sender, message))
            carried = decode(encode(message)) if self._wire and isinstance(message, KINDS) else message
            for receiver in self.neighbours[sender]:
                for _ in range(self._copies):
                    if self._loss and self._rng.random() < self._loss:
                        continue
                    late = float(self._rng.integers(0, self._delay + 1)) if self._delay else 0.0
                    self._count += 1
                    heapq.heappush(self._under_way, (self.now + late, self._count, receiver, carried))

    def all_agreed(self) -> bool:
        """Whether everybody says that all agree."""
        return all(one.agreed for one in self.agents.values())

    def settle(self, what: str = "the agents") -> None:
        """Play until everybody says that all agree, then check that it is so."""
        for _ in range(MOST_ROUNDS):
            self.round()
            if self.all_agreed():
                break
        else:
            doubting = [name for name, one in self.agents.items() if not one.agreed]
            same = "equal" if len({one.digest for one in self.agents.values()}) == 1 else "unequal"
            raise Broken(
                f"{what} did not agree within {MOST_ROUNDS} rounds; {', '.join(doubting)} still doubt, "
                f"with {same} digests{self._difference()}"
            )
        if len({one.digest for one in self.agents.values()}) > 1:
            raise Broken(f"{what} all say that they agree, but their digests differ{self._difference()}")

    def _difference(self) -> str:
        held = [(name, one.beliefs()) for name, one in self.agents.items()]
        for task in self.mission.tasks:
            seen = {name: beliefs[task.id] for name, beliefs in held if task.id in beliefs}
            if len(set(seen.values())) > 1:
                return f"; for instance on {task.id}: {seen}"
        return ""

    def check_assignment(self, *, physics: bool = True) -> None:
        """Nobody disputes a task, paths and beliefs say the same, and each path can be flown."""
        names = list(self.agents)
        first = self.agents[names[0]].beliefs()
        for name in names:
            if self.agents[name].beliefs() != first:
                raise Broken(
                    f"{names[0]} and {name} have equal digests and unequal beliefs{self._difference()}"
                )
        seats = {task.id: task.agents_required or len(names) for task in self.mission.tasks}
        doers: dict[str, list[str]] = {}
        for name, one in self.agents.items():
            for task, _ in one.path:
                doers.setdefault(task, []).append(name)
        for task, who in doers.items():
            if len(who) > seats[task]:
                raise Broken(f"{' and '.join(who)} all plan {task}, which has seats for {seats[task]}")
            strangers = [name for name in who if name not in dict(first[task])]
            if strangers:
                raise Broken(f"{strangers[0]} plans {task}, but all believe that {first[task]} win it")
        for task, holders in first.items():
            for holder, bid in holders:
                if holder in self.agents and holder not in doers.get(task, []):
                    raise Broken(
                        f"all believe that {holder} wins {task} (bid {bid:g}), but it does not plan it"
                    )
        if physics:
            self.check_physics(self.mission)

    def check_physics(self, mission: Mission) -> None:
        """The paths can be flown by the agents of `mission`."""
        paths = {name: one.path for name, one in self.agents.items()}
        score = make_score("time_window")
        for violation in verify(mission, make_plan(mission, paths, score, "conformance", "shift"), score):
            raise Broken(f"a path cannot be flown: {violation}")

    def path_tasks(self, name: str) -> list[str]:
        """Ids of what an agent plans, in order of visit."""
        return [task for task, _ in self.agents[name].path]


def held_by(agent_id: str, one: Negotiator) -> set[str]:
    """Tasks that an agent holds, as far as `one` knows."""
    return {task for task, holders in one.beliefs().items() if agent_id in dict(holders)}


def state(one: Negotiator) -> tuple[Any, ...]:
    """Everything that a driver can see of a negotiator's mind."""
    return one.digest, one.path, one.beliefs()
