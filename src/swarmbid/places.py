"""Where one more task would fit into finished paths, and what that would gain, by plain code.

The gain is that of the agent's own path; where tasks are coupled, by groups or prerequisites, a place is
one only if the starts of everybody, worked out anew, still keep every window.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING

from swarmbid.model import Agent, Mission, Position, Task
from swarmbid.timing import Path, flight, joint_starts

if TYPE_CHECKING:
    from swarmbid.scores import Score

SLACK = 1e-9
"""Relative rounding allowed when a sum of legs or times just meets a limit."""


class OutOfSteps(Exception):
    """There are more places to try than was allowed."""


class Places:
    """Finished paths, into which one more task may fit.

    Parameters
    ----------
    paths : agent id -> its path; agents without one are idle.
    score : what a visit is worth.
    insertion : ``"hold"``, ``"shift"`` or ``"append"``: which places of a path are tried.
    steps : most flights and path steps tried before `OutOfSteps`.
    """

    def __init__(
        self, mission: Mission, paths: Mapping[str, Path], score: Score, *, insertion: str, steps: int
    ) -> None:
        self.mission, self.score, self.insertion, self.steps = mission, score, insertion, steps
        self.agents = sorted(mission.agents, key=lambda agent: agent.id.encode())
        self.paths = {agent.id: list(paths.get(agent.id, ())) for agent in self.agents}
        self.starts: dict[str, float] = {}
        self.ends: dict[str, float] = {}
        for path in self.paths.values():
            for task, start in path:
                self.starts[task.id] = max(self.starts.get(task.id, -math.inf), start)
                self.ends[task.id] = self.starts[task.id] + task.duration
        self.worths = {agent.id: self.worth(agent, self.paths[agent.id]) for agent in self.agents}
        self.coupled = any(task.is_group or task.prerequisites for task in mission.tasks)
        self.visits = sum(len(path) for path in self.paths.values())

    def spend(self, steps: int) -> None:
        """Count steps off what may be tried."""
        self.steps -= steps
        if self.steps < 0:
            raise OutOfSteps

    def lateness(self, agent: Agent, task: Task) -> float:
        """Seconds by which `agent`, going straight there, misses the window; 0 or less if it does not."""
        self.spend(1)
        travel = self.mission.distance(agent.position, task.position) / agent.speed
        late = agent.available_at + travel - task.end
        return 0.0 if 0.0 < late <= SLACK * max(1.0, task.end) else late

    def reaches(self, agent: Agent, task: Task) -> bool:
        """Whether `agent` can do `task` and come back, doing nothing else."""
        if self.lateness(agent, task) > 0.0:
            return False
        metres, finish = self.trip(agent, task)
        return self.fits(agent, metres, finish)

    def trip(self, agent: Agent, task: Task) -> tuple[float, float]:
        """Metres and time of being done, s, if `agent` does `task` and nothing else."""
        travel = self.mission.distance(agent.position, task.position) / agent.speed
        return flight(self.mission, agent, [(task, max(agent.available_at + travel, task.start))])

    def fits(self, agent: Agent, metres: float, finish: float) -> bool:
        """Whether a flight keeps the agent's range and endurance."""
        latest = agent.available_at + agent.endurance
        return metres <= agent.range * (1.0 + SLACK) and finish <= latest * (1.0 + SLACK)

    def best(self, agent: Agent, task: Task) -> tuple[float, int] | None:
        """Gain and position of the best place for `task` in the agent's path; None if there is none."""
        found: tuple[float, int] | None = None
        for position, trial in self.trials(agent, task):
            gain = self.worth(agent, trial) - self.worths[agent.id]
            if (found is None or gain > found[0]) and self.suits_all(agent, trial):
                found = gain, position
        return found

    def trials(self, agent: Agent, task: Task) -> Iterator[tuple[int, Path]]:
        """Yield every path with `task` added that the agent itself can fly, by the rule of `insertion`."""
        path = self.paths[agent.id]
        insert = self.held if self.insertion == "hold" else self.shifted
        for position in range(len(path) if self.insertion == "append" else 0, len(path) + 1):
            self.spend(len(path) + 1)
            trial = insert(agent, path, task, position)
            if trial is not None and self.fits(agent, *flight(self.mission, agent, trial)):
                yield position, trial

    def held(self, agent: Agent, path: Path, task: Task, position: int) -> Path | None:
        """Insert between promised times that do not move."""
        place, departure = self.left(agent, path[:position])
        latest = task.end
        if position < len(path):
            after, promised = path[position]
            travel = self.mission.distance(task.position, after.position) / agent.speed
            latest = min(latest, promised - task.duration - travel)
        start = self.start(agent, place, departure, task, latest)
        if start > latest:
            return None
        return [*path[:position], (task, start), *path[position:]]

    def shifted(self, agent: Agent, path: Path, task: Task, position: int) -> Path | None:
        """Insert and let later visits slip, as long as every window holds."""
        trial = path[:position]
        for step in (task, *(later for later, _ in path[position:])):
            place, departure = self.left(agent, trial)
            start = self.start(agent, place, departure, step, step.end)
            if start > step.end:
                return None
            trial.append((step, start))
        return trial

    def left(self, agent: Agent, path: Path) -> tuple[Position, float]:
        """Where and when, s, `agent` is free after `path`."""
        if not path:
            return agent.position, agent.available_at
        task, start = path[-1]
        return task.position, start + task.duration

    def floor(self, task: Task) -> float:
        """Seconds before which `task` cannot start, for its window, its group or what comes first."""
        if not self.coupled:
            return task.start
        ends = [self.ends[need] for need in task.prerequisites if need in self.ends]
        return max([task.start, self.starts.get(task.id, 0.0), *ends])

    def start(self, agent: Agent, place: Position, departure: float, task: Task, latest: float) -> float:
        """As early as possible, or at the scheduled time of a repeated visit if that is worth more."""
        leg = self.mission.distance(place, task.position)
        earliest = max(departure + leg / agent.speed, self.floor(task))
        if task.revisit_at is None:
            return earliest
        waited = max(earliest, min(task.revisit_at, latest))
        gain = self.score.value(self.mission, agent, task, waited, leg)
        return waited if gain > self.score.value(self.mission, agent, task, earliest, leg) else earliest

    def worth(self, agent: Agent, path: Path) -> float:
        """Score units of one agent's path."""
        total, place = 0.0, agent.position
        for task, start in path:
            leg = self.mission.distance(place, task.position)
            total += self.score.value(self.mission, agent, task, start, leg)
            place = task.position
        return total

    def worth_alone(self, agent: Agent, task: Task) -> float:
        """Score units of `task` to an agent that does nothing else."""
        start = self.start(agent, agent.position, agent.available_at, task, task.end)
        return self.worth(agent, [(task, start)])

    def suits_all(self, agent: Agent, trial: Path) -> bool:
        """Whether everybody's windows and endurance still hold when `agent` flies `trial`."""
        if not self.coupled or self.insertion == "hold":
            return True
        self.spend(self.visits + 1)
        orders = {one: [task.id for task, _ in path] for one, path in self.paths.items()}
        orders[agent.id] = [task.id for task, _ in trial]
        # Nothing starts earlier for one task more, and what waits for a time of its own goes on waiting.
        ready = {task.id: start for task, start in trial} | self.starts
        starts = joint_starts(self.mission, orders, ready)
        if starts is None:
            return False
        paths = self.paths | {agent.id: trial}
        for one in self.agents:
            path = [(task, starts[task.id]) for task, _ in paths[one.id]]
            if any(start > task.end + SLACK * max(1.0, task.end) for task, start in path):
                return False
            if not self.fits(one, *flight(self.mission, one, path)):
                return False
        return True
