"""1,000 agents and 10,000 tasks: one large team over radios that reach eight neighbours on average."""

from __future__ import annotations

import json
import sys
import time
from typing import Any

from benchmarks.measure import MEBIBYTE, Table, in_child, peak_memory

AGENTS, TASKS, MEAN_DEGREE, BUNDLE_LIMIT = 1000, 10_000, 8.0, 10
SECONDS, BYTES = 60.0, 2 * 2**30
"""Wall clock and resident memory promised."""


def run(quick: bool = False) -> Table:
    """Run the large mission, or a tenth of it."""
    agents, tasks = (AGENTS // 10, TASKS // 10) if quick else (AGENTS, TASKS)
    found = in_child("benchmarks.scale", str(agents), str(tasks))
    table = Table(
        f"{agents:,} agents, {tasks:,} tasks, range-limited graph, mean degree {MEAN_DEGREE:g}, "
        f"bundle limit {BUNDLE_LIMIT}",
        (
            "what", "wall s", "CPU s", "peak MiB", "links each", "diameter", "last bid", "agreed", "all know",
            "messages", "MB", "bytes each",
        ),
    )  # fmt: skip
    table.rows.append(
        (
            found["status"], f"{found['wall']:.1f}", f"{found['cpu']:.1f}",
            f"{found['peak'] / MEBIBYTE:.0f}", f"{found['degree']:.1f}", str(found["diameter"]),
            str(found["last_bid_round"]), str(found["rounds"]), str(found["declared_round"]),
            str(found["messages"]), f"{found['bytes'] / 1e6:.0f}",
            f"{found['bytes'] / found['messages']:.0f}",
        )
    )  # fmt: skip
    table.note(f"""
        `simulate` from the mission to agreement in a process of its own; loading compiled code
        from the disk cache included, making the mission ({found["making"]:.1f} s) not. 5M+2N would be
        {5 * tasks + 2 * agents:,} bytes a broadcast. Total score {found["total"]:.1f}.
    """)
    size = f"{agents:,} x {tasks:,}"
    each = found["bytes"] / found["messages"]
    table.bars.append((f"{size} reaches agreement", found["status"] == "converged"))
    table.bars.append((f"{size} in {found['wall']:.1f} s, promised {SECONDS:g}", found["wall"] <= SECONDS))
    table.bars.append((f"{size} in {found['peak'] / 2**30:.2f} GiB, promised 2", found["peak"] <= BYTES))
    table.bars.append((f"{size}: {each:.0f} bytes a broadcast, below 5M+2N", each < 5 * tasks + 2 * agents))
    return table


def measure(agents: int, tasks: int) -> dict[str, Any]:
    """Run once in this process."""
    from swarmbid.network import Network, agent_positions, make_topology
    from swarmbid.scenarios import uniform
    from swarmbid.scores import make_score
    from swarmbid.simulator import simulate

    begin = time.perf_counter()
    mission = uniform.make(
        seed=1, agents=agents, tasks=tasks, bundle_limit=BUNDLE_LIMIT, mean_degree=MEAN_DEGREE
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
    print(json.dumps(measure(int(sys.argv[1]), int(sys.argv[2]))))
