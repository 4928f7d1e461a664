"""Topologies: which agents have a link, from textbook graphs to radios on moving robots."""

from __future__ import annotations

import heapq
import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from swarmbid.arrays import FloatArray
from swarmbid.errors import Fault, InputError
from swarmbid.network.positions import (
    positions_with_mean_degree,
    range_for_mean_degree,
    within_range,
)
from swarmbid.rng import stream

PositionsAt = Callable[[float], FloatArray]
"""Time in s -> float64[num_agents, 3] in m, in order of row."""

DEFAULT_MEAN_DEGREE = 8.0


class Topology(ABC):
    """Who has a link to whom, and when.

    Attributes
    ----------
    name : as given to `make_topology`.
    num_agents : rows 0 to num_agents - 1.
    static : whether the links are the same at all times, so that they may be kept.
    """

    def __init__(self, name: str, num_agents: int, *, static: bool) -> None:
        if num_agents < 1:
            raise _fault("num_agents", f"is {num_agents}", "Give 1 or more.")
        self.name = name
        self.num_agents = num_agents
        self.static = static

    @abstractmethod
    def neighbours(self, row: int, now: float) -> tuple[int, ...]:
        """Rows that hear a broadcast of `row` at `now` s, ascending, without itself."""

    def links(self, now: float = 0.0) -> list[tuple[int, ...]]:
        """Return the neighbours of each row at `now` s."""
        return [self.neighbours(row, now) for row in range(self.num_agents)]

    def describe(self) -> dict[str, Any]:
        """Return name and parameters, ready for JSON."""
        return {"name": self.name, "num_agents": self.num_agents}


class FixedTopology(Topology):
    """A graph that never changes, given by the neighbours of each row.

    Parameters
    ----------
    links : for each row the rows that hear it. A link may lead one way only.
    name : for reports.
    parameters : what the graph was made from, for `describe`.

    Examples
    --------
    >>> FixedTopology([(1,), (0, 2), (1,)]).neighbours(1, now=0.0)
    (0, 2)
    """

    def __init__(
        self, links: Sequence[Sequence[int]], *, name: str = "fixed", parameters: dict[str, Any] | None = None
    ) -> None:
        super().__init__(name, len(links), static=True)
        for row, near in enumerate(links):
            if len(set(near)) != len(near) or row in near or not all(0 <= k < len(links) for k in near):
                raise _fault(
                    f"links[{row}]",
                    f"is {tuple(near)}",
                    f"Give different rows of 0 to {len(links) - 1}, without {row} itself.",
                )
        self._links = [tuple(sorted(near)) for near in links]
        self._parameters = parameters or {}

    def neighbours(self, row: int, now: float) -> tuple[int, ...]:
        """Rows that hear `row`, at any time."""
        return self._links[row]

    def describe(self) -> dict[str, Any]:
        """Return name and parameters, ready for JSON."""
        return super().describe() | self._parameters


class RangeTopology(Topology):
    """Agents hear each other while they are no more than the communication range apart.

    Parameters
    ----------
    positions : float64[num_agents, 3], m, for agents that stay; or a function of the time in s that
        returns it, for agents that move.
    communication_range : m.

    Examples
    --------
    >>> two = RangeTopology(lambda now: np.array([[0.0, 0, 0], [now, 0, 0]]), communication_range=5.0)
    >>> two.neighbours(0, now=5.0), two.neighbours(0, now=5.1)
    ((1,), ())
    """

    def __init__(self, positions: FloatArray | PositionsAt, *, communication_range: float) -> None:
        self._moving = positions if callable(positions) else None
        self._positions = _checked_positions(positions(0.0) if callable(positions) else positions)
        super().__init__("range", len(self._positions), static=self._moving is None)
        if not 0.0 < communication_range < math.inf:
            raise _fault("communication_range", f"is {communication_range}", "Give a range of more than 0 m.")
        self.communication_range = communication_range
        self._now = 0.0

    def neighbours(self, row: int, now: float) -> tuple[int, ...]:
        """Rows within range of `row` at `now` s, ascending."""
        # All agents of one round ask for the same time.
        if self._moving is not None and now != self._now:
            self._positions = _checked_positions(self._moving(now))
            self._now = now
        return within_range(self._positions, row, self.communication_range)

    def describe(self) -> dict[str, Any]:
        """Return name and parameters, ready for JSON."""
        return super().describe() | {
            "communication_range": self.communication_range,
            "moving": self._moving is not None,
        }


