"""Slow twin of coalition forming (CBGA), second half: what one agent plans, and what all come to.

See `naive_referee` for the first half, and for what both are allowed to share with swarmbid: nothing
but the mission's dataclasses and `Score.value`.
"""

from __future__ import annotations

import math
import random
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

from naive_referee import Barred, Entry, Key, Outcome, Records, Scene, State, ranked, referee
from swarmbid.model import Mission
from swarmbid.scores import Score

__all__ = ["Agreement", "Entry", "Outcome", "Rumour", "central", "negotiate", "plan", "referee"]


class Agreement(NamedTuple):
    """How a negotiation, or the central planner, ended.

    Parameters
    ----------
    quits : groups dissolved, in order, as (task id, members in order of id).
    barred : the pairs that these quits have barred.
    settled : whether it came to rest within the rounds given.
    """

    outcome: Outcome
    records: dict[str, list[Entry]]
    quits: list[tuple[str, tuple[str, ...]]]
    barred: Barred
    rounds: int
    settled: bool


class Bidder:
    """One agent's own part of a scan: what it has taken, and what it claims of what it might take.

    A claim never rises while others are accepted: it is the least of what was counted since the agent's
    own last entry, or since the stage began. Otherwise two entries could hold each other up for ever, for
    the first that joins a group may pay for a delay that is free for all who follow.

    Counting is put off: all tasks are counted at the agent's own entries and where a stage begins; later
    only the one that it is about to take, if others have been seated since that was counted.

    That the joint schedule has no room for a task at a position shows only when it is tried there; the
    agent remembers it until its path changes.
    """

    def __init__(self, scene: Scene, agent_id: str, team_rewards: bool) -> None:
        self.scene, self.agent_id, self.team_rewards = scene, agent_id, team_rewards
        self.bundle: list[Entry] = []
        self.claims: dict[str, tuple[float, int]] = {}  # task id -> (claim, position)
        self.counted: dict[str, int] = {}  # task id -> seats taken when it was counted
        self.refused: set[tuple[str, int]] = set()  # (task id, position)

    def key(self, entry: Entry) -> Key:
        """Rank that the entry would have as the agent's next."""
        return self.scene.key(self.agent_id, len(self.bundle), entry)

    def tried(self, state: State, entry: Entry, admitted: bool) -> None:
        """Learn what became of the candidate."""
        if admitted:
            self.bundle.append(entry)
            self.claims, self.counted, self.refused = {}, {}, set()
        else:
            self.refused.add((entry.task, entry.position))
            self.count(state, entry.task)

    def count(self, state: State, task_id: str) -> None:
        """Claim no more of a task than it gains the agent as things stand."""
        gain, position = state.best_insertion(self.agent_id, task_id, self.refused) or (-math.inf, -1)
        claim, _ = self.claims.get(task_id, (math.inf, -1))
        self.claims[task_id] = (min(claim, gain), position)
        self.counted[task_id] = state.seats_taken()

    def count_again(self, state: State, entry: Entry) -> bool:
        """Count the candidate, if others have been seated since; return whether they have."""
        if self.counted[entry.task] == state.seats_taken():
            return False
        self.count(state, entry.task)
        return True

    def candidate(self, state: State, stage: int) -> Entry | None:
        """What the agent would try next. To be asked whenever the state or `refused` has changed."""
        offers = []
        for task_id, task in self.scene.tasks.items():
            if self.scene.stage(task_id) != stage:
                continue
            if task_id not in self.claims:
                self.count(state, task_id)
            claim, position = self.claims[task_id]
            if claim <= 0.0 or state.is_full(task_id):
                continue
            entry = Entry(task_id, claim, claim, position)
            if self.team_rewards and task_id in state.groups:
                bid, founder = state.groups[task_id]
                entry = entry._replace(bid=bid, founder=founder)
            entry = self.warped(entry)
            if entry.bid > 0.0:
                offers.append((self.key(entry), -claim, task.start, task_id.encode(), entry))
        return min(offers)[-1] if offers else None

    def warped(self, entry: Entry) -> Entry:
        """The entry, lowered if need be until it ranks below the agent's last one of its stage.

        The more it claims the higher it ranks, lowered or not: or else a claim that falls could lift it
        above what has been accepted already. So who joins two groups of one founder with one bid, and
        gains more from the second, says so much less of its gain rather than leave the founder's rank.
        """
        if not self.bundle or self.scene.stage(self.bundle[-1].task) != self.scene.stage(entry.task):
            return entry
        last = self.bundle[-1]
        below = self.scene.key(self.agent_id, len(self.bundle) - 1, last)
        modest = entry._replace(gain=min(entry.gain, last.gain)) if entry.founder is not None else entry
        lowered = entry._replace(bid=min(entry.bid, last.bid), founder=None)
        lowest = lowered._replace(bid=math.nextafter(last.bid, -math.inf))
        return next(one for one in (entry, modest, lowered, lowest) if self.key(one) > below)


