"""What the answers to a call come to: who is to have the task (Dymkou's slides, "Compare bids")."""

from __future__ import annotations

import math

from swarmbid.algorithms._contract_bids import best, diagonal, with_take_overs
from swarmbid.algorithms._contract_book import Book
from swarmbid.algorithms._contract_contractor import ContractorSide
from swarmbid.messages.acts import AS_CONTRACTOR, FAILURE, Act


class Judge(ContractorSide):
    """Compares the bids that a manager was sent with its own."""

    _take_over: bool

    def _verdict(self, book: Book, now: float) -> str:
        """What the answers so far come to; empty while they are waited for."""
        if book.keep:
            return "own bid best"
        rows = [row for row in self._present() if not (book.handing and row == self._me)]
        answered = book.all_answered(rows)
        if not answered and now < book.deadline:
            return ""
        winner = self._best(book)
        if winner == self._me:
            self._refresh(book, now)
            winner = self._best(book)
        if winner >= 0 and self._from_whom(book) >= 0:
            return "take-over best"
        if winner >= 0:
            return "own bid best" if winner == self._me else "proposals"
        if book.handing:
            return "kept"
        if not answered or book.barred:  # who did not confirm has not refused
            return "reply_by passed"
        failed = any(act.performative == FAILURE for act in book.answers.values())
        return "failures" if failed else "refusals"

    def _best(self, book: Book) -> int:
        """Row of the best bidder: the larger bid, then the higher id; -1 for none."""
        proposals = book.proposals()
        if book.handing:
            proposals.pop(self._me, None)
        return best(diagonal(proposals))[0]

    def _from_whom(self, book: Book) -> int:
        """Row of the bidder whose whole path this agent, having none, had better fly itself; -1 for none."""
        if not self._take_over or book.handing or len(self._route) or self._executing:
            return -1
        flyer, proposer = best(with_take_overs(book.proposals(), self._me, self._worth_of))
        return proposer if flyer == self._me and proposer != self._me else -1

    def _worth_of(self, act: Act) -> float:
        path = [name for name, _ in act.path]
        if len(path) + 1 > self._limit:
            return -math.inf
        return self._route.worth_of([*path[: act.place], act.task, *path[act.place :]])

    def _refresh(self, book: Book, now: float) -> None:
        """Bid anew if the agent has promised something else since it bid."""
        if self._route.version == self._bid_version:
            return
        gain, place, start = self._gain(book)
        if gain > 0.0:
            if gain != book.answers[self._me].bid:
                self._step(AS_CONTRACTOR, book, "can do", now, bid=gain, place=place, start=start)
        else:
            full = len(self._route) >= self._limit
            self._step(AS_CONTRACTOR, book, "cannot do", now, why="overloaded" if full else "")
