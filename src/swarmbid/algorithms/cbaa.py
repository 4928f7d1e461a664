"""CBAA: each agent bids for one task, and neighbours agree who won (Choi, Brunet, How 2009).

Solves: single-robot tasks, one per robot, at this instant (ST-SR-IA). An agent without a task takes the
one with the largest gain among those that its bid wins; whoever hears a larger bid on a task believes it;
whoever is outbid chooses again. Bids are only ever replaced by larger ones, so no stamp is needed: messages
may be lost, late or doubled.
"""

from __future__ import annotations

from swarmbid.algorithms._auction import ConsensusAuction
from swarmbid.algorithms.cbba import CBBA, packed
from swarmbid.kernels.consensus import BETTER, NOBODY, OTHER, RECEIVER, SAME, SENDER, UPDATE
from swarmbid.model import Mission

LARGER_BID_WINS = {
    (says, thinks): ((BETTER, UPDATE),)
    for says in (SENDER, RECEIVER, OTHER)
    for thinks in (RECEIVER, SENDER, OTHER, NOBODY, SAME)
}


class CBAA(ConsensusAuction):
    """The consensus-based auction algorithm aboard one agent."""

    DECISIONS = packed(LARGER_BID_WINS)

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
