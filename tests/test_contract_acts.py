"""Acts on the wire: nothing is lost, garbage is refused by name, and what is unknown is asked about once."""

from __future__ import annotations

import math

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmbid.algorithms.contract_net import ContractNet
from swarmbid.messages import INCARNATION, MAX_BYTES, MAX_STAMP, Acts, MessageError, decode, encode
from swarmbid.messages import acts as wire
from swarmbid.messages.acts import (
    AS_CONTRACTOR,
    AS_MANAGER,
    ASIDE,
    CFP,
    MAX_EPOCH,
    MAX_PATH,
    MAX_TEXT,
    NOT_UNDERSTOOD,
    PERFORMATIVES,
    PROPOSE,
    Act,
    ActRun,
    Ending,
    specification,
)
from swarmbid.model import Agent, Mission, Task
from swarmbid.negotiator import MessageDropped, Said

AGENTS = ("a", "b", "c")
NO_ROWS = np.zeros(0, np.int32)
NO_STAMPS = np.zeros(0, np.int64)
BASE = INCARNATION
AT = (0.0, 0.0, 0.0)


def message(*runs: ActRun, **changes) -> Acts:
    fields = {
        "sender": "b",
        "sequence": BASE + 9,
        "agent_ids": AGENTS,
        "runs": runs,
        "known": np.full(3, BASE, np.int64),
        "near": np.array([0, 2], np.int32),
        "ended": (),
        "ended_hash": 0,
        "digest": 2**64 - 1,
        "digest_at": BASE + 9,
        "agreed": NO_ROWS,
        "agreed_at": NO_STAMPS,
        "settled": False,
        "left": NO_ROWS,
        "left_at": NO_STAMPS,
    }
    return Acts(**{**fields, **changes})


def run(*said: Act, owner: int = 1, after: int = BASE, upto: int | None = None) -> ActRun:
    last = said[-1].number if said else after + 1
    return ActRun(owner, after, last if upto is None else upto, said)


def told(one: Acts) -> tuple:
    """Everything that a message says, by id."""

    def names(rows) -> list[str]:
        return [one.agent_ids[row] for row in rows.tolist()]

    runs = [(one.agent_ids[run.owner], run.after, run.upto, run.acts) for run in one.runs]
    known = dict(zip(one.agent_ids, one.known.tolist(), strict=True))
    return (
        one.sender, one.sequence, runs, known, names(one.near), one.ended, one.ended_hash, one.digest,
        one.digest_at, names(one.agreed), one.agreed_at.tolist(), one.settled, names(one.left),
        one.left_at.tolist(),
    )  # fmt: skip


ids = st.from_regex(r"[A-Za-z0-9_][A-Za-z0-9._-]{0,9}", fullmatch=True)
numbers = st.floats(-1e9, 1e9)
amounts = st.floats(0.0, 1e9)
epochs = st.integers(0, MAX_EPOCH)
tasks = st.builds(
    Task,
    id=ids,
    position=st.tuples(numbers, numbers, numbers),
    type=st.just("look"),
    reward=st.floats(1.0, 9.0),
    start=st.floats(0.0, 5.0),
    end=st.sampled_from([7.0, math.inf]),
    duration=st.floats(0.0, 5.0),
    equipment=st.frozensets(st.sampled_from(["camera", "radar"])),
    revisit_at=st.none() | st.floats(0.0, 9.0),
)


@st.composite
def said(draw) -> Act:
    path = tuple(draw(st.lists(st.tuples(ids, numbers), max_size=3)))
    task = draw(tasks)
    return Act(
        number=1, performative=draw(st.sampled_from(PERFORMATIVES) | st.text(max_size=20)), task=task.id,
        role=draw(st.integers(0, 2)), to=draw(st.just("") | ids), manager=draw(st.just("") | ids),
        epoch=draw(epochs), asked=draw(epochs), reply_to=draw(st.integers(0, MAX_STAMP)), bid=draw(amounts),
        at=draw(numbers), reason=draw(st.text(max_size=20)), idle=draw(st.booleans()), path=path,
        place=draw(st.integers(0, len(path))), worth=draw(numbers),
        specification=draw(st.none() | st.just(specification(task))),
    )  # fmt: skip


