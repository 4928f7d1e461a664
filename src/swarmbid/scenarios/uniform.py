"""Agents and tasks spread evenly over a square.

Every attribute is drawn from a stream of its own: switching on windows leaves the positions where
they were, and asking for more tasks keeps the first ones.

Examples
--------
>>> from swarmbid.scenarios import uniform
>>> mission = uniform.make(seed=7, agents=3, tasks=10, reward_min=50.0, reward_max=100.0)
>>> [agent.id for agent in mission.agents]
['a000', 'a001', 'a002']
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from swarmbid.arrays import FloatArray
from swarmbid.errors import Fault, InputError
from swarmbid.model import Agent, Mission, Position, Task
from swarmbid.network import connected_positions, positions_with_mean_degree
from swarmbid.rng import stream
from swarmbid.scenarios._options import chosen, option


@dataclass(frozen=True, kw_only=True)
class Options:
    """What `make` understands; each field tells its meaning and unit in ``metadata["help"]``."""

    agents: int = option(20, "how many agents, 1 or more")
    tasks: int = option(100, "how many tasks")
    width: float = option(1000.0, "side of the square, m")
    height: float = option(0.0, "tasks lie from 0 to this height, m")
    grid: int = option(0, "put everything on a grid of so many positions a side, for ties; 0 for anywhere")
    speed: float = option(10.0, "speed of every agent, m/s")
    fuel_per_metre: float = option(0.0, "score lost per m flown")
    bundle_limit: int = option(10, "most tasks an agent takes at once; 0 for no limit")
    reward_min: float = option(10.0, "lowest reward, score")
    reward_max: float = option(100.0, "highest reward, score; equal to reward_min for ties")
    discount: float = option(0.01, "how fast rewards fade, 1/s")
    duration_min: float = option(0.0, "shortest service, s")
    duration_max: float = option(0.0, "longest service, s")
    horizon: float = option(0.0, "windows open from 0 to this time, s")
    window_min: float = option(0.0, "shortest window, s")
    window_max: float = option(0.0, "longest window, s; 0 for windows that never close")
    types: int = option(1, "how many types of tasks, each done only by agents of its own type")
    communication_range: float = option(0.0, "place agents so that this range connects them, m; 0 for not")
    mean_degree: float = option(
        0.0, "place agents so that the range with so many neighbours each connects them; 0 for not"
    )

    def __post_init__(self) -> None:
        faults = [
            Fault("uniform", name, f"is {getattr(self, name)}", f"Give {low} or more.")
            for name, low in _LOWEST.items()
            if not low <= getattr(self, name) < math.inf
        ]
        faults += [
            Fault("uniform", name, f"is {getattr(self, name)}", "Give more than 0.")
            for name in ("width", "speed", "reward_min")
            if not 0.0 < getattr(self, name) < math.inf
        ]
        for name in ("reward", "duration", "window"):
            low, high = getattr(self, f"{name}_min"), getattr(self, f"{name}_max")
            if not low <= high < math.inf:
                faults.append(
                    Fault("uniform", f"{name}_max", f"is {high}, with {name}_min {low}", "Give no less.")
                )
        placing = [name for name in ("grid", "communication_range", "mean_degree") if getattr(self, name)]
        if len(placing) > 1:
            faults.append(
                Fault(
                    "uniform", placing[1], f"comes with {placing[0]}", "Give one way of placing the agents."
                )
            )
        if faults:
            raise InputError(faults)


_LOWEST = {
    "agents": 1,
    "tasks": 0,
    "height": 0,
    "grid": 0,
    "fuel_per_metre": 0,
    "bundle_limit": 0,
    "discount": 0,
    "duration_min": 0,
    "horizon": 0,
    "window_min": 0,
    "types": 1,
    "communication_range": 0,
    "mean_degree": 0,
}

OPTIONS = Options()
"""The defaults, and through `dataclasses.fields` the name and meaning of every option."""


def make(seed: int = 0, **options: Any) -> Mission:
    """Make a mission of agents and tasks spread evenly over a square.

    Parameters
    ----------
    seed : same seed, same mission.
    options : fields of `Options`.
    """
    picked = chosen("uniform", Options, options)
    return Mission(
        agents=_agents(seed, picked),
        tasks=_tasks(seed, picked),
        compatible={_kind(k): frozenset({_kind(k)}) for k in range(picked.types)} if picked.types > 1 else {},
        name=f"uniform-{picked.agents}x{picked.tasks}-seed{seed}",
    )


def _agents(seed: int, options: Options) -> tuple[Agent, ...]:
    positions = _agent_positions(seed, options)
    digits = max(3, len(str(options.agents - 1)))
    return tuple(
        Agent(
            id=f"a{row:0{digits}d}",
            # In turn, so that no type goes without an agent while there are enough of them.
            type=_kind(row % options.types) if options.types > 1 else "agent",
            position=_position(positions[row]),
            speed=options.speed,
            fuel_per_metre=options.fuel_per_metre,
            bundle_limit=options.bundle_limit or None,
        )
        for row in range(options.agents)
    )


def _agent_positions(seed: int, options: Options) -> FloatArray:
    if options.communication_range:
        return connected_positions(options.agents, options.width, options.communication_range, seed)
    if options.mean_degree:
        return positions_with_mean_degree(options.agents, options.width, options.mean_degree, seed)[0]
    positions = np.zeros((options.agents, 3))
    positions[:, :2] = _spread(seed, "agents", options.agents, options)
    return positions


def _tasks(seed: int, options: Options) -> tuple[Task, ...]:
    num = options.tasks
    positions = np.zeros((num, 3))
    positions[:, :2] = _spread(seed, "tasks", num, options)
    positions[:, 2] = _draws(seed, "height", num, 0.0, options.height)
    rewards = _draws(seed, "reward", num, options.reward_min, options.reward_max)
    durations = _draws(seed, "duration", num, options.duration_min, options.duration_max)
    starts = _draws(seed, "start", num, 0.0, options.horizon)
    windows = _draws(seed, "window", num, options.window_min, options.window_max)
    types = stream(seed, "uniform", "type").integers(options.types, size=num)
    digits = max(4, len(str(num - 1)))
    return tuple(
        Task(
            id=f"t{row:0{digits}d}",
            type=_kind(int(types[row])) if options.types > 1 else "task",
            position=_position(positions[row]),
            reward=float(rewards[row]),
            start=float(starts[row]),
            end=float(starts[row] + windows[row]) if options.window_max else math.inf,
            duration=float(durations[row]),
            discount=options.discount,
        )
        for row in range(num)
    )


def _spread(seed: int, name: str, num: int, options: Options) -> FloatArray:
    """Draw float64[num, 2], m: positions over the square, or over the points of its grid."""
    rng = stream(seed, "uniform", name)
    if options.grid == 0:
        return rng.random((num, 2)) * options.width
    step = options.width / max(1, options.grid - 1)
    points: FloatArray = rng.integers(options.grid, size=(num, 2)).astype(np.float64) * step
    return points


def _draws(seed: int, name: str, num: int, low: float, high: float) -> FloatArray:
    return low + (high - low) * stream(seed, "uniform", name).random(num)


def _position(row: FloatArray) -> Position:
    east, north, up = row.tolist()
    return east, north, up


def _kind(number: int) -> str:
    return f"type{number + 1}"
