"""Who flies where in the Drone Swarm Search Environment: three rules to compare with, and ours.

A policy sees what the environment shows: the drones' positions and the probability matrix. It returns an
action for each drone: one of eight moves by one cell, or a search of the cell below, either of which takes
the step.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np

from swarmbid.algorithms.cbba import CBBA
from swarmbid.arrays import FloatArray, MissionArrays
from swarmbid.experiments._dsse_belief import Belief, Cell
from swarmbid.model import Agent, Mission, Task
from swarmbid.scores.time_discounted import TimeDiscounted

ACTIONS = {(-1, 0): 0, (1, 0): 1, (0, -1): 2, (0, 1): 3, (-1, -1): 4, (1, -1): 5, (-1, 1): 6, (1, 1): 7}
"""(x, y) -> the environment's number of the move; rows count downwards."""
SEARCH = 8
SCORE = TimeDiscounted()
ROUNDS = 60
"""After so many rounds without agreement something is wrong: four drones need a handful."""

Place = tuple[int, int]


class Policy(Protocol):
    """One team's rule; the same object serves episode after episode."""

    def start(self, matrix: FloatArray, rng: np.random.Generator) -> None:
        """Begin an episode with its first observed matrix; `rng` for those that draw."""

    def act(self, places: Sequence[Place]) -> list[int]:
        """Return an action for each drone, given their (x, y)."""

    def observe(self, matrix: FloatArray) -> None:
        """Take in the matrix after the step: nobody was found in it."""


class Random:
    """Any of the nine actions, all as likely."""

    def start(self, matrix: FloatArray, rng: np.random.Generator) -> None:
        """Begin an episode."""
        self._rng = rng

    def act(self, places: Sequence[Place]) -> list[int]:
        """Draw."""
        return [int(action) for action in self._rng.integers(0, SEARCH + 1, len(places))]

    def observe(self, matrix: FloatArray) -> None:
        """Learn nothing."""


class Greedy:
    """The environment's authors' heuristic: each drone rushes to one of the most probable cells.

    The first drone to the fourth most probable cell, and so on, whether they were searched or not. Who
    would fly into another searches where it is instead.
    """

    def start(self, matrix: FloatArray, rng: np.random.Generator) -> None:
        """Begin an episode."""
        self._matrix = matrix

    def act(self, places: Sequence[Place]) -> list[int]:
        """Go to the most probable cells."""
        best = np.argsort(self._matrix, axis=None)[-len(places) :]
        taken, actions = list(places), []
        for drone, goal in enumerate(best):
            step = _towards(places[drone], _cell(int(goal), self._matrix))
            ahead = (places[drone][0] + step[0], places[drone][1] + step[1])
            if step == (0, 0) or ahead in taken:
                actions.append(SEARCH)
            else:
                actions.append(ACTIONS[step])
                taken[drone] = ahead
        return actions

    def observe(self, matrix: FloatArray) -> None:
        """Take the new matrix."""
        self._matrix = matrix


class SmallAuction:
    """A sequential auction of single cells: the best bid of all wins, then the best of the others.

    A bid is the matrix's value over (1 + steps to get there)^`haste`, and nothing for a cell that was
    searched within `memory` steps.
    """

    def __init__(self, memory: int, haste: float) -> None:
        self.memory, self.haste = memory, haste

    def start(self, matrix: FloatArray, rng: np.random.Generator) -> None:
        """Begin an episode."""
        self._matrix, self._now = matrix, 0
        self._searched = np.full(matrix.shape, -self.memory - 1)

    def act(self, places: Sequence[Place]) -> list[int]:
        """Auction one cell to each."""
        worth = np.where(self._now - self._searched > self.memory, self._matrix, 0.0)
        bids = np.array([worth / (1.0 + _steps(place, worth)) ** self.haste for place in places])
        actions = [SEARCH] * len(places)
        for _ in places:
            drone, goal = divmod(int(bids.argmax()), worth.size)
            cell = _cell(goal, worth)
            bids[drone] = -1.0
            bids[:, cell[0], cell[1]] = np.minimum(bids[:, cell[0], cell[1]], 0.0)
            step = _towards(places[drone], cell)
            if step == (0, 0):
                self._searched[cell] = self._now
            else:
                actions[drone] = ACTIONS[step]
        return actions

    def observe(self, matrix: FloatArray) -> None:
        """Take the new matrix."""
        self._matrix, self._now = matrix, self._now + 1


