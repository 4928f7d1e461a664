"""CBAA: each agent bids for one task, and neighbours agree who won (Choi, Brunet, How 2009).

Solves: single-robot tasks, one per robot, at this instant (ST-SR-IA). An agent without a task takes the
one with the largest gain among those that its bid wins; whoever hears a larger bid on a task believes it;
whoever is outbid chooses again.

Where this departs from the paper, and why: beliefs are resolved by CBBA's table. While nobody gives a bid up
that comes to the same, the larger bid wins. But a vehicle that moves, starts or cancels a task does
give bids up, and of a larger bid that is no longer meant only a stamp can tell.
"""

from __future__ import annotations

from swarmbid.algorithms._auction import ConsensusAuction
from swarmbid.algorithms.cbba import CBBA
from swarmbid.model import Mission


class CBAA(ConsensusAuction):
    """The consensus-based auction algorithm aboard one agent."""

    DECISIONS = CBBA.DECISIONS

    @classmethod
    def unsupported(cls, mission: Mission) -> list[str]:
        """The same as for CBBA."""
        return CBBA.unsupported(mission)

    def _limit(self, limit: int) -> int:
        return min(limit, 1)

    def _kept(self) -> int:
        """An agent keeps its task until it is outbid."""
        held = self._bundle.tasks
        return int(held.size > 0 and self._beliefs.winner[held[0]] == self._me)
