"""A run in simulated time: negotiators, a network with faults, one event heap.

The simulator is a driver like any other (`swarmbid.negotiator`): it carries messages and tells the
time. In rounds mode every agent ticks at 0, 1, 2 ... s and what is sent arrives for the next round, as
the papers count. Asynchronously every agent has a phase of its own. Time is virtual: a run takes as
long as its arithmetic.
"""

from __future__ import annotations

import heapq
import math
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from os import PathLike
from typing import IO, Any, cast

from swarmbid import __version__, registry
from swarmbid.arrays import MissionArrays
from swarmbid.disagreement import disagreements, undisputed
from swarmbid.errors import Fault, InputError
from swarmbid.kernels import wire
from swarmbid.messages import Beliefs, Message, decode, encode
from swarmbid.messages.beliefs import Counts, encoded_size
from swarmbid.missionfile import mission_to_dict
from swarmbid.model import Mission
from swarmbid.negotiator import Negotiator
from swarmbid.network import Network, make_topology
from swarmbid.plan import Plan, make_plan
from swarmbid.rng import stream
from swarmbid.scores import INSERTIONS, Score, make_score
from swarmbid.trace import EVENT_RECORDS, Header, Result, Sent, TraceWriter

MODES = ("rounds", "asynchronous")
EPSILON = 1e-9
"""s, the least time between two ticks of an agent."""


@dataclass(frozen=True)
class Run:
    """How a run ended, what it took, and the plan that came of it.

    Parameters
    ----------
    status : "converged" (all live agents know that all agree, and they do) or "not_converged".
    reason : why not; empty if converged.
    disagreements : who believes what of which task, when they differ.
    rounds : until the beliefs of all were equal and stayed so.
    last_bid_round : of the last bid. declared_round : in which the last agent knew that all agree.
    false_agreements : instants at which all thought that all agree, and were wrong.
    changes : how often beliefs changed; an agent's count once for each time at which it acted.
    messages, bytes, entries : broadcasts, their size on the wire, the beliefs in them.
    dropped : messages not taken in, by reason.
    negotiators : as they were at the end, in order of id.
    """

    mission: Mission
    algorithm: str
    score: Score
    insertion: str
    status: str
    reason: str
    disagreements: list[dict[str, Any]]
    rounds: int
    last_bid_round: int
    declared_round: int | None
    false_agreements: int
    messages: int
    bytes: int
    entries: int
    dropped: dict[str, int]
    paths: dict[str, list[tuple[str, float]]] = field(repr=False)
    changes: int = 0
    negotiators: tuple[Negotiator, ...] = field(default=(), repr=False, compare=False)

    @property
    def converged(self) -> bool:
        """Whether `status` is "converged"."""
        return self.status == "converged"

    @cached_property
    def plan(self) -> Plan:
        """Who does what, and when."""
        return make_plan(self.mission, self.paths, self.score, self.algorithm, self.insertion)


