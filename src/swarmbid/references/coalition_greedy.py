"""Sequential greedy for groups: what a central planner gets by always seating whose entry ranks best.

The oracle of CBGA: without quitting its agents settle on exactly this, on every connected network. It
shares CBGA's referee and its candidates (`swarmbid.kernels`), but nothing is negotiated: one joint plan,
all agents' candidates in view.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from swarmbid.algorithms._bundle import RULES
from swarmbid.algorithms._groups import incomplete, is_complete, members
from swarmbid.algorithms._terms import make_terms
from swarmbid.arrays import MissionArrays
from swarmbid.kernels.joint import clear, empty_joint
from swarmbid.kernels.offers import (
    BEST,
    LENGTH,
    MOST_BLOCKED,
    SEATS,
    Own,
    empty_own,
    pick,
    refresh,
    take_best,
    weigh_again,
)
from swarmbid.kernels.ranks import BID, outranks
from swarmbid.kernels.referee import admit
from swarmbid.model import Mission
from swarmbid.scores import Score, make_score


@dataclass(frozen=True)
class CoalitionResult:
    """Who gets what.

    Parameters
    ----------
    paths : agent id -> (task id, start of service in s) in order of visit, complete groups only.
    seats : (agent id, task id, bid) in the order in which seats were given away, all groups.
    incomplete : ids of tasks whose groups were left incomplete.
    """

    paths: dict[str, list[tuple[str, float]]]
    seats: tuple[tuple[str, str, float], ...]
    incomplete: tuple[str, ...]


def coalition_greedy(
    mission: Mission,
    score: str | Score | None = None,
    *,
    insertion: str | None = None,
    quitting: bool = True,
    dissolve: float = 0.25,
    team_rewards: bool = False,
) -> CoalitionResult:
    """Give away one seat after the other, each time to the entry that ranks best.

    Parameters
    ----------
    score, insertion, quitting, dissolve, team_rewards : as for `swarmbid.algorithms.cbga.CBGA`.

    Examples
    --------
    >>> from swarmbid.model import Agent, Task
    >>> mission = Mission(
    ...     agents=tuple(Agent(id=name, position=(0.0, 0.0, 0.0)) for name in ("uav1", "uav2")),
    ...     tasks=(Task(id="lift", position=(3.0, 4.0, 0.0), reward=10.0, agents_required=2),),
    ... )
    >>> coalition_greedy(mission).paths
    {'uav1': [('lift', 5.0)], 'uav2': [('lift', 5.0)]}
    """
    planner = _Planner(MissionArrays(mission), make_score(score), insertion, team_rewards)
    while True:
        planner.run()
        worst = incomplete(planner.terms, planner.joint, planner.gain) if quitting else []
        if not worst:
            return planner.result()
        for task in worst[: max(1, math.ceil(dissolve * len(worst)))]:
            for row in members(planner.terms, planner.joint, task):
                planner.terms.allowed[row, task] = False


class _Planner:
    def __init__(self, arrays: MissionArrays, score: Score, insertion: str | None, team: bool) -> None:
        self.arrays = arrays
        self.team = team
        rule = insertion or score.insertion
        self.rule = RULES[rule if rule != "hold" else "shift"]
        terms = make_terms(arrays, score)
        self.terms = terms._replace(allowed=terms.allowed.copy())
        self.joint = empty_joint(arrays.num_agents, arrays.num_tasks, int(terms.slot_at[-1]))
        self.fixed = [score.fixed(arrays, agent) for agent in arrays.agents]
        self.owns: list[Own] = []
        self.seats: list[tuple[int, int, float]] = []

    def run(self) -> None:
        """Start again with nobody seated, and seat whom there is to seat, stage by stage."""
        terms, joint = self.terms, self.joint
        clear(terms, joint)
        self.seats = []
        self.owns = [
            empty_own(
                terms.tasks.copy(), np.zeros(0) if fixed is None else fixed, terms.agents[row].copy(),
                int(terms.limits[row]),
            )
            for row, fixed in enumerate(self.fixed)
        ]  # fmt: skip
        for stage in range(int(terms.stage.max(initial=0)) + 1):
            for row, own in enumerate(self.owns):
                refresh(terms, joint, own, row, self.rule, stage, self.team)
            while self.seat_best(stage):
                pass

    def seat_best(self, stage: int) -> bool:
        """Seat whose candidate ranks best; False if nobody has one."""
        terms, joint, team, rule = self.terms, self.joint, self.team, self.rule
        while True:
            best = -1
            for row, own in enumerate(self.owns):
                if own.sizes[BEST] >= 0 and (best < 0 or outranks(own.key, self.owns[best].key)):
                    best = row
            if best < 0:
                return False
            own = self.owns[best]
            task = int(own.sizes[BEST])
            if own.seen[task] != own.sizes[SEATS]:  # others' seats may have changed what it gains
                claim = own.claim[task]
                weigh_again(terms, joint, own, best, rule, team, task)
                if own.claim[task] != claim:
                    continue
            place = int(own.place[task])
            if admit(terms, joint, best, task, place, rule) >= 0:
                break
            own.blocked[task] |= 1 << min(place, MOST_BLOCKED)
            weigh_again(terms, joint, own, best, rule, team, task)
        if joint.filled[task] == 1:
            joint.lead[task], joint.lead_bid[task] = best, own.key[BID]
        self.seats.append((best, task, float(own.key[BID])))
        take_best(own)
        refresh(terms, joint, own, best, rule, stage, team)
        for row, other in enumerate(self.owns):
            if row != best:
                other.sizes[SEATS] += 1
                if terms.slot_at[task] + joint.filled[task] == terms.slot_at[task + 1]:
                    other.claim[task] = -np.inf
                pick(terms, joint, other, row, team)
        return True

    def gain(self, row: int, task: int) -> float:
        """What a task gained an agent when it took it."""
        own = self.owns[row]
        return float(own.gain[: own.sizes[LENGTH]][own.task[: own.sizes[LENGTH]] == task][0])

    def result(self) -> CoalitionResult:
        """Return the paths of complete groups, and all seats."""
        arrays, joint = self.arrays, self.joint
        paths: dict[str, list[tuple[str, float]]] = {}
        for row, agent_id in enumerate(arrays.agent_ids):
            own = self.owns[row]
            path = [int(task) for task in own.path[: own.sizes[LENGTH]]]
            paths[agent_id] = [
                (arrays.task_ids[task], float(joint.start[task]))
                for task in path
                if is_complete(self.terms, joint, task)
            ]
        return CoalitionResult(
            paths=paths,
            seats=tuple((arrays.agent_ids[row], arrays.task_ids[task], bid) for row, task, bid in self.seats),
            incomplete=tuple(arrays.task_ids[task] for task in incomplete(self.terms, joint, self.gain)),
        )
