"""Sequential greedy: what a central planner gets by always giving away the best bid (SGA).

The oracle of CBBA: for scores with diminishing gains CBBA reaches exactly this allocation, on every
connected network (Choi, Brunet, How 2009); with warped bids it reaches the greedy with bids warped alike.
Nothing is negotiated here: one loop, all agents' gains in view.
"""

from __future__ import annotations

import heapq
import math
from dataclasses import dataclass

import numpy as np

from swarmbid.algorithms._bundle import Bundle
from swarmbid.arrays import NO_AGENT, MissionArrays
from swarmbid.kernels.bundle import BID
from swarmbid.model import Mission
from swarmbid.scores import Score, make_score


@dataclass(frozen=True)
class GreedyResult:
    """Who gets what.

    Parameters
    ----------
    paths : agent id -> (task id, start of service in s) in order of visit.
    bids : task id -> (agent id, bid) in the order in which tasks were given away.
    """

    paths: dict[str, list[tuple[str, float]]]
    bids: dict[str, tuple[str, float]]

    @property
    def total_bid(self) -> float:
        """Sum of the winning bids."""
        return float(sum(bid for _, bid in self.bids.values()))


def sequential_greedy(
    mission: Mission, score: str | Score | None = None, *, insertion: str | None = None, warp: bool = True
) -> GreedyResult:
    """Give away one task after the other, each time to the highest bid.

    Every agent offers its largest gain (ties: earlier window, then smaller task id), warped to its
    previous bid at most; the highest offer wins (ties: the highest agent id).

    Parameters
    ----------
    score, insertion, warp : as for `swarmbid.algorithms.cbba.CBBA`.
    """
    arrays = MissionArrays(mission)
    found = make_score(score)
    rule = insertion or found.insertion
    bundles = [
        Bundle(arrays, row, found, limit=arrays.bundle_limit(agent), insertion=rule, warp=warp)
        for row, agent in enumerate(arrays.agents)
    ]
    bid_to_beat = np.zeros(arrays.num_tasks)
    winner = np.full(arrays.num_tasks, NO_AGENT, np.int32)
    order: list[int] = []  # tasks given away, first to last
    seen = [0] * arrays.num_agents  # how many of them each agent's bundle takes into account
    held = [0] * arrays.num_agents
    bids: dict[str, tuple[str, float]] = {}
    offers: list[tuple[float, int, int]] = []

    def offer(row: int) -> None:
        bundle = bundles[row]
        changed = np.array(order[seen[row] :], np.int64)
        bundle.build(bid_to_beat, winner, changed, held[row])
        seen[row] = len(order)
        if bundle.length > held[row]:
            bid = float(bundle.marks[BID, held[row]])
            heapq.heappush(offers, (-bid, -row, int(bundle.tasks[held[row]])))

    for row in range(arrays.num_agents):
        offer(row)
    while offers:
        bid, row, task = heapq.heappop(offers)
        row = -row
        if winner[task] == NO_AGENT:
            winner[task] = row
            bid_to_beat[task] = math.inf
            order.append(task)
            held[row] += 1
            bids[arrays.task_ids[task]] = (arrays.agent_ids[row], -bid)
        offer(row)  # its next best, also when somebody else was given this one
    paths = {
        agent_id: [(arrays.task_ids[task], start) for task, start in bundle.path]
        for agent_id, bundle in zip(arrays.agent_ids, bundles, strict=True)
    }
    return GreedyResult(paths, bids)
