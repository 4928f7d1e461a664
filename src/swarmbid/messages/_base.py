"""What every broadcast is, and what every message of a negotiation is besides."""

from __future__ import annotations

from abc import ABC, abstractmethod

from swarmbid.messages._columns import IntArray, StampArray


class Broadcast(ABC):
    """What one agent tells all who hear it; a frozen dataclass, checked when it is made.

    Attributes
    ----------
    sender : id.
    sequence : stamp of this broadcast, the sender's own counter (see `INCARNATION`).
    """

    sender: str
    sequence: int

    @property
    @abstractmethod
    def full(self) -> bool:
        """Whether this is the sender's whole state."""

    @property
    @abstractmethod
    def entries(self) -> int:
        """How many things it tells of: for bids, the papers' unit of data."""

    @abstractmethod
    def encode(self) -> bytes:
        """Return its bytes, with the ids that it mentions and no others."""


class Message(Broadcast):
    """A broadcast of a negotiation, which ends when all digests are equal.

    Attributes
    ----------
    agent_ids, task_ids : the tables that its rows refer to.
    digest : hash of all that the sender's agents must agree on. digest_at : stamp since when it holds.
    agreed : int32[m], rows of agents known to have held the same digest; agreed_at : int64[m], since.
    settled : whether the sender has seen every live agent hold its digest.
    left : int32[q], rows of agents that are gone; left_at : int64[q], the stamps of their last word.
    """

    agent_ids: tuple[str, ...]
    task_ids: tuple[str, ...]
    digest: int
    digest_at: int
    agreed: IntArray
    agreed_at: StampArray
    settled: bool
    left: IntArray
    left_at: StampArray
