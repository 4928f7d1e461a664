"""What the referee's state says of the groups: who is in one, whether it is complete, which is the worst."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from swarmbid.kernels.joint import Joint, Terms, complete


def members(terms: Terms, joint: Joint, task: int) -> list[int]:
    """Return the rows of the agents that have a seat at a task, in order of id."""
    begin = int(terms.slot_at[task])
    return sorted(joint.holder[begin : begin + int(joint.filled[task])].tolist())


def is_complete(terms: Terms, joint: Joint, task: int) -> bool:
    """Whether a task's group has all its members and equipment."""
    return bool(complete(terms.seats, joint.filled, joint.missing, task))


def incomplete(terms: Terms, joint: Joint, gain: Callable[[int, int], float]) -> list[int]:
    """Return the tasks that have members, but not all that they need, the worst first.

    The worst has the smallest share of its seats filled (of its equipment, where it takes as many agents as
    that takes), then the smallest sum of its members' gains, then the smallest id.

    Parameters
    ----------
    gain : what a task is said to gain an agent, by the rows of agent and task.
    """
    found = []
    for task in np.flatnonzero(joint.filled > 0).tolist():
        if is_complete(terms, joint, task):
            continue
        if terms.seats[task] > 0:
            share = float(joint.filled[task]) / float(terms.seats[task])
        else:
            wanted = int(terms.full[terms.kind[task]]).bit_count()
            share = 1.0 - int(joint.missing[task]).bit_count() / wanted
        found.append((share, sum(gain(row, task) for row in members(terms, joint, task)), task))
    return [task for _, _, task in sorted(found)]
