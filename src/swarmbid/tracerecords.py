"""What a trace is made of: one frozen struct a kind of line. `swarmbid.trace` writes and reads them."""

from __future__ import annotations

from typing import Annotated, Any, Literal, get_args

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
    mode: Literal["rounds", "asynchronous", "world"] = "rounds"
    world: Annotated[
        dict[str, Any] | None,
        Meta(description="the simulated world of a search mission: area, vehicles, sensors, targets"),
    ] = None


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


class Act(Struct, frozen=True, kw_only=True, tag_field="kind", tag="act"):
    """An agent said something in a Contract Net conversation."""

    t: Time
    agent: AgentId
    task: TaskId
    performative: Annotated[str, Meta(description="FIPA name: cfp, propose, refuse, accept-proposal ...")]
    to: Annotated[str, Meta(description="id of the receiver; empty for all")]
    conversation: Annotated[str, Meta(description="which conversation: task, manager, epoch")]
    bid: Annotated[float | None, Meta(description="score units, of a proposal or an award")] = None
    detail: Annotated[str, Meta(description="reason of a refusal or a failure, or what else was said")] = ""


class Stage(Struct, frozen=True, kw_only=True, tag_field="kind", tag="stage"):
    """An agent's state in a conversation, or in its statechart of the mission, changed."""

    t: Time
    agent: AgentId
    task: TaskId
    role: Annotated[str, Meta(description="manager or contractor")]
    state: str


class Ended(Struct, frozen=True, kw_only=True, tag_field="kind", tag="ended"):
    """An agent knows a task to have ended."""

    t: Time
    agent: AgentId
    task: TaskId
    outcome: Annotated[str, Meta(description="done, failed, cancelled or unserved")]
    by: Annotated[str, Meta(description="id of the agent that did it, empty for none")] = ""
    reason: str = ""


class Pose(Struct, frozen=True, kw_only=True, tag_field="kind", tag="pose"):
    """Where a vehicle is, and what it is doing."""

    t: Time
    agent: AgentId
    x: Annotated[float, Meta(description="m east")]
    y: Annotated[float, Meta(description="m north")]
    heading: Annotated[float, Meta(description="rad from east, counter-clockwise")]
    mode: Annotated[str, Meta(description="search, transit, track, visit, return or base")]
    fuel: Annotated[float, Meta(description="s that it can still fly, the reserve included")]


class Truth(Struct, frozen=True, kw_only=True, tag_field="kind", tag="truth"):
    """Where a target really is; nobody in the team knows."""

    t: Time
    target: Annotated[str, Meta(description="id of the true target")]
    x: Annotated[float, Meta(description="m east")]
    y: Annotated[float, Meta(description="m north")]


class Detected(Struct, frozen=True, kw_only=True, tag_field="kind", tag="detected"):
    """A vehicle has confirmed a contact, and the type that it takes it for."""

    t: Time
    agent: AgentId
    task: TaskId
    x: Annotated[float, Meta(description="m east, estimated")]
    y: Annotated[float, Meta(description="m north, estimated")]
    moving: Annotated[bool, Meta(description="whether it is taken for a moving target")]
    evidence: Annotated[str, Meta(description="what that rests on")] = ""
    truth: Annotated[str, Meta(description="id of the true target; empty for a false alarm")] = ""


class Tracked(Struct, frozen=True, kw_only=True, tag_field="kind", tag="tracked"):
    """What a vehicle estimates of the target that it tracks or looks at."""

    t: Time
    agent: AgentId
    task: TaskId
    x: Annotated[float, Meta(description="m east")]
    y: Annotated[float, Meta(description="m north")]
    vx: Annotated[float, Meta(description="m/s east")] = 0.0
    vy: Annotated[float, Meta(description="m/s north")] = 0.0
    sigma: Annotated[float, Meta(description="m, standard deviation of the place")] = 0.0


class Divided(Struct, frozen=True, kw_only=True, tag_field="kind", tag="divided"):
    """A searcher has divided the area anew among those that it knows to search."""

    t: Time
    agent: AgentId
    searchers: Annotated[list[str], Meta(description="ids of the searchers, itself included")]
    because: str = ""


class Crashed(Struct, frozen=True, kw_only=True, tag_field="kind", tag="crashed"):
    """A vehicle has failed in flight and is gone."""

    t: Time
    agent: AgentId


class Result(Struct, frozen=True, kw_only=True, tag_field="kind", tag="result"):
    """Last line: how the run ended and the plan that came of it."""

    t: Time
    status: Literal["converged", "not_converged", "flown"]
    reason: str = ""
    disagreements: Annotated[list[Any], Meta(description="who believes what about which task")] = []
    rounds: Annotated[int | None, Meta(description="rounds until all agreed")] = None
    last_bid_round: Annotated[int | None, Meta(description="round of the last bid")] = None
    declared_round: Annotated[int | None, Meta(description="round in which all knew it")] = None
    plan: Annotated[dict[str, Any], Meta(description="who does what and when")] = {}
    measures: Annotated[
        dict[str, Any], Meta(description="of a search mission: times to detection, shares tracked and so on")
    ] = {}


Known = (
    Sent
    | Dropped
    | Taken
    | Outbid
    | Released
    | Quit
    | Agreed
    | Doubted
    | Act
    | Stage
    | Ended
    | Pose
    | Truth
    | Detected
    | Tracked
    | Divided
    | Crashed
    | Result
)
RECORD_KINDS: tuple[type[Struct], ...] = (Header, *get_args(Known))