@st.composite
def messages(draw) -> Acts:
    runs = []
    for owner in draw(st.lists(st.integers(0, 2), unique=True)):
        base = draw(st.integers(1, 5)) * INCARNATION
        number = after = base + draw(st.integers(0, 99))
        listed = []
        for act in draw(st.lists(said(), max_size=3)):
            number += draw(st.integers(1, 5))
            listed.append(msgspec.structs.replace(act, number=number))
        runs.append(ActRun(owner, after, number + draw(st.integers(1, 5)), tuple(listed)))
    ended = st.builds(
        Ending, task=ids, state=st.sampled_from(wire.ENDINGS), agent=st.just("") | ids,
        reason=st.text(max_size=20), epoch=epochs, bid=amounts,
    )  # fmt: skip
    stamps = st.integers(0, MAX_STAMP)
    rows = draw(st.lists(st.integers(0, 2), unique=True))
    sequence = draw(st.integers(1, MAX_STAMP))
    return message(
        *runs,
        sequence=sequence,
        digest_at=draw(st.integers(0, sequence)),
        known=np.array(draw(st.lists(stamps, min_size=3, max_size=3)), np.int64),
        ended=tuple(draw(st.lists(ended, max_size=2))),
        ended_hash=draw(st.integers(0, 2**64 - 1)),
        agreed=np.array(rows, np.int32),
        agreed_at=np.array([draw(stamps) for _ in rows], np.int64),
        settled=draw(st.booleans()),
        left=np.array(rows[:1], np.int32),
        left_at=np.array([draw(stamps) for _ in rows[:1]], np.int64),
    )


@given(messages())
def test_what_is_told_arrives(one):
    again = decode(encode(one))
    assert isinstance(again, Acts)
    assert told(again) == told(one)
    assert encode(again) == encode(one)


@given(tasks)
def test_a_task_that_others_do_not_know_arrives_as_it_is(task):
    assert specification(task).task(task.id) == task


@given(st.binary(max_size=200))
def test_noise_is_refused_and_nothing_else(data):
    with pytest.raises(MessageError):
        decode(data)


@given(messages(), st.integers(0, 10**6), st.integers(0, 255))
def test_a_message_with_a_broken_byte_is_refused_or_is_one(one, place, value):
    data = bytearray(encode(one))
    data[place % len(data)] = value
    try:
        again = decode(bytes(data))
    except MessageError:
        return
    assert decode(encode(again)).sequence == again.sequence  # whatever is let in can be told on


@given(messages(), st.integers(0, 10**6))
def test_a_message_cut_off_is_refused(one, place):
    data = encode(one)
    with pytest.raises(MessageError):
        decode(data[: place % len(data)])


def act(**changes) -> Act:
    fields = {"number": BASE + 1, "performative": PROPOSE, "task": "t", "role": AS_CONTRACTOR}
    return Act(**{**fields, **changes})


BAD_ACTS = {
    "task no id": ("id", {"task": "no id"}),
    "no task": ("id", {"task": ""}),
    "receiver no id": ("id", {"to": "-x"}),
    "manager no id": ("id", {"manager": "a/b"}),
    "path no id": ("id", {"path": (("?", 1.0),)}),
    "no such role": ("malformed", {"role": 3}),
    "role below": ("malformed", {"role": -1}),
    "reply below": ("stamp", {"reply_to": -1}),
    "reply above": ("stamp", {"reply_to": MAX_STAMP + 1}),
    "epoch below": ("stamp", {"epoch": -1}),
    "epoch above": ("stamp", {"epoch": MAX_EPOCH + 1}),
    "asked above": ("stamp", {"asked": MAX_EPOCH + 1}),
    "bid below": ("bid", {"bid": -0.5}),
    "bid nan": ("bid", {"bid": math.nan}),
    "bid infinite": ("bid", {"bid": math.inf}),
    "time nan": ("malformed", {"at": math.nan}),
    "time of path": ("malformed", {"path": (("u", math.inf),)}),
    "worth infinite": ("malformed", {"worth": -math.inf}),
    "place outside": ("malformed", {"place": 1}),
    "place below": ("malformed", {"place": -1}),
    "long reason": ("oversize", {"reason": "x" * (MAX_TEXT + 1)}),
    "long performative": ("oversize", {"performative": "x" * (MAX_TEXT + 1)}),
    "long path": ("oversize", {"path": (("u", 1.0),) * (MAX_PATH + 1)}),
    "task that cannot be": (
        "malformed",
        {"specification": wire.Specification("look", AT, -1.0, 0.0, 9.0, 0.0, 0.0)},
    ),
}


