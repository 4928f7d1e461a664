"""CBGA to agreement: how the cost grows with the team, and with how many agents a task needs."""

from __future__ import annotations

import json
import sys
import time
from typing import Any

from benchmarks.measure import MEBIBYTE, Table, in_child, peak_memory

SECONDS = 20.0
"""CPU promised for 100 agents, 500 tasks and one to four agents a task, by `distance_cost`."""
BUNDLE_LIMIT = 20
CASES = (
    # agents, tasks, most agents a task, score
    (25, 125, 4, "distance_cost"),
    (50, 250, 4, "distance_cost"),
    (100, 500, 1, "distance_cost"),
    (100, 500, 2, "distance_cost"),
    (100, 500, 4, "distance_cost"),
    (50, 250, 4, "time_discounted"),
    (100, 500, 4, "time_discounted"),
)
PROMISED = (100, 500, 4, "distance_cost")


def run(quick: bool = False) -> Table:
    """Run every case, or the smallest only."""
    table = Table(
        f"CBGA: tasks that need 1 to L agents, complete graph, bundle limit {BUNDLE_LIMIT}",
        (
            "agents", "tasks", "L", "score", "status", "CPU s", "peak MiB", "agreed", "all know", "messages",
            "MB", "bytes each", "not served",
        ),
    )  # fmt: skip
    for case in CASES[:1] if quick else CASES:
        one = in_child("benchmarks.coalitions", *map(str, case))
        table.rows.append(
            (
                *map(str, case), one["status"], f"{one['cpu']:.1f}", f"{one['peak'] / MEBIBYTE:.0f}",
                str(one["rounds"]), str(one["declared_round"]), str(one["messages"]),
                f"{one['bytes'] / 1e6:.1f}", f"{one['bytes'] / one['messages']:.0f}", str(one["unserved"]),
            )
        )  # fmt: skip
        size = f"{case[0]} x {case[1]}, L = {case[2]}, {case[3]}"
        table.bars.append((f"{size} reaches agreement", one["status"] == "converged"))
        if case == PROMISED:
            table.bars.append(
                (f"{size} in {one['cpu']:.1f} s of CPU, promised {SECONDS:g}", one["cpu"] <= SECONDS)
            )
    table.note("""
        Agents and tasks are spread over a square of 100 m, speed 10 m/s, rewards 100, service 5 s, fuel 0.01
        a metre; how many agents a task needs is drawn from 1 to L; `time_discounted` with 0.001 a second.
        `simulate` from the mission to agreement in a process of its own; loading compiled code from the disk
        cache included, making the mission not.
    """)
    return table


def measure(agents: int, tasks: int, most: int, score: str) -> dict[str, Any]:
    """Run once in this process."""
    import numpy as np

    from swarmbid.model import Agent, Mission, Task
    from swarmbid.simulator import simulate

    rng = np.random.default_rng(1)

    def place() -> tuple[float, float, float]:
        east, north = rng.uniform(0.0, 100.0, 2).tolist()
        return east, north, 0.0

    mission = Mission(
        agents=tuple(
            Agent(
                id=f"a{row:03d}", position=place(), speed=10.0, fuel_per_metre=0.01, bundle_limit=BUNDLE_LIMIT
            )
            for row in range(agents)
        ),
        tasks=tuple(
            Task(
                id=f"t{row:03d}", position=place(), reward=100.0, duration=5.0, discount=0.001,
                agents_required=int(rng.integers(1, most + 1)),
            )
            for row in range(tasks)
        ),
    )  # fmt: skip
    cpu = time.process_time()
    found = simulate(mission, algorithm="cbga", score=score)
    cpu = time.process_time() - cpu
    return {
        "cpu": cpu,
        "peak": peak_memory(),
        "status": found.status,
        "rounds": found.rounds,
        "declared_round": found.declared_round,
        "messages": found.messages,
        "bytes": found.bytes,
        "unserved": len(found.plan.unserved),
    }


if __name__ == "__main__":
    print(json.dumps(measure(int(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3]), sys.argv[4])))
