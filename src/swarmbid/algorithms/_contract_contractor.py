"""The contractor's side: bids, confirmations, and what is under contract.

Dymkou's slides, "Potential contractors statecharts". A proposal says what a task would gain on top of
what the agent is committed to. When that changes, all its other proposals are renewed at once, and an
award that rests on an old one stands only if the new bid still beats every other that is known; else it
is declined, with the new bid.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from swarmbid.algorithms._contract_book import CONTRACTED, HAND_OVER, STARTED, TAKE_OVER, Book
from swarmbid.algorithms._contract_desk import Desk
from swarmbid.messages.acts import (
    ACCEPT,
    AS_CONTRACTOR,
    ASIDE,
    CFP,
    CONFIRM,
    DONE,
    FAILURE,
    INFORM,
    PROPOSE,
    REFUSE,
    RESULT,
    Act,
    Ending,
)
from swarmbid.model import Task
from swarmbid.negotiator import TaskReleased, TaskTaken

WITHDRAWN, OUTDATED = "withdrawn", "outdated"
UNBOUND = ("idle", "proposed", "refused", "released", "failed")


class ContractorSide(Desk):
    """Answers calls, confirms awards, keeps the path."""

    _limit: int
    _may: Callable[[Task], str | None] | None

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        self._bid_version = -1
        self._live = False
        self._said_path: tuple[int, tuple[tuple[str, float], ...]] = (-1, ())

    # --- hearing managers

    def _hear_managers(self, touched: dict[str, None], now: float) -> None:
        """Take up contracts, give way to others', and answer awards."""
        awards: list[Book] = []
        for task_id in touched:
            book = self._books.get(task_id)
            if book is None or book.task is None:
                continue
            top = book.top(self._arrays)
            if top is None:
                continue
            act = top[1]
            if act.epoch < book.floor:
                self._say_outdated(book, act)
                continue
            mine = act.to == self.agent_id
            if book.part == "started":
                other = book.holder(but=self._me)
                if book.handing and other >= 0 and book.answers[other].reason == STARTED:
                    self._step(AS_CONTRACTOR, book, "taken over", now)
                elif mine and act.performative == INFORM and act.epoch > book.held_epoch:
                    self._step(AS_CONTRACTOR, book, "contract", now, act=act)
            elif book.part in ("confirmed", "contracted"):
                if mine and act.performative == INFORM:
                    # Who has begun it keeps it, unless it is that one who hands it over.
                    other = book.outcome(self._arrays).agent not in (self.agent_id, act.manager)
                    if not other and (book.part == "confirmed" or act.epoch > book.held_epoch):
                        self._step(AS_CONTRACTOR, book, "contract", now, act=act)
                elif mine and act.performative == ACCEPT:
                    if book.part == "confirmed" and act.epoch > book.held_epoch:
                        awards.append(book)
                elif book.part == "confirmed" or act.performative == INFORM or act.reason == TAKE_OVER:
                    self._step(AS_CONTRACTOR, book, "awarded elsewhere", now)
            elif mine and act.performative == ACCEPT and (act.manager, act.number) != book.declined:
                awards.append(book)
            elif act.performative == INFORM and not mine:
                self._step(AS_CONTRACTOR, book, "awarded elsewhere", now)
        for book in sorted(awards, key=lambda one: (-self._award(one).bid, one.id)):
            self._weigh_award(book, now)

    def _say_outdated(self, book: Book, act: Act) -> None:
        """Tell a manager, once, that a later epoch is known than that of its word."""
        said = book.asides.get(self._me)
        if act.manager != self.agent_id and (said is None or said.epoch < book.floor):
            self._say_act(
                INFORM, book, ASIDE, to=act.manager, manager=act.manager, epoch=book.floor,
                reply_to=act.number, reason=OUTDATED,
            )  # fmt: skip

    def _award(self, book: Book) -> Act:
        top = book.top(self._arrays)
        assert top is not None
        return top[1]

    def _weigh_award(self, book: Book, now: float) -> None:
        act = self._award(book)
        if book.part == "confirmed":  # awarded anew under a higher epoch: it is in the path already
            self._step(AS_CONTRACTOR, book, "award stands", now, act=act, bid=book.bid, place=-1, start=0.0)
            return
        gain, place, start = self._gain(book)
        others = [(one.bid, row) for row, one in book.proposals_since(act.asked).items() if row != self._me]
        wins = gain >= act.bid or all((gain, self._me) > other for other in others)
        if gain > 0.0 and wins:
            self._step(AS_CONTRACTOR, book, "award stands", now, act=act, bid=gain, place=place, start=start)
        else:
            self._step(AS_CONTRACTOR, book, "award stale", now, act=act)

    def _gain(self, book: Book) -> tuple[float, int, float]:
        if len(self._route) >= self._limit or self._barred(book) or not self._route.knows(book.id):
            return -math.inf, 0, 0.0
        gains, places, starts = self._route.gains([book.id])
        return gains[0], places[0], starts[0]

    def _barred(self, book: Book) -> str:
        """Why the agent would not even look at a task."""
        if book.failed_here:
            return "failed"
        if self._may is not None and book.task is not None:
            return self._may(book.task) or ""
        return ""

    # --- answering calls

    def _answer(self, touched: dict[str, None], now: float) -> None:
        """Propose for, or refuse, what is called for and what the changed path makes other bids for."""
        changed = self._route.version != self._bid_version
        todo, must = self._to_answer(touched, changed)
        if must and self._live and not self._executing:
            self._route.wait_until(now)
            if self._route.version != self._bid_version and not changed:
                todo, must = self._to_answer(touched, changed=True)
        self._bid_version = self._route.version
        if not todo:
            return
        full = len(self._route) >= self._limit
        gains, places, starts = self._route.gains([book.id for book in todo])
        for book, gain, place, start in zip(todo, gains, places, starts, strict=True):
            why = self._barred(book) or ("overloaded" if full else "")
            own = book.answers.get(self._me)
            said = own if own is not None and book.id not in must else None
            if not why and gain > 0.0:
                if said is None or said.performative != PROPOSE or said.bid != gain:
                    self._step(AS_CONTRACTOR, book, "can do", now, bid=gain, place=place, start=start)
            elif said is None or said.performative == PROPOSE:
                self._step(AS_CONTRACTOR, book, "cannot do", now, why=why)

    def _to_answer(self, touched: dict[str, None], changed: bool) -> tuple[list[Book], dict[str, None]]:
        """Books whose answer is wanted, or may have changed; and those of the former kind."""
        todo: list[Book] = []
        must: dict[str, None] = {}
        for task_id in self._books if changed else touched:
            book = self._books.get(task_id)
            if book is None or book.part not in UNBOUND or not self._route.knows(task_id):
                continue
            top = book.top(self._arrays)
            if top is None or top[1].performative not in (CFP, ACCEPT, RESULT, FAILURE):
                continue
            own = book.answers.get(self._me)
            parked = top[1].performative in (RESULT, FAILURE)
            if (
                own is None
                or own.asked < top[1].asked
                or (own.performative == FAILURE and not book.failed_here)
            ):
                must[task_id] = None
                todo.append(book)
            elif changed and not (parked and own.performative == PROPOSE) and not book.failed_here:
                todo.append(book)
        return todo, must

    def _contractor_propose(self, book: Book, now: float, *, bid: float, place: int, start: float) -> None:
        act = self._award(book)
        path = self._committed()
        worth = self._route.worth if path else 0.0
        self._say_act(
            PROPOSE, book, AS_CONTRACTOR, to=act.manager, manager=act.manager,
            epoch=max(act.epoch, book.floor), asked=act.asked, reply_to=book.reply_to(act), bid=bid, at=start,
            idle=not path and not self._executing, path=path, place=place, worth=worth,
        )  # fmt: skip

    def _contractor_refuse(self, book: Book, now: float, *, why: str) -> None:
        act = self._award(book)
        failed = why == "failed"
        reason = why or self._route.refusal(book.id)
        self._say_act(
            FAILURE if failed else REFUSE, book, AS_CONTRACTOR, to=act.manager, manager=act.manager,
            epoch=max(act.epoch, book.floor), asked=act.asked, reply_to=book.reply_to(act), reason=reason,
        )  # fmt: skip

    def _committed(self) -> tuple[tuple[str, float], ...]:
        """The path as it is told to others, made once for all proposals that rest on it."""
        if self._said_path[0] != self._route.version:
            self._said_path = (self._route.version, tuple(self._route.path))
        return self._said_path[1]

    # --- what the table does

    def _contractor_confirm(
        self, book: Book, now: float, *, act: Act, bid: float, place: int, start: float
    ) -> None:
        if place >= 0:
            self._route.insert(book.id, place, start)
        book.bid, book.held_epoch = bid, act.epoch
        self._say_act(
            CONFIRM, book, AS_CONTRACTOR, to=act.manager, manager=act.manager, epoch=act.epoch,
            asked=act.asked, reply_to=act.number, bid=bid, at=start,
        )  # fmt: skip

    def _contractor_decline(self, book: Book, now: float, *, act: Act) -> None:
        book.declined = (act.manager, act.number)
        self._say_act(
            FAILURE, book, AS_CONTRACTOR, to=act.manager, manager=act.manager, epoch=act.epoch,
            asked=act.asked, reply_to=act.number, reason=WITHDRAWN,
        )  # fmt: skip

    def _contractor_take(self, book: Book, now: float, *, act: Act) -> None:
        book.failed_here = False
        self._contractor_renew(book, now, act=act)
        ids = self._path_ids()
        place = ids.index(book.id) if book.id in ids else len(ids)
        self._events.append(TaskTaken(book.id, book.bid, place, self._start_of(book.id)))

    def _contractor_renew(self, book: Book, now: float, *, act: Act) -> None:
        """Hold the task under a newer epoch, and say so."""
        book.held_epoch = act.epoch
        started = book.id in self._executing
        self._say_act(
            INFORM, book, AS_CONTRACTOR, to=act.manager, manager=act.manager, epoch=act.epoch,
            asked=act.asked, reply_to=act.number, bid=book.bid,
            at=self._executing[book.id] if started else self._start_of(book.id),
            reason=STARTED if started else CONTRACTED,
        )  # fmt: skip

    def _start_of(self, task_id: str) -> float:
        return dict(self._route.path).get(task_id, 0.0)

    def _contractor_drop(self, book: Book, now: float) -> None:
        """Somebody else does it; what was proposed was only proposed."""

    def _contractor_release(self, book: Book, now: float) -> None:
        self._give_back(book, now, WITHDRAWN)

    def _contractor_give_back(self, book: Book, now: float, *, why: str) -> None:
        self._give_back(book, now, why)

    def _contractor_hand_over(self, book: Book, now: float) -> None:
        book.handing = False
        self._give_back(book, now, HAND_OVER)

    def _contractor_fail(self, book: Book, now: float, *, why: str) -> None:
        book.failed_here = True
        self._give_back(book, now, why)

    def _give_back(self, book: Book, now: float, why: str) -> None:
        self._executing.pop(book.id, None)
        self._route.remove(book.id)
        own = book.answers[self._me]
        if own.performative == INFORM:
            self._events.append(TaskReleased(book.id, None))
        self._say_act(
            FAILURE, book, AS_CONTRACTOR, to=own.manager, manager=own.manager, epoch=book.held_epoch,
            asked=own.asked, reply_to=own.reply_to, reason=why,
        )  # fmt: skip

    def _contractor_start(self, book: Book, now: float) -> None:
        assert book.task is not None
        self._route.remove(book.id)
        self._route.move(book.task.position, now + book.task.duration)
        self._executing[book.id] = now
        own = book.answers[self._me]
        self._say_act(
            INFORM, book, AS_CONTRACTOR, to=own.manager, manager=own.manager, epoch=book.held_epoch,
            asked=own.asked, reply_to=own.number, bid=book.bid, at=now, reason=STARTED,
        )  # fmt: skip

    def _contractor_finish(self, book: Book, now: float) -> None:
        assert book.task is not None
        own = book.answers[self._me]
        self._report(own, performative=DONE, detail=" ")
        self._executing.pop(book.id)
        self._route.move(book.task.position, now)
        self._over(Ending(book.id, "done", self.agent_id, "", book.floor, book.bid), now)

    def _keep_promises(self, now: float) -> None:
        """Give back what can no longer be done in time, or with what is left to fly."""
        for task_id in self._route.overdue():
            book = self._books[task_id]
            self._step(AS_CONTRACTOR, book, "give back", now, why="too_late")

    def _path_ids(self) -> list[str]:
        return [*self._executing, *[name for name, _ in self._route.path if self._holds(name)]]

    def _holds(self, task_id: str) -> bool:
        """Whether a task is under contract with this agent, and nothing heard since says otherwise."""
        book = self._books.get(task_id)
        if book is None or book.part != "contracted":
            return False
        # While it is handed over, who has begun it goes on, and this agent may begin.
        return book.outcome(self._arrays).agent in (self.agent_id, book.answers[self._me].manager)
