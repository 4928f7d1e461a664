"""Who is seated where, and when everything starts: the joint schedule of groups of agents.

Seats that are taken are linked along their agents' paths; what waits for what is the next visit of each
path, and the tasks that come after another. `swarmbid.kernels.referee` decides who is seated.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from swarmbid.arrays import (
    AGENT_X,
    AGENT_Y,
    AGENT_Z,
    BASE_X,
    BASE_Y,
    BASE_Z,
    DURATION,
    HAS_BASE,
    NO_AGENT,
    READY,
    FloatArray,
    RowArray,
    X,
    Y,
    Z,
)
from swarmbid.kernels.lanes import distance_between

# Functions that are called for every task take the arrays that they need, not the whole tuples: taking an
# array out of a tuple counts a reference, which costs more than their arithmetic.

NO_SEAT = -1
HELD = -2
"""In `Joint.before`: a task that is under way or done, and so on nobody's path."""

HIGHEST_BID = np.finfo(np.float64).max
"""What the founder of a group that is under way is said to have bid."""

NEVER = 255
"""In `Terms.cover`: no sets of the fleet cover this."""


class Terms(NamedTuple):
    """What the referee knows of a mission; the same at every agent.

    Parameters
    ----------
    tasks : float64[NUM_TASK_ROWS, num_tasks], with the score's READY. agents : float64[num_agents, slots].
    limits : int64[num_agents], most tasks (L_t).
    seats : int64[num_tasks], agents required (L_j), 0 for as many as the equipment takes.
    slot_at : int64[num_tasks + 1], where the seats of each task begin. slot_task : int64[num_slots].
    stage : int64[num_tasks], longest chain of prerequisites before each.
    kind : int64[num_tasks], which need each has: an equipment set wanted of agents of some types.
    full : int64[num_kinds], the need as bits. brings : int64[num_kinds, num_agents], what each agent has
        of it.
    cover : uint8[...], from cover_at[kind] on, for each part of the need as bits, the least number of sets
        in the fleet that cover it. spare : int64[...], likewise, all that is carried by agents that carry
        nothing of it.
    allowed : bool[num_agents, num_tasks], False also for what is barred.
    need_at, needs : prerequisites of each task; later_at, later : the tasks that come after each.
    """

    tasks: FloatArray
    agents: FloatArray
    limits: RowArray
    seats: RowArray
    slot_at: RowArray
    slot_task: RowArray
    stage: RowArray
    kind: RowArray
    full: RowArray
    brings: RowArray
    cover: NDArray[np.uint8]
    spare: RowArray
    cover_at: RowArray
    allowed: NDArray[np.bool_]
    need_at: RowArray
    needs: RowArray
    later_at: RowArray
    later: RowArray


class Joint(NamedTuple):
    """What has been accepted so far, and when everything starts.

    Parameters
    ----------
    start : float64[num_tasks], s; read where somebody is seated.
    filled : int64[num_tasks], seats taken. missing : int64[num_tasks], equipment nobody brings yet.
    lead : int64[num_tasks], the first who took a seat; lead_bid : float64[num_tasks], with which bid.
    holder, before, after : int64[num_slots]: who has the seat, and the seats before and after it on his path.
    first, last, visits : int64[num_agents], of each path: its ends, and how many it has.
    metres : float64[num_agents], of each path, without the way back.
    voided : bool[num_agents], whether a refusal ended the agent's bundle.
    touched, old : the tasks whose start the last step changed, and what it was; sizes[0] of them.
    queue, waiting, seen : scratch. sizes : int64[2]; sizes[1] is the mark in `seen` of the last search.
    """

    start: FloatArray
    filled: RowArray
    missing: RowArray
    lead: RowArray
    lead_bid: FloatArray
    holder: RowArray
    before: RowArray
    after: RowArray
    first: RowArray
    last: RowArray
    visits: RowArray
    metres: FloatArray
    voided: NDArray[np.bool_]
    touched: RowArray
    old: FloatArray
    queue: RowArray
    waiting: NDArray[np.bool_]
    seen: RowArray
    sizes: RowArray


def empty_joint(num_agents: int, num_tasks: int, num_slots: int) -> Joint:
    """Return the arrays of a `Joint`; `clear` fills them."""
    return Joint(
        start=np.zeros(num_tasks),
        filled=np.zeros(num_tasks, np.int64),
        missing=np.zeros(num_tasks, np.int64),
        lead=np.zeros(num_tasks, np.int64),
        lead_bid=np.zeros(num_tasks),
        holder=np.zeros(num_slots, np.int64),
        before=np.zeros(num_slots, np.int64),
        after=np.zeros(num_slots, np.int64),
        first=np.zeros(num_agents, np.int64),
        last=np.zeros(num_agents, np.int64),
        visits=np.zeros(num_agents, np.int64),
        metres=np.zeros(num_agents),
        voided=np.zeros(num_agents, np.bool_),
        touched=np.zeros(num_tasks, np.int64),
        old=np.zeros(num_tasks),
        queue=np.zeros(num_tasks + 1, np.int64),
        waiting=np.zeros(num_tasks, np.bool_),
        seen=np.zeros(num_tasks, np.int64),
        sizes=np.zeros(2, np.int64),
    )


