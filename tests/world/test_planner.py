"""The planner finds what is worth flying to, soon, and keeps its mind."""

from __future__ import annotations

import numpy as np
from tests.world.test_belief import Box, Cookie

from swarmbid.rng import stream
from swarmbid.world.belief import Belief, Footprint
from swarmbid.world.grid import Grid
from swarmbid.world.planner import Planner


def search(greedy, seed):
    grid = Grid(Box(1000.0, 1000.0), 25.0)
    footprint = Footprint(Cookie(60.0, 0.8), 100.0, grid)
    rng = stream(seed, "planner")
    belief = Belief(grid, "one", rng.uniform(0.0, 1.0, grid.shape) ** 8)
    planner, seen, at, heading = Planner(grid, footprint, 20.0), 0.0, np.array([500.0, 500.0]), 0.0
    goal = None
    seen = np.ones(grid.shape)
    prior = belief.probability.copy()
    for _ in range(300):
        if greedy:
            goal = planner.plan(belief.probability, grid.mask, (at[0], at[1]), heading)
        elif goal is None or np.hypot(*(np.array(goal) - at)) < 30.0:
            goal = tuple(rng.uniform(0.0, 1000.0, 2))
        way = np.array(goal) - at
        heading = float(np.arctan2(way[1], way[0]))
        at = at + way * min(1.0, 20.0 / max(np.hypot(*way), 1e-9))
        belief.glimpse(footprint, at[0], at[1])
        seen *= 1.0 - footprint.probability(np.hypot(grid.x[None, :] - at[0], grid.y[:, None] - at[1]))
    return float((prior * (1.0 - seen)).sum())


def test_greedy_beats_random_legs():
    pairs = [(search(True, seed), search(False, seed)) for seed in range(3)]
    assert all(greedy > chance for greedy, chance in pairs)


def test_it_goes_where_it_may_and_keeps_its_goal():
    grid = Grid(Box(1000.0, 400.0), 20.0)
    footprint = Footprint(Cookie(50.0, 0.9), 100.0, grid)
    planner = Planner(grid, footprint, 20.0)
    belief = np.zeros(grid.shape)
    belief[10, 5] = belief[10, 45] = 0.5
    east = np.zeros(grid.shape, dtype=bool)
    east[:, 25:] = True
    assert planner.plan(belief, east, (500.0, 200.0), 0.0)[0] > 500.0
    kept = planner.goal
    assert planner.plan(belief, grid.mask, (495.0, 200.0), 0.0) == kept
    assert planner.plan(np.zeros(grid.shape), east, (500.0, 200.0), 0.0) is None
