"""The one order of CBGA's entries, best first, that all agents share.

Prerequisite stage of the task (lower first), bid (higher), the id of who leads (higher): the agent itself,
or under team rewards the founder of the group that it joins; then, behind the founder, who joins, by gain
(higher); the agent's id (higher), the place in its bundle (lower).
"""

from __future__ import annotations

from numba import njit

from swarmbid.arrays import NO_AGENT

# Slots of a key, float64[KEY_SLOTS]; every one is a number that floats hold exactly.
STAGE, BID, LEAD, JOINS, GAIN, AGENT, PLACE = range(7)
KEY_SLOTS = 7


@njit(cache=True, error_model="numpy", forceinline=True)
def write_key(key, stage, bid, lead, gain, agent, place):
    """Write the key of an entry. `lead` : who founded the group that is joined, or NO_AGENT."""
    key[STAGE] = stage
    key[BID] = bid
    key[LEAD] = agent if lead == NO_AGENT else lead
    key[JOINS] = 0.0 if lead == NO_AGENT else 1.0
    key[GAIN] = gain
    key[AGENT] = agent
    key[PLACE] = place


@njit(cache=True, error_model="numpy", forceinline=True)
def copy_key(key, out):
    """Copy a key."""
    for slot in range(KEY_SLOTS):
        out[slot] = key[slot]


@njit(cache=True, error_model="numpy", forceinline=True)
def outranks(key, other):
    """Whether an entry comes before another."""
    if key[STAGE] != other[STAGE]:
        return key[STAGE] < other[STAGE]
    if key[BID] != other[BID]:
        return key[BID] > other[BID]
    if key[LEAD] != other[LEAD]:
        return key[LEAD] > other[LEAD]
    if key[JOINS] != other[JOINS]:
        return key[JOINS] < other[JOINS]
    if key[JOINS] > 0.0 and key[GAIN] != other[GAIN]:
        return key[GAIN] > other[GAIN]
    if key[AGENT] != other[AGENT]:
        return key[AGENT] > other[AGENT]
    return key[PLACE] < other[PLACE]


@njit(cache=True, error_model="numpy")
def sort_entries(refs, count, keys, spare):
    """Sort references into `keys`, best first, by merging runs of doubled length.

    Parameters
    ----------
    refs : int64[>= count]. keys : float64[num_agents * width, KEY_SLOTS]. spare : int64[>= count].
    """
    run = 1
    while run < count:
        for begin in range(0, count, 2 * run):
            middle, end = min(begin + run, count), min(begin + 2 * run, count)
            left, right = begin, middle
            for k in range(begin, end):
                if right >= end or (left < middle and not outranks(keys[refs[right]], keys[refs[left]])):
                    spare[k] = refs[left]
                    left += 1
                else:
                    spare[k] = refs[right]
                    right += 1
        for k in range(count):
            refs[k] = spare[k]
        run *= 2


@njit(cache=True, error_model="numpy")
def rearrange(order, count, stale, fresh, num_fresh, keys, spare):
    """Take entries out of an order and put new ones in.

    Parameters
    ----------
    order : int64[...], `count` references into `keys`, best first; changed.
    stale : bool[num_agents * width], which of them go; read for those in the order only.
    fresh : int64[...], `num_fresh` references that come; sorted here.

    Returns
    -------
    (entries now, the first that differs).
    """
    sort_entries(fresh, num_fresh, keys, spare)
    kept = 0
    first = count
    for k in range(count):
        if stale[order[k]]:
            first = min(first, k)
        else:
            spare[kept] = order[k]
            kept += 1
    total = kept + num_fresh
    left = right = 0
    for k in range(total):
        if right >= num_fresh or (left < kept and not outranks(keys[fresh[right]], keys[spare[left]])):
            order[k] = spare[left]
            left += 1
        else:
            order[k] = fresh[right]
            first = min(first, k)
            right += 1
    return total, first
