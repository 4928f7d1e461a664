"""The rules of CBGA as it was printed, compiled (Hunt 2014, Fig. 1 and 2).

State is the paper's: the matrix of bids, one row a task and one column an agent, 0 for no bid. What the
print leaves open is decided by `charitable`: False follows the letters, True what the text says that they
mean (the table in `swarmbid.algorithms.cbga_printed` lists every place).

`terms` is what the tasks ask for, the same at every agent; see `PrintedTerms`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from swarmbid.arrays import NO_AGENT, RowArray
from swarmbid.kernels.bundle import before, outbids
from swarmbid.kernels.consensus import LEAVE, UPDATE, belief_hash, decide


class PrintedTerms(NamedTuple):
    """What the tasks ask for, and who could bring it.

    Parameters
    ----------
    seats : int64[num_tasks] (L_j).
    need : int64[num_tasks], the task's equipment (e_j) as bits of its own.
    brings : int64[num_tasks, num_agents], which of those bits each agent carries.
    first : int64[num_tasks], where the task's part of `least` begins.
    least : uint8[...], for each set of missing bits how few agents could bring it, or NEVER (255).
    able : int64[num_tasks], how many agents may do the task by type.
    begin : int64[num_tasks + 1], prerequisites[begin[j] : begin[j + 1]] are those of task j (P_j).
    prerequisites : int64[...], task rows.
    order : int64[num_tasks], task rows, prerequisites before those that wait for them.
    """

    seats: RowArray
    need: RowArray
    brings: RowArray
    first: RowArray
    least: NDArray[np.uint8]
    able: RowArray
    begin: RowArray
    prerequisites: RowArray
    order: RowArray


@njit(cache=True)
def digest_of(bids, task_hash, agent_hash):
    """Sum of the hashes of all bids, and of all tasks; the same matrix gives the same digest."""
    bits = bids.view(np.uint64)
    total = np.uint64(0)
    for j in range(bids.shape[0]):
        total += belief_hash(task_hash[j], np.uint64(0), np.uint64(0))
        for m in range(bids.shape[1]):
            if bids[j, m] > 0.0:
                total += belief_hash(task_hash[j], agent_hash[m], bits[j, m])
    return total


@njit(cache=True)
def holder(bids, task):
    """The best bidder of a task, NO_AGENT for none."""
    best = NO_AGENT
    for m in range(bids.shape[1]):
        if bids[task, m] > 0.0 and (best == NO_AGENT or outbids(bids[task, m], m, bids[task, best], best)):
            best = m
    return best


@njit(cache=True)
def seated(bids, task):
    """How many agents hold a seat."""
    count = 0
    for m in range(bids.shape[1]):
        count += bids[task, m] > 0.0
    return count


@njit(cache=True)
def complete(terms, bids, task):
    """Whether the group has all its members and all its equipment (eq. (4), as the text means it)."""
    missing = terms.need[task]
    for m in range(bids.shape[1]):
        if bids[task, m] > 0.0:
            missing &= ~terms.brings[task, m]
    return seated(bids, task) == terms.seats[task] and missing == 0


@njit(cache=True)
def prepared(terms, charitable, bids, task):
    """Whether the prerequisites let a task be bid for (eq. (5)).

    As printed the sum over all prerequisites has to be positive: one bid on any of them will do. The text
    asks that all of them have complete assignments.
    """
    begin, end = terms.begin[task], terms.begin[task + 1]
    if begin == end:
        return True
    met = 0
    for i in range(begin, end):
        first = terms.prerequisites[i]
        if complete(terms, bids, first) if charitable else seated(bids, first) > 0:
            met += 1
    return met == end - begin if charitable else met > 0


@njit(cache=True)
def completable(terms, bids, task, agent):
    """Whether the group, with `agent` in a free seat, can still be completed by agents that exist."""
    missing = terms.need[task] & ~terms.brings[task, agent]
    left = terms.seats[task] - 1
    for m in range(bids.shape[1]):
        if m != agent and bids[task, m] > 0.0:
            missing &= ~terms.brings[task, m]
            left -= 1
    if left < 0 or terms.able[task] < terms.seats[task]:
        return False
    return terms.least[terms.first[task] + missing] <= left


@njit(cache=True)
def weakest(terms, charitable, bids, task, agent):
    """The lowest bidder whose place `agent` could take, NO_AGENT for none.

    The print takes the lowest of all (Fig. 2, line 17), eq. (9) only one with the same equipment.
    """
    found = NO_AGENT
    for m in range(bids.shape[1]):
        if bids[task, m] <= 0.0:
            continue
        if charitable and terms.brings[task, m] != terms.brings[task, agent]:
            continue
        if found == NO_AGENT or outbids(bids[task, found], found, bids[task, m], m):
            found = m
    return found


@njit(cache=True)
def admitted(terms, charitable, bids, task, agent, bid):
    """Whether `agent` may bid for a task (h_ij; Fig. 1, lines 8 to 18)."""
    if terms.seats[task] == 1:
        # Line 17: more than the sum of the row, which holds one bid at most; ties by id.
        best = holder(bids, task)
        total = 0.0
        for m in range(bids.shape[1]):
            total += bids[task, m]
        return best == NO_AGENT or outbids(bid, agent, total, best)
    if seated(bids, task) < terms.seats[task]:
        if not charitable or completable(terms, bids, task, agent):
            return True
    elif not charitable and seated(bids, task) < bids.shape[1]:
        return True  # line 11: the minimum over all agents is the 0 of one that has not bid
    low = weakest(terms, charitable, bids, task, agent)
    return low != NO_AGENT and outbids(bid, agent, bids[task, low], low)


@njit(cache=True)
def choose(terms, charitable, teams, me, bids, closed, gain, opens, ceiling):
    """The task to take next, NO_AGENT for none (J_i; Fig. 1, line 20).

    Parameters
    ----------
    teams : whether a group's task is valued by the whole group's bids (eq. (6)) instead of one's own.
    closed : bool[num_tasks], tasks that are out of the question.
    gain : float64[num_tasks] (c_ij), -inf where a task fits nowhere. opens : float64[num_tasks], s.
    ceiling : no bid is higher than this (bid warping), inf for no limit.
    """
    best, best_worth, best_opens = NO_AGENT, 0.0, -np.inf
    for j in range(gain.shape[0]):
        bid = min(gain[j], ceiling)
        if closed[j] or bids[j, me] > 0.0 or not bid > 0.0:
            continue
        worth = gain[j]
        if teams and terms.seats[j] > 1:
            for m in range(bids.shape[1]):
                worth += bids[j, m]
            if seated(bids, j) >= terms.seats[j]:
                worth -= bids[j, max(weakest(terms, charitable, bids, j, me), 0)]
        if not before(worth, opens[j], j, best_worth, best_opens, best):
            continue
        if prepared(terms, charitable, bids, j) and admitted(terms, charitable, bids, j, me, bid):
            best, best_worth, best_opens = j, worth, opens[j]
    return best


@njit(cache=True)
def seat(terms, charitable, bids, task, agent, bid):
    """Enter a bid, in place of the weakest where there is no other seat."""
    if terms.seats[task] == 1:
        bids[task, :] = 0.0
    elif seated(bids, task) >= terms.seats[task] or (
        charitable and not completable(terms, bids, task, agent)
    ):
        low = weakest(terms, charitable, bids, task, agent)
        if low != NO_AGENT:
            bids[task, low] = 0.0
    bids[task, agent] = bid


@njit(cache=True)
def merge_single(table, me, sender, task, bids, arrivals, heard, their_bids, their_arrivals, their_heard):
    """A task with one seat, by the table of CBBA (Fig. 2, line 5); return whether a bid changed."""
    mine, theirs = holder(bids, task), holder(their_bids, task)
    my_bid = bids[task, mine] if mine != NO_AGENT else 0.0
    their_bid = their_bids[task, theirs] if theirs != NO_AGENT else 0.0
    if mine == theirs and my_bid == their_bid:
        if mine != NO_AGENT and mine != me and their_heard[mine] > heard[mine]:
            arrivals[task, mine] = their_arrivals[task, mine]
        return False
    action = decide(table, me, sender, theirs, their_bid, mine, my_bid, their_heard, heard)
    if action == LEAVE:
        return False
    bids[task, :] = 0.0
    if action == UPDATE and theirs != NO_AGENT:
        bids[task, theirs] = their_bid
        arrivals[task, theirs] = their_arrivals[task, theirs]
    return True


@njit(cache=True)
def merge_group(
    terms, charitable, me, sender, task, bids, arrivals, heard, their_bids, their_arrivals, their_heard
):
    """A task with several seats, in the paper's two phases (Fig. 2, lines 7 to 23)."""
    changed = False
    num_agents = bids.shape[1]
    for m in range(num_agents):  # lines 7 to 11: correct what is known by what the sender knows better
        if bids[task, m] <= 0.0 or m == me:
            continue
        # The print asks for k = m; the text (and `charitable`) takes news from anybody who has newer.
        if their_heard[m] > heard[m] and (charitable or m == sender):
            changed |= bids[task, m] != their_bids[task, m]
            bids[task, m] = their_bids[task, m]
            arrivals[task, m] = their_arrivals[task, m]
    for m in range(num_agents):  # lines 12 to 23: merge what is new
        bid = their_bids[task, m]
        if bid <= 0.0 or m == me or their_heard[m] <= heard[m]:
            continue
        if charitable and bids[task, m] > 0.0:
            continue  # "neither the receiver nor assigned by i": the second half is not in line 13
        free = seated(bids, task) < terms.seats[task]
        if not free or (charitable and not completable(terms, bids, task, m)):
            low = weakest(terms, charitable, bids, task, m)
            if low == NO_AGENT or not outbids(bid, m, bids[task, low], low):
                continue
            bids[task, low] = 0.0
            changed = True
        changed |= bids[task, m] != bid
        bids[task, m] = bid
        arrivals[task, m] = their_arrivals[task, m]
    return changed


