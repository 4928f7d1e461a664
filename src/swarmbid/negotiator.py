"""The contract: one agent's side of a protocol, without clock, socket, thread or random source.

A negotiator is a state machine. A driver (the simulator, or a process on a real network) feeds it
messages and the time, and carries away what it wants to say. Nothing in it knows which driver that is,
so what is rehearsed in simulation is what flies.

    while running:
        for message in arrived:
            negotiator.receive(message, now)      # takes in; says nothing
        if negotiator.next_tick() <= now:
            for message in negotiator.tick(now):  # weighs everything taken in, then speaks once
                broadcast(message)
        for event in negotiator.events():
            ...                                   # what the driver should know

A mistake of the caller raises. A peer's bad message never does: it changes nothing and becomes a
`MessageDropped` event with a reason.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar

from swarmbid.messages import Message
from swarmbid.model import Mission, Position, Task


@dataclass(frozen=True)
class Event:
    """Something that the driver should know; `kind` is its name in the trace."""

    kind: ClassVar[str]


@dataclass(frozen=True)
class TaskTaken(Event):
    """The agent adds a task to its bundle.

    Parameters
    ----------
    bid : score units. position : in the path, counted from 0. start : s, planned start of service.
    """

    kind = "taken"
    task: str
    bid: float
    position: int
    start: float


@dataclass(frozen=True)
class TaskOutbid(Event):
    """The agent loses a task of its bundle to another's better bid.

    Parameters
    ----------
    bid : what it had bid. by : the winner now. by_bid : the winner's bid.
    """

    kind = "outbid"
    task: str
    bid: float
    by: str
    by_bid: float


@dataclass(frozen=True)
class TaskReleased(Event):
    """The agent gives up a task that nobody outbid.

    Parameters
    ----------
    because : the lost task that the bid on this one was built upon; None if its plan changed.
    """

    kind = "released"
    task: str
    because: str | None


@dataclass(frozen=True)
class TaskQuit(Event):
    """The agent gives up a task whose group stays incomplete, and bids on it no more.

    Parameters
    ----------
    filled : how many of the task's seats were taken.
    """

    kind = "quit"
    task: str
    filled: int


@dataclass(frozen=True)
class Said(Event):
    """The agent said something in a conversation about a task.

    Parameters
    ----------
    performative : FIPA name ("cfp", "propose" ...). to : id of the receiver; empty for all.
    conversation : task, manager and epoch.
    bid : of a proposal, an award or a contract. detail : reason, or what else was said.
    """

    kind = "act"
    task: str
    performative: str
    to: str
    conversation: str
    bid: float | None
    detail: str


@dataclass(frozen=True)
class Stage(Event):
    """The agent's state in a conversation about a task changed.

    Parameters
    ----------
    role : "manager" or "contractor". state : the new one.
    """

    kind = "stage"
    task: str
    role: str
    state: str


@dataclass(frozen=True)
class TaskEnded(Event):
    """The agent knows a task to have ended.

    Parameters
    ----------
    outcome : "done", "failed", "cancelled" or "unserved". by : id of who did it; empty for nobody.
    reason : why it was not done.
    """

    kind = "ended"
    task: str
    outcome: str
    by: str
    reason: str


@dataclass(frozen=True)
class MessageDropped(Event):
    """A message was not taken in, and changed nothing.

    Parameters
    ----------
    reason : one word, to be counted. sender : as the message says.
    """

    kind = "dropped"
    sender: str
    reason: str


@dataclass(frozen=True)
class Agreed(Event):
    """Every live agent's newest digest equals the agent's own."""

    kind = "agreed"


@dataclass(frozen=True)
class Doubted(Event):
    """That is so no longer."""

    kind = "doubted"


class Negotiator(ABC):
    """One agent's side of a protocol.

    Parameters
    ----------
    agent_id : which agent of the mission it speaks for.
    """

    agent_id: str

    @classmethod
    def unsupported(cls, mission: Mission) -> list[str]:
        """Return why this algorithm cannot allocate `mission`, in sentences; empty if it can."""
        return []

    @abstractmethod
    def receive(self, message: Message, now: float) -> None:
        """Take in one message. Call whenever one arrives, in any order, duplicates too.

        Says nothing itself: afterwards `next_tick` may have become earlier. Never raises on a peer's
        fault.
        """

    @abstractmethod
    def tick(self, now: float) -> list[Message]:
        """Weigh what was taken in and return what to broadcast to the neighbours.

        Call at `next_tick`, after the messages that have arrived by then. Extra calls are harmless: a
        negotiator with nothing due returns an empty list.
        """

    @abstractmethod
    def next_tick(self) -> float | None:
        """When `tick` has work, s; None if it only waits for messages.

        Pure. Changes only through `receive`, `tick` and the local commands.
        """

    @abstractmethod
    def events(self) -> list[Event]:
        """Return what happened since the last call, oldest first, and forget it."""

    @property
    @abstractmethod
    def path(self) -> list[tuple[str, float]]:
        """What the agent intends to do: task ids in order of visit, with their starts of service, s."""

    @property
    @abstractmethod
    def agreed(self) -> bool:
        """Whether every live agent's newest known digest equals its own."""

    @property
    @abstractmethod
    def digest(self) -> int:
        """Hash of everything that the agents must agree on."""

    @abstractmethod
    def beliefs(self) -> dict[str, tuple[tuple[str, float], ...]]:
        """Who holds which task with which bid, as far as this agent knows (z_i, y_i; X_i).

        Every task that it knows; the holders in order of id, more than one where a task needs several.
        """

    # Local commands: what the vehicle and its operator tell the agent, never disguised as messages.

    @abstractmethod
    def add_task(self, task: Task) -> None:
        """Make a new task known to this agent. Tell every agent; until told, one does not bid on it."""

    @abstractmethod
    def cancel_task(self, task_id: str) -> None:
        """Never do this task; give it up if it is held. Tell every agent."""

    @abstractmethod
    def start_task(self, task_id: str, now: float) -> None:
        """Service has begun: from now on no bid takes the task away."""

    @abstractmethod
    def finish_task(self, task_id: str, now: float) -> None:
        """Service has ended; the agent is free from `now`, where the task is."""

    @abstractmethod
    def set_position(self, position: Position, now: float) -> None:
        """The agent is at `position` (m) now, free to go on; bids count from here."""

    @abstractmethod
    def leave(self) -> None:
        """Give up everything not yet started, say so at the next tick, and bid no more."""

    @abstractmethod
    def lose_agent(self, agent_id: str) -> None:
        """Another agent is gone (a failure detector's verdict): what it held is open again."""
