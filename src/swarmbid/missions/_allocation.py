"""Who does what of what was found: one way of deciding it per class, all with the same doors.

`ByContract` is the mission's own: the Contract Net reacts to every discovery, and CBBA settles what stands.
The others are there to be compared with.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Any

from swarmbid.algorithms.cbba import CBBA
from swarmbid.algorithms.contract_net import ContractNet
from swarmbid.errors import InputError
from swarmbid.messages import Message
from swarmbid.missions._contacts import Contacts
from swarmbid.model import Mission, Task
from swarmbid.negotiator import Event, Negotiator
from swarmbid.places import Places
from swarmbid.scores import make_score
from swarmbid.timing import joint_starts
from swarmbid.world.vehicle import VehicleState

RESTATE_EVERY = 5.0
"""s between two times at which the negotiator is told where the UAV is."""


FreeAt = Callable[[float], float]
"""From now, s, to when a UAV is free for something new, s; infinite for never."""
NEVER = 1e9
"""s: later than any mission ends."""


class Allocation(ABC):
    """Decides which tasks one UAV does.

    Attributes
    ----------
    may : why the UAV cannot take a task on, or None; the UAV gives it.
    """

    may: Callable[[Task], str | None] | None = None

    @abstractmethod
    def announce(self, task: Task, now: float, keep: bool = False) -> None:
        """This UAV found `task`; keep : it takes it itself at once."""

    @abstractmethod
    def at(self, state: VehicleState, free_at: FreeAt, now: float, contacts: Contacts) -> None:
        """The UAV is there and knows of these contacts; `free_at` tells from when on it is free."""

    @property
    @abstractmethod
    def path(self) -> Sequence[tuple[str, float]]:
        """Tasks that this UAV is to do, in order, what it has started first."""

    @abstractmethod
    def is_open(self, task: str) -> bool:
        """Whether a task is still to be done."""

    @abstractmethod
    def is_started(self, task: str) -> bool:
        """Whether this UAV has started it."""

    def standing_of(self, task: str) -> tuple[str, tuple[str, ...]]:
        """Return who holds a task, empty for nobody, and which others proposed for it."""
        return "", ()

    @abstractmethod
    def served(self, task: str) -> bool:
        """Whether, as far as this UAV knows, somebody has done a task or is to do it."""

    @abstractmethod
    def start(self, task: str, now: float) -> None:
        """This UAV begins."""

    @abstractmethod
    def finish(self, task: str, now: float) -> None:
        """This UAV has done it."""

    @abstractmethod
    def give_back(self, task: str, now: float) -> None:
        """This UAV flies home to refuel: the task is for another, or for itself when it is back."""

    @abstractmethod
    def cancel(self, task: str) -> None:
        """Nobody need do it."""

    @abstractmethod
    def hand_over(self, task: str, now: float) -> None:
        """Look for somebody to go on with a task that this UAV has started."""

    @abstractmethod
    def lose(self, agent: str) -> None:
        """Another UAV is gone."""

    @abstractmethod
    def receive(self, message: Message, now: float) -> None:
        """Take in what was heard."""

    def tick(self, now: float) -> list[Message]:
        """Return what to say."""
        return []

    def events(self) -> list[Event]:
        """Return what happened, and forget it."""
        return []


class _Negotiated(Allocation):
    """What the algorithms have in common."""

    def __init__(self, negotiator: Negotiator) -> None:
        self.negotiator = negotiator
        self._started: set[str] = set()
        self._ended: set[str] = set()
        self._told_at = -math.inf

    @property
    def path(self) -> Sequence[tuple[str, float]]:
        """See `Allocation.path`."""
        return [item for item in self.negotiator.path if item[0] not in self._ended]

    def is_started(self, task: str) -> bool:
        """See `Allocation.is_started`."""
        return task in self._started

    def start(self, task: str, now: float) -> None:
        """See `Allocation.start`."""
        if task not in self._started:
            self._started.add(task)
            self.negotiator.start_task(task, now)

    def finish(self, task: str, now: float) -> None:
        """See `Allocation.finish`."""
        self._ended.add(task)
        self.negotiator.finish_task(task, now)

    def at(self, state: VehicleState, free_at: FreeAt, now: float, contacts: Contacts) -> None:
        """See `Allocation.at`."""
        if now - self._told_at >= RESTATE_EVERY:
            self._told_at = now
            self.negotiator.set_position((state.x, state.y, 0.0), self._free_from(free_at(now), now))

    def _free_from(self, free_at: float, now: float) -> float:
        """From when on bids count, s, for a UAV that is free at `free_at`."""
        return min(free_at, NEVER)

    def lose(self, agent: str) -> None:
        """See `Allocation.lose`."""
        self.negotiator.lose_agent(agent)

    def receive(self, message: Message, now: float) -> None:
        """See `Allocation.receive`."""
        self.negotiator.receive(message, now)

    def tick(self, now: float) -> list[Message]:
        """See `Allocation.tick`."""
        due = self.negotiator.next_tick()
        return self.negotiator.tick(now) if due is not None and due <= now else []

    def events(self) -> list[Event]:
        """See `Allocation.events`."""
        return self.negotiator.events()


class ByContract(_Negotiated):
    """The Contract Net: the finder announces, the best bid is awarded.

    Parameters
    ----------
    roster : the UAVs, without tasks. options : of `ContractNet`.
    """

    def __init__(self, agent: str, roster: Mission, **options: Any) -> None:
        self.net = ContractNet(agent, roster, "time_discounted", may=self._refusal, **options)
        super().__init__(self.net)

    def _free_from(self, free_at: float, now: float) -> float:
        """Whether it is free at all is for `may` to judge."""
        return now if math.isinf(free_at) else free_at

    def standing_of(self, task: str) -> tuple[str, tuple[str, ...]]:
        """See `Allocation.standing_of`."""
        outcome = self.net.outcomes().get(task)
        return "" if outcome is None else outcome.agent, self.net.proposers(task)

    def _refusal(self, task: Task) -> str | None:
        return None if self.may is None else self.may(task)

    def announce(self, task: Task, now: float, keep: bool = False) -> None:
        """See `Allocation.announce`."""
        self.net.announce(task, now, keep=keep)

    def is_open(self, task: str) -> bool:
        """See `Allocation.is_open`."""
        outcome = self.net.outcomes().get(task)
        return outcome is not None and outcome.state in ("open", "contracted")

    def served(self, task: str) -> bool:
        """See `Allocation.served`."""
        outcome = self.net.outcomes().get(task)
        return outcome is not None and outcome.state in ("contracted", "started", "done", "cancelled")

    def give_back(self, task: str, now: float) -> None:
        """See `Allocation.give_back`."""
        self._started.discard(task)
        self.net.give_back(task, "no_fuel", now)

    def cancel(self, task: str) -> None:
        """See `Allocation.cancel`."""
        if task not in self._ended:
            self._ended.add(task)
            if task in self.net.outcomes():
                self.net.cancel_task(task)

    def hand_over(self, task: str, now: float) -> None:
        """See `Allocation.hand_over`."""
        self.net.sub_contract(task, now)


class ByConsensus(_Negotiated):
    """CBBA over everything that is known: every UAV learns of a task with the contact.

    Parameters
    ----------
    task_of : makes the same task of the same contact aboard every UAV.
    """

    def __init__(self, agent: str, roster: Mission, task_of: Any) -> None:
        self.cbba = CBBA(agent, roster, "time_discounted")
        super().__init__(self.cbba)
        self._task_of = task_of
        self._known: set[str] = set()
        self._agents = {one.id for one in roster.agents}

    def announce(self, task: Task, now: float, keep: bool = False) -> None:
        """See `Allocation.announce`: the contact is announcement enough."""

    def at(self, state: VehicleState, free_at: FreeAt, now: float, contacts: Contacts) -> None:
        """See `Allocation.at`."""
        for name, contact in contacts.known.items():
            if name not in self._known and name not in self._agents:
                with suppress(InputError):  # a peer may have told of a contact that can be no task
                    self.cbba.add_task(self._task_of(contact))
                    self._known.add(name)
            if contact.over and name not in self._ended:
                self.cancel(name)
        super().at(state, free_at, now, contacts)

    def is_open(self, task: str) -> bool:
        """See `Allocation.is_open`."""
        return task in self._known and task not in self._ended and task not in self._started

    def served(self, task: str) -> bool:
        """See `Allocation.served`."""
        return task in self._ended or bool(self.cbba.beliefs().get(task))

    def give_back(self, task: str, now: float) -> None:
        """See `Allocation.give_back`: what was not begun goes as bids count from never; CBBA cannot
        give back what was, so nobody does that again.
        """
        if task in self._started:
            self.cancel(task)

    def cancel(self, task: str) -> None:
        """See `Allocation.cancel`."""
        self._ended.add(task)
        self._started.discard(task)
        if task in self._known:
            self.cbba.cancel_task(task)

    def hand_over(self, task: str, now: float) -> None:
        """See `Allocation.hand_over`: whoever turns home gives up what it follows, and cannot do more."""


class Centre:
    """One planner that hears everything at once and is obeyed at once: what no radio gives.

    It inserts each task, when it is found, where the team gains most (the sequential greedy algorithm, one
    task at a time).
    """

    def __init__(self, mission: Mission) -> None:
        self.mission = mission
        self.tasks: dict[str, Task] = {}
        self.paths: dict[str, list[str]] = {agent.id: [] for agent in mission.agents}
        self.places: dict[str, tuple[float, float, float]] = {one.id: one.position for one in mission.agents}
        self.done: set[str] = set()
        self.lost: set[str] = set()

    def allocate(self, task: Task, now: float, without: str = "") -> None:
        """Insert a task."""
        self.tasks[task.id] = task
        agents = tuple(
            replace(one, position=self.places[one.id], available_at=now, base=None, endurance=math.inf)
            for one in self.mission.agents
            if one.id not in self.lost and one.id != without
        )
        here = replace(self.mission, agents=agents, tasks=tuple(self.tasks.values()))
        orders = {one.id: self.paths[one.id] for one in agents}
        starts = joint_starts(here, orders) or {}
        paths = {name: [(self.tasks[step], starts[step]) for step in order] for name, order in orders.items()}
        places = Places(here, paths, make_score("time_discounted"), insertion="shift", steps=10**9)
        best: tuple[float, str, int] | None = None
        for agent in places.agents:
            found = places.best(agent, task)
            if found is not None and (best is None or (found[0], agent.id) > best[:2]):
                best = (found[0], agent.id, found[1])
        if best is not None and best[0] > 0.0:
            self.paths[best[1]].insert(best[2], task.id)


class ByCentre(Allocation):
    """What a central planner tells this UAV to do."""

    def __init__(self, agent: str, centre: Centre) -> None:
        self.agent = agent
        self.centre = centre
        self._started: set[str] = set()

    def announce(self, task: Task, now: float, keep: bool = False) -> None:
        """See `Allocation.announce`."""
        if keep:
            self.centre.tasks[task.id] = task
            self.centre.paths[self.agent].insert(0, task.id)
        else:
            self.centre.allocate(task, now)

    def at(self, state: VehicleState, free_at: FreeAt, now: float, contacts: Contacts) -> None:
        """See `Allocation.at`."""
        self.centre.places[self.agent] = (state.x, state.y, 0.0)

    @property
    def path(self) -> Sequence[tuple[str, float]]:
        """See `Allocation.path`."""
        return [(name, 0.0) for name in self.centre.paths[self.agent]]

    def is_open(self, task: str) -> bool:
        """See `Allocation.is_open`."""
        return any(task in path for path in self.centre.paths.values()) and task not in self._started

    def is_started(self, task: str) -> bool:
        """See `Allocation.is_started`."""
        return task in self._started

    def served(self, task: str) -> bool:
        """See `Allocation.served`."""
        return task in self.centre.done or any(task in path for path in self.centre.paths.values())

    def start(self, task: str, now: float) -> None:
        """See `Allocation.start`."""
        self._started.add(task)

    def finish(self, task: str, now: float) -> None:
        """See `Allocation.finish`."""
        self.centre.done.add(task)
        self.centre.paths[self.agent].remove(task)

    def give_back(self, task: str, now: float) -> None:
        """See `Allocation.give_back`."""
        self._started.discard(task)
        self.centre.paths[self.agent].remove(task)
        self.centre.allocate(self.centre.tasks[task], now, without=self.agent)

    def cancel(self, task: str) -> None:
        """See `Allocation.cancel`."""
        for path in self.centre.paths.values():
            if task in path:
                path.remove(task)

    def hand_over(self, task: str, now: float) -> None:
        """See `Allocation.hand_over`: the central planner gives it away when this UAV turns home."""

    def lose(self, agent: str) -> None:
        """See `Allocation.lose`."""
        if agent not in self.centre.lost:
            self.centre.lost.add(agent)
            for name in self.centre.paths[agent]:
                self.centre.allocate(self.centre.tasks[name], 0.0, without=agent)
            self.centre.paths[agent] = []

    def receive(self, message: Message, now: float) -> None:
        """See `Allocation.receive`: the centre needs no radio."""