@njit(cache=True)
def merge(
    terms, table, charitable, me, sender, bids, arrivals, heard, their_bids, their_arrivals, their_heard
):
    """Take in one neighbour's matrix (Fig. 2).

    Parameters
    ----------
    table : int8[5, 5, NUM_FACTS], the decision table of CBBA.
    me, sender : rows (i, k).
    bids, arrivals : float64[num_tasks, num_agents], in and out (X_i; s).
    heard : int64[num_agents], stamps, in and out (s_i).
    their_bids, their_arrivals, their_heard : the sender's (X_k, s_k).

    Returns
    -------
    Whether a bid changed.
    """
    changed = False
    for j in range(bids.shape[0]):
        if terms.seats[j] == 1:
            changed |= merge_single(
                table, me, sender, j, bids, arrivals, heard, their_bids, their_arrivals, their_heard
            )
        else:
            changed |= merge_group(
                terms, charitable, me, sender, j, bids, arrivals, heard, their_bids, their_arrivals,
                their_heard,
            )  # fmt: skip
    # Line 24, after all tasks: within the loop, news would count for the first task only.
    heard[sender] = max(heard[sender], their_heard[sender])
    if charitable:
        for m in range(heard.shape[0]):
            if m != me:
                heard[m] = max(heard[m], their_heard[m])
    return changed


@njit(cache=True)
def wait_for_others(terms, me, bids, arrivals, ready, duration, out):
    """When each task can begin as far as others are concerned, s (eq. (8)).

    That is when its latest other member arrives and its prerequisites are done.

    Parameters
    ----------
    ready, duration : float64[num_tasks], s: earliest start of service and its length.
    out : float64[num_tasks], written, s.
    """
    start = np.empty(ready.shape[0])
    for i in range(terms.order.shape[0]):
        j = terms.order[i]
        others = ready[j]
        for k in range(terms.begin[j], terms.begin[j + 1]):
            first = terms.prerequisites[k]
            if seated(bids, first) > 0:
                others = max(others, start[first] + duration[first])
        for m in range(bids.shape[1]):
            if m != me and bids[j, m] > 0.0:
                others = max(others, arrivals[j, m])
        out[j] = others
        start[j] = max(others, arrivals[j, me]) if bids[j, me] > 0.0 else others
