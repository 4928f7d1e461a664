"""The manager's side: calls, awards, contracts, and what becomes of a task that nobody takes.

Dymkou's slides, "Manager statecharts". A task is awarded in three steps, so that nobody starts alone:
accept-proposal, confirm, and the contract itself (inform). Whoever is late with a confirmation is passed
over under the next epoch, and its late word means nothing. The contract is broadcast like everything, and
so it tells the losers.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from swarmbid.algorithms._contract_book import HAND_OVER, STARTED, TAKE_OVER, Book
from swarmbid.algorithms._contract_contractor import OUTDATED
from swarmbid.algorithms._contract_judge import Judge
from swarmbid.algorithms._contract_tables import MANAGER, MANAGER_EVENTS, NOTHING
from swarmbid.messages.acts import (
    ACCEPT,
    AS_CONTRACTOR,
    AS_MANAGER,
    CFP,
    CONFIRM,
    FAILURE,
    INFORM,
    PROPOSE,
    REFUSE,
    REJECT,
    RESULT,
    Act,
    Ending,
)

MOST_PERIODS = 64
"""Longest wait between two calls, in multiples of the first."""
MOST_STEPS = 64
"""Steps of one conversation at one time: far more than any takes."""
WANTED = {
    state: [event for event in MANAGER_EVENTS if MANAGER[state, event][0] != NOTHING]
    for state in sorted({state for state, _ in MANAGER})
}
"""State -> what may come that matters, in the order in which it is looked for."""


class ManagerSide(Judge):
    """Announces, awards, contracts, and takes over where a manager is gone."""

    _reply_within: float
    _confirm_within: float
    _hears_until: float

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        self._wake = math.inf
        self._facts: dict[str, Callable[[Book, float], bool]] = {
            "rival": self._rival,
            "heir: unserved": lambda book, now: book.parked_as == "unserved" and self._in_charge(book, now),
            "heir: failed": lambda book, now: book.parked_as == "failed" and self._in_charge(book, now),
            "in charge": self._in_charge,
            "outdated": lambda book, now: book.floor > book.epoch,
            "holder": self._holder_heard,
            "confirm": self._confirmed,
            "failure": self._fails,
            "contractor lost": self._contractor_lost,
            "confirm_by passed": lambda book, now: now >= book.deadline,
            "take-over best": lambda book, now: self._verdict(book, now) == "take-over best",
            "own bid best": lambda book, now: self._verdict(book, now) == "own bid best",
            "proposals": lambda book, now: self._verdict(book, now) == "proposals",
            "kept": lambda book, now: self._verdict(book, now) == "kept",
            "refusals": lambda book, now: self._verdict(book, now) == "refusals",
            "failures": lambda book, now: self._verdict(book, now) == "failures",
            "reply_by passed": lambda book, now: self._verdict(book, now) == "reply_by passed",
            "can now": lambda book, now: bool(book.proposals()),
            "back-off over": lambda book, now: now >= book.deadline,
            "latest start passed": self._too_late,
        }

    def _manage(self, touched: dict[str, None], now: float) -> None:
        """Let every conversation that this agent leads go as far as it can."""
        due = [
            book
            for book in self._books.values()
            if book.task is not None and (book.id in touched or now >= book.deadline)
        ]
        own = {book.id: self._own_bid(book) for book in due}
        for book in sorted(due, key=lambda one: (-own[one.id], one.id)):
            for _ in range(MOST_STEPS):
                if book.id not in self._books or not self._next_step(book, now):
                    break
            self._call_again(book)

    def _own_bid(self, book: Book) -> float:
        own = book.answers.get(self._me)
        return own.bid if own is not None and own.performative == PROPOSE else 0.0

    def _next_step(self, book: Book, now: float) -> bool:
        for event in WANTED[book.stage]:
            fact = self._facts.get(event)
            if fact is not None and fact(book, now):
                return self._step(AS_MANAGER, book, event, now)
        return False

    def _insist(self, now: float) -> None:
        """Say awards and confirmations that wait for an answer again, in case they were lost."""
        waiting = [
            act.number
            for book in self._books.values()
            if book.stage == "awarded" or book.part == "confirmed"
            for act in (book.calls.get(self._me), book.answers.get(self._me))
            if act is not None and act.performative in (ACCEPT, CONFIRM)
        ]
        if waiting:
            self._voice.insist(min(waiting), now)

    # --- what has come

    def _rival(self, book: Book, now: float) -> bool:
        top = book.top(self._arrays)
        return top is not None and top[0] != self._me

    def _in_charge(self, book: Book, now: float) -> bool:
        """Whether nobody leads and it is this agent's turn.

        Of a task of the mission everybody knows whose turn it is. One that was found may be unknown to
        those before: each waits for all of them, one time to reply for each. Who has started again with
        nothing remembered first hears what the others know.
        """
        if book.top(self._arrays) is not None:
            book.vacant = book.deadline = math.inf
            return False
        turn = 0 if self._resumes(book) else book.turn(self._arrays, self._absent, self._me)
        if not book.found and turn > 0:
            return False
        book.vacant = min(book.vacant, now)
        wait = turn * self._reply_within + (self._grace(book) if self._absent else 0.0)
        book.deadline = max(book.vacant + wait, self._hears_until)
        return now >= book.deadline

    def _resumes(self, book: Book) -> bool:
        """Whether this agent has yielded to one that is gone, and others still go by its own old call."""
        return book.stage == "yielded" and any(
            act.to == self.agent_id and act.reason == OUTDATED for act in book.asides.values()
        )

    def _grace(self, book: Book) -> float:
        """s after which nobody out of earshot can still begin the task, or be at it."""
        if self._leases is None or book.task is None:
            return 0.0
        return self._leases.lease + book.task.duration

    def _contractor_lost(self, book: Book, now: float) -> bool:
        if book.chosen in book.answers:
            if book.vacant < math.inf:
                book.vacant = book.deadline = math.inf
            return False
        if book.stage == "awarded" or self._leases is None:
            return True
        book.vacant = min(book.vacant, now)
        book.deadline = book.vacant + self._grace(book)
        return now >= book.deadline

    def _holder_heard(self, book: Book, now: float) -> bool:
        holder = self._holder(book)
        if holder >= 0 and book.stage == "awarded" and book.calls[self._me].reason == TAKE_OVER:
            return book.answers[holder].reason == STARTED
        if holder < 0 or (book.stage == "contracted" and holder == book.chosen):
            return False
        if book.stage == "contracted":
            chosen = book.answers.get(book.chosen)
            started = chosen is not None and chosen.performative == INFORM and chosen.reason == STARTED
            return not started and book.answers[holder].reason == STARTED
        return True

    def _holder(self, book: Book) -> int:
        return book.holder(but=self._me if book.handing else -1)

    def _confirmed(self, book: Book, now: float) -> bool:
        act = book.answers.get(book.chosen)
        if book.calls[self._me].reason == TAKE_OVER and book.holder() >= 0:
            return False  # it has not let go of it yet
        return act is not None and act.performative == CONFIRM and act.epoch == book.epoch

    def _fails(self, book: Book, now: float) -> bool:
        act = book.answers.get(book.chosen)
        if act is None:
            return False
        if book.stage == "awarded":
            award = book.calls[self._me]
            return (
                act.performative in (PROPOSE, REFUSE, FAILURE)
                and act.reply_to == award.number
                and act.manager == self.agent_id
            )
        return act.performative not in (INFORM, CONFIRM)

    def _too_late(self, book: Book, now: float) -> bool:
        assert book.task is not None
        return now > book.task.end

    # --- what the table does

    def _manager_announce(self, book: Book, now: float) -> None:
        book.epoch = book.floor
        book.tries = 0
        self._call(book, now)

    def _manager_reopen(self, book: Book, now: float) -> None:
        book.epoch = max(book.epoch, book.floor)
        self._call(book, now)

    def _call(self, book: Book, now: float) -> None:
        """Call for proposals under the next epoch; earlier answers do not count."""
        book.epoch += 1
        book.asked = book.epoch
        book.chosen = -1
        book.barred.clear()
        book.vacant = math.inf
        wait = self._reply_within * min(2.0**book.tries, MOST_PERIODS)
        book.deadline = now + wait
        self._call_for(book)

    def _call_for(self, book: Book) -> None:
        self._say_act(
            CFP, book, AS_MANAGER, manager=self.agent_id, epoch=book.epoch, asked=book.asked,
            at=book.deadline, reason=HAND_OVER if book.handing else "",
        )  # fmt: skip

    def _call_again(self, book: Book) -> None:
        """An award that was revoked must not stand as the last word."""
        if book.stage == "announced" and book.calls[self._me].epoch < book.epoch:
            self._call_for(book)

    def _manager_resume(self, book: Book, now: float) -> None:
        """Somebody can do it after all; who has answered need not do so again."""
        book.epoch += 1
        book.chosen = -1
        book.tries = 0
        book.deadline = now + self._reply_within
        self._call_for(book)

    def _manager_award(self, book: Book, now: float) -> None:
        book.chosen = self._best(book)
        book.tries = 0
        # What is too far away for one deadline is within the next: else an award is revoked for ever.
        book.deadline = now + self._confirm_within * min(2.0**book.vain, MOST_PERIODS)
        won = book.answers[book.chosen]
        self._say_act(
            ACCEPT, book, AS_MANAGER, to=self._arrays.agent_ids[book.chosen], manager=self.agent_id,
            epoch=book.epoch, asked=book.asked, reply_to=won.number, bid=won.bid, at=book.deadline,
            reason=HAND_OVER if book.handing else "",
        )  # fmt: skip

    def _manager_next_best(self, book: Book, now: float) -> None:
        book.epoch += 1
        book.chosen = -1
        book.deadline = min(book.deadline, now)  # who has not answered the call by now was not waited for

    def _manager_revoke(self, book: Book, now: float) -> None:
        act = book.answers.get(book.chosen)
        if act is not None:
            book.barred[book.chosen] = act.number
        name = self._arrays.agent_ids[book.chosen]
        self._report(book.calls[self._me], name, REJECT, "did not confirm in time")
        book.vain += 1
        self._manager_next_best(book, now)

    def _manager_contract(self, book: Book, now: float) -> None:
        self._put_in_force(book, book.answers[book.chosen])

    def _put_in_force(self, book: Book, won: Act) -> None:
        book.deadline = math.inf
        book.tries = book.vain = 0
        name = self._arrays.agent_ids[book.chosen]
        act = self._say_act(
            INFORM, book, AS_MANAGER, to=name, manager=self.agent_id, epoch=book.epoch, asked=book.asked,
            reply_to=won.number, bid=won.bid, reason="",
        )  # fmt: skip
        self._tell_losers(act, name)

    def _tell_losers(self, act: Act, name: str) -> None:
        """The contract is heard by all, and with it everybody else that its proposal is rejected."""
        if self._arrays.num_agents > 1:
            self._report(act, "", REJECT, f"awarded to {name}")

    def _manager_take(self, book: Book, now: float) -> None:
        """The own bid is the best: the contract is with oneself, at once."""
        gain, place, start = self._gain(book)
        if gain == -math.inf:  # kept whatever it costs: first of all
            place, start, gain = 0, now, 0.0
        book.bid, book.chosen, book.keep = max(gain, 0.0), self._me, False
        self._route.insert(book.id, place, start)
        own = book.answers.get(self._me)
        number = own.number if own is not None else 0
        book.deadline = math.inf
        act = self._say_act(
            INFORM, book, AS_MANAGER, to=self.agent_id, manager=self.agent_id, epoch=book.epoch,
            asked=book.asked, reply_to=number, bid=book.bid,
        )  # fmt: skip
        self._step(AS_CONTRACTOR, book, "contract", now, act=act)
        self._tell_losers(act, self.agent_id)

    def _manager_take_over(self, book: Book, now: float) -> None:
        """This idle agent takes the task and, by direct awards, all that the best bidder has not begun."""
        proposer = self._from_whom(book)
        act = book.answers[proposer]
        self._manager_take(book, now)
        for name, _ in act.path:
            other = self._books.get(name)
            if other is not None and other.holder() == proposer and other.answers[proposer].reason != STARTED:
                self._step(AS_MANAGER, other, "claim", now)

    def _manager_claim(self, book: Book, now: float) -> None:
        """Award oneself what another holds; it is in force when that one has let go of it."""
        book.epoch = max(book.floor, book.epoch) + 1
        book.chosen = self._me
        book.deadline = now + self._confirm_within
        gain, place, start = self._gain(book)
        act = self._say_act(
            ACCEPT, book, AS_MANAGER, to=self.agent_id, manager=self.agent_id, epoch=book.epoch,
            asked=book.asked, bid=max(gain, 0.0), at=book.deadline, reason=TAKE_OVER,
        )  # fmt: skip
        if gain > -math.inf:
            self._step(
                AS_CONTRACTOR, book, "award stands", now, act=act, bid=act.bid, place=place, start=start
            )

    def _manager_adopt(self, book: Book, now: float) -> None:
        """Who holds the task keeps it, under this manager and the next epoch."""
        book.chosen = self._holder(book)
        book.epoch = max(book.epoch, book.floor) + 1
        book.handing = False
        self._put_in_force(book, book.answers[book.chosen])

    def _manager_lift(self, book: Book, now: float) -> None:
        """The contract stands, under an epoch above all that were heard of."""
        book.epoch = book.floor + 1
        self._put_in_force(book, book.answers.get(book.chosen, book.calls[self._me]))

    def _manager_keep(self, book: Book, now: float) -> None:
        """Nobody takes it over: the holder goes on, under a contract with itself."""
        book.handing = False
        book.chosen = self._me
        book.epoch += 1
        self._put_in_force(book, book.answers[self._me])

    def _manager_park(self, book: Book, now: float) -> None:
        """Nobody can do it as things are; it is taken up again when somebody can.

        An heir repeats what the last manager has found, under the next epoch.
        """
        assert book.task is not None
        book.deadline = math.nextafter(book.task.end, math.inf)
        last = book.parked if self._me not in book.calls else None
        if last is not None:
            book.epoch, book.asked = book.floor + 1, last.asked
        reason = book.reasons()[:200] if last is None else last.reason
        act = self._say_act(
            FAILURE if book.stage == "failed" else RESULT, book, AS_MANAGER, manager=self.agent_id,
            epoch=book.epoch, asked=book.asked, reason=reason,
        )  # fmt: skip
        if last is None:
            self._report(act, "", REJECT, "nobody can do it now")

    def _manager_back_off(self, book: Book, now: float) -> None:
        assert book.task is not None
        book.tries += 1
        wait = self._reply_within * min(2.0**book.tries, MOST_PERIODS)
        book.deadline = min(now + wait, max(math.nextafter(book.task.end, math.inf), now + self.period))

    def _manager_give_up(self, book: Book, now: float) -> None:
        reason = book.reasons() or "nobody answered"
        self._report(book.calls[self._me], "", REJECT, "given up: " + reason[:150])
        self._over(Ending(book.id, book.stage, "", reason[:200], book.epoch), now)

    def _manager_withdraw(self, book: Book, now: float) -> None:
        """A rival leads: it hears who holds the task from the holder itself."""
        book.calls.pop(self._me, None)
        self._voice.unsay(book.id, AS_MANAGER)
        book.chosen = -1
        book.handing = book.keep = False
        book.deadline = math.inf
        self._touch(book)