def simulate(
    mission: Mission,
    *,
    algorithm: str = "cbba",
    score: str | Score | None = None,
    insertion: str | None = None,
    network: Network | None = None,
    seed: int = 0,
    trace: str | PathLike[str] | IO[str] | IO[bytes] | None = None,
    mode: str = "rounds",
    max_rounds: int | None = None,
    through_bytes: bool = False,
    progress: Callable[[float], None] | None = None,
    **options: Any,
) -> Run:
    """Let the agents of `mission` negotiate until all know that they agree.

    Parameters
    ----------
    algorithm : a name of `swarmbid list`.
    score : see `swarmbid.scores.make_score`. insertion : "hold", "shift" or "append"; the score's own
        by default.
    network : who hears whom, with which faults; the complete graph without faults by default.
    seed : of the phases in asynchronous mode (the network has a seed of its own).
    trace : where to write the record of the run.
    mode : "rounds" or "asynchronous".
    max_rounds : when to give up; far beyond what theory allows by default.
    through_bytes : send every message through its bytes, as on a real network.
    progress : called with the time, s, after every instant, so that somebody who waits can be told.
    options : of the algorithm.

    Raises
    ------
    InputError : an unknown name or option, a network of another size, or a mission that the algorithm
        cannot allocate. Not converging is no error but a status.

    Examples
    --------
    >>> from swarmbid.model import Agent, Task
    >>> here, there = (0.0, 0.0, 0.0), (30.0, 40.0, 0.0)
    >>> mission = Mission(agents=(Agent(id="uav1", position=here),), tasks=(Task(id="t1", position=there),))
    >>> simulate(mission).paths
    {'uav1': [('t1', 50.0)]}
    """
    found = make_score(score)
    rule = insertion or found.insertion
    for name, chosen, known in (("mode", mode, MODES), ("insertion", rule, INSERTIONS)):
        if chosen not in known:
            mend = "Choose one of: " + ", ".join(known) + "."
            raise InputError([Fault("simulation", name, f"is {chosen!r}", mend)])
    cls = registry.load_class("algorithms", algorithm, Negotiator)  # type: ignore[type-abstract]
    reasons = cls.unsupported(mission)
    if reasons:
        mend = "Choose another algorithm (swarmbid list) or change the mission."
        raise InputError([Fault(f"algorithm {algorithm}", "", f"cannot: {why}", mend) for why in reasons])
    if network is None:
        network = Network(make_topology("complete", max(len(mission.agents), 1)))
    if len(mission.agents) not in (network.num_agents, 0):
        why = f"is for {network.num_agents} agents, the mission has {len(mission.agents)}"
        raise InputError([Fault("network", "", why, "Make it for as many.")])
    arrays = MissionArrays(mission)
    try:
        make: Callable[..., Negotiator] = cls
        negotiators = [
            make(agent_id, arrays, found, insertion=rule, **options) for agent_id in arrays.agent_ids
        ]
    except TypeError as error:
        raise InputError([Fault(f"algorithm {algorithm}", "options", str(error), "Leave it out.")]) from None
    running = _Run(mission, arrays, negotiators, network, mode, seed, through_bytes)
    running.progress = progress
    if trace is None:
        return running.go(algorithm, found, rule, max_rounds)
    with TraceWriter(trace) as writer:
        writer.write(
            Header(
                swarmbid=__version__,
                mission=mission_to_dict(mission),
                algorithm=algorithm,
                options={"insertion": rule, **options},
                score={"name": found.name, **found.options},
                network=network.describe(),
                seed=seed,
                mode=mode,  # type: ignore[arg-type]
            )
        )
        running.writer = writer
        run = running.go(algorithm, found, rule, max_rounds)
        writer.write(
            Result(
                t=running.now,
                status=run.status,  # type: ignore[arg-type]
                reason=run.reason,
                disagreements=run.disagreements,
                rounds=run.rounds,
                last_bid_round=run.last_bid_round,
                declared_round=run.declared_round,
                plan=run.plan.to_dict(),
            )
        )
    return run


