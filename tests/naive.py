"""Slow twins of the arithmetic: plain Python, one agent, one task, one position at a time.

Written from the description of the algorithms alone, so that nothing is borrowed from the compiled
code that these functions judge. Only the mission's dataclasses are shared. Units are SI throughout.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

from swarmbid.model import Agent, Mission, Position, Task

Path = list[tuple[str, float]]  # (task id, start of service s), in order of visit


def distance(a: Position, b: Position, step: float = 0.0) -> float:
    """Metres from `a` to `b`, rounded down to a multiple of `step` if that is not 0."""
    metres = math.sqrt((b[0] - a[0]) ** 2 + (b[1] - a[1]) ** 2 + (b[2] - a[2]) ** 2)
    return math.floor(metres / step + 1e-9) * step if step > 0 else metres


def outbids(bid: float, agent: str | None, other_bid: float, other_agent: str | None) -> bool:
    """The one order of bids: higher bid first, then higher agent id as bytes; nobody comes last."""
    if bid != other_bid:
        return bid > other_bid
    if agent is None:
        return False
    return other_agent is None or agent.encode() > other_agent.encode()


@dataclass(frozen=True)
class Terms:
    """What one visit is worth: the one family that all built-in scores are members of.

    reward * exp(-(decay * (t - reference) + ((t - peak) * inverse_width)^2)) - cost * leg - fixed,
    with t the start of service in s and leg the metres flown from the previous stop.
    """

    reward: float
    reference: float = 0.0
    decay: float = 0.0
    peak: float = 0.0
    inverse_width: float = 0.0
    cost: float = 0.0
    fixed: float = 0.0
    ready: float | None = None  # start of service that the agent would wait for; None: window opens

    def value(self, start: float, leg: float) -> float:
        exponent = self.decay * (start - self.reference) + ((start - self.peak) * self.inverse_width) ** 2
        return self.reward * math.exp(-exponent) - self.cost * leg - self.fixed


Score = Callable[[Mission, Agent, Task], Terms]


def time_discounted(fuel: str) -> Score:
    """The slides' score; fuel counted by leg ("path") or from the agent's first position ("start")."""

    def terms(mission: Mission, agent: Agent, task: Task) -> Terms:
        from_start = agent.fuel_per_metre * distance(agent.position, task.position, mission.distance_step)
        return Terms(
            task.reward,
            reference=task.start,
            decay=task.discount,
            cost=agent.fuel_per_metre if fuel == "path" else 0.0,
            fixed=from_start if fuel == "start" else 0.0,
        )

    return terms


def distance_cost(mission: Mission, agent: Agent, task: Task) -> Terms:
    """Hunt 2014, eq. 7: reward less metres flown less seconds of service, a score unit each."""
    return Terms(task.reward - task.duration, cost=1.0)


def time_window(mission: Mission, agent: Agent, task: Task) -> Terms:
    """The whole reward within the window, less fuel along the path."""
    return Terms(task.reward, cost=agent.fuel_per_metre)


def revisit(mission: Mission, agent: Agent, task: Task) -> Terms:
    """A reward that peaks at the scheduled time, for which an early agent waits."""
    if task.revisit_at is None:
        return time_window(mission, agent, task)
    return Terms(
        task.reward,
        peak=task.revisit_at,
        inverse_width=1.0 / task.revisit_width,
        cost=agent.fuel_per_metre,
        ready=min(max(task.start, task.revisit_at), task.end),
    )


SCORES: dict[str, Score] = {
    "time_discounted": time_discounted("path"),
    "time_discounted fuel=start": time_discounted("start"),
    "distance_cost": distance_cost,
    "time_window": time_window,
    "revisit": revisit,
}


def fly(mission: Mission, agent: Agent, stops: Sequence[Position]) -> float:
    """Metres along `stops` from where the agent is, with the way back to its base if it has one."""
    route = [agent.position, *stops]
    if agent.base is not None and stops:
        route.append(agent.base)
    return sum(distance(a, b, mission.distance_step) for a, b in itertools.pairwise(route))


class Judge:
    """One agent's timing, feasibility and gain under one score and one insertion rule.

    Parameters
    ----------
    rule : "hold" (promised starts never move), "shift" (later visits slip), "append" (only the end).
    """

    def __init__(self, mission: Mission, agent: Agent, score: Score, rule: str) -> None:
        if rule not in ("hold", "shift", "append"):
            raise ValueError(rule)
        self.mission, self.agent, self.rule = mission, agent, rule
        self.tasks = {task.id: task for task in mission.tasks}
        self.terms = {task.id: score(mission, agent, task) for task in mission.tasks}

    def metres(self, a: Position, b: Position) -> float:
        return distance(a, b, self.mission.distance_step)

    def ready(self, task: Task) -> float:
        wanted = self.terms[task.id].ready
        return task.start if wanted is None else max(task.start, wanted)

    def leave(self, path: Path, position: int) -> tuple[Position, float]:
        """Where and when (s) the agent sets off for what stands, or would stand, at `position`."""
        if position == 0:
            return self.agent.position, self.agent.available_at
        task_id, start = path[position - 1]
        return self.tasks[task_id].position, start + self.tasks[task_id].duration

    def arrival(self, path: Path, position: int, task: Task) -> float:
        place, when = self.leave(path, position)
        return when + self.metres(place, task.position) / self.agent.speed

    def may_fly(self, path: Path) -> bool:
        """Whether range and endurance allow `path`, the way back included."""
        if not path:
            return True
        stops = [self.tasks[task_id].position for task_id, _ in path]
        if fly(self.mission, self.agent, stops) > self.agent.range:
            return False
        place, when = self.leave(path, len(path))
        if self.agent.base is not None:
            when += self.metres(place, self.agent.base) / self.agent.speed
        return when <= self.agent.available_at + self.agent.endurance

    def insert(self, path: Path, position: int, task: Task) -> Path | None:
        """`path` with `task` at `position`, or None if the rule, a window, range or return forbids it."""
        if not self.mission.can_do(self.agent, task) or (self.rule == "append" and position != len(path)):
            return None
        earliest = max(task.start, self.arrival(path, position, task))
        latest = task.end
        if self.rule != "shift" and position < len(path):
            following, promised = path[position]
            way = self.metres(task.position, self.tasks[following].position) / self.agent.speed
            latest = min(latest, promised - task.duration - way)
        if earliest > latest:
            return None
        start = max(earliest, min(self.ready(task), latest))
        longer = [*path[:position], (task.id, start)]
        for task_id, promised in path[position:]:
            if self.rule == "shift":
                later = self.tasks[task_id]
                promised = max(self.ready(later), self.arrival(longer, len(longer), later))
                if promised > later.end:
                    return None
            longer.append((task_id, promised))
        return longer if self.may_fly(longer) else None

    def visit_value(self, path: Path, position: int) -> float:
        task_id, start = path[position]
        place, _ = self.leave(path, position)
        return self.terms[task_id].value(start, self.metres(place, self.tasks[task_id].position))

    def path_score(self, path: Path) -> float:
        return sum(self.visit_value(path, position) for position in range(len(path)))

    def gain(self, path: Path, longer: Path, position: int) -> float:
        """S(longer) - S(path), summed over the visits that changed only: the new one and later ones."""
        gained = self.visit_value(longer, position)
        for later in range(position, len(path)):
            old, new = self.visit_value(path, later), self.visit_value(longer, later + 1)
            if old != new:
                gained += new - old
        return gained

    def best_insertion(self, path: Path, task: Task) -> tuple[float, int, Path] | None:
        """(gain, position, longer path) of the best place for `task`; of equals the earliest."""
        best: tuple[float, int, Path] | None = None
        for position in range(len(path) + 1):
            longer = self.insert(path, position, task)
            if longer is not None:
                gain = self.gain(path, longer, position)
                if best is None or gain > best[0]:
                    best = (gain, position, longer)
        return best

    def tie(self, task_id: str) -> tuple[float, bytes]:
        """Among equal gains the task that opens first, then the smallest id."""
        return self.tasks[task_id].start, task_id.encode()

    def candidates(self, path: Path, open_tasks: Iterable[str]) -> list[tuple[float, str, Path]]:
        """(gain, task id, longer path), largest gain first, ties in the order of `tie`."""
        found = []
        for task_id in open_tasks:
            best = self.best_insertion(path, self.tasks[task_id])
            if best is not None:
                found.append((best[0], task_id, best[2]))
        return sorted(found, key=lambda entry: (-entry[0], self.tie(entry[1])))

    def limit(self) -> int:
        return len(self.tasks) if self.agent.bundle_limit is None else self.agent.bundle_limit


@dataclass
class Bundle:
    """What one agent has taken: ids and bids in order of taking, and the path in order of doing."""

    tasks: list[str]
    bids: list[float]
    path: Path


def extend_bundle(
    judge: Judge, bundle: Bundle, beliefs: dict[str, tuple[str | None, float]], *, warp: bool
) -> None:
    """Phase 1: take the best task that would beat its present winner, until there is none.

    `beliefs` maps task id to (winning agent, winning bid); what is taken is written into it.
    """
    me = judge.agent.id
    while len(bundle.tasks) < judge.limit():
        chosen = None
        open_tasks = [task_id for task_id in beliefs if task_id not in bundle.tasks]
        for gain, task_id, longer in judge.candidates(bundle.path, open_tasks):
            bid = min(gain, bundle.bids[-1]) if warp and bundle.bids else gain
            winner, winning_bid = beliefs[task_id]
            if bid > 0 and outbids(bid, me, winning_bid, winner):
                chosen = (task_id, bid, longer)
                break
        if chosen is None:
            return
        task_id, bid, longer = chosen
        bundle.tasks.append(task_id)
        bundle.bids.append(bid)
        bundle.path = longer
        beliefs[task_id] = (me, bid)


def sequential_greedy(
    mission: Mission, score: Score, rule: str, *, warp: bool = False
) -> tuple[dict[str, Bundle], list[tuple[str, str, float]]]:
    """The central planner that CBBA must equal: the best bid of all agents, one task at a time.

    Returns the bundles and the order of award as (task id, agent id, bid).
    """
    judges = {agent.id: Judge(mission, agent, score, rule) for agent in mission.agents}
    bundles = {agent.id: Bundle([], [], []) for agent in mission.agents}
    open_tasks = sorted(task.id for task in mission.tasks)
    awards: list[tuple[str, str, float]] = []
    while True:
        best: tuple[float, str, str, Path] | None = None
        for agent_id, judge in judges.items():
            bundle = bundles[agent_id]
            if len(bundle.tasks) >= judge.limit():
                continue
            candidates = judge.candidates(bundle.path, open_tasks)
            if candidates:
                gain, task_id, longer = candidates[0]
                bid = min(gain, bundle.bids[-1]) if warp and bundle.bids else gain
                if bid > 0 and (best is None or outbids(bid, agent_id, best[0], best[1])):
                    best = (bid, agent_id, task_id, longer)
        if best is None:
            return bundles, awards
        bid, agent_id, task_id, longer = best
        bundles[agent_id].tasks.append(task_id)
        bundles[agent_id].bids.append(bid)
        bundles[agent_id].path = longer
        open_tasks.remove(task_id)
        awards.append((task_id, agent_id, bid))


def optimum(mission: Mission, score: Score) -> float:
    """The largest total score of any assignment, by trying every order of every subset.

    Every visit starts as early as it can, which is best for scores that never grow with time.
    """
    task_ids = [task.id for task in mission.tasks]
    best = {frozenset[str](): 0.0}
    for agent in mission.agents:
        judge = Judge(mission, agent, score, "append")
        alone: dict[frozenset[str], float] = {}
        for size in range(min(judge.limit(), len(task_ids)) + 1):
            for order in itertools.permutations(task_ids, size):
                path: Path | None = []
                for task_id in order:
                    path = judge.insert(path, len(path), judge.tasks[task_id])
                    if path is None:
                        break
                if path is not None:
                    key = frozenset(order)
                    alone[key] = max(alone.get(key, -math.inf), judge.path_score(path))
        merged = dict(best)
        for mine, worth in alone.items():
            for theirs, total in best.items():
                if not mine & theirs:
                    key = mine | theirs
                    merged[key] = max(merged.get(key, -math.inf), total + worth)
        best = merged
    return max(best.values())
