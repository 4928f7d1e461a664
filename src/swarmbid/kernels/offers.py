"""An agent's own candidates in the scan of CBGA: what it may claim that each task gains it, and the best.

Gains are those of its own path (`swarmbid.kernels.insertion`), with starts no sooner than the joint
schedule has them. They are counted when the agent took something, and again, lazily, when a candidate is
about to be taken; a claim is the least of them. So claims only fall along the scan: a gain can rise (who
joins a group that waits anyway delays nobody), and stale entries would then hold each other up.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import njit

from swarmbid.arrays import NO_AGENT, OPEN, READY, FloatArray, RowArray
from swarmbid.kernels.bundle import before
from swarmbid.kernels.insertion import evaluate, first_position, path_state
from swarmbid.kernels.joint import earliest
from swarmbid.kernels.lanes import BLOCK
from swarmbid.kernels.ranks import BID, GAIN, JOINS, KEY_SLOTS, LEAD, copy_key, outranks, write_key
from swarmbid.kernels.referee import open_to

LENGTH, BEST, COUNT, SEATS, TIMED = range(5)
MOST_BLOCKED = 62
"""Positions that are refused one by one; those further along a path are refused together."""


class Own(NamedTuple):
    """One agent's bundle, path and candidates.

    Parameters
    ----------
    table : float64[NUM_TASK_ROWS, num_tasks], the agent's own, whose READY follows the joint schedule.
    fixed : float64[num_tasks] or float64[0]. vector : float64[NUM_AGENT_SLOTS].
    task, position, lead : int64[limit + 1]; bid, gain : float64[limit + 1]: the bundle, in order of taking.
    path : int64[limit + 1]; starts, legs, values : float64[limit + 1]; total : float64[1], m.
    claim : float64[num_tasks], what each candidate may be said to gain; place : int64[num_tasks], where.
    blocked : int64[num_tasks], bits of positions that the referee refused on this path.
    key, trial, last : float64[KEY_SLOTS], ranks of the best candidate, of the one compared with it, and of
        the agent's last entry.
    columns, places : int64[BLOCK]; single : int64[1]; gains, times : float64[BLOCK]; scratch.
    seen : int64[num_tasks], how many seats of others had been taken when a candidate was last evaluated.
    sizes : int64[5]: tasks in the bundle; the best candidate; how many of `columns` are to be evaluated;
        seats that others have taken, now and when the path was timed.
    """

    table: FloatArray
    fixed: FloatArray
    vector: FloatArray
    task: RowArray
    position: RowArray
    lead: RowArray
    bid: FloatArray
    gain: FloatArray
    path: RowArray
    starts: FloatArray
    legs: FloatArray
    values: FloatArray
    total: FloatArray
    claim: FloatArray
    place: RowArray
    blocked: RowArray
    seen: RowArray
    key: FloatArray
    trial: FloatArray
    last: FloatArray
    columns: RowArray
    single: RowArray
    places: RowArray
    gains: FloatArray
    times: FloatArray
    sizes: RowArray


def empty_own(table: FloatArray, fixed: FloatArray, vector: FloatArray, limit: int) -> Own:
    """Return an agent's arrays, with nothing taken. `table` : becomes the agent's own."""
    num_tasks = table.shape[1]
    room = limit + 1
    return Own(
        table=table,
        fixed=fixed,
        vector=vector,
        task=np.zeros(room, np.int64),
        position=np.zeros(room, np.int64),
        lead=np.zeros(room, np.int64),
        bid=np.zeros(room),
        gain=np.zeros(room),
        path=np.zeros(room, np.int64),
        starts=np.zeros(room),
        legs=np.zeros(room),
        values=np.zeros(room),
        total=np.zeros(1),
        claim=np.full(num_tasks, -np.inf),
        place=np.zeros(num_tasks, np.int64),
        blocked=np.zeros(num_tasks, np.int64),
        seen=np.zeros(num_tasks, np.int64),
        key=np.zeros(KEY_SLOTS),
        trial=np.zeros(KEY_SLOTS),
        last=np.zeros(KEY_SLOTS),
        columns=np.zeros(BLOCK, np.int64),
        single=np.zeros(1, np.int64),
        places=np.zeros(BLOCK, np.int64),
        gains=np.zeros(BLOCK),
        times=np.zeros(BLOCK),
        sizes=np.zeros(5, np.int64),
    )


@njit(cache=True, error_model="numpy", forceinline=True)
def candidate_key(terms, joint, own, me, team, j, key):
    """Write the rank that a candidate would have.

    Its bid is what it claims; under team rewards, where a group is open, the founder's bid. It comes after
    the agent's own previous entry of the stage: bids never rise along a bundle (Johnson et al. 2012).
    """
    length = own.sizes[LENGTH]
    stage, claim = terms.stage[j], own.claim[j]
    bid, lead = claim, np.int64(NO_AGENT)
    if team and joint.filled[j] > 0:
        bid, lead = joint.lead_bid[j], joint.lead[j]
    write_key(key, stage, bid, lead, claim, me, length)
    if length > 0 and terms.stage[own.task[length - 1]] == stage:
        own_bid, own_lead = own.bid[length - 1], own.lead[length - 1]
        last = own.last
        write_key(last, stage, own_bid, own_lead, own.gain[length - 1], me, length - 1)
        if lead != NO_AGENT and lead == own_lead and bid == own_bid:
            # Another group of the same founder: what claims less must not rank higher (see the twin).
            key[GAIN] = min(claim, own.gain[length - 1])
        if not outranks(last, key):
            write_key(key, stage, min(bid, own_bid), np.int64(NO_AGENT), claim, me, length)
            if not outranks(last, key):
                key[BID] = np.nextafter(own_bid, -np.inf)


@njit(cache=True, error_model="numpy", forceinline=True)
def better(terms, joint, own, me, team, j):
    """Take candidate j for the best if it comes before that; `key` is the rank of the best."""
    claim, opens, best = own.claim, terms.tasks[OPEN], own.sizes[BEST]
    if claim[j] <= 0.0:
        return
    if not team and best >= 0 and not before(claim[j], opens[j], j, claim[best], opens[best], best):
        return  # where nobody joins behind a founder, ranks are in the order of claims
    candidate_key(terms, joint, own, me, team, j, own.trial)
    if own.trial[BID] <= 0.0:
        return
    if team and best >= 0 and not outranks(own.trial, own.key):
        if outranks(own.key, own.trial):
            return
        if not before(claim[j], opens[j], j, claim[best], opens[best], best):
            return
    copy_key(own.trial, own.key)
    own.sizes[BEST] = j


@njit(cache=True, error_model="numpy")
def pick(terms, joint, own, me, team):
    """Find the best candidate afresh."""
    own.sizes[BEST] = NO_AGENT
    claim, opens = own.claim, terms.tasks[OPEN]
    best: Any = np.int64(NO_AGENT)
    for j in range(claim.shape[0]):
        if claim[j] <= 0.0:
            continue
        if team:
            better(terms, joint, own, me, team, j)
        elif best < 0 or before(claim[j], opens[j], j, claim[best], opens[best], best):
            best = j
    if best >= 0:
        better(terms, joint, own, me, team, best)


@njit(cache=True, error_model="numpy")
def weigh_block(own, rule):
    """Evaluate the tasks in `columns`."""
    length, count = own.sizes[LENGTH], own.sizes[COUNT]
    evaluate(
        own.table, own.columns, count, own.vector, own.path, length, own.starts, own.legs, own.values,
        own.total[0], rule, first_position(rule, length), length, own.gains, own.places, own.times,
    )  # fmt: skip
    columns, gains, places, fixed = own.columns, own.gains, own.places, own.fixed
    claim, place = own.claim, own.place
    for i in range(count):
        j = columns[i]
        claim[j] = min(claim[j], gains[i] - (fixed[j] if fixed.shape[0] > 0 else 0.0))
        place[j] = places[i]


@njit(cache=True, error_model="numpy", forceinline=True)
def time_path(joint, own, rule):
    """Bring the times of the agent's path up to the joint schedule."""
    length = own.sizes[LENGTH]
    path, ready, start = own.path, own.table[READY], joint.start
    for k in range(length):
        ready[path[k]] = start[path[k]]
    own.total[0] = path_state(
        own.table, own.vector, own.path, length, own.starts, rule, own.starts, own.legs, own.values
    )
    own.sizes[TIMED] = own.sizes[SEATS]


