"""Who holds which digest: how an agent knows that all agree, without counting quiet rounds.

Every message carries its sender's digest. What an agent has heard of another's digest it passes on only
while it equals its own, for nothing else can ever help to agreement; so news of agreement crosses the
network once, and costs nothing before.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from swarmbid.arrays import IntArray, StampArray
from swarmbid.messages import NOT_LISTED, Message


class Agreement:
    """The newest digest known of each agent, and of whom it is needed.

    Parameters
    ----------
    num_agents, me : of the roster.
    """

    def __init__(self, num_agents: int, me: int) -> None:
        self.me = me
        self._digest: NDArray[np.uint64] = np.zeros(num_agents, np.uint64)
        self._at: StampArray = np.full(num_agents, NOT_LISTED, np.int64)
        self._told: StampArray = np.full(num_agents, NOT_LISTED, np.int64)
        self._waited_for: NDArray[np.bool_] = np.ones(num_agents, np.bool_)
        self._waited_for[me] = False
        self._doubtful = me  # somebody who lately held another digest: looked at first

    def hear(self, sender: int, message: Message) -> None:
        """Take in what a message says of digests. The message is in the agent's own rows."""
        if message.digest_at > self._at[sender]:
            self._digest[sender] = message.digest
            self._at[sender] = message.digest_at
        if message.agreed.size:
            newer = (message.agreed_at > self._at[message.agreed]) & (message.agreed != self.me)
            rows = message.agreed[newer]
            self._digest[rows] = message.digest
            self._at[rows] = message.agreed_at[newer]

    def reached(self, digest: int) -> bool:
        """Whether the newest known digest of every live agent is `digest`."""
        doubtful = self._doubtful
        if self._waited_for[doubtful] and self._digest[doubtful] != digest:
            return False
        others = (self._digest != np.uint64(digest)) & self._waited_for
        self._doubtful = int(np.argmax(others))
        return not others[self._doubtful]

    def has_news(self, digest: int) -> bool:
        """Whether an agent is known to hold `digest` of which that has not been told."""
        holders = self._digest == np.uint64(digest)
        return bool(holders.any() and (holders & (self._at > self._told)).any())

    def tell(self, digest: int, *, everything: bool) -> tuple[IntArray, StampArray]:
        """Return which agents hold `digest`, and since when; only the untold ones unless `everything`."""
        holders = self._digest == np.uint64(digest)
        holders &= self._at > (NOT_LISTED if everything else self._told)
        rows = np.flatnonzero(holders).astype(np.int32)
        self._told[rows] = self._at[rows]
        return rows, self._at[rows]

    def newest(self, agent: int) -> int:
        """Stamp of the newest digest known of an agent."""
        return int(self._at[agent])

    def wait_for(self, agent: int, wanted: bool) -> None:
        """Whether agreement needs this agent."""
        self._waited_for[agent] = wanted and agent != self.me
