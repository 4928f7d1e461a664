"""Missions with exact answers of another implementation, and totals of a central greedy.

Source, licence and fields: ``testdata/cross_check/README.md``.

With windows many bids are tied: whoever is there before a task opens bids its whole reward. Their code
breaks ties between agents by the smaller number, ours by the higher id, so the last agent becomes
``a000``. Among its own tied tasks an agent of theirs takes the one that opens first, then the smaller
number: the task that opens first becomes ``t000``. The central greedy's `append` and `insert` took the
smaller number whenever it opens: there the rewards fall by 1e-13 of themselves from number to number,
which unties them in that order and changes no total that matters.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from swarmbid.model import Agent, Mission, Task

FOLDER = Path(__file__).parent / "testdata" / "cross_check"

INSERTION = {"append": "append", "insert": "shift", "promise": "hold"}
"""The reference's word for a rule -> ours."""

Links = list[tuple[int, ...]]
"""For each agent, in order of id, the rows of those that hear it."""


@dataclass(frozen=True)
class Expected:
    """The other implementation's answer.

    Parameters
    ----------
    bundles : agent id -> task ids in order of taking.
    paths : agent id -> (task id, start of service s) in order of doing.
    winners : task id -> agent id, without the tasks that nobody won.
    bids : task id -> winning bid, likewise.
    total : score in all.
    last_bid_round : the last round in which a bid changed.
    """

    bundles: dict[str, list[str]]
    paths: dict[str, list[tuple[str, float]]]
    winners: dict[str, str]
    bids: dict[str, float]
    total: float
    last_bid_round: int


@dataclass(frozen=True)
class Reference:
    """The central greedy's plan by one rule: agent id -> task ids in order of doing; and its score."""

    insertion: str
    instance: str
    ties: str
    paths: dict[str, list[str]]
    total: float


def solved() -> list[str]:
    """Names of the missions that have an exact answer."""
    return [name for name in _names() if "-" not in name or name.startswith("graph")]


def large() -> list[str]:
    """Names of the larger missions, which have totals of the central greedy."""
    return [name for name in _names() if name not in solved()]


def load_instance(name: str, *, ties: str = "start") -> tuple[Mission, Expected | None, Links | None]:
    """Return the mission, its answer if it has one, and its graph, None for a complete one.

    Parameters
    ----------
    ties : which of its tied tasks an agent takes: "start" for the one that opens first, as the other
        implementation does, "number" for the smallest number, by rewards that fall by a hair.
    """
    data, ids = _load(name, ties)
    instance = data.get("instance", data)
    graph = instance.get("comm_graph")
    links = None
    if graph is not None:
        # Rows follow the ids, which run against the numbers.
        order = sorted(range(len(graph)), key=lambda number: ids.agents[number])
        links = [tuple(row for row, k in enumerate(order) if graph[number][k]) for number in order]
    hair = 1e-13 if ties == "number" else 0.0
    return _mission(instance, ids, hair), _expected(data["result"], ids) if "result" in data else None, links


def references() -> list[Reference]:
    """Return every result of the central greedy."""
    found = []
    for path in sorted((FOLDER / "reference").glob("*.json")):
        data = json.loads(path.read_text(encoding="utf-8"))
        # By that greedy's own records: promised times broke ties by opening, the others by number.
        ties = "start" if data["rule"] == "promise" else "number"
        _, ids = _load(data["instance"], ties)
        paths = {ids.agents[k]: [ids.tasks[j] for j in tasks] for k, tasks in enumerate(data["paths"])}
        found.append(Reference(INSERTION[data["rule"]], data["instance"], ties, paths, data["total_score"]))
    return found


@dataclass(frozen=True)
class _Ids:
    """Number -> id."""

    agents: list[str]
    tasks: list[str]


def _names() -> list[str]:
    return sorted(path.stem for path in FOLDER.glob("*.json"))


def _load(name: str, ties: str) -> tuple[dict[str, Any], _Ids]:
    data = json.loads((FOLDER / f"{name}.json").read_text(encoding="utf-8"))
    instance = data.get("instance", data)
    starts = [task["start"] if ties == "start" else 0.0 for task in instance["tasks"]]
    order = sorted(range(len(starts)), key=lambda number: (starts[number], number))
    last = len(instance["agents"]) - 1
    agents = [f"a{last - number:03d}" for number in range(last + 1)]
    return data, _Ids(agents, [f"t{order.index(number):03d}" for number in range(len(order))])


def _mission(instance: dict[str, Any], ids: _Ids, hair: float) -> Mission:
    agents = tuple(
        Agent(
            id=ids.agents[item["id"]],
            type=f"type{item['type']}",
            position=(item["x"], item["y"], item["z"]),
            speed=item["speed"],
            available_at=item["availability"],
            bundle_limit=instance["bundle_limit"],
        )
        for item in instance["agents"]
    )
    tasks = tuple(
        Task(
            id=ids.tasks[item["id"]],
            type=f"kind{item['type']}",
            position=(item["x"], item["y"], item["z"]),
            reward=item["value"] * (1.0 - hair * item["id"]),
            start=item["start"],
            end=item["end"],
            duration=item["duration"],
            discount=item["discount"],
        )
        for item in instance["tasks"]
    )
    compatible = {
        f"type{row}": frozenset(f"kind{column}" for column, may in enumerate(columns) if may)
        for row, columns in enumerate(instance["compat"])
    }
    return Mission(agents=agents, tasks=tasks, compatible=compatible, name=instance["name"])


def _expected(result: dict[str, Any], ids: _Ids) -> Expected:
    first = result["agents"][0]
    if not all(one["winners"] == first["winners"] for one in result["agents"]):
        raise ValueError("the fixture's agents do not agree")
    won = {j: k for j, k in enumerate(first["winners"]) if k >= 0}
    return Expected(
        bundles={ids.agents[one["agent"]]: [ids.tasks[j] for j in one["bundle"]] for one in result["agents"]},
        paths={
            ids.agents[one["agent"]]: [
                (ids.tasks[j], start) for j, start in zip(one["path"], one["times"], strict=True)
            ]
            for one in result["agents"]
        },
        winners={ids.tasks[j]: ids.agents[k] for j, k in won.items()},
        bids={ids.tasks[j]: first["winner_bids"][j] for j in won},
        total=result["true_score"],
        last_bid_round=result["last_bid_round"],
    )
