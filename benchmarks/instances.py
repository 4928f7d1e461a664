"""The missions that whole runs are timed on: `std-A-T` of the cross-check data, A agents and T tasks.

Speed 10 m/s, a square of 1,000 m, discount 0.01 1/s, bundle limit 10, complete graph. Their source and
licence are in ``tests/testdata/cross_check/README.md``.
"""

from __future__ import annotations

import json
from typing import Any

from benchmarks.measure import ROOT
from swarmbid.model import Agent, Mission, Task

FOLDER = ROOT / "tests" / "testdata" / "cross_check"

NAMES = ("std-20-100", "std-50-200", "std-100-500")


def load(name: str) -> dict[str, Any]:
    """Return an instance as it is on file."""
    data: dict[str, Any] = json.loads((FOLDER / f"{name}.json").read_text(encoding="utf-8"))
    return data


def central_greedy(name: str) -> float:
    """Return the total score of the central greedy that delays later tasks, which CBBA must reach."""
    path = FOLDER / "reference" / f"insert__{name}.json"
    return float(json.loads(path.read_text(encoding="utf-8"))["total_score"])


def mission(name: str) -> Mission:
    """Return an instance as a mission."""
    data = load(name)
    return Mission(
        agents=tuple(
            Agent(
                id=f"a{item['id']:03d}",
                position=(item["x"], item["y"], item["z"]),
                speed=item["speed"],
                available_at=item["availability"],
                bundle_limit=data["bundle_limit"],
            )
            for item in data["agents"]
        ),
        tasks=tuple(
            Task(
                id=f"t{item['id']:03d}",
                position=(item["x"], item["y"], item["z"]),
                reward=item["value"],
                start=item["start"],
                end=item["end"],
                duration=item["duration"],
                discount=item["discount"],
            )
            for item in data["tasks"]
        ),
        name=name,
    )
