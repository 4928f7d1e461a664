"""CBGA: groups of agents form for tasks that need several, without a leader (Hunt et al. 2014), repaired.

Solves: multi-robot tasks, several per robot, planned ahead (ST-MR-TA), with equipment, prerequisites and
windows. The paper's algorithm as printed seldom ends in a clean state (`cbga_printed`). Here two ideas
replace its pairwise merging of matrices:

- Each agent alone writes its own record, its column of the assignment matrix X: what it bids for, how much,
  and where in its path. Everybody relays it unchanged, and the newer one counts.
- All else follows from the set of records, by one referee that everybody runs alike: who is accepted,
  which groups are complete, and when each starts, so that nobody waits for ever.

An entry's fate depends on entries of higher rank alone, and claims only fall; so the agents settle, on
what a central greedy with the same referee would choose (`swarmbid.references.coalition_greedy`), whatever
the network does to messages. See "Why CBGA settles" in the documentation.

Task quitting (the paper's bees): once all agree and groups are left incomplete, the worst of them is
dissolved, its members never bid on that task again, and they plan anew; each time one pair of agent and
task less is left, so this ends. Bars are part of what is agreed on, and are lifted when the roster or the
tasks change. Team rewards (the paper's ants): who joins an open group ranks right behind its founder, so
that open groups fill before new ones are opened.

Where this departs from the paper, and why, is in the documentation ("What the paper prints").
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from swarmbid.algorithms._conversation import Conversation, check_options
from swarmbid.algorithms._joint_plan import JointPlan
from swarmbid.algorithms._records import Bar, RecordsVoice, translated
from swarmbid.algorithms._terms import MOST_EQUIPMENT, too_much_equipment
from swarmbid.arrays import MissionArrays
from swarmbid.errors import Fault
from swarmbid.kernels.consensus import digest_of_stamps
from swarmbid.messages import Message, MessageError, Records
from swarmbid.messages.records import BIDDING, DONE, STARTED, Place, Record
from swarmbid.model import Mission, Position, Task, distance
from swarmbid.negotiator import TaskOutbid, TaskQuit, TaskReleased, TaskTaken
from swarmbid.scores import Score, make_score

INSERTIONS = ("shift", "append")


class CBGA(Conversation[RecordsVoice]):
    """The consensus-based grouping algorithm aboard one agent.

    Parameters
    ----------
    agent_id : which agent of the mission.
    mission : the mission, or its arrays (share them between agents of one process).
    score : see `swarmbid.scores.make_score`.
    insertion : "shift" or "append"; promised times cannot hold where groups wait for their last member.
    quitting : whether incomplete groups are dissolved.
    quit_after : s without any change after which an agent quits even if it does not know that all agree
        (δ, Hunt 2014, eq. (10)); None to wait for agreement, which never errs.
    dissolve : share of the incomplete groups that are dissolved at a time, the worst first; one at least.
    team_rewards : whether who joins an open group ranks right behind its founder.
    period : s between two messages at most. heartbeat : s between messages when all agree.
    idle_every : periods between two messages of an agent that has no news but does not know yet that all
        agree.
    incarnation : count it up whenever the agent starts again with nothing remembered.

    Examples
    --------
    >>> from swarmbid.model import Agent, Mission, Task
    >>> mission = Mission(
    ...     agents=(Agent(id="uav1", position=(0.0, 0.0, 0.0)), Agent(id="uav2", position=(3.0, 0.0, 0.0))),
    ...     tasks=(Task(id="lift", position=(3.0, 4.0, 0.0), reward=10.0, agents_required=2),),
    ... )
    >>> one, other = CBGA("uav1", mission), CBGA("uav2", mission)
    >>> for message in one.tick(now=0.0):
    ...     other.receive(message, now=0.5)
    >>> said = other.tick(now=1.0)
    >>> other.path
    [('lift', 5.0)]
    """

    def __init__(
        self,
        agent_id: str,
        mission: Mission | MissionArrays,
        score: str | Score | None = None,
        *,
        insertion: str | None = None,
        quitting: bool = True,
        quit_after: float | None = None,
        dissolve: float = 0.25,
        team_rewards: bool = False,
        period: float = 1.0,
        heartbeat: float = 10.0,
        idle_every: int = 4,
        incarnation: int = 1,
    ) -> None:
        faults = []
        where = f"agent {agent_id}"
        if quit_after is not None and not quit_after > 0.0:
            faults.append(Fault(where, "quit_after", f"is {quit_after!r}", "Give seconds above 0, or None."))
        if not 0.0 <= dissolve <= 1.0:
            faults.append(Fault(where, "dissolve", f"is {dissolve!r}", "Give a share from 0 to 1."))
        found = make_score(score)
        if found.visit_function() is not None:
            mend = "Use a score of `swarmbid list`, or an algorithm for tasks of one agent each."
            faults.append(
                Fault(where, "score", "is a function of one's own, by which groups cannot bid", mend)
            )
        rule = insertion or (found.insertion if found.insertion in INSERTIONS else "shift")
        arrays = check_options(
            agent_id, mission, rule, insertions=INSERTIONS, period=period, heartbeat=heartbeat, faults=faults,
            idle_every=idle_every,
        )  # fmt: skip
        me = arrays.agent_row[agent_id]
        voice = RecordsVoice(agent_id, arrays, me, incarnation=incarnation)
        super().__init__(agent_id, arrays, voice, period=period, heartbeat=heartbeat, idle_every=idle_every)
        self._quitting = quitting
        self._quit_after = math.inf if quit_after is None else quit_after
        self._dissolve = dissolve
        self._plan = JointPlan(arrays, me, found, insertion=rule, team=team_rewards)
        self._bars: set[Bar] = set()
        self._closed: set[int] = set()
        self._started: list[tuple[int, float]] = []
        self._context = self._context_now()
        self._digest: int | None = None
        self._changed_at = -math.inf

    @classmethod
    def unsupported(cls, mission: Mission) -> list[str]:
        """Everything but tasks that need a great many kinds of equipment."""
        found = too_much_equipment(mission)
        return [f"task {found[0]} needs more than {MOST_EQUIPMENT} kinds of equipment"] if found else []

    # --- the conversation

    def _understand(self, message: Message) -> Message:
        if not isinstance(message, Records):
            raise MessageError("malformed", "is of another algorithm")
        message = translated(message, self._arrays)
        for owner, record in zip(message.owners.tolist(), message.records, strict=True):
            # Room is made for the longest record there is, so nobody may claim more than it can hold.
            if record.wanted > self._plan.limit(owner) or record.tasks.size > self._arrays.num_tasks:
                raise MessageError("bundle", "a record holds more than its agent may take")
        return message

    def _absorb(self, sender: int, message: Message, now: float) -> None:
        assert isinstance(message, Records)
        for place in self._voice.hear(sender, message):
            owner, record = int(message.owners[place]), message.records[place]
            if owner == self._me:
                continue  # what an earlier life of this agent said; the next word of this one outdates it
            self._voice.learn(sender, owner, record.stamp)
            self._put(owner, record)
        if message.context == self._context and message.barred_tasks.size:
            told = zip(message.barred_agents.tolist(), message.barred_tasks.tolist(), strict=True)
            self._bar({(agent, task) for agent, task in told})

    def _put(self, row: int, record: Record) -> None:
        if row in self._left and record.stamp <= self._left[row]:
            record = record.only(record.states == DONE)
        self._plan.put(row, record)
        self._digest = None

    def _decide(self, now: float) -> None:
        if self._must_build or self._plan.stale:
            self._build(now)
        if self._quitting and now - self._changed_at >= self._quit_after:
            self._quit(now)

    def _satisfied(self, now: float) -> bool:
        """All agree: leave it at that, unless a group is incomplete and may be dissolved."""
        return not self._quit(now)

    def _quit(self, now: float) -> bool:
        """Dissolve the worst of the incomplete groups; return whether there was one."""
        groups = self._plan.incomplete() if self._quitting else []
        worst = groups[: max(1, math.ceil(self._dissolve * len(groups)))]
        bars = {(row, task) for task in worst for row in self._plan.members(task)}
        for task in worst:
            if self._me in self._plan.members(task):
                filled = len(self._plan.members(task))
                self._events.append(TaskQuit(self._arrays.task_ids[task], filled))
        if bars:
            self._bar(bars)
            self._build(now)
        return bool(bars)

    def _bar(self, bars: set[Bar]) -> None:
        new = bars - self._bars
        if new:
            self._bars |= new
            self._voice.bars_owed = True
            self._plan.bar(new)
            self._digest = None
            self._change()

    def _allow(self) -> None:
        present = np.array([not self._absent(row) for row in range(self._arrays.num_agents)], np.bool_)
        self._plan.allow(present, self._bars, self._closed)
        self._digest = None
        self._change()

    def _build(self, now: float) -> None:
        """Scan all records, and publish the agent's own if its bundle has changed."""
        self._plan.scan()
        self._must_build = False
        self._changed_at = now
        record = self._plan.bundle(self._voice.stamp + 1)
        self._publish(record)

    def _publish(self, record: Record) -> None:
        old = self._plan.records[self._me]
        if old.stamp > 0 and record.same(old):
            return
        self._report(old, record)
        self._plan.put(self._me, record)
        self._voice.stamps[self._me] = record.stamp
        self._voice.owed[self._me] = True
        self._digest = None

    def _say(self, now: float, *, heartbeat: bool) -> Message:
        return self._voice.say(
            now, self._arrays, self._plan.records, self._agreement, self._left, self._bars,
            context=self._context, digest=self.digest, settled=self._agreed, heartbeat=heartbeat,
        )  # fmt: skip

    def _report(self, old: Record, new: Record) -> None:
        """Turn the difference between two bundles into events."""
        ids = self._arrays.task_ids
        before = _bids(old)
        after = _bids(new)
        started = set(new.tasks[new.states != BIDDING].tolist())
        because = None
        for row, bid in before.items():
            if row in after or row in started:
                continue
            members = self._plan.members(row)
            if members and self._me not in members and self._plan.full(row):
                by = min(members, key=lambda one: (self._plan.bid(one, row), one))
                name = self._arrays.agent_ids[by]
                self._events.append(TaskOutbid(ids[row], bid, name, self._plan.bid(by, row)))
                because = because or ids[row]
            else:
                self._events.append(TaskReleased(ids[row], because))
        path = self._plan.path(self._me)
        for row, bid in after.items():
            if before.get(row) != bid:
                self._events.append(TaskTaken(ids[row], bid, path.index(row), self._plan.start(row)))

    # --- what the driver may ask

    @property
    def path(self) -> list[tuple[str, float]]:
        """Started tasks first, then those whose groups are complete (p_i, τ_i)."""
        ids, plan = self._arrays.task_ids, self._plan
        mine = plan.records[self._me]
        held = mine.tasks[mine.states != BIDDING].tolist()
        started = [(ids[row], start) for row, start in self._started]
        to_do = [row for row in plan.path(self._me) if plan.complete(row) and row not in held]
        return started + [(ids[row], plan.start(row)) for row in to_do]

    @property
    def bundle(self) -> list[str]:
        """Task ids in order of taking (b_i), those of incomplete groups included."""
        return [self._arrays.task_ids[row] for row in _bids(self._plan.records[self._me])]

    @property
    def digest(self) -> int:
        """See `Negotiator.digest`: of whose record is how new, of the bars, the roster and the tasks."""
        if self._digest is None:
            arrays = self._arrays
            bars = np.array(sorted(self._bars), np.int64).reshape(-1, 2)
            present = np.array([not self._absent(row) for row in range(arrays.num_agents)], np.bool_)
            self._digest = int(
                digest_of_stamps(
                    arrays.agent_hash, arrays.task_hash, self._voice.stamps, present, bars,
                    np.uint64(self._context),
                )
            )  # fmt: skip
        return self._digest

    def beliefs(self) -> dict[str, tuple[tuple[str, float], ...]]:
        """See `Negotiator.beliefs`; what is under way or done counts with the largest bid there is."""
        plan, ids = self._plan, self._arrays.agent_ids
        return {
            task_id: tuple((ids[row], plan.bid(row, task)) for row in plan.members(task))
            for task, task_id in enumerate(self._arrays.task_ids)
            if task not in self._closed
        } | {self._arrays.task_ids[task]: () for task in sorted(self._closed)}

    # --- local commands

    def add_task(self, task: Task) -> None:
        """See `Negotiator.add_task`."""
        old = self._arrays
        self._arrays = MissionArrays(replace(old.mission, tasks=(*old.mission.tasks, task)))
        rows = np.array([self._arrays.task_row[name] for name in old.task_ids], np.int32)
        plan = self._plan
        self._plan = JointPlan(self._arrays, self._me, plan.score, insertion=plan.insertion, team=plan.team)
        for row, record in enumerate(plan.records):
            self._plan.put(row, replace(record, tasks=rows[record.tasks]))
        self._closed = {int(rows[row]) for row in self._closed}
        self._started = [(int(rows[row]), start) for row, start in self._started]
        self._lift()
        self._plan.scan()

    def cancel_task(self, task_id: str) -> None:
        """See `Negotiator.cancel_task`."""
        row = self._row(task_id)
        self._closed.add(row)
        self._started = [(started, start) for started, start in self._started if started != row]
        mine = self._plan.records[self._me]
        self._publish(mine.only(mine.tasks != row, self._voice.stamp + 1))
        self._lift()

    def start_task(self, task_id: str, now: float) -> None:
        """See `Negotiator.start_task`."""
        row = self._row(task_id)
        task = self._arrays.tasks[row]
        self._started.append((row, now))
        self._hold(row, STARTED, now, self._place_at(task.position, now + task.duration))

    def finish_task(self, task_id: str, now: float) -> None:
        """See `Negotiator.finish_task`. The record keeps it, so that nobody takes the seat again."""
        row = self._row(task_id)
        if row not in dict(self._started):
            raise ValueError(f"task {task_id} was not started by {self.agent_id}; call start_task first")
        self._started = [(started, start) for started, start in self._started if started != row]
        self._hold(row, DONE, now, self._place_at(self._arrays.tasks[row].position, now))

    def set_position(self, position: Position, now: float) -> None:
        """See `Negotiator.set_position`."""
        mine = self._plan.records[self._me]
        self._restate(replace(mine, place=self._place_at(position, now)))

    def leave(self) -> None:
        """See `Negotiator.leave`. What has been started is finished, so it is not open to others."""
        mine = self._plan.records[self._me]
        held = mine.only(mine.states != BIDDING, self._voice.stamp + 1)
        done = replace(held, states=np.full(held.tasks.size, DONE, np.int8))
        for row in _bids(mine):
            self._events.append(TaskReleased(self._arrays.task_ids[row], None))
        self._plan.put(self._me, done)
        self._voice.stamps[self._me] = self._voice.stamp + 1
        self._voice.owed[self._me] = True
        self._leave()
        self._lift()
        self._plan.scan()

    # --- who has left, what is open

    def _open_what_is_left(self) -> None:
        for row in self._left:
            gone = self._gone(row)
            self._agreement.wait_for(row, not gone)
            if gone and row != self._me:
                record = self._plan.records[row]
                if record.tasks.size and (record.states != DONE).any():
                    self._plan.put(row, record.only(record.states == DONE))
        if self._context != self._context_now():
            self._lift()

    def _absent(self, row: int) -> bool:
        return row in self._left and (row == self._me or self._gone(row))

    def _newest(self, row: int) -> int:
        return max(super()._newest(row), int(self._voice.stamps[row]))

    def _lift(self) -> None:
        """The roster or the tasks have changed: every bar is lifted."""
        self._context = self._context_now()
        self._bars.clear()
        self._allow()

    def _context_now(self) -> int:
        arrays = self._arrays
        found = np.uint64(0)
        for row in range(arrays.num_agents):
            if not self._absent(row):
                found ^= arrays.agent_hash[row]
        for row in range(arrays.num_tasks):
            if row not in self._closed:
                found ^= arrays.task_hash[row]
        return int(found)

    def _place_at(self, position: Position, free_at: float) -> Place:
        """Where the agent is to be counted from; what was flown to it is spent."""
        mine, agent = self._plan.records[self._me], self._arrays.agents[self._me]
        here, metres = agent.position, agent.range
        if mine.place is not None:
            here, metres = mine.place[:3], mine.place[4]
        return (*position, free_at, metres - distance(here, position))

    def _hold(self, row: int, state: int, now: float, place: Place) -> None:
        """Put a task that is under way or done before the bundle."""
        mine = self._plan.records[self._me]
        start = now
        if state == DONE:
            start = float(mine.bids[mine.tasks == row][0])
        rest = mine.only(mine.tasks != row)
        self._restate(
            Record(
                stamp=mine.stamp,
                states=np.concatenate([[state], rest.states]).astype(np.int8),
                tasks=np.concatenate([[row], rest.tasks]).astype(np.int32),
                bids=np.concatenate([[start], rest.bids]),
                gains=np.concatenate([[0.0], rest.gains]),
                positions=np.concatenate([[0], rest.positions]).astype(np.int32),
                leads=np.concatenate([[-1], rest.leads]).astype(np.int32),
                place=place,
            )
        )

    def _restate(self, record: Record) -> None:
        """Say something of oneself that is no bid; the bundle follows at the next tick."""
        self._plan.put(self._me, replace(record, stamp=self._voice.stamp + 1))
        self._voice.stamps[self._me] = self._voice.stamp + 1
        self._voice.owed[self._me] = True
        self._digest = None
        self._change()


def _bids(record: Record) -> dict[int, float]:
    """Task rows of a bundle, in order of taking, with the bids."""
    wanted = record.states == BIDDING
    return dict(zip(record.tasks[wanted].tolist(), record.bids[wanted].tolist(), strict=True))
