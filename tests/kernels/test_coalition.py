"""CBGA's kernel against the slow twin: what one agent makes of everybody's records, and undoing it.

Tasks, positions, founders, groups and starts must be the twin's exactly; bids to rounding, for the kernel
sums a path's values in another order.
"""

from __future__ import annotations

import math
import random
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from coalition_missions import FAMILIES, missions
from naive_coalition import Entry, central, incomplete_groups, negotiate, plan, referee
from naive_referee import Barred, Outcome, Scene
from same_exponential import share_exponential
from swarmbid.algorithms._joint_plan import FIRST_WIDTH, JointPlan, Record, empty_record
from swarmbid.algorithms._terms import make_terms
from swarmbid.arrays import NO_AGENT, MissionArrays
from swarmbid.kernels import coalition, insertion
from swarmbid.kernels.joint import Joint, clear, empty_joint
from swarmbid.kernels.ranks import (
    AGENT,
    BID,
    GAIN,
    JOINS,
    KEY_SLOTS,
    LEAD,
    PLACE,
    STAGE,
    rearrange,
    sort_entries,
)
from swarmbid.kernels.referee import admit, withdraw
from swarmbid.messages.records import BIDDING, DONE, STARTED
from swarmbid.model import Agent, Mission, Task
from swarmbid.scores import make_score

SCORES = [make_score(name) for name in ("time_discounted", "distance_cost", "time_window", "revisit")]
ROUNDING = 1e-12
"""Relative rounding allowed in bids."""

Records = dict[str, list[Entry]]


@pytest.fixture(autouse=True)
def one_exponential(monkeypatch: pytest.MonkeyPatch) -> None:
    share_exponential(monkeypatch)


def record_of(arrays: MissionArrays, entries: list[Entry]) -> Record:
    """The kernel's form of a record."""
    return Record(
        stamp=1,
        states=np.full(len(entries), BIDDING, np.int8),
        tasks=np.array([arrays.task_row[one.task] for one in entries], np.int32),
        bids=np.array([one.bid for one in entries], np.float64),
        gains=np.array([one.gain for one in entries], np.float64),
        positions=np.array([one.position for one in entries], np.int32),
        leads=np.array(
            [NO_AGENT if one.founder is None else arrays.agent_row[one.founder] for one in entries], np.int32
        ),
    )


def entries_of(arrays: MissionArrays, record: Record) -> list[Entry]:
    """The twin's form of a record."""
    columns = (record.tasks, record.bids, record.gains, record.positions, record.leads)
    return [
        Entry(
            arrays.task_ids[task], bid, gain, position, None if lead == NO_AGENT else arrays.agent_ids[lead]
        )
        for task, bid, gain, position, lead in zip(*(column.tolist() for column in columns), strict=True)
    ]


def nonsense(mission: Mission, rng: random.Random) -> Records:
    """What no agent would say: any tasks, bids, places and founders, many of them equal."""
    names = [agent.id for agent in mission.agents]
    records: Records = {}
    for name in names:
        records[name] = []
        for place, task in enumerate(rng.sample(mission.tasks, rng.randint(0, len(mission.tasks)))):
            bid = rng.choice([100.0, rng.uniform(1, 130)])
            founder = rng.choice([None, None, rng.choice(names)])
            records[name].append(
                Entry(task.id, bid, rng.choice([bid, bid + 5.0]), rng.randint(0, place), founder)
            )
    return records


def same_entries(found: list[Entry], wanted: list[Entry]) -> bool:
    """Whether bids and gains are equal to rounding and all else exactly."""
    return [(one.task, one.position, one.founder) for one in found] == [
        (one.task, one.position, one.founder) for one in wanted
    ] and np.allclose(
        [(one.bid, one.gain) for one in found],
        [(one.bid, one.gain) for one in wanted],
        rtol=ROUNDING,
        atol=ROUNDING,
    )


