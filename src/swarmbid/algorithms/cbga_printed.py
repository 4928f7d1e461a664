"""CBGA as printed: groups by merging matrices of bids, kept for reproduction (Hunt et al. 2014).

Solves, where it does: tasks that need several agents, equipment and prerequisites (ST-MR-TA with
cross-schedule dependencies). Use `cbga` for anything but a comparison: as printed, the algorithm ends in
a clean state in a fraction of missions only, and often does not end.

Algorithm 1 builds bundles, Algorithm 2 merges a neighbour's matrix; tasks with one seat follow CBBA's
decision table. The whole matrix is sent every period, as triples [agent, task, bid] and stamps. Where the
print leaves something open or contradicts the text, there are two readings:

| place | literal | charitable |
|---|---|---|
| eq. 4: e_j \\ {e_i} is not empty | a group is as many agents as there are seats | and covers the equipment |
| eq. 5: sum over prerequisites > 0 | one bid on any of them | all have complete groups |
| eq. 5: when the task starts | not said | after they are done |
| eq. 8: latest arrival | no arrival is sent: eq. 7 | arrivals are sent; service begins with the latest |
| Alg. 1, line 11: minimum over all agents | the zeros of those without a bid count | over the members |
| Alg. 1, line 17: y, which CBGA has not | the row's sum | the same |
| Alg. 1: equipment | not looked at | the group must still be completable |
| Alg. 1: a full task and a higher bid | takes the weakest one's place | the same |
| Alg. 2, line 8: k = m | news of m from m only | from anybody whose news is newer |
| Alg. 2, line 13: newer | even if i has m already | only if it has not |
| Alg. 2, lines 17 to 19 | the weakest goes | the weakest with the same equipment (eq. 9) |
| Alg. 2, line 24: s_ik = t | after all tasks, of the sender | and the newest of what it relays |
| a lost seat | that task goes | and every task taken after it, as in CBBA |
| eq. 10: infeasible until others assign | until another agent joins | the same |

Stamps are the originator's own counters, as everywhere here. Eq. 7 adds metres to seconds; the score
`distance_cost` has a weight for each. Bids are not warped by default (`warp`), for the print says
nothing of it; without it even single-seat tasks cycle. Ties go to the higher agent id, as the text says.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from swarmbid.algorithms._auction import STARTED_BID
from swarmbid.algorithms._beliefs import DONE_BID
from swarmbid.algorithms._conversation import Conversation, check_options
from swarmbid.algorithms._printed import PrintedState, translated, why_not
from swarmbid.algorithms._voice import Voice
from swarmbid.algorithms.cbba import DECISION_RULES, packed
from swarmbid.arrays import NO_AGENT, MissionArrays
from swarmbid.errors import Fault, InputError
from swarmbid.messages import Message, MessageError
from swarmbid.messages.assignments import Assignments
from swarmbid.model import Mission, Position, Task
from swarmbid.negotiator import Event, TaskOutbid, TaskReleased, TaskTaken
from swarmbid.scores import Score, make_score

READINGS = ("literal", "charitable")


class CBGAPrinted(Conversation[Voice]):
    """The consensus-based grouping algorithm aboard one agent, to the letter or in its spirit.

    Parameters
    ----------
    agent_id : which agent of the mission.
    mission : the mission, or its arrays (share them between agents of one process).
    score : see `swarmbid.scores.make_score`; the paper's is "distance_cost".
    insertion : "shift" or "append"; the score's own by default.
    reading : "literal" or "charitable", see above.
    warp : bids never rise along a bundle (Johnson et al. 2012).
    quitting : whether members leave a group that is not complete (eq. (10)).
    quit_after : s that they wait for it (δ).
    team_rewards : whether a group's task is valued by the whole group's bids (eq. (6)).
    release_late : whether tasks are given up that the wait for others has made too late; not in the paper.
    period : s between two messages. heartbeat : s between messages when all agree.
    incarnation : count it up whenever the agent starts again with nothing remembered.

    Examples
    --------
    >>> from swarmbid.model import Agent, Mission, Task
    >>> mission = Mission(
    ...     agents=(Agent(id="uav1", position=(0.0, 0.0, 0.0)), Agent(id="uav2", position=(9.0, 0.0, 0.0))),
    ...     tasks=(Task(id="lift", position=(3.0, 4.0, 0.0), reward=10.0, agents_required=2),),
    ... )
    >>> agent = CBGAPrinted("uav1", mission, "distance_cost")
    >>> messages = agent.tick(now=0.0)
    >>> agent.beliefs()
    {'lift': (('uav1', 5.0),)}
    """

    DECISIONS = packed(DECISION_RULES)

    @classmethod
    def unsupported(cls, mission: Mission) -> list[str]:
        """Seats are counted, and equipment has few names."""
        return why_not(mission)

    def __init__(
        self,
        agent_id: str,
        mission: Mission | MissionArrays,
        score: str | Score | None = None,
        *,
        insertion: str | None = None,
        reading: str = "charitable",
        warp: bool = False,
        quitting: bool = False,
        quit_after: float = 10.0,
        team_rewards: bool = False,
        release_late: bool = False,
        period: float = 1.0,
        heartbeat: float = 10.0,
        incarnation: int = 1,
    ) -> None:
        faults = []
        where = f"agent {agent_id}"
        if reading not in READINGS:
            faults.append(Fault(where, "reading", f"is {reading!r}", "Give 'literal' or 'charitable'."))
        if not quit_after > 0.0:
            faults.append(Fault(where, "quit_after", f"is {quit_after!r}", "Give more than 0 s."))
        found = make_score(score)
        if found.visit_function() is not None:
            mend = "Choose a score of `swarmbid list`."
            faults.append(
                Fault(where, "score", "is of your own, which the printed algorithm cannot use", mend)
            )
        arrays = check_options(
            agent_id, mission, insertion or found.insertion, insertions=("shift", "append"),
            period=period, heartbeat=heartbeat, faults=faults, incarnation=incarnation,
        )  # fmt: skip
        reasons = why_not(arrays.mission)
        if reasons:
            raise InputError([Fault(where, "mission", why, "Use cbga.") for why in reasons])
        voice = Voice(agent_id, incarnation=incarnation)
        super().__init__(agent_id, arrays, voice, period=period, heartbeat=heartbeat, idle_every=1)
        self.quit_after = quit_after if quitting else np.inf
        self.release_late = release_late
        self._state = PrintedState(
            arrays, self._me, found, insertion=insertion or found.insertion, warp=warp,
            charitable=reading == "charitable", teams=team_rewards,
        )  # fmt: skip
        self._under_way: list[int] = []
        self._now = 0.0

    # --- the conversation

    def _understand(self, message: Message) -> Message:
        if not isinstance(message, Assignments):
            raise MessageError("malformed", "is of another algorithm")
        return translated(message, self._arrays)

    def _absorb(self, sender: int, message: Message, now: float) -> None:
        assert isinstance(message, Assignments)
        state = self._state
        state.merge(self.DECISIONS, sender, message)
        state.refresh_digest()
        self._must_build = True

    def tick(self, now: float) -> list[Message]:
        """Weigh what was taken in, quit what does not fill, build, and say everything."""
        self._now = now
        return super().tick(now)

    def _decide(self, now: float) -> None:
        state = self._state
        if not (self._must_build or self._waits()):
            return
        before = dict(state.bundle)
        gone: dict[int, Event] = {}
        if state.moved:  # the whole path was counted from elsewhere
            state.moved = False
            for row in before:
                state.drop(row)
        self._lose(gone)
        state.times()
        if self.release_late:
            while (row := state.late()) != NO_AGENT:
                self._release_from(row, None, gone)
                state.times()
        self._quit(gone)
        while state.take(self._now):
            pass
        state.times()
        state.refresh_digest()
        self._must_build = False
        self._report(before, gone)

    def _lose(self, gone: dict[int, Event]) -> None:
        """Give up what others have taken, and what was built upon it (phase 2's end, in CBBA)."""
        state, ids = self._state, self._arrays.task_ids
        lost = [row for row in state.bundle if state.bids[row, self._me] == 0.0]
        for row in lost:
            bid = state.bundle.get(row)
            if bid is None:
                continue
            by = state.outbid_by(row, bid)
            if by != NO_AGENT:
                better = float(state.bids[row, by])
                gone[row] = TaskOutbid(ids[row], bid, self._arrays.agent_ids[by], better)
            # Tasks with one seat follow CBBA in either reading.
            if state.charitable or state.terms.seats[row] == 1:
                self._release_from(row, ids[row], gone)
            else:
                state.drop(row)

    def _release_from(self, first: int, because: str | None, gone: dict[int, Event]) -> None:
        """Give up a task of the bundle and all that were taken after it."""
        state, ids = self._state, self._arrays.task_ids
        rows = list(state.bundle)
        for row in rows[rows.index(first) :]:
            bid = state.bundle[row]
            by = state.outbid_by(row, bid) if state.bids[row, self._me] == 0.0 else NO_AGENT
            if by != NO_AGENT:
                better = float(state.bids[row, by])
                gone.setdefault(row, TaskOutbid(ids[row], bid, self._arrays.agent_ids[by], better))
            else:
                gone.setdefault(row, TaskReleased(ids[row], because if row != first else None))
            state.drop(row)

    def _waits(self) -> bool:
        """Whether it will quit a group unless others join."""
        state = self._state
        return bool(np.isfinite(self.quit_after)) and any(
            state.terms.seats[row] > 1 and not state.complete(row) for row in state.bundle
        )

    def _quit(self, gone: dict[int, Event]) -> None:
        """Leave groups that were not completed in time, and look at those left before (eq. (10))."""
        state = self._state
        for row, others in list(state.quit.items()):
            if state.others(row) - others:
                del state.quit[row]
            else:
                state.quit[row] = state.others(row)
        for row in list(state.bundle):
            if row not in state.bundle or state.terms.seats[row] == 1 or state.complete(row):
                continue
            if self._now - state.joined_at[row] > self.quit_after:
                state.quit[row] = state.others(row)
                if state.charitable:
                    self._release_from(row, self._arrays.task_ids[row], gone)
                else:
                    gone[row] = TaskReleased(self._arrays.task_ids[row], None)
                    state.drop(row)

    def _report(self, before: dict[int, float], gone: dict[int, Event]) -> None:
        """Turn the difference between the old and the new bundle into events."""
        state, ids = self._state, self._arrays.task_ids
        for row in before:
            if row not in state.bundle:
                self._events.append(gone.get(row) or TaskReleased(ids[row], None))
        for row, bid in state.bundle.items():
            if before.get(row) != bid or row in gone:
                place = state.path.index(row)
                self._events.append(TaskTaken(ids[row], bid, place, state.start_of(row)))

    def _news(self) -> bool:
        return self._state.untold()  # changed bids change the digest, and that is news already

    def _satisfied(self, now: float) -> bool:
        return not self._waits()

    def _say(self, now: float, *, heartbeat: bool) -> Message:
        state, arrays = self._state, self._arrays
        stamp, digest_at = self._voice.next_stamp(now, state.digest)
        state.heard[self._me] = stamp
        tasks, holders, bids, arrivals = state.columns()
        agreed, agreed_at = self._agreement.tell(state.digest, everything=True)
        return Assignments(
            sender=self.agent_id,
            sequence=stamp,
            agent_ids=arrays.agent_ids,
            task_ids=arrays.task_ids,
            heard=state.heard.copy(),
            tasks=tasks,
            holders=holders,
            bids=bids,
            arrivals=arrivals,
            digest=state.digest,
            digest_at=digest_at,
            agreed=agreed,
            agreed_at=agreed_at,
            left=np.array(list(self._left), np.int32),
            left_at=np.array(list(self._left.values()), np.int64),
            settled=self._agreed,
        )

    # --- what the driver may ask

    @property
    def path(self) -> list[tuple[str, float]]:
        """Started tasks first, then those of the path whose group is complete, for all that it knows."""
        state, ids = self._state, self._arrays.task_ids
        started = [(ids[row], state.served[row]) for row in self._under_way]
        return [*started, *((ids[row], start) for row, start in state.flown())]

    @property
    def bundle(self) -> list[str]:
        """Task ids in order of taking (b_i), with those whose group is not complete."""
        return [self._arrays.task_ids[row] for row in self._state.bundle]

    @property
    def intended(self) -> list[str]:
        """Task ids in order of visit (p_i), with those whose group is not complete."""
        return [self._arrays.task_ids[row] for row in self._state.path]

    @property
    def digest(self) -> int:
        """See `Negotiator.digest`; of the matrix of bids."""
        return self._state.digest

    def beliefs(self) -> dict[str, tuple[tuple[str, float], ...]]:
        """See `Negotiator.beliefs`: the rows of the matrix."""
        state, ids = self._state, self._arrays.agent_ids
        return {
            task_id: tuple((ids[m], float(state.bids[row, m])) for m in state.holders(row))
            for row, task_id in enumerate(self._arrays.task_ids)
        }

    def heard(self) -> dict[str, int]:
        """How new the news of each agent is (s_i); -1 if nothing was heard."""
        return dict(zip(self._arrays.agent_ids, self._state.heard.tolist(), strict=True))

    # --- local commands

    def add_task(self, task: Task) -> None:
        """See `Negotiator.add_task`."""
        old = self._arrays
        self._arrays = MissionArrays(replace(old.mission, tasks=(*old.mission.tasks, task)))
        self._state = self._state.moved_to(self._arrays)
        self._under_way = [self._arrays.task_row[old.task_ids[row]] for row in self._under_way]
        self._change()

    def cancel_task(self, task_id: str) -> None:
        """See `Negotiator.cancel_task`."""
        row, state = self._row(task_id), self._state
        state.closed[row] = True
        state.cancelled.add(row)
        held = row in state.bundle
        state.drop(row)
        state.bids[row] = 0.0
        self._under_way = [started for started in self._under_way if started != row]
        if held:
            self._events.append(TaskReleased(task_id, None))
        self._touched()

    def start_task(self, task_id: str, now: float) -> None:
        """See `Negotiator.start_task`."""
        row, state = self._row(task_id), self._state
        task = self._arrays.tasks[row]
        held = row in state.bundle
        state.drop(row)
        if state.terms.seats[row] == 1:
            state.bids[row] = 0.0
        state.bids[row, self._me] = STARTED_BID
        state.closed[row] = True
        state.served[row] = now
        state.move(task.position, now + task.duration)
        self._under_way.append(row)
        if not held:
            self._events.append(TaskTaken(task_id, STARTED_BID, 0, now))
        self._touched()

    def finish_task(self, task_id: str, now: float) -> None:
        """See `Negotiator.finish_task`. The bid stays, so that nobody does the task again."""
        row, state = self._row(task_id), self._state
        if row not in self._under_way:
            raise ValueError(f"task {task_id} was not started by {self.agent_id}; call start_task first")
        self._under_way.remove(row)
        state.move(self._arrays.tasks[row].position, now)
        state.bids[row, self._me] = DONE_BID
        self._touched()

    def set_position(self, position: Position, now: float) -> None:
        """See `Negotiator.set_position`."""
        self._state.move(position, now)
        self._change()

    def leave(self) -> None:
        """See `Negotiator.leave`. What has been started is finished, so it is not open to others."""
        state = self._state
        for row in list(state.bundle):
            state.drop(row)
            self._events.append(TaskReleased(self._arrays.task_ids[row], None))
        for row in self._under_way:
            state.bids[row, self._me] = DONE_BID
        self._touched()
        self._leave()

    def _open_what_is_left(self) -> None:
        for row in self._left:
            gone = self._gone(row)
            self._agreement.wait_for(row, not gone)
            if gone and row != self._me:
                self._state.open_all_of(row)
        self._touched()

    def _touched(self) -> None:
        """The matrix was changed by hand."""
        self._state.refresh_digest()
        self._change()

    def _newest(self, row: int) -> int:
        return max(super()._newest(row), int(self._state.heard[row]))
