"""What CBGA's referee has to know of a mission, as arrays that all agents of a process share."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from swarmbid.arrays import MissionArrays, RowArray
from swarmbid.kernels.joint import NEVER, Terms
from swarmbid.model import Mission, Task
from swarmbid.scores import Score

MOST_EQUIPMENT = 16
"""Most different pieces that one task may need: for each set of them some bytes are kept."""


def make_terms(arrays: MissionArrays, score: Score) -> Terms:
    """Return the terms of a mission with everybody on the roster and nothing barred."""
    return arrays.shared(("terms", score), lambda: _make(arrays, score))


def too_much_equipment(mission: Mission) -> list[str]:
    """Return ids of tasks that need more different pieces than the referee can keep."""
    return [task.id for task in mission.tasks if len(task.equipment) > MOST_EQUIPMENT]


def cover_of(
    arrays: MissionArrays, present: NDArray[np.bool_]
) -> tuple[NDArray[np.uint8], RowArray, RowArray]:
    """Return `Terms.cover`, `Terms.spare` and `Terms.cover_at`: who can bring which parts of each need.

    Parameters
    ----------
    present : bool[num_agents], who is on the roster.
    """
    parts, spares = [], []
    begins = []
    begin = 0
    for need, task_type in _kinds(arrays):
        carried = {
            _bits(need, agent.equipment)
            for row, agent in enumerate(arrays.agents)
            if present[row] and _may(arrays.mission, agent.type, task_type)
        }
        fewest = np.full(1 << len(need), NEVER, np.uint8)
        fewest[0] = 0
        for wanted in range(1, fewest.size):
            left = [int(fewest[wanted & ~one]) for one in sorted(carried) if wanted & one]
            fewest[wanted] = min(min(left, default=NEVER) + 1, NEVER)
        parts.append(fewest)
        spare = np.zeros(fewest.size, np.int64)
        for one in sorted(carried):
            spare[np.arange(fewest.size) & one == 0] |= one
        spares.append(spare)
        begins.append(begin)
        begin += fewest.size
    return (
        np.concatenate([*parts, np.zeros(0, np.uint8)]),
        np.concatenate([*spares, np.zeros(0, np.int64)]),
        np.array(begins, np.int64),
    )


def _make(arrays: MissionArrays, score: Score) -> Terms:
    mission, tasks, agents = arrays.mission, arrays.tasks, arrays.agents
    kinds = _kinds(arrays)
    kind_of = {kind: row for row, kind in enumerate(kinds)}
    slots = [task.agents_required or len(task.equipment) for task in tasks]
    slot_at = np.concatenate([[0], np.cumsum(slots, dtype=np.int64)]).astype(np.int64)
    needs = [[arrays.task_row[name] for name in task.prerequisites] for task in tasks]
    later: list[list[int]] = [[] for _ in tasks]
    for row, rows in enumerate(needs):
        for need in rows:
            later[need].append(row)
    cover, spare, cover_at = cover_of(arrays, np.ones(len(agents), np.bool_))
    types = sorted({agent.type for agent in agents})
    may = {name: np.array([_may(mission, name, task.type) for task in tasks], np.bool_) for name in types}
    return Terms(
        tasks=arrays.value_table(score, lambda table: score.fill(table, arrays)),
        agents=np.array(
            [arrays.agent_vector(agent, score.cost_per_metre(agent)) for agent in agents], np.float64
        ),
        limits=np.array([arrays.bundle_limit(agent) for agent in agents], np.int64),
        seats=np.array([task.agents_required for task in tasks], np.int64),
        slot_at=slot_at,
        slot_task=np.repeat(np.arange(len(tasks)), slots).astype(np.int64),
        stage=_stages(needs),
        kind=np.array([kind_of[_kind(task)] for task in tasks], np.int64),
        full=np.array([(1 << len(need)) - 1 for need, _ in kinds], np.int64),
        brings=np.array(
            [[_bits(need, agent.equipment) for agent in agents] for need, _ in kinds], np.int64
        ).reshape(len(kinds), len(agents)),
        cover=cover,
        spare=spare,
        cover_at=cover_at,
        allowed=np.array([may[agent.type] for agent in agents], np.bool_).reshape(len(agents), len(tasks)),
        need_at=_begins(needs),
        needs=_joined(needs),
        later_at=_begins(later),
        later=_joined(later),
    )


def _kind(task: Task) -> tuple[tuple[str, ...], str]:
    return tuple(sorted(task.equipment)), task.type


def _kinds(arrays: MissionArrays) -> list[tuple[tuple[str, ...], str]]:
    return sorted({_kind(task) for task in arrays.tasks})


def _bits(need: tuple[str, ...], equipment: Iterable[str]) -> int:
    carried = frozenset(equipment)
    return sum(1 << bit for bit, name in enumerate(need) if name in carried)


def _may(mission: Mission, agent_type: str, task_type: str) -> bool:
    allowed = mission.compatible.get(agent_type)
    return allowed is None or task_type in allowed


def _stages(needs: list[list[int]]) -> RowArray:
    """Longest chain of prerequisites before each task; missions have no circles."""
    stages = np.zeros(len(needs), np.int64)
    waiting = [len(rows) for rows in needs]
    later: list[list[int]] = [[] for _ in needs]
    for row, rows in enumerate(needs):
        for need in rows:
            later[need].append(row)
    ready = [row for row, count in enumerate(waiting) if count == 0]
    while ready:
        row = ready.pop()
        for after in later[row]:
            stages[after] = max(stages[after], stages[row] + 1)
            waiting[after] -= 1
            if waiting[after] == 0:
                ready.append(after)
    return stages


def _begins(lists: list[list[int]]) -> RowArray:
    return np.concatenate([[0], np.cumsum([len(rows) for rows in lists], dtype=np.int64)]).astype(np.int64)


def _joined(lists: list[list[int]]) -> RowArray:
    return np.array([row for rows in lists for row in rows], np.int64)
