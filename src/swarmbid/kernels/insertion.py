"""What inserting a task would gain: every task at every position of one agent's path.

Timing is physics and stands here: travel, waiting for the window, service, range and the latest
return. What a visit is worth comes in as coefficients (`swarmbid.scores`), and is evaluated by
`visit_values`, `later_values` and `leg_changes` alone, so that a user's own function can take their
place.

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
from swarmbid.kernels.lanes import BLOCK, distance_between, distance_lanes, exp_lanes

HOLD = 0
SHIFT = 1
APPEND = 2

SCRATCH_ROWS = 10


@njit(cache=True, nogil=True, error_model="numpy")
def visit_values(candidates, count, time, leg, cost, power, bits, scale, out):
    """Score of visits side by side: lane j is column j of `candidates`, begun at time[j] after leg[j] m.

    `power`, `bits` and `scale` are scratch, as in `exp_lanes`. Writes out[:count].
    """
    reference, decay = candidates[REFERENCE], candidates[DECAY]
    peak, inverse_width, reward = candidates[PEAK], candidates[INVERSE_WIDTH], candidates[REWARD]
    for j in range(count):
        off = (time[j] - peak[j]) * inverse_width[j]
        power[j] = -(decay[j] * (time[j] - reference[j]) + off * off)
    exp_lanes(power, bits, scale, count)
    for j in range(count):
        out[j] = reward[j] * power[j] - cost * leg[j]


@njit(cache=True, nogil=True, error_model="numpy")
def later_values(tasks, task, count, time, leg, cost, power, bits, scale, out):
    """Score of one task's visit if it started at each of time[:count] after leg[j] m."""
    reference, decay = tasks[REFERENCE, task], tasks[DECAY, task]
    peak, inverse_width = tasks[PEAK, task], tasks[INVERSE_WIDTH, task]
    reward = tasks[REWARD, task]
    if decay > 0.0 or inverse_width > 0.0:
        for j in range(count):
            off = (time[j] - peak) * inverse_width
            power[j] = -(decay * (time[j] - reference) + off * off)
        exp_lanes(power, bits, scale, count)
        for j in range(count):
            out[j] = reward * power[j] - cost * leg[j]
    else:
        for j in range(count):
            out[j] = reward - cost * leg[j]


@njit(cache=True, nogil=True, error_model="numpy")
def leg_changes(tasks, task, start, old_leg, count, leg, cost, out):
    """What one task's visit gains if its leg becomes leg[:count] m and its start stays."""
    for j in range(count):
        out[j] = cost * (old_leg - leg[j])


@njit(cache=True, nogil=True, error_model="numpy")
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
    step = agent[DISTANCE_STEP]
    lane = np.empty((5, 1))
    scale = lane[4]
    bits = scale.view(np.int64)
    x, y, z = agent[AGENT_X], agent[AGENT_Y], agent[AGENT_Z]
    free = agent[AVAILABLE]
    total = 0.0
    for k in range(length):
        task = path[k]
        leg = distance_between(x, y, z, tasks[X, task], tasks[Y, task], tasks[Z, task], step)
        start = hold_times[k] if rule == HOLD else max(free + leg * agent[SLOWNESS], tasks[READY, task])
        lane[0, 0] = start
        lane[1, 0] = leg
        later_values(tasks, task, 1, lane[0], lane[1], agent[COST_PER_METRE], lane[2], bits, scale, lane[3])
        starts[k] = start
        legs[k] = leg
        values[k] = lane[3, 0]
        total += leg
        free = start + tasks[DURATION, task]
        x, y, z = tasks[X, task], tasks[Y, task], tasks[Z, task]
    return total


