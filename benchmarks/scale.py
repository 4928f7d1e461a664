"""1,000 agents and 10,000 tasks: one large team over radios that reach eight neighbours on average."""

from __future__ import annotations

import json
import math
import sys
import time
from typing import Any

from benchmarks.measure import MEBIBYTE, Table, in_child, peak_memory

AGENTS, TASKS, MEAN_DEGREE, BUNDLE_LIMIT = 1000, 10_000, 8.0, 10
SECONDS, BYTES = 60.0, 2 * 2**30
"""Wall clock and resident memory promised."""
DENSITIES = (20.0, 1000.0)
"""Agents per km²: as in std-20-100, on which the promise is judged; and all in one km², where every agent is
a rival for every task."""


def run(quick: bool = False) -> Table:
    """Run the large mission, or a tenth of it."""
    agents, tasks = (AGENTS // 10, TASKS // 10) if quick else (AGENTS, TASKS)
    table = Table(
        f"{agents:,} agents, {tasks:,} tasks, range-limited graph, mean degree {MEAN_DEGREE:g}, "
        f"bundle limit {BUNDLE_LIMIT}",
        (
            "agents per km²", "status", "wall s", "CPU s", "peak MiB", "links each", "diameter", "last bid",
            "agreed", "all know", "messages", "MB", "bytes each",
        ),
    )  # fmt: skip
    found = {}
    for density in DENSITIES:
        one = in_child("benchmarks.scale", str(agents), str(tasks), str(density))
        found[density] = one
        table.rows.append(
            (
                f"{density:g}", one["status"], f"{one['wall']:.1f}", f"{one['cpu']:.1f}",
                f"{one['peak'] / MEBIBYTE:.0f}", f"{one['degree']:.1f}", str(one["diameter"]),
                str(one["last_bid_round"]), str(one["rounds"]), str(one["declared_round"]),
                str(one["messages"]), f"{one['bytes'] / 1e6:.0f}", f"{one['bytes'] / one['messages']:.0f}",
            )
        )  # fmt: skip
    table.note(f"""
        `simulate` from the mission to agreement in a process of its own; loading compiled code
        from the disk cache included, making the mission not. 5M+2N would be {5 * tasks + 2 * agents:,} bytes
        a broadcast.
    """)
    size = f"{agents:,} x {tasks:,}"
    one = found[DENSITIES[0]]
    each = one["bytes"] / one["messages"]
    table.bars.append((f"{size} reaches agreement", one["status"] == "converged"))
    table.bars.append((f"{size} in {one['wall']:.1f} s, promised {SECONDS:g}", one["wall"] <= SECONDS))
    table.bars.append((f"{size} in {one['peak'] / 2**30:.2f} GiB, promised 2", one["peak"] <= BYTES))
    table.bars.append((f"{size}: {each:.0f} bytes a broadcast, below 5M+2N", each < 5 * tasks + 2 * agents))
    return table


def measure(agents: int, tasks: int, density: float) -> dict[str, Any]:
    """Run once in this process."""
    from swarmbid.network import Network, agent_positions, make_topology
    from swarmbid.scenarios import uniform
    from swarmbid.scores import make_score
    from swarmbid.simulator import simulate

    begin = time.perf_counter()
    width = 1000.0 * math.sqrt(agents / density)
    mission = uniform.make(
        seed=1, agents=agents, tasks=tasks, bundle_limit=BUNDLE_LIMIT, mean_degree=MEAN_DEGREE, width=width
    )
    topology = make_topology("range", agents, positions=agent_positions(mission), mean_degree=MEAN_DEGREE)
    network = Network(topology)
    making = time.perf_counter() - begin
    wall, cpu = time.perf_counter(), time.process_time()
    found = simulate(
        mission, algorithm="cbba", insertion="shift", score=make_score("time_discounted"), network=network
    )
    wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
    return {
        "making": making,
        "wall": wall,
        "cpu": cpu,
        "peak": peak_memory(),
        "degree": sum(map(len, topology.links())) / agents,
        "diameter": network.diameter(),
        "status": found.status,
        "rounds": found.rounds,
        "last_bid_round": found.last_bid_round,
        "declared_round": found.declared_round,
        "messages": found.messages,
        "bytes": found.bytes,
        "total": found.plan.total_score,
    }


if __name__ == "__main__":
    print(json.dumps(measure(int(sys.argv[1]), int(sys.argv[2]), float(sys.argv[3]))))
