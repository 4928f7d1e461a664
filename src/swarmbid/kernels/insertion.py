"""What inserting a task would gain: every task at every position of one agent's path.

Timing is physics and stands here: travel, waiting for the window, service, range and the latest
return. What a visit is worth comes in as coefficients (`swarmbid.scores`):

    value = reward * exp(-(decay * (t - reference) + ((t - peak) / width)^2)) - cost * leg - fixed

Two rules (see `swarmbid.algorithms.cbba`): HOLD keeps promised times, SHIFT lets later visits slip.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from swarmbid.kernels.lanes import (
    AGENT_X,
    AGENT_Y,
    AGENT_Z,
    AVAILABLE,
    BASE_X,
    BASE_Y,
    BASE_Z,
    BLOCK,
    COST_PER_METRE,
    DECAY,
    DISTANCE_STEP,
    DURATION,
    END,
    FIXED,
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
    distance_between,
    distance_lanes,
    exp_lanes,
)

HOLD = 0
SHIFT = 1

SCRATCH_ROWS = 8


@njit(cache=True, error_model="numpy")
def visit_value(tasks, task, start, leg, cost_per_metre, lane, bits, scale):
    """Score of one visit that starts at `start` s after a leg of `leg` m."""
    late = start - tasks[REFERENCE, task]
    off = (start - tasks[PEAK, task]) * tasks[INVERSE_WIDTH, task]
    lane[0] = -(tasks[DECAY, task] * late + off * off)
    exp_lanes(lane, bits, scale, 1)
    return tasks[REWARD, task] * lane[0] - cost_per_metre * leg - tasks[FIXED, task]


@njit(cache=True, error_model="numpy")
def path_state(tasks, agent, path, length, hold_times, rule, starts, legs, values):
    """Times, legs and values along a path; what `evaluate` builds on.

    Parameters
    ----------
    tasks, agent : see `swarmbid.kernels.lanes`.
    path : int64[>= length], task columns in order of visit (p_i).
    hold_times : float64[>= length], promised starts in s; read under HOLD only.
    starts, legs, values : float64[>= length], written: start of service s, leg m, score.

    Returns
    -------
    Metres flown without the way back.
    """
    lane = np.empty(1)
    bits = np.empty(1, np.int64)
    scale = bits.view(np.float64)
    x, y, z = agent[AGENT_X], agent[AGENT_Y], agent[AGENT_Z]
    free = agent[AVAILABLE]
    total = 0.0
    for k in range(length):
        task = path[k]
        leg = distance_between(x, y, z, tasks[X, task], tasks[Y, task], tasks[Z, task], agent[DISTANCE_STEP])
        if rule == HOLD:
            start = hold_times[k]
        else:
            start = max(free + leg * agent[SLOWNESS], tasks[READY, task])
        starts[k] = start
        legs[k] = leg
        values[k] = visit_value(tasks, task, start, leg, agent[COST_PER_METRE], lane, bits, scale)
        total += leg
        free = start + tasks[DURATION, task]
        x, y, z = tasks[X, task], tasks[Y, task], tasks[Z, task]
    return total


@njit(cache=True, error_model="numpy")
def evaluate(tasks, agent, path, length, starts, legs, values, total, rule, gain, position, start_time):
    """Best insertion of every task into a path; the earliest position wins ties.

    Parameters
    ----------
    tasks, agent, path, length : as in `path_state`, which made `starts`, `legs`, `values`, `total`.
    rule : HOLD or SHIFT.
    gain : float64[num_tasks], written; -inf where the task fits nowhere.
    position : int64[num_tasks], written.
    start_time : float64[num_tasks], written, s.
    """
    num_tasks = tasks.shape[1]
    step = agent[DISTANCE_STEP]
    slowness = agent[SLOWNESS]
    cost = agent[COST_PER_METRE]
    scratch = np.empty((SCRATCH_ROWS, BLOCK))
    leg_in, leg_out, home = scratch[0], scratch[1], scratch[2]
    time, free, score, power = scratch[3], scratch[4], scratch[5], scratch[6]
    scale = scratch[7]
    bits = scale.view(np.int64)

    for first in range(0, num_tasks, BLOCK):
        count = min(BLOCK, num_tasks - first)
        last = first + count
        open_, ready, end = tasks[OPEN, first:last], tasks[READY, first:last], tasks[END, first:last]
        duration, reward = tasks[DURATION, first:last], tasks[REWARD, first:last]
        reference, decay = tasks[REFERENCE, first:last], tasks[DECAY, first:last]
        peak, inverse_width = tasks[PEAK, first:last], tasks[INVERSE_WIDTH, first:last]
        fixed = tasks[FIXED, first:last]
        best, place, best_time = gain[first:last], position[first:last], start_time[first:last]
        for j in range(count):
            best[j] = -np.inf
            place[j] = 0
            best_time[j] = 0.0
            home[j] = 0.0
        if agent[HAS_BASE] > 0.0:
            distance_lanes(agent[BASE_X], agent[BASE_Y], agent[BASE_Z], tasks, first, count, step, home)

        for n in range(length + 1):
            # Leave the previous visit, or the agent's own place.
            if n == 0:
                departure = agent[AVAILABLE]
                distance_lanes(
                    agent[AGENT_X], agent[AGENT_Y], agent[AGENT_Z], tasks, first, count, step, leg_in
                )
            else:
                before = path[n - 1]
                departure = starts[n - 1] + tasks[DURATION, before]
                for j in range(count):
                    leg_in[j] = leg_out[j]
            after = path[n] if n < length else 0
            if n < length:
                distance_lanes(
                    tasks[X, after], tasks[Y, after], tasks[Z, after], tasks, first, count, step, leg_out
                )

            if rule == HOLD:
                promised = starts[n] if n < length else np.inf
                for j in range(count):
                    earliest = max(departure + leg_in[j] * slowness, open_[j])
                    latest = end[j]
                    if n < length:
                        latest = min(latest, promised - duration[j] - leg_out[j] * slowness)
                    chosen = max(earliest, min(ready[j], latest))
                    time[j] = chosen
                    score[j] = 0.0 if earliest <= latest else -np.inf
            else:
                for j in range(count):
                    chosen = max(departure + leg_in[j] * slowness, ready[j])
                    time[j] = chosen
                    score[j] = 0.0 if chosen <= end[j] else -np.inf
            for j in range(count):
                off = (time[j] - peak[j]) * inverse_width[j]
                power[j] = -(decay[j] * (time[j] - reference[j]) + off * off)
            exp_lanes(power, bits, scale, count)
            for j in range(count):
                score[j] = score[j] + (reward[j] * power[j] - cost * leg_in[j] - fixed[j])
                free[j] = time[j] + duration[j]

            if n < length and rule == SHIFT:
                for k in range(n, length):
                    task = path[k]
                    ready_k, end_k, duration_k = tasks[READY, task], tasks[END, task], tasks[DURATION, task]
                    lost = values[k] + tasks[FIXED, task]
                    reward_k, decay_k, reference_k = (
                        tasks[REWARD, task],
                        tasks[DECAY, task],
                        tasks[REFERENCE, task],
                    )
                    peak_k, inverse_width_k = tasks[PEAK, task], tasks[INVERSE_WIDTH, task]
                    travel_k = legs[k] * slowness
                    paid = cost * legs[k]
                    for j in range(count):
                        arrival = free[j] + (leg_out[j] * slowness if k == n else travel_k)
                        later = max(arrival, ready_k)
                        free[j] = later + duration_k
                        paid_j = cost * leg_out[j] if k == n else paid
                        score[j] = (score[j] if later <= end_k else -np.inf) - paid_j - lost
                        off = (later - peak_k) * inverse_width_k
                        power[j] = -(decay_k * (later - reference_k) + off * off)
                    if decay_k > 0.0 or inverse_width_k > 0.0:
                        exp_lanes(power, bits, scale, count)
                        for j in range(count):
                            score[j] = score[j] + reward_k * power[j]
                    else:
                        for j in range(count):
                            score[j] = score[j] + reward_k
            elif n < length:
                # Promised times hold, so the visit after keeps its value but for its leg.
                for j in range(count):
                    score[j] = score[j] - cost * (leg_out[j] - legs[n])

            # Range and the latest return, the way back included.
            if n < length:
                final = path[length - 1]
                back = 0.0
                if agent[HAS_BASE] > 0.0:
                    back = distance_between(
                        tasks[X, final], tasks[Y, final], tasks[Z, final],
                        agent[BASE_X], agent[BASE_Y], agent[BASE_Z], step,
                    )  # fmt: skip
                kept = starts[length - 1] + tasks[DURATION, final]
                for j in range(count):
                    flown = total - legs[n] + leg_in[j] + leg_out[j] + back
                    done = (kept if rule == HOLD else free[j]) + back * slowness
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