@njit(cache=True, nogil=True, error_model="numpy")
def evaluate(
    tasks, candidates, count, agent, path, length, starts, legs, values, total, rule,
    gain, position, start_time,
):  # fmt: skip
    """Best insertion of some tasks into a path; the earliest position wins ties.

    Parameters
    ----------
    tasks, agent, path, length : as in `path_state`, which made `starts`, `legs`, `values`, `total`.
    candidates : float64[NUM_TASK_ROWS, BLOCK], columns of `tasks` side by side; the first `count` count.
    rule : HOLD, SHIFT or APPEND.
    gain : float64[count], written; -inf where the task fits nowhere.
    position : int64[count], written. start_time : float64[count], written, s.
    """
    step = agent[DISTANCE_STEP]
    slowness = agent[SLOWNESS]
    cost = agent[COST_PER_METRE]
    scratch = np.empty((SCRATCH_ROWS, BLOCK))
    leg_in, leg_out, home = scratch[0], scratch[1], scratch[2]
    time, free, score, power = scratch[3], scratch[4], scratch[5], scratch[6]
    scale, value, same = scratch[7], scratch[8], scratch[9]
    bits = scale.view(np.int64)

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

    open_, ready, end = candidates[OPEN], candidates[READY], candidates[END]
    duration = candidates[DURATION]
    best, place, best_time = gain, position, start_time
    for j in range(count):
        best[j] = -np.inf
        place[j] = 0
        best_time[j] = 0.0
        home[j] = 0.0
    if agent[HAS_BASE] > 0.0:
        distance_lanes(agent[BASE_X], agent[BASE_Y], agent[BASE_Z], candidates, count, step, home)

    begin = length if rule == APPEND else 0
    for n in range(begin, length + 1):
        # Leave the previous visit, or the agent's own place.
        if n == 0:
            departure = agent[AVAILABLE]
            distance_lanes(agent[AGENT_X], agent[AGENT_Y], agent[AGENT_Z], candidates, count, step, leg_in)
        else:
            before = path[n - 1]
            departure = starts[n - 1] + tasks[DURATION, before]
            if n == begin:
                x, y, z = tasks[X, before], tasks[Y, before], tasks[Z, before]
                distance_lanes(x, y, z, candidates, count, step, leg_in)
            else:
                for j in range(count):
                    leg_in[j] = leg_out[j]
        if n < length:
            after = path[n]
            distance_lanes(
                tasks[X, after], tasks[Y, after], tasks[Z, after], candidates, count, step, leg_out
            )

        if rule == HOLD:
            promised = starts[n] if n < length else np.inf
            for j in range(count):
                earliest = max(departure + leg_in[j] * slowness, open_[j])
                latest = end[j]
                if n < length:
                    latest = min(latest, promised - duration[j] - leg_out[j] * slowness)
                time[j] = max(earliest, min(ready[j], latest))
                score[j] = 0.0 if earliest <= latest else -np.inf
        else:
            for j in range(count):
                chosen = max(departure + leg_in[j] * slowness, ready[j])
                time[j] = chosen
                score[j] = 0.0 if chosen <= end[j] else -np.inf
        visit_values(candidates, count, time, leg_in, cost, power, bits, scale, value)
        for j in range(count):
            score[j] = score[j] + value[j]
            free[j] = time[j] + duration[j]

        if n < length and rule == SHIFT:
            travel = leg_out
            for k in range(n, length):
                task = path[k]
                ready_k, end_k, duration_k = tasks[READY, task], tasks[END, task], tasks[DURATION, task]
                if k > n:
                    travel = same
                    for j in range(count):
                        same[j] = legs[k]
                lost = values[k]
                for j in range(count):
                    later = max(free[j] + travel[j] * slowness, ready_k)
                    free[j] = later
                    score[j] = (score[j] if later <= end_k else -np.inf) - lost
                later_values(tasks, task, count, free, travel, cost, power, bits, scale, value)
                for j in range(count):
                    score[j] = score[j] + value[j]
                    free[j] = free[j] + duration_k
        elif n < length:
            # Promised times hold, so the visit after keeps its start and only its leg changes.
            leg_changes(tasks, path[n], starts[n], legs[n], count, leg_out, cost, value)
            for j in range(count):
                score[j] = score[j] + value[j]
                free[j] = kept

        # Range and the latest return, the way back included.
        if n < length:
            for j in range(count):
                flown = total - legs[n] + leg_in[j] + leg_out[j] + back
                done = free[j] + back * slowness
                fits = flown <= agent[RANGE] and done <= agent[LATEST_RETURN]
                score[j] = score[j] if fits else -np.inf
        else:
            for j in range(count):
                flown = total + leg_in[j] + home[j]
                done = free[j] + home[j] * slowness
                fits = flown <= agent[RANGE] and done <= agent[LATEST_RETURN]
                score[j] = score[j] if fits else -np.inf

        for j in range(count):
            better = score[j] > best[j]
            best[j] = score[j] if better else best[j]
            place[j] = n if better else place[j]
            best_time[j] = time[j] if better else best_time[j]
