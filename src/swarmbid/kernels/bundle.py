"""Phase 1 of CBAA, CBBA and CBGA for one agent, compiled whole (Hunt 2014, Algorithm 1).

Eligibility comes in as vectors, so the rules of each algorithm stay in its own file: a task is taken
only with a bid that outbids ``(bid_to_beat, rank_to_beat)``; what the agent holds itself is open to it.
Two things keep a rebuild cheap without changing its result. The gains for a prefix of the bundle do not
depend on what others bid, so they are kept: the arithmetic is repeated only from the first choice that
differs, and at a prefix that stands only tasks whose bids changed are looked at. And no insertion gains
more than a visit flown to directly, so tasks whose bound reaches no further are never evaluated.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from swarmbid.arrays import (
    AGENT_X,
    AGENT_Y,
    AGENT_Z,
    AVAILABLE,
    DECAY,
    DISTANCE_STEP,
    DURATION,
    END,
    INVERSE_WIDTH,
    NO_AGENT,
    OPEN,
    PEAK,
    READY,
    REFERENCE,
    REWARD,
    SLOWNESS,
    X,
    Y,
    Z,
)
from swarmbid.kernels.insertion import HOLD, evaluate, first_position, path_state, visit_value
from swarmbid.kernels.lanes import BLOCK, distance_between

# Rows of the two bundle tables, int64[NUM_ORDER_ROWS, limit] and float64[NUM_MARK_ROWS, limit].
BUNDLE = 0  # task rows in order of taking (b_i)
PLACE = 1  # where each was inserted
PATH = 2  # task rows in order of visit (p_i)
NUM_ORDER_ROWS = 3
BID = 0  # what each was taken with, in order of taking
PROMISED = 1  # start of service promised when it was inserted, s, in order of taking
START = 2  # start of service, s, in order of visit (τ_i)
NUM_MARK_ROWS = 3

FIRST_BATCH = 32
"""Tasks evaluated before the bound is looked at again; doubled until a block is full."""


@njit(cache=True, error_model="numpy")
def outbids(bid, rank, other_bid, other_rank):
    """The one order of bids: the higher bid; among equal bids the higher agent id (its rank here)."""
    return bid > other_bid or (bid == other_bid and rank > other_rank)


@njit(cache=True, error_model="numpy")
def eligible(gain, ceiling, rank, bid_to_beat, rank_to_beat):
    """Whether a bid of min(gain, ceiling) wins the task, or the agent holds it anyway (h_ij)."""
    bid = min(gain, ceiling)
    if bid <= 0.0:
        return False
    return rank_to_beat == rank or outbids(bid, rank, bid_to_beat, rank_to_beat)


@njit(cache=True, error_model="numpy")
def before(gain, opens, task, best_gain, best_opens, best):
    """The one order of an agent's own candidates: larger gain, earlier window, smaller row."""
    if gain != best_gain:
        return gain > best_gain
    return opens < best_opens or (opens == best_opens and task < best)


@njit(cache=True, error_model="numpy")
def bounds(tasks, fixed, agent, out):
    """The most that each task can ever gain this agent, whatever is in its path.

    It is the value of a visit flown to directly, for no path leads there sooner (triangle inequality), to
    insert a visit never makes others worth more, and a leg never costs less than nothing. Distances that
    are rounded down obey no triangle inequality: then there is no bound.

    Parameters
    ----------
    out : float64[num_tasks], written.
    """
    num_tasks = tasks.shape[1]
    if agent[DISTANCE_STEP] > 0.0:
        out[:] = np.inf
        return
    for j in range(num_tasks):
        leg = distance_between(
            agent[AGENT_X], agent[AGENT_Y], agent[AGENT_Z], tasks[X, j], tasks[Y, j], tasks[Z, j], 0.0
        )
        direct = agent[AVAILABLE] + leg * agent[SLOWNESS]
        value = visit_value(
            max(direct, tasks[READY, j]), leg, 0.0, tasks[REWARD, j], tasks[DECAY, j], tasks[REFERENCE, j],
            tasks[PEAK, j], tasks[INVERSE_WIDTH, j], tasks[OPEN, j], tasks[END, j], tasks[DURATION, j],
        )  # fmt: skip
        # Rounding may lift a gain over the exact bound by a few units in the last place.
        bound = value * (1.0 + 1e-9)
        if fixed.shape[0] > 0:
            bound -= fixed[j]
        out[j] = bound if max(direct, tasks[OPEN, j]) <= tasks[END, j] * (1.0 + 1e-12) else -np.inf