class _Run:
    """The event heap and what is counted on the way."""

    def __init__(
        self,
        mission: Mission,
        arrays: MissionArrays,
        negotiators: list[Negotiator],
        network: Network,
        mode: str,
        seed: int,
        through_bytes: bool,
    ) -> None:
        self.mission = mission
        self.arrays = arrays
        self.negotiators = negotiators
        self.network = network
        self.mode = mode
        self.through_bytes = through_bytes
        self.writer: TraceWriter | None = None
        self.progress: Callable[[float], None] | None = None
        self.now = 0.0
        self._heap: list[tuple[float, int, Message | None, tuple[int, ...]]] = []
        self._count = 0
        self._digests = [negotiator.digest for negotiator in negotiators]
        self._changed_round = 0
        self._changed_at = 0.0
        self._last_bid_round = 0
        self._messages = self._bytes = self._entries = self._changes = 0
        self._changed_last = [-1.0] * len(negotiators)
        self._dropped: Counter[str] = Counter()
        phases = stream(seed, "phases").random(len(negotiators)).tolist()
        first = [0.0] * len(negotiators) if mode == "rounds" else phases
        self._next = list(first)
        for row, time in enumerate(first):
            self._push(time, None, (row,))

    def _push(self, time: float, message: Message | None, rows: tuple[int, ...]) -> None:
        """Let `rows` receive `message` at `time`, or tick if it is None."""
        self._count += 1
        heapq.heappush(self._heap, (time, self._count, message, rows))

    def go(self, algorithm: str, score: Score, insertion: str, max_rounds: int | None) -> Run:
        """Run until all agree or the rounds are over."""
        limit = max_rounds if max_rounds is not None else self._patience()
        declared: int | None = 0 if not self.negotiators else None
        reason = "" if not self.negotiators else f"the beliefs still differed after {limit} rounds"
        false_agreements = 0
        while self._heap and self._heap[0][0] < limit:
            ticked = self._instant()
            if self.progress is not None:
                self.progress(self.now)
            if not ticked or not all(one.agreed for one in self.negotiators):
                if ticked and self._hopeless():
                    reason = self._split()
                    break
                continue
            if len({one.digest for one in self.negotiators}) == 1:
                declared, reason = math.floor(self.now) + 1, ""
                break
            false_agreements += 1
        status = "not_converged" if reason else "converged"
        return Run(
            mission=self.mission,
            algorithm=algorithm,
            score=score,
            insertion=insertion,
            status=status,
            reason=reason,
            disagreements=disagreements(self.negotiators) if reason else [],
            rounds=self._changed_round,
            last_bid_round=self._last_bid_round,
            declared_round=declared,
            false_agreements=false_agreements,
            messages=self._messages,
            bytes=self._bytes,
            entries=self._entries,
            dropped=dict(sorted(self._dropped.items())),
            paths=self._paths(agreed=not reason),
            changes=self._changes,
            negotiators=tuple(self.negotiators),
        )

    def _instant(self) -> bool:
        """Everything that happens at the next instant; return whether anybody ticked.

        What is sent now arrives later, so agents can be served one after the other: each takes in its
        messages and ticks while its beliefs are at hand in the processor's cache.
        """
        now = self.now = self._heap[0][0]
        arrived: dict[int, list[Message]] = {}
        while self._heap and self._heap[0][0] == now:
            _, _, message, rows = heapq.heappop(self._heap)
            for row in rows:
                if message is not None:
                    arrived.setdefault(row, []).append(message)
                elif self._next[row] == now:
                    arrived.setdefault(row, [])
        ticked = False
        for row in sorted(arrived):
            ticked |= self._serve(row, arrived[row])
        return ticked

    def _serve(self, row: int, messages: list[Message]) -> bool:
        """Let one agent take in its messages, and tick if it is due; return whether it did."""
        one, now = self.negotiators[row], self.now
        for message in messages:
            one.receive(message, now)
        # What changed since the last tick came in messages of rounds that are over.
        self._note_change(row, math.ceil(now))
        due: float = min(self._next[row], max(self._at(one.next_tick()), now))
        ticked = due <= now
        said: list[Message] = []
        if ticked:
            said = one.tick(now)
            self._note_change(row, math.floor(now) + 1)
            due = self._at(one.next_tick(), after=now)
        if ticked or due != self._next[row]:
            self._next[row] = due
            if math.isfinite(due):
                self._push(due, None, (row,))
        self._note_events(one)
        for message in said:
            self._send(row, message)
        return ticked

    def _note_change(self, row: int, round_: int) -> None:
        digest = self.negotiators[row].digest
        if digest != self._digests[row]:
            self._digests[row] = digest
            self._changed_round = max(self._changed_round, round_)
            self._changed_at = self.now
            self._changes += self._changed_last[row] != self.now
            self._changed_last[row] = self.now

    def _note_events(self, one: Negotiator) -> None:
        for event in one.events():
            if event.kind == "taken":
                self._last_bid_round = max(self._last_bid_round, math.floor(self.now) + 1)
            elif event.kind == "dropped":
                self._dropped[vars(event)["reason"]] += 1
            if self.writer is not None:
                self.writer.write(EVENT_RECORDS[event.kind](t=self.now, agent=one.agent_id, **vars(event)))

    def _at(self, wanted: float | None, after: float = -math.inf) -> float:
        """When a tick wanted at some time can be had: later than `after`, in whole rounds in rounds mode."""
        if wanted is None:
            return math.inf
        time = max(wanted, after + EPSILON)
        return float(math.ceil(time)) if self.mode == "rounds" and math.isfinite(time) else time

    def _send(self, row: int, message: Message) -> None:
        network = self.network
        size = size_on_wire(message, self.arrays)
        self._messages += 1
        self._bytes += size
        self._entries += message.entries
        if self.through_bytes:
            message = cast(Message, decode(encode(message)))
        deliveries = network.deliveries(row, self.now)
        for arrival, receivers in deliveries:
            self._push(arrival, message, receivers)
        if self.writer is not None:
            self.writer.write(
                Sent(
                    t=self.now,
                    agent=message.sender,
                    sequence=message.sequence,
                    entries=message.entries,
                    bytes=size,
                    full=message.full,
                    receivers=len(network.neighbours(row, self.now)),
                    lost=network.last_lost,
                )
            )

    def _patience(self) -> int:
        """Rounds after which even a bad network should long have agreed."""
        seats = sum(self.arrays.bundle_limit(agent) for agent in self.arrays.agents)
        hops = self.network.diameter() if self.network.topology.static else -1
        hops = max(hops, 1) if hops >= 0 else self.network.num_agents
        slow = (1.0 + self.network.delay) / max(1.0 - self.network.loss, 0.01)
        ends = [partition.end for partition in self.network.partitions]
        ends += [cut.end for cut in self.network.cuts]
        ends += [end for _, end in self.network.freeze]
        wait = max((end for end in ends if math.isfinite(end)), default=0.0)
        wanted = sum(task.agents_required or len(task.equipment) for task in self.arrays.tasks)
        # Groups that stay incomplete are dissolved one after the other, each after an agreement.
        groups = sum(task.is_group for task in self.arrays.tasks)
        return math.ceil(wait + 200 + (4 * (min(wanted, seats) + 1) + 50 * groups) * hops * slow)

    def _hopeless(self) -> bool:
        """Whether the network is in pieces for good and each piece has long been at rest."""
        if self.now - self._changed_at < 2 * self.network.num_agents + 20 or self.now % 10:
            return False
        return self.network.final_components(self.now) > 1

    def _split(self) -> str:
        pieces = self.network.final_components(self.now)
        return f"the network is in {pieces} pieces that cannot hear each other"

    def _paths(self, *, agreed: bool) -> dict[str, list[tuple[str, float]]]:
        if agreed:
            return {one.agent_id: one.path for one in self.negotiators}
        return undisputed(self.mission, self.negotiators)


def size_on_wire(message: Message, arrays: MissionArrays) -> int:
    """Bytes of a message that is in the rows of `arrays`.

    Beliefs are counted without being encoded: in large runs there are a million of them.
    """
    return (
        encoded_size(message, counts_of(message, arrays))
        if isinstance(message, Beliefs)
        else len(encode(message))
    )


def counts_of(message: Beliefs, arrays: MissionArrays) -> Counts:
    """Count what the size of a message follows from; the message is in the rows of `arrays`."""
    agents, agent_bytes, task_bytes, winners = wire.count_columns(
        message.heard, message.tasks, message.winners, message.agreed, message.asked, message.left,
        arrays.agent_lengths, arrays.task_lengths,
    )  # fmt: skip
    return Counts(
        agents=agents,
        agent_bytes=agent_bytes,
        task_bytes=task_bytes,
        winners=winners,
        stamps=wire.spread(message.heard),
        agreed_at=wire.spread(message.agreed_at),
        left_at=wire.spread(message.left_at),
    )