def plan(
    mission: Mission,
    score: Score,
    agent_id: str,
    records: Records,
    *,
    insertion: str = "shift",
    team_rewards: bool = False,
    barred: Barred = frozenset(),
    alive: frozenset[str] | None = None,
) -> list[Entry]:
    """The record that the agent makes of what it knows of the others' (its own is not looked at)."""
    scene = Scene(mission, score, insertion, barred, alive)
    state = State(scene)
    voided: set[str] = set()
    me = Bidder(scene, agent_id, team_rewards)
    coming = [item for item in ranked(scene, records) if item[1] != agent_id]
    last_stage = max((scene.stage(task_id) for task_id in scene.tasks), default=0)
    stage = 0
    while stage <= last_stage:
        mine = me.candidate(state, stage)
        if mine is not None and (not coming or me.key(mine) < coming[0][0]):
            if not me.count_again(state, mine):
                me.tried(state, mine, state.admit(agent_id, mine))
        elif coming and (mine is not None or scene.stage(coming[0][2].task) == stage):
            _, other, entry = coming.pop(0)
            if other in voided or not state.admit(other, entry):
                voided.add(other)
        else:
            stage += 1
    return me.bundle


def incomplete_groups(scene: Scene, outcome: Outcome, records: Records) -> list[str]:
    """Tasks whose group is not complete, the one to be dissolved first in front.

    Least filled first, then least gain of its members (summed in order of agent id), then smallest id.
    """

    def order(task_id: str) -> tuple[float, float, bytes]:
        task, crew = scene.tasks[task_id], outcome.members[task_id]
        if task.agents_required == 0:
            brought = frozenset[str]().union(*(scene.agents[m].equipment for m in crew)) & task.equipment
            filled = len(brought) / len(task.equipment)
        else:
            filled = len(crew) / task.agents_required
        gains = sum(entry.gain for m in crew for entry in records[m] if entry.task == task_id)
        return filled, gains, task_id.encode()

    return sorted((task for task in outcome.members if task not in outcome.complete), key=order)


def quitting_rounds(
    settle: Callable[[Barred], tuple[dict[str, list[Entry]], int, bool]],
    mission: Mission,
    score: Score,
    quitting: bool,
    dissolve: float,
    insertion: str,
    alive: frozenset[str] | None,
) -> Agreement:
    """Settle, dissolve the worst of the incomplete groups, settle again, until none is incomplete.

    `settle` returns the records that all come to under given bars, the rounds, and whether it came to rest.
    """
    barred: Barred = frozenset()
    quits: list[tuple[str, tuple[str, ...]]] = []
    rounds = 0
    while True:
        records, spent, settled = settle(barred)
        rounds += spent
        outcome = referee(mission, score, records, insertion=insertion, barred=barred, alive=alive)
        worst = incomplete_groups(Scene(mission, score, insertion, barred, alive), outcome, records)
        if not settled or not quitting or not worst:
            return Agreement(outcome, records, quits, barred, rounds, settled)
        for task_id in worst[: max(1, math.ceil(dissolve * len(worst)))]:
            crew = tuple(outcome.members[task_id])
            quits.append((task_id, crew))
            barred |= {(m, task_id) for m in crew}