@njit(cache=True, error_model="numpy")
def weigh(
    tasks, fixed, agent, path, length, starts, legs, values, total, rule, rank, ceiling,
    bid_to_beat, rank_to_beat, ranking, gain, extent, batch, count, columns, gains, position, start_time,
    best, best_gain, best_opens,
):  # fmt: skip
    """Evaluate the batch, keep its gains, and return the best of it and of what was best before."""
    for i in range(count):
        columns[i] = ranking[batch[i]]
    evaluate(
        tasks, columns, count, agent, path, length, starts, legs, values, total, rule,
        first_position(rule, length), length, gains, position, start_time,
    )  # fmt: skip
    for i in range(count):
        place = batch[i]
        task = ranking[place]
        g = gains[i]
        if fixed.shape[0] > 0:
            g -= fixed[task]
        if place < extent:
            gain[place] = g
        if before(g, tasks[OPEN, task], task, best_gain, best_opens, best) and eligible(
            g, ceiling, rank, bid_to_beat[task], rank_to_beat[task]
        ):
            best, best_gain, best_opens = task, g, tasks[OPEN, task]
    return best, best_gain, best_opens


@njit(cache=True, error_model="numpy")
def worth_weighing(changed, rank, bid_to_beat, rank_to_beat, bound, place_of, order, length):
    """Which tasks with changed bids could enter the bundle, and whether it has to be built at all.

    A task whose bound does not win it cannot; while no task of the bundle is lost and none could enter,
    a new bundle would be the old one.

    Parameters
    ----------
    changed : int32[n], rows of tasks whose bid to beat changed.

    Returns
    -------
    (tasks int64[m], whether to build).
    """
    found = np.empty(changed.shape[0], np.int64)
    count = 0
    for i in range(changed.shape[0]):
        j = changed[i]
        if eligible(bound[place_of[j]], np.inf, rank, bid_to_beat[j], rank_to_beat[j]):
            found[count] = j
            count += 1
    build = count > 0
    for k in range(length):
        build |= rank_to_beat[order[BUNDLE, k]] != rank
    return found[:count], build


