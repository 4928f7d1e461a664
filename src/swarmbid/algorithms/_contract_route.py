"""What one agent is committed to, in order of visit, and what another task would gain it.

A sibling of `Bundle`: the same kernel, the same rules, but tasks come and go one by one, by contracts,
and nothing is ever rebuilt. Whatever has been started is no longer part of it.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from swarmbid.arrays import (
    AGENT_X,
    AGENT_Z,
    AVAILABLE,
    BASE_X,
    BASE_Z,
    DURATION,
    END,
    HAS_BASE,
    LATEST_RETURN,
    RANGE,
    SLOWNESS,
    FloatArray,
    MissionArrays,
    X,
    Z,
)
from swarmbid.kernels.insertion import APPEND, HOLD, SHIFT, evaluate, first_position, path_state
from swarmbid.kernels.lanes import BLOCK
from swarmbid.model import Position, Task, distance
from swarmbid.scores import Score

RULES = {"hold": HOLD, "shift": SHIFT, "append": APPEND}
SPARE = 64
"""Tasks that are over are cleared away when there are this many more of them than live ones."""


class Route:
    """The tasks that an agent has promised to do.

    Parameters
    ----------
    arrays : of the mission. me : row of the agent. rule : "hold", "shift" or "append".

    Attributes
    ----------
    version : counts every change that may change a gain.
    """

    def __init__(self, arrays: MissionArrays, me: int, score: Score, rule: str) -> None:
        self.me = me
        self.score = score
        self.rule = RULES[rule]
        self.version = 0
        self._agent = arrays.agents[me]
        self._path: list[str] = []
        self._promised: list[float] = []
        self._vector = arrays.agent_vector(self._agent, score.cost_per_metre(self._agent))
        self._use(arrays)

    def _use(self, arrays: MissionArrays) -> None:
        self.arrays = arrays
        score = self.score
        self._table = arrays.task_table(self._agent, score, lambda table: score.fill(table, arrays))
        fixed = score.fixed(arrays, self._agent)
        self._fixed: FloatArray = np.zeros(arrays.num_tasks) if fixed is None else fixed
        self._measured = -1

    def know(self, tasks: Iterable[Task], live: Iterable[str]) -> None:
        """Make new tasks known; those that are not in `live` may be cleared away."""
        wanted = set(live) | set(self._path)
        old = self.arrays.mission.tasks
        kept = [task for task in old if task.id in wanted]
        if len(old) - len(kept) < SPARE:
            kept = list(old)
        self._use(MissionArrays(replace(self.arrays.mission, tasks=(*kept, *tasks))))

    def knows(self, task_id: str) -> bool:
        """Whether bids can be counted for a task."""
        return task_id in self.arrays.task_row

    @property
    def path(self) -> list[tuple[str, float]]:
        """Task ids in order of visit with starts of service, s."""
        self._measure()
        return list(zip(self._path, self._starts.tolist(), strict=False))

    def __len__(self) -> int:
        return len(self._path)

    def place_of(self, task_id: str) -> int:
        """Where in the path a task stands."""
        return self._path.index(task_id)

    def __contains__(self, task_id: str) -> bool:
        return task_id in self._path

    def insert(self, task_id: str, place: int, start: float) -> None:
        """Promise a task."""
        self._path.insert(place, task_id)
        self._promised.insert(place, start)
        self._change()

    def remove(self, task_id: str) -> None:
        """Give a task up, or begin it."""
        if task_id in self._path:
            place = self._path.index(task_id)
            del self._path[place], self._promised[place]
            self._change()

    def clear(self) -> None:
        """Give everything up."""
        self._path.clear()
        self._promised.clear()
        self._change()

    def move(self, position: Position, free_at: float) -> None:
        """Count from `position` (m) and `free_at` (s) on; what was flown to it is spent."""
        here = self._vector[AGENT_X : AGENT_Z + 1]
        self._vector[RANGE] -= distance((float(here[0]), float(here[1]), float(here[2])), position)
        self._vector[AGENT_X : AGENT_Z + 1] = position
        self._vector[AVAILABLE] = free_at
        if self.rule == HOLD:  # promises were counted from elsewhere: the earliest that can be kept now
            self._promised = self._earliest()
        self._change()

    def wait_until(self, now: float) -> None:
        """An agent that has nothing to do is where it was, and cannot begin in the past."""
        if not self._path and self._vector[AVAILABLE] < now:
            self._vector[AVAILABLE] = now
            self._change()

    def _change(self) -> None:
        self.version += 1

    def _rows(self) -> NDArray[np.int64]:
        return np.array([self.arrays.task_row[name] for name in self._path], np.int64)

    def _measure(self) -> None:
        if self._measured == self.version:
            return
        self._measured = self.version
        length = len(self._path)
        self._row_path = self._rows()
        self._starts, self._legs, self._values = np.empty(length), np.empty(length), np.empty(length)
        self._total = path_state(
            self._table, self._vector, self._row_path, length, np.array(self._promised), self.rule,
            self._starts, self._legs, self._values,
        )  # fmt: skip

    def _earliest(self) -> list[float]:
        length = len(self._path)
        starts = np.empty(length)
        path_state(
            self._table, self._vector, self._rows(), length, np.zeros(length), SHIFT,
            starts, np.empty(length), np.empty(length),
        )  # fmt: skip
        earliest: list[float] = starts.tolist()
        return earliest

    def gains(self, task_ids: list[str]) -> tuple[list[float], list[int], list[float]]:
        """Gain, place and start of the best insertion of each task; -inf where it fits nowhere."""
        return self._gains(task_ids, self._vector)

    def _gains(self, task_ids: list[str], vector: FloatArray) -> tuple[list[float], list[int], list[float]]:
        self._measure()
        columns = np.array([self.arrays.task_row[name] for name in task_ids], np.int64)
        gain, start = np.empty(columns.size), np.empty(columns.size)
        place = np.empty(columns.size, np.int64)
        length = len(self._path)
        for begin in range(0, columns.size, BLOCK):
            part = slice(begin, min(begin + BLOCK, columns.size))
            evaluate(
                self._table, columns[part], part.stop - begin, vector, self._row_path, length, self._starts,
                self._legs, self._values, self._total, self.rule, first_position(self.rule, length), length,
                gain[part], place[part], start[part],
            )  # fmt: skip
        gain -= self._fixed[columns]
        return gain.tolist(), place.tolist(), start.tolist()

    @property
    def worth(self) -> float:
        """Score of what is promised."""
        self._measure()
        fixed = self._fixed[self._row_path].sum() if self._path else 0.0
        return float(self._values.sum() - fixed)

    def worth_of(self, task_ids: list[str]) -> float:
        """Score of another path flown from here instead; -inf if the agent cannot fly it."""
        if not all(self.knows(name) for name in task_ids):
            return -math.inf
        other = Route(self.arrays, self.me, self.score, "shift")
        other._vector[:] = self._vector
        other._path, other._promised = list(task_ids), [0.0] * len(task_ids)
        other._change()
        return -math.inf if other.overdue() else other.worth

    def refusal(self, task_id: str) -> str:
        """Return why the agent cannot do a task with what it is committed to (`REFUSALS`)."""
        task = self.arrays.tasks[self.arrays.task_row[task_id]]
        mission = self.arrays.mission
        allowed = mission.compatible.get(self._agent.type)
        if allowed is not None and task.type not in allowed:
            return "unauthorised"
        if not mission.can_do(self._agent, task):
            return "no_equipment"
        far = self._vector.copy()
        far[RANGE] = far[LATEST_RETURN] = math.inf
        if self._gains([task_id], far)[0][0] > 0.0:
            return "no_fuel"
        direct = Route(self.arrays, self.me, self.score, "shift")
        direct._vector[:] = far
        alone = direct.gains([task_id])[0][0]
        if alone == -math.inf:
            return "too_late"
        return "busy" if alone > 0.0 and self._path else "no_fuel"

    def overdue(self) -> list[str]:
        """Promises that cannot be kept any more, the latest visits first; they are not removed."""
        given_up: list[str] = []
        path, promised = list(self._path), list(self._promised)
        while self._path:
            self._change()
            self._measure()
            late = np.flatnonzero(self._starts > self._table[END, self._row_path])
            if late.size:
                place = int(late[0])
            elif self._beyond_range():
                place = len(self._path) - 1
            else:
                break
            given_up.append(self._path[place])
            del self._path[place], self._promised[place]
        self._path, self._promised = path, promised
        self._change()
        return given_up

    def _beyond_range(self) -> bool:
        last, vector = self._row_path[-1], self._vector
        free = float(self._starts[-1] + self._table[DURATION, last])
        home = 0.0
        if vector[HAS_BASE] > 0.0:
            place = tuple(float(one) for one in self._table[X : Z + 1, last])
            base = tuple(float(one) for one in vector[BASE_X : BASE_Z + 1])
            home = self.arrays.mission.distance(place, base)  # type: ignore[arg-type]
        # A promise was made within the bounds: only more than rounding breaks it.
        return bool(
            self._total + home > vector[RANGE] * (1.0 + 1e-9) + 1e-6
            or free + home * vector[SLOWNESS] > vector[LATEST_RETURN] * (1.0 + 1e-9) + 1e-6
        )
