"""The referee of CBGA: one entry of one agent's bundle, accepted or refused, with all that follows.

Who is accepted, which groups are complete and when everybody starts is a pure function of the agents'
records, computed alike by everybody. Here is its step: `admit` lets an agent take a seat of a task at a
place of its path, unless seats, equipment, prerequisites, the joint schedule or the agent's own limits
forbid it, and moves every start that has to wait for it; `withdraw` takes such steps back, last first.
The joint schedule is the longest path over what waits for what.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from swarmbid.arrays import AVAILABLE, DISTANCE_STEP, DURATION, END, LATEST_RETURN, RANGE, SLOWNESS
from swarmbid.kernels.insertion import APPEND
from swarmbid.kernels.joint import (
    HELD,
    NO_SEAT,
    between,
    complete,
    earliest,
    from_start,
    link,
    unlink,
    way_back,
)

# What `admit` returns if it does not return a seat.
VOID, NOT_ALLOWED, BUNDLE_FULL, NO_PLACE, MEMBER, FULL, EQUIPMENT, PREREQUISITE = (
    -1,
    -2,
    -3,
    -4,
    -5,
    -6,
    -7,
    -8,
)
CIRCLE, TOO_FAR, TOO_LATE, NO_LEAD = -9, -10, -11, -12

SLACK = 1e-12
"""Relative rounding allowed when a sum of legs just meets a range: its order differs from the bidder's."""


@njit(cache=True, error_model="numpy")
def completable(spare, base, brings, holder, begin, taken, missing, m):
    """Whether a group with one more member can become complete, and everybody in it be needed.

    It can if a piece can be kept for each member, of those that it alone brings, such that agents who
    carry none of the kept pieces bring all that is missing: as few of them as do it are needed each.
    Else a group may come to a standstill: of A, C and BC, the first two leave no room for the third.
    """
    once, twice = brings[m], np.int64(0)
    for slot in range(begin, taken):
        other = brings[holder[slot]]
        twice |= once & other
        once |= other
    alone = once & ~twice
    members = taken - begin + 1
    own = np.empty(members, np.int64)
    own[0] = brings[m] & alone
    for slot in range(begin, taken):
        own[slot - begin + 1] = brings[holder[slot]] & alone
    for k in range(members):
        if own[k] == 0:
            return False
    left = missing & ~brings[m]
    rest = own.copy()  # pieces not tried yet, for each member
    pick = np.zeros(members, np.int64)
    kept, k = np.int64(0), 0
    while k >= 0:
        kept &= ~pick[k]
        if rest[k] == 0:
            rest[k], pick[k] = own[k], 0
            k -= 1
            continue
        pick[k] = rest[k] & -rest[k]
        rest[k] &= rest[k] - 1
        kept |= pick[k]
        if left & ~spare[base + kept] == 0:
            if k == members - 1:
                return True
            k += 1
    return False


@njit(cache=True, error_model="numpy", forceinline=True)
def open_to(
    allowed,
    slot_at,
    seats,
    kind,
    brings,
    cover,
    spare,
    cover_at,
    need_at,
    needs,
    holder,
    filled,
    missing,
    m,
    j,
):
    """Return 0 if an agent may take a seat of a task as far as its group goes, else why not.

    Hunt 2014, eqs. (4), (5) and (9): a free seat; equipment such that the seats left can still bring the
    rest, from sets that exist in the fleet; and the prerequisites' groups complete. Where the seats are
    as many as the equipment takes, everybody has to bring something that nobody else brings.

    Parameters
    ----------
    allowed ... needs : see `Terms`. holder, filled, missing : see `Joint`.
    """
    if not allowed[m, j]:
        return NOT_ALLOWED
    begin = slot_at[j]
    taken = begin + filled[j]
    if taken >= slot_at[j + 1]:
        return FULL
    for slot in range(begin, taken):
        if holder[slot] == m:
            return MEMBER
    k = kind[j]
    bring = brings[k, m]
    if seats[j] > 0:
        if cover[cover_at[k] + (missing[j] & ~bring)] > seats[j] - filled[j] - 1:
            return EQUIPMENT
    else:
        if bring & missing[j] == 0 or not completable(
            spare, cover_at[k], brings[k], holder, begin, taken, missing[j], m
        ):
            return EQUIPMENT
    for i in range(need_at[j], need_at[j + 1]):
        if not complete(seats, filled, missing, needs[i]):
            return PREREQUISITE
    return 0


