"""Whole CBBA runs to agreement, beside plain Python and what other implementations took.

Each instance runs in a child of its own, so that its peak memory is its own; a small mission first, so
that compiled code is loaded. CPU s of `simulate`, everything in it: arrays, bundles, messages, agreement.
"""

from __future__ import annotations

import json
import statistics
import sys
import time
from typing import Any

from benchmarks import instances, plain_cbba
from benchmarks.measure import MEBIBYTE, Table, in_child, peak_memory

BARS = {"std-20-100": 0.05, "std-50-200": 0.2, "std-100-500": 2.0}
"""CPU s after warm start, promised."""

PEERS = {
    "ados-swarm 0.1.0, Rust, optimised, as a whole process": {
        "std-20-100": "0.12",
        "std-50-200": "0.52",
        "std-100-500": "4.9",
    },
    "zehuilu/CBBA-Python at 269b14a, its `solve()`": {
        "std-20-100": "1.9",
        "std-50-200": "18",
        "std-100-500": "> 125",
    },
}
"""CPU s that other implementations took for the same instances, to the same totals. Measured by us once,
before swarmbid was written, on a machine of two cores; the last was stopped. Not repeated here."""

PLAIN_CAP = 20.0
"""CPU s after which the plain-Python run is cut off."""


def run(quick: bool = False) -> Table:
    """Run every instance."""
    table = Table(
        "Whole runs, complete graph, bundle limit 10",
        (
            "mission", "CPU s", "bar", "plain Python", "times", "last bid", "agreed", "all know",
            "messages", "bytes", "bytes each", "5M+2N", "peak MiB",
        ),
    )  # fmt: skip
    for name, bar in BARS.items():
        found = in_child("benchmarks.runs", name, "3" if quick else "9")
        data = instances.load(name)
        dense = 5 * len(data["tasks"]) + 2 * len(data["agents"])
        each = found["bytes"] / found["messages"]
        plain = plain_cbba.run(data, PLAIN_CAP / 10 if quick else PLAIN_CAP * 10)
        capped = "" if plain.finished else "> "
        seconds, total = found["seconds"], found["total"]
        table.rows.append(
            (
                name, f"{seconds:.3f}", f"{bar:g}", f"{capped}{plain.seconds:.1f}",
                f"{capped}{plain.seconds / seconds:.0f}", str(found["last_bid_round"]), str(found["rounds"]),
                str(found["declared_round"]), str(found["messages"]), str(found["bytes"]), f"{each:.0f}",
                str(dense), f"{found['peak'] / MEBIBYTE:.0f}",
            )
        )  # fmt: skip
        reached = abs(total - instances.central_greedy(name)) < 1e-6 and found["status"] == "converged"
        table.bars += [
            (f"{name} in {seconds:.3f} s of CPU, promised {bar:g}", seconds <= bar),
            (f"{name}: {each:.0f} bytes a broadcast, below 5M+2N = {dense}", each < dense),
            (f"{name}: total {total:.2f}, that of the central greedy", reached),
        ]
        if plain.finished and abs(plain.total - instances.central_greedy(name)) > 1e-6:
            raise AssertionError(f"The plain-Python CBBA reached {plain.total} on {name}: it is wrong.")
    table.note("""
        CPU s after warm start, median. Rounds: the last in which a task was taken; after which all believed
        the same; in which the last agent knew that all agree. Bytes: of all broadcasts. Peak: of the whole
        child process. Plain Python: the CBBA written for this benchmark, `benchmarks/plain_cbba.py`, whole
        states every round; `>` where it was cut off.
    """)
    for who, seconds in PEERS.items():
        figures = ", ".join(f"{name} {value} s" for name, value in seconds.items())
        table.note(
            f"For comparison, measured by us once on another day and not repeated here: {who}: {figures}."
        )
    return table


def measure(name: str, repeats: int) -> dict[str, Any]:
    """Run one instance in this process."""
    from swarmbid.scores import make_score
    from swarmbid.simulator import simulate

    def once(mission: Any) -> Any:
        score = make_score("time_discounted")
        return simulate(mission, algorithm="cbba", insertion="shift", score=score)

    mission = instances.mission(name)
    once(instances.mission("std-5-20"))
    seconds = []
    for _ in range(repeats):
        begin = time.process_time()
        found = once(mission)
        seconds.append(time.process_time() - begin)
    return {
        "seconds": statistics.median(seconds),
        "status": found.status,
        "rounds": found.rounds,
        "last_bid_round": found.last_bid_round,
        "declared_round": found.declared_round,
        "messages": found.messages,
        "bytes": found.bytes,
        "total": found.plan.total_score,
        "peak": peak_memory(),
    }


if __name__ == "__main__":
    print(json.dumps(measure(sys.argv[1], int(sys.argv[2]))))
