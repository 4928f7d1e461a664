"""The network of one run: a topology with faults over it, all from one seed."""

from __future__ import annotations

import bisect
import math
from collections.abc import Sequence
from itertools import compress
from typing import Any

import numpy as np

from swarmbid.errors import Fault, InputError
from swarmbid.network import graph
from swarmbid.network.faults import BurstyLoss, Cut, IndependentLoss, Loss, Partition, SenderStreams, finite
from swarmbid.network.topologies import Topology

Deliveries = list[tuple[float, tuple[int, ...]]]

REPLAY_DELAY = 10.0
"""Mean rounds after which a replayed message comes back."""


class Network:
    """Where each copy of a broadcast arrives, and when.

    A link carries a message if it exists, uncut, when the message is sent. Each copy then meets its
    faults alone: loss first, so that a lost copy is not delayed or duplicated. Random draws come from
    one stream per sender and kind of fault, so a sender's fate depends only on its own broadcasts in
    their order.

    Parameters
    ----------
    topology : who has a link to whom.
    seed : of all faults.
    latency : s from sending to arrival without delay; this is one round.
    loss : share of copies lost, 0 to 1.
    burst : mean copies lost in a row on a link (Gilbert-Elliott); None for independent losses.
    delay : mean further delay in rounds, exponential for each copy: messages overtake each other.
    duplicate : probability that a copy arrives twice, the second with a delay of its own.
    replay : probability that a copy comes back once more after 10 rounds on average.
    partitions, cuts : links that carry nothing for a while.
    freeze : intervals (start, end) in s: whatever would arrive within arrives at `end`, all at once.

    Attributes
    ----------
    last_lost : copies of the last broadcast that were lost on the air; a cut link has no copy to lose.

    Examples
    --------
    >>> from swarmbid.network import make_topology
    >>> Network(make_topology("line", 3)).deliveries(1, now=5.0)
    [(6.0, (0, 2))]
    """

    def __init__(
        self,
        topology: Topology,
        *,
        seed: int = 0,
        latency: float = 1.0,
        loss: float = 0.0,
        burst: float | None = None,
        delay: float = 0.0,
        duplicate: float = 0.0,
        replay: float = 0.0,
        partitions: Sequence[Partition] = (),
        cuts: Sequence[Cut] = (),
        freeze: Sequence[tuple[float, float]] = (),
    ) -> None:
        self.topology = topology
        self.num_agents = topology.num_agents
        self.seed = seed
        self.latency = float(latency)
        self.loss = float(loss)
        self.burst = burst
        self.delay = float(delay)
        self.duplicate = float(duplicate)
        self.replay = float(replay)
        self.partitions = tuple(partitions)
        self.cuts = tuple(cuts)
        self.freeze = tuple(sorted((float(start), float(end)) for start, end in freeze))
        self._check()
        self.last_lost = 0
        self._barriers: tuple[Partition | Cut, ...] = (*self.partitions, *self.cuts)
        self._kept_links = topology.links(0.0) if topology.static else None
        self._open: dict[tuple[int, tuple[int, ...]], tuple[int, ...]] = {}
        self._diameters: dict[tuple[int, ...], int] = {}
        self._final: dict[tuple[int, ...], int] = {}
        self._loss = self._make_loss()
        self._delays = SenderStreams(seed, self.num_agents, "delay")
        self._duplicates = SenderStreams(seed, self.num_agents, "duplicate")
        self._replays = SenderStreams(seed, self.num_agents, "replay")
        faults = self.loss or self.delay or self.duplicate or self.replay or self._barriers or self.freeze
        self._ideal = None if faults else self._kept_links

    def deliveries(self, sender: int, now: float) -> Deliveries:
        """Decide the fate of one broadcast; call once for each, as random numbers are drawn.

        Parameters
        ----------
        sender : row.
        now : s, when it is sent.

        Returns
        -------
        Pairs (arrival in s, receivers' rows), by arrival; no group is empty, and every arrival is
        later than `now`. A receiver may come up more than once. `last_lost` tells the copies lost.
        """
        if self._ideal is not None:
            receivers = self._ideal[sender]
            return [(now + self.latency, receivers)] if receivers else []
        receivers = linked = self.neighbours(sender, now)
        if self._loss is not None and linked:
            receivers = tuple(compress(linked, self._loss.kept(sender, linked).tolist()))
        self.last_lost = len(linked) - len(receivers)
        if not receivers:
            return []
        groups = self._spread(receivers, now, self.delay, self._delays, sender)
        if self.duplicate:
            twice = self._chosen(receivers, self.duplicate, self._duplicates[sender])
            groups += self._spread(twice, now, self.delay, self._duplicates, sender)
        if self.replay:
            again = self._chosen(receivers, self.replay, self._replays[sender])
            groups += self._spread(again, now, self.delay + REPLAY_DELAY, self._replays, sender)
        if self.freeze:
            groups = [(self._thawed(arrival), near) for arrival, near in groups]
        if len(groups) > 1:
            groups.sort()
        return groups

    def neighbours(self, row: int, now: float = 0.0) -> tuple[int, ...]:
        """Rows that a broadcast of `row` sent at `now` s can reach, ascending; cut links left out."""
        links = self._kept_links
        near = links[row] if links is not None else self.topology.neighbours(row, now)
        if not self._barriers:
            return near
        return self._past(self._active(now), row, near)

    def links(self, now: float = 0.0) -> list[tuple[int, ...]]:
        """Return the neighbours of each row at `now` s, cut links left out."""
        return [self.neighbours(row, now) for row in range(self.num_agents)]

    def diameter(self, now: float = 0.0) -> int:
        """Most hops between any two agents over the links of `now` (D); -1 if some cannot be reached."""
        if self._kept_links is None:
            return graph.diameter(self.links(now))
        active = self._active(now)
        if active not in self._diameters:
            self._diameters[active] = graph.diameter(self.links(now))
        return self._diameters[active]

    def components(self, now: float = 0.0) -> list[list[int]]:
        """Groups of rows that can reach each other both ways over the links of `now` s."""
        return graph.components(self.links(now))

    def final_components(self, now: float) -> int:
        """How many components are left when every cut that ends has ended; 1 if agents move.

        More than 1 means that some agents will never hear each other again: of the cuts begun by `now`
        s those without end stay. Agents that move may always meet again. With a loss of 1 each is alone.
        """
        if self.loss == 1.0:
            return self.num_agents
        links = self._kept_links
        if links is None:
            return 1
        lasting = tuple(index for index in self._active(now) if math.isinf(self._barriers[index].end))
        if lasting not in self._final:
            left = [self._past(lasting, row, near) for row, near in enumerate(links)]
            self._final[lasting] = len(graph.components(left))
        return self._final[lasting]

    def describe(self) -> dict[str, Any]:
        """Return every parameter, ready for JSON; an endless interval has None for its end."""
        return {
            "topology": self.topology.describe(),
            "seed": self.seed,
            "latency": self.latency,
            "loss": self.loss,
            "burst": self.burst,
            "delay": self.delay,
            "duplicate": self.duplicate,
            "replay": self.replay,
            "partitions": [partition.describe() for partition in self.partitions],
            "cuts": [cut.describe() for cut in self.cuts],
            "freeze": [[start, finite(end)] for start, end in self.freeze],
        }

    def _active(self, now: float) -> tuple[int, ...]:
        return tuple(
            index for index, barrier in enumerate(self._barriers) if barrier.start <= now < barrier.end
        )

    def _past(self, active: tuple[int, ...], row: int, near: tuple[int, ...]) -> tuple[int, ...]:
        """Return those of `near` that a broadcast of `row` reaches past the barriers numbered `active`."""
        if not active:
            return near
        open_links = self._open.get((row, active))
        if open_links is None:
            standing = [self._barriers[index] for index in active]
            open_links = tuple(k for k in near if not any(barrier.blocks(row, k) for barrier in standing))
            if self._kept_links is not None:
                self._open[row, active] = open_links
        return open_links

    def _make_loss(self) -> Loss | None:
        if self.loss == 0.0:
            return None
        if self.burst is None:
            return IndependentLoss(self.seed, self.num_agents, self.loss)
        return BurstyLoss(self.seed, self.num_agents, self.loss, self.burst)

    def _chosen(
        self, receivers: tuple[int, ...], probability: float, rng: np.random.Generator
    ) -> tuple[int, ...]:
        return tuple(compress(receivers, (rng.random(len(receivers)) < probability).tolist()))

    def _spread(
        self, receivers: tuple[int, ...], now: float, delay: float, streams: SenderStreams, sender: int
    ) -> Deliveries:
        if not receivers:
            return []
        if delay == 0.0:
            return [(now + self.latency, receivers)]
        waits = streams[sender].exponential(delay, len(receivers)).tolist()
        return [
            (now + self.latency * (1.0 + wait), (row,)) for row, wait in zip(receivers, waits, strict=True)
        ]

    def _thawed(self, arrival: float) -> float:
        index = bisect.bisect_right(self.freeze, (arrival, math.inf)) - 1
        return max(arrival, self.freeze[index][1]) if index >= 0 else arrival

    def _check(self) -> None:
        faults = []
        for name in ("loss", "duplicate", "replay"):
            value = getattr(self, name)
            if not 0.0 <= value <= 1.0:
                faults.append(Fault("network", name, f"is {value}", "Give a probability from 0 to 1."))
        if not 0.0 < self.latency < math.inf:
            faults.append(Fault("network", "latency", f"is {self.latency} s", "Give more than 0 s."))
        if not 0.0 <= self.delay < math.inf:
            faults.append(Fault("network", "delay", f"is {self.delay} rounds", "Give 0 or more."))
        if self.seed < 0:
            faults.append(Fault("network", "seed", f"is {self.seed}", "Give 0 or more."))
        if self.burst is not None:
            faults += self._burst_faults(self.burst)
        for name in ("partitions", "cuts"):
            barriers: tuple[Partition | Cut, ...] = getattr(self, name)
            for number, barrier in enumerate(barriers):
                strangers = [row for row in barrier.rows() if not 0 <= row < self.num_agents]
                if strangers:
                    mend = f"Name rows from 0 to {self.num_agents - 1}."
                    faults.append(Fault("network", f"{name}[{number}]", f"names row {strangers[0]}", mend))
        earlier = 0.0
        for start, end in self.freeze:
            if not earlier <= start < end < math.inf:
                mend = "Give finite intervals with start before end that do not overlap."
                faults.append(Fault("network", "freeze", f"has {start} s to {end} s", mend))
            earlier = end
        if faults:
            raise InputError(faults)

    def _burst_faults(self, burst: float) -> list[Fault]:
        # A good link turns bad with probability loss / ((1 - loss) burst), which is at most 1
        # (0.8 / 0.2 is a hair more than 4 in floating point: that is let pass).
        lowest = max(1.0, self.loss / (1.0 - self.loss)) if self.loss < 1.0 else math.inf
        if not 0.0 < self.loss < 1.0:
            why, mend = f"is {burst} with a loss of {self.loss}", "Give a loss between 0 and 1 with it."
        elif not lowest * (1.0 - 1e-9) <= burst < math.inf:
            why, mend = f"is {burst} messages", f"Give {lowest:g} or more for a loss of {self.loss:g}."
        else:
            return []
        return [Fault("network", "burst", why, mend)]