@njit(cache=True, error_model="numpy")
def waits_for(terms, joint, source, target):
    """Whether `target` has to wait for `source`; nothing that starts later than it can stand between."""
    start, filled, after, queue, seen = joint.start, joint.filled, joint.after, joint.queue, joint.seen
    slot_at, slot_task, later_at, later = terms.slot_at, terms.slot_task, terms.later_at, terms.later
    joint.sizes[1] += 1
    mark = joint.sizes[1]
    latest = start[target]
    queue[0] = source
    seen[source] = mark
    count = 1
    while count > 0:
        count -= 1
        t = queue[count]
        if t == target:
            return True
        if start[t] > latest:
            continue
        for slot in range(slot_at[t], slot_at[t] + filled[t]):
            following = after[slot]
            if following >= 0:
                u = slot_task[following]
                if seen[u] != mark:
                    seen[u] = mark
                    queue[count] = u
                    count += 1
        for i in range(later_at[t], later_at[t + 1]):
            u = later[i]
            if filled[u] > 0 and seen[u] != mark:
                seen[u] = mark
                queue[count] = u
                count += 1
    return False


@njit(cache=True, error_model="numpy", forceinline=True)
def delay(latest, start, touched, old, sizes, seen, waiting, queue, j, new, end):
    """Let a task start at `new`, note what it was, and queue it unless it is queued.

    Returns
    -------
    (entries that this adds to the queue, its end); -1 if the task misses its window.
    """
    if seen[j] != sizes[1]:
        seen[j] = sizes[1]
        touched[sizes[0]] = j
        old[sizes[0]] = start[j]
        sizes[0] += 1
    start[j] = new
    if new > latest[j]:
        return -1, end
    if waiting[j]:
        return 0, end
    waiting[j] = True
    queue[end] = j
    return 1, (end + 1) % queue.shape[0]


@njit(cache=True, error_model="numpy")
def spread_delay(terms, joint, j, new):
    """Let a task start at `new` and move all that waits for it; False if something comes too late."""
    tasks, agents = terms.tasks, terms.agents
    slot_at, slot_task, later_at, later = terms.slot_at, terms.slot_task, terms.later_at, terms.later
    start, filled, holder, before, after = joint.start, joint.filled, joint.holder, joint.before, joint.after
    touched, old, sizes, seen = joint.touched, joint.old, joint.sizes, joint.seen
    waiting, queue = joint.waiting, joint.queue
    latest = tasks[END]
    step = agents[0, DISTANCE_STEP]
    sizes[1] += 1
    begin, end, count = np.int64(0), np.int64(0), np.int64(0)
    u = j
    # One place where tasks are delayed, so that it is compiled once: the first time round it is j itself.
    t, slot, i, in_time = np.int64(-1), np.int64(0), np.int64(0), True
    while True:
        more, end = delay(latest, start, touched, old, sizes, seen, waiting, queue, u, new, end)
        in_time = more >= 0
        count += more
        u = np.int64(-1)
        while u < 0 and in_time:
            if t < 0 or (slot == slot_at[t] + filled[t] and i == later_at[t + 1]):
                if count == 0:
                    return True
                t = queue[begin]
                begin = (begin + 1) % queue.shape[0]
                count -= 1
                waiting[t] = False
                slot, i = slot_at[t], later_at[t]
                continue
            done = start[t] + tasks[DURATION, t]
            if slot < slot_at[t] + filled[t]:
                m, following = holder[slot], after[slot]
                if before[slot] == HELD:
                    pass
                elif following >= 0:
                    new = done + between(tasks, t, slot_task[following], step) * agents[m, SLOWNESS]
                    if new > start[slot_task[following]]:
                        u = slot_task[following]
                else:
                    home = way_back(tasks, agents, m, t, step) * agents[m, SLOWNESS]
                    in_time = done + home <= agents[m, LATEST_RETURN]
                slot += 1
            else:
                if filled[later[i]] > 0 and done > start[later[i]]:
                    u, new = later[i], done
                i += 1
        if not in_time:
            for k in range(sizes[0]):
                waiting[touched[k]] = False
            return False


