"""What the UAVs of a search tell each other of themselves and of what they have seen.

Everything in it is safe to hear twice, late or out of order: of a status, a contact or an estimate the
one made later counts, and glimpses have numbers of their own (`swarmbid.world.glimpses`).

Wire format::

    ["survey", version, sender, sequence, statuses, contacts, agents, first, counts, floors, glimpses,
     known_agents, known]
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import msgspec
import numpy as np
from numpy.typing import NDArray

from swarmbid.checks import ID_PATTERN
from swarmbid.messages._base import Broadcast
from swarmbid.messages._columns import MAX_STAMP, VERSION, FloatArray, MessageError, ids

MAX_ITEMS = 1 << 14
MODES = ("search", "transit", "visit", "track", "return", "base", "gone")
"""What a UAV may be doing."""

_encoder = msgspec.msgpack.Encoder()


class Status(msgspec.Struct, array_like=True, frozen=True):
    """What one UAV does, in its own words.

    Parameters
    ----------
    agent : id. t : s, when it said so. mode : one of `MODES`. x, y : m.
    """

    agent: str
    t: float
    mode: str
    x: float
    y: float


class Contact(msgspec.Struct, array_like=True, frozen=True):
    """The newest estimate of one target that was found.

    Parameters
    ----------
    task : id of the task made of it. by : who found it. found_at : s.
    moving : what it is taken for. t : s, of the estimate. x, y : m. vx, vy : m/s. sigma : m.
    over : whether nobody need look for it or follow it any more, as it turned out to be another contact.
    """

    task: str
    by: str
    found_at: float
    moving: bool
    t: float
    x: float
    y: float
    vx: float
    vy: float
    sigma: float
    over: bool = False


@dataclass(frozen=True, eq=False)
class Survey(Broadcast):
    """One UAV's view of the search.

    Parameters
    ----------
    sender, sequence : see `Broadcast`.
    statuses : the newest known of each UAV. contacts : those that changed lately, or all.
    agents, first, counts, floors : runs of glimpses: whose, the number of the first, how many, and below
        which number they are lost.
    glimpses : float64[3, n]: t (s), x, y (m), run after run.
    known_agents, known : of whose glimpses the sender knows how many.
    """

    sender: str
    sequence: int
    statuses: tuple[Status, ...]
    contacts: tuple[Contact, ...]
    agents: tuple[str, ...]
    first: NDArray[np.int64]
    counts: NDArray[np.int64]
    floors: NDArray[np.int64]
    glimpses: FloatArray
    known_agents: tuple[str, ...]
    known: NDArray[np.int64]

    @property
    def full(self) -> bool:
        """It tells of everybody."""
        return True

    @property
    def entries(self) -> int:
        """Statuses, contacts and glimpses."""
        return len(self.statuses) + len(self.contacts) + int(self.glimpses.shape[1])

    def encode(self) -> bytes:
        """Return its bytes."""
        return _encoder.encode(
            SurveyWire(
                version=VERSION,
                sender=self.sender,
                sequence=self.sequence,
                statuses=self.statuses,
                contacts=self.contacts,
                agents="\n".join(self.agents),
                first=self.first.tolist(),
                counts=self.counts.tolist(),
                floors=self.floors.tolist(),
                glimpses=self.glimpses.astype("<f8").tobytes(),
                known_agents="\n".join(self.known_agents),
                known=self.known.tolist(),
            )
        )


class SurveyWire(msgspec.Struct, array_like=True, tag="survey", frozen=True):
    """The fields in their order on the wire."""

    version: int
    sender: str
    sequence: int
    statuses: tuple[Status, ...]
    contacts: tuple[Contact, ...]
    agents: str
    first: list[int]
    counts: list[int]
    floors: list[int]
    glimpses: bytes
    known_agents: str
    known: list[int]

    def message(self) -> Survey:
        """Return the survey; MessageError if it says what cannot be."""
        if self.version != VERSION:
            raise MessageError("version", f"is {self.version}, not {VERSION}")
        if not ID_PATTERN.fullmatch(self.sender):
            raise MessageError("id", "the sender's id is none")
        if not 0 < self.sequence <= MAX_STAMP:
            raise MessageError("stamp", "the stamp is out of range")
        agents, known_agents = ids(self.agents), ids(self.known_agents)
        if max(len(self.statuses), len(self.contacts)) > MAX_ITEMS:
            raise MessageError("oversize", f"more than {MAX_ITEMS} statuses or contacts")
        for status in self.statuses:
            if status.mode not in MODES or not ID_PATTERN.fullmatch(status.agent):
                raise MessageError("malformed", "a status is of nobody, or of a mode that there is not")
            _finite((status.t, status.x, status.y))
        for contact in self.contacts:
            if not ID_PATTERN.fullmatch(contact.task) or not ID_PATTERN.fullmatch(contact.by):
                raise MessageError("id", "a contact has no proper id")
            numbers = (contact.found_at, contact.t, contact.x, contact.y, contact.vx, contact.vy)
            _finite((*numbers, contact.sigma))
        columns = (self.first, self.counts, self.floors)
        if any(len(column) != len(agents) for column in columns) or len(self.known) != len(known_agents):
            raise MessageError("malformed", "two columns that belong together differ in length")
        if any(not 0 <= number <= MAX_STAMP for column in (*columns, self.known) for number in column):
            raise MessageError("malformed", "a number of glimpses is out of range")
        size = sum(self.counts)
        if len(self.glimpses) != 24 * size:
            raise MessageError("malformed", "the glimpses are cut off")
        glimpses = np.frombuffer(self.glimpses, "<f8").astype(np.float64).reshape(3, size)
        if not np.isfinite(glimpses).all():
            raise MessageError("malformed", "a glimpse is not a finite number")
        return Survey(
            sender=self.sender,
            sequence=self.sequence,
            statuses=self.statuses,
            contacts=self.contacts,
            agents=agents,
            first=np.array(self.first, np.int64),
            counts=np.array(self.counts, np.int64),
            floors=np.array(self.floors, np.int64),
            glimpses=glimpses,
            known_agents=known_agents,
            known=np.array(self.known, np.int64),
        )


def _finite(numbers: tuple[float, ...]) -> None:
    if not all(map(math.isfinite, numbers)):
        raise MessageError("malformed", "a place or a time is not a finite number")
