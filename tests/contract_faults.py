"""Missions flown under the Contract Net while things break, and what must hold all the same.

A driver of its own, without the simulator: virtual time, one seed for everything. It executes too: each
vehicle flies its path, starts and finishes its tasks, fails at some, is told of new tasks, of cancelled
ones, leaves, crashes at a chosen step of the protocol and comes back with nothing remembered. Survivors
hear of a crash some time later. The air loses, delays, doubles and replays messages, or is parted.

What must hold, by name (`Broken.rule`):

S1   a task is carried out by one agent at a time. While the air is parted, and only if "duplicate_ok",
     each part may have one, and finishes what it has begun; a hand-over lasts until the old holder hears.
S5   a started task leaves its agent only as done, failed, cancelled, lost with its agent or its lease.
S6   who knows that a task is cancelled never starts it; once all know it, nobody does.
S7   epochs never fall; one epoch of a conversation is awarded to one agent.
S8   the same message a second time changes nothing.
S10  no bid is negative, infinite or not a number.
S11  no good message is refused, and nothing said by a peer raises.
S13  no agent takes what it cannot do: equipment, windows, and the ways between.
START  only what is under contract is started: award, confirmation and contract, or one's own task.
TRUE   "done" was done, "failed" failed, "cancelled" was cancelled, "unserved" has a reason and no taker.
L2   who says that all agree is right.
L3   when the faults are over, every task ends, and ends alike at everybody: no orphan.
L4   what a dead agent held is under contract again soon after its loss was told.
L5   soon after the air has healed nobody plans what another plans.
L7   a task is not passed round and round; when all has ended nobody speaks of it again.
TICK who has been served does not ask for the same instant again.
TOLD every bidder hears what became of its bid.

A run that breaks one of them raises `Broken`, whose text ends with the command that replays it, word for
word of the conversation::

    python tests/contract_faults.py crash 17
"""

from __future__ import annotations

import heapq
import math
import random
import sys
from collections import Counter, defaultdict
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from swarmbid.arrays import MissionArrays
from swarmbid.messages import Message, decode, encode
from swarmbid.model import Agent, Mission, Position, Task, distance
from swarmbid.network import Network, Partition, make_topology
from swarmbid.scores import make_score

ACTS = (
    "cfp", "propose", "refuse", "accept-proposal", "reject-proposal", "confirm", "inform", "inform-done",
    "failure", "cancel",
)  # fmt: skip
CRASH_POINTS = (
    *((when, act) for act in ACTS for when in ("before", "after")),
    *(("when", what) for what in ("started", "finished", "told finished", "any time")),
)
"""Just before or just after an act leaves, or what has happened to the vehicle."""
FAMILIES = ("calm", "noise", "crash", "parted", "hold", "busy", "all")
ENDED = ("done", "failed", "cancelled", "unserved")
HELD = ("contracted", "started")
MANAGING = ("announced", "awarded", "waiting")
PATIENCE = 600.0
"""s after the faults are over until which every task must have ended."""
REST = 15.0
"""s without a word about any task, more than a heartbeat, before a run counts as over."""
SPEED = 4.0


class Broken(AssertionError):
    """Something that must hold did not. `rule` : its name."""

    def __init__(self, rule: str, found: str) -> None:
        super().__init__(f"{rule}: {found}")
        self.rule = rule


@dataclass
class Case:
    """One mission and everything that will happen to it.

    Parameters
    ----------
    orders : (s, what, its parameters), of the world and of the operators.
    crash_points : (when, what, how many times before) for each agent that will crash.
    back_after : s until a crashed agent is back, None for never; in order of crashing.
    failures : how often each task fails in execution before it succeeds.
    bad, good : the air until `calm_at` s, and afterwards.
    told : whether the parts of a parted team are told that they have lost each other.
    detection : s from a crash until each survivor is told, by survivor's row.
    fixes : s between two position reports to an agent on its way; None for none.
    """

    family: str
    seed: int
    mission: Mission
    orders: list[tuple[float, str, tuple[Any, ...]]]
    crash_points: list[tuple[str, str, int]]
    back_after: list[float | None]
    failures: dict[str, int]
    bad: Network
    good: Network
    calm_at: float
    parted: tuple[float, float] | None
    side: dict[str, bool]
    told: bool
    detection: float
    fixes: float | None
    phased: bool
    through_bytes: bool
    options: dict[str, Any]


