"""The slow twins among themselves, and against numbers worked out by hand: who guards the guards."""

from __future__ import annotations

import dataclasses
import random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from generators import SHAPES, graph_of, graphs, make_graph, missions, random_mission
from naive import SCORES, Judge, optimum, outbids, sequential_greedy
from naive_consensus import Outcome, cbaa, cbba, decide, diameter, n_min, row_of
from swarmbid.model import Agent, Mission, Task

DIMINISHING = SCORES["time_discounted fuel=start"]
SEEDS = 150


def agree(outcome: Outcome, bundles: dict) -> bool:
    """Whether a run ended with exactly these bundles, bids, paths and times."""
    return outcome.converged and outcome.bundles == bundles


def test_one_order_of_bids():
    assert outbids(2.0, "a", 1.0, "b")
    assert outbids(1.0, "b", 1.0, "a") and not outbids(1.0, "a", 1.0, "b")
    assert not outbids(1.0, "a", 1.0, "a")
    assert outbids(0.1, "a", 0.0, None) and not outbids(0.0, None, 0.1, "a")
    assert outbids(1.0, "b10", 1.0, "B2")  # bytes: "b" is 0x62, "B" is 0x42


def test_an_insertion_by_hand():
    """At 2 m/s from 0: t2 at 20 m is reached at 10 s, t1 at 10 m on the way at 5 s, service 3 s.

    Held, t1 would have to start by 10 - 3 - 5 = 2 s: too early, so it comes after, at 10 + 5 = 15 s.
    Shifted, t1 starts at 5 s and t2 slips to 5 + 3 + 5 = 13 s. At 0.1 per s and 10 a task, the path is
    worth 10 (e^-0.5 + e^-1.3) against 10 (e^-1 + e^-1.5) with t1 last: 8.791 against 5.910.
    """
    tasks = (
        Task(id="t1", position=(10.0, 0.0, 0.0), reward=10.0, discount=0.1, duration=3.0),
        Task(id="t2", position=(20.0, 0.0, 0.0), reward=10.0, discount=0.1),
    )
    agent = Agent(id="a", position=(0.0, 0.0, 0.0), speed=2.0)
    mission = Mission(agents=(agent,), tasks=tasks)
    held = Judge(mission, agent, DIMINISHING, "hold")
    assert held.insert([("t2", 10.0)], 0, tasks[0]) is None
    assert held.insert([("t2", 10.0)], 1, tasks[0]) == [("t2", 10.0), ("t1", 15.0)]
    shifted = Judge(mission, agent, DIMINISHING, "shift")
    best = shifted.best_insertion([("t2", 10.0)], tasks[0])
    assert best is not None
    assert best[1:] == (0, [("t1", 5.0), ("t2", 13.0)])
    assert shifted.path_score(best[2]) == pytest.approx(8.7906, abs=1e-4)
    assert best[0] == pytest.approx(8.7906 - 3.6788, abs=1e-4)


def test_a_release_keeps_the_winner_of_the_lost_task_and_opens_the_later_ones():
    """b is nearer to t1; a took t1 and then t2 behind it. Losing t1, a gives up t2 and takes it again.

    Rewards 10 at 0.1 per s, 1 m/s. a at 0: t1 (10 m) for 10 e^-1 = 3.68, t2 (20 m) for 10 e^-2 = 1.35.
    b at 12 m with room for one: t1 for 10 e^-0.2 = 8.19. The end: b has t1, a has t2.
    """
    mission = Mission(
        agents=(
            Agent(id="a", position=(0.0, 0.0, 0.0)),
            Agent(id="b", position=(12.0, 0.0, 0.0), bundle_limit=1),
        ),
        tasks=(
            Task(id="t1", position=(10.0, 0.0, 0.0), reward=10.0, discount=0.1),
            Task(id="t2", position=(20.0, 0.0, 0.0), reward=10.0, discount=0.1),
        ),
    )
    for rebuild in (True, False):
        outcome = cbba(mission, make_graph(["a", "b"], "line"), DIMINISHING, "hold", rebuild=rebuild)
        assert outcome.converged
        assert outcome.paths == {"a": [("t2", 20.0)], "b": [("t1", 2.0)]}


@pytest.mark.parametrize(
    ("theirs", "mine", "row"),
    [(t, m, None) for t in ("i", "k", "m", "n", None) for m in ("i", "k", "m", "n", None)],
)
def test_without_news_and_with_a_better_bid_only_these_rows_act(theirs, mine, row):
    """All stamps equal, the sender's bid higher: 1, 3 update; 2, 4, 15 update; 6, 10 reset; rest leave."""
    expected = {1: "update", 2: "update", 3: "update", 4: "update", 6: "reset", 10: "reset", 15: "update"}
    same = dict.fromkeys("ikmn", 3.0)
    bids = (5.0 if theirs else 0.0, 4.0 if mine else 0.0)
    said = decide("i", "k", theirs, bids[0], mine, bids[1], same, same)
    assert said == expected.get(row_of("i", "k", theirs, mine), "leave")


@given(data=st.data())
def test_cbba_equals_sequential_greedy_within_the_theorems_rounds(data):
    mission = data.draw(missions())
    graph = data.draw(graphs(mission))
    bundles, _ = sequential_greedy(mission, DIMINISHING, "hold")
    outcome = cbba(mission, graph, DIMINISHING, "hold")
    assert agree(outcome, bundles)
    assert outcome.rounds <= n_min(mission) * max(1, diameter(graph))


