"""Who said what, who lacks it, and what is said again: how acts travel.

Every agent numbers its own acts and keeps the newest of each task and role. `known` says of every
speaker up to which number all that is alive is known; a run of acts carries one speaker's from there on,
so whoever missed one run sees it at the next, says what it knows, and is told again. Copies that are
late, doubled or overtaken change nothing. What came from an agent whose neighbours include all of one's
own is not relayed.

Endings of tasks are no acts: they are passed on once by everybody who learns of them, and again, a few
at a time, to a neighbour whose hash of all endings stays different.
"""

from __future__ import annotations

import hashlib
from typing import Any

import numpy as np
from numpy.typing import NDArray

from swarmbid.algorithms._agreement import Agreement
from swarmbid.algorithms._voice import NO_ROWS, NO_STAMPS, Voice
from swarmbid.arrays import MissionArrays, StampArray
from swarmbid.messages import INCARNATION, Acts, MessageError
from swarmbid.messages.acts import Act, ActRun, Ending

Key = tuple[str, int]
"""Task and role: of each, a speaker's newest act counts."""
PATIENCE = 1.5
"""Periods after a word before a neighbour's ignorance of it means that it was lost."""
INSISTENCE = 2.0
"""Periods after which a word that needs an answer is said again: the answer may have been here by then."""
RETELL = 4.0
"""Periods after which it is told again who is known to agree, whatever else there is to say."""
REMINDERS = 32
"""Endings told again in one message: messages stay small however many tasks have ended."""
REMEMBERED = 4096
"""Tasks forgotten on command that are still known for ended, the newest ones."""


