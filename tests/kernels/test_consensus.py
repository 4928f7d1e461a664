"""The consensus kernel against the decision table spelt out in if and elif, over everything there is."""

from __future__ import annotations

import itertools
import random

import numpy as np
import pytest

from naive_consensus import decide, row_of
from swarmbid.algorithms.cbba import CBBA, DECISION_RULES, packed
from swarmbid.arrays import NO_AGENT
from swarmbid.kernels import consensus
from swarmbid.kernels.bundle import BID, BUNDLE, NUM_MARK_ROWS, NUM_ORDER_ROWS

ACTIONS = {consensus.LEAVE: "leave", consensus.UPDATE: "update", consensus.RESET: "reset"}
ROLES = "ikmn"  # receiver, sender and two third agents
BELIEFS = [*ROLES, None]
BIDS = ((5.0, 4.0), (5.0, 5.0), (4.0, 5.0))  # theirs, mine
STAMPS = ((3, 2), (2, 2), (2, 3), (consensus.NOT_LISTED, 2))  # theirs, mine
SEATINGS = list(itertools.permutations(ROLES))  # who has which row: the order that breaks ties


def every_case():
    """(seating, sender believes, receiver believes, bids, stamps of the two agents believed in)."""
    for seating, theirs, mine, bids in itertools.product(SEATINGS, BELIEFS, BELIEFS, BIDS):
        named = sorted({agent for agent in (theirs, mine) if agent is not None})
        for stamps in itertools.product(STAMPS, repeat=len(named)):
            yield seating, theirs, mine, bids, dict(zip(named, stamps, strict=True))


def twin_says(seating, theirs, mine, bids, stamps, row_12="settling") -> str:
    """The if/elif table, with agents named so that their order as ids is their order as rows."""
    name = {role: str(row) for row, role in enumerate(seating)} | {None: None}
    their_heard, my_heard = {}, {}
    for role in ROLES:
        theirs_at, mine_at = stamps.get(role, (2, 2))
        # Unlisted is "unchanged since the last message", of which the receiver knows already.
        their_heard[name[role]] = mine_at if theirs_at == consensus.NOT_LISTED else theirs_at
        my_heard[name[role]] = mine_at
    bid, my_bid = (bids[0] if theirs else 0.0), (bids[1] if mine else 0.0)
    return decide(
        name["i"], name["k"], name[theirs], bid, name[mine], my_bid, their_heard, my_heard, row_12=row_12
    )


def kernel_says(rules, seating, theirs, mine, bids, stamps) -> str:
    row = {role: number for number, role in enumerate(seating)} | {None: NO_AGENT}
    their_heard, my_heard = np.full(4, 2, np.int64), np.full(4, 2, np.int64)
    for role, (theirs_at, mine_at) in stamps.items():
        their_heard[row[role]], my_heard[row[role]] = theirs_at, mine_at
    bid, my_bid = (bids[0] if theirs else 0.0), (bids[1] if mine else 0.0)
    return ACTIONS[
        consensus.decide(
            rules, row["i"], row["k"], row[theirs], bid, row[mine], my_bid, their_heard, my_heard
        )
    ]


def disagreements(rules) -> set[int]:
    """Rows of the table in which kernel and twin decide differently somewhere."""
    found = set()
    for case in every_case():
        number = row_of("i", "k", case[1], case[2])
        if number not in found and kernel_says(rules, *case) != twin_says(*case):
            found.add(number)
    return found


def test_the_kernel_decides_as_the_table_says_in_every_case():
    """25 pairs of beliefs, 3 relations of bids, 4 of each stamp, 24 orders of ids."""
    assert sum(1 for _ in every_case()) > 10_000
    assert disagreements(CBBA.DECISIONS) == set()


