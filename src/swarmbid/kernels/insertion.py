"""What inserting a task would gain: every task at every position of one agent's path.

Timing is physics and stands here: travel, waiting for the window, service, range and the latest
return. What a visit is worth comes in as coefficients (`swarmbid.scores`), and is evaluated by
`visit_value` alone, so that a user's own function can stand in its place.

Three rules: HOLD keeps promised times, SHIFT lets later visits slip, APPEND adds at the end only.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from swarmbid.arrays import (
    AGENT_X,
    AGENT_Y,
    AGENT_Z,
    AVAILABLE,
    BASE_X,
    BASE_Y,
    BASE_Z,
    COST_PER_METRE,
    DECAY,
    DISTANCE_STEP,
    DURATION,
    END,
    HAS_BASE,
    INVERSE_WIDTH,
    LATEST_RETURN,
    NUM_TASK_ROWS,
    OPEN,
    PEAK,
    RANGE,
    READY,
    REFERENCE,
    REWARD,
    SLOWNESS,
    X,
    Y,
    Z,
)
from swarmbid.kernels.lanes import (
    BLOCK,
    copy_lanes,
    copy_whole,
    distance_between,
    distance_lanes,
    exp_lane,
    whole_vectors,
)

HOLD = 0
SHIFT = 1
APPEND = 2

SCRATCH_ROWS = NUM_TASK_ROWS + 9


@njit(cache=True, error_model="numpy")
def visit_value(
    start, leg, cost, reward, decay, reference, peak, inverse_width, window_start, window_end, duration
):
    """Score of one visit that starts at `start` s after a leg of `leg` m.

    reward * exp(-(decay * (start - reference) + ((start - peak) * inverse_width)^2)) - cost * leg
    """
    off = (start - peak) * inverse_width
    return reward * exp_lane(decay * (reference - start) - off * off) - cost * leg


@njit(cache=True, error_model="numpy")
def timeless(decay, inverse_width):
    """Whether the value of a visit does not depend on when it starts."""
    return decay == 0.0 and inverse_width == 0.0


@njit(cache=True, error_model="numpy")
def path_state(tasks, agent, path, length, hold_times, rule, starts, legs, values):
    """Times, legs and values along a path; what `evaluate` builds on.

    Parameters
    ----------
    tasks, agent : see `swarmbid.arrays`.
    path : int64[>= length], task columns in order of visit (p_i).
    hold_times : float64[>= length], promised starts in s; read under HOLD only.
    starts, legs, values : float64[>= length], written: start of service s, leg m, score.

    Returns
    -------
    Metres flown without the way back.
    """
    step, cost = agent[DISTANCE_STEP], agent[COST_PER_METRE]
    x, y, z = agent[AGENT_X], agent[AGENT_Y], agent[AGENT_Z]
    free = agent[AVAILABLE]
    total = 0.0
    for k in range(length):
        task = path[k]
        leg = distance_between(x, y, z, tasks[X, task], tasks[Y, task], tasks[Z, task], step)
        start = hold_times[k] if rule == HOLD else max(free + leg * agent[SLOWNESS], tasks[READY, task])
        starts[k] = start
        legs[k] = leg
        values[k] = visit_value(
            start, leg, cost, tasks[REWARD, task], tasks[DECAY, task], tasks[REFERENCE, task],
            tasks[PEAK, task], tasks[INVERSE_WIDTH, task], tasks[OPEN, task], tasks[END, task],
            tasks[DURATION, task],
        )  # fmt: skip
        total += leg
        free = start + tasks[DURATION, task]
        x, y, z = tasks[X, task], tasks[Y, task], tasks[Z, task]
    return total


@njit(cache=True, error_model="numpy")
def first_position(rule, length):
    """The first position that a rule lets a task be inserted at; the last is always `length`."""
    return length if rule == APPEND else 0


@njit(cache=True, error_model="numpy")
def evaluate(
    tasks, columns, count, agent, path, length, starts, legs, values, total, rule, begin, end_at,
    gain, position, start_time,
):  # fmt: skip
    """Best insertion of some tasks into a path; the earliest position wins ties.

    Parameters
    ----------
    tasks, agent, path, length : as in `path_state`, which made `starts`, `legs`, `values`, `total`.
    columns : int64[>= count], the tasks to insert, at most BLOCK of them.
    rule : HOLD or SHIFT; APPEND is SHIFT at the end only.
    begin, end_at : first and last position tried; see `first_position`.
    gain : float64[>= count], written; -inf where the task fits nowhere.
    position : int64[>= count], written. start_time : float64[>= count], written, s.
    """
    step = agent[DISTANCE_STEP]
    slowness = agent[SLOWNESS]
    cost = agent[COST_PER_METRE]
    farthest = agent[RANGE]
    latest_return = agent[LATEST_RETURN]
    # One allocation, rows at fixed offsets: LLVM sees that no two rows overlap and needs no checks.
    rows = np.empty((SCRATCH_ROWS, BLOCK))
    xs, ys, zs, end, ready, open_ = rows[X], rows[Y], rows[Z], rows[END], rows[READY], rows[OPEN]
    duration, reward, reference, decay = rows[DURATION], rows[REWARD], rows[REFERENCE], rows[DECAY]
    peak, inverse_width = rows[PEAK], rows[INVERSE_WIDTH]
    leg_in, leg_out, home = rows[NUM_TASK_ROWS], rows[NUM_TASK_ROWS + 1], rows[NUM_TASK_ROWS + 2]
    time, free, score = rows[NUM_TASK_ROWS + 3], rows[NUM_TASK_ROWS + 4], rows[NUM_TASK_ROWS + 5]
    best, place, best_time = rows[NUM_TASK_ROWS + 6], rows[NUM_TASK_ROWS + 7], rows[NUM_TASK_ROWS + 8]

    back = 0.0
    kept = 0.0
    if length > 0:
        final = path[length - 1]
        kept = starts[length - 1] + tasks[DURATION, final]
        if agent[HAS_BASE] > 0.0:
            back = distance_between(
                tasks[X, final], tasks[Y, final], tasks[Z, final],
                agent[BASE_X], agent[BASE_Y], agent[BASE_Z], step,
            )  # fmt: skip

    lanes = whole_vectors(count)
    for j in range(lanes):
        task = columns[min(j, count - 1)]  # the lanes left over repeat the last one
        for row in range(NUM_TASK_ROWS):
            rows[row, j] = tasks[row, task]
    for j in range(lanes):
        best[j] = -np.inf
        place[j] = 0.0
        best_time[j] = 0.0
        home[j] = 0.0
    if agent[HAS_BASE] > 0.0:
        distance_lanes(agent[BASE_X], agent[BASE_Y], agent[BASE_Z], xs, ys, zs, lanes, step, home)
    x, y, z = agent[AGENT_X], agent[AGENT_Y], agent[AGENT_Z]
    if begin > 0:
        before = path[begin - 1]
        x, y, z = tasks[X, before], tasks[Y, before], tasks[Z, before]
    distance_lanes(x, y, z, xs, ys, zs, lanes, step, leg_out)

    for n in range(begin, end_at + 1):
        # Leave the previous visit, or the agent's own place.
        departure = agent[AVAILABLE]
        if n > 0:
            departure = starts[n - 1] + tasks[DURATION, path[n - 1]]
        for j in range(lanes):
            leg_in[j] = leg_out[j]
        if n < length:
            after = path[n]
            distance_lanes(
                tasks[X, after], tasks[Y, after], tasks[Z, after], xs, ys, zs, lanes, step, leg_out
            )

        if rule == HOLD and n < length:
            # Promised times hold: the visit after keeps its start, and only its leg changes.
            promised, lost = starts[n], values[n]
            open_n, end_n, duration_n = tasks[OPEN, after], tasks[END, after], tasks[DURATION, after]
            reward_n, reference_n, decay_n = (
                tasks[REWARD, after],
                tasks[REFERENCE, after],
                tasks[DECAY, after],
            )
            peak_n, inverse_width_n = tasks[PEAK, after], tasks[INVERSE_WIDTH, after]
            for j in range(lanes):
                earliest = max(departure + leg_in[j] * slowness, open_[j])
                latest = min(end[j], promised - duration[j] - leg_out[j] * slowness)
                start = max(earliest, min(ready[j], latest))
                value = visit_value(
                    start, leg_in[j], cost, reward[j], decay[j], reference[j], peak[j], inverse_width[j],
                    open_[j], end[j], duration[j],
                )  # fmt: skip
                value_n = visit_value(
                    promised, leg_out[j], cost, reward_n, decay_n, reference_n, peak_n, inverse_width_n,
                    open_n, end_n, duration_n,
                )  # fmt: skip
                time[j] = start
                free[j] = kept
                score[j] = (value if earliest <= latest else -np.inf) + (value_n - lost)
        else:
            for j in range(lanes):
                start = max(departure + leg_in[j] * slowness, ready[j])
                value = visit_value(
                    start, leg_in[j], cost, reward[j], decay[j], reference[j], peak[j], inverse_width[j],
                    open_[j], end[j], duration[j],
                )  # fmt: skip
                time[j] = start
                free[j] = start + duration[j]
                score[j] = value if start <= end[j] else -np.inf

        for k in range(n, length if rule == SHIFT else n):
            task = path[k]
            lost, leg_k, travel_k = values[k], legs[k], legs[k] * slowness
            ready_k, open_k, end_k = tasks[READY, task], tasks[OPEN, task], tasks[END, task]
            duration_k, reward_k = tasks[DURATION, task], tasks[REWARD, task]
            reference_k, decay_k = tasks[REFERENCE, task], tasks[DECAY, task]
            peak_k, inverse_width_k = tasks[PEAK, task], tasks[INVERSE_WIDTH, task]
            if k == n:
                for j in range(lanes):
                    start = max(free[j] + leg_out[j] * slowness, ready_k)
                    value = visit_value(
                        start, leg_out[j], cost, reward_k, decay_k, reference_k, peak_k, inverse_width_k,
                        open_k, end_k, duration_k,
                    )  # fmt: skip
                    before_k = score[j]
                    score[j] = (before_k if start <= end_k else -np.inf) + (value - lost)
                    free[j] = start + duration_k
            elif timeless(decay_k, inverse_width_k):
                for j in range(lanes):
                    start = max(free[j] + travel_k, ready_k)
                    before_k = score[j]
                    score[j] = before_k if start <= end_k else -np.inf
                    free[j] = start + duration_k
            else:
                for j in range(lanes):
                    start = max(free[j] + travel_k, ready_k)
                    value = visit_value(
                        start, leg_k, cost, reward_k, decay_k, reference_k, peak_k, inverse_width_k,
                        open_k, end_k, duration_k,
                    )  # fmt: skip
                    before_k = score[j]
                    score[j] = (before_k if start <= end_k else -np.inf) + (value - lost)
                    free[j] = start + duration_k

        # Range and the latest return, the way back included.
        here = float(n)
        if n < length:
            flown = total - legs[n] + back
            way_back = back * slowness
            for j in range(lanes):
                new, new_time, free_j = score[j], time[j], free[j]
                old, old_place, old_time = best[j], place[j], best_time[j]
                far, late = flown + leg_in[j] + leg_out[j], free_j + way_back
                better = (new > old) & (far <= farthest) & (late <= latest_return)
                best[j] = new if better else old
                place[j] = here if better else old_place
                best_time[j] = new_time if better else old_time
        else:
            for j in range(lanes):
                new, new_time, free_j, home_j = score[j], time[j], free[j], home[j]
                old, old_place, old_time = best[j], place[j], best_time[j]
                far, late = total + leg_in[j] + home_j, free_j + home_j * slowness
                better = (new > old) & (far <= farthest) & (late <= latest_return)
                best[j] = new if better else old
                place[j] = here if better else old_place
                best_time[j] = new_time if better else old_time

    copy_lanes(best, gain, count)
    copy_lanes(best_time, start_time, count)
    copy_whole(place, position, count)
