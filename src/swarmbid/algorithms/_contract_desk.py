"""What both sides of a Contract Net share: the books, speaking, steps of the tables, what has ended."""

from __future__ import annotations

from abc import abstractmethod
from typing import Any

import msgspec

from swarmbid.algorithms._contract_book import Book, Outcome
from swarmbid.algorithms._contract_lease import PRESENCE, Leases, mark
from swarmbid.algorithms._contract_post import Post, stable_hash, translated
from swarmbid.algorithms._contract_route import Route
from swarmbid.algorithms._contract_tables import CONTRACTOR, MANAGER, NOTHING, Table
from swarmbid.algorithms._conversation import Conversation
from swarmbid.arrays import MissionArrays
from swarmbid.messages import INCARNATION, Acts, Message, MessageError
from swarmbid.messages.acts import (
    AS_CONTRACTOR,
    AS_MANAGER,
    ASIDE,
    INFORM,
    NOT_UNDERSTOOD,
    PERFORMATIVES,
    Act,
    Ending,
    specification,
)
from swarmbid.model import Task
from swarmbid.negotiator import Said, Stage, TaskEnded, TaskReleased
from swarmbid.scores import Score

ROLES = ("manager", "contractor")


class Desk(Conversation[Post]):
    """The books of all tasks that are not over, and how their states change.

    Parameters
    ----------
    arrays : of the mission. rule : of insertion. incarnation, period, heartbeat, idle_every : see
        `ContractNet`.
    """

    def __init__(
        self,
        agent_id: str,
        arrays: MissionArrays,
        score: Score,
        rule: str,
        *,
        incarnation: int,
        period: float,
        heartbeat: float,
        idle_every: int,
    ) -> None:
        me = arrays.agent_row[agent_id]
        post = Post(agent_id, arrays.num_agents, me, incarnation=incarnation, period=period)
        super().__init__(agent_id, arrays, post, period=period, heartbeat=heartbeat, idle_every=idle_every)
        self._leases: Leases | None = None
        self._route = Route(arrays, me, score, rule)
        self._books: dict[str, Book] = {task.id: Book(task.id, task, me=me) for task in arrays.tasks}
        self._dirty: dict[str, None] = dict.fromkeys(self._books)
        self._absent: set[int] = set()
        self._executing: dict[str, float] = {}
        self._outcome: dict[str, Outcome] = {}
        self._outcome_hash: dict[str, int] = {}
        self._unhashed: dict[str, None] = dict.fromkeys(self._books)
        self._books_hash = 0

    # --- taking in

    def _understand(self, message: Message) -> Message:
        if not isinstance(message, Acts):
            raise MessageError("malformed", "is of another algorithm")
        message = translated(message, self._arrays)
        rows = self._arrays.agent_row
        for run in message.runs:
            for act in run.acts:
                if (act.to and act.to not in rows) or (act.manager and act.manager not in rows):
                    raise MessageError("unknown_id", "an act names an agent that is not known here")
                if act.task in rows:
                    raise MessageError("malformed", "an act is about a task that is an agent")
        for ending in message.ended:
            if ending.agent and ending.agent not in rows:
                raise MessageError("unknown_id", "an ending names an agent that is not known here")
        return message

    def _absorb(self, sender: int, message: Message, now: float) -> None:
        assert isinstance(message, Acts)
        if message.known[self._me] > self._voice.known[self._me]:
            # Others know more of this incarnation than it has said: it has been used up before.
            self._voice.reincarnate(
                int(message.known[self._me]) // INCARNATION * INCARNATION + INCARNATION - 1
            )
        reborn, news = self._voice.hear(sender, message, now)
        for row, acts in reborn.items():
            self._drop(row, acts)
        learnt: dict[str, Task] = {}
        for owner, act in news:
            if owner in self._absent and act.number <= self._left.get(owner, 0):
                self._voice.live(owner).pop((act.task, act.role), None)
                continue
            if act.task == PRESENCE:
                self._presence(owner, act, now)
            else:
                self._put(owner, act, learnt)
        if learnt:
            self._route.know(learnt.values(), self._books)
        for ending in message.ended:
            self._over(ending, now)

    def _hear_from_gone(self, message: Message, now: float) -> None:
        """What is over is over, whoever says so."""
        assert isinstance(message, Acts)
        for ending in message.ended:
            self._over(ending, now)

    def _put(self, owner: int, act: Act, learnt: dict[str, Task]) -> None:
        book = self._book(act.task)
        if book.task is None and act.specification is not None:
            book.task = learnt[act.task] = act.specification.task(act.task)
            book.found = True
        if act.performative not in PERFORMATIVES:
            self._puzzled(book, owner, act)
        elif act.role == AS_MANAGER:
            book.calls[owner] = act
        elif act.role == AS_CONTRACTOR:
            book.answers[owner] = act
        else:
            book.asides[owner] = act
        book.floor = max(book.floor, act.epoch)
        self._touch(book)

    def _presence(self, owner: int, act: Act, now: float) -> None:
        """Somebody is there, and says which words of this agent it has heard."""
        if self._leases is not None:
            for name, word in act.path:
                if name == self.agent_id:
                    self._leases.answered(owner, word, now)

    def _be_present(self, now: float) -> None:
        """Say that this agent is there, if it is time."""
        if self._leases is None or now < self._leases.next_word:
            return
        heard = [
            (name, mark(act.number))
            for row, name in enumerate(self._arrays.agent_ids)
            if row != self._me and (act := self._voice.live(row).get((PRESENCE, ASIDE))) is not None
        ]
        act = self._voice.put(INFORM, PRESENCE, ASIDE, path=tuple(heard), at=now)
        self._leases.say(act.number, now)

    def _puzzled(self, book: Book, owner: int, act: Act) -> None:
        """Say once that an act was not understood; what is not understood is never answered so again."""
        said = self._voice.live(self._me).get((book.id, ASIDE))
        if said is None or said.reply_to < act.number:
            self._say_act(
                NOT_UNDERSTOOD, book, ASIDE, to=self._arrays.agent_ids[owner], manager=act.manager,
                epoch=act.epoch, reply_to=act.number, reason=act.performative[:40],
            )  # fmt: skip

    def _book(self, task_id: str) -> Book:
        book = self._books.get(task_id)
        if book is None:
            book = self._books[task_id] = Book(task_id, me=self._me)
        return book

    def _touch(self, book: Book) -> None:
        book.changed()
        self._dirty[book.id] = None
        self._unhashed[book.id] = None
        self._busy = True

    def _drop(self, row: int, acts: list[Act]) -> None:
        """What an agent said counts no more, and it is somebody else's turn."""
        for act in acts:
            book = self._books.get(act.task)
            if book is not None:
                book.calls.pop(row, None)
                book.answers.pop(row, None)
                book.asides.pop(row, None)
        for book in list(self._books.values()):
            if book.task is None and not book.calls and not book.answers:
                self._unlearn(book)  # nobody is left who could tell what the task was
            else:
                self._touch(book)

    def _unlearn(self, book: Book) -> None:
        for table in (self._books, self._dirty, self._unhashed, self._outcome):
            table.pop(book.id, None)
        self._books_hash ^= self._outcome_hash.pop(book.id, 0)

    # --- saying

    def _say_act(self, performative: str, book: Book, role: int, **content: Any) -> Act:
        """Say something, note it in the book, and tell the driver."""
        if role == AS_MANAGER and book.found and book.task is not None:
            content["specification"] = specification(book.task)
        act = self._voice.put(performative, book.id, role, **content)
        if role == AS_MANAGER:
            book.calls[self._me] = act
        elif role == AS_CONTRACTOR:
            book.answers[self._me] = act
        else:
            book.asides[self._me] = act
        book.floor = max(book.floor, act.epoch)
        self._touch(book)
        self._report(act)
        return act

    def _report(self, act: Act, to: str | None = None, performative: str = "", detail: str = "") -> None:
        """Tell the driver what was said."""
        bid = act.bid if act.bid > 0.0 else None
        self._events.append(
            Said(act.task, performative or act.performative, act.to if to is None else to, act.conversation,
                 bid, detail or act.reason)
        )  # fmt: skip

    def _say(self, now: float, *, heartbeat: bool) -> Message:
        return self._voice.say(
            now, self._arrays, self._agreement, self._left,
            digest=self.digest, settled=self._agreed, heartbeat=heartbeat,
        )  # fmt: skip

    # --- the tables

    def _step(self, role: int, book: Book, event: str, now: float, **content: Any) -> bool:
        """Do what the table of a role says about `event`; return whether that is anything."""
        table: Table = (MANAGER, CONTRACTOR)[role]
        action, after = table[book.stage if role == AS_MANAGER else book.part, event]
        if action == NOTHING:
            return False
        before = book.stage if role == AS_MANAGER else book.part
        if role == AS_MANAGER:
            book.stage = after
        else:
            book.part = after
        if before != after:
            self._events.append(Stage(book.id, ROLES[role], after))
        getattr(self, f"_{ROLES[role]}_{action}")(book, now, **content)
        return True

    # --- what has ended

    def _over(self, ending: Ending, now: float) -> None:
        """Note that a task is over, if that is news, and let go of all about it."""
        known = self._books.get(ending.task)
        if known is not None and known.floor > ending.epoch:
            ending = msgspec.structs.replace(ending, epoch=known.floor)  # epochs never fall
        if not self._voice.end(ending, now):
            return
        self._busy = True
        held = ending.task in self._path_ids()
        book = self._books.get(ending.task)
        self._events.append(TaskEnded(ending.task, ending.state, ending.agent, ending.reason))
        if book is not None:
            self._unlearn(book)
            self._step(AS_MANAGER, book, f"over: {ending.state}", now)
            self._step(AS_CONTRACTOR, book, f"over: {ending.state}", now)
            self._executing.pop(book.id, None)
            self._route.remove(book.id)
            if held:
                self._events.append(TaskReleased(book.id, None))

    def _manager_close(self, book: Book, now: float) -> None:
        """Nothing more to do: the ending says it all."""

    def _contractor_close(self, book: Book, now: float) -> None:
        """Nothing more to do: the ending says it all."""

    @abstractmethod
    def _path_ids(self) -> list[str]:
        """Ids of the tasks that are under way or under contract, in order of visit."""

    # --- what all must agree on

    def _outcome_of(self, task_id: str) -> Outcome:
        ending = self._voice.endings.get(task_id)
        if ending is not None:
            return Outcome(ending.state, ending.agent, ending.reason, ending.epoch)
        return self._books[task_id].outcome(self._arrays)

    @property
    def digest(self) -> int:
        """See `Negotiator.digest`: of every task's outcome and of who is gone."""
        for task_id in self._unhashed:
            outcome = self._books[task_id].outcome(self._arrays)
            if self._outcome.get(task_id) != outcome:
                self._outcome[task_id] = outcome
                self._books_hash ^= self._outcome_hash.get(task_id, 0)
                self._outcome_hash[task_id] = stable_hash(f"{task_id}\x1f{outcome}")
                self._books_hash ^= self._outcome_hash[task_id]
        self._unhashed.clear()
        found = self._books_hash ^ self._voice.ended_hash
        for row in [*self._absent, *([self._me] if self._leaving else [])]:
            found ^= int(self._arrays.agent_hash[row])
        return found

    def _satisfied(self, now: float) -> bool:
        """Whether every task that is known has an owner, an end, or nobody who can do it."""
        self.digest  # noqa: B018 - brings the outcomes up to date
        return all(outcome.state != "open" for outcome in self._outcome.values()) and all(
            book.top(self._arrays) is not None for book in self._books.values()
        )

    # --- who has left

    def _open_what_is_left(self) -> None:
        absent = set()
        for row in self._left:
            gone = self._gone(row)
            self._agreement.wait_for(row, not gone)
            if gone and row != self._me:
                absent.add(row)
        if absent != self._absent:
            for row in sorted(absent - self._absent):
                self._drop(row, self._voice.drop(row))
            self._absent = absent
            for book in self._books.values():
                self._touch(book)

    def _newest(self, row: int) -> int:
        return max(super()._newest(row), int(self._voice.known[row]))

    def _present(self) -> list[int]:
        return [row for row in range(self._arrays.num_agents) if row not in self._absent]
