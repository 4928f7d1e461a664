"""Where to put agents so that those within radio range form one connected graph.

Random points at a realistic density almost never do: with eight neighbours on average, a thousand
agents nearly always leave a few alone. So the largest group stays where it fell, and every other one
moves as a body straight towards the nearest agent of those connected, until they just hear it.
"""

from __future__ import annotations

import math

import numpy as np

from swarmbid.arrays import FloatArray, MissionArrays
from swarmbid.errors import Fault, InputError
from swarmbid.model import Mission
from swarmbid.network.graph import components
from swarmbid.rng import stream

_TRIALS = 16
"""Ranges tried for a wanted mean degree before the nearest is taken."""


def agent_positions(mission: Mission) -> FloatArray:
    """Return float64[num_agents, 3], m: where the agents of `mission` begin, in order of row."""
    agents = MissionArrays(mission).agents
    return np.array([agent.position for agent in agents], dtype=np.float64).reshape(-1, 3)


def within_range(positions: FloatArray, row: int, communication_range: float) -> tuple[int, ...]:
    """Rows no further than `communication_range` m from `row`, ascending, without itself."""
    near = np.flatnonzero(_distances(positions, positions[row]) <= communication_range).tolist()
    near.remove(row)
    return tuple(near)


def connected_positions(num: int, width: float, communication_range: float, seed: int) -> FloatArray:
    """Place agents at random in a square so that the range graph is connected.

    Parameters
    ----------
    num : how many agents.
    width : side of the square, m.
    communication_range : m.
    seed : of the stream that places them.

    Returns
    -------
    float64[num, 3], m; the third column is 0.

    Examples
    --------
    >>> connected_positions(50, 1000.0, 200.0, seed=7).shape
    (50, 3)
    """
    _check_square(num, width)
    if not 0.0 < communication_range < math.inf:
        raise _fault("communication_range", communication_range, "Give a range of more than 0 m.")
    # A hair less, so that rounding while agents move cannot break a link.
    reach = communication_range * (1.0 - 1e-9)
    positions = np.zeros((num, 3))
    positions[:, :2] = stream(seed, "network", "positions").random((num, 2)) * width
    groups = components([within_range(positions, row, reach) for row in range(num)])
    group_of = np.zeros(num, dtype=np.int64)
    for number, group in enumerate(groups):
        group_of[group] = number
    joining = max(groups, key=len)
    outside = np.ones(num, dtype=np.bool_)
    nearest = np.full(num, np.inf)
    host = np.zeros(num, dtype=np.int64)
    while True:
        outside[joining] = False
        if not outside.any():
            return positions
        for row in joining:
            distances = _distances(positions, positions[row])
            host[distances < nearest] = row
            nearest = np.minimum(nearest, distances)
        row = int(np.argmin(np.where(outside, nearest, np.inf)))
        shift = (positions[host[row]] - positions[row]) * (1.0 - reach / nearest[row])
        joining = groups[group_of[row]]
        # Clipping to the square brings points closer to each other, never apart.
        positions[joining] = np.clip(positions[joining] + shift, 0.0, width)


def positions_with_mean_degree(
    num: int, width: float, mean_degree: float, seed: int
) -> tuple[FloatArray, float]:
    """Place agents at random in a square so that each has about `mean_degree` neighbours.

    Parameters
    ----------
    num, width, seed : as for `connected_positions`.
    mean_degree : wanted neighbours per agent, from 2 (num - 1) / num, which any connected graph has,
        to num - 1.

    Returns
    -------
    float64[num, 3], m, and the communication range, m, at which the graph is connected and nearest
    to the wanted mean degree.
    """
    _check_square(num, width)
    _check_mean_degree(num, mean_degree)
    if num == 1:
        return connected_positions(1, width, width, seed), width
    # Bringing lost agents back crowds the rest, so the range is corrected by what was found. Mean
    # degree grows with the square of the range while the square is much wider than the range.
    communication_range = width * math.sqrt(mean_degree / (num - 1) / math.pi)
    best: tuple[float, FloatArray, float] | None = None
    for _ in range(_TRIALS):
        positions = connected_positions(num, width, communication_range, seed)
        exact = range_for_mean_degree(positions, mean_degree)
        found = _mean_degree(positions, exact)
        miss = abs(found - mean_degree) / mean_degree
        if best is None or miss < best[0]:
            best = (miss, positions, exact)
        if miss <= max(0.01, 1.0 / (num * mean_degree)):
            break
        communication_range *= math.sqrt(mean_degree / found)
    assert best is not None
    return best[1], best[2]


def range_for_mean_degree(positions: FloatArray, mean_degree: float) -> float:
    """Shortest range, m, that connects `positions` and gives at least about `mean_degree` neighbours.

    Parameters
    ----------
    positions : float64[num_agents, 3], m.
    mean_degree : wanted neighbours per agent.
    """
    num = len(positions)
    _check_mean_degree(num, mean_degree)
    if num == 1:
        return 0.0
    pairs = np.sort(
        np.concatenate([_distances(positions[row + 1 :], positions[row]) for row in range(num - 1)])
    )
    # Each link gives a neighbour to both its ends.
    wanted = max(1, round(mean_degree * num / 2))
    return max(float(pairs[wanted - 1]), connecting_range(positions))


def connecting_range(positions: FloatArray) -> float:
    """Shortest range, m, at which the range graph over `positions` is connected.

    It is the longest edge of the shortest spanning tree, grown here one nearest agent at a time.
    """
    nearest = _distances(positions, positions[0])
    outside = np.ones(len(positions), dtype=np.bool_)
    outside[0] = False
    longest = 0.0
    for _ in range(len(positions) - 1):
        row = int(np.argmin(np.where(outside, nearest, np.inf)))
        longest = max(longest, float(nearest[row]))
        outside[row] = False
        nearest = np.minimum(nearest, _distances(positions, positions[row]))
    return longest


def _distances(positions: FloatArray, point: FloatArray) -> FloatArray:
    # Summed in one fixed order: both ends of a link compute the same bits, and so agree on it.
    east, north, up = (positions - point).T
    distances: FloatArray = np.sqrt(east * east + north * north + up * up)
    return distances


def _mean_degree(positions: FloatArray, communication_range: float) -> float:
    num = len(positions)
    return sum(len(within_range(positions, row, communication_range)) for row in range(num)) / num


def _check_square(num: int, width: float) -> None:
    if num < 1:
        raise _fault("num_agents", num, "Give 1 or more.")
    if not 0.0 < width < math.inf:
        raise _fault("width", width, "Give a width of more than 0 m.")


def _check_mean_degree(num: int, mean_degree: float) -> None:
    low, high = 2.0 * (num - 1) / num, float(num - 1)
    if not low <= mean_degree <= high:
        raise _fault(
            "mean_degree",
            mean_degree,
            f"Give {low:g} to {high:g}: fewer cannot connect {num} agents, and nobody has more neighbours.",
        )


def _fault(field: str, value: float, mend: str) -> InputError:
    return InputError([Fault("network", field, f"is {value}", mend)])
