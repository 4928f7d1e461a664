"""Phase 1 of CBGA: an agent's own bundle, chosen within the scan over everybody's records.

The records' entries lie in one order, best first (`swarmbid.kernels.ranks`). The scan puts each to the
referee; at the point where the agent's own best candidate ranks higher than the next entry, that is
admitted and becomes part of its bundle. So an entry's fate, and an agent's choice, depend on entries of
higher rank alone. When records change, only what ranks below the first change is scanned again.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from swarmbid.arrays import NO_AGENT, FloatArray, RowArray
from swarmbid.kernels.joint import clear, hold
from swarmbid.kernels.offers import (
    BEST,
    LENGTH,
    MOST_BLOCKED,
    SEATS,
    better,
    pick,
    refresh,
    take_best,
    weigh_again,
)
from swarmbid.kernels.ranks import BID, JOINS, LEAD, STAGE, outranks
from swarmbid.kernels.referee import NO_LEAD, admit, withdraw

ITEMS, JOURNAL, BASE = 0, 1, 2


class Records(NamedTuple):
    """The bundles of all agents but one, as they wrote them, in rows of `width` entries.

    Parameters
    ----------
    task, position : int64[num_agents * width]. key : float64[num_agents * width, KEY_SLOTS].
    order : int64[num_agents * width], entries in order of rank; entries : int64[1], how many.
    held_agent, held_task : int64[n], held_start : float64[n], s: what is under way or done.
    """

    task: RowArray
    position: RowArray
    key: FloatArray
    order: RowArray
    entries: RowArray
    held_agent: RowArray
    held_task: RowArray
    held_start: FloatArray


class Log(NamedTuple):
    """What was scanned, in order, with what is needed to take it back.

    Parameters
    ----------
    agent, task, stage : int64[room]. own : bool[room], whether it was the agent's own choice.
    at : int64[room], entries of the order scanned before it.
    seat : int64[room], negative where it was refused. voids : bool[room], whether it ended its bundle.
    metres : float64[room], of its agent before.
    ends : int64[room], where its part of `touched` and `old` ends.
    touched : int64[...], old : float64[...], starts that it moved, and what they were.
    sizes : int64[3]: items; entries of the journal; items from whose end on it reaches back.
    """

    agent: RowArray
    task: RowArray
    stage: RowArray
    own: NDArray[np.bool_]
    at: RowArray
    seat: RowArray
    voids: NDArray[np.bool_]
    metres: FloatArray
    ends: RowArray
    touched: RowArray
    old: FloatArray
    sizes: RowArray


def empty_log(room: int, journal: int) -> Log:
    """Return a log for so many items and moved starts."""
    return Log(
        agent=np.zeros(room, np.int64),
        task=np.zeros(room, np.int64),
        stage=np.zeros(room, np.int64),
        own=np.zeros(room, np.bool_),
        at=np.zeros(room, np.int64),
        seat=np.zeros(room, np.int64),
        voids=np.zeros(room, np.bool_),
        metres=np.zeros(room),
        ends=np.zeros(room, np.int64),
        touched=np.zeros(journal, np.int64),
        old=np.zeros(journal),
        sizes=np.zeros(3, np.int64),
    )


@njit(cache=True, error_model="numpy", forceinline=True)
def note(joint, log, agent, task, stage, own, at, seat, voids, metres):
    """Write down what became of an entry. When the journal is full, what lies behind is for good."""
    item = log.sizes[ITEMS]
    moved = joint.sizes[0] if seat >= 0 else 0
    if log.sizes[JOURNAL] + moved > log.touched.shape[0]:
        log.sizes[JOURNAL] = 0
        log.sizes[BASE] = item
    begin = log.sizes[JOURNAL]
    if begin + moved > log.touched.shape[0]:  # more than the whole journal: this item cannot go back either
        log.sizes[BASE] = item + 1
        moved = 0
    for k in range(moved):
        log.touched[begin + k] = joint.touched[k]
        log.old[begin + k] = joint.old[k]
    log.agent[item] = agent
    log.task[item] = task
    log.stage[item] = stage
    log.own[item] = own
    log.at[item] = at
    log.seat[item] = seat
    log.voids[item] = voids
    log.metres[item] = metres
    log.ends[item] = begin + moved
    log.sizes[JOURNAL] = begin + moved
    log.sizes[ITEMS] = item + 1


@njit(cache=True, error_model="numpy")
def rewind(terms, joint, log, records, own, me, first):
    """Take back all that was scanned at or after entry `first` of the order; all if it is negative.

    And further back to where the agent last took something or the stage began: from there on claims have to
    be counted, for they are the least of what was gained since.

    Returns
    -------
    (entries of the order that are behind, the stage to go on with).
    """
    items = log.sizes[ITEMS]
    keep = items
    while keep > 0 and log.at[keep - 1] >= first:
        keep -= 1
    stage = log.stage[keep - 1] if keep > 0 else np.int64(0)
    while keep > 0 and not log.own[keep - 1] and log.stage[keep - 1] == stage:
        keep -= 1
    if first < 0 or keep < log.sizes[BASE]:
        clear(terms, joint)
        for k in range(records.held_agent.shape[0]):
            hold(terms, joint, records.held_agent[k], records.held_task[k], records.held_start[k])
        for k in range(log.sizes.shape[0]):
            log.sizes[k] = 0
        own.sizes[LENGTH] = 0
        keep, stage = np.int64(0), np.int64(0)
    else:
        for item in range(items - 1, keep - 1, -1):
            if log.seat[item] >= 0:
                begin = log.ends[item - 1] if item > log.sizes[BASE] else np.int64(0)
                withdraw(
                    terms, joint, log.task[item], log.metres[item], log.touched, log.old, begin,
                    log.ends[item],
                )  # fmt: skip
            if log.voids[item]:
                joint.voided[log.agent[item]] = False
            if log.own[item]:
                own.sizes[LENGTH] -= 1
        log.sizes[ITEMS] = keep
        log.sizes[JOURNAL] = log.ends[keep - 1] if keep > log.sizes[BASE] else 0
    seat = joint.first[me]
    for k in range(own.sizes[LENGTH]):
        own.path[k] = terms.slot_task[seat]
        seat = joint.after[seat]
    at = np.int64(0)
    if keep > 0:
        at = log.at[keep - 1] + (0 if log.own[keep - 1] else 1)
    return at, stage


@njit(cache=True, error_model="numpy")
def scan(terms, joint, log, records, own, me, rule, team, first):
    """Go through everybody's entries and choose the agent's own on the way.

    Parameters
    ----------
    me : the agent's row; NO_AGENT to judge the records alone.
    rule : SHIFT or APPEND. team : whether who joins a group ranks behind its founder.
    first : the first entry of the order that changed since the last scan; negative to forget that.
    """
    at, stage = rewind(terms, joint, log, records, own, me, first)
    num_stages = 1
    for j in range(terms.stage.shape[0]):
        num_stages = max(num_stages, terms.stage[j] + 1)
    width = records.task.shape[0] // max(terms.limits.shape[0], 1)
    count = records.entries[0]
    anew = True
    while stage < num_stages:
        if anew and me != NO_AGENT:
            refresh(terms, joint, own, me, rule, stage, team)
        anew = False
        mine = me != NO_AGENT and own.sizes[BEST] >= 0
        mine = mine and (at >= count or outranks(own.key, records.key[records.order[at]]))
        if mine:
            m, j = me, own.sizes[BEST]
            if own.seen[j] != own.sizes[SEATS]:  # others' seats may have changed what it gains
                claim = own.claim[j]
                weigh_again(terms, joint, own, me, rule, team, j)
                if own.claim[j] != claim:
                    continue
            place = own.place[j]
            key = own.key
        elif at < count and records.key[records.order[at], STAGE] == stage:
            entry = records.order[at]
            m, j, place = entry // width, records.task[entry], records.position[entry]
            key = records.key[entry]
        else:
            stage += 1
            anew = True
            continue
        metres = joint.metres[m]
        seat = np.int64(NO_LEAD)
        if key[JOINS] == 0.0 or (joint.filled[j] > 0 and joint.lead[j] == key[LEAD]):
            seat = admit(terms, joint, m, j, place, rule)
        if mine and seat < 0:  # try it elsewhere
            own.blocked[j] |= np.int64(1) << min(place, MOST_BLOCKED)
            weigh_again(terms, joint, own, me, rule, team, j)
            continue
        voids = bool(seat < 0 and not joint.voided[m])
        if voids:
            joint.voided[m] = True
        if seat >= 0 and joint.filled[j] == 1:  # the first who takes a seat leads the group
            joint.lead[j] = m
            joint.lead_bid[j] = key[BID]
        note(joint, log, m, j, stage, mine, at, seat, voids, metres)
        if mine:
            take_best(own)
            anew = True
        else:
            at += 1
            if seat >= 0 and me != NO_AGENT:
                mind(terms, joint, own, me, team, j)


@njit(cache=True, error_model="numpy", forceinline=True)
def mind(terms, joint, own, me, team, j):
    """See to it that another's seat at task j tells; what else it changed is counted when it is wanted."""
    own.sizes[SEATS] += 1
    if terms.slot_at[j] + joint.filled[j] == terms.slot_at[j + 1]:
        own.claim[j] = -np.inf
    if own.sizes[BEST] == j:
        pick(terms, joint, own, me, team)
    elif team:  # the group that opened lends its rank
        better(terms, joint, own, me, team, j)