class Auction:
    """Ours: a shared belief, whose best cells the drones divide by CBBA in every step.

    Each drone could run the same belief, for what goes into it is heard by all: the matrix and who
    searched where. The cells are tasks: reward the probability, service one step, discounted by
    time. While all are far away, the cells are those that will be probable when the nearest arrives.

    Parameters
    ----------
    cells : how many are auctioned. bundle : most that a drone plans ahead.
    discount : 1/step. near : steps, from where on the belief of now is used.

    Attributes
    ----------
    refused : negotiations in which the drones did not agree, or agreed on one cell for two drones.
    """

    def __init__(
        self, belief: Belief, cells: int = 16, bundle: int = 3, discount: float = 0.1, near: int = 2
    ) -> None:
        self.belief, self.cells, self.bundle, self.discount = belief, cells, bundle, discount
        self.near, self.refused = near, 0

    def start(self, matrix: FloatArray, rng: np.random.Generator) -> None:
        """Begin an episode."""
        self.belief.start(matrix)
        self._searched: list[Cell] = []

    def act(self, places: Sequence[Place]) -> list[int]:
        """Divide the best cells, and go to the first of one's own."""
        worth = self.belief.forecast(0)
        peak = _cell(int(worth.argmax()), worth)
        away = min(int(_steps(place, worth)[peak]) for place in places)
        if away > self.near:
            worth = self.belief.forecast(away)
        actions, self._searched = [], []
        for place, goal in zip(places, self._goals(worth, places), strict=True):
            step = _towards(place, goal)
            actions.append(SEARCH if step == (0, 0) else ACTIONS[step])
            if step == (0, 0):
                self._searched.append(goal)
        return actions

    def observe(self, matrix: FloatArray) -> None:
        """Take in what was searched in vain, then the new matrix."""
        self.belief.miss(self._searched)
        self.belief.advance(matrix)

    def _goals(self, worth: FloatArray, places: Sequence[Place]) -> list[Cell]:
        best = [int(cell) for cell in np.argsort(-worth, axis=None, kind="stable")[: self.cells]]
        best = [cell for cell in best if worth.flat[cell] > 1e-9]
        mission = Mission(
            agents=tuple(
                Agent(id=f"drone{drone}", position=(float(x), float(y), 0.0), bundle_limit=self.bundle)
                for drone, (x, y) in enumerate(places)
            ),
            tasks=tuple(
                Task(
                    id=f"cell{cell}",
                    position=(float(cell % worth.shape[1]), float(cell // worth.shape[1]), 0.0),
                    reward=1000.0 * float(worth.flat[cell]),
                    duration=1.0,
                    discount=self.discount,
                )
                for cell in best
            ),
        )
        paths = self._negotiate(mission)
        # Who won nothing, for there are fewer good cells than drones, follows the others.
        return [
            _cell(int(path[0][0].removeprefix("cell")), worth)
            if path
            else _cell(int((worth / (1.0 + _steps(place, worth))).argmax()), worth)
            for place, path in zip(places, paths, strict=True)
        ]

    def _negotiate(self, mission: Mission) -> list[list[tuple[str, float]]]:
        """Let the drones' negotiators talk, everybody hearing everybody, until all know that they agree."""
        arrays = MissionArrays(mission)
        team = [CBBA(agent, arrays, SCORE, insertion=SCORE.insertion) for agent in arrays.agent_ids]
        now = 0.0
        while now < ROUNDS and not all(one.agreed for one in team):
            said = [one.tick(now) for one in team]
            now += 1.0
            for speaker, messages in enumerate(said):
                for message in messages:
                    for hearer, one in enumerate(team):
                        if hearer != speaker:
                            one.receive(message, now)
        paths = [one.path for one in team]
        held = [task for path in paths for task, _ in path]
        self.refused += len(held) != len(set(held)) or not all(one.agreed for one in team)
        return paths


def _cell(flat: int, grid: FloatArray) -> Cell:
    row, column = divmod(flat, int(grid.shape[1]))
    return row, column


def _towards(place: Place, cell: Cell) -> tuple[int, int]:
    """Return the move (x, y) of one step from `place` (x, y) to `cell` (row, column)."""
    right, down = cell[1] - place[0], cell[0] - place[1]
    return ((right > 0) - (right < 0), (down > 0) - (down < 0))


def _steps(place: Place, grid: FloatArray) -> FloatArray:
    """Return how many steps each cell is away: a diagonal step counts as one."""
    rows, columns = grid.shape
    across, along = np.abs(np.arange(columns) - place[0]), np.abs(np.arange(rows) - place[1])
    found: FloatArray = np.maximum(across[None, :], along[:, None]).astype(float)
    return found