def outcome_of(arrays: MissionArrays, joint: JointPlan, there: list[str]) -> tuple[object, ...]:
    """Members, starts, paths and complete tasks, as the twin's referee tells them."""
    members = {
        name: [arrays.agent_ids[row] for row in joint.members(task)]
        for task, name in enumerate(arrays.task_ids)
        if joint.members(task)
    }
    return (
        members,
        {name: joint.start(arrays.task_row[name]) for name in members},
        {name: [arrays.task_ids[task] for task in joint.path(arrays.agent_row[name])] for name in there},
        {name for task, name in enumerate(arrays.task_ids) if joint.complete(task)},
    )


def told(outcome: Outcome) -> tuple[object, ...]:
    return outcome.members, outcome.start, outcome.paths, outcome.complete


class Case:
    """A mission with a score, a rule and switches, all by seed; and both sides' answers on it."""

    def __init__(self, family: str, seed: int, **sizes: tuple[int, int]) -> None:
        self.rng = rng = random.Random(f"{family} {seed}")
        self.mission = missions(seed, family, **sizes)
        self.arrays = MissionArrays(self.mission)
        self.names = [agent.id for agent in self.mission.agents]
        self.score = SCORES[seed // 2 % len(SCORES)]
        self.team = rng.random() < 0.5
        self.insertion = rng.choice(["shift", "shift", "append"])
        self.barred: Barred = frozenset()
        self.alive: frozenset[str] | None = None
        if rng.random() < 0.3:
            pairs = [(name, task.id) for name in self.names for task in self.mission.tasks]
            self.barred = frozenset(pair for pair in pairs if rng.random() < 0.15)
        if rng.random() < 0.3:
            self.alive = frozenset(rng.sample(self.names, len(self.names) - 1))

    @property
    def there(self) -> list[str]:
        return [name for name in self.names if self.alive is None or name in self.alive]

    def records(self) -> Records:
        """Nonsense, or what is on the table in the middle of a negotiation."""
        records = nonsense(self.mission, self.rng)
        if self.rng.random() < 0.5:
            return records
        before = records if self.rng.random() < 0.5 else None
        agreed = negotiate(
            self.mission, self.score, quitting=False, rounds=self.rng.randint(1, 3), records=before,
            team_rewards=self.team, insertion=self.insertion,
        )  # fmt: skip
        return agreed.records

    def joint(self, name: str | None) -> JointPlan:
        """The kernel's plan of one agent, or of one who only judges."""
        arrays = self.arrays
        row = NO_AGENT if name is None else arrays.agent_row[name]
        joint = JointPlan(arrays, row, self.score, insertion=self.insertion, team=self.team)
        present = np.array([one in self.there for one in arrays.agent_ids])
        bars = {(arrays.agent_row[agent], arrays.task_row[task]) for agent, task in self.barred}
        joint.allow(present, bars, set())
        return joint

    def hears(self, joint: JointPlan, records: Records) -> list[Entry]:
        """Let a plan take in all records; return its own bundle."""
        for name, entries in records.items():
            if self.arrays.agent_row[name] != joint.me:
                joint.put(self.arrays.agent_row[name], record_of(self.arrays, entries))
        joint.scan()
        return [] if joint.me == NO_AGENT else entries_of(self.arrays, joint.bundle(1))

    def switches(self) -> dict[str, object]:
        return {"insertion": self.insertion, "barred": self.barred, "alive": self.alive}


# --- (a) one scan


@pytest.mark.parametrize("family", FAMILIES)
def test_a_plan_made_of_any_records_is_the_twins(family: str, effort: int):
    """Its own bundle; who is in which group, when each starts, which are complete, which is the worst."""
    taken = 0
    for seed in range(40 * effort):
        case = Case(family, seed)
        records = case.records()
        for name in case.there:
            joint = case.joint(name)
            found = case.hears(joint, records)
            wanted = plan(case.mission, case.score, name, records, team_rewards=case.team, **case.switches())
            assert same_entries(found, wanted), (seed, name)
            taken += len(found)
            on_table = records | {name: found}
            outcome = referee(case.mission, case.score, on_table, **case.switches())
            assert outcome_of(case.arrays, joint, case.there) == told(outcome), (seed, name)
            scene = Scene(case.mission, case.score, case.insertion, case.barred, case.alive)
            worst = [case.arrays.task_ids[task] for task in joint.incomplete()]
            assert worst == incomplete_groups(scene, outcome, on_table), (seed, name)
    assert taken > 20


def test_a_seat_that_delays_a_prerequisite_lowers_what_comes_after_it():
    """On a line, at 1 m/s, 100 e^(-0.01 t) each: b does t1 at 10 m at 10 s, so t2, after it, starts at 10 s.

    Then b, 20 m on the other side, does t3 first, at 20 s, and t1 at 20 + 30 = 50 s. t2, where a waits all
    the time and nobody has a seat yet, starts at 50 s: a may claim 100 e^-0.5 for it, no longer 100 e^-0.1.
    """
    agents = tuple(
        Agent(id=name, position=(x, 0.0, 0.0)) for name, x in (("a", 50.0), ("b", 0.0), ("c", 0.0))
    )
    places = {"t0": (0.0, ()), "t1": (10.0, ()), "t2": (50.0, ("t1",)), "t3": (-20.0, ("t0",))}
    tasks = tuple(
        Task(id=name, position=(x, 0.0, 0.0), reward=100.0, discount=0.01, prerequisites=after)
        for name, (x, after) in places.items()
    )
    mission = Mission(agents=agents, tasks=tasks)
    arrays = MissionArrays(mission)
    score = make_score("time_discounted")
    early = [Entry("t1", 90.0, 90.0, 0)]
    for entries, start in ((early, 10.0), ([*early, Entry("t3", 95.0, 95.0, 0)], 50.0)):
        joint = JointPlan(arrays, 0, score, insertion="shift", team=False)
        joint.put(1, record_of(arrays, entries))
        joint.put(2, record_of(arrays, [Entry("t0", 99.0, 99.0, 0)]))
        joint.scan()
        first = entries_of(arrays, joint.bundle(1))[0]
        assert first.task == "t2"
        assert first.bid == pytest.approx(100.0 * math.exp(-0.01 * start), rel=1e-12)
        assert joint.start(arrays.task_row["t2"]) == start


@pytest.mark.parametrize("family", FAMILIES)
def test_who_only_judges_comes_to_the_twins_outcome(family: str, effort: int):
    for seed in range(100, 100 + 40 * effort):
        case = Case(family, seed)
        records = nonsense(case.mission, case.rng)
        joint = case.joint(None)
        case.hears(joint, records)
        outcome = referee(case.mission, case.score, records, **case.switches())
        assert outcome_of(case.arrays, joint, case.there) == told(outcome), seed


# --- (b) a scan after a scan


def state_of(joint: JointPlan) -> dict[str, object]:
    """All that is known of who is seated and when: what a fresh plan must come to, bit for bit."""
    inside: Joint = joint._joint
    seats = joint._terms.slot_at
    taken = [
        slot for task, begin in enumerate(seats[:-1]) for slot in range(begin, begin + inside.filled[task])
    ]
    open_to_all = inside.filled > 0
    names = ("filled", "missing", "first", "last", "visits", "metres", "voided")
    found: dict[str, object] = {name: getattr(inside, name).tolist() for name in names}
    found |= {name: getattr(inside, name)[taken].tolist() for name in ("holder", "before", "after")}
    found |= {name: getattr(inside, name)[open_to_all].tolist() for name in ("start", "lead", "lead_bid")}
    if joint.me != NO_AGENT:
        own = joint.bundle(1)
        found["bundle"] = [
            getattr(own, name).tolist() for name in ("states", "tasks", "bids", "gains", "positions", "leads")
        ]
    return found


def changed(record: Record, other: Record, rng: random.Random) -> Record:
    """Another's record, or the old one cut short, or the old one with the other's end."""
    cut = rng.randint(0, record.tasks.size)
    kind = rng.choice(["other", "other", "shorter", "end"])
    if kind == "other":
        return other
    names = ("states", "tasks", "bids", "gains", "positions", "leads")
    if kind == "shorter":
        return replace(record, **{name: getattr(record, name)[:cut] for name in names})
    new = ~np.isin(other.tasks, record.tasks[:cut])
    return replace(
        record,
        **{name: np.concatenate([getattr(record, name)[:cut], getattr(other, name)[new]]) for name in names},
    )


def begun(record: Record, rng: random.Random) -> Record:
    """The record with its first entries under way or done; their bids are then the times of their start."""
    count = rng.randint(0, min(2, record.tasks.size))
    states, bids = np.full(record.tasks.size, BIDDING, np.int8), record.bids.copy()
    for place in range(count):
        states[place] = rng.choice([STARTED, DONE])
        bids[place] = float(rng.randint(0, 30))
    return replace(record, states=states, bids=bids)


def sequence(
    case: Case, joint: JointPlan, steps: int
) -> Iterator[tuple[dict[int, Record], tuple[object, ...]]]:
    """Let things happen to a plan; after each step tell the records and what `allow` was given."""
    rng, arrays = case.rng, case.arrays
    said = {row: empty_record() for row in range(arrays.num_agents)}
    everybody = np.ones(arrays.num_agents, np.bool_)
    allowed: tuple[object, ...] = (everybody, set(), set())
    for step in range(steps):
        others = nonsense(case.mission, rng)
        for row in rng.sample(range(arrays.num_agents), rng.choice([1, 1, 1, 2])):
            other = record_of(arrays, others[arrays.agent_ids[row]])
            if row == joint.me:
                # Of its own record only what is under way, done, or where it is, is read.
                other = replace(other, **{name: getattr(other, name)[:0] for name in (
                    "states", "tasks", "bids", "gains", "positions", "leads")})  # fmt: skip
            said[row] = changed(said[row], other, rng)
            if rng.random() < 0.1:
                said[row] = begun(said[row], rng)
            if rng.random() < 0.05:
                place = (rng.uniform(0, 50), 0.0, 0.0, rng.uniform(0, 20), rng.choice([50.0, np.inf]))
                said[row] = replace(said[row], place=place)
            joint.put(row, said[row])
        if rng.random() < 0.1:
            pairs = [(row, task) for row in range(arrays.num_agents) for task in range(arrays.num_tasks)]
            present = everybody.copy()
            present[rng.randrange(arrays.num_agents)] = rng.random() < 0.5
            closed = {rng.randrange(arrays.num_tasks)} if rng.random() < 0.3 else set()
            allowed = (present, set(rng.sample(pairs, len(pairs) // 6)), closed)
            joint.allow(*allowed)
        if step % 3 == 2:
            said_twice = rng.choice(sorted(said))
            joint.put(said_twice, replace(said[said_twice], stamp=step))
        yield dict(said), allowed


def incremental(case: Case, name: str | None, steps: int) -> int:
    """Check a plan that has seen much against fresh ones; return how many scans did not begin anew."""
    joint, again = case.joint(name), 0
    joint.allow(np.ones(case.arrays.num_agents, np.bool_), set(), set())
    joint.scan()
    for said, allowed in sequence(case, joint, steps):
        again += not joint._again
        joint.scan()
        fresh = case.joint(name)
        for row, record in said.items():
            fresh.put(row, record)
        fresh.allow(*allowed)
        fresh.scan()
        assert state_of(joint) == state_of(fresh)
        assert not joint.stale
    return again


@pytest.mark.parametrize("family", FAMILIES)
@pytest.mark.parametrize("journal", [None, 3])
def test_what_came_before_leaves_no_trace(
    family: str, journal: int | None, effort: int, monkeypatch: pytest.MonkeyPatch
):
    """As long as the journal reaches back, and when three moved starts are all that it holds."""
    if journal is not None:
        whole = coalition.empty_log
        monkeypatch.setattr(coalition, "empty_log", lambda room, _: whole(room, journal))
    again = 0
    for seed in range(200, 200 + 30 * effort):
        case = Case(family, seed)
        again += incremental(case, None if seed % 5 == 0 else case.rng.choice(case.names), steps=12)
    assert again > 120 * effort  # of 360, the rest after a change of what is held, allowed or where


def test_records_longer_than_there_was_room_for():
    assert FIRST_WIDTH == 8
    for seed in range(8):
        case = Case("mixed", seed, tasks=(12, 14))
        joint = case.joint(case.names[0])
        records = {name: [] for name in case.names}
        case.hears(joint, records)
        long = [Entry(task.id, 100.0 - k, 100.0 - k, k) for k, task in enumerate(case.mission.tasks)]
        records[case.names[1]] = long
        case.hears(joint, records)
        records[case.names[1]] = long[:3]
        found = case.hears(joint, records)
        wanted = (
            plan(case.mission, case.score, case.names[0], records, team_rewards=case.team, **case.switches())
            if case.names[0] in case.there
            else []
        )
        assert same_entries(found, wanted)
        incremental(case, case.names[-1], steps=12)


def test_the_joint_schedule_holds_what_is_under_way(effort: int):
    """Whoever has begun keeps its seat: the rest of its records is judged from where it is, after that."""
    for seed in range(6 * effort):
        case = Case("L2", seed, tasks=(3, 5))
        arrays = case.arrays
        joint = case.joint(None)
        joint.allow(np.ones(arrays.num_agents, np.bool_), set(), set())
        task = arrays.task_ids[0]
        record = record_of(arrays, [Entry(task, 33.0, 0.0, 0)])
        joint.put(0, replace(record, states=np.array([STARTED], np.int8)))
        joint.put(1, replace(record, bids=np.array([31.0]), states=np.array([DONE], np.int8)))
        joint.scan()
        assert joint.members(0) == [0, 1]
        assert joint.complete(0)
        assert joint.start(0) == 33.0  # the later of the two
        assert joint.path(0) == joint.path(1) == []


# --- (c) rounds


@pytest.mark.parametrize("family", FAMILIES)
def test_rounds_end_where_a_central_planner_would(family: str, effort: int):
    """Everybody hears of everybody else, once a round, until nothing changes: one round for each entry."""
    for seed in range(300, 300 + 30 * effort):
        case = Case(family, seed)
        case.barred, case.alive = frozenset(), None
        plans = {name: case.joint(name) for name in case.names}
        records: Records = {name: [] for name in case.names}
        rounds = 0
        while True:
            heard = dict(records)
            records = {name: case.hears(joint, heard) for name, joint in plans.items()}
            if records == heard:
                break
            rounds += 1
            assert rounds <= 100, seed
        wanted = central(
            case.mission, case.score, quitting=False, team_rewards=case.team, insertion=case.insertion
        )
        assert all(same_entries(records[name], wanted.records[name]) for name in case.names), seed
        for joint in plans.values():
            assert outcome_of(case.arrays, joint, case.names) == told(wanted.outcome), seed
        assert rounds <= sum(len(bundle) for bundle in records.values()) + 1, seed


# --- (d) the order of entries


def keys(draw: st.DrawFn, count: int) -> np.ndarray:
    """Keys with few different numbers, so that many are equal in part."""
    few = st.integers(0, 2)
    out = np.zeros((count, KEY_SLOTS))
    for row in range(count):
        agent = draw(few)
        joins = draw(st.booleans())
        out[row, STAGE] = draw(st.integers(0, 1))
        out[row, BID] = draw(few)
        out[row, LEAD] = draw(few) if joins else agent
        out[row, JOINS] = joins
        out[row, GAIN] = draw(few)
        out[row, AGENT] = agent
        out[row, PLACE] = row  # no two entries of a table have one agent and one place
    return out


def rank(key: np.ndarray) -> tuple[float, ...]:
    """The key as it is described, for `sorted`."""
    gain = -key[GAIN] if key[JOINS] else 0.0
    return (key[STAGE], -key[BID], -key[LEAD], key[JOINS], gain, -key[AGENT], key[PLACE])


@given(data=st.data())
def test_entries_are_sorted_as_described(data: st.DataObject):
    table = keys(data.draw, data.draw(st.integers(0, 20)))
    count = len(table)
    refs = np.array(data.draw(st.permutations(range(count))), np.int64)
    wanted = sorted(refs.tolist(), key=lambda ref: rank(table[ref]))
    sort_entries(refs, count, table, np.zeros(count, np.int64))
    assert refs.tolist() == wanted


@given(data=st.data())
def test_entries_go_and_come_and_the_order_stays(data: st.DataObject):
    """The same as sorting what is there; and the first place that differs is told."""
    table = keys(data.draw, data.draw(st.integers(1, 20)))
    count = len(table)
    parts = data.draw(
        st.lists(st.sampled_from(["stays", "goes", "comes", "out"]), min_size=count, max_size=count)
    )
    old = sorted(
        (ref for ref in range(count) if parts[ref] in ("stays", "goes")), key=lambda ref: rank(table[ref])
    )
    coming = [ref for ref in range(count) if parts[ref] == "comes"]
    fresh = np.array(data.draw(st.permutations(coming)), np.int64)
    order = np.zeros(count, np.int64)
    order[: len(old)] = old
    # What is not in the order may be marked all the same: nobody asks.
    stale = np.array([part in ("goes", "out") for part in parts], np.bool_)
    total, first = rearrange(order, len(old), stale, fresh, fresh.size, table, np.zeros(count, np.int64))
    wanted = sorted([ref for ref in old if parts[ref] == "stays"] + coming, key=lambda ref: rank(table[ref]))
    assert order[:total].tolist() == wanted
    differs = [k for k in range(max(len(old), total)) if old[k : k + 1] != wanted[k : k + 1]]
    assert first == (differs[0] if differs else len(old))


# --- (e) a step and back


def everything(joint: Joint, seats: np.ndarray) -> list[list[float]]:
    """What has to be as before once a step is taken back; seats that nobody has may hold anything."""
    taken = [
        slot for task, begin in enumerate(seats[:-1]) for slot in range(begin, begin + joint.filled[task])
    ]
    whole = [joint.start, joint.filled, joint.missing, joint.first, joint.last, joint.visits, joint.metres]
    whole += [joint.waiting, joint.voided]
    return [part.tolist() for part in whole] + [
        part[taken].tolist() for part in (joint.holder, joint.before, joint.after)
    ]


@pytest.mark.parametrize("family", FAMILIES)
def test_a_step_taken_back_or_refused_leaves_all_as_it_was(family: str, effort: int):
    """Bit for bit: a number that is added and taken off again would not do."""
    steps = refused = moved = 0
    for seed in range(400, 400 + 60 * effort):
        case = Case(family, seed, tasks=(4, 10))
        arrays, rng = case.arrays, case.rng
        terms = make_terms(arrays, case.score)
        joint = empty_joint(arrays.num_agents, arrays.num_tasks, int(terms.slot_at[-1]))
        clear(terms, joint)
        history = []
        for _ in range(60):
            agent, task = rng.randrange(arrays.num_agents), rng.randrange(arrays.num_tasks)
            position = rng.randint(0, int(joint.visits[agent]))
            before, metres = everything(joint, terms.slot_at), float(joint.metres[agent])
            seat = admit(terms, joint, agent, task, position, insertion.SHIFT)
            if seat < 0:
                assert everything(joint, terms.slot_at) == before, seed
                refused += 1
                continue
            steps += 1
            changes = int(joint.sizes[0])
            moved += changes - 1
            history.append((before, task, metres, joint.touched[:changes].copy(), joint.old[:changes].copy()))
            if rng.random() < 0.3:  # the last few, last first
                for before, task, metres, touched, old in history[: -rng.randint(1, 3) - 1 : -1]:
                    withdraw(terms, joint, task, metres, touched, old, 0, touched.size)
                    assert everything(joint, terms.slot_at) == before, seed
                    history.pop()
    assert steps > 300
    assert refused > 100
    assert moved > 50