def case_of(family: str, seed: int) -> Case:
    """Draw a case; the crash points of consecutive seeds go through all that there are."""
    rng = random.Random(f"contract net {family} {seed}")
    mission, later = _mission(rng, f"{family}-{seed}")
    count = len(mission.agents)
    every = family == "all"
    noisy = family in ("noise", "all") or (family != "calm" and rng.random() < 0.5)
    partings = family in ("parted", "hold") or (every and rng.random() < 0.4)
    crashes = {"crash": rng.choice((1, 1, 2)), "all": rng.randint(0, 2)}.get(family, 0)
    crashes = min(crashes, count - 2)
    orders: list[tuple[float, str, tuple[Any, ...]]] = []
    for task in later:
        keep = rng.random() < 0.2 and math.isinf(task.end)
        finders = 2 if family in ("busy", "all") and not keep and rng.random() < 0.3 else 1
        found = rng.uniform(1.0, 40.0)
        for _ in range(finders):
            orders.append((found, "announce", (task, rng.random(), keep)))
            found += rng.uniform(0.0, 0.5)
    failures: dict[str, int] = {}
    leaves = False
    if family in ("busy", "all"):
        tasks = [task.id for task in (*mission.tasks, *later)]
        failures = {task: rng.choice((0, 0, 0, 1, 2)) for task in tasks}
        for task in tasks:
            if rng.random() < 0.2:
                orders.append((rng.uniform(0.0, 45.0), "cancel", (task, rng.random() < 0.5, rng.random())))
        for _ in range(rng.randint(0, 3)):
            orders.append((rng.uniform(5.0, 45.0), "sub_contract", (rng.random(), rng.random() < 0.5)))
        leaves = rng.random() < 0.4 and count - crashes > 2
        if leaves:
            orders.append((rng.uniform(3.0, 45.0), "leave", (rng.random(),)))
    points = [
        (*CRASH_POINTS[(seed + 7 * number) % len(CRASH_POINTS)], rng.choice((0, 0, 1, 2)))
        for number in range(crashes)
    ]
    parted = None
    if partings:
        start = rng.uniform(1.0, 25.0)
        parted = (start, start + rng.uniform(15.0, 50.0))
    shape = "complete" if every or crashes > 1 or rng.random() < 0.6 else rng.choice(("ring", "line"))
    if shape == "line" and (crashes or leaves):
        shape = "ring"  # who is gone relays nothing
    half = rng.randint(1, count - 1)
    faults: dict[str, Any] = {}
    if noisy:
        faults = {"loss": 0.3, "delay": rng.choice((0.0, 1.0)), "duplicate": 0.2, "replay": 0.05}
    topology = make_topology(shape, count)
    cuts = [] if parted is None else [Partition(groups=[range(half)], start=parted[0], end=parted[1])]
    ids = sorted((agent.id for agent in mission.agents), key=str.encode)
    options: dict[str, Any] = {}
    if family == "hold" or (every and rng.random() < 0.3):
        options = {"on_partition": "hold", "lease": rng.choice((20.0, 30.0))}
    if every and rng.random() < 0.3:
        options["take_over"] = True
    hold = options.get("on_partition") == "hold"
    absences: list[float | None] = [
        rng.choice((None, None, rng.uniform(0.5, 4.0), rng.uniform(8.0, 25.0))) for _ in points
    ]
    if hold:  # with half of the team gone for good nobody may begin anything
        absences = [rng.uniform(2.0, 25.0) if back is None else back for back in absences]
    return Case(
        family=family,
        seed=seed,
        mission=mission,
        orders=sorted(orders, key=lambda order: order[0]),
        crash_points=points,
        back_after=absences,
        failures=failures,
        bad=Network(topology, seed=seed, partitions=cuts, **faults),
        good=Network(topology, seed=seed),
        calm_at=max(60.0 if noisy else 0.0, parted[1] if parted else 0.0),
        parted=parted,
        side={name: row < half for row, name in enumerate(ids)},
        told=rng.random() < 0.5,
        detection=rng.uniform(1.0, 5.0),
        fixes=rng.choice((None, 7.0)),
        phased=rng.random() < 0.5,
        through_bytes=seed % 4 == 0,
        options=options,
    )


def _mission(rng: random.Random, name: str) -> tuple[Mission, list[Task]]:
    """A small mission, and tasks that come up later; a third of them full of ties."""
    tied = rng.random() < 0.33

    def place() -> Position:
        if tied:
            return (20.0 * rng.randrange(4), 20.0 * rng.randrange(4), 0.0)
        return (rng.uniform(0.0, 70.0), rng.uniform(0.0, 70.0), 0.0)

    def task(task_id: str) -> Task:
        end = rng.uniform(15.0, 70.0) if rng.random() < 0.2 else math.inf
        return Task(
            id=task_id,
            position=place(),
            reward=80.0 if tied else rng.uniform(50.0, 100.0),
            end=end,
            duration=float(rng.randint(3, 10)),
            discount=0.005,
            equipment=frozenset({"camera"} if rng.random() < 0.2 else ()),
        )

    agents = tuple(
        Agent(
            id=f"a{number}",
            position=place(),
            speed=SPEED,
            equipment=frozenset({"camera"} if number and rng.random() < 0.6 else ()),
        )
        for number in range(rng.randint(3, 6))
    )
    tasks = tuple(task(f"t{number}") for number in range(rng.randint(2, 5)))
    later = [task(f"u{number}") for number in range(rng.randint(2, 3))]
    return Mission(name=name, agents=agents, tasks=tasks), later


@dataclass
class Craft:
    """A vehicle, and the negotiator aboard while it is up.

    Parameters
    ----------
    place, since : where it was at a time, s. bound_for : the task that it flies to. doing : what it does.
    told_at : s, and place, from which its negotiator counts.
    """

    agent: Agent
    one: Any
    place: Position
    since: float = 0.0
    bound_for: str | None = None
    doing: str | None = None
    incarnation: int = 1
    leaving: bool = False
    stale: bool = False
    wake: float = math.inf
    course: int = 0
    ticked: float = -math.inf
    ticks: int = 0
    count_from: tuple[Position, float] = ((0.0, 0.0, 0.0), 0.0)
    last_words: bool = False
    epochs: dict[str, tuple[int, str]] = field(default_factory=dict)
    ended: dict[str, str] = field(default_factory=dict)
    stages: dict[tuple[str, str], str] = field(default_factory=dict)

    @property
    def id(self) -> str:
        return self.agent.id

    @property
    def up(self) -> bool:
        return self.one is not None


@dataclass(frozen=True)
class Flown:
    """How a run ended.

    Parameters
    ----------
    outcomes : of every task, as all see them. seen : what happened how often. awards : by task.
    longest : s from the news of a crash until what was held is under contract again; in quiet air only.
    """

    case: Case
    outcomes: dict[str, Any]
    seen: Counter[str]
    ended_at: float
    awards: dict[str, int]
    longest: float


Make = Callable[..., Any]


def contract_net(*args: Any, **options: Any) -> Any:
    """Make a negotiator."""
    from swarmbid.algorithms.contract_net import ContractNet

    return ContractNet(*args, **options)