def make_topology(
    name: str,
    num_agents: int,
    *,
    seed: int = 0,
    mean_degree: float | None = None,
    positions: FloatArray | PositionsAt | None = None,
    communication_range: float | None = None,
) -> Topology:
    """Make a topology by name.

    Parameters
    ----------
    name : "complete"; "ring" and "line", in order of row; "star" around row 0; "tree", drawn evenly
        from all trees; "geometric", agents at random in a unit square, linked within a radius;
        "range", agents at `positions` linked within `communication_range`.
    num_agents : how many rows.
    seed : of tree and geometric.
    mean_degree : neighbours per agent of geometric (8 by default, or all if there are fewer); of
        range, in place of `communication_range`: the shortest range that connects the agents at 0 s
        and gives that many.
    positions : of range: float64[num_agents, 3], m, or a function of the time in s. The others do not
        ask where agents are, so it may always be given.
    communication_range : of range, m.

    Examples
    --------
    >>> make_topology("ring", 4).links()
    [(1, 3), (0, 2), (1, 3), (0, 2)]
    """
    if name not in TOPOLOGIES:
        raise _fault("topology", f"is {name!r}", f"Use one of {', '.join(TOPOLOGIES)}.")
    if num_agents < 1:
        raise _fault("num_agents", f"is {num_agents}", "Give 1 or more.")
    options = {"mean_degree": mean_degree, "communication_range": communication_range}
    for option, value in options.items():
        if value is not None and option not in TOPOLOGIES[name]:
            raise _fault(option, f"means nothing to {name!r}", "Leave it out, or use another topology.")
    if name == "range":
        return _range(num_agents, positions, mean_degree, communication_range)
    if name == "geometric":
        return _geometric(num_agents, mean_degree, seed)
    if name == "tree":
        return FixedTopology(_tree(num_agents, seed), name=name, parameters={"seed": seed})
    return FixedTopology(_GRAPHS[name](num_agents), name=name)


def _range(
    num_agents: int,
    positions: FloatArray | PositionsAt | None,
    mean_degree: float | None,
    communication_range: float | None,
) -> RangeTopology:
    if positions is None:
        raise _fault("positions", "is missing", "Give where the agents are: a topology of range needs it.")
    beginning = _checked_positions(positions(0.0) if callable(positions) else positions)
    if len(beginning) != num_agents:
        raise _fault("positions", f"has {len(beginning)} rows", f"Give one for each of {num_agents} agents.")
    if (communication_range is None) == (mean_degree is None):
        raise _fault(
            "communication_range",
            "is missing" if mean_degree is None else "comes with a mean_degree",
            "Give either communication_range or mean_degree.",
        )
    if communication_range is None:
        assert mean_degree is not None
        communication_range = range_for_mean_degree(beginning, mean_degree)
    return RangeTopology(positions, communication_range=communication_range)


def _geometric(num_agents: int, mean_degree: float | None, seed: int) -> FixedTopology:
    if mean_degree is None:
        mean_degree = min(DEFAULT_MEAN_DEGREE, float(num_agents - 1))
    positions, radius = positions_with_mean_degree(num_agents, 1.0, mean_degree, seed)
    return FixedTopology(
        [within_range(positions, row, radius) for row in range(num_agents)],
        name="geometric",
        parameters={"mean_degree": mean_degree, "seed": seed},
    )


def _complete(num_agents: int) -> list[tuple[int, ...]]:
    everybody = tuple(range(num_agents))
    return [everybody[:row] + everybody[row + 1 :] for row in range(num_agents)]


def _line(num_agents: int) -> list[tuple[int, ...]]:
    return [tuple(k for k in (row - 1, row + 1) if 0 <= k < num_agents) for row in range(num_agents)]


def _ring(num_agents: int) -> list[tuple[int, ...]]:
    if num_agents < 3:
        return _line(num_agents)
    return [((row - 1) % num_agents, (row + 1) % num_agents) for row in range(num_agents)]


def _star(num_agents: int) -> list[tuple[int, ...]]:
    return [tuple(range(1, num_agents)), *([(0,)] * (num_agents - 1))]


def _tree(num_agents: int, seed: int) -> list[list[int]]:
    """Draw one of the num_agents^(num_agents - 2) labelled trees by its Prüfer sequence."""
    links: list[list[int]] = [[] for _ in range(num_agents)]
    if num_agents == 1:
        return links
    rng = stream(seed, "network", "tree")
    sequence = rng.integers(num_agents, size=num_agents - 2).tolist()
    missing = np.bincount(np.array(sequence, dtype=np.int64), minlength=num_agents).tolist()
    leaves = [row for row in range(num_agents) if missing[row] == 0]
    for parent in sequence:
        leaf = heapq.heappop(leaves)
        links[leaf].append(parent)
        links[parent].append(leaf)
        missing[parent] -= 1
        if missing[parent] == 0:
            heapq.heappush(leaves, parent)
    first, second = leaves
    links[first].append(second)
    links[second].append(first)
    return links


def _checked_positions(positions: FloatArray) -> FloatArray:
    positions = np.asarray(positions, dtype=np.float64)
    if positions.ndim != 2 or positions.shape[1] != 3 or not np.isfinite(positions).all():
        raise _fault(
            "positions",
            f"has shape {positions.shape} or a number that is not finite",
            "Give three finite numbers for each agent: east, north, up in m.",
        )
    return positions


def _fault(field: str, why: str, mend: str) -> InputError:
    return InputError([Fault("network", field, why, mend)])


_GRAPHS: dict[str, Callable[[int], list[tuple[int, ...]]]] = {
    "complete": _complete,
    "ring": _ring,
    "line": _line,
    "star": _star,
}

TOPOLOGIES: dict[str, tuple[str, ...]] = {
    "complete": (),
    "ring": (),
    "line": (),
    "star": (),
    "tree": (),
    "geometric": ("mean_degree",),
    "range": ("communication_range", "mean_degree"),
}
"""Names for `make_topology`, and the options of a user that each understands."""