@njit(cache=True, error_model="numpy")
def refresh(terms, joint, own, me, rule, stage, team):
    """Count all candidates anew, after the agent took something, or when a stage begins."""
    length = own.sizes[LENGTH]
    time_path(joint, own, rule)
    claim, blocked, seen, ready, columns = own.claim, own.blocked, own.seen, own.table[READY], own.columns
    stages, allowed, slot_at, seats, kind = terms.stage, terms.allowed, terms.slot_at, terms.seats, terms.kind
    brings, cover, spare, cover_at = terms.brings, terms.cover, terms.spare, terms.cover_at
    need_at, needs = terms.need_at, terms.needs
    tasks, start = terms.tasks, joint.start
    holder, filled, missing = joint.holder, joint.filled, joint.missing
    num_tasks = claim.shape[0] if length < terms.limits[me] else 0
    for j in range(claim.shape[0]):
        claim[j] = -np.inf
        blocked[j] = 0
        seen[j] = own.sizes[SEATS]
    count = 0
    for j in range(num_tasks + 1):
        if j < num_tasks and stages[j] == stage:
            why = open_to(
                allowed, slot_at, seats, kind, brings, cover, spare, cover_at, need_at, needs, holder, filled,
                missing, me, j,
            )  # fmt: skip
            if why == 0:
                claim[j] = np.inf
                ready[j] = earliest(tasks, start, filled, need_at, needs, j)
                columns[count] = j
                count += 1
        if count == BLOCK or (j == num_tasks and count > 0):
            own.sizes[COUNT] = count
            weigh_block(own, rule)
            count = 0
    pick(terms, joint, own, me, team)


