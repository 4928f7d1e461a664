"""Who hears whom, and what the air does to a message on its way.

A `Topology` says which agents have a link at a time; a `Network` lays faults over it (loss, bursts,
delay, duplication, replay, partitions, one-way cuts, freezes), all drawn from one seed. Nothing here
keeps a clock or moves a message: the simulator asks when each copy of a broadcast arrives, and where.
Agents are named by row, in order of id, as in `swarmbid.arrays`.
"""

from __future__ import annotations

from swarmbid.network.channel import Network
from swarmbid.network.faults import Cut, Partition
from swarmbid.network.positions import (
    agent_positions,
    connected_positions,
    connecting_range,
    positions_with_mean_degree,
    range_for_mean_degree,
)
from swarmbid.network.topologies import (
    TOPOLOGIES,
    FixedTopology,
    RangeTopology,
    Topology,
    make_topology,
)

__all__ = [
    "TOPOLOGIES",
    "Cut",
    "FixedTopology",
    "Network",
    "Partition",
    "RangeTopology",
    "Topology",
    "agent_positions",
    "connected_positions",
    "connecting_range",
    "make_topology",
    "positions_with_mean_degree",
    "range_for_mean_degree",
]