@dataclass
class Rumour:
    """An unfair network: in a round an agent may sleep, and hears of each other agent now and then.

    Parameters
    ----------
    rng : where chance comes from. awake, heard : probabilities.
    """

    rng: random.Random
    awake: float = 0.5
    heard: float = 0.5


def negotiate(
    mission: Mission,
    score: Score,
    *,
    quitting: bool = True,
    dissolve: float = 0.0,
    team_rewards: bool = False,
    insertion: str = "shift",
    rounds: int = 400,
    alive: frozenset[str] | None = None,
    records: Records | None = None,
    rumour: Rumour | None = None,
) -> Agreement:
    """Everybody plans on what it knows of the others, again and again, until nothing changes.

    Parameters
    ----------
    dissolve : share of the incomplete groups that is dissolved at a time, at least one.
    rounds : most rounds between two quits.
    alive : who takes part; None for all.
    records : what was on the table before; nothing by default.
    rumour : who hears what when; None for all, each round, what the round before said.
    """
    there = [a.id for a in mission.agents if alive is None or a.id in alive]
    said: dict[str, list[Entry]] = {m: list((records or {}).get(m, [])) for m in there}
    known: dict[str, dict[str, list[Entry]]] = {m: dict(said) for m in there}

    def settle(barred: Barred) -> tuple[dict[str, list[Entry]], int, bool]:
        nonlocal said, known
        # A plan is a function of what is known: what has been planned on before need not be planned again.
        before: dict[str, dict[str, list[Entry]]] = {}
        for count in range(rounds):
            fair = rumour is None or count % 10 == 9  # all is heard in the end
            for m in there:
                for k in there:
                    if fair or (rumour is not None and rumour.rng.random() < rumour.heard):
                        known[m][k] = said[k]
            spoken = dict(said)
            for m in there:
                if not fair and rumour is not None and rumour.rng.random() >= rumour.awake:
                    continue
                others = {k: entries for k, entries in known[m].items() if k != m}
                if before.get(m) != others:
                    spoken[m] = plan(
                        mission,
                        score,
                        m,
                        others,
                        insertion=insertion,
                        team_rewards=team_rewards,
                        barred=barred,
                        alive=alive,
                    )
                    before[m] = others
            quiet = spoken == said
            said = spoken
            if fair and quiet:
                return said, count, True
        return said, rounds, False

    return quitting_rounds(settle, mission, score, quitting, dissolve, insertion, alive)


def central(
    mission: Mission,
    score: Score,
    *,
    quitting: bool = True,
    dissolve: float = 0.0,
    team_rewards: bool = False,
    insertion: str = "shift",
    alive: frozenset[str] | None = None,
) -> Agreement:
    """What one planner for all would do: of everybody's best candidates admit the best, again and again."""

    def settle(barred: Barred) -> tuple[dict[str, list[Entry]], int, bool]:
        scene = Scene(mission, score, insertion, barred, alive)
        state = State(scene)
        bidders = [Bidder(scene, agent_id, team_rewards) for agent_id in scene.agents]
        last: Key | None = None
        for stage in sorted({scene.stage(task_id) for task_id in scene.tasks}):
            while True:
                offers = []
                for one in bidders:
                    entry = one.candidate(state, stage)
                    if entry is not None:
                        offers.append((one.key(entry), one, entry))
                if not offers:
                    break
                key, one, entry = min(offers, key=lambda offer: offer[0])
                if one.count_again(state, entry):
                    continue
                if last is not None and key <= last:
                    raise AssertionError("an entry ranks above one accepted before it")
                admitted = state.admit(one.agent_id, entry)
                one.tried(state, entry, admitted)
                last = key if admitted else last
        return {one.agent_id: one.bundle for one in bidders}, 0, True

    return quitting_rounds(settle, mission, score, quitting, dissolve, insertion, alive)
