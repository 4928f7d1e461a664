"""Small random missions with groups, equipment and prerequisites, by seed.

Even seeds are full of ties: places on a coarse grid, equal rewards. Speeds are powers of two, so that a
division and a product with the inverse give the same bits.
"""

from __future__ import annotations

import random
from collections.abc import Iterable

from swarmbid.model import Agent, Mission, Task

FAMILIES = ("single", "L2", "L4", "mixed", "AB", "ABC", "prerequisites", "open")
"""One agent a task; two; four; one or two; carriers of A, B or AB; of A, AB or ABC; chains; as many as the
equipment takes."""


def missions(
    seed: int,
    family: str,
    *,
    agents: tuple[int, int] = (2, 6),
    tasks: tuple[int, int] = (2, 8),
    windows: bool | None = None,
) -> Mission:
    """A mission of one of `FAMILIES`; the same every time.

    Parameters
    ----------
    agents, tasks : least and most of them; "L4" has at least four agents.
    windows : whether tasks have windows; None for every other pair of seeds.
    """
    if family not in FAMILIES:
        raise ValueError(family)
    rng = random.Random(f"{family} {seed}")
    ties = seed % 2 == 0
    timed = seed // 2 % 2 == 1 if windows is None else windows

    def place() -> tuple[float, float, float]:
        if ties:
            return (10.0 * rng.randrange(5), 10.0 * rng.randrange(5), 0.0)
        return (rng.uniform(0, 50), rng.uniform(0, 50), rng.uniform(0, 5))

    def number(low: float, high: float, *tied: float) -> float:
        return rng.choice(tied) if ties else rng.uniform(low, high)

    limited = rng.random() < 0.3
    ranged = rng.random() < 0.3
    typed = rng.random() < 0.2
    revisits = rng.random() < 0.2
    sets = carried_sets(rng, family)
    least, most = agents
    team = []
    for i in range(rng.randint(max(least, 4 if family == "L4" else 2), max(most, 4))):
        home = place()
        team.append(
            Agent(
                id=f"a{i}",
                type=rng.choice(["flyer", "rover"]) if typed else "agent",
                position=home,
                speed=rng.choice([1.0, 1.0, 2.0]),
                available_at=number(0, 15, 0.0, 10.0) if rng.random() < 0.3 else 0.0,
                fuel_per_metre=number(0, 0.5, 0.0, 0.25),
                range=number(60, 250, 80.0, 160.0) if ranged and rng.random() < 0.6 else float("inf"),
                endurance=number(60, 250, 80.0, 160.0) if ranged and rng.random() < 0.6 else float("inf"),
                equipment=rng.choice(sets),
                bundle_limit=rng.choice([1, 2, 3]) if limited and rng.random() < 0.7 else None,
                base=home if ranged and rng.random() < 0.5 else None,
            )
        )
    count = rng.randint(*tasks)
    ids = [f"t{j:02}" for j in range(count)]
    order = rng.sample(ids, count)  # prerequisites point backwards in this order, not in that of ids
    discount = rng.choice([0.0, 0.01, 0.05])
    work = []
    for task_id in ids:
        opens = number(0, 60, 0.0, 20.0, 40.0) if timed else 0.0
        seats, needed = required(rng, family)
        earlier = order[: order.index(task_id)]
        chained = family == "prerequisites" and earlier and rng.random() < 0.6
        needs = rng.sample(earlier, min(len(earlier), rng.choice([1, 1, 2]))) if chained else []
        work.append(
            Task(
                id=task_id,
                type=rng.choice(["look", "look", "lift"]) if typed else "task",
                position=place(),
                reward=number(40, 120, 100.0, 100.0, 60.0),
                start=opens,
                end=opens + number(10, 80, 20.0, 60.0) if timed else float("inf"),
                duration=number(0, 15, 0.0, 5.0, 15.0),
                discount=discount if ties else rng.uniform(0.001, 0.05),
                agents_required=seats,
                equipment=needed,
                prerequisites=tuple(needs),
                revisit_at=opens + number(0, 30, 0.0, 20.0) if revisits and rng.random() < 0.5 else None,
                revisit_width=number(10, 60, 40.0) if revisits else 60.0,
            )
        )
    compatible = {"rover": frozenset({"look"})} if typed else {}
    return Mission(agents=tuple(team), tasks=tuple(work), compatible=compatible, name=f"{family}-{seed}")


def named(*sets: Iterable[str]) -> list[frozenset[str]]:
    """Sets of one-letter names: "AB" is {A, B}."""
    return [frozenset(letters) for letters in sets]


def carried_sets(rng: random.Random, family: str) -> list[frozenset[str]]:
    """What there is for each agent to carry.

    In half of the "open" missions A and C together leave no room for the third set, which alone has B.
    """
    if family == "open" and rng.random() < 0.5:
        return named("A", "BC", "C")
    kinds = {
        "AB": named("A", "B", "AB"),
        "ABC": named("A", "AB", "ABC"),
        "open": named("A", "B", "C", "AB", "BC", ""),
        "prerequisites": named("A", "A", "AB"),
    }
    return kinds.get(family, named(""))


def required(rng: random.Random, family: str) -> tuple[int, frozenset[str]]:
    """Seats and equipment of one task."""
    kinds = {
        "single": ([1], named("")),
        "L2": ([2], named("")),
        "L4": ([4], named("")),
        "mixed": ([1, 2], named("")),
        "AB": ([1, 2], named("A", "B", "AB", "AB")),
        "ABC": ([1, 2, 3], named("A", "AB", "ABC")),
        "prerequisites": ([1, 1, 2], named("", "A", "B", "AB")),
        "open": ([0, 0, 0, 1], named("A", "B", "AB", "ABC")),
    }
    seats, needed = kinds[family]
    return rng.choice(seats), rng.choice(needed)