@njit(cache=True, error_model="numpy", forceinline=True)
def withdraw(terms, joint, j, metres, touched, old, begin, end):
    """Take the last step back: unseat who was last seated at a task, and restore the starts it moved.

    Parameters
    ----------
    metres : of that agent before.
    touched, old : its tasks and their starts, from `begin` to `end`.
    """
    m = joint.holder[terms.slot_at[j] + joint.filled[j] - 1]
    unlink(terms, joint, j)
    joint.metres[m] = metres
    for k in range(end - 1, begin - 1, -1):
        joint.start[touched[k]] = old[k]


@njit(cache=True, error_model="numpy")
def admit(terms, joint, m, j, position, rule):
    """Let an agent take a seat of a task at a position of its path.

    Returns
    -------
    The seat, at least 0, with `touched` and `old` telling which starts moved; or why not (see above), and
    then nothing has changed.
    """
    joint.sizes[0] = 0
    if joint.voided[m]:
        return VOID
    count = joint.visits[m]
    if count >= terms.limits[m]:
        return BUNDLE_FULL
    if position < 0 or position > count or (rule == APPEND and position != count):
        return NO_PLACE
    tasks, agents, slot_task = terms.tasks, terms.agents, terms.slot_task
    need_at, needs, start, filled = terms.need_at, terms.needs, joint.start, joint.filled
    why = open_to(
        terms.allowed, terms.slot_at, terms.seats, terms.kind, terms.brings, terms.cover, terms.spare,
        terms.cover_at,
        need_at, needs, joint.holder, filled, joint.missing, m, j,
    )  # fmt: skip
    if why != 0:
        return why
    b, a = NO_SEAT, joint.first[m]
    if position == count:
        b, a = joint.last[m], NO_SEAT
    else:
        for _ in range(position):
            b = a
            a = joint.after[a]
    # Nothing may wait for itself, not even for no time. Every circle leads through the new seat.
    if filled[j] > 0:
        if b >= 0 and waits_for(terms, joint, j, slot_task[b]):
            return CIRCLE
        if a >= 0 and waits_for(terms, joint, slot_task[a], j):
            return CIRCLE
    if a >= 0:
        for i in range(need_at[j], need_at[j + 1]):
            if waits_for(terms, joint, slot_task[a], needs[i]):
                return CIRCLE
    step, slowness = agents[m, DISTANCE_STEP], agents[m, SLOWNESS]
    if b >= 0:
        previous = slot_task[b]
        leg = between(tasks, previous, j, step)
        arrival = start[previous] + tasks[DURATION, previous] + leg * slowness
    else:
        leg = from_start(tasks, agents, m, j, step)
        arrival = agents[m, AVAILABLE] + leg * slowness
    new = max(earliest(tasks, start, filled, need_at, needs, j), arrival)
    if new > tasks[END, j]:
        return TOO_LATE
    metres = joint.metres[m] + leg
    final = j
    if a >= 0:
        following = slot_task[a]
        metres += between(tasks, j, following, step)
        if b >= 0:
            metres -= between(tasks, slot_task[b], following, step)
        else:
            metres -= from_start(tasks, agents, m, following, step)
        final = slot_task[joint.last[m]]
    if metres + way_back(tasks, agents, m, final, step) > agents[m, RANGE] * (1.0 + SLACK):
        return TOO_FAR
    slot = link(terms, joint, m, j, b, a)
    if not spread_delay(terms, joint, j, new):
        withdraw(terms, joint, j, joint.metres[m], joint.touched, joint.old, np.int64(0), joint.sizes[0])
        return TOO_LATE
    joint.metres[m] = metres
    return slot