@pytest.mark.parametrize("ties", [False, True])
@pytest.mark.parametrize("shape", SHAPES)
def test_cbba_equals_sequential_greedy_on_many_missions(shape: str, ties: bool, effort: int):
    """Own stamps and the papers' reception stamps alike, in rounds without loss."""
    for seed in range(SEEDS * effort // 5):
        mission = random_mission(seed, ties=ties, ranges=seed % 3 == 0)
        graph = graph_of(random.Random(seed), mission, shape)
        bundles, _ = sequential_greedy(mission, DIMINISHING, "hold")
        for stamps in ("own", "reception"):
            outcome = cbba(mission, graph, DIMINISHING, "hold", stamps=stamps)
            assert agree(outcome, bundles), seed
            assert outcome.rounds <= n_min(mission) * max(1, diameter(graph)), seed


@pytest.mark.parametrize("ties", [False, True])
@pytest.mark.parametrize(("label", "rule"), [("distance_cost", "shift"), ("time_discounted", "shift")])
def test_warped_cbba_equals_warped_greedy_without_diminishing_gains(label: str, rule: str, ties: bool):
    for seed in range(40):
        mission = random_mission(seed, ties=ties, reward_scale=12.0 if label == "distance_cost" else 1.0)
        graph = graph_of(random.Random(seed), mission, SHAPES[seed % len(SHAPES)])
        bundles, _ = sequential_greedy(mission, SCORES[label], rule, warp=True)
        assert agree(cbba(mission, graph, SCORES[label], rule, warp=True), bundles), seed


def test_with_the_papers_row_12_a_mesh_can_disagree_for_ever():
    """The reason for departing from it. The winners themselves know; some third parties never learn.

    i believes n; m lives next to both i and k, so their news of m is equally old, and k's news of n is
    always newer. n gave the task up long ago and m has it for less: row 12 of the paper leaves that.
    """
    stuck = 0
    for seed in (8, 21, 31):
        rng = random.Random(seed)
        mission = random_mission(seed, ties=seed % 2 == 0, agents=(20, 20), tasks=(40, 40))
        graph = dense_mesh(rng, [agent.id for agent in mission.agents])
        bundles, _ = sequential_greedy(mission, DIMINISHING, "hold", warp=True)
        paper = cbba(mission, graph, DIMINISHING, "hold", warp=True, row_12="paper")
        assert paper.bundles == bundles, seed
        stuck += not paper.converged
        assert agree(cbba(mission, graph, DIMINISHING, "hold", warp=True), bundles), seed
    assert stuck == 3


def dense_mesh(rng: random.Random, ids: list[str]) -> dict[str, list[str]]:
    """A random tree and two random links more for each agent."""
    rng.shuffle(ids)
    edges = {frozenset((ids[k], ids[rng.randrange(k)])) for k in range(1, len(ids))}
    edges |= {frozenset(rng.sample(ids, 2)) for _ in range(2 * len(ids))}
    return {i: sorted(k for k in ids if k != i and frozenset((i, k)) in edges) for i in ids}


def test_without_warping_distance_cost_runs_into_cycles():
    """The reason for warping: of 30 missions several never settle."""
    cycles = 0
    for seed in range(30):
        mission = random_mission(seed, ties=True, reward_scale=12.0)
        graph = graph_of(random.Random(seed), mission, "ring")
        cycles += not cbba(mission, graph, SCORES["distance_cost"], "shift", max_rounds=100).converged
    assert cycles >= 3


def test_the_incremental_bundle_departs_from_greedy_now_and_then():
    """The reason for rebuilding. At a bundle limit of 1 the two are the same."""
    different = 0
    for seed in range(200, 420):
        mission = random_mission(seed, ties=True, agents=(2, 7), tasks=(2, 12))
        graph = graph_of(random.Random(seed), mission, SHAPES[seed % len(SHAPES)])
        bundles, _ = sequential_greedy(mission, DIMINISHING, "hold")
        different += not agree(cbba(mission, graph, DIMINISHING, "hold", rebuild=False), bundles)
        if seed % 4 == 0:
            single = dataclasses.replace(
                mission, agents=tuple(dataclasses.replace(a, bundle_limit=1) for a in mission.agents)
            )
            bundles, _ = sequential_greedy(single, DIMINISHING, "hold")
            assert agree(cbba(single, graph, DIMINISHING, "hold", rebuild=False), bundles), seed
    assert 1 <= different <= 22  # 1 to 10 %


@given(data=st.data())
def test_cbaa_equals_greedy_with_one_task_each(data):
    drawn = data.draw(missions())
    mission = dataclasses.replace(
        drawn, agents=tuple(dataclasses.replace(agent, bundle_limit=1) for agent in drawn.agents)
    )
    graph = data.draw(graphs(mission))
    bundles, _ = sequential_greedy(mission, DIMINISHING, "append")
    outcome = cbaa(mission, graph, DIMINISHING)
    assert agree(outcome, bundles)
    assert outcome.rounds <= n_min(mission) * max(1, diameter(graph))


@given(mission=missions(max_agents=3, max_tasks=5))
def test_greedy_is_worth_at_least_half_the_optimum(mission: Mission):
    bundles, _ = sequential_greedy(mission, DIMINISHING, "hold")
    total = sum(sum(bundle.bids) for bundle in bundles.values())
    assert total >= optimum(mission, DIMINISHING) / 2 - 1e-9
    assert total <= optimum(mission, DIMINISHING) + 1e-9