@pytest.mark.parametrize("case", BAD_ACTS)
def test_what_nobody_can_have_said_is_refused_by_name(case):
    reason, changes = BAD_ACTS[case]
    with pytest.raises(MessageError) as caught:
        decode(encode(message(run(act(**changes)))))
    assert caught.value.reason == reason


def test_what_is_just_within_the_bounds_is_taken_in():
    one = act(
        performative="x" * MAX_TEXT, reason="y" * MAX_TEXT, epoch=MAX_EPOCH, asked=MAX_EPOCH,
        reply_to=MAX_STAMP, path=(("u", 1.0),) * MAX_PATH, place=MAX_PATH,
    )  # fmt: skip
    assert decode(encode(message(run(one)))).runs[0].acts == (one,)


BAD_MESSAGES = {
    "two runs of one": ("malformed", lambda: message(run(act()), run(act()))),
    "run of nobody": ("malformed", lambda: message(run(act(), owner=3))),
    "out of order": ("stamp", lambda: message(run(act(number=BASE + 2), act(number=BASE + 1)))),
    "twice": ("stamp", lambda: message(run(act(), act()))),
    "before its run": ("stamp", lambda: message(run(act(), after=BASE + 1, upto=BASE + 2))),
    "after its run": ("stamp", lambda: message(run(act(number=BASE + 3), upto=BASE + 2))),
    "run backwards": ("stamp", lambda: message(run(after=BASE + 3, upto=BASE + 2))),
    "two lives": ("stamp", lambda: message(run(after=BASE, upto=2 * BASE + 1))),
    "ended in no way": ("malformed", lambda: message(ended=(Ending("t", "lost"),))),
    "ended for nan": ("bid", lambda: message(ended=(Ending("t", "done", "a", bid=math.nan),))),
    "ended by no id": ("id", lambda: message(ended=(Ending("t", "done", "a b"),))),
    "long reason": ("malformed", lambda: message(ended=(Ending("t", "failed", "", "x" * (MAX_TEXT + 1)),))),
    "hash": ("malformed", lambda: message(ended_hash=-1)),
    "sender": ("id", lambda: message(sender="no id")),
    "sequence": ("stamp", lambda: message(sequence=0, digest_at=0)),
    "agreed in two lengths": ("malformed", lambda: message(agreed=np.array([1], np.int32))),
    "left in two lengths": ("malformed", lambda: message(left_at=np.array([5], np.int64))),
}


@pytest.mark.parametrize("case", BAD_MESSAGES)
def test_a_message_that_cannot_be_is_refused_by_name(case):
    reason, make = BAD_MESSAGES[case]
    with pytest.raises(MessageError) as caught:
        decode(encode(make()))
    assert caught.value.reason == reason


def test_a_flood_is_refused():
    with pytest.raises(MessageError) as caught:
        decode(encode(message(ended=tuple(Ending(f"t{n}", "done") for n in range(wire.MAX_ACTS + 1)))))
    assert caught.value.reason == "oversize"
    with pytest.raises(MessageError) as caught:
        decode(bytes(MAX_BYTES + 1))
    assert caught.value.reason == "oversize"


def test_another_version_is_refused():
    fields = msgspec.msgpack.decode(encode(message()))
    fields[1] += 1
    with pytest.raises(MessageError) as caught:
        decode(msgspec.msgpack.encode(fields))
    assert caught.value.reason == "version"


