"""What everybody has looked at, told from neighbour to neighbour and counted once.

Each glimpse has a key (agent, number), the agent's own count from 0. A log holds an unbroken run of
numbers per agent, so that one number says all that it knows: a version vector. Whatever is repeated,
lost or reordered, two logs end alike once each heard what it misses.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from swarmbid.arrays import FloatArray


@dataclass(frozen=True)
class GlimpseBatch:
    """Runs of glimpses, one run per agent, as plain arrays that a message can carry.

    Parameters
    ----------
    agents : whose. first : int64[agents], number of each run's first glimpse. counts : int64[agents].
    t : float64[sum of counts], s. x, y : the same, m; run after run.
    floors : int64[agents], the numbers below are lost to the sender: no one need wait for them.
    """

    agents: tuple[str, ...]
    first: NDArray[np.int64]
    counts: NDArray[np.int64]
    t: FloatArray
    x: FloatArray
    y: FloatArray
    floors: NDArray[np.int64]

    def well_formed(self) -> bool:
        """Tell whether the lengths fit and every number is finite and in order."""
        first, counts, floors = self.first.tolist(), self.counts.tolist(), self.floors.tolist()
        size = len(self.agents)
        # Batches are short and many: plain numbers are quicker than arrays here.
        return (
            len(set(self.agents)) == size == len(first) == len(counts) == len(floors)
            and all(0 <= low <= begin for low, begin in zip(floors, first, strict=True))
            and min(counts, default=0) >= 0
            and sum(counts) == len(self.t) == len(self.x) == len(self.y)
            and all(all(map(math.isfinite, column.tolist())) for column in (self.t, self.x, self.y))
        )


class GlimpseLog:
    """One agent's log of everybody's glimpses.

    Parameters
    ----------
    agent : its owner. keep : newest glimpses kept per agent; older ones can no longer be passed on.
    stride : m, a glimpse nearer than this to the owner's previous one is not logged. 0 logs all.
    """

    def __init__(self, agent: str, keep: int = 5000, stride: float = 0.0) -> None:
        if keep < 1 or not stride >= 0.0:
            raise ValueError(f"keep {keep} must be >= 1 and stride {stride} >= 0")
        self.agent = agent
        self.keep = keep
        self.stride = stride
        self._floor: dict[str, int] = {}
        self._held: dict[str, list[tuple[float, float, float]]] = {}

    def add(self, t: float, x: float, y: float) -> bool:
        """Log a glimpse of the owner's; False if it was too near the previous one."""
        held = self._held.get(self.agent)
        if held and math.hypot(x - held[-1][1], y - held[-1][2]) < self.stride:
            return False
        self._append(self.agent, [(t, x, y)])
        return True

    def known(self) -> dict[str, int]:
        """Return the version vector: for each agent how many of its glimpses were counted, by id."""
        return {agent: self._floor[agent] + len(self._held[agent]) for agent in sorted(self._held)}

    def missing(self, known: Mapping[str, int], most: int) -> GlimpseBatch:
        """Return at most `most` glimpses that a neighbour lacks, oldest first.

        The room is shared fairly: agents whose run is short leave the rest to the others.

        Parameters
        ----------
        known : the neighbour's version vector.
        """
        starts = {
            agent: max(known.get(agent, 0), self._floor[agent])
            for agent, newest in self.known().items()
            if known.get(agent, 0) < newest
        }
        wanted = {agent: self._floor[agent] + len(self._held[agent]) - starts[agent] for agent in starts}
        counts: dict[str, int] = {}
        room = max(most, 0)
        for left, agent in enumerate(sorted(starts, key=lambda agent: (wanted[agent], agent))):
            counts[agent] = min(wanted[agent], room // (len(starts) - left))
            room -= counts[agent]
        agents = tuple(agent for agent in starts if counts[agent])
        rows = [
            row
            for agent in agents
            for row in self._held[agent][starts[agent] - self._floor[agent] :][: counts[agent]]
        ]
        columns = np.array(rows, dtype=float).reshape(-1, 3)
        return GlimpseBatch(
            agents,
            np.array([starts[agent] for agent in agents], dtype=np.int64),
            np.array([counts[agent] for agent in agents], dtype=np.int64),
            columns[:, 0].copy(),
            columns[:, 1].copy(),
            columns[:, 2].copy(),
            np.array([self._floor[agent] for agent in agents], dtype=np.int64),
        )

    def merge(self, batch: GlimpseBatch) -> FloatArray:
        """Take in a batch and return what was new, float64[n, 3] of t, x, y, each glimpse once ever.

        A run that starts beyond what is known leaves a gap and is ignored, to be asked for again,
        unless the sender says that the gap is lost. A malformed batch changes nothing. The owner's own
        glimpses are taken from others too, so that a restarted owner goes on counting where it was.
        """
        new: list[tuple[float, float, float]] = []
        if not batch.agents or not batch.well_formed():
            return np.empty((0, 3))
        begin = 0
        for k, agent in enumerate(batch.agents):
            first, count = int(batch.first[k]), int(batch.counts[k])
            held = self._held.get(agent, [])
            end = self._floor.get(agent, 0) + len(held)
            skip = end - first
            if skip < 0 and int(batch.floors[k]) == first and count:
                self._floor[agent], self._held[agent] = first, []
                skip = 0
            if 0 <= skip < count:
                at = slice(begin + skip, begin + count)
                rows = list(
                    zip(batch.t[at].tolist(), batch.x[at].tolist(), batch.y[at].tolist(), strict=True)
                )
                self._append(agent, rows)
                new += rows
            begin += count
        return np.array(new, dtype=float).reshape(-1, 3)

    def _append(self, agent: str, rows: list[tuple[float, float, float]]) -> None:
        held = self._held.setdefault(agent, [])
        self._floor.setdefault(agent, 0)
        held += rows
        # Cut in slabs: a cut of one at a time would move the whole list for every glimpse.
        if len(held) > self.keep + self.keep // 4:
            cut = len(held) - self.keep
            del held[:cut]
            self._floor[agent] += cut
