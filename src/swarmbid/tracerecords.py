"""What a trace is made of: one frozen struct a kind of line. `swarmbid.trace` writes and reads them."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from msgspec import Meta, Struct

TRACE_VERSION = 1

Time = Annotated[float, Meta(description="s since the run began; in rounds mode the number of the round")]
AgentId = Annotated[str, Meta(description="id of the agent that the record is about")]
TaskId = Annotated[str, Meta(description="id of the task")]


class Header(Struct, frozen=True, kw_only=True, tag_field="kind", tag="trace"):
    """First line: everything that is needed to run it again."""

    version: Annotated[int, Meta(description="version of the format, 1")] = TRACE_VERSION
    swarmbid: Annotated[str, Meta(description="version of the program that wrote it")]
    mission: Annotated[dict[str, Any], Meta(description="the mission, as in a mission file, local metres")]
    algorithm: str
    options: Annotated[dict[str, Any], Meta(description="options of the algorithm")] = {}
    score: Annotated[dict[str, Any], Meta(description="name of the score and its options")] = {}
    network: Annotated[dict[str, Any], Meta(description="graph, delay, loss and the like")] = {}
    seed: int = 0
    mode: Literal["rounds", "asynchronous"] = "rounds"


class Sent(Struct, frozen=True, kw_only=True, tag_field="kind", tag="sent"):
    """An agent broadcast what changed (or all it believes)."""

    t: Time
    agent: AgentId
    sequence: Annotated[int, Meta(description="the sender's own counter")]
    entries: Annotated[int, Meta(description="beliefs carried")]
    bytes: Annotated[int, Meta(description="size on the wire")]
    full: Annotated[bool, Meta(description="whole state rather than changes")] = False
    receivers: Annotated[int, Meta(description="neighbours in reach when it was sent")] = 0
    lost: Annotated[int, Meta(description="of them, how many the network lost it for")] = 0


class Dropped(Struct, frozen=True, kw_only=True, tag_field="kind", tag="dropped"):
    """An agent refused a message; nothing changed for it."""

    t: Time
    agent: Annotated[str, Meta(description="id of the receiver")]
    sender: str | None = None
    reason: Annotated[str, Meta(description="gap, duplicate, stale, malformed ...")]


class Taken(Struct, frozen=True, kw_only=True, tag_field="kind", tag="taken"):
    """An agent added a task to its bundle and bids for it."""

    t: Time
    agent: AgentId
    task: TaskId
    bid: Annotated[float, Meta(description="score units")]
    position: Annotated[int, Meta(description="place in its path, 0 for first")]
    start: Annotated[float, Meta(description="start of service meant, s")]


class Outbid(Struct, frozen=True, kw_only=True, tag_field="kind", tag="outbid"):
    """An agent learnt that a task it held is another's."""

    t: Time
    agent: Annotated[str, Meta(description="id of the agent that lost the task")]
    task: TaskId
    bid: Annotated[float, Meta(description="what it had bid, score units")]
    by: Annotated[str, Meta(description="id of the winner")]
    by_bid: Annotated[float, Meta(description="the winner's bid, score units")]


class Released(Struct, frozen=True, kw_only=True, tag_field="kind", tag="released"):
    """An agent gave up a task that was still its own."""

    t: Time
    agent: AgentId
    task: TaskId
    because: Annotated[str | None, Meta(description="the earlier task of its bundle that it had lost")] = None


class Quit(Struct, frozen=True, kw_only=True, tag_field="kind", tag="quit"):
    """An agent gave up a task whose group stayed incomplete."""

    t: Time
    agent: AgentId
    task: TaskId
    filled: Annotated[int, Meta(description="seats of the task that were taken")]


class Agreed(Struct, frozen=True, kw_only=True, tag_field="kind", tag="agreed"):
    """An agent sees everybody's beliefs equal to its own."""

    t: Time
    agent: AgentId


class Doubted(Struct, frozen=True, kw_only=True, tag_field="kind", tag="doubted"):
    """An agent no longer sees everybody's beliefs equal to its own."""

    t: Time
    agent: AgentId


class Result(Struct, frozen=True, kw_only=True, tag_field="kind", tag="result"):
    """Last line: how the run ended and the plan that came of it."""

    t: Time
    status: Literal["converged", "not_converged"]
    reason: str = ""
    disagreements: Annotated[list[Any], Meta(description="who believes what about which task")] = []
    rounds: Annotated[int | None, Meta(description="rounds until all agreed")] = None
    last_bid_round: Annotated[int | None, Meta(description="round of the last bid")] = None
    declared_round: Annotated[int | None, Meta(description="round in which all knew it")] = None
    plan: Annotated[dict[str, Any], Meta(description="who does what and when")] = {}


Known = Sent | Dropped | Taken | Outbid | Released | Quit | Agreed | Doubted | Result
RECORD_KINDS: tuple[type[Struct], ...] = (
    Header,
    Sent,
    Dropped,
    Taken,
    Outbid,
    Released,
    Quit,
    Agreed,
    Doubted,
    Result,
)
