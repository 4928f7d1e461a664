"""The missions of Hunt et al. 2014: a room, timed tasks, groups, equipment and follow-ups.

The paper states 20 tasks, 1 to 10 agents, how many agents a task requires and which equipment. It does
not state the arena, the rewards, the durations, the windows or the speeds. The defaults below are those
of the public MATLAB sample of CBBA that the paper's algorithm grew from (a flight room of about
4.5 m by 7.5 m by 2 m, 2 m/s, windows as long as the service that open within 100 s), and a reward of 100
a seat, without which the paper's scores could not be reached (80 seats, scores up to 6,216).

Every attribute is drawn from a stream of its own, and families share them: the same seed with another
family has the same positions, windows and durations.

Examples
--------
>>> from swarmbid.scenarios import hunt2014
>>> mission = hunt2014.make(seed=3, agents=10, agents_required=4)
>>> len(mission.tasks), {task.agents_required for task in mission.tasks}
(20, {4})
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from swarmbid.errors import Fault, InputError, did_you_mean
from swarmbid.model import Agent, Mission, Task
from swarmbid.rng import stream
from swarmbid.scenarios._options import chosen, option

FAMILIES = {
    "seats": "every task requires `agents_required` agents",
    "mixed": "one half of the tasks requires one agent, the other half `agents_required`",
    "a_b": "tasks for one agent; one half needs equipment A, the other half B (Fig. 8, #1)",
    "a_b_ab": "tasks for A, for B, and for one agent of each, 7-7-6 of 20 (Fig. 8, #2)",
    "a_ab_abc": "tasks for A, for AB and for ABC, 8-6-6 of 20 (Fig. 8, #3)",
    "follow_up": "half of the tasks follow another, some of them a follow-up (Fig. 10, #2)",
    "follow_up_open": "the same, but follow-ups may start at any time (Fig. 10, #3)",
}
"""Name of a family -> what its tasks require."""

_KITS = {
    "a_b": (("A",), ("B",)),
    "a_b_ab": (("A",), ("B",), ("A", "B")),
    "a_ab_abc": (("A",), ("A", "B"), ("A", "B", "C")),
}
"""Family -> what its kinds of tasks need, one agent for each piece."""
_SHARES = {"a_b": (10, 10), "a_b_ab": (7, 7, 6), "a_ab_abc": (8, 6, 6)}
"""How many of 20 tasks are of each kind. The paper states the last; the second is ours."""
_CHAINED = 0.3
"""Share of the follow-ups that follow a follow-up. The paper shows that there are some; the share is ours."""


@dataclass(frozen=True, kw_only=True)
class Options:
    """What `make` understands; each field tells its meaning and unit in ``metadata["help"]``."""

    agents: int = option(10, "how many agents, 1 or more")
    tasks: int = option(20, "how many tasks")
    agents_required: int = option(2, "agents for a task of several; with family seats for every task")
    family: str = option("seats", "what the tasks require: " + ", ".join(FAMILIES))
    width: float = option(4.5, "the room from west to east, m")
    length: float = option(7.5, "the room from south to north, m")
    height: float = option(2.0, "the room from floor to ceiling, m; agents start on the floor")
    speed: float = option(2.0, "speed of every agent, m/s")
    reward: float = option(100.0, "what each seat of a task pays, score")
    fuel_per_metre: float = option(1.0, "score lost per m flown")
    horizon: float = option(100.0, "windows open from 0 to this time, s")
    duration_short: float = option(5.0, "service of one half of the tasks, s; their windows last as long")
    duration_long: float = option(15.0, "service of the other half, s; their windows last as long")

    def __post_init__(self) -> None:
        faults = [
            Fault("hunt2014", name, f"is {getattr(self, name)}", f"Give {low} or more.")
            for name, low in _LOWEST.items()
            if not low <= getattr(self, name) < math.inf
        ]
        faults += [
            Fault("hunt2014", name, f"is {getattr(self, name)}", "Give more than 0.")
            for name in ("speed", "reward")
            if not 0.0 < getattr(self, name) < math.inf
        ]
        if self.family not in FAMILIES:
            mend = did_you_mean(self.family, FAMILIES) or "Choose one of: " + ", ".join(FAMILIES) + "."
            faults.append(Fault("hunt2014", "family", f"is {self.family!r}", mend))
        if faults:
            raise InputError(faults)


_LOWEST = {
    "agents": 1,
    "tasks": 0,
    "agents_required": 1,
    "width": 0,
    "length": 0,
    "height": 0,
    "fuel_per_metre": 0,
    "horizon": 0,
    "duration_short": 0,
    "duration_long": 0,
}

OPTIONS = Options()
"""The defaults, and through `dataclasses.fields` the name and meaning of every option."""


def make(seed: int = 0, **options: Any) -> Mission:
    """Make a mission of the paper's kind.

    Parameters
    ----------
    seed : same seed, same mission.
    options : fields of `Options`.
    """
    picked = chosen("hunt2014", Options, options)
    return Mission(
        agents=_agents(seed, picked),
        tasks=_tasks(seed, picked),
        name=f"hunt2014-{picked.family.replace('_', '-')}-{picked.agents}x{picked.tasks}-seed{seed}",
    )


def _agents(seed: int, options: Options) -> tuple[Agent, ...]:
    places = stream(seed, "hunt2014", "agents").random((options.agents, 2))
    digits = max(2, len(str(options.agents - 1)))
    kinds = sorted({piece for kit in _KITS.get(options.family, ()) for piece in kit})
    return tuple(
        Agent(
            id=f"a{row:0{digits}d}",
            # In turn: evenly split, the surplus to A first, then B.
            type=kinds[row % len(kinds)] if kinds else "agent",
            equipment=frozenset({kinds[row % len(kinds)]}) if kinds else frozenset(),
            position=(east * options.width, north * options.length, 0.0),
            speed=options.speed,
            fuel_per_metre=options.fuel_per_metre,
        )
        for row, (east, north) in enumerate(places.tolist())
    )


def _tasks(seed: int, options: Options) -> tuple[Task, ...]:
    num = options.tasks
    digits = max(2, len(str(num - 1)))
    ids = [f"t{row:0{digits}d}" for row in range(num)]
    places = stream(seed, "hunt2014", "tasks").random((num, 3)).tolist()
    starts = (stream(seed, "hunt2014", "start").random(num) * options.horizon).tolist()
    long = stream(seed, "hunt2014", "duration").random(num) < 0.5
    durations = [options.duration_long if each else options.duration_short for each in long.tolist()]
    after = _prerequisites(num) if options.family.startswith("follow_up") else {}
    open_ended = set(after) if options.family == "follow_up_open" else set()
    return tuple(
        Task(
            id=ids[row],
            type=_kind(row, num, options, after),
            position=(east * options.width, north * options.length, up * options.height),
            reward=options.reward,
            start=0.0 if row in open_ended else starts[row],
            end=math.inf if row in open_ended else starts[row] + durations[row],
            duration=durations[row],
            agents_required=_seats(row, num, options),
            equipment=frozenset(_kit(row, num, options)),
            prerequisites=(ids[after[row]],) if row in after else (),
        )
        for row, (east, north, up) in enumerate(places)
    )


def _seats(row: int, num: int, options: Options) -> int:
    if options.family in _KITS:
        return len(_kit(row, num, options))
    if options.family == "mixed" and row < num - num // 2:
        return 1
    return options.agents_required


def _kit(row: int, num: int, options: Options) -> Sequence[str]:
    """What the task of a row needs; kinds come in blocks, in the shares of `_SHARES`."""
    if options.family not in _KITS:
        return ()
    reached = 0
    for kit, share in zip(_KITS[options.family], _SHARES[options.family], strict=True):
        reached += share
        if row < num * reached / 20.0:
            return kit
    return _KITS[options.family][-1]


def _kind(row: int, num: int, options: Options, after: dict[int, int]) -> str:
    """Type of a task, for reading: its kit, or the place it has in a chain (T, B, C as in Fig. 11)."""
    if options.family in _KITS:
        return "".join(_kit(row, num, options))
    if not after:
        return "task"
    if row not in after:
        return "T"
    return "C" if after[row] in after else "B"


def _prerequisites(num: int) -> dict[int, int]:
    """Row of each follow-up -> row of the task that it follows; half of the tasks, in chains of 2 or 3."""
    firsts = num - num // 2
    follow_ups = num // 2
    seconds = follow_ups - int(_CHAINED * follow_ups)
    after = {firsts + row: row for row in range(seconds)}
    after.update({firsts + seconds + row: firsts + row for row in range(follow_ups - seconds)})
    return after