@njit(cache=True, error_model="numpy", forceinline=True)
def weigh_open(terms, joint, own, rule, j):
    """Count one candidate at the positions that the referee has not refused."""
    length = own.sizes[LENGTH]
    if own.sizes[TIMED] != own.sizes[SEATS]:
        time_path(joint, own, rule)
    own.seen[j] = own.sizes[SEATS]
    own.table[READY, j] = earliest(terms.tasks, joint.start, joint.filled, terms.need_at, terms.needs, j)
    own.single[0] = j
    best = -np.inf
    where: Any = np.int64(0)
    for n in range(first_position(rule, length), length + 1):
        if own.blocked[j] >> min(n, MOST_BLOCKED) & 1:
            continue
        evaluate(
            own.table, own.single, own.single.shape[0], own.vector, own.path, length, own.starts, own.legs,
            own.values, own.total[0], rule, n, n, own.gains, own.places, own.times,
        )  # fmt: skip
        if own.gains[0] > best:
            best, where = own.gains[0], n
    own.claim[j] = min(own.claim[j], best - (own.fixed[j] if own.fixed.shape[0] > 0 else 0.0))
    own.place[j] = where


@njit(cache=True, error_model="numpy", forceinline=True)
def weigh_again(terms, joint, own, me, rule, team, j):
    """Count one candidate again, after something at its task or at one of its positions has changed."""
    why = open_to(
        terms.allowed, terms.slot_at, terms.seats, terms.kind, terms.brings, terms.cover, terms.spare,
        terms.cover_at, terms.need_at, terms.needs, joint.holder, joint.filled, joint.missing, me, j,
    )  # fmt: skip
    if why != 0:
        own.claim[j] = -np.inf
    else:
        weigh_open(terms, joint, own, rule, j)
    if own.sizes[BEST] == j:
        pick(terms, joint, own, me, team)
    else:
        better(terms, joint, own, me, team, j)


@njit(cache=True, error_model="numpy", forceinline=True)
def take_best(own):
    """Append the best candidate, which was admitted, to the bundle and the path."""
    length = own.sizes[LENGTH]
    j, place = own.sizes[BEST], own.place[own.sizes[BEST]]
    own.task[length] = j
    own.position[length] = place
    own.lead[length] = np.int64(own.key[LEAD]) if own.key[JOINS] > 0.0 else NO_AGENT
    own.bid[length] = own.key[BID]
    own.gain[length] = own.key[GAIN]
    for k in range(length, place, -1):
        own.path[k] = own.path[k - 1]
    own.path[place] = j
    own.sizes[LENGTH] = length + 1
