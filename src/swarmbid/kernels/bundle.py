"""Phase 1 of CBAA, CBBA and CBGA for one agent, compiled whole (Hunt 2014, Algorithm 1).

Eligibility comes in as vectors, so the rules of each algorithm stay in its own file: a task is taken
only with a bid that outbids ``(bid_to_beat, rank_to_beat)``. The gains for a prefix of the bundle do
not depend on what others bid, so they are kept: a rebuild repeats the arithmetic only from the first
choice that differs.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from swarmbid.kernels.insertion import HOLD, evaluate, path_state


@njit(cache=True, error_model="numpy")
def outbids(bid, rank, other_bid, other_rank):
    """The one order of bids: the higher bid; among equal bids the higher agent id (its rank here)."""
    return bid > other_bid or (bid == other_bid and rank > other_rank)


@njit(cache=True, error_model="numpy")
def choose(gain, taken, bid_to_beat, rank_to_beat, rank, ceiling):
    """Return the task to take next, or -1: largest gain, then the smallest row.

    `ceiling` is the bid that the bundle's last task was taken with when bids are warped (Johnson et
    al. 2012), infinite otherwise: the bid is min(gain, ceiling), the ranking uses the gain.
    """
    best = -1
    best_gain = 0.0
    for j in range(gain.shape[0]):
        g = gain[j]
        eligible = outbids(min(g, ceiling), rank, bid_to_beat[j], rank_to_beat[j])
        if eligible and g > best_gain and not taken[j]:
            best = j
            best_gain = g
    return best


@njit(cache=True, error_model="numpy")
def build_bundle(
    tasks, agent, rank, rule, warped, limit, bid_to_beat, rank_to_beat,
    kept, known, bundle, bids, places, gain, position, start_time, path, times,
):  # fmt: skip
    """Take tasks greedily until none outbids its current bid.

    Parameters
    ----------
    tasks, agent : see `swarmbid.kernels.lanes`.
    rank : this agent's place in the order of ids.
    rule : HOLD or SHIFT. warped : whether bids never rise along the bundle.
    limit : most tasks to take (L_t).
    bid_to_beat, rank_to_beat : float64[num_tasks], int64[num_tasks].
    kept : tasks of `bundle` that stay without question (0 to build afresh).
    known : rows of `gain`, `position`, `start_time` that are valid for the old bundle.
    bundle : int64[limit], in and out, in order of taking (b_i).
    bids : float64[limit], in and out. places : int64[limit], in and out, where each was inserted.
    gain, start_time : float64[limit, num_tasks], position : int16[limit, num_tasks]: row k is
        what `evaluate` says after the first k tasks of the bundle.
    path : int64[limit], written (p_i). times : float64[limit], written, s (τ_i).

    Returns
    -------
    (length, known): tasks taken, and valid rows afterwards.
    """
    num_tasks = tasks.shape[1]
    taken = np.zeros(num_tasks, np.bool_)
    starts = np.empty(limit)
    legs = np.empty(limit)
    values = np.empty(limit)
    row_position = np.empty(num_tasks, np.int64)
    length = 0
    ceiling = np.inf
    same = True
    while length < limit:
        if not (same and length < known):
            total = path_state(tasks, agent, path, length, times, rule, starts, legs, values)
            evaluate(
                tasks, agent, path, length, starts, legs, values, total, rule,
                gain[length], row_position, start_time[length],
            )  # fmt: skip
            for j in range(num_tasks):
                position[length, j] = row_position[j]
            same = False
            known = length + 1
        if length < kept:
            task = bundle[length]
            bid = bids[length]
        else:
            task = choose(gain[length], taken, bid_to_beat, rank_to_beat, rank, ceiling)
            if task < 0:
                break
            bid = min(gain[length, task], ceiling)
            if bundle[length] != task:
                same = False
                known = length + 1
        place = position[length, task]
        for k in range(length, place, -1):
            path[k] = path[k - 1]
            times[k] = times[k - 1]
        path[place] = task
        times[place] = start_time[length, task]
        bundle[length] = task
        bids[length] = bid
        places[length] = place
        taken[task] = True
        if warped:
            ceiling = bid
        length += 1
    if rule != HOLD:
        path_state(tasks, agent, path, length, times, rule, starts, legs, values)
        for k in range(length):
            times[k] = starts[k]
    for k in range(length, limit):
        bundle[k] = -1
    return length, known
