"""Leases: who may begin a task while it might be done elsewhere, out of earshot.

Each agent says now and then that it is there, and in the same word which such words of others it has
heard. A word that somebody has answered is a lease of a fixed length from that agent, counted from when
the word was SAID: the answer may take its time. An agent may begin a task while it holds leases from more
than half of the team, itself included (of an even half, from the half with the first agent in order of
id). Of two parts of a team that cannot hear each other only one can: the other's leases end one lease
after they were parted at the latest, and a successor there waits for that, and for what may then have
been begun to be over. Who was without a majority, however shortly, waits a lease when it has one
again, to hear what has happened since. (Leases: Gray and Cheriton 1989; majorities: Gifford 1979.)
"""

from __future__ import annotations

import math

import numpy as np

from swarmbid.arrays import FloatArray
from swarmbid.messages import INCARNATION

WORDS_PER_LEASE = 4.0
PRESENCE = "_presence"
"""Stands for a task in the word that says that an agent is there."""
_LIVES = 1 << 20


class Leases:
    """The leases that one agent holds.

    Parameters
    ----------
    lease : s. again : whether the agent has started again, with nothing remembered.
    """

    def __init__(self, num_agents: int, me: int, lease: float, *, again: bool) -> None:
        self.lease = lease
        self._me = me
        self._until: FloatArray = np.full(num_agents, -math.inf)
        self._said: dict[float, float] = {}
        self._since = math.inf if again else -math.inf
        self._had = again
        self.next_word = -math.inf

    def say(self, number: int, now: float) -> None:
        """Note when the word under `number` was said."""
        self._said = {word: said for word, said in self._said.items() if said > now - self.lease}
        self._said[mark(number)] = now
        self.next_word = now + self.lease / WORDS_PER_LEASE

    def answered(self, row: int, word: float, now: float) -> None:
        """An agent has heard a word of this one."""
        if word not in self._said:
            return
        # However short a lapse was, the task may have been given to another before it ended.
        lapsed = self._had and not self._majority(now)
        self._until[row] = max(float(self._until[row]), self._said[word] + self.lease)
        if self._majority(now):
            self._had = True
            if lapsed:
                self._since = now

    def live(self, now: float) -> bool:
        """Whether the agent may begin a task: who was out of earshot hears first what has happened since."""
        return self._majority(now) and now >= self._since + self.lease

    def _majority(self, now: float) -> bool:
        yes = self._until > now
        yes[self._me] = True
        twice = 2 * int(np.count_nonzero(yes))
        return twice > yes.size or (twice == yes.size and bool(yes[0]))


def mark(number: int) -> float:
    """The number of an act as a float that holds it exactly."""
    return float(number // INCARNATION % _LIVES * INCARNATION + number % INCARNATION)