@njit(cache=True, error_model="numpy")
def clear(terms, joint):
    """Nobody is seated anywhere."""
    joint.filled[:] = 0
    joint.first[:] = NO_SEAT
    joint.last[:] = NO_SEAT
    joint.visits[:] = 0
    joint.metres[:] = 0.0
    joint.voided[:] = False
    joint.waiting[:] = False
    joint.lead[:] = NO_AGENT
    joint.sizes[0] = 0
    for j in range(joint.start.shape[0]):
        joint.missing[j] = terms.full[terms.kind[j]]


@njit(cache=True, error_model="numpy")
def hold(terms, joint, m, j, start):
    """Seat an agent at a task that it has begun, whatever it was allowed to."""
    slot = terms.slot_at[j] + joint.filled[j]
    if slot >= terms.slot_at[j + 1]:
        return
    joint.start[j] = start if joint.filled[j] == 0 else max(start, joint.start[j])
    if joint.filled[j] == 0:
        joint.lead[j] = m
        joint.lead_bid[j] = HIGHEST_BID
    joint.holder[slot] = m
    joint.before[slot] = HELD
    joint.after[slot] = NO_SEAT
    joint.filled[j] += 1
    joint.missing[j] &= ~terms.brings[terms.kind[j], m]


@njit(cache=True, error_model="numpy", forceinline=True)
def complete(seats, filled, missing, j):
    """Whether all seats are taken and all equipment is there (Hunt 2014, eq. (4))."""
    return missing[j] == 0 and filled[j] > 0 and (seats[j] == 0 or filled[j] == seats[j])


@njit(cache=True, error_model="numpy", forceinline=True)
def between(tasks, a, b, step):
    """Metres from task to task."""
    return distance_between(
        tasks[X, a], tasks[Y, a], tasks[Z, a], tasks[X, b], tasks[Y, b], tasks[Z, b], step
    )


@njit(cache=True, error_model="numpy", forceinline=True)
def from_start(tasks, agents, m, j, step):
    """Metres from an agent's own place to a task."""
    return distance_between(
        agents[m, AGENT_X],
        agents[m, AGENT_Y],
        agents[m, AGENT_Z],
        tasks[X, j],
        tasks[Y, j],
        tasks[Z, j],
        step,
    )


@njit(cache=True, error_model="numpy", forceinline=True)
def way_back(tasks, agents, m, j, step):
    """Metres from a task to the agent's base; 0 without one."""
    if agents[m, HAS_BASE] == 0.0:
        return 0.0
    return distance_between(
        tasks[X, j], tasks[Y, j], tasks[Z, j], agents[m, BASE_X], agents[m, BASE_Y], agents[m, BASE_Z], step
    )


@njit(cache=True, error_model="numpy", forceinline=True)
def earliest(tasks, start, filled, need_at, needs, j):
    """The start of a task as it stands: its group's, or its window's and its prerequisites'."""
    if filled[j] > 0:
        return start[j]
    found = tasks[READY, j]
    for i in range(need_at[j], need_at[j + 1]):
        found = max(found, start[needs[i]] + tasks[DURATION, needs[i]])
    return found


@njit(cache=True, error_model="numpy", forceinline=True)
def link(terms, joint, m, j, b, a):
    """Seat an agent between the seats b and a of its path; return the seat."""
    slot = terms.slot_at[j] + joint.filled[j]
    joint.holder[slot] = m
    joint.before[slot] = b
    joint.after[slot] = a
    if b >= 0:
        joint.after[b] = slot
    else:
        joint.first[m] = slot
    if a >= 0:
        joint.before[a] = slot
    else:
        joint.last[m] = slot
    joint.filled[j] += 1
    joint.visits[m] += 1
    joint.missing[j] &= ~terms.brings[terms.kind[j], m]
    return slot


@njit(cache=True, error_model="numpy", forceinline=True)
def unlink(terms, joint, j):
    """Take the last who was seated at a task from his seat."""
    joint.filled[j] -= 1
    begin = terms.slot_at[j]
    slot = begin + joint.filled[j]
    m, b, a = joint.holder[slot], joint.before[slot], joint.after[slot]
    if b >= 0:
        joint.after[b] = a
    else:
        joint.first[m] = a
    if a >= 0:
        joint.before[a] = b
    else:
        joint.last[m] = b
    joint.visits[m] -= 1
    kind = terms.kind[j]
    missing = terms.full[kind]
    for other in range(begin, slot):
        missing &= ~terms.brings[kind, joint.holder[other]]
    joint.missing[j] = missing
