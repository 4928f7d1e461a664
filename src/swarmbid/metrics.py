"""Numbers from a trace, and from nothing else.

Rounds, messages and bytes say what the agreement cost; distance, makespan and score what came of it.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass
from itertools import groupby
from typing import Any

from swarmbid.plan import Plan
from swarmbid.trace import Dropped, Outbid, Record, Released, Sent, Taken, Trace


@dataclass(frozen=True)
class Metrics:
    """What one run cost and what it achieved.

    Attributes
    ----------
    status : ``converged`` or ``not_converged``.
    rounds, last_bid_round, declared_round : until all agreed; of the last bid; until all knew it.
    messages : broadcasts.
    bytes, entries : carried by all of them.
    bytes_per_broadcast : mean; 0 without a broadcast.
    lost : receptions that the network lost.
    dropped : messages that a receiver refused, by reason.
    winner_changes : for each task how often its leading bidder gave way to another (0 is left out).
    makespan : s at which the last task ends.
    total_distance : m, ways back included.
    score, honest_score : of the plan; the second counts every leg once.
    gini : inequality of work (s of travel and service) over the agents: 0 all equal, near 1 one does all.
    num_agents, num_tasks, served, unserved : counts.
    """

    status: str
    rounds: int | None
    last_bid_round: int | None
    declared_round: int | None
    messages: int
    bytes: int
    entries: int
    bytes_per_broadcast: float
    lost: int
    dropped: dict[str, int]
    winner_changes: dict[str, int]
    makespan: float
    total_distance: float
    score: float
    honest_score: float
    gini: float
    num_agents: int
    num_tasks: int
    served: int
    unserved: int

    def to_dict(self) -> dict[str, Any]:
        """Return it ready for JSON."""
        return asdict(self)


def measure(trace: Trace) -> Metrics:
    """Take all the numbers of a finished run; InputError if it was stopped before its end."""
    result = trace.finished()
    mission = trace.mission()
    plan = Plan.from_dict(result.plan, where=trace.source)
    sent = list(trace.of(Sent))
    total_bytes = sum(record.bytes for record in sent)
    speed = {agent.id: agent.speed for agent in mission.agents}
    duration = {task.id: task.duration for task in mission.tasks}
    work = [
        agent.distance / speed[agent.agent] + sum(duration[visit.task] for visit in agent.visits)
        for agent in plan.agents
    ]
    work += [0.0] * (len(mission.agents) - len(work))
    visits = [visit for agent in plan.agents for visit in agent.visits]
    return Metrics(
        status=result.status,
        rounds=result.rounds,
        last_bid_round=result.last_bid_round,
        declared_round=result.declared_round,
        messages=len(sent),
        bytes=total_bytes,
        entries=sum(record.entries for record in sent),
        bytes_per_broadcast=total_bytes / len(sent) if sent else 0.0,
        lost=sum(record.lost for record in sent),
        dropped=dict(sorted(Counter(record.reason for record in trace.of(Dropped)).items())),
        winner_changes=winner_changes(trace.records),
        makespan=max((visit.end for visit in visits), default=0.0),
        total_distance=sum(agent.distance for agent in plan.agents),
        score=plan.total_score,
        honest_score=plan.honest_score,
        gini=gini(work),
        num_agents=len(mission.agents),
        num_tasks=len(mission.tasks),
        served=len({visit.task for visit in visits}),
        unserved=len(plan.unserved),
    )


def winner_changes(records: Iterable[Record]) -> dict[str, int]:
    """Count for each task how often its leading bidder changed from one agent to another.

    The leader at an instant is, of the agents that hold the task in their bundles, the one whose bid
    outbids the others' (the higher; among equals the higher id). Records of one instant count together:
    that ten agents bid in the same round is no change.
    """
    holders: dict[str, dict[str, float]] = {}
    leader: dict[str, str] = {}
    changes: Counter[str] = Counter()
    for _, instant in groupby(_bids(records), key=lambda record: record.t):
        touched: dict[str, None] = {}
        for record in instant:
            held = holders.setdefault(record.task, {})
            if isinstance(record, Taken):
                held[record.agent] = record.bid
            else:
                held.pop(record.agent, None)
            touched[record.task] = None
        for task in touched:
            held = holders[task]
            if not held:
                continue
            best = max(held, key=lambda agent: (held[agent], agent.encode()))
            if leader.get(task, best) != best:
                changes[task] += 1
            leader[task] = best
    return dict(sorted(changes.items()))


def gini(values: Sequence[float]) -> float:
    """Gini coefficient of non-negative values: mean absolute difference over twice the mean.

    0 if all are equal (or all 0, or none), (n - 1)/n if one of n has everything.

    Examples
    --------
    >>> gini([1.0, 1.0, 1.0]), gini([0.0, 0.0, 0.0, 8.0])
    (0.0, 0.75)
    """
    total = sum(values)
    if total <= 0.0:
        return 0.0
    count = len(values)
    weighted = sum((2 * rank - count + 1) * value for rank, value in enumerate(sorted(values)))
    return weighted / (count * total)


def _bids(records: Iterable[Record]) -> Iterator[Taken | Outbid | Released]:
    for record in records:
        if isinstance(record, Taken | Outbid | Released):
            yield record
