"""What the two makespan benchmarks share: negotiate, judge the plan twice, keep the best of several.

A team that has agreed knows the whole plan, so each member can compute its makespan. Hence a team may
negotiate several times, each time with other rewards that follow from a common seed, and keep the plan that
ends the earliest. Nobody is in charge of that: all have the same plans and the same numbers.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from multiprocessing import get_context
from typing import Any, Protocol

from swarmbid.datasets._routes import Replay
from swarmbid.model import Mission
from swarmbid.plan import Plan
from swarmbid.rng import stream
from swarmbid.scores.early_finish import EarlyFinish
from swarmbid.simulator import simulate
from swarmbid.verify import verify

ALGORITHM = "cbga"
TOLERANCE = 1e-9
"""Relative difference of two computations of one time that is put down to rounding."""

Progress = Callable[[int, int], None]


class Judged(Protocol):
    """An instance of a benchmark: our mission, and the benchmark's own judge."""

    @property
    def name(self) -> str:
        """Of the instance."""

    @property
    def mission(self) -> Mission:
        """The instance in our words."""

    def replay(self, routes: Sequence[Sequence[int]]) -> Replay:
        """Follow routes by the benchmark's rules."""


@dataclass(frozen=True)
class Setting:
    """How a team negotiates.

    Parameters
    ----------
    score : what it bids by. insertion : "shift" or "append".
    spread : s; standard deviation of the head starts that the later negotiations draw.
    """

    score: EarlyFinish
    insertion: str
    spread: float


@dataclass(frozen=True)
class Attempt:
    """One negotiation and its plan.

    Parameters
    ----------
    makespan : by the benchmark's judge; infinite if not everything is done.
    left : tasks not done. rounds : until all agreed. messages : broadcasts. converged : whether they did.
    problems : what `verify` or the judge has against the plan, or where the two differ.
    """

    makespan: float
    left: int
    rounds: int
    messages: int
    converged: bool
    problems: tuple[str, ...]


def best(attempts: Sequence[Attempt], count: int) -> float:
    """Return the shortest makespan of the first `count` negotiations."""
    return min(one.makespan for one in attempts[:count])


def negotiate(instance: Judged, setting: Setting, draw: int) -> Attempt:
    """Let the team of `instance` negotiate once, and judge the plan.

    Parameters
    ----------
    draw : 0 for the rewards as they are, 1 and more for the seed of others.
    """
    mission = varied(instance.mission, setting, draw)
    run = simulate(
        mission, algorithm=ALGORITHM, score=setting.score, insertion=setting.insertion, team_rewards=True
    )
    plan = run.plan
    judged = instance.replay(routes(mission, plan))
    problems = [str(violation) for violation in verify(mission, plan, setting.score)]
    if not plan.unserved:
        problems += judged.problems
        finish = max(one.finish for one in plan.agents if one.visits)
        if not math.isclose(finish, judged.makespan, rel_tol=TOLERANCE):
            problems.append(f"the plan ends at {finish:.9g} s, followed it ends at {judged.makespan:.9g} s")
    return Attempt(
        makespan=math.inf if plan.unserved else judged.makespan,
        left=len(plan.unserved),
        rounds=run.rounds,
        messages=run.messages,
        converged=run.converged,
        problems=tuple(problems),
    )


def varied(mission: Mission, setting: Setting, draw: int) -> Mission:
    """Return the mission with rewards that give every task a head start of its own.

    A head start of h s is a reward e^(h / time_constant): that many seconds later the task is worth
    what it would be worth without. Drawn from a normal distribution, the same for all the team.

    Parameters
    ----------
    draw : the seed; 0 leaves the rewards as they are.
    """
    if draw == 0:
        return mission
    normal = stream(draw, "head starts", mission.name).standard_normal(len(mission.tasks))
    factors = setting.spread / setting.score.time_constant * normal
    return replace(
        mission,
        tasks=tuple(
            replace(task, reward=task.reward * math.exp(float(factor)))
            for task, factor in zip(mission.tasks, factors, strict=True)
        ),
    )


def routes(mission: Mission, plan: Plan) -> list[list[int]]:
    """Return for each robot the numbers of its tasks in order, as the benchmarks count: 1 is the first."""
    number = {task.id: place for place, task in enumerate(mission.tasks, 1)}
    visits = {one.agent: [number[visit.task] for visit in one.visits] for one in plan.agents}
    return [visits.get(agent.id, []) for agent in mission.agents]


def negotiate_all(
    instances: Sequence[Judged], setting: Setting, negotiations: int, progress: Progress | None
) -> list[tuple[Attempt, ...]]:
    """Return the attempts for each instance, made by as many processes as there are processors."""
    cases = [(instance, setting, draw) for instance in instances for draw in range(negotiations)]
    attempts: list[Attempt] = []
    for attempt in _spread(cases):
        attempts.append(attempt)
        if progress is not None:
            progress(len(attempts), len(cases))
    return [
        tuple(attempts[place * negotiations : (place + 1) * negotiations]) for place in range(len(instances))
    ]


def _spread(cases: Sequence[tuple[Judged, Setting, int]]) -> Iterator[Attempt]:
    workers = min(os.cpu_count() or 1, len(cases) // 4)
    if workers < 2:  # too few to pay for starting another interpreter
        yield from (_negotiate(case) for case in cases)
        return
    # Started afresh, not forked: compiled code may own threads, which a fork would lose.
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        yield from pool.map(_negotiate, cases)


def _negotiate(case: tuple[Judged, Setting, int]) -> Attempt:
    return negotiate(*case)


def faults(name: str, attempts: Iterable[Attempt]) -> list[str]:
    """What went wrong with one instance, in sentences."""
    found = []
    for draw, one in enumerate(attempts):
        where = f"{name}, negotiation {draw + 1}"
        if not one.converged:
            found.append(f"{where}: the agents did not agree")
        if one.left and draw == 0:
            found.append(f"{where}: {one.left} tasks are left")
        found += [f"{where}: {problem}" for problem in one.problems]
    return found


def described(setting: Setting) -> dict[str, Any]:
    """The setting, JSON-ready."""
    return {
        "algorithm": ALGORITHM,
        "insertion": setting.insertion,
        "team_rewards": True,
        "score": {"name": setting.score.name, **setting.score.options},
        "spread": setting.spread,
    }


def in_json(data: Any) -> Any:
    """Return the same with None for every number that is not finite: JSON has none such."""
    if isinstance(data, dict):
        return {name: in_json(value) for name, value in data.items()}
    if isinstance(data, list | tuple):
        return [in_json(value) for value in data]
    return None if isinstance(data, float) and not math.isfinite(data) else data


def mean(values: Iterable[float]) -> float:
    """Return the mean of one or more numbers."""
    listed = list(values)
    return math.fsum(listed) / len(listed)


def markdown(headings: Sequence[str], rows: Iterable[Sequence[str]], texts: int = 2) -> list[str]:
    """Return the lines of a Markdown table; the first column and the last `texts` are words."""
    rule = ["---", *["---:"] * (len(headings) - 1 - texts), *["---"] * texts]
    return ["| " + " | ".join(cells) + " |" for cells in (headings, rule, *rows)]
