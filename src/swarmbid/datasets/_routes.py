"""A benchmark's own judge: follow given routes by the benchmark's rules, and say when everybody is home.

It knows nothing of missions, plans or scores: a route is a list of task numbers, and the only rules are
that robots go on as soon as they are done, that a task starts when everybody who goes there has arrived
and what comes before it has ended, and that all stay until it ends.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

Travel = Callable[[int, int | None, int | None], float]
"""Robot, from task, to task -> how long it takes; None is the start (from) or the end (to)."""


@dataclass(frozen=True)
class Replay:
    """What came of following the routes; times in the benchmark's unit.

    Parameters
    ----------
    makespan : when the last robot is at the end.
    starts : task number -> when it starts, of those that do.
    crews : task number -> who goes there, by number from 0.
    problems : what is against the rules, in words; empty if nothing is.
    """

    makespan: float
    starts: dict[int, float]
    crews: dict[int, tuple[int, ...]]
    problems: tuple[str, ...]


def follow(
    routes: Sequence[Sequence[int]],
    durations: Mapping[int, float],
    travel: Travel,
    before: Mapping[int, Sequence[int]],
) -> Replay:
    """Let every robot follow its route.

    Parameters
    ----------
    routes : for each robot the tasks that it goes to, in order.
    durations : task number -> how long it takes; all tasks there are.
    before : task number -> the tasks that have to end first.
    """
    problems = []
    crews: dict[int, list[int]] = {}
    for robot, route in enumerate(routes):
        for task in route:
            if task not in durations:
                problems.append(f"robot {robot + 1} goes to {task}, which is no task")
            crews.setdefault(task, []).append(robot)
        if len(set(route)) < len(route):
            problems.append(f"robot {robot + 1} goes to a task twice")
    problems += [f"nobody goes to task {task}" for task in durations if task not in crews]
    found = {task: tuple(crew) for task, crew in crews.items()}
    if any("no task" in problem or "twice" in problem for problem in problems):
        return Replay(float("inf"), {}, found, tuple(problems))

    done = [0] * len(routes)  # stops of each route that are behind the robot
    free = [0.0] * len(routes)
    starts: dict[int, float] = {}
    while True:
        ready = [
            task
            for task, crew in crews.items()
            if task not in starts
            and all(done[robot] < len(routes[robot]) and routes[robot][done[robot]] == task for robot in crew)
            and all(first in starts for first in before.get(task, ()))
        ]
        if not ready:
            break
        for task in ready:
            arrivals = [
                free[robot] + travel(robot, routes[robot][done[robot] - 1] if done[robot] else None, task)
                for robot in crews[task]
            ]
            ends = [starts[first] + durations[first] for first in before.get(task, ())]
            starts[task] = max(arrivals + ends)
            for robot in crews[task]:
                free[robot] = starts[task] + durations[task]
                done[robot] += 1
    waiting = [robot for robot, route in enumerate(routes) if done[robot] < len(route)]
    problems += [
        f"robot {robot + 1} waits at task {routes[robot][done[robot]]} for ever" for robot in waiting
    ]
    home = [
        free[robot] + travel(robot, route[-1] if route else None, None)
        for robot, route in enumerate(routes)
        if not waiting
    ]
    return Replay(max(home, default=float("inf")), starts, found, tuple(problems))
