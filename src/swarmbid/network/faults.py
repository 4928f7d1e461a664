"""Faults of a network: links that are cut for a while, and messages lost on the air."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from swarmbid.errors import Fault, InputError
from swarmbid.rng import stream


@dataclass(frozen=True, kw_only=True)
class Partition:
    """Groups of agents that cannot hear each other for a while.

    Parameters
    ----------
    groups : rows of each group. All rows that are not named make one more group.
    start, end : s; cut for messages sent from `start` until just before `end`.
    one_way : whether groups still reach the groups named after them, and only these.

    Examples
    --------
    >>> cut = Partition(groups=[(0, 1)], start=10.0, end=60.0)
    >>> cut.blocks(0, 2), cut.blocks(2, 0), cut.blocks(0, 1)
    (True, True, False)
    """

    groups: Sequence[Sequence[int]]
    start: float = 0.0
    end: float = math.inf
    one_way: bool = False
    _group: dict[int, int] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        _check_interval("partition", self.start, self.end)
        object.__setattr__(self, "groups", tuple(tuple(group) for group in self.groups))
        rows = self.rows()
        if len(set(rows)) != len(rows):
            raise fault("partition", "groups", f"are {self.groups}", "Name each row once at most.")
        object.__setattr__(self, "_group", {row: g for g, group in enumerate(self.groups) for row in group})

    def rows(self) -> list[int]:
        """Return every row named."""
        return [row for group in self.groups for row in group]

    def blocks(self, sender: int, receiver: int) -> bool:
        """Whether a message between two rows is stopped while the cut lasts."""
        rest = len(self.groups)
        source, target = self._group.get(sender, rest), self._group.get(receiver, rest)
        return source > target if self.one_way else source != target

    def describe(self) -> dict[str, Any]:
        """Return it ready for JSON; an endless cut has no end."""
        return {
            "groups": [list(group) for group in self.groups],
            "start": self.start,
            "end": finite(self.end),
            "one_way": self.one_way,
        }


@dataclass(frozen=True, kw_only=True)
class Cut:
    """Single links that carry nothing for a while, each in one direction.

    Parameters
    ----------
    links : pairs (sender row, receiver row).
    start, end : s; cut for messages sent from `start` until just before `end`.

    Examples
    --------
    >>> deaf = Cut(links=[(0, 1)])
    >>> deaf.blocks(0, 1), deaf.blocks(1, 0)
    (True, False)
    """

    links: Sequence[tuple[int, int]]
    start: float = 0.0
    end: float = math.inf

    def __post_init__(self) -> None:
        _check_interval("cut", self.start, self.end)
        object.__setattr__(self, "links", tuple((sender, receiver) for sender, receiver in self.links))

    def rows(self) -> list[int]:
        """Return every row named."""
        return [row for link in self.links for row in link]

    def blocks(self, sender: int, receiver: int) -> bool:
        """Whether a message from `sender` to `receiver` is stopped while the cut lasts."""
        return (sender, receiver) in self.links

    def describe(self) -> dict[str, Any]:
        """Return it ready for JSON; an endless cut has no end."""
        return {"links": [list(link) for link in self.links], "start": self.start, "end": finite(self.end)}


class Loss(ABC):
    """Which copies of a broadcast are lost. Each sender draws from a stream of its own."""

    @abstractmethod
    def kept(self, sender: int, receivers: tuple[int, ...]) -> NDArray[np.bool_]:
        """Draw bool[len(receivers)]: whose copy of the next broadcast of `sender` arrives."""


class IndependentLoss(Loss):
    """Each copy is lost with the same probability, whatever became of others (Bernoulli)."""

    def __init__(self, seed: int, num_agents: int, probability: float) -> None:
        self._probability = probability
        self._streams = SenderStreams(seed, num_agents, "loss")

    def kept(self, sender: int, receivers: tuple[int, ...]) -> NDArray[np.bool_]:
        """Draw whose copy arrives."""
        kept: NDArray[np.bool_] = self._streams[sender].random(len(receivers)) >= self._probability
        return kept


class BurstyLoss(Loss):
    """Each link is good or bad for a while; a bad one loses everything, a good one nothing.

    The chain of Gilbert and Elliott, stepped once per message on the link: a bad link turns good with
    probability 1 / burst, so bad runs last `burst` messages on average, and a good one turns bad just
    as often as makes the mean loss come out. Links begin in the steady state.

    Parameters
    ----------
    mean : mean share of messages lost.
    burst : mean number of messages lost in a row.
    """

    def __init__(self, seed: int, num_agents: int, mean: float, burst: float) -> None:
        self._mean = mean
        self._stays_bad = 1.0 - 1.0 / burst
        self._turns_bad = mean / ((1.0 - mean) * burst)
        self._bad: list[NDArray[np.bool_] | None] = [None] * num_agents
        self._streams = SenderStreams(seed, num_agents, "loss")

    def kept(self, sender: int, receivers: tuple[int, ...]) -> NDArray[np.bool_]:
        """Step the links of `sender` and draw whose copy arrives."""
        rng = self._streams[sender]
        bad = self._bad[sender]
        if bad is None:
            bad = self._bad[sender] = rng.random(len(self._bad)) < self._mean
        rows = np.array(receivers, dtype=np.int64)
        now_bad = rng.random(len(rows)) < np.where(bad[rows], self._stays_bad, self._turns_bad)
        bad[rows] = now_bad
        return ~now_bad


class SenderStreams:
    """One random stream per sender for one kind of fault, made when first used.

    What happens to a sender's broadcasts then depends on these alone, not on what others send in
    between, nor on which other faults are switched on.
    """

    def __init__(self, seed: int, num_agents: int, kind: str) -> None:
        self._seed = seed
        self._kind = kind
        self._streams: list[np.random.Generator | None] = [None] * num_agents

    def __getitem__(self, sender: int) -> np.random.Generator:
        rng = self._streams[sender]
        if rng is None:
            rng = self._streams[sender] = stream(self._seed, "network", self._kind, sender)
        return rng


def finite(value: float) -> float | None:
    """`value`, or None for infinity, which JSON cannot write."""
    return value if math.isfinite(value) else None


def fault(where: str, name: str, why: str, mend: str) -> InputError:
    """Return the error for one bad parameter."""
    return InputError([Fault(where, name, why, mend)])


def _check_interval(where: str, start: float, end: float) -> None:
    if not 0.0 <= start < end:
        raise fault(where, "start, end", f"are {start} s, {end} s", "Give 0 <= start < end.")
