"""What must hold of CBGA on every mission, every connected graph and every bad link.

One right answer for each mission: what the slow twin's central planner does. Whatever the network does to
messages, all come to that and know it. Plans are proved from the mission alone by `verify`.
"""

from __future__ import annotations

import itertools
import math
import os
import random
import statistics
from collections import Counter
from functools import cache
from typing import Any

import pytest

from coalition_missions import FAMILIES, missions
from naive_coalition import Agreement, central
from same_exponential import share_exponential
from swarmbid.model import Mission
from swarmbid.network import Network, Partition, make_topology
from swarmbid.scores import make_score
from swarmbid.simulator import Run, simulate
from swarmbid.verify import verify

NAMES = ("time_discounted", "distance_cost", "time_window", "revisit")
GRAPHS = ("complete", "ring", "line", "geometric")
SIZES: dict[str, tuple[int, int]] = {"agents": (3, 6), "tasks": (2, 7)}
SEEDS = 8
MANY_ROUNDS = 20_000
"""When to give up. Each quit costs a whole agreement, and a bad network needs hundreds of rounds for some."""
ROUNDING = 1e-12
"""Relative rounding allowed in bids; groups, paths and starts must be the twin's exactly."""


@pytest.fixture(autouse=True)
def one_exponential(monkeypatch: pytest.MonkeyPatch) -> None:
    share_exponential(monkeypatch)


