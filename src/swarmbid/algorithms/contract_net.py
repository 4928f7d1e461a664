"""The Contract Net: whoever finds a task calls for proposals and awards it (Smith 1980; FIPA SC00029H).

Solves: tasks that come up while a mission runs, one agent a task, several per agent, with windows,
equipment, range. It reacts at once, to one event, and says of every task why who has it.

- The manager of a task calls; every agent proposes what the task would gain it on top of what it is
  committed to, or refuses with a reason; the best is awarded the task, confirms, and is under contract.
  Only what is under contract may be started.
- Acts are replicated: each is written by its speaker alone, relayed by all, and the newest counts. So
  messages may be lost, doubled or overtaken.
- No task is left without an owner: an award that is not confirmed is revoked, a manager that is gone is
  succeeded, what nobody can do is parked with the reasons and taken up again by whoever can.

The protocol itself is two tables (`_contract_tables`). See Dymkou's slides, "Procedure Diagram", "Manager
statecharts", "Potential contractors statecharts".
"""

from __future__ import annotations

import math
from collections.abc import Callable

from swarmbid.algorithms._bundle import RULES
from swarmbid.algorithms._contract_book import Book, Outcome
from swarmbid.algorithms._contract_lease import Leases
from swarmbid.algorithms._contract_manager import ManagerSide
from swarmbid.algorithms._conversation import check_options
from swarmbid.algorithms.cbba import CBBA
from swarmbid.arrays import MissionArrays
from swarmbid.errors import Fault
from swarmbid.messages.acts import AS_CONTRACTOR, AS_MANAGER, CANCEL, Ending
from swarmbid.model import Mission, Position, Task
from swarmbid.negotiator import Said, TaskReleased
from swarmbid.scores import Score, make_score

__all__ = ["ContractNet", "Outcome"]

POLICIES = ("duplicate_ok", "hold")