# --- what an agent does about them

MISSION = Mission(
    agents=tuple(Agent(id=name, position=AT) for name in AGENTS),
    tasks=(Task(id="t", position=(3.0, 4.0, 0.0), reward=9.0),),
)


def replies(agent: ContractNet) -> list[Said]:
    return [
        event for event in agent.events() if isinstance(event, Said) and event.performative == NOT_UNDERSTOOD
    ]


def odd(number: int, performative: str = "ponder") -> Act:
    return act(number=BASE + number, performative=performative, role=AS_MANAGER, manager="b", to="")


def heard(agent: ContractNet, *listed: Act, sequence: int, after: int = 0) -> None:
    one = message(run(*listed, after=BASE + after), sequence=BASE + sequence, digest_at=BASE + sequence)
    agent.receive(decode(encode(one)), 0.0)
    for now in (0.0, 30.0):
        agent.tick(now)


def test_what_is_not_understood_is_answered_once():
    """FIPA SC00029H: not-understood, with what it answers."""
    agent = ContractNet("a", MISSION)
    heard(agent, odd(1), sequence=1)
    (reply,) = replies(agent)
    assert (reply.task, reply.to, reply.detail) == ("t", "b", "ponder")
    heard(agent, odd(1), sequence=2)  # again: it is answered already
    heard(agent, odd(1), sequence=1)  # late: the message is old
    assert replies(agent) == []
    heard(agent, odd(2, "muse"), sequence=3, after=1)
    (reply,) = replies(agent)
    assert reply.detail == "muse"


def test_not_understood_is_never_answered_by_itself():
    agent = ContractNet("a", MISSION)
    puzzled = act(performative=NOT_UNDERSTOOD, role=ASIDE, to="a", manager="a", reply_to=1, reason="cfp")
    heard(agent, puzzled, sequence=1)
    assert replies(agent) == []


def test_two_agents_do_not_puzzle_each_other_for_ever():
    agents = {name: ContractNet(name, MISSION) for name in AGENTS}
    heard(agents["a"], odd(1), sequence=1)
    said = len(replies(agents["a"]))
    for step in range(40):
        for name, agent in agents.items():
            for one in agent.tick(float(step)):
                for other in AGENTS:
                    if other != name:
                        agents[other].receive(decode(encode(one)), float(step))
    said += sum(len(replies(agent)) for agent in agents.values())
    assert said <= len(AGENTS)  # once by each that heard of it


@given(messages())
def test_nothing_that_can_be_decoded_raises_in_an_agent(one):
    agent = ContractNet("a", MISSION)
    agent.receive(decode(encode(one)), 0.0)
    agent.tick(0.0)
    agent.tick(30.0)
    assert agent.digest == agent.digest
    assert all(math.isfinite(start) for _, start in agent.path)


def test_an_act_that_names_strangers_changes_nothing():
    agent = ContractNet("a", MISSION)
    before = agent.digest
    for stranger in (act(to="x"), act(manager="x"), act(task="c")):
        agent.receive(decode(encode(message(run(stranger)))), 0.0)
    drops = [event for event in agent.events() if isinstance(event, MessageDropped)]
    assert [event.reason for event in drops] == ["unknown_id", "unknown_id", "malformed"]
    assert agent.digest == before


def test_a_call_teaches_a_task_that_was_not_known():
    agent = ContractNet("a", MISSION)
    task = Task(id="new", position=(1.0, 1.0, 0.0), reward=50.0)
    call = act(
        performative=CFP, task="new", role=AS_MANAGER, manager="b", epoch=1, asked=1, at=20.0,
        specification=specification(task),
    )  # fmt: skip
    agent.receive(decode(encode(message(run(call)))), 0.0)
    agent.tick(0.0)
    answers = [event for event in agent.events() if isinstance(event, Said) and event.task == "new"]
    assert [(event.performative, event.to) for event in answers] == [(PROPOSE, "b")]
