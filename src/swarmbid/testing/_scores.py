"""What every score must do (`swarmbid.scores`): words, numbers and promises that agree."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

from swarmbid.algorithms.cbba import CBBA
from swarmbid.model import Agent, Mission, Task
from swarmbid.negotiator import TaskTaken
from swarmbid.plan import make_plan
from swarmbid.rng import stream
from swarmbid.scores import INSERTIONS, Score, make_score
from swarmbid.simulator import simulate
from swarmbid.testing._team import Broken, Check
from swarmbid.verify import verify

NEAR = 1e-9
"""Relative difference (absolute below 1) that is put down to rounding."""

Path = list[tuple[Task, float]]


def describes_itself(score: Score) -> None:
    if score.insertion not in INSERTIONS:
        raise Broken(f"its insertion rule is {score.insertion!r}, none of {', '.join(INSERTIONS)}")
    if hash(score) != hash(replace(score)) or score != replace(score):
        raise Broken("it is not equal to its own copy")
    if not score.name or not isinstance(score.options, dict):
        raise Broken("it has no name, or its options are no dictionary")
    if score.visit_function() is None and type(score).__module__.startswith("swarmbid.scores."):
        again = make_score(score.name, **score.options)
        if again != score:
            raise Broken(f"make_score({score.name!r}, **options) gives {again!r}")
    if score.honest().honest() != score.honest():
        raise Broken("the honest form of its honest form is another score")


def is_finite(score: Score) -> None:
    mission = _mission(1)
    for agent, task in itertools.product(mission.agents, mission.tasks):
        late = min(task.end, 1e6)
        for start, leg in itertools.product((task.start, 0.5 * (task.start + late), late), (0.0, 1.0, 1e5)):
            value = score.value(mission, agent, task, start, leg)
            if not isinstance(value, float) or not math.isfinite(value):
                raise Broken(f"a visit to {task.id} at {start:g} s after {leg:g} m is worth {value!r}")


def kernel_agrees(score: Score) -> None:
    """Single visits, then whole paths: what the compiled kernel bids is what `value` says."""
    for seed in range(4):
        mission = _mission(seed)
        for agent, task in itertools.product(mission.agents, mission.tasks):
            _compare(score, replace(mission, agents=(agent,), tasks=(task,)))
        for rule in INSERTIONS:
            _compare(score, replace(mission, agents=mission.agents[:1]), rule)


def _compare(score: Score, mission: Mission, rule: str = "hold") -> None:
    agent = mission.agents[0]
    one = CBBA(agent.id, mission, score, insertion=rule, warp=False)
    one.tick(0.0)
    bids = {event.task: event.bid for event in one.events() if isinstance(event, TaskTaken)}
    worth = make_plan(mission, {agent.id: one.path}, score, "cbba", rule).total_score
    bid = math.fsum(bids.values())
    where = f"{len(bids)} visits by {rule}" if len(mission.tasks) > 1 else f"a visit to {mission.tasks[0].id}"
    if not math.isclose(bid, worth, rel_tol=NEAR, abs_tol=NEAR * max(1.0, len(bids))):
        raise Broken(f"the kernel bids {bid:.12g} for {where}, by value() it is worth {worth:.12g}")
    if len(mission.tasks) == 1 and not bids:
        timed = _timed(mission, agent, [(mission.tasks[0], math.nan)])
        if timed and _worth(mission, agent, score, timed) > NEAR:
            expected = _worth(mission, agent, score, timed)
            raise Broken(f"the kernel does not bid on {where}, by value() it is worth {expected:.12g}")


def keeps_its_promise(score: Score) -> None:
    for rule in INSERTIONS:
        if score.diminishing(rule):
            for seed in range(12):
                _check_diminishing(score, _mission(seed), rule, seed)


def _check_diminishing(score: Score, mission: Mission, rule: str, seed: int) -> None:
    rng = stream(seed, "prefixes")
    agent = mission.agents[seed % len(mission.agents)]
    path: Path = []
    left = list(mission.tasks)
    known = {task.id: math.inf for task in left}
    while left:
        gains = {task.id: _best(mission, agent, score, path, task, rule) for task in left}
        for task in left:
            gain = gains[task.id][0]
            if gain > known[task.id] + NEAR * max(1.0, abs(gain)):
                names = ", ".join(visited.id for visited, _ in path)
                raise Broken(
                    f"diminishing({rule!r}) says True, but {task.id} gains {gain:.9g} for {agent.id} with "
                    f"{names} in the path, and {known[task.id]:.9g} with one of them less"
                )
            known[task.id] = gain
        chosen = left.pop(int(rng.integers(len(left))))
        path = gains[chosen.id][1] or path


def _best(
    mission: Mission, agent: Agent, score: Score, path: Path, task: Task, rule: str
) -> tuple[float, Path | None]:
    """The largest gain of inserting `task`, by definition, and the path with it."""
    best: tuple[float, Path | None] = (-math.inf, None)
    before = _worth(mission, agent, score, path)
    kept = path if rule == "hold" else [(visited, math.nan) for visited, _ in path]
    for place in range(len(path) if rule == "append" else 0, len(path) + 1):
        timed = _timed(mission, agent, [*kept[:place], (task, math.nan), *kept[place:]])
        if timed is not None:
            gain = _worth(mission, agent, score, timed) - before
            best = max(best, (gain, timed), key=lambda found: found[0])
    return best


def _timed(mission: Mission, agent: Agent, path: Path) -> Path | None:
    """The path with times: those promised are kept, the others (NaN) as early as can be; None if it fails."""
    place, free = agent.position, agent.available_at
    timed: Path = []
    for task, promised in path:
        arrival = max(free + mission.distance(place, task.position) / agent.speed, task.start)
        start = arrival if math.isnan(promised) else promised
        if start < arrival or start > task.end:
            return None
        timed.append((task, start))
        place, free = task.position, start + task.duration
    return timed


def _worth(mission: Mission, agent: Agent, score: Score, path: Path) -> float:
    worth, place = 0.0, agent.position
    for task, start in path:
        worth += score.value(mission, agent, task, start, mission.distance(place, task.position))
        place = task.position
    return worth


def plans(score: Score) -> None:
    for seed in range(3):
        run = simulate(_mission(seed), score=score)
        if not run.converged:
            raise Broken(f"CBBA does not converge with it: {run.reason}")
        for violation in verify(run.mission, run.plan, score):
            raise Broken(f"a plan made by it is not in order: {violation}")


def _mission(seed: int, agents: int = 2, tasks: int = 7) -> Mission:
    """Windows on half of the tasks, a scheduled time on half, fuel, decay: something for every score."""
    rng = stream(seed, "score-mission")

    def draw(low: float, high: float, size: int) -> list[float]:
        return [float(number) for number in rng.uniform(low, high, size)]

    places = [(float(x), float(y), float(z)) for x, y, z in rng.uniform(0.0, 60.0, (agents + tasks, 3))]
    opens, rewards, decays = draw(0.0, 80.0, tasks), draw(30.0, 90.0, tasks), draw(0.0, 0.02, tasks)
    durations, free, fuels = draw(0.0, 10.0, tasks), draw(0.0, 20.0, agents), draw(0.0, 0.3, agents)
    windowed, peaked = rng.random(tasks) < 0.5, rng.random(tasks) < 0.5
    return Mission(
        name=f"score-{seed}",
        agents=tuple(
            Agent(
                id=f"a{row}",
                position=places[row],
                speed=1.5,
                available_at=free[row],
                fuel_per_metre=fuels[row],
            )
            for row in range(agents)
        ),
        tasks=tuple(
            Task(
                id=f"t{row}",
                position=places[agents + row],
                reward=rewards[row],
                duration=durations[row],
                discount=decays[row],
                start=opens[row] if windowed[row] else 0.0,
                end=opens[row] + 60.0 if windowed[row] else math.inf,
                revisit_at=opens[row] + 30.0 if peaked[row] else None,
                revisit_width=40.0,
            )
            for row in range(tasks)
        ),
    )


CHECKS = (
    Check("describes_itself", "A score is a frozen dataclass: its name and options make it again, so that a "
          "trace can be replayed; its insertion rule is a known one.", describes_itself),
    Check("is_finite", "value() returns a finite float for every visit within the window, near or far, early "
          "or late. A bid that is no number cannot be compared.", is_finite),
    Check("kernel_agrees", "value() is the definition; fill(), cost_per_metre() and fixed() say the same in "
          "coefficients. Agents bid by the second, plans are checked by the first.", kernel_agrees),
    Check("keeps_its_promise", "diminishing(rule) is True only if no gain ever rises as tasks are added: the "
          "theorems of CBBA rest on it. Return False if in doubt; bids are then warped.",
          keeps_its_promise),
    Check("plans", "With it a team agrees, and the plan is in order.", plans),
)  # fmt: skip
