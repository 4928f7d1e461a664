"""CBBA: each agent bids for a bundle of tasks, and neighbours agree who won (Choi, Brunet, How 2009).

Solves: single-robot tasks, several per robot, planned ahead (ST-SR-TA). Phase 1 adds the task with the
largest gain, wherever it fits best into the path, while the bid outbids the best one known. Phase 2
compares beliefs with each neighbour by the table below. For scores with diminishing gains the result is
that of the sequential greedy algorithm, within N_min * D rounds, and at least half the optimum.

Where this departs from the papers, and why:

- Bundles are built afresh when something changed (`rebuild`): the incremental bundle keeps tasks that
  were chosen while a better one was held by an agent that lost it since, and then differs from greedy.
- Bids are warped (`warp`), so that scores without diminishing gains converge (Johnson et al. 2012).
- Stamps are the originator's own counters; the papers' times of reception are an option (`stamps`).
- Ties go to the higher agent id, in bids and in the table alike (Hunt 2014); without an order they never
  settle.
- Row 12, when the sender has newer news of the agent that the receiver believes in, and news equally
  old of the other: the papers leave the belief, we take the sender's, as the published MATLAB does.
  Left alone, two camps of a large network can believe two different winners for ever.
- Only what changed is sent (`full_every`), and agreement is known by equal digests.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from swarmbid.algorithms._auction import ConsensusAuction
from swarmbid.kernels.consensus import (
    BETTER,
    LEAVE,
    NEWER_MINE,
    NEWER_THEIRS,
    NOBODY,
    NUM_FACTS,
    OLDER_THEIRS,
    OTHER,
    RECEIVER,
    RESET,
    SAME,
    SENDER,
    UPDATE,
)
from swarmbid.model import Mission

ALWAYS = 0

Case = tuple[int, int]
Rules = Mapping[Case, tuple[tuple[int, int], ...]]

DECISION_RULES: Rules = {
    # (sender believes, receiver believes): ((if all of these facts hold, then do this), ...), else LEAVE
    (SENDER, RECEIVER): ((BETTER, UPDATE),),  # row 1
    (SENDER, SENDER): ((ALWAYS, UPDATE),),  # row 2
    (SENDER, OTHER): ((NEWER_MINE, UPDATE), (BETTER, UPDATE)),  # row 3
    (SENDER, NOBODY): ((ALWAYS, UPDATE),),  # row 4
    (RECEIVER, RECEIVER): (),  # row 5
    (RECEIVER, SENDER): ((ALWAYS, RESET),),  # row 6
    (RECEIVER, OTHER): ((NEWER_MINE, RESET),),  # row 7
    (RECEIVER, NOBODY): (),  # row 8
    (OTHER, RECEIVER): ((NEWER_THEIRS | BETTER, UPDATE),),  # row 9
    (OTHER, SENDER): ((NEWER_THEIRS, UPDATE), (ALWAYS, RESET)),  # row 10
    (OTHER, SAME): ((NEWER_THEIRS, UPDATE),),  # row 11
    (OTHER, OTHER): (  # row 12, see above
        (NEWER_MINE | OLDER_THEIRS, RESET),
        (NEWER_MINE, UPDATE),
        (NEWER_THEIRS | BETTER, UPDATE),
    ),
    (OTHER, NOBODY): ((NEWER_THEIRS, UPDATE),),  # row 13
    (NOBODY, RECEIVER): (),  # row 14
    (NOBODY, SENDER): ((ALWAYS, UPDATE),),  # row 15
    (NOBODY, OTHER): ((NEWER_MINE, UPDATE),),  # row 16
    (NOBODY, NOBODY): (),  # row 17
}
"""The decision table (Choi 2009, Table I; Dymkou's slides, "Action rules"), in order of its 17 rows."""


def packed(rules: Rules) -> NDArray[np.int8]:
    """Return a decision table as int8[5, 5, NUM_FACTS] of actions, which the kernel looks up.

    Parameters
    ----------
    rules : (sender believes, receiver believes) -> ((facts, action), ...), the first that holds counts.
    """
    table = np.full((5, 5, NUM_FACTS), LEAVE, np.int8)
    for (says, thinks), lines in rules.items():
        for facts in range(NUM_FACTS):
            for needed, action in lines:
                if facts & needed == needed:
                    table[says, thinks, facts] = action
                    break
    return table


class CBBA(ConsensusAuction):
    """The consensus-based bundle algorithm aboard one agent.

    Examples
    --------
    >>> from swarmbid.model import Agent, Mission, Task
    >>> mission = Mission(
    ...     agents=(Agent(id="uav1", position=(0.0, 0.0, 0.0)),),
    ...     tasks=(Task(id="look", position=(3.0, 4.0, 0.0), reward=10.0),),
    ... )
    >>> agent = CBBA("uav1", mission)
    >>> messages = agent.tick(now=0.0)
    >>> agent.path
    [('look', 5.0)]
    """

    DECISIONS = packed(DECISION_RULES)

    @classmethod
    def unsupported(cls, mission: Mission) -> list[str]:
        """One agent does each task, in any order."""
        reasons = []
        several = [task.id for task in mission.tasks if task.is_group]
        ordered = [task.id for task in mission.tasks if task.prerequisites]
        if several:
            reasons.append(f"{_some(several)} more than one agent")
        if ordered:
            reasons.append(f"{_some(ordered)} other tasks done first")
        return reasons


def _some(ids: list[str]) -> str:
    if len(ids) == 1:
        return f"task {ids[0]} needs"
    return f"{len(ids)} tasks (the first is {ids[0]}) need"
