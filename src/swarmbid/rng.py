"""One seed, a tree of named random streams.

Scenario, network and world each draw from a stream of their own, so that adding a draw to one never
shifts another. Algorithms draw nothing.
"""

from __future__ import annotations

import hashlib

import numpy as np


def stream(seed: int, *names: str | int) -> np.random.Generator:
    """Return the random stream called `names` under `seed`.

    The same seed and names give the same numbers in every process and on every machine: the name is
    hashed by SHA-256, never by Python's salted ``hash``.

    Parameters
    ----------
    seed : any non-negative integer.
    names : path of the stream, such as ``"network", "loss"``.

    Examples
    --------
    >>> float(stream(7, "network").random()) == float(stream(7, "network").random())
    True
    """
    if seed < 0:
        raise ValueError(f"seed must be >= 0, not {seed}")
    digest = hashlib.sha256("\x1f".join([str(seed), *map(str, names)]).encode()).digest()
    return np.random.Generator(np.random.PCG64(int.from_bytes(digest[:16], "little")))
