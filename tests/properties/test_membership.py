"""Agents that leave, crash and come back: the rest agrees on what greedy would do without them."""

from __future__ import annotations

import dataclasses
import random

import pytest

from fleet import Fleet, Link
from generators import SHAPES, graph_of, random_mission
from naive import SCORES, sequential_greedy
from naive_consensus import diameter
from swarmbid.algorithms.cbba import CBBA
from swarmbid.scores import make_score

DIMINISHING = SCORES["time_discounted fuel=start"]
OPTIONS = {"score": make_score("time_discounted", fuel="start"), "insertion": "hold"}
BAD = Link(loss=0.3, delay=3, duplicate=0.2)
SEEDS = 40


def connected_without(graph, victim: str) -> bool:
    rest = {i: [k for k in others if k != victim] for i, others in graph.items() if i != victim}
    try:
        diameter(rest)
    except ValueError:
        return False
    return True


def fleet_and_victim(seed: int, link: Link) -> tuple[Fleet, str, random.Random]:
    """A fleet some rounds into its run, and an agent whose loss does not part it."""
    rng = random.Random(seed)
    mission = random_mission(seed, ties=seed % 2 == 0, agents=(3, 6), tasks=(3, 9))
    graph = graph_of(rng, mission, SHAPES[seed % len(SHAPES)])
    victim = rng.choice([i for i in graph if connected_without(graph, i)])
    fleet = Fleet(mission, graph, seed=seed, link=link, options=OPTIONS)
    for _ in range(rng.randint(1, 8)):
        fleet.play_round()
    return fleet, victim, rng


def assert_greedy(fleet: Fleet, gone: str | None) -> None:
    """The agents that are there agree, and do what greedy gives them."""
    assert fleet.settle(300)
    mission = fleet.mission
    rest = dataclasses.replace(mission, agents=tuple(a for a in mission.agents if a.id != gone))
    bundles, _ = sequential_greedy(rest, DIMINISHING, "hold")
    assert {i: fleet.agents[i].path for i in bundles} == {i: b.path for i, b in bundles.items()}


@pytest.mark.parametrize("link", [Link(), BAD], ids=["good", "bad"])
def test_one_that_leaves_leaves_nothing_undone(link: Link):
    for seed in range(SEEDS):
        fleet, victim, _ = fleet_and_victim(seed, link)
        fleet.agents[victim].leave()
        assert_greedy(fleet, victim)


@pytest.mark.parametrize("link", [Link(), BAD], ids=["good", "bad"])
def test_one_that_crashed_is_done_without(link: Link):
    """One neighbour is told, or everybody. Its last words may arrive after the verdict: it stays gone."""
    for seed in range(SEEDS):
        fleet, victim, rng = fleet_and_victim(seed, link)
        fleet.crash(victim)
        for agent_id in list(fleet.agents) if seed % 2 else [rng.choice(fleet.graph[victim])]:
            for _ in range(rng.randint(0, 2)):
                fleet.play_round()
            fleet.agents[agent_id].lose_agent(victim)
        assert_greedy(fleet, victim)


@pytest.mark.parametrize("link", [Link(), BAD], ids=["good", "bad"])
def test_one_that_comes_back_is_taken_in_again(link: Link):
    """By all, also by those that do not hear it themselves, and for good."""
    for seed in range(SEEDS):
        fleet, victim, rng = fleet_and_victim(seed, link)
        fleet.crash(victim)
        fleet.agents[rng.choice(fleet.graph[victim])].lose_agent(victim)
        for _ in range(rng.randint(0, 12)):
            fleet.play_round()
        fleet.agents[victim] = CBBA(victim, fleet.arrays, incarnation=2, **OPTIONS)
        fleet.agents = dict(sorted(fleet.agents.items()))
        assert_greedy(fleet, None)
