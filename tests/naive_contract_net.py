"""Slow twin of the Contract Net where its result is determined: tasks called for one after the other.

In good air, with each task awarded before the next is found and nothing carried out meanwhile, the protocol
is a sequential auction (Dymkou's slides, "Compare bids", the diagonal of the table): every agent offers
what the task would add to its path, wherever it fits best, and the largest offer has it; of equal ones
that of the highest id. Nothing else of the protocol is modelled.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

from naive import Judge, Path, Score, outbids
from swarmbid.model import Mission, Task


@dataclass(frozen=True)
class Awards:
    """Who has what: `winners` by task, None for nobody; `bids` that won; `paths` by agent."""

    winners: dict[str, str | None]
    bids: dict[str, float]
    paths: dict[str, list[str]]


def sequential_auction(mission: Mission, tasks: Iterable[Task], score: Score, rule: str) -> Awards:
    """Award `tasks` in their order to the agents of `mission`, whose own tasks are not looked at."""
    tasks = tuple(tasks)
    whole = replace(mission, tasks=tasks)
    judges = {agent.id: Judge(whole, agent, score, rule) for agent in mission.agents}
    paths: dict[str, Path] = {name: [] for name in judges}
    winners: dict[str, str | None] = {}
    bids: dict[str, float] = {}
    for task in tasks:
        winner, bid, longer = None, 0.0, None
        for name, judge in judges.items():
            best = judge.best_insertion(paths[name], task)
            if best is None or best[0] <= 0.0 or len(paths[name]) >= judge.limit():
                continue
            if outbids(best[0], name, bid, winner):
                winner, bid, longer = name, best[0], best[2]
        winners[task.id], bids[task.id] = winner, bid
        if winner is not None and longer is not None:
            paths[winner] = longer
    return Awards(winners, bids, {name: [task for task, _ in path] for name, path in paths.items()})