def test_the_table_departs_from_the_papers_in_one_case_only():
    """Row 12, news of n, news of m as old as the receiver's, no better bid or a better one: not left."""
    departures = 0
    for case in every_case():
        paper, ours = twin_says(*case, row_12="paper"), twin_says(*case)
        if paper != ours:
            departures += 1
            _, theirs, mine, _, stamps = case
            assert (paper, ours) == ("leave", "update")
            assert row_of("i", "k", theirs, mine) == 12
            assert stamps[mine][0] > stamps[mine][1]
            assert stamps[theirs][0] in (stamps[theirs][1], consensus.NOT_LISTED)
    assert departures > 0


@pytest.mark.parametrize("row", range(1, 18))
def test_a_row_that_is_changed_to_leave_is_noticed(row: int):
    """But for the four rows that say *leave* anyway: 5, 8, 14 and 17."""
    case = list(DECISION_RULES)[row - 1]
    mutant = {key: (() if key == case else lines) for key, lines in DECISION_RULES.items()}
    assert disagreements(packed(mutant)) == ({row} if DECISION_RULES[case] else set())
    assert (DECISION_RULES[case] == ()) == (row in (5, 8, 14, 17))


@pytest.mark.parametrize("action", [consensus.UPDATE, consensus.RESET])
@pytest.mark.parametrize("row", [5, 8, 14, 17])
def test_a_row_that_should_leave_and_does_not_is_noticed(row: int, action: int):
    case = list(DECISION_RULES)[row - 1]
    mutant = {**DECISION_RULES, case: ((0, action),)}
    assert disagreements(packed(mutant)) == {row}


@pytest.mark.parametrize(("row", "line"), [(3, 0), (3, 1), (10, 0), (10, 1), (12, 0), (12, 1), (12, 2)])
def test_every_clause_of_a_row_counts(row: int, line: int):
    case = list(DECISION_RULES)[row - 1]
    fewer = tuple(clause for k, clause in enumerate(DECISION_RULES[case]) if k != line)
    assert disagreements(packed({**DECISION_RULES, case: fewer})) == {row}


class Table:
    """One agent's beliefs as the kernel wants them."""

    def __init__(self, rng: random.Random, num_tasks: int, num_agents: int) -> None:
        self.winner = np.array([rng.randrange(-1, num_agents) for _ in range(num_tasks)], np.int32)
        bids = [float(rng.randint(1, 3)) for _ in range(num_tasks)]
        self.bid = np.where(self.winner == NO_AGENT, 0.0, bids)
        self.heard = np.array([rng.randint(0, 3) for _ in range(num_agents)], np.int64)
        self.flags = np.zeros(num_tasks, np.uint8)
        self.task_hash = np.arange(1, num_tasks + 1, dtype=np.uint64) * np.uint64(977)
        self.agent_hash = np.arange(1, num_agents + 1, dtype=np.uint64) * np.uint64(1_000_003)
        self.digest = np.array([self.fresh_digest()], np.uint64)

    def fresh_digest(self) -> int:
        return int(
            consensus.digest_of(self.task_hash, self.agent_hash, self.winner, self.bid.view(np.uint64))
        )

    def beliefs(self) -> list[tuple[int, float]]:
        return list(zip(self.winner.tolist(), self.bid.tolist(), strict=True))

    def resolve(self, me: int, sender: int, full: bool, rows, winners, bids, heard) -> int:
        return consensus.resolve(
            CBBA.DECISIONS, me, sender, full, self.winner, self.bid, self.bid.view(np.uint64), self.heard,
            self.flags, self.task_hash, self.agent_hash, self.digest, rows, winners, bids, heard,
        )  # fmt: skip


