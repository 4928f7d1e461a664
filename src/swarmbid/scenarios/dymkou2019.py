"""The missions of Dymkou's slides and public sample code: quadrotors that track, cars that rescue.

The slides ("Distributed tasking problem for track and search") show a run of CBBA as paths in x, y and
time, and seven UAVs that divide seven locations among themselves, but give no numbers. The defaults are
those of the author's public MATLAB sample: 2 QUAD and 3 CAR, 3 TRACK tasks for the first and 4 RESCUE
tasks for the second, an arena of ±30 m, 2 m/s, fuel 1 a metre, value 100 that fades with 0.1 1/s, 600 s
of service, starts even over 1009 s, windows as long as the service, bundles of 3.

The sample draws z from -10 m to -2 m. Our reading: its z axis points down, so here tasks lie 2 m to 10 m
up. Agents start on the ground, and anywhere in the arena.

`self_assignment` makes the slides' other picture: as many UAVs as locations, of one type, no windows, one
location each.

Examples
--------
>>> from swarmbid.scenarios import dymkou2019
>>> mission = dymkou2019.make(seed=1)
>>> [agent.type for agent in mission.agents], len(mission.tasks)
(['QUAD', 'QUAD', 'CAR', 'CAR', 'CAR'], 7)
>>> each = dymkou2019.make(seed=1, agents=7, tasks=7, self_assignment=True)
>>> {agent.bundle_limit for agent in each.agents}
{1}
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from swarmbid.arrays import FloatArray
from swarmbid.errors import Fault, InputError
from swarmbid.model import Agent, Mission, Task
from swarmbid.rng import stream
from swarmbid.scenarios._options import chosen, option

COMPATIBLE = {"QUAD": frozenset({"TRACK"}), "CAR": frozenset({"RESCUE"})}


@dataclass(frozen=True, kw_only=True)
class Options:
    """What `make` understands; each field tells its meaning and unit in ``metadata["help"]``."""

    agents: int = option(5, "how many agents, 1 or more; of two types, the first two fifths are QUAD")
    tasks: int = option(7, "how many tasks; of two types, the first three sevenths are TRACK")
    self_assignment: bool = option(False, "one type, no windows, no service, one location each")
    half_width: float = option(30.0, "the arena reaches so far from its middle, m")
    lowest: float = option(2.0, "lowest task above the ground, m")
    highest: float = option(10.0, "highest task above the ground, m")
    speed: float = option(2.0, "speed of every agent, m/s")
    fuel_per_metre: float = option(1.0, "score lost per m flown")
    reward: float = option(100.0, "value of every task, score")
    discount: float = option(0.1, "how fast values fade, 1/s; not used with self_assignment")
    duration: float = option(600.0, "service of every task, and how long its window is, s")
    horizon: float = option(1009.0, "windows open from 0 to this time, s")
    bundle_limit: int = option(3, "most tasks an agent takes at once; 0 for no limit")

    def __post_init__(self) -> None:
        faults = [
            Fault("dymkou2019", name, f"is {getattr(self, name)}", f"Give {low} or more.")
            for name, low in _LOWEST.items()
            if not low <= getattr(self, name) < math.inf
        ]
        faults += [
            Fault("dymkou2019", name, f"is {getattr(self, name)}", "Give more than 0.")
            for name in ("half_width", "speed", "reward")
            if not 0.0 < getattr(self, name) < math.inf
        ]
        if not self.lowest <= self.highest < math.inf:
            mend = f"Give no less than lowest, {self.lowest:g}."
            faults.append(Fault("dymkou2019", "highest", f"is {self.highest}", mend))
        if faults:
            raise InputError(faults)


_LOWEST = {
    "agents": 1, "tasks": 0, "lowest": 0, "fuel_per_metre": 0, "discount": 0, "duration": 0, "horizon": 0,
    "bundle_limit": 0,
}  # fmt: skip

OPTIONS = Options()
"""The defaults, and through `dataclasses.fields` the name and meaning of every option."""


def make(seed: int = 0, **options: Any) -> Mission:
    """Make a mission of the slides' setting.

    Parameters
    ----------
    seed : same seed, same mission.
    options : fields of `Options`.
    """
    picked = chosen("dymkou2019", Options, options)
    name = "self-assignment" if picked.self_assignment else "dymkou2019"
    return Mission(
        agents=_agents(seed, picked),
        tasks=_tasks(seed, picked),
        compatible={} if picked.self_assignment else COMPATIBLE,
        name=f"{name}-{picked.agents}x{picked.tasks}-seed{seed}",
    )


def _agents(seed: int, options: Options) -> tuple[Agent, ...]:
    places = _spread(seed, "agents", options.agents, options)
    quads = math.floor(options.agents * 2 / 5)
    limit = 1 if options.self_assignment else options.bundle_limit
    return tuple(
        Agent(
            id=f"uav{row + 1}",
            type="UAV" if options.self_assignment else "QUAD" if row < quads else "CAR",
            position=(float(places[row, 0]), float(places[row, 1]), 0.0),
            speed=options.speed,
            fuel_per_metre=options.fuel_per_metre,
            bundle_limit=limit or None,
        )
        for row in range(options.agents)
    )


def _tasks(seed: int, options: Options) -> tuple[Task, ...]:
    num = options.tasks
    places = _spread(seed, "tasks", num, options)
    heights = options.lowest + (options.highest - options.lowest) * stream(
        seed, "dymkou2019", "height"
    ).random(num)
    starts = stream(seed, "dymkou2019", "start").random(num) * options.horizon
    tracks = math.floor(num * 3 / 7)
    alone = options.self_assignment
    return tuple(
        Task(
            id=f"t{row + 1}",
            type="LOCATION" if alone else "TRACK" if row < tracks else "RESCUE",
            position=(float(places[row, 0]), float(places[row, 1]), float(heights[row])),
            reward=options.reward,
            start=0.0 if alone else float(starts[row]),
            end=math.inf if alone else float(starts[row]) + options.duration,
            duration=0.0 if alone else options.duration,
            discount=0.0 if alone else options.discount,
        )
        for row in range(num)
    )


def _spread(seed: int, name: str, num: int, options: Options) -> FloatArray:
    """Draw float64[num, 2], m: positions even over the arena."""
    places: FloatArray = (stream(seed, "dymkou2019", name).random((num, 2)) * 2.0 - 1.0) * options.half_width
    return places