def play(
    family: str, seed: int, *, make: Make = contract_net, verbose: bool = False, case: Case | None = None
) -> Flown:
    """Fly one case to its end. Raises `Broken`, with the command that replays it."""
    running = Flight(case or case_of(family, seed), make, verbose)
    try:
        return running.go()
    except Exception as error:
        rule = error.rule if isinstance(error, Broken) else "S11"
        text = str(error) if isinstance(error, Broken) else f"S11: raised {type(error).__name__}: {error}"
        replay = f"replay: python tests/contract_faults.py {family} {seed}"
        broken = Broken(rule, f"{text.partition(': ')[2]}\n    at {running.now:.3f} s; {replay}")
        raise broken from error


class Flight:
    """One run: the event heap, the vehicles, and everything that is watched."""

    def __init__(self, case: Case, make: Make, verbose: bool) -> None:
        self.case, self.make, self.verbose = case, make, verbose
        self.rng = random.Random(f"flight {case.family} {case.seed}")
        self.now = 0.0
        self.seen: Counter[str] = Counter()
        self.arrays = MissionArrays(case.mission)
        self.tasks = {task.id: task for task in case.mission.tasks}
        self.crafts = {
            agent.id: Craft(agent, None, agent.position)
            for agent in sorted(case.mission.agents, key=lambda agent: agent.id.encode())
        }
        self.rows = list(self.crafts)
        self.heap: list[tuple[float, int, str, tuple[Any, ...]]] = []
        self.count = 0
        self.pending = 0  # orders, returns and verdicts that are still to come
        self.points = list(case.crash_points)
        self.crashed: dict[str, float] = {}
        self.handing: set[tuple[str, str]] = set()
        self.finished: defaultdict[str, set[tuple[str, int]]] = defaultdict(set)
        self.broke_down: Counter[str] = Counter()
        self.failed_by: defaultdict[str, set[str]] = defaultdict(set)
        self.cancelled: set[str] = set()
        self.cancel_known: dict[str, set[tuple[str, int]]] = {}
        self.acts: list[tuple[float, str, int, Any]] = []
        self.last_act = 0.0
        self.managers: defaultdict[str, dict[str, int]] = defaultdict(dict)
        self.awarded: dict[tuple[str, int, str], str] = {}
        self.deals: defaultdict[tuple[str, str, int], set[tuple[str, str]]] = defaultdict(set)
        self.awards: Counter[str] = Counter()
        self.disturbed: Counter[str] = Counter()
        self.reopened: dict[str, float] = {}
        self.resting_since: float | None = None
        self.longest = 0.0

    # --- the heap

    def push(self, time: float, kind: str, *args: Any, order: bool = False) -> None:
        self.count += 1
        self.pending += order
        heapq.heappush(self.heap, (time, self.count, kind, args))

    def go(self) -> Flown:
        """Fly until every task has ended and nobody has spoken of one for a while."""
        for craft in self.crafts.values():
            self._board(craft)
        for time, kind, args in self.case.orders:
            self.push(time, kind, *args, order=True)
        if self.case.parted is not None and self.case.told:
            self.push(self.case.parted[0] + self.case.detection, "parted", order=True)
        if any(what == "any time" for _, what, _ in self.points):
            self.push(self.rng.uniform(1.0, 40.0), "any_time", order=True)
        limit = max([self.case.calm_at, *(time for time, _, _ in self.case.orders)]) + PATIENCE
        while self.heap:
            time, _, kind, args = heapq.heappop(self.heap)
            self.now = time
            if time > limit:
                raise Broken("L3", f"not over after {limit:.0f} s: {self._unfinished()}")
            getattr(self, f"_do_{kind}")(*args)
            if kind == "tick" and self._over():
                break
        return self._end()

    def _board(self, craft: Craft) -> None:
        """Put a negotiator aboard that remembers nothing."""
        options = {**self.case.options, "incarnation": craft.incarnation}
        craft.one = self.make(
            craft.id, self.arrays, make_score("time_discounted"), insertion="shift", **options
        )
        craft.count_from = (craft.place, self.now)
        craft.epochs, craft.ended, craft.stages = {}, {}, {}
        craft.bound_for = craft.doing = None
        craft.leaving = craft.last_words = False
        if self.now > 0.0:
            craft.one.set_position(craft.place, self.now)
        first = self.rng.random() if self.case.phased else 0.0
        craft.wake = math.inf
        self._wake(craft, self.now + first)
        if self.case.fixes is not None:
            self.push(self.now + self.case.fixes, "fix", craft.id, craft.incarnation)

    def _wake(self, craft: Craft, time: float) -> None:
        if time < craft.wake:
            craft.wake = time
            self.push(time, "tick", craft.id, craft.incarnation)

    # --- ticks and messages

    def _do_tick(self, name: str, incarnation: int) -> None:
        craft = self.crafts[name]
        if not craft.up or craft.incarnation != incarnation or craft.wake != self.now:
            return
        craft.wake = math.inf
        craft.ticks = craft.ticks + 1 if self.now - craft.ticked < 0.01 else 0
        craft.ticked = self.now
        if craft.ticks > 20:
            raise Broken("TICK", f"{name} wants to tick again and again: {craft.one.next_tick()}")
        said = craft.one.tick(self.now)
        craft.stale = False
        fate = self._watch(craft)
        if fate == "before":
            self._crash(craft)
            return
        for message in said:
            self._send(craft, message)
        if fate == "after" or (craft.last_words and said):
            self._crash(craft)
            return
        self._inspect(craft)
        self._steer(craft)
        self._schedule(craft)
        self._check_agreement()

    def _schedule(self, craft: Craft) -> None:
        due = craft.one.next_tick()
        if due is not None:
            self._wake(craft, max(due, self.now + 1e-6))

    def _send(self, craft: Craft, message: Message) -> None:
        network = self.case.bad if self.now < self.case.calm_at else self.case.good
        if self.case.through_bytes:
            message = decode(encode(message))
        for arrival, receivers in network.deliveries(self.rows.index(craft.id), self.now):
            self.push(arrival, "hear", message, receivers)

    def _do_hear(self, message: Message, receivers: tuple[int, ...]) -> None:
        for row in receivers:
            craft = self.crafts[self.rows[row]]
            if not craft.up:
                continue
            craft.one.receive(message, self.now)
            craft.stale = True
            if self.rng.random() < 0.02:
                self._hear_twice(craft, message)
            self._watch(craft)
            self._schedule(craft)

    def _hear_twice(self, craft: Craft, message: Message) -> None:
        before = (craft.one.digest, craft.one.path, craft.one.outcomes())
        craft.one.receive(message, self.now)
        self.seen["heard twice"] += 1
        if (craft.one.digest, craft.one.path, craft.one.outcomes()) != before:
            raise Broken("S8", f"{craft.id} changed its mind on a second copy from {message.sender}")

    # --- what the operators and the world do

    def _alive(self) -> list[Craft]:
        return [craft for craft in self.crafts.values() if craft.up and not craft.leaving]

    def _do_announce(self, task: Task, which: float, keep: bool) -> None:
        self.pending -= 1
        finders = [craft for craft in self._alive() if task.id not in craft.one.outcomes()]
        if keep:
            finders = [craft for craft in finders if self.case.mission.can_do(craft.agent, task)]
        if not finders:
            return
        craft = finders[int(which * len(finders))]
        if task.id in self.tasks:
            self.seen["found by two"] += 1
        self.tasks[task.id] = task
        self.managers[task.id][craft.id] = craft.incarnation
        self.seen["kept by its finder" if keep else "announced"] += 1
        self._tell(f"finds {task.id}" + (" and keeps it" if keep else ""), craft)
        craft.one.announce(task, self.now, keep=keep)
        self._commanded(craft)

    def _do_cancel(self, task_id: str, everybody: bool, which: float) -> None:
        self.pending -= 1
        knowing = [craft for craft in self._alive() if task_id in craft.one.outcomes()]
        if not knowing:
            return
        self.seen["cancelled"] += 1
        if any(craft.doing == task_id for craft in self.crafts.values()):
            self.seen["cancelled while under way"] += 1
        self.cancelled.add(task_id)
        for craft in knowing if everybody else [knowing[int(which * len(knowing))]]:
            self._tell(f"is told to cancel {task_id}", craft)
            craft.one.cancel_task(task_id)
            self._commanded(craft)

    def _do_sub_contract(self, which: float, started: bool) -> None:
        self.pending -= 1
        offers = []
        for craft in self._alive():
            held = [task for task, _ in craft.one.path]
            wanted = [task for task in held if (task == craft.doing) == started]
            if wanted:
                offers.append((craft, wanted[-1]))
        if not offers:
            return
        craft, task_id = offers[int(which * len(offers))]
        self.seen["sub-contracts opened"] += 1
        self.handing.add((task_id, craft.id))
        self._tell(f"offers {task_id} to others", craft)
        craft.one.sub_contract(task_id, self.now)
        self._commanded(craft)

    def _do_leave(self, which: float) -> None:
        self.pending -= 1
        alive = self._alive()
        if len(alive) < 2:
            return
        craft = alive[int(which * len(alive))]
        self.seen["left busy" if craft.doing else "left"] += 1
        for task_id, _ in craft.one.path:
            self.disturbed[task_id] += 1
        self._tell("leaves", craft)
        for other in self.rows:  # its last word may be lost, or find nobody in earshot
            if other != craft.id:
                late = max(self.now, self.case.calm_at) + self.case.detection
                self.push(late, "verdict", other, craft.id, craft.incarnation, order=True)
        if craft.doing is not None:  # it finishes that, and counts as having done it
            self.finished[craft.doing].add((craft.id, craft.incarnation))
        craft.one.leave()
        craft.leaving = True
        self._commanded(craft)
        if craft.up and [task for task, _ in craft.one.path] != [craft.doing] * (craft.doing is not None):
            raise Broken("S5", f"{craft.id} has left and still plans {craft.one.path}, doing {craft.doing}")

    def _do_fix(self, name: str, incarnation: int) -> None:
        craft = self.crafts[name]
        if not craft.up or craft.incarnation != incarnation or self.case.fixes is None:
            return
        self.push(self.now + self.case.fixes, "fix", name, incarnation)
        if craft.doing is None and not craft.leaving and craft.bound_for is not None:
            self._fly(craft)
            craft.one.set_position(craft.place, self.now)
            craft.count_from = (craft.place, self.now)
            self._commanded(craft)

    def _do_parted(self) -> None:
        """Each side is told that the other is lost; nobody is."""
        self.pending -= 1
        self.seen["parted and told"] += 1
        for craft in self._alive():
            for other in self.rows:
                if craft.up and self.case.side[other] != self.case.side[craft.id]:
                    craft.one.lose_agent(other)
                    self._commanded(craft)

    def _do_any_time(self) -> None:
        self.pending -= 1
        alive = self._alive()
        if len(alive) > 1 and any(what == "any time" for _, what, _ in self.points):
            self.points = [point for point in self.points if point[1] != "any time"]
            self.seen["crash when any time"] += 1
            self._crash(self.rng.choice(alive))

    # --- crashes

    def _crash(self, craft: Craft) -> None:
        self._tell("CRASHES", craft)
        self._fly(craft)
        if craft.doing is not None:
            self.seen["crashed while under way"] += 1
        for task_id in self.tasks:
            outcome = craft.one.outcomes().get(task_id)
            if outcome is not None and outcome.agent == craft.id and outcome.state in HELD:
                self.disturbed[task_id] += 1
                if task_id not in self.cancelled:
                    self.reopened.setdefault(task_id, math.inf)
            if self.managers[task_id].get(craft.id) == craft.incarnation:
                self.disturbed[task_id] += 1
        craft.one = craft.bound_for = craft.doing = None
        self.crashed[craft.id] = self.now
        index = sum(self.seen[key] for key in self.seen if key.startswith("crash ")) - 1
        back = self.case.back_after[min(index, len(self.case.back_after) - 1)]
        if back is not None:
            self.push(self.now + back, "return", craft.id, order=True)
        if back is None or back > self.case.detection + 1.0:
            for other in self.rows:
                if other != craft.id:
                    late = self.case.detection + self.rng.random()
                    self.push(self.now + late, "verdict", other, craft.id, craft.incarnation, order=True)
        else:
            self.seen["back before anybody noticed"] += 1

    def _do_verdict(self, name: str, gone: str, incarnation: int) -> None:
        self.pending -= 1
        craft, other = self.crafts[name], self.crafts[gone]
        if craft.up and (not other.up or other.leaving) and other.incarnation == incarnation:
            self._tell(f"is told that {gone} is lost", craft)
            craft.one.lose_agent(gone)
            for task_id in self.reopened:
                self.reopened[task_id] = min(self.reopened[task_id], self.now)
            self._commanded(craft)

    def _do_return(self, name: str) -> None:
        self.pending -= 1
        craft = self.crafts[name]
        craft.incarnation += 1
        self.seen["back with nothing remembered"] += 1
        self._board(craft)
        self._tell("is back", craft)
        del self.crashed[name]
        for other in self.crashed:
            self.push(self.now + self.case.detection, "verdict", name, other,
                      self.crafts[other].incarnation, order=True)  # fmt: skip

    def _strike(self, when: str, what: str) -> bool:
        """Whether a crash is due at this point."""
        for number, (wanted_when, wanted, left) in enumerate(self.points):
            if (wanted_when, wanted) == (when, what):
                if left:
                    self.points[number] = (when, what, left - 1)
                elif len(self._alive()) > 2:
                    del self.points[number]
                    self.seen[f"crash {when} {what}"] += 1
                    return True
        return False

    # --- flying and working

    def _fly(self, craft: Craft) -> None:
        """Bring the place up to now."""
        if craft.bound_for is not None and craft.doing is None:
            goal = self.tasks[craft.bound_for].position
            way, flown = distance(craft.place, goal), SPEED * (self.now - craft.since)
            part = 1.0 if way <= flown else flown / way
            craft.place = tuple(a + part * (b - a) for a, b in zip(craft.place, goal, strict=True))  # type: ignore[assignment]
        craft.since = self.now

    def _steer(self, craft: Craft) -> None:
        """Fly to the first task of the path, and be there to start it."""
        path = craft.one.path
        if craft.doing is not None:
            if craft.doing not in [task for task, _ in path]:
                self._abandon(craft)
            else:
                return
        head, start = path[0] if path else (None, 0.0)
        if craft.bound_for != head:
            self._fly(craft)
            craft.bound_for = head
        if head is None:
            return
        self._fly(craft)
        there = self.now + distance(craft.place, self.tasks[head].position) / SPEED
        craft.course += 1
        ready = max(there, start, self.now + 1e-6)
        self.push(ready, "arrive", craft.id, craft.incarnation, craft.course)

    def _abandon(self, craft: Craft) -> None:
        """The task under way is not the agent's any more: that needs a reason."""
        task_id = craft.doing
        assert task_id is not None
        outcome = craft.one.outcomes()[task_id]
        hold = self.case.options.get("on_partition") == "hold"
        excused = (
            task_id in self.cancelled
            or self._handing(task_id)
            or (self.case.parted is not None and self.case.told)
            or (hold and self.case.parted is not None)
        )
        if not excused:
            raise Broken("S5", f"{craft.id} was at {task_id} and has lost it: {outcome}")
        self.seen["handed over" if (task_id, craft.id) in self.handing else "abandoned"] += 1
        self.handing.discard((task_id, craft.id))
        craft.doing = craft.bound_for = None
        craft.place, craft.since = self.tasks[task_id].position, self.now
        craft.one.set_position(craft.place, self.now)
        craft.count_from = (craft.place, self.now)
        self._commanded(craft, steer=False)

    def _do_arrive(self, name: str, incarnation: int, course: int) -> None:
        craft = self.crafts[name]
        if not craft.up or (craft.incarnation, craft.course) != (incarnation, course):
            return
        path = craft.one.path
        if not path or craft.doing is not None or path[0][0] != craft.bound_for:
            return
        task_id = path[0][0]
        task = self.tasks[task_id]
        self._fly(craft)
        if self.now > task.end + 1e-6:
            self.seen["came too late"] += 1
            self.broke_down[task_id] += 1
            self.failed_by[task_id].add(name)
            self.disturbed[task_id] += 1
            craft.one.fail_task(task_id, "too_late", self.now)
            self._commanded(craft)
            return
        if self.rng.random() < 0.1:
            self._probe(craft)
        try:
            craft.one.start_task(task_id, self.now)
        except ValueError:
            if self.case.options.get("on_partition") != "hold":
                raise
            self.seen["start held back"] += 1
            craft.course += 1
            self.push(self.now + 1.0, "arrive", name, incarnation, craft.course)
            return
        self._tell(f"STARTS {task_id}", craft)
        craft.doing = task_id
        self.seen["started"] += 1
        self._check_start(craft, task_id)
        craft.place, craft.since = task.position, self.now
        craft.count_from = (task.position, self.now + task.duration)
        self.push(self.now + task.duration, "finish", name, incarnation, task_id, course)
        if self._strike("when", "started"):
            self._crash(craft)
            return
        self._commanded(craft)

    def _probe(self, craft: Craft) -> None:
        """What is not under contract cannot be started, however the driver asks."""
        held = {task for task, _ in craft.one.path}
        for task_id in craft.one.outcomes():
            if task_id not in held:
                try:
                    craft.one.start_task(task_id, self.now)
                except ValueError:
                    self.seen["start without contract refused"] += 1
                else:
                    raise Broken("START", f"{craft.id} may start {task_id}, which is not in its path")

    def _do_finish(self, name: str, incarnation: int, task_id: str, course: int) -> None:
        craft = self.crafts[name]
        if not craft.up or (craft.incarnation, craft.doing) != (incarnation, task_id):
            return
        if task_id not in [task for task, _ in craft.one.path]:
            self._abandon(craft)  # heard just now, not yet weighed
            return
        if self._strike("when", "finished"):
            self._crash(craft)
            return
        craft.doing = craft.bound_for = None
        craft.count_from = (craft.place, self.now)
        if self.case.failures.get(task_id, 0) > self.broke_down[task_id] and not craft.leaving:
            self._tell(f"FAILS at {task_id}", craft)
            self.broke_down[task_id] += 1
            self.failed_by[task_id].add(name)
            self.disturbed[task_id] += 1
            self.seen["failed"] += 1
            craft.one.fail_task(task_id, "broken", self.now)
        else:
            self._tell(f"FINISHES {task_id}", craft)
            if self.finished[task_id] - {(name, incarnation)}:
                self.seen["done again"] += 1
            self.finished[task_id].add((name, incarnation))
            craft.one.finish_task(task_id, self.now)
        if self._strike("when", "told finished"):
            self._crash(craft)
            return
        self._commanded(craft)

    def _commanded(self, craft: Craft, *, steer: bool = True) -> None:
        """After a command: look at what came of it, and at when the agent wants to tick."""
        craft.stale = True
        fate = self._watch(craft)
        if fate == "before":
            self._crash(craft)
            return
        craft.last_words = craft.last_words or fate == "after"
        self._inspect(craft)
        if steer:
            self._steer(craft)
        self._schedule(craft)

    # --- what is watched

    def _tell(self, what: str, craft: Craft) -> None:
        if self.verbose:
            print(f"{self.now:9.3f}  {craft.id} {what}")

    def _watch(self, craft: Craft) -> str:
        """Drain the events; return "before" or "after" if the agent is to crash around an act."""
        fate = ""
        for event in craft.one.events():
            if event.kind == "act":
                fate = self._watch_act(craft, event) or fate
            elif event.kind == "stage":
                self._tell(f"  [{event.role} of {event.task}: {event.state}]", craft)
                self.seen[f"{event.role} {event.state}"] += 1
                craft.stages[event.task, event.role] = event.state
                if event.role == "manager" and event.state in MANAGING:
                    self._watch_manager(craft, event.task)
            elif event.kind == "ended":
                self._tell(f"  {event.task} ended: {event.outcome} by {event.by!r} {event.reason}", craft)
                self.seen[f"ended {event.outcome}"] += 1
            elif event.kind == "dropped":
                self.seen[f"dropped {event.reason}"] += 1
                if event.reason in ("malformed", "oversize", "bid", "id", "unknown_sender"):
                    raise Broken("S11", f"{craft.id} refused a message of {event.sender}: {event.reason}")
        return fate

    def _watch_manager(self, craft: Craft, task_id: str) -> None:
        known = self.managers[task_id]
        if known.get(craft.id) == craft.incarnation:
            return
        others = [self.crafts[name] for name, life in known.items() if name != craft.id]
        if any(other.up and not other.leaving for other in others):
            self.seen["rival managers"] += 1
        elif others:
            self.seen["a successor took over"] += 1
        known[craft.id] = craft.incarnation

    def _watch_act(self, craft: Craft, act: Any) -> str:
        self._tell(
            f"{act.performative} -> {act.to or 'all'}: {act.conversation} {act.bid} {act.detail}", craft
        )
        self.acts.append((self.now, craft.id, craft.incarnation, act))
        self.seen[act.performative] += 1
        if act.bid is not None and not 0.0 <= act.bid < math.inf:
            raise Broken("S10", f"{craft.id} says a bid of {act.bid} on {act.task}")
        self.last_act = self.now
        conversation = act.conversation
        if act.performative in ("accept-proposal", "confirm", "inform"):
            self._watch_deal(craft, act, conversation)
        if act.performative in ACTS:
            for when in ("before", "after"):
                if self._strike(when, act.performative):
                    return when
        return ""

    def _watch_deal(self, craft: Craft, act: Any, conversation: str) -> None:
        if act.performative == "confirm":
            self.deals[act.task, craft.id, craft.incarnation].add(("confirm", conversation))
            return
        other = self.crafts.get(act.to)
        if other is not None:
            self.deals[act.task, other.id, other.incarnation].add((act.performative, conversation))
        if act.performative != "accept-proposal":
            return
        self.awards[act.task] += 1
        key = (craft.id, craft.incarnation, conversation)
        if self.awarded.setdefault(key, act.to) != act.to:
            raise Broken("S7", f"{craft.id} awards {conversation} to {self.awarded[key]} and to {act.to}")
        epoch = _epoch(conversation)
        for (name, life, earlier), to in self.awarded.items():
            same = (name, life) == (craft.id, craft.incarnation) and earlier.split("/")[0] == act.task
            if same and earlier != conversation and _epoch(earlier) > epoch:
                raise Broken("S7", f"{craft.id} awards {conversation} after {earlier}")
            if same and to != act.to and _epoch(earlier) < epoch:
                self.seen["awarded to the next"] += 1

    def _check_start(self, craft: Craft, task_id: str) -> None:
        """S1, S6 and START, at the instant of starting."""
        known = self.cancel_known.get(task_id)
        told = known is not None and (self.case.parted is None or (craft.id, craft.incarnation) in known)
        if craft.ended.get(task_id) == "cancelled" or told:
            raise Broken("S6", f"{craft.id} starts {task_id}, which is known to be cancelled")
        mine = self.deals[task_id, craft.id, craft.incarnation]
        under = {what for what, _ in mine}
        whole = any({("accept-proposal", one), ("confirm", one), ("inform", one)} <= mine for _, one in mine)
        if not whole and craft.id not in self.managers[task_id]:
            raise Broken("START", f"{craft.id} starts {task_id} with no more than {sorted(under)}")
        for other in self.crafts.values():
            if other is not craft and other.doing == task_id and not self._may_both(craft, other, task_id):
                raise Broken("S1", f"{craft.id} starts {task_id}, which {other.id} is carrying out")

    def _may_both(self, craft: Craft, other: Craft, task_id: str) -> bool:
        if (task_id, other.id) in self.handing:
            self.seen["hand-over"] += 1
            return True
        parted, side = self.case.parted, self.case.side
        if parted is None or self.case.options.get("on_partition") == "hold":
            return False
        self.seen["carried out on both sides"] += 1
        return side[craft.id] != side[other.id] and parted[0] <= self.now <= parted[1] + self._news()

    def _news(self) -> float:
        """s in which news surely goes round: every hop may take some goes, each a period and the way."""
        network = self.case.bad
        hops = max(1, self.case.good.diameter())
        return (2.0 * hops + 5.0) * 2.0 / (1.0 - network.loss) * (1.0 + network.delay)

    def _inspect(self, craft: Craft) -> None:
        """What an agent believes may change in certain ways only, and its plan must be possible."""
        outcomes, path = craft.one.outcomes(), craft.one.path
        for task_id, outcome in outcomes.items():
            before = craft.ended.get(task_id)
            if outcome.state in ENDED:
                # Who had done it may be heard last, and a failure may yet be called off.
                if before == "done" and outcome.state != "done":
                    raise Broken("S6", f"{craft.id} held {task_id} for done, now {outcome}")
                if before == "cancelled" and outcome.state not in ("done", "cancelled"):
                    raise Broken("S6", f"{craft.id} held {task_id} for cancelled, now {outcome}")
                craft.ended[task_id] = outcome.state
            elif before in ("done", "cancelled"):
                raise Broken("S6", f"{craft.id} held {task_id} for {before}, now it is {outcome.state}")
            elif before is not None:
                self.seen[f"called again after {before}"] += 1
                del craft.ended[task_id]
            if outcome.state in HELD:
                epoch, agent = craft.epochs.get(task_id, (0, ""))
                if outcome.epoch < epoch and outcome.agent != agent and not self._handing(task_id):
                    raise Broken("S7", f"{craft.id} believes that {outcome.agent} holds {task_id} by epoch "
                                       f"{outcome.epoch}, after {agent} by epoch {epoch}")  # fmt: skip
                craft.epochs[task_id] = max((outcome.epoch, outcome.agent), (epoch, agent))
            if outcome.state in HELD and task_id in self.reopened:
                self._check_served_again(task_id, outcome.agent)
        for task_id, _ in path if not craft.stale else ():
            outcome = outcomes[task_id]
            mine = outcome.state in HELD and outcome.agent == craft.id
            last = craft.leaving and task_id == craft.doing
            if not mine and not last and not self._handing(task_id):
                raise Broken("START", f"{craft.id} plans {task_id}, but believes {outcome}")
        self._check_path(craft, path)
        if self.cancelled:
            alive = self._alive()
            for task_id in sorted(self.cancelled - set(self.cancel_known)):
                if alive and all(one.ended.get(task_id) == "cancelled" for one in alive):
                    self.cancel_known[task_id] = {(one.id, one.incarnation) for one in alive}

    def _handing(self, task_id: str) -> bool:
        return any(task == task_id for task, _ in self.handing)

    def _check_served_again(self, task_id: str, agent: str) -> None:
        told = self.reopened[task_id]
        holder = self.crafts[agent]
        if not holder.up or agent in self.crashed or math.isinf(told):
            return
        del self.reopened[task_id]
        self.seen["served again after a crash"] += 1
        agents = len(self.crafts)
        rounds = (2.0 * agents + 2.0) * 2.0 + 10.0 + 10.0 * max(1, self.case.good.diameter())
        quiet = self.case.bad.loss == 0.0 and self.case.parted is None and not self.case.options
        if quiet and self.case.family == "crash" and len(self.case.crash_points) == 1:
            self.longest = max(self.longest, self.now - told)
            if self.now - told > rounds:
                raise Broken("L4", f"{task_id} was open for {self.now - told:.0f} s, more than {rounds:.0f}")

    def _check_path(self, craft: Craft, path: list[tuple[str, float]]) -> None:
        place, free = craft.count_from
        for task_id, start in path:
            if task_id == craft.doing:
                continue
            task = self.tasks[task_id]
            if not self.case.mission.can_do(craft.agent, task):
                raise Broken("S13", f"{craft.id} takes {task_id} without {sorted(task.equipment)}")
            earliest = max(task.start, free + distance(place, task.position) / SPEED)
            if not earliest - 1e-6 <= start <= task.end + 1e-6:
                raise Broken("S13", f"{craft.id} plans {task_id} at {start:.3f} s, not within "
                                    f"{earliest:.3f} to {task.end:.3f}; free at {free:.3f} s")  # fmt: skip
            place, free = task.position, start + task.duration

    def _check_agreement(self) -> None:
        """L2: when every agent knows that all agree, they do; and L5."""
        alive = self._alive()
        if self.case.parted is not None:
            self._check_healed(alive)
            if self.case.parted[0] <= self.now <= self.case.parted[1] + 10.0 * self._news():
                return
        if any(craft.stale or not craft.one.agreed for craft in alive):
            return
        self.seen["all agreed"] += 1
        if len({craft.one.digest for craft in alive}) > 1:
            views = {craft.id: craft.one.outcomes() for craft in alive}
            raise Broken("L2", f"all say that they agree, with different digests: {views}")

    def _check_healed(self, alive: list[Craft]) -> None:
        assert self.case.parted is not None
        if not self.case.parted[1] + self._news() < self.now < self.case.parted[1] + self._news() + 2.0:
            return
        planners: dict[str, str] = {}
        for craft in alive:
            for task_id, _ in craft.one.path:
                if task_id != craft.doing and task_id in planners:
                    raise Broken("L5", f"{planners[task_id]} and {craft.id} both plan {task_id}, "
                                       f"{self.now - self.case.parted[1]:.0f} s after the heal")  # fmt: skip
                planners[task_id] = craft.id

    # --- the end

    def _unfinished(self) -> dict[str, dict[str, str]]:
        views: defaultdict[str, dict[str, str]] = defaultdict(dict)
        for craft in self._alive():
            for task_id, outcome in craft.one.outcomes().items():
                views[task_id][craft.id] = f"{outcome.state} {outcome.agent}"
        everybody = len(self._alive())
        return {
            task_id: seen for task_id, seen in views.items()
            if len(seen) < everybody or len(set(seen.values())) > 1
            or next(iter(seen.values())).split()[0] not in ENDED
        }  # fmt: skip

    def _over(self) -> bool:
        busy = any(craft.up and craft.doing for craft in self.crafts.values())
        if self.now < self.case.calm_at or self.pending or busy or self._unfinished():
            self.resting_since = None
            return False
        if self.resting_since is None:
            self.resting_since = self.now
        return self.now - max(self.resting_since, self.last_act) >= REST

    def _end(self) -> Flown:
        alive = self._alive()
        if self._unfinished():
            raise Broken("L3", f"nobody will tick any more: {self._unfinished()}")
        outcomes = alive[0].one.outcomes() if alive else {}
        for task_id, outcome in outcomes.items():
            self._check_true(task_id, outcome)
            self.seen[f"task {outcome.state}"] += 1
        for craft in alive:
            for (task_id, role), stage in craft.stages.items():
                if role == "contractor" and stage in ("proposed", "confirmed", *HELD):
                    raise Broken("TOLD", f"{craft.id} is left {stage} of {task_id}, which has ended")
            if craft.one.path:
                raise Broken("L3", f"{craft.id} still plans {craft.one.path}")
            if len({outcome.state for outcome in outcomes.values()} - set(ENDED)):
                raise Broken("L3", f"not all has ended: {outcomes}")
        lost = [task_id for task_id in self.tasks if task_id not in outcomes]
        self.seen["found by one that crashed at once"] += len(lost)
        if lost and not self.seen_crash:
            raise Broken("L3", f"nobody knows of {lost}")
        if self.case.family == "calm":
            self._check_calm()
        for task_id, count in self.awards.items():
            most = len(self.crafts) * (1 + self.disturbed[task_id]) + (8 if self.case.family != "calm" else 0)
            if count > most:
                raise Broken("L7", f"{task_id} was awarded {count} times, disturbed "
                                   f"{self.disturbed[task_id]} times")  # fmt: skip
        return Flown(self.case, outcomes, self.seen, self.now, dict(self.awards), self.longest)

    @property
    def seen_crash(self) -> bool:
        return (
            any(key.startswith("crash ") for key in self.seen)
            or self.seen["left"] + self.seen["left busy"] > 0
        )

    def _check_true(self, task_id: str, outcome: Any) -> None:
        state = outcome.state
        wrong = (
            (state == "done" and outcome.agent not in {name for name, _ in self.finished[task_id]})
            or (state == "failed" and not self.broke_down[task_id])
            or (state == "cancelled" and task_id not in self.cancelled)
            or (state == "unserved" and not outcome.reason)
        )
        if wrong:
            raise Broken("TRUE", f"{task_id} is {outcome}; finished by {sorted(self.finished[task_id])}")
        crafts = {(craft.id, craft.incarnation) for craft in self.crafts.values() if craft.up}
        if state != "done" and self.finished[task_id] & crafts:  # who did it and can still tell
            raise Broken("TRUE", f"{task_id} is {outcome}, but {self.finished[task_id]} has done it")
        task = self.tasks[task_id]
        if state in ("unserved", "failed") and math.isinf(task.end):
            able = [one.id for one in self._alive() if self.case.mission.can_do(one.agent, task)]
            able = [name for name in able if name not in self.failed_by[task_id]]
            if able:
                raise Broken("TRUE", f"{task_id} is {outcome}, but {able} could do it")

    def _check_calm(self) -> None:
        """Without faults every bidder is told, by name or with all."""
        bidders: defaultdict[str, set[str]] = defaultdict(set)
        told: defaultdict[str, set[str]] = defaultdict(set)
        for _, speaker, _, act in self.acts:
            if act.performative == "propose":
                bidders[act.task].add(speaker)
            elif act.performative in ("accept-proposal", "reject-proposal", "cancel"):
                told[act.task] |= {act.to} if act.to else set(self.rows)
        for task_id, names in bidders.items():
            if not names <= told[task_id] | set(self.managers[task_id]):
                raise Broken("TOLD", f"nobody told {sorted(names - told[task_id])} about {task_id}")


def _epoch(conversation: str) -> int:
    return int(conversation.rsplit("/", 1)[1])


def main(arguments: list[str]) -> int:
    """Replay one run word for word."""
    family, seed = arguments[0], int(arguments[1])
    case = case_of(family, seed)
    for agent in case.mission.agents:
        print(agent)
    for task in case.mission.tasks:
        print(task)
    for name in ("orders", "crash_points", "back_after", "failures", "parted", "side", "told", "detection",
                 "fixes", "calm_at", "options"):  # fmt: skip
        print(f"{name}: {getattr(case, name)}")
    print(case.bad.describe())
    try:
        flown = play(family, seed, verbose=True, case=case)
    except Broken as broken:
        print(broken)
        return 1
    for task_id, outcome in flown.outcomes.items():
        print(task_id, outcome)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