@pytest.mark.parametrize("full", [True, False])
def test_a_message_is_resolved_task_by_task_and_then_the_stamps(full: bool):
    """Beliefs, stamps, digest, flags and the count of changes, on 400 random messages."""
    num_tasks, num_agents = 7, 4
    acted = 0
    for seed in range(400):
        rng = random.Random(seed)
        mine, theirs = Table(rng, num_tasks, num_agents), Table(rng, num_tasks, num_agents)
        me, sender = rng.sample(range(num_agents), 2)
        listed = np.array(
            [j for j in range(num_tasks) if (theirs.winner[j] != NO_AGENT if full else rng.random() < 0.5)],
            np.int32,
        )
        before, old_heard = mine.beliefs(), mine.heard.tolist()
        changes = mine.resolve(
            me, sender, full, listed, theirs.winner[listed], theirs.bid[listed], theirs.heard
        )
        name = [str(row) for row in range(num_agents)]
        stamps = dict(zip(name, theirs.heard.tolist(), strict=True))
        known = dict(zip(name, old_heard, strict=True))
        expected = []
        for j, (winner, bid) in enumerate(before):
            if not full and j not in listed:
                expected.append((winner, bid))
                continue
            said = (int(theirs.winner[j]), float(theirs.bid[j]))
            action = decide(
                str(me), str(sender),
                None if said[0] == NO_AGENT else str(said[0]), said[1],
                None if winner == NO_AGENT else str(winner), bid, stamps, known,
                row_12="settling",
            )  # fmt: skip
            expected.append({"leave": (winner, bid), "update": said, "reset": (NO_AGENT, 0.0)}[action])
        assert mine.beliefs() == expected, seed
        assert changes == sum(old != new for old, new in zip(before, expected, strict=True)), seed
        assert mine.heard.tolist() == [
            old if row == me else max(old, int(theirs.heard[row])) for row, old in enumerate(old_heard)
        ], seed
        assert int(mine.digest[0]) == mine.fresh_digest(), seed
        for j in range(num_tasks):
            changed = before[j] != expected[j]
            differ = (full or j in listed) and expected[j] != (theirs.winner[j], theirs.bid[j])
            assert bool(mine.flags[j] & consensus.TO_WEIGH) == changed, seed
            assert bool(mine.flags[j] & consensus.TO_SEND) == (changed or differ), seed
        acted += changes
    assert acted > 400


def test_a_claim_opens_what_is_no_longer_held_and_leaves_what_others_won():
    """Tasks 0, 1, 2 were held. 1 was lost to agent 3 and is not taken again, 0 is given up, 2 stays."""
    me = 1
    table = Table(random.Random(0), 5, 4)
    table.winner[:] = [me, 3, me, NO_AGENT, 2]
    table.bid[:] = [4.0, 6.0, 3.0, 0.0, 5.0]
    table.digest[0] = table.fresh_digest()
    order = np.full((NUM_ORDER_ROWS, 3), NO_AGENT, np.int64)
    marks = np.zeros((NUM_MARK_ROWS, 3))
    order[BUNDLE, :2], marks[BID, :2] = [2, 4], [3.5, 7.0]
    changes = consensus.claim(
        me, np.array([0, 1, 2], np.int64), order, marks, 2, table.winner, table.bid,
        table.bid.view(np.uint64), table.flags, table.task_hash, table.agent_hash, table.digest,
    )  # fmt: skip
    assert table.beliefs() == [(NO_AGENT, 0.0), (3, 6.0), (me, 3.5), (NO_AGENT, 0.0), (me, 7.0)]
    assert changes == 3
    assert (table.flags & consensus.TO_SEND).tolist() == [1, 0, 1, 0, 1]
    assert int(table.digest[0]) == table.fresh_digest()


def test_digests_tell_beliefs_apart():
    """Another winner, another bid, or two beliefs swapped between tasks."""
    table = Table(random.Random(3), 3, 4)
    table.winner[:], table.bid[:] = [0, 1, NO_AGENT], [2.0, 2.0, 0.0]
    seen = {table.fresh_digest()}
    for winner, bid in (
        ([1, 0, NO_AGENT], [2.0, 2.0, 0.0]),
        ([0, 1, NO_AGENT], [2.5, 2.0, 0.0]),
        ([0, NO_AGENT, NO_AGENT], [2.0, 0.0, 0.0]),
        ([0, NO_AGENT, 1], [2.0, 0.0, 2.0]),
    ):
        table.winner[:], table.bid[:] = winner, bid
        seen.add(table.fresh_digest())
    assert len(seen) == 5
