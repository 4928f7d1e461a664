"""The best plan there is, for missions small enough to try every path.

Each agent's feasible paths are enumerated in plain Python; of those over the same tasks only the best
is kept. Choosing one set of tasks per agent, no task twice, is then a set packing problem, which HiGHS
(through SciPy) solves to proven optimality.

No insertion rule enters: promised times, delays and appending differ in how a path grows, yet every
path with the starts below can be grown by each of them (append its tasks in order), so the same set
of paths is open to all and one optimum bounds them all.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

from swarmbid.errors import Fault, InputError
from swarmbid.model import Agent, Mission, Position, Task

if TYPE_CHECKING:
    from swarmbid.scores import Score

MAX_PATHS = 2_000_000
"""Most paths tried, some six seconds of plain Python: 5 agents and 8 tasks without limits."""

_SLACK = 1e-9  # relative rounding allowed where a sum just meets a limit


@dataclass(frozen=True)
class OptimumResult:
    """The best plan and how far it is proven.

    Parameters
    ----------
    paths : agent id -> (task id, start of service in s) in order, as `swarmbid.plan.make_plan` takes.
    value : its total score.
    proven : whether no plan has a higher score. False if the solver stopped early, or if a task has a
        scheduled time of revisit: starts between "at once" and "at the scheduled time" are not tried,
        so `value` is then the best of the starts tried only. (A score of your own that rises with
        time in other ways is not recognised.)
    num_paths : paths that were tried.
    """

    paths: dict[str, list[tuple[str, float]]]
    value: float
    proven: bool
    num_paths: int


@dataclass(frozen=True)
class _Choice:
    """The best way for one agent to do one set of tasks."""

    agent: str
    path: tuple[tuple[str, float], ...]
    value: float


def optimum(mission: Mission, score: Score, *, max_paths: int = MAX_PATHS) -> OptimumResult:
    """Return the plan of the highest total score.

    Each visit starts as early as it can, which is best for every score that does not rise with time;
    a task with `revisit_at` is also tried with waiting until then.

    Parameters
    ----------
    score : what a visit is worth.
    max_paths : most paths to try before giving up.

    Raises
    ------
    InputError
        If the mission is too large, or has tasks for several agents or with prerequisites, where
        one agent's worth depends on the others.

    Examples
    --------
    >>> from swarmbid.scores import make_score
    >>> mission = Mission(
    ...     agents=(Agent(id="a", position=(0.0, 0.0, 0.0)),),
    ...     tasks=(Task(id="t", position=(3.0, 4.0, 0.0), reward=8.0),),
    ... )
    >>> optimum(mission, make_score("distance_cost"))
    OptimumResult(paths={'a': [('t', 5.0)]}, value=3.0, proven=True, num_paths=2)
    """
    _refuse_coupled(mission)
    choices: list[_Choice] = []
    tried = 0
    for agent in mission.agents:
        best: dict[frozenset[str], _Choice] = {}
        for path, value in _paths(mission, score, agent):
            tried += 1
            if tried > max_paths:
                raise InputError([_too_large(mission, max_paths)])
            key = frozenset(task_id for task_id, _ in path)
            if key not in best or value > best[key].value:
                best[key] = _Choice(agent.id, path, value)
        # A set that earns nothing is never better than staying where one is.
        choices += [choice for choice in best.values() if choice.value > 0.0]
    chosen, solved = _pack(choices)
    paths: dict[str, list[tuple[str, float]]] = {agent.id: [] for agent in mission.agents}
    for choice in chosen:
        paths[choice.agent] = list(choice.path)
    waiting = any(task.revisit_at is not None for task in mission.tasks)
    value = math.fsum(choice.value for choice in chosen)
    return OptimumResult(paths=paths, value=value, proven=solved and not waiting, num_paths=tried)


def _paths(
    mission: Mission, score: Score, agent: Agent
) -> Iterator[tuple[tuple[tuple[str, float], ...], float]]:
    """Yield every feasible path of `agent` with its value, the empty one first, depth first."""
    tasks = [task for task in mission.tasks if mission.can_do(agent, task)]
    limit = len(tasks) if agent.bundle_limit is None else min(agent.bundle_limit, len(tasks))
    most_metres = agent.range * (1.0 + _SLACK)
    latest = (agent.available_at + agent.endurance) * (1.0 + _SLACK)

    def extend(
        path: tuple[tuple[str, float], ...],
        used: frozenset[str],
        place: Position,
        departure: float,
        metres: float,
        value: float,
    ) -> Iterator[tuple[tuple[tuple[str, float], ...], float]]:
        back = mission.distance(place, agent.base) if path and agent.base is not None else 0.0
        if metres + back <= most_metres and departure + back / agent.speed <= latest:
            yield path, value
        # A path that cannot come back may still grow: rounded distances can make a detour shorter.
        if len(path) == limit or metres > most_metres or departure > latest:
            return
        for task in tasks:
            if task.id in used:
                continue
            leg = mission.distance(place, task.position)
            for start in _starts(task, departure + leg / agent.speed):
                worth = score.value(mission, agent, task, start, leg)
                yield from extend(
                    (*path, (task.id, start)),
                    used | {task.id},
                    task.position,
                    start + task.duration,
                    metres + leg,
                    value + worth,
                )

    yield from extend((), frozenset(), agent.position, agent.available_at, 0.0, 0.0)


def _starts(task: Task, arrival: float) -> Iterator[float]:
    """Yield the starts of service tried: at once, and at the scheduled time of a revisit."""
    earliest = max(arrival, task.start)
    if earliest <= task.end:
        yield earliest
        if task.revisit_at is not None and earliest < min(task.revisit_at, task.end):
            yield min(task.revisit_at, task.end)


def _pack(choices: list[_Choice]) -> tuple[list[_Choice], bool]:
    """Choose at most one choice per agent and per task for the largest sum; and whether it is proven."""
    if not choices:
        return [], True
    # SciPy takes 0.2 s to import and only this function needs it.
    import numpy as np
    from scipy.optimize import Bounds, LinearConstraint, milp
    from scipy.sparse import csr_array

    rows: dict[tuple[str, str], int] = {}
    entries: list[tuple[int, int]] = []
    for column, choice in enumerate(choices):
        for key in [("agent", choice.agent), *(("task", task_id) for task_id, _ in choice.path)]:
            entries.append((rows.setdefault(key, len(rows)), column))
    where = np.array(entries).T
    matrix = csr_array((np.ones(len(entries)), (where[0], where[1])), shape=(len(rows), len(choices)))
    result = milp(
        c=[-choice.value for choice in choices],
        integrality=np.ones(len(choices)),
        bounds=Bounds(0, 1),
        constraints=LinearConstraint(matrix, ub=np.ones(len(rows))),
        # The solver's default stops within 0.01 % of the optimum.
        options={"mip_rel_gap": 0.0},
    )
    if result.x is None:
        return [], False
    chosen = [choice for choice, taken in zip(choices, result.x, strict=True) if taken > 0.5]
    return chosen, result.status == 0


def _refuse_coupled(mission: Mission) -> None:
    faults = []
    for task in mission.tasks:
        for name, coupled, why in (
            ("agents_required", task.is_group, f"is {task.agents_required}"),
            ("prerequisites", bool(task.prerequisites), f"are {', '.join(task.prerequisites)}"),
        ):
            if coupled:
                mend = "This takes tasks that one agent does on its own; coalition_optimum takes the others."
                faults.append(Fault(f"task {task.id}", name, why, mend))
    if faults:
        raise InputError(faults)


def _too_large(mission: Mission, max_paths: int) -> Fault:
    most = 0.0
    for agent in mission.agents:
        able = sum(1 for task in mission.tasks if mission.can_do(agent, task))
        limit = able if agent.bundle_limit is None else min(agent.bundle_limit, able)
        orders = 1.0  # of the tasks taken so far; floats, for the true number may have thousands of digits
        for taken in range(limit + 1):
            most += orders
            orders *= able - taken
    count = f"{most:,.0f}" if most < 1e15 else f"{most:.1e}" if math.isfinite(most) else "over 1e308"
    return Fault(
        f"mission {mission.name}",
        "",
        f"is too large for the exact optimum: more than {max_paths:,} feasible paths, {count} without limits",
        "Give fewer tasks, smaller bundle limits or tighter windows, or raise max_paths.",
    )
