"""Questions about a graph given as neighbours of each row: its components and its diameter."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

Links = Sequence[tuple[int, ...]]
"""Rows that hear each row's broadcast, ascending; a link may lead one way only."""

NOT_CONNECTED = -1
"""Diameter of a graph in which some row cannot reach some other."""

_WORDS_AT_ONCE = 1 << 21
"""64-bit words gathered in one step of `diameter`: 16 MiB."""


def components(links: Links) -> list[list[int]]:
    """Groups of rows that reach each other both ways, each ascending, by first row."""
    reverse = _reversed(links)
    unplaced = set(range(len(links)))
    groups = []
    for row in range(len(links)):
        if row in unplaced:
            group = _reachable(links, row) & _reachable(reverse, row)
            unplaced -= group
            groups.append(sorted(group))
    return groups


def diameter(links: Links) -> int:
    """Most hops that news needs between any two rows (D); `NOT_CONNECTED` if it may never arrive.

    One bit per pair: a step merges, for every row at once, what its neighbours reach, so the cost is
    D · links · num_agents / 64 word operations.
    """
    num_agents = len(links)
    if num_agents <= 1:
        return 0
    if not all(links):
        return NOT_CONNECTED
    rows = np.arange(num_agents)
    reached = np.zeros((num_agents, (num_agents + 63) // 64), dtype=np.uint64)
    reached[rows, rows // 64] = np.uint64(1) << (rows % 64).astype(np.uint64)
    everybody = np.bitwise_or.reduce(reached, axis=0)
    targets = np.array([neighbour for near in links for neighbour in near])
    starts = np.cumsum([0, *map(len, links)])
    hops = 0
    while not (reached == everybody).all():
        further = reached.copy()
        row = 0
        while row < num_agents:
            limit = starts[row] + _WORDS_AT_ONCE // reached.shape[1]
            last = max(row + 1, int(np.searchsorted(starts, limit, side="right")) - 1)
            gathered = reached[targets[starts[row] : starts[last]]]
            further[row:last] |= np.bitwise_or.reduceat(gathered, starts[row:last] - starts[row], axis=0)
            row = last
        if np.array_equal(further, reached):
            return NOT_CONNECTED
        reached = further
        hops += 1
    return hops


def _reversed(links: Links) -> list[tuple[int, ...]]:
    sources: list[list[int]] = [[] for _ in links]
    for row, near in enumerate(links):
        for neighbour in near:
            sources[neighbour].append(row)
    return [tuple(near) for near in sources]


def _reachable(links: Links, start: int) -> set[int]:
    seen = {start}
    frontier = [start]
    while frontier:
        for neighbour in links[frontier.pop()]:
            if neighbour not in seen:
                seen.add(neighbour)
                frontier.append(neighbour)
    return seen
