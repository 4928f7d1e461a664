"""How good CBGA's plans are, and how often it ends clean where the printed algorithm does not.

The tables of "Why CBGA settles". Not among the benchmarks that run by default: the whole takes an hour, most
of it for printed runs that never come to rest.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

from benchmarks.measure import Table

SEEDS = 40
KINDS = ("single", "L2", "L4", "mixed", "AB", "ABC", "prerequisites")
READINGS: tuple[tuple[str, dict[str, Any]], ...] = (
    ("literal", {"algorithm": "cbga_printed", "reading": "literal", "max_rounds": 150}),
    ("charitable", {"algorithm": "cbga_printed", "reading": "charitable", "max_rounds": 150}),
    ("warped", {"algorithm": "cbga_printed", "reading": "charitable", "warp": True, "max_rounds": 150}),
    ("cbga", {"algorithm": "cbga", "max_rounds": 5000}),
)


def run(quick: bool = False) -> Table:
    """Compare with the optimum on small missions, and count clean ends on larger ones."""
    seeds = 3 if quick else SEEDS
    table = Table(
        f"CBGA: score over the exact optimum, and share of clean ends, {seeds} missions a cell",
        ("tasks", "what", "mean or share", "worst"),
    )
    for family, score, ratios in optimum_ratios(seeds):
        mean = sum(ratios) / max(len(ratios), 1)
        table.rows.append((family, score, f"{mean:.3f}", f"{min(ratios, default=0.0):.3f}"))
    for kind in KINDS:
        for windows in (True, False):
            for name, options in READINGS:
                clean = clean_share(kind, windows, options, seeds)
                what = f"{name}, {'with' if windows else 'without'} windows"
                table.rows.append((kind, what, f"{clean:.2f}", ""))
                if name == "cbga":
                    table.bars.append((f"{kind}, {what}: every run ends clean", clean == 1.0))
    return table


def optimum_ratios(seeds: int) -> list[tuple[str, str, list[float]]]:
    """Return (family, score, plan's score over the optimum's) of missions with something to gain."""
    sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
    from coalition_missions import FAMILIES, missions
    from swarmbid.references.coalition_optimum import coalition_optimum
    from swarmbid.scores import make_score
    from swarmbid.simulator import simulate

    found = []
    for name in ("distance_cost", "time_discounted"):
        score = make_score(name)
        for family in FAMILIES:
            ratios = []
            for seed in range(seeds):
                mission = missions(seed, family, agents=(2, 4), tasks=(2, 6))
                best = coalition_optimum(mission, score).value
                if best > 0.0:
                    plan = simulate(mission, algorithm="cbga", score=score, max_rounds=20000).plan
                    ratios.append(plan.total_score / best)
            found.append((family, name, ratios))
    return found


def clean_share(kind: str, windows: bool, options: dict[str, Any], seeds: int) -> float:
    """Return the share of missions on which an algorithm ends clean."""
    from swarmbid.experiments._cleanliness import judge_state
    from swarmbid.simulator import simulate

    clean = 0
    for seed in range(seeds):
        mission = mission_of(kind, seed, windows)
        negotiators = simulate(mission, score="distance_cost", **options).negotiators
        clean += bool(judge_state(negotiators, mission)["clean"])
    return clean / seeds


def mission_of(kind: str, seed: int, windows: bool) -> Any:
    """Make a mission of 5 to 10 agents and 8 to 20 tasks in a square of 100 m."""
    from swarmbid.model import Agent, Mission, Task
    from swarmbid.rng import stream

    rng = stream(seed, "m" + ("pre" if kind == "prerequisites" else kind))
    num_agents, num_tasks = int(rng.integers(5, 11)), int(rng.integers(8, 21))

    def place() -> tuple[float, float, float]:
        east, north, _ = rng.uniform(0, 100, 3).tolist()
        return east, north, 0.0

    carried: list[frozenset[str]] = [frozenset()] * num_agents
    seats, needs = [1] * num_tasks, [frozenset[str]()] * num_tasks
    first: list[tuple[str, ...]] = [()] * num_tasks
    if kind in ("L2", "L4"):
        seats = [int(kind[1])] * num_tasks
    elif kind in ("mixed", "prerequisites"):
        seats = [1 + int(more) for more in rng.integers(0, 2, num_tasks)]
        if kind == "prerequisites":
            first = [() if row % 2 == 0 else (f"t{row - 1:02}",) for row in range(num_tasks)]
    elif kind in ("AB", "ABC"):
        wanted = ("A", "B", "AB") if kind == "AB" else ("A", "AB", "ABC")
        carried = [frozenset(kind[row % len(kind)]) for row in range(num_agents)]
        drawn = [wanted[pick] for pick in rng.integers(0, 3, num_tasks).tolist()]
        seats, needs = [len(letters) for letters in drawn], [frozenset(letters) for letters in drawn]
    agents = [
        Agent(id=f"a{row:02}", position=place(), speed=2.0, equipment=carried[row])
        for row in range(num_agents)
    ]
    tasks = []
    for row in range(num_tasks):
        start = float(rng.uniform(0, 100)) if windows else 0.0
        tasks.append(
            Task(
                id=f"t{row:02}", position=place(), reward=float(rng.uniform(80, 150)),
                duration=float(rng.uniform(2, 10)), start=start,
                end=start + float(rng.uniform(10, 60)) if windows else float("inf"),
                agents_required=seats[row], equipment=needs[row], prerequisites=first[row],
            )
        )  # fmt: skip
    return Mission(agents=tuple(agents), tasks=tuple(tasks))
