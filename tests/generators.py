"""Random missions and graphs, for hypothesis (which shrinks them) and by seed (which is fast).

Half of everything is full of ties: positions on a coarse grid, equal rewards, equal discounts.
"""

from __future__ import annotations

import random

from hypothesis import strategies as st

from naive_consensus import Graph
from swarmbid.model import Agent, Mission, Task

SHAPES = ("complete", "ring", "line", "star", "tree", "mesh")


def make_graph(agent_ids: list[str], shape: str, parents: list[int] | None = None) -> Graph:
    """A connected graph; for a "tree", agent k + 1 hangs on agent parents[k] (any number of 0..k).

    A "mesh" is a tree with half as many links again: triangles with tails, where news of one agent
    comes by several ways of different length.
    """
    size = len(agent_ids)
    if shape == "complete":
        edges = [(a, b) for a in range(size) for b in range(a)]
    elif shape == "ring":
        edges = [(a, (a + 1) % size) for a in range(size if size > 2 else size - 1)]
    elif shape == "line":
        edges = [(a, a + 1) for a in range(size - 1)]
    elif shape == "star":
        edges = [(0, a) for a in range(1, size)]
    elif shape in ("tree", "mesh"):
        drawn = parents or [0] * size
        edges = [(a, drawn[a - 1] % a) for a in range(1, size)]
        if shape == "mesh":
            edges += [(a, drawn[a - 1] // size % size) for a in range(1, size, 2)]
    else:
        raise ValueError(shape)
    graph: Graph = {agent_id: [] for agent_id in agent_ids}
    for a, b in sorted({(min(edge), max(edge)) for edge in edges if edge[0] != edge[1]}):
        graph[agent_ids[a]].append(agent_ids[b])
        graph[agent_ids[b]].append(agent_ids[a])
    return {agent_id: sorted(others, key=str.encode) for agent_id, others in graph.items()}


def graph_of(rng: random.Random, mission: Mission, shape: str) -> Graph:
    """A graph of the named shape over the mission's agents, in an order drawn from `rng`."""
    ids = [agent.id for agent in mission.agents]
    rng.shuffle(ids)
    return make_graph(ids, shape, [rng.randrange(1 << 16) for _ in ids])


def random_mission(
    seed: int,
    *,
    ties: bool = False,
    agents: tuple[int, int] = (2, 6),
    tasks: tuple[int, int] = (1, 10),
    windows: bool = True,
    fuel: bool = True,
    limits: bool = True,
    ranges: bool = False,
    revisits: bool = False,
    reward_scale: float = 1.0,
) -> Mission:
    """A small mission from `seed`; `agents` and `tasks` are the least and most of them.

    Speeds are powers of two, so that a division and a product with the inverse give the same bits.
    """
    rng = random.Random(seed)
    side = 4 if ties else 100

    def place() -> tuple[float, float, float]:
        if ties:
            return (10.0 * rng.randrange(side), 10.0 * rng.randrange(side), 0.0)
        return (rng.uniform(0, side), rng.uniform(0, side), rng.uniform(0, 10))

    def number(low: float, high: float, *tied: float) -> float:
        return rng.choice(tied) if ties else rng.uniform(low, high)

    discount = rng.choice([0.01, 0.05]) if ties else None
    with_windows = windows and rng.random() < 0.5
    team = []
    for i in range(rng.randint(*agents)):
        home = place()
        team.append(
            Agent(
                id=f"a{i}",
                position=home,
                speed=rng.choice([1.0, 2.0]),
                available_at=number(0, 10, 0.0) if windows else 0.0,
                fuel_per_metre=number(0, 0.02, 0.0, 0.0, 0.25) if fuel else 0.0,
                bundle_limit=rng.choice([None, 1, 2, 3]) if limits else None,
                range=number(60, 400, 60.0, 120.0) if ranges and rng.random() < 0.7 else float("inf"),
                endurance=number(60, 400, 60.0, 120.0) if ranges and rng.random() < 0.5 else float("inf"),
                base=home if ranges and rng.random() < 0.5 else None,
            )
        )
    work = []
    for j in range(rng.randint(*tasks)):
        opens = number(0, 60, 0.0, 20.0, 40.0) if with_windows else 0.0
        work.append(
            Task(
                id=f"t{j:02}",
                position=place(),
                reward=reward_scale * number(1, 10, 5.0, 5.0, 5.0, 8.0),
                start=opens,
                end=opens + number(5, 60, 10.0, 20.0) if with_windows else float("inf"),
                duration=number(0, 10, 0.0, 5.0),
                discount=discount if discount is not None else rng.uniform(0.001, 0.05),
                revisit_at=number(0, 80, 0.0, 30.0) if revisits and rng.random() < 0.5 else None,
                revisit_width=number(5, 50, 20.0) if revisits else 60.0,
            )
        )
    return Mission(agents=tuple(team), tasks=tuple(work))


@st.composite
def missions(
    draw: st.DrawFn,
    *,
    max_agents: int = 5,
    max_tasks: int = 7,
    windows: bool = True,
    fuel: bool = True,
    ties: bool | None = None,
) -> Mission:
    """Missions that hypothesis can shrink: integers for everything, ties on a coarse grid."""
    tied = draw(st.booleans()) if ties is None else ties
    grid = st.integers(0, 3).map(lambda x: 10.0 * x) if tied else st.integers(0, 1000).map(lambda x: x / 8)
    places = st.tuples(grid, grid, st.just(0.0))
    discount = draw(st.sampled_from([0.0, 0.01, 0.05]))
    team = [
        Agent(
            id=f"a{i}",
            position=draw(places),
            speed=draw(st.sampled_from([1.0, 2.0])),
            available_at=draw(st.sampled_from([0.0, 0.0, 7.0])),
            fuel_per_metre=draw(st.sampled_from([0.0, 0.03125])) if fuel else 0.0,
            bundle_limit=draw(st.sampled_from([None, 1, 2])),
        )
        for i in range(draw(st.integers(1, max_agents)))
    ]
    rewards = st.sampled_from([5.0, 5.0, 8.0]) if tied else st.integers(1, 500).map(lambda x: x / 8)
    work = []
    for j in range(draw(st.integers(1, max_tasks))):
        opens = draw(st.sampled_from([0.0, 0.0, 20.0])) if windows else 0.0
        length = draw(st.sampled_from([float("inf"), 10.0, 30.0])) if windows else float("inf")
        work.append(
            Task(
                id=f"t{j}",
                position=draw(places),
                reward=draw(rewards),
                start=opens,
                end=opens + length,
                duration=draw(st.sampled_from([0.0, 5.0])),
                discount=discount,
            )
        )
    return Mission(agents=tuple(team), tasks=tuple(work))


@st.composite
def graphs(draw: st.DrawFn, mission: Mission) -> Graph:
    """Connected graphs over the mission's agents: complete, ring, line, star, tree or mesh."""
    ids = draw(st.permutations([agent.id for agent in mission.agents]))
    shape = draw(st.sampled_from(SHAPES))
    parents = [draw(st.integers(0, 99)) for _ in ids] if shape in ("tree", "mesh") else None
    return make_graph(list(ids), shape, parents)
