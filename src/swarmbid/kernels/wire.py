"""What a message holds, counted in one pass, and the columns of the next one.

Messages of a run are many and short-lived; these loops stand between the beliefs and the wire.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from swarmbid.arrays import NO_AGENT
from swarmbid.kernels.consensus import NOT_LISTED, TO_SEND, take_flagged


@njit(cache=True)
def compose(full, winner, bid, flags, heard, told):
    """Return the columns of the next message, and mark its tasks as sent.

    Parameters
    ----------
    full : list every task with a winner; else those flagged to be sent.
    winner, bid, flags : beliefs (`swarmbid.algorithms._beliefs`); flags in and out.
    heard : int64[num_agents], stamps. told : int64[num_agents], stamps of the last message, in and out.

    Returns
    -------
    (tasks int32[n], winners int32[n], bids float64[n], stamps int64[num_agents]): stamps that are
    unchanged are NOT_LISTED, but for those of agents that a listed task is about: a receiver weighs
    a claim by them.
    """
    num_agents = heard.shape[0]
    tasks = take_flagged(flags, TO_SEND)
    if full:
        tasks = np.flatnonzero(winner != NO_AGENT).astype(np.int32)
    winners, bids = np.empty(tasks.shape[0], np.int32), np.empty(tasks.shape[0])
    stamps = np.empty(num_agents, np.int64)
    for m in range(num_agents):
        stamps[m] = heard[m] if full or heard[m] != told[m] else NOT_LISTED
        told[m] = heard[m]
    for i in range(tasks.shape[0]):
        w = winner[tasks[i]]
        winners[i] = w
        bids[i] = bid[tasks[i]]
        if w != NO_AGENT:
            stamps[w] = heard[w]
    return tasks, winners, bids, stamps


@njit(cache=True)
def spread(stamps):
    """Largest less smallest of the stamps that are listed, and how many are."""
    low, high, count = np.int64(0), np.int64(0), 0
    for i in range(stamps.shape[0]):
        s = stamps[i]
        if s != NOT_LISTED:
            low = s if count == 0 else min(low, s)
            high = s if count == 0 else max(high, s)
            count += 1
    return high - low, count


@njit(cache=True)
def count_columns(heard, tasks, winners, agreed, asked, left, agent_lengths, task_lengths):
    """What the size of a message follows from.

    Parameters
    ----------
    heard ... left : columns of a message. agent_lengths, task_lengths : bytes of each id.

    Returns
    -------
    (agents mentioned, bytes of their ids, bytes of the tasks' ids, winners).
    """
    mentioned = heard != NOT_LISTED
    won = 0
    names = 0
    for i in range(winners.shape[0]):
        names += task_lengths[tasks[i]]
        if winners[i] != NO_AGENT:
            mentioned[winners[i]] = True
            won += 1
    for i in range(agreed.shape[0]):
        mentioned[agreed[i]] = True
    for i in range(asked.shape[0]):
        mentioned[asked[i]] = True
    for i in range(left.shape[0]):
        mentioned[left[i]] = True
    count = 0
    agents = 0
    for m in range(mentioned.shape[0]):
        if mentioned[m]:
            count += 1
            agents += agent_lengths[m]
    return count, agents, names, won