class ContractNet(ManagerSide):
    """The Contract Net aboard one agent, manager and contractor at once.

    Parameters
    ----------
    agent_id : which agent of the mission.
    mission : the mission, or its arrays (share them between agents of one process).
    score : see `swarmbid.scores.make_score`.
    insertion : "hold", "shift" or "append"; the score's own by default.
    reply_within : s that a manager waits for answers to its first call, and for a confirmation; twice as
        many periods as there are agents, and two, by default.
    on_partition : "duplicate_ok", where a team in two parts may do a task twice, or "hold", where an agent
        begins a task only while it holds leases from more than half of the team (`_contract_lease`). Those
        who are left with less begin nothing, be it that the others are out of earshot or dead.
    lease : s, of "hold"; 30 periods by default.
    take_over : whether a manager without tasks takes over the whole path of the best bidder, if that is
        better for the team (slides, "Compare bids", an empty manager).
    may : what the agent may do: returns None, or a reason to refuse a task (`messages.acts.REFUSALS`).
    period : s between two messages at most. heartbeat : s between messages when all agree.
    idle_every : periods between two messages of an agent that has no news but does not know yet that all
        agree.
    incarnation : count it up whenever the agent starts again with nothing remembered.

    Examples
    --------
    >>> from swarmbid.model import Agent, Mission, Task
    >>> mission = Mission(agents=(Agent(id="uav1", position=(0.0, 0.0, 0.0)),), tasks=())
    >>> agent = ContractNet("uav1", mission)
    >>> agent.announce(Task(id="look", position=(3.0, 4.0, 0.0), reward=10.0), now=2.0)
    >>> said = agent.tick(now=2.0)
    >>> agent.path, agent.outcomes()["look"].state
    ([('look', 7.0)], 'contracted')
    """

    def __init__(
        self,
        agent_id: str,
        mission: Mission | MissionArrays,
        score: str | Score | None = None,
        *,
        insertion: str | None = None,
        reply_within: float | None = None,
        on_partition: str = "duplicate_ok",
        lease: float | None = None,
        take_over: bool = False,
        may: Callable[[Task], str | None] | None = None,
        period: float = 1.0,
        heartbeat: float = 10.0,
        idle_every: int = 4,
        incarnation: int = 1,
    ) -> None:
        faults = []
        where = f"agent {agent_id}"
        for name, value in (("reply_within", reply_within), ("lease", lease)):
            if value is not None and not 0.0 < value < math.inf:
                faults.append(Fault(where, name, f"is {value!r}", "Give seconds above 0."))
        if on_partition not in POLICIES:
            mend = "Choose one of: " + ", ".join(POLICIES) + "."
            faults.append(Fault(where, "on_partition", f"is {on_partition!r}", mend))
        found = make_score(score)
        if found.visit_function() is not None:
            mend = "Use a score of `swarmbid list`, or cbba."
            faults.append(
                Fault(where, "score", "is a function of one's own, which contractors cannot bid by", mend)
            )
        arrays = check_options(
            agent_id, mission, insertion, period=period, heartbeat=heartbeat, faults=faults,
            idle_every=idle_every,
        )  # fmt: skip
        rule = insertion or found.insertion
        super().__init__(
            agent_id, arrays, found, rule if rule in RULES else "shift",
            incarnation=incarnation, period=period, heartbeat=heartbeat, idle_every=idle_every,
        )  # fmt: skip
        patience = (2.0 * arrays.num_agents + 2.0) * period
        self._reply_within = self._confirm_within = patience if reply_within is None else reply_within
        self._hears_until = -math.inf if incarnation == 1 else math.inf
        self._may = may
        self._take_over = take_over
        if on_partition == "hold":
            length = 30.0 * period if lease is None else lease
            self._leases = Leases(arrays.num_agents, self._me, length, again=incarnation > 1)
        limit = arrays.agents[self._me].bundle_limit
        self._limit = 1 << 30 if limit is None else limit

    @classmethod
    def unsupported(cls, mission: Mission) -> list[str]:
        """One agent does each task, in any order."""
        return CBBA.unsupported(mission)

    # --- the conversation

    def _decide(self, now: float) -> None:
        if self._hears_until == math.inf and (self._received.any() or len(self._present()) == 1):
            self._hears_until = now + self._reply_within
        touched, self._dirty = self._dirty, {}  # what is touched below is looked at again next time
        self._hear_managers(touched, now)
        self._answer({**touched, **self._dirty}, now)
        self._manage({**touched, **self._dirty}, now)
        self._answer(self._dirty, now)
        self._insist(now)
        self._be_present(now)
        self._wake = min((book.deadline for book in self._books.values()), default=math.inf)
        if self._leases is not None:
            self._wake = min(self._wake, self._leases.next_word)

    def next_tick(self) -> float | None:
        """When there is something to weigh or to say; see `Negotiator.next_tick`."""
        due = super().next_tick()
        return due if due is None or self._leaving else min(due, max(self._wake, self._due))

    # --- what the driver may ask

    @property
    def path(self) -> list[tuple[str, float]]:
        """Started tasks first, then those under contract in order of visit (p_i, τ_i)."""
        held = [(name, start) for name, start in self._route.path if self._holds(name)]
        return [*self._executing.items(), *held]

    @property
    def bundle(self) -> list[str]:
        """Ids of what is under contract, in order of visit."""
        return [name for name, _ in self.path]

    def outcomes(self) -> dict[str, Outcome]:
        """How far each task has come, in order of id, as far as this agent knows."""
        known = sorted([*self._books, *self._voice.endings], key=str.encode)
        return {task_id: self._outcome_of(task_id) for task_id in known}

    def beliefs(self) -> dict[str, tuple[tuple[str, float], ...]]:
        """See `Negotiator.beliefs`; what is done counts with the bid that it was done for."""
        found: dict[str, tuple[tuple[str, float], ...]] = {}
        for task_id, outcome in self.outcomes().items():
            holders: tuple[tuple[str, float], ...] = ()
            if outcome.state in ("contracted", "started"):
                book = self._books[task_id]
                holders = ((outcome.agent, book.bid_of(self._arrays, outcome.agent)),)
            elif outcome.state == "done":
                holders = ((outcome.agent, self._voice.endings[task_id].bid),)
            found[task_id] = holders
        return found

    def proposers(self, task_id: str) -> tuple[str, ...]:
        """Who of the others has proposed for a task, as far as this agent knows."""
        book = self._books.get(task_id)
        rows = sorted(book.proposals()) if book is not None else []
        return tuple(self._arrays.agent_ids[row] for row in rows if row != self._me)

    def conversations(self) -> dict[str, tuple[str, str]]:
        """Task id -> this agent's states as manager and as contractor, of tasks that are not over."""
        return {name: (book.stage, book.part) for name, book in sorted(self._books.items())}

    # --- local commands

    def announce(self, task: Task, now: float, keep: bool = False) -> None:
        """Say that this agent has found a task, and call for proposals; others learn of it by the call.

        Parameters
        ----------
        keep : whether the agent takes the task itself at once (slides, "switch to track") and only tells
            the others.

        Raises
        ------
        ValueError : the task is over, needs several agents or others before it, or the agent is leaving.
        """
        if self._leaving:
            raise ValueError(f"{self.agent_id} is leaving and announces nothing")
        self._live = True
        book = self._learn(task)
        if book.stage not in ("idle", "yielded") or book.top(self._arrays) is not None:
            return  # somebody manages it already
        book.keep = keep
        self._step(AS_MANAGER, book, "in charge", now)
        if keep:
            self._manage({task.id: None}, now)
        self._change()

    def add_task(self, task: Task) -> None:
        """See `Negotiator.add_task`. It is managed by whoever is nearest by the roster."""
        self._learn(task)
        self._change()

    def _learn(self, task: Task) -> Book:
        if task.is_group or task.prerequisites:
            raise ValueError(f"task {task.id} needs several agents or other tasks first")
        if self._voice.is_over(task.id):
            raise ValueError(f"task {task.id} is over")
        if task.id in self._arrays.agent_row:
            raise ValueError(f"task {task.id} has the id of an agent")
        book = self._book(task.id)
        if book.task is None:
            book.task, book.found = task, True
        if not self._route.knows(task.id):
            self._route.know([book.task], self._books)
        self._touch(book)
        return book

    def _known(self, task_id: str) -> Book:
        if task_id not in self._books:
            raise ValueError(f"task {task_id} is not known to {self.agent_id}, or over")
        return self._books[task_id]

    def cancel_task(self, task_id: str) -> None:
        """See `Negotiator.cancel_task`. To tell one agent is enough; nothing happens to what is over."""
        if self._voice.is_over(task_id):
            return
        book = self._known(task_id)
        top = book.top(self._arrays)
        conversation = top[1].conversation if top is not None else f"{task_id}//{book.epoch}"
        self._events.append(Said(task_id, CANCEL, "", conversation, None, ""))
        self._over(Ending(task_id, "cancelled", "", "", book.floor), self._voice.last_spoken)
        self._change()

    def start_task(self, task_id: str, now: float) -> None:
        """See `Negotiator.start_task`; ValueError unless the task is under contract with this agent.

        Under "hold" also ValueError while it has no live lease: ask again later.
        """
        book = self._known(task_id)
        if self._leases is not None and book.part == "contracted" and not self._leases.live(now):
            raise ValueError(f"{self.agent_id} holds no live lease, so task {task_id} must wait")
        if not self._holds(task_id) or not self._step(AS_CONTRACTOR, book, "start", now):
            raise ValueError(f"task {task_id} is not under contract with {self.agent_id}")
        self._live = True
        self._keep_promises(now)
        self._change()

    def finish_task(self, task_id: str, now: float) -> None:
        """See `Negotiator.finish_task`."""
        book = self._books.get(task_id)
        if book is None or not self._step(AS_CONTRACTOR, book, "finish", now):
            if task_id in self._executing and self._leaving:
                del self._executing[task_id]
                return
            raise ValueError(f"task {task_id} was not started by {self.agent_id}; call start_task first")
        self._keep_promises(now)
        self._change()

    def fail_task(self, task_id: str, reason: str, now: float) -> None:
        """Give a task up that this agent cannot do after all; it is called for again, among the others."""
        if not self._step(AS_CONTRACTOR, self._known(task_id), "fail", now, why=reason[:200] or "failed"):
            raise ValueError(f"task {task_id} is not under contract with {self.agent_id}")
        self._change()

    def give_back(self, task_id: str, reason: str, now: float) -> None:
        """Give a task up that this agent cannot keep; unlike after `fail_task` it may bid for it again."""
        why = reason[:200] or "given back"
        if not self._step(AS_CONTRACTOR, self._known(task_id), "give back", now, why=why):
            raise ValueError(f"task {task_id} is not under contract with {self.agent_id}")
        self._change()

    def sub_contract(self, task_id: str, now: float, before: float = math.inf) -> None:
        """Look for another to take over a task that this agent holds; if nobody can, it keeps it.

        Parameters
        ----------
        before : s, when an answer is needed at the latest. What has been started is this agent's until
            the other has started it.
        """
        book = self._known(task_id)
        if book.part not in ("contracted", "started"):
            raise ValueError(f"task {task_id} is not under contract with {self.agent_id}")
        if book.handing or book.stage in ("announced", "awarded"):
            return
        book.handing = True
        if self._step(AS_MANAGER, book, "hand over", now):
            book.deadline = min(book.deadline, before)
        self._change()

    def set_position(self, position: Position, now: float) -> None:
        """See `Negotiator.set_position`. What can no longer be done in time is given back."""
        self._route.move(position, now)
        self._keep_promises(now)
        self._change()

    def leave(self) -> None:
        """See `Negotiator.leave`. What has been started is finished, so it is not open to others."""
        for task_id, _ in self._route.path:
            if self._books[task_id].part == "contracted":
                self._events.append(TaskReleased(task_id, None))
        self._route.clear()
        now = self._voice.last_spoken
        for task_id in list(self._executing):
            book = self._books[task_id]
            start = self._executing[task_id]
            self._over(Ending(task_id, "done", self.agent_id, "", book.floor, book.bid), now)
            self._executing[task_id] = start
        self._leave()
        self._drop(self._me, self._voice.drop(self._me))
        self._wake = math.inf

    def forget(self, task_id: str) -> None:
        """Give the memory of a task back that is over. Tell every agent, when all know that it is.

        Raises
        ------
        ValueError : the task is not over.
        """
        if task_id not in self._voice.endings:
            raise ValueError(f"task {task_id} is not over, as far as {self.agent_id} knows")
        self._voice.forget(task_id)
        self._change()