@njit(cache=True, error_model="numpy")
def build_bundle(
    tasks, fixed, agent, rank, rule, warped, bid_to_beat, rank_to_beat,
    kept, known, length, changed, bound, ranking, place_of, gain, extent, order, marks,
):  # fmt: skip
    """Take tasks greedily until none outbids its current bid.

    At each step the task taken is the first in the order of `before` among those that are eligible.
    Tasks are looked at from the largest bound down, and only while the bound reaches the best gain
    found; of the others not even the insertion is evaluated.

    Parameters
    ----------
    tasks, agent : see `swarmbid.arrays`.
    fixed : float64[num_tasks] or float64[0]: score units lost with a task, whenever it is done.
    rank : this agent's place in the order of ids.
    rule : HOLD, SHIFT or APPEND. warped : whether bids never rise along the bundle (Johnson et al.
        2012): the bid is then the gain, or the previous bid if that is less; the ranking uses the gain.
    bid_to_beat : float64[num_tasks]; rank_to_beat : int32[num_tasks], NO_AGENT for nobody.
    kept : tasks of the old bundle that stay without question (0 to build afresh).
    known : rows of `gain` that are valid for the old bundle.
    length : tasks in the old bundle.
    changed : int64[n]: tasks whose bid to beat changed since the old bundle was built.
    bound : float64[num_tasks], what `bounds` says, from the largest down.
    ranking : int64[num_tasks], the tasks in that order; place_of : int64[num_tasks], its inverse.
    gain : float64[rows, num_tasks]: row k holds gains after the first k tasks, in the order of
        `ranking`, of its first extent[k] tasks; NaN where there was no need to know. Longer prefixes than
        there are rows share the last row, which is then never known.
    order, marks : the bundle, in and out; their width is the most tasks to take (L_t).

    Returns
    -------
    (length, known): tasks taken, and valid rows afterwards.
    """
    num_tasks = tasks.shape[1]
    limit = order.shape[1]
    last_row = gain.shape[0] - 1
    taken = np.zeros(num_tasks, np.bool_)
    scratch = np.empty((3, limit + 1))
    starts, legs, values = scratch[0], scratch[1], scratch[2]
    gains, start_time = np.empty(BLOCK), np.empty(BLOCK)
    batch, columns = np.empty(BLOCK, np.int64), np.empty(BLOCK, np.int64)
    position = np.empty(BLOCK, np.int64)
    path, start = order[PATH], marks[START]
    old_length = length
    length = 0
    ceiling = np.inf
    same = True
    while length < limit:
        row = min(length, last_row)
        ready = same and length < known
        total = -1.0
        old = order[BUNDLE, length] if length < old_length else NO_AGENT
        if length < kept:
            task = old
            bid = marks[BID, length]
            if not ready:
                extent[row] = 0
                known = min(length + 1, last_row)
        else:
            total = path_state(tasks, agent, path, length, start, rule, starts, legs, values)
            best, best_gain, best_opens = NO_AGENT, 0.0, -np.inf
            afresh = True
            if ready:
                # The old choice stands unless it was lost or a task whose bid changed comes before it.
                afresh = False
                if old != NO_AGENT:
                    g = gain[row, place_of[old]]
                    afresh = not eligible(g, ceiling, rank, bid_to_beat[old], rank_to_beat[old])
                    if not afresh:
                        best, best_gain, best_opens = old, g, tasks[OPEN, old]
            else:
                extent[row] = 0
                known = min(length + 1, last_row)
            count = 0
            width = FIRST_BATCH if afresh else BLOCK
            i = 0
            while True:
                if i < (num_tasks if afresh else changed.shape[0]):
                    place = i if afresh else place_of[changed[i]]
                    j = ranking[place]
                    i += 1
                    enough = bound[place] < best_gain or bound[place] <= 0.0
                    if not enough:
                        if afresh and place >= extent[row]:
                            gain[row, place] = np.nan
                            extent[row] = place + 1
                        if not taken[j] and eligible(
                            bound[place], ceiling, rank, bid_to_beat[j], rank_to_beat[j]
                        ):
                            g = gain[row, place] if place < extent[row] else np.nan
                            if np.isnan(g):
                                batch[count] = place
                                count += 1
                            elif before(g, tasks[OPEN, j], j, best_gain, best_opens, best) and eligible(
                                g, ceiling, rank, bid_to_beat[j], rank_to_beat[j]
                            ):
                                best, best_gain, best_opens = j, g, tasks[OPEN, j]
                    over = enough and afresh
                else:
                    over = True
                if count == width or (over and count > 0):
                    best, best_gain, best_opens = weigh(
                        tasks, fixed, agent, path, length, starts, legs, values, total, rule, rank, ceiling,
                        bid_to_beat, rank_to_beat, ranking, gain[row], extent[row], batch, count,
                        columns, gains, position, start_time, best, best_gain, best_opens,
                    )  # fmt: skip
                    count = 0
                    width = min(2 * width, BLOCK)
                if over:
                    break
            if best == NO_AGENT:
                break
            task = best
            bid = min(best_gain, ceiling)
        if same and task == old:
            place = order[PLACE, length]
            promised = marks[PROMISED, length]
        else:
            columns[0] = task
            evaluate(
                tasks, columns, 1, agent, path, length, starts, legs, values, total, rule,
                first_position(rule, length), length, gains, position, start_time,
            )  # fmt: skip
            place, promised = position[0], start_time[0]
            if same:
                same = False
                known = min(known, min(length + 1, last_row))
        for k in range(length, place, -1):
            path[k] = path[k - 1]
            start[k] = start[k - 1]
        path[place] = task
        start[place] = promised
        order[BUNDLE, length] = task
        order[PLACE, length] = place
        marks[BID, length] = bid
        marks[PROMISED, length] = promised
        taken[task] = True
        if warped:
            ceiling = min(ceiling, bid)
        length += 1
    if rule != HOLD:
        path_state(tasks, agent, path, length, start, rule, starts, legs, values)
        for k in range(length):
            start[k] = starts[k]
    for k in range(length, limit):
        order[BUNDLE, k] = NO_AGENT
    return length, known