def parted(num_agents: int) -> Partition:
    """One half hears nothing of the other, from early on until long after each has come to rest."""
    return Partition(groups=[range(num_agents // 2)], start=2.0, end=60.0)


CONDITIONS: dict[str, dict[str, Any]] = {
    "nothing amiss": {},
    "loss 0.3": {"loss": 0.3},
    "loss 0.7": {"loss": 0.7},
    "late, and out of order": {"delay": 3.0},
    "many messages twice": {"duplicate": 0.5, "replay": 0.2, "delay": 1.0},
    "parted for a while": {"parted": True, "loss": 0.2},
    "everybody in its own time": {"mode": "asynchronous", "loss": 0.3, "delay": 0.5},
}


def switches(seed: int) -> dict[str, Any]:
    """Everything that all agents of a run must have in common; chance, not to go in step with the graphs."""
    rng = random.Random(f"switches {seed}")
    return {
        "quitting": rng.random() < 0.75,
        "dissolve": rng.choice([0.0, 0.0, 0.5, 1.0]),
        "team_rewards": rng.random() < 0.5,
        "insertion": rng.choice(["shift", "shift", "append"]),
    }


def score_name(seed: int) -> str:
    return random.Random(f"score {seed}").choice(NAMES)


@cache
def wanted(family: str, seed: int, windows: bool | None = None) -> Agreement:
    """What the central planner does; the same whatever the network, so asked once."""
    mission = missions(seed, family, windows=windows, **SIZES)
    return central(mission, make_score(score_name(seed)), **switches(seed))


def run(mission: Mission, seed: int, graph: str = "complete", **how: Any) -> Run:
    """One run of the mission in simulated time; `how` as in `CONDITIONS`, or options of the algorithm."""
    how = dict(how)
    faults = {name: how.pop(name) for name in ("loss", "delay", "duplicate", "replay") if name in how}
    if how.pop("parted", False):
        faults["partitions"] = [parted(len(mission.agents))]
    network = Network(make_topology(graph, len(mission.agents), seed=seed), seed=seed, **faults)
    options = {"score": make_score(score_name(seed)), "seed": seed, "max_rounds": MANY_ROUNDS}
    options |= {**switches(seed), **how}
    return simulate(mission, algorithm="cbga", network=network, **options)


def assert_as_wanted(found: Run, agreed: Agreement, where: object) -> None:
    """All agree, and know it, on the central planner's groups, starts, paths, bids and bars."""
    assert found.status == "converged", where
    assert found.paths == agreed.outcome.complete_paths(), where
    bids = {(name, one.task): one.bid for name, record in agreed.records.items() for one in record}
    for negotiator in found.negotiators:
        held = {task: dict(holders) for task, holders in negotiator.beliefs().items() if holders}
        assert {task: sorted(holders) for task, holders in held.items()} == agreed.outcome.members, where
        for task, holders in held.items():
            for name, bid in holders.items():
                assert math.isclose(bid, bids[name, task], rel_tol=ROUNDING), where
    assert verify(found.mission, found.plan, found.score) == [], where


def bars(found: Run) -> list[set[tuple[str, str]]]:
    """Who must not bid on what, by each agent's own account."""
    return [
        {(one._arrays.agent_ids[agent], one._arrays.task_ids[task]) for agent, task in one._bars}
        for one in found.negotiators
    ]


@pytest.mark.parametrize("how", CONDITIONS)
def test_whatever_the_network_does_all_come_to_the_same(how: str, effort: int):
    """Every family, each graph in turn: groups, starts, paths, bids, bars; and never a false agreement."""
    for family in FAMILIES:
        for seed in range(SEEDS * effort):
            mission, agreed = missions(seed, family, **SIZES), wanted(family, seed)
            found = run(mission, seed, GRAPHS[seed % len(GRAPHS)], **CONDITIONS[how])
            assert_as_wanted(found, agreed, (family, seed))
            assert bars(found) == [set(agreed.barred)] * len(mission.agents), (family, seed)
            assert found.false_agreements == 0, (family, seed)


@pytest.mark.parametrize("graph", GRAPHS)
def test_without_quitting_an_entry_costs_as_many_rounds_as_the_network_is_wide(graph: str, effort: int):
    """After each round as many hops as the diameter has, one entry more is what it will be for good."""
    worst = 0.0
    for family in FAMILIES:
        for seed in range(20, 20 + 3 * effort):
            mission = missions(seed, family, agents=(4, 6), tasks=(2, 7))
            found = run(mission, seed, graph, quitting=False)
            width = Network(make_topology(graph, len(mission.agents), seed=seed)).diameter()
            entries = sum(len(one.bundle) for one in found.negotiators)
            assert found.converged, (family, seed)
            worst = max(worst, found.rounds / ((entries + 1) * max(1, width)))
    assert 0.0 < worst <= 1.0


@pytest.mark.parametrize("label", ["distance_cost", "time_discounted"])
def test_with_one_agent_a_task_it_is_cbba(label: str, effort: int):
    """The same paths at the same times, and the same bids, bit for bit."""
    taken = 0
    for seed in range(20 * effort):
        mission = missions(seed, "single", **SIZES)
        options = {"score": make_score(label), "insertion": "shift", "seed": seed}
        grouped = simulate(mission, algorithm="cbga", team_rewards=seed % 2 == 1, **options)
        auctioned = simulate(mission, algorithm="cbba", **options)
        assert grouped.converged, seed
        assert auctioned.converged, seed
        assert grouped.paths == auctioned.paths, seed
        assert grouped.negotiators[0].beliefs() == auctioned.negotiators[0].beliefs(), seed
        taken += sum(len(path) for path in grouped.paths.values())
    assert taken > 40


def test_quitting_ends_with_no_group_left_incomplete(effort: int):
    """At most one quit for each pair of agent and task, for every share that is dissolved at a time."""
    quits = 0
    for family in ("L2", "L4", "AB", "ABC", "open"):
        for seed in range(40, 40 + 4 * effort):
            mission = missions(seed, family, **SIZES)
            found = run(mission, seed, quitting=True, dissolve=random.Random(seed).choice([0.0, 0.3, 1.0]))
            assert found.converged, (family, seed)
            count = len(bars(found)[0])
            quits += count
            assert count <= len(mission.agents) * len(mission.tasks), (family, seed)
            seats = {task.id: task.agents_required for task in mission.tasks}
            for task, holders in found.negotiators[0].beliefs().items():
                assert not holders or seats[task] in (0, len(holders)), (family, seed)
            assert verify(mission, found.plan, found.score) == [], (family, seed)
    assert quits > 20


def test_who_quits_before_all_agree_still_comes_to_rest(effort: int):
    """With `quit_after` an agent may be wrong to quit; all agree in the end, on a plan that can be flown."""
    for family in FAMILIES:
        for seed in range(60, 60 + 2 * effort):
            mission = missions(seed, family, **SIZES)
            found = run(mission, seed, "ring", quitting=True, quit_after=3.0, loss=0.4)
            assert found.converged, (family, seed)
            assert verify(mission, found.plan, found.score) == [], (family, seed)


@pytest.mark.skipif(os.environ.get("SWARMBID_LONG") != "1", reason="minutes long; SWARMBID_LONG=1 runs it")
def test_two_thousand_missions(capsys: pytest.CaptureFixture[str]):
    """Every family, graph, with and without windows, on a good network and on a bad one; prints the figures.

    "patient": runs that needed more rounds than `simulate` waits by default.
    """
    each, bad = 32, [how for how in CONDITIONS if how != "nothing amiss"]
    counted = ("missions", "runs", "converged", "as central", "verified", "patient", "quits")
    total: Counter[str] = Counter()

    def tell(*words: object) -> None:
        with capsys.disabled():
            print(" ".join(f"{word!s:>13}" for word in words), flush=True)

    tell("family", "graph", "windows", *counted, "rounds", "most")
    cells = itertools.product(FAMILIES, enumerate(GRAPHS), (False, True))
    for family, (place, graph), windows in cells:
        count: Counter[str] = Counter(missions=each)
        rounds = []
        for seed in range(1000 + each * place, 1000 + each * (place + 1)):
            mission, agreed = missions(seed, family, windows=windows, **SIZES), wanted(family, seed, windows)
            count["quits"] += len(agreed.quits)
            for how in ("nothing amiss", bad[seed % len(bad)]):
                found = run(mission, seed, graph, max_rounds=None, **CONDITIONS[how])
                if not found.converged:
                    count["patient"] += 1
                    found = run(mission, seed, graph, **CONDITIONS[how])
                count["runs"] += 1
                count["converged"] += found.converged
                count["verified"] += verify(mission, found.plan, found.score) == []
                try:
                    assert_as_wanted(found, agreed, (family, seed, windows, how))
                    assert bars(found) == [set(agreed.barred)] * len(mission.agents)
                    count["as central"] += 1
                except AssertionError as error:
                    tell("differs:", family, seed, windows, graph, how, error)
                rounds.append(found.rounds)
        total += count
        counts = [count[name] for name in counted]
        tell(family, graph, windows, *counts, statistics.median(rounds), max(rounds))
    tell("all", "", "", *[total[name] for name in counted])
    assert total["missions"] >= 2000
    assert total["runs"] == total["converged"] == total["as central"] == total["verified"]
