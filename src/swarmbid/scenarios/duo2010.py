"""Duo cooperation: solo tasks, tasks that pay more for two, and tasks that need two agents of unlike type.

The three kinds of Choi, Whitten, How 2010 ("Decentralized task allocation for heterogeneous teams with
cooperation constraints"), for agents of two types, a and b, as ordinary tasks with seats, equipment and
prerequisites. Numbers, places and rewards are ours.

- Solo: one agent of one type. Exact.
- Required duo: one agent of each type, at the same time. Exact: two seats and the equipment of both
  types. `duo_reward` is paid in halves, as each seat pays alike.
- Preferred duo: `reward` for an agent of any type, `duo_reward` for one of each together. Tasks that
  exclude each other cannot be stated, so it is two tasks at one place: the service, with one seat, and a
  bonus with two, which follows it, takes no time and pays the difference, in halves. Exact are what is
  paid to nobody, to one and to two, that the two are of unlike type, and that they are there together.
  Not exact: they are together at the end of the service, not from its start, so the second agent is kept
  for no longer than that moment (without `duration` there is no difference); and the bonus may go to two
  who are not the one that served, which pays no more but takes more way.

Examples
--------
>>> from swarmbid.scenarios import duo2010
>>> mission = duo2010.make(seed=1, agents=4, solo=2, preferred=1, required=1)
>>> [(task.id, task.agents_required, task.reward) for task in mission.tasks]
[('solo00', 1, 10.0), ('solo01', 1, 10.0), ('preferred00', 1, 10.0), ('preferred00.bonus', 2, 10.0), \
('required00', 2, 15.0)]
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from swarmbid.errors import Fault, InputError
from swarmbid.model import Agent, Mission, Position, Task
from swarmbid.rng import stream
from swarmbid.scenarios._options import chosen, option

TYPES = ("a", "b")
"""The types of agents; each carries its own name as equipment."""


@dataclass(frozen=True, kw_only=True)
class Options:
    """What `make` understands; each field tells its meaning and unit in ``metadata["help"]``."""

    agents: int = option(6, "how many agents, 1 or more; the types take turns")
    solo: int = option(8, "how many tasks for one agent; the types take turns")
    preferred: int = option(6, "how many tasks that pay more for two")
    required: int = option(6, "how many tasks that need two")
    width: float = option(100.0, "side of the square, m")
    speed: float = option(2.0, "speed of every agent, m/s")
    reward: float = option(10.0, "what a task pays one agent, score")
    duo_reward: float = option(30.0, "what a task pays two together, score")
    discount: float = option(0.01, "how fast rewards fade, 1/s")
    fuel_per_metre: float = option(0.05, "score lost per m flown")
    duration: float = option(5.0, "service of every task, s")
    horizon: float = option(0.0, "windows open from 0 to this time, s")
    window: float = option(0.0, "how long windows stay open, s; 0 for windows that never close")

    def __post_init__(self) -> None:
        faults = [
            Fault("duo2010", name, f"is {getattr(self, name)}", f"Give {low} or more.")
            for name, low in _LOWEST.items()
            if not low <= getattr(self, name) < math.inf
        ]
        faults += [
            Fault("duo2010", name, f"is {getattr(self, name)}", "Give more than 0.")
            for name in ("width", "speed", "reward")
            if not 0.0 < getattr(self, name) < math.inf
        ]
        if not self.reward < self.duo_reward < math.inf:
            mend = f"Two are to earn more than one, who earns {self.reward:g}."
            faults.append(Fault("duo2010", "duo_reward", f"is {self.duo_reward}", mend))
        if faults:
            raise InputError(faults)


_LOWEST = {
    "agents": 1, "solo": 0, "preferred": 0, "required": 0, "discount": 0, "fuel_per_metre": 0,
    "duration": 0, "horizon": 0, "window": 0,
}  # fmt: skip

OPTIONS = Options()
"""The defaults, and through `dataclasses.fields` the name and meaning of every option."""


def make(seed: int = 0, **options: Any) -> Mission:
    """Make a mission of solo, preferred duo and required duo tasks.

    Parameters
    ----------
    seed : same seed, same mission.
    options : fields of `Options`.
    """
    picked = chosen("duo2010", Options, options)
    places = _places(seed, "agents", picked.agents, picked)
    agents = tuple(
        Agent(
            id=f"{TYPES[row % 2]}{row // 2:02d}",
            type=TYPES[row % 2],
            position=place,
            speed=picked.speed,
            fuel_per_metre=picked.fuel_per_metre,
            equipment=frozenset({TYPES[row % 2]}),
        )
        for row, place in enumerate(places)
    )
    return Mission(
        agents=agents,
        tasks=(*_solo(seed, picked), *_preferred(seed, picked), *_required(seed, picked)),
        compatible={kind: frozenset({f"solo_{kind}", "preferred", "required"}) for kind in TYPES},
        name=f"duo2010-{picked.agents}x{picked.solo + picked.preferred + picked.required}-seed{seed}",
    )


def _solo(seed: int, options: Options) -> list[Task]:
    return [
        Task(
            id=f"solo{row:02d}",
            type=f"solo_{TYPES[row % 2]}",
            reward=options.reward,
            duration=options.duration,
            discount=options.discount,
            **place,
        )
        for row, place in enumerate(_when_and_where(seed, "solo", options.solo, options))
    ]


def _preferred(seed: int, options: Options) -> list[Task]:
    tasks = []
    for row, place in enumerate(_when_and_where(seed, "preferred", options.preferred, options)):
        service = Task(
            id=f"preferred{row:02d}",
            type="preferred",
            reward=options.reward,
            duration=options.duration,
            discount=options.discount,
            **place,
        )
        bonus = Task(
            id=f"{service.id}.bonus",
            type="preferred",
            position=service.position,
            reward=(options.duo_reward - options.reward) / 2.0,
            # As late as the service ends, so that it fades as much as that does.
            start=service.start + options.duration,
            end=service.end + options.duration,
            discount=options.discount,
            agents_required=2,
            equipment=frozenset(TYPES),
            prerequisites=(service.id,),
        )
        tasks += [service, bonus]
    return tasks


def _required(seed: int, options: Options) -> list[Task]:
    return [
        Task(
            id=f"required{row:02d}",
            type="required",
            reward=options.duo_reward / 2.0,
            duration=options.duration,
            discount=options.discount,
            agents_required=2,
            equipment=frozenset(TYPES),
            **place,
        )
        for row, place in enumerate(_when_and_where(seed, "required", options.required, options))
    ]


def _when_and_where(seed: int, kind: str, num: int, options: Options) -> list[dict[str, Any]]:
    starts = stream(seed, "duo2010", kind, "start").random(num) * options.horizon
    return [
        {
            "position": place,
            "start": float(start),
            "end": float(start) + options.window if options.window else math.inf,
        }
        for place, start in zip(_places(seed, kind, num, options), starts, strict=True)
    ]


def _places(seed: int, kind: str, num: int, options: Options) -> list[Position]:
    spots = stream(seed, "duo2010", kind).random((num, 2)) * options.width
    return [(float(east), float(north), 0.0) for east, north in spots]