class Post(Voice):
    """Keeps everybody's live acts and makes messages of those that a neighbour may lack.

    Attributes
    ----------
    known : int64[num_agents], up to which number each speaker's acts are known.
    endings : of tasks that are over. ended_hash : of them all, whatever their order.
    """

    def __init__(self, agent_id: str, num_agents: int, me: int, *, incarnation: int, period: float) -> None:
        super().__init__(agent_id, incarnation=incarnation)
        self.me = me
        self.period = period
        self.known: StampArray = np.zeros(num_agents, np.int64)
        self.known[me] = incarnation * INCARNATION
        self.endings: dict[str, Ending] = {}
        self.ended_hash = 0
        self._live: list[dict[Key, Act]] = [{} for _ in range(num_agents)]
        self._told: StampArray = self.known.copy()
        self._surely_told: StampArray = self.known.copy()
        self._lately: dict[int, list[tuple[float, int]]] = {}
        self._told_at: NDArray[np.float64] = np.full(num_agents, -np.inf)
        self._heard: StampArray = np.zeros(num_agents, np.int64)
        self._near: NDArray[np.bool_] = np.zeros(num_agents, np.bool_)
        self._near_of: dict[int, NDArray[np.bool_]] = {}
        self._told_near = 0
        self._told_all_at = -np.inf
        self._asks = False
        self._fresh: dict[str, Ending] = {}
        self._ended_at = -np.inf
        self._remind = False
        self._reminded = 0
        self._forgotten: dict[str, None] = {}

    # --- what is known

    def live(self, owner: int) -> dict[Key, Act]:
        """The live acts of one speaker."""
        return self._live[owner]

    def put(self, performative: str, task: str, role: int, **content: Any) -> Act:
        """Say something in place of what was said before of the same task in the same role."""
        number = int(self.known[self.me]) + 1
        act = Act(number, performative, task, role, **content)
        self._keep(self.me, act)
        self.known[self.me] = number
        return act

    def unsay(self, task: str, role: int) -> None:
        """Let an own act go, which nobody needs any more."""
        self._live[self.me].pop((task, role), None)

    def end(self, ending: Ending, now: float) -> bool:
        """Note how a task ended, to be passed on; return whether that is news."""
        if ending.task in self._forgotten:
            return False
        old = self.endings.get(ending.task)
        if old is not None:
            if ending.rank <= old.rank:
                return False
            self.ended_hash ^= _hash(old)
        self.endings[ending.task] = self._fresh[ending.task] = ending
        self.ended_hash ^= _hash(ending)
        self._ended_at = now
        for acts in self._live:
            for role in (0, 1, 2):
                acts.pop((ending.task, role), None)
        return True

    def forget(self, task: str) -> None:
        """Remember of a task that is over only that it is."""
        self.ended_hash ^= _hash(self.endings.pop(task))
        self._fresh.pop(task, None)
        self._forgotten[task] = None
        if len(self._forgotten) > REMEMBERED:
            self._forgotten.pop(next(iter(self._forgotten)))

    def is_over(self, task: str) -> bool:
        """Whether a task has ended, be it forgotten."""
        return task in self.endings or task in self._forgotten

    def drop(self, owner: int) -> list[Act]:
        """Forget everything that a speaker has said; return what it was."""
        dropped = list(self._live[owner].values())
        self._live[owner].clear()
        return dropped

    def reincarnate(self, after: int) -> None:
        """Speak on as a new incarnation: all own acts are said again under new numbers."""
        super().reincarnate(after)
        base = self.stamp // INCARNATION * INCARNATION
        self.known[self.me] = self._told[self.me] = self._surely_told[self.me] = base
        self._lately.pop(self.me, None)
        for act in self.drop(self.me):
            fields = {name: getattr(act, name) for name in act.__struct_fields__[4:]}
            self.put(act.performative, act.task, act.role, **fields)

    def _keep(self, owner: int, act: Act) -> None:
        acts = self._live[owner]
        acts.pop((act.task, act.role), None)  # the newest stands last
        acts[act.task, act.role] = act

    def insist(self, number: int, now: float) -> None:
        """Say again what was said under `number`, and since, if that is a while ago."""
        if now - self._told_at[self.me] >= INSISTENCE * self.period:
            self._told[self.me] = min(int(self._told[self.me]), number - 1)

    # --- hearing

    def hear(
        self, sender: int, message: Acts, now: float
    ) -> tuple[dict[int, list[Act]], list[tuple[int, Act]]]:
        """Take in what a message tells.

        Returns
        -------
        What those had said whose former lives are over, by row; and the acts that are news, with rows.
        """
        self._near[sender] = True
        reborn = {row: self.drop(row) for row in self._lives(sender, message) if row != self.me}
        for row in reborn:
            newest = max(int(message.known[row]), message.sequence if row == sender else 0)
            base = newest // INCARNATION * INCARNATION
            self.known[row] = self._told[row] = self._surely_told[row] = base
            self._lately.pop(row, None)
        near = np.zeros(self._near.size, np.bool_)
        near[message.near] = True
        near[sender] = True
        news: list[tuple[int, Act]] = []
        self._near_of[sender] = near
        for run in message.runs:
            owner = run.owner
            mine = int(self.known[owner])
            if (
                owner == self.me
                or run.upto <= mine
                or run.upto // INCARNATION != max(mine, run.upto) // INCARNATION
            ):
                continue
            if run.after > mine:
                self._asks = True  # something before it was missed
                continue
            for act in run.acts:
                if act.number > mine and not self.is_over(act.task):
                    self._keep(owner, act)
                    news.append((owner, act))
            self._learn(sender, owner, run.upto, now)
        np.maximum(self._heard, message.known, out=self._heard)
        self._let_settle(now)
        lacking = message.known < self._surely_told
        if lacking.any():
            self._told[lacking] = np.minimum(self._told, np.maximum(message.known, self._base()))[lacking]
            self._surely_told[lacking] = self._told[lacking]
        if message.ended_hash != self.ended_hash and now - self._ended_at >= PATIENCE * self.period:
            self._remind = True
        return reborn, news

    def _lives(self, sender: int, message: Acts) -> list[int]:
        """Speakers of whom the message knows a newer life."""
        lives = message.known // INCARNATION
        lives[sender] = max(int(lives[sender]), message.sequence // INCARNATION)
        return np.flatnonzero(lives > self.known // INCARNATION).tolist()

    def _let_settle(self, now: float) -> None:
        """Whatever was told long enough ago has been heard by now, or was lost."""
        for owner, told in list(self._lately.items()):
            while told and now - told[0][0] >= PATIENCE * self.period:
                self._surely_told[owner] = max(int(self._surely_told[owner]), told.pop(0)[1])
            if not told:
                del self._lately[owner]

    def _base(self) -> StampArray:
        """The number before the first of each speaker's present life."""
        return self.known // INCARNATION * INCARNATION

    def _learn(self, sender: int, owner: int, upto: int, now: float) -> None:
        """Note newer acts, to be relayed unless all neighbours have them from the same sender."""
        others = self._near.copy()
        others[owner] = others[sender] = False
        others &= ~self._near_of[sender]
        if not others.any() and self._told[owner] >= self.known[owner]:
            self._told[owner] = upto
            self._lately.setdefault(owner, []).append((now, upto))
        self.known[owner] = upto

    # --- speaking

    def has_news(self, digest: int) -> bool:
        """Whether something is wanted or untold."""
        return (
            bool((self._told < self.known).any())
            or bool(self._fresh)
            or self._remind
            or self._asks
            or bool((self._heard > self.known).any())
            or super().has_news(digest)
        )

    def say(
        self,
        now: float,
        arrays: MissionArrays,
        agreement: Agreement,
        left: dict[int, int],
        *,
        digest: int,
        settled: bool,
        heartbeat: bool,
    ) -> Acts:
        """Return the next message: what some neighbour may lack, and how new one's own knowledge is.

        Parameters
        ----------
        left : rows of agents that are gone, with the last stamp that this covers.
        settled : whether all agree. heartbeat : whether it is time to tell who agrees anyway.
        """
        runs = []
        for owner in np.flatnonzero(self._told < self.known).tolist():
            after, upto = int(max(self._told[owner], self._base()[owner])), int(self.known[owner])
            acts: list[Act] = []
            for act in reversed(self._live[owner].values()):
                if act.number <= after:
                    break
                acts.append(act)
            runs.append(ActRun(owner, after, upto, tuple(reversed(acts))))
            self._told_at[owner] = now
            self._lately.setdefault(owner, []).append((now, upto))
        self._told[:] = np.maximum(self._told, self.known)
        ended = dict(self._fresh)
        if self._remind or self.full_for > 0:
            told = list(self.endings.values())
            for place in range(min(REMINDERS, len(told))):
                ending = told[-1 - (self._reminded + place) % len(told)]
                ended[ending.task] = ending
            self._reminded = (self._reminded + REMINDERS) % max(len(told), 1)
        self._fresh.clear()
        self._remind = self._asks = False
        self._heard[:] = self.known
        near = int(np.count_nonzero(self._near))
        everything = heartbeat or self.full_for > 0 or near != self._told_near or not (runs or ended)
        everything |= now - self._told_all_at >= RETELL * self.period
        if everything:
            self._told_all_at = now
        self._told_near = near
        stamp, digest_at = self.next_stamp(now, digest)
        holders, held_at = agreement.tell(digest, everything=everything)
        return Acts(
            sender=self.agent_id,
            sequence=stamp,
            agent_ids=arrays.agent_ids,
            runs=tuple(runs),
            known=self.known.copy(),
            near=np.flatnonzero(self._near).astype(np.int32),
            ended=tuple(ended.values()),
            ended_hash=self.ended_hash,
            digest=digest,
            digest_at=digest_at,
            agreed=holders,
            agreed_at=held_at,
            settled=settled,
            left=np.array(list(left), np.int32) if left else NO_ROWS,
            left_at=np.array(list(left.values()), np.int64) if left else NO_STAMPS,
        )


def translated(message: Acts, arrays: MissionArrays) -> Acts:
    """Return `message` in the rows of `arrays`; itself if it is in them already.

    Raises
    ------
    MessageError : it names an agent that is not known here.
    """
    if message.agent_ids == arrays.agent_ids:
        return message
    try:
        rows = np.array([arrays.agent_row[name] for name in message.agent_ids], np.int32)
    except KeyError as error:
        raise MessageError("unknown_id", f"{error.args[0]!r} is not known here") from None
    known = np.zeros(arrays.num_agents, np.int64)
    known[rows] = message.known
    return Acts(
        sender=message.sender,
        sequence=message.sequence,
        agent_ids=arrays.agent_ids,
        runs=tuple(ActRun(int(rows[run.owner]), run.after, run.upto, run.acts) for run in message.runs),
        known=known,
        near=rows[message.near],
        ended=message.ended,
        ended_hash=message.ended_hash,
        digest=message.digest,
        digest_at=message.digest_at,
        agreed=rows[message.agreed],
        agreed_at=message.agreed_at,
        settled=message.settled,
        left=rows[message.left],
        left_at=message.left_at,
    )


def _hash(ending: Ending) -> int:
    return stable_hash(f"{ending.task}\x1f{ending.rank}")


def stable_hash(text: str) -> int:
    """64 bits of a text, the same on every machine."""
    return int.from_bytes(hashlib.blake2b(text.encode(), digest_size=8).digest(), "little")
