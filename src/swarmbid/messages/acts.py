"""Acts of a Contract Net, each written by its speaker alone and relayed unchanged.

What agents say to each other are acts in the sense of the FIPA Contract Net Interaction Protocol
(SC00029H): a performative, a conversation, a receiver, what it answers and its content. They travel by
broadcasts that may be lost, so every speaker keeps its live acts, the newest of each task and role, under
numbers of its own; a message holds runs of them: all that is alive of one speaker above one number and
up to another. What ended is told as an outcome and no longer as acts.

Wire format::

    ["acts", version, sender, sequence, agents, runs, known, near, ended, ended_hash, digest, digest_at,
     agreed, agreed_at, settled, left, left_at]

`agents` is ids joined by newlines; a run is ``[row, after, upto, [act, ...]]``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import msgspec
import numpy as np

from swarmbid.checks import ID_PATTERN
from swarmbid.errors import InputError
from swarmbid.messages._base import Message
from swarmbid.messages._columns import (
    INCARNATION,
    MAX_STAMP,
    VERSION,
    IntArray,
    MessageError,
    StampArray,
    check_head,
    ids,
    pack,
    pack_stamps,
    unpack,
    unpack_stamps,
)
from swarmbid.model import Task

CFP, PROPOSE, REFUSE = "cfp", "propose", "refuse"
ACCEPT, REJECT, CONFIRM = "accept-proposal", "reject-proposal", "confirm"
INFORM, DONE, RESULT, FAILURE = "inform", "inform-done", "inform-result", "failure"
CANCEL, NOT_UNDERSTOOD = "cancel", "not-understood"
PERFORMATIVES = (
    CFP, PROPOSE, REFUSE, ACCEPT, REJECT, CONFIRM, INFORM, DONE, RESULT, FAILURE, CANCEL, NOT_UNDERSTOOD,
)  # fmt: skip
"""FIPA names (SC00037J), in the order in which a conversation meets them."""

REFUSALS = ("no_equipment", "no_fuel", "too_late", "busy", "out_of_area", "unauthorised", "overloaded")
"""Why an agent does not bid."""

AS_MANAGER, AS_CONTRACTOR, ASIDE = 0, 1, 2
"""The roles in which an agent speaks of a task; the newest act of each counts."""
NUM_ROLES = 3

MAX_ACTS = 1 << 16
MAX_PATH = 1 << 12
MAX_TEXT = 200
MAX_EPOCH = 1 << 40
ENDINGS = ("unserved", "failed", "cancelled", "done")
"""How a task may end; where two endings meet, the later in this list wins."""

_encoder = msgspec.msgpack.Encoder()


class Specification(msgspec.Struct, array_like=True, frozen=True):
    """A task that the receivers may not know: the fields of `Task`."""

    type: str
    position: tuple[float, float, float]
    reward: float
    start: float
    end: float
    duration: float
    discount: float
    equipment: tuple[str, ...] = ()
    revisit_at: float | None = None
    revisit_width: float = 60.0

    def task(self, task_id: str) -> Task:
        """Return the task; MessageError if there can be none such."""
        try:
            return Task(
                id=task_id, type=self.type, position=self.position, reward=self.reward, start=self.start,
                end=self.end, duration=self.duration, discount=self.discount,
                equipment=frozenset(self.equipment), revisit_at=self.revisit_at,
                revisit_width=self.revisit_width,
            )  # fmt: skip
        except InputError as error:
            raise MessageError("malformed", str(error)) from None


def specification(task: Task) -> Specification:
    """Return what others must know of a task of one agent without prerequisites."""
    return Specification(
        task.type, task.position, task.reward, task.start, task.end, task.duration, task.discount,
        tuple(sorted(task.equipment)), task.revisit_at, task.revisit_width,
    )  # fmt: skip


class Act(msgspec.Struct, array_like=True, frozen=True):
    """One thing said of one task.

    Parameters
    ----------
    number : the speaker's own counter, incarnation first (see `INCARNATION`).
    performative : one of `PERFORMATIVES`; another is answered once by "not-understood".
    task : id. role : AS_MANAGER, AS_CONTRACTOR or ASIDE.
    to : id of the receiver; empty for all.
    manager, epoch : with the task the conversation that it belongs to; epochs of a task only rise.
    asked : epoch of the call that answers must be newer than (manager), or of the call answered.
    reply_to : number of the act that it answers, 0 for none.
    bid : score units.
    at : s: reply_by of a call, confirm_by of an award, start of service else.
    reason : of a refusal, a failure or an ending; or what is informed of.
    idle : whether the bidder's path is empty.
    path : what the bidder is committed to, in order of visit, with starts of service in s.
    place : where in that path the task would be inserted. worth : score of the path without it.
    specification : of a task that is not in everybody's mission.
    """

    number: int
    performative: str
    task: str
    role: int
    to: str = ""
    manager: str = ""
    epoch: int = 0
    asked: int = 0
    reply_to: int = 0
    bid: float = 0.0
    at: float = 0.0
    reason: str = ""
    idle: bool = False
    path: tuple[tuple[str, float], ...] = ()
    place: int = 0
    worth: float = 0.0
    specification: Specification | None = None

    @property
    def conversation(self) -> str:
        """Task, manager and epoch as one id."""
        return f"{self.task}/{self.manager}/{self.epoch}"

    def check(self) -> None:
        """Raise MessageError if no agent can have said this."""
        if not ID_PATTERN.fullmatch(self.task):
            raise MessageError("id", "the task of an act is no id")
        for name in (self.to, self.manager):
            if name and not ID_PATTERN.fullmatch(name):
                raise MessageError("id", "the receiver or the manager of an act is no id")
        if not 0 <= self.role < NUM_ROLES:
            raise MessageError("malformed", "an act is of no role that there is")
        if not 0 < self.number <= MAX_STAMP or not 0 <= self.reply_to <= MAX_STAMP:
            raise MessageError("stamp", "the number of an act is out of range")
        if not 0 <= self.asked <= MAX_EPOCH or not 0 <= self.epoch <= MAX_EPOCH:
            raise MessageError("stamp", "an epoch is out of range")
        if not 0.0 <= self.bid < math.inf:
            raise MessageError("bid", "a bid is not a finite number of at least 0")
        if (
            not math.isfinite(self.at)
            or not math.isfinite(self.worth)
            or not all(math.isfinite(time) for _, time in self.path)
        ):
            raise MessageError("malformed", "a time is not a finite number")
        if max(len(self.performative), len(self.reason)) > MAX_TEXT or len(self.path) > MAX_PATH:
            raise MessageError("oversize", "a text or a path is too long")
        if not 0 <= self.place <= len(self.path):
            raise MessageError("malformed", "a place lies outside its path")
        if not all(ID_PATTERN.fullmatch(task) for task, _ in self.path):
            raise MessageError("id", "a task of a path is no id")
        if self.specification is not None:
            self.specification.task(self.task)


class Ending(msgspec.Struct, array_like=True, frozen=True):
    """How a task ended: all that is left of its conversations.

    Parameters
    ----------
    state : one of `ENDINGS`. agent : id of who did it; empty for nobody. bid : that it was done for.
    """

    task: str
    state: str
    agent: str = ""
    reason: str = ""
    epoch: int = 0
    bid: float = 0.0

    def check(self) -> None:
        """Raise MessageError if no task can end so."""
        if not ID_PATTERN.fullmatch(self.task) or (self.agent and not ID_PATTERN.fullmatch(self.agent)):
            raise MessageError("id", "a task or an agent of an ending is no id")
        if self.state not in ENDINGS or len(self.reason) > MAX_TEXT or not 0 <= self.epoch <= MAX_EPOCH:
            raise MessageError("malformed", "a task ended in no way that there is")
        if not 0.0 <= self.bid < math.inf:
            raise MessageError("bid", "a bid is not a finite number of at least 0")

    @property
    def rank(self) -> tuple[int, int, str, str, float]:
        """Which of two endings of a task wins: the larger."""
        return ENDINGS.index(self.state), self.epoch, self.agent, self.reason, self.bid


class ActRun(msgspec.Struct, array_like=True, frozen=True):
    """All live acts of one speaker above `after` and up to `upto`.

    Parameters
    ----------
    owner : row of the speaker. acts : in order of number.
    """

    owner: int
    after: int
    upto: int
    acts: tuple[Act, ...]

    def check(self) -> None:
        """Raise MessageError unless the numbers are in order."""
        if not 0 < self.upto <= MAX_STAMP or not 0 <= self.after <= self.upto:
            raise MessageError("stamp", "a run of acts is out of range")
        if self.after // INCARNATION != self.upto // INCARNATION:
            raise MessageError("stamp", "a run of acts spans two lives of its speaker")
        last = self.after
        for act in self.acts:
            if not last < act.number <= self.upto:
                raise MessageError("stamp", "a run of acts is out of order")
            last = act.number
            act.check()


@dataclass(frozen=True, eq=False)
class Acts(Message):
    """Acts that some neighbour seems to lack, and how new the sender's knowledge of everybody's is.

    Parameters
    ----------
    sender, sequence, agent_ids, digest, digest_at, agreed, agreed_at, settled, left, left_at :
        see `Message`.
    runs : of acts, one at most of each speaker.
    known : int64[len(agent_ids)], up to which number the sender knows each speaker's acts.
    near : int32[k], rows of agents that the sender hears directly.
    ended : of tasks. ended_hash : of all the endings that the sender knows.
    """

    sender: str
    sequence: int
    agent_ids: tuple[str, ...]
    runs: tuple[ActRun, ...]
    known: StampArray
    near: IntArray
    ended: tuple[Ending, ...]
    ended_hash: int
    digest: int
    digest_at: int
    agreed: IntArray
    agreed_at: StampArray
    settled: bool
    left: IntArray
    left_at: StampArray

    @property
    def task_ids(self) -> tuple[str, ...]:  # type: ignore[override]
        """Nothing refers to tasks by row: acts name them."""
        return ()

    @property
    def full(self) -> bool:
        """Every message tells how new all of the sender's knowledge is."""
        return True

    @property
    def entries(self) -> int:
        """Acts and endings that it tells of."""
        return len(self.ended) + sum(len(run.acts) for run in self.runs)

    def encode(self) -> bytes:
        """Return the bytes of a message."""
        top = len(self.agent_ids)
        return _encoder.encode(
            ActsWire(
                version=VERSION,
                sender=self.sender,
                sequence=self.sequence,
                agents="\n".join(self.agent_ids),
                runs=self.runs,
                known=pack_stamps(self.known // INCARNATION) + pack_stamps(self.known % INCARNATION),
                near=pack(self.near, top),
                ended=self.ended,
                ended_hash=self.ended_hash,
                digest=self.digest,
                digest_at=self.digest_at,
                agreed=pack(self.agreed, top),
                agreed_at=pack_stamps(self.agreed_at),
                settled=self.settled,
                left=pack(self.left, top),
                left_at=pack_stamps(self.left_at),
            )
        )


class ActsWire(msgspec.Struct, array_like=True, tag="acts", frozen=True):
    """The fields in their order on the wire."""

    version: int
    sender: str
    sequence: int
    agents: str
    runs: tuple[ActRun, ...]
    known: bytes
    near: bytes
    ended: tuple[Ending, ...]
    ended_hash: int
    digest: int
    digest_at: int
    agreed: bytes
    agreed_at: bytes
    settled: bool
    left: bytes
    left_at: bytes

    def message(self) -> Acts:
        """Return the message; MessageError if it says what cannot be."""
        check_head(self.version, self.sender, self.sequence, self.digest, self.digest_at)
        if not 0 <= self.ended_hash < 1 << 64:
            raise MessageError("malformed", "the hash of the endings is not of 64 bits")
        agents = ids(self.agents)
        top = len(agents)
        if sum(len(run.acts) for run in self.runs) + len(self.ended) > MAX_ACTS:
            raise MessageError("oversize", "too many acts at once")
        owners = [run.owner for run in self.runs]
        if len(set(owners)) != len(owners) or not all(0 <= owner < top for owner in owners):
            raise MessageError("malformed", "a run of acts is there twice or of nobody")
        for run in self.runs:
            run.check()
        for ending in self.ended:
            ending.check()
        agreed, left = unpack(self.agreed, top, top), unpack(self.left, top, top)
        agreed_at, left_at = unpack_stamps(self.agreed_at), unpack_stamps(self.left_at)
        known = _unpack_known(self.known, top)
        if known.size != top or agreed.size != agreed_at.size or left.size != left_at.size:
            raise MessageError("malformed", "two columns that belong together differ in length")
        return Acts(
            sender=self.sender,
            sequence=self.sequence,
            agent_ids=agents,
            runs=self.runs,
            known=known,
            near=unpack(self.near, top, top).astype(np.int32),
            ended=self.ended,
            ended_hash=self.ended_hash,
            digest=self.digest,
            digest_at=self.digest_at,
            agreed=agreed.astype(np.int32),
            agreed_at=agreed_at,
            settled=self.settled,
            left=left.astype(np.int32),
            left_at=left_at,
        )


def _unpack_known(data: bytes, top: int) -> StampArray:
    """Incarnations, then numbers: together they would be spread too wide to pack well."""
    if not top:
        return np.zeros(0, np.int64)
    if len(data) < 10:
        raise MessageError("malformed", "a column of stamps is cut off")
    begin = 9 + top * data[8]
    known = unpack_stamps(data[:begin]) * INCARNATION
    numbers = unpack_stamps(data[begin:])
    if known.size != numbers.size or (
        known.size and not 0 <= int(known.min()) <= int(known.max()) <= MAX_STAMP
    ):
        raise MessageError("stamp", "a stamp is out of range")
    return known + numbers
