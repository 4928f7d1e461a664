"""What the UAVs of a search tell each other: bytes, refusals, and that any order of hearing will do."""

from __future__ import annotations

import contextlib
import math
from dataclasses import fields

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmbid.messages import MAX_STAMP, VERSION, MessageError, Survey, decode, encode
from swarmbid.messages.survey import MODES, Contact, Status
from swarmbid.missions._contacts import Contacts

NUMBER = st.floats(allow_nan=False, allow_infinity=False)
ID = st.sampled_from(["uav01", "uav02", "a", "b-3"])
STAMP = st.integers(0, MAX_STAMP)
STATUS = st.builds(Status, ID, NUMBER, st.sampled_from(MODES), NUMBER, NUMBER)
CONTACT = st.builds(
    Contact,
    st.sampled_from(["a-t1", "a-t2", "b-t1"]),
    ID,
    NUMBER,
    st.booleans(),
    *[NUMBER] * 6,
    st.booleans(),
)


@st.composite
def surveys(draw):
    agents = tuple(draw(st.lists(ID, max_size=3, unique=True)))
    counts = draw(st.lists(st.integers(0, 4), min_size=len(agents), max_size=len(agents)))
    column = st.lists(STAMP, min_size=len(agents), max_size=len(agents))
    known_agents = tuple(draw(st.lists(ID, max_size=4, unique=True)))
    glimpses = draw(st.lists(NUMBER, min_size=3 * sum(counts), max_size=3 * sum(counts)))
    return Survey(
        sender=draw(ID),
        sequence=draw(st.integers(1, MAX_STAMP)),
        statuses=tuple(draw(st.lists(STATUS, max_size=3))),
        contacts=tuple(draw(st.lists(CONTACT, max_size=3))),
        agents=agents,
        first=np.array(draw(column), np.int64),
        counts=np.array(counts, np.int64),
        floors=np.array(draw(column), np.int64),
        glimpses=np.array(glimpses, np.float64).reshape(3, sum(counts)),
        known_agents=known_agents,
        known=np.array(
            draw(st.lists(STAMP, min_size=len(known_agents), max_size=len(known_agents))), np.int64
        ),
    )


def same(a: Survey, b: Survey) -> bool:
    def equal(x, y):
        if isinstance(x, np.ndarray):
            return x.dtype == y.dtype and x.shape == y.shape and np.array_equal(x, y)
        return x == y

    return all(equal(getattr(a, one.name), getattr(b, one.name)) for one in fields(Survey))


def example(**changes) -> list:
    """The fields on the wire of a survey with one of everything."""
    wire = {
        "kind": "survey", "version": VERSION, "sender": "a", "sequence": 1,
        "statuses": [["a", 1.0, "search", 2.0, 3.0]],
        "contacts": [["a-t1", "a", 1.0, False, 2.0, 3.0, 4.0, 0.0, 0.0, 5.0, False]],
        "agents": "a\nb", "first": [0, 7], "counts": [1, 1], "floors": [0, 7],
        "glimpses": np.arange(6, dtype="<f8").tobytes(), "known_agents": "a\nb", "known": [1, 8],
    }  # fmt: skip
    return list((wire | changes).values())


def bytes_of(**changes) -> bytes:
    return msgspec.msgpack.encode(example(**changes))


@given(surveys())
def test_what_is_encoded_is_decoded(survey: Survey):
    heard = decode(encode(survey))
    assert isinstance(heard, Survey) and same(heard, survey)
    assert encode(heard) == encode(survey)
    assert (
        survey.full
        and survey.entries == len(survey.statuses) + len(survey.contacts) + survey.glimpses.shape[1]
    )


def test_glimpses_stay_run_after_run():
    heard = decode(bytes_of())
    assert heard.agents == ("a", "b") and heard.glimpses.tolist() == [[0.0, 1.0], [2.0, 3.0], [4.0, 5.0]]
    assert heard.statuses == (Status("a", 1.0, "search", 2.0, 3.0),)
    assert heard.contacts[0].sigma == 5.0 and heard.known.tolist() == [1, 8]


def test_a_contact_without_the_last_field_is_not_over():
    """New fields are appended, with defaults."""
    contact = ["a-t1", "a", 1.0, False, 2.0, 3.0, 4.0, 0.0, 0.0, 5.0]
    assert decode(bytes_of(contacts=[contact])).contacts[0].over is False


STATUS_OF = ["a", 1.0, "search", 2.0, 3.0]
CONTACT_OF = ["a-t1", "a", 1.0, False, 2.0, 3.0, 4.0, 0.0, 0.0, 5.0, False]


def put(values: list, place: int, value: object) -> list:
    return [*values[:place], value, *values[place + 1 :]]


@pytest.mark.parametrize(
    ("reason", "changes"),
    [
        ("version", {"version": VERSION + 1}),
        ("id", {"sender": ""}),
        ("id", {"sender": "a b"}),
        ("stamp", {"sequence": 0}),
        ("stamp", {"sequence": -3}),
        ("stamp", {"sequence": MAX_STAMP + 1}),
        ("malformed", {"statuses": [put(STATUS_OF, 2, "asleep")]}),
        ("malformed", {"statuses": [put(STATUS_OF, 0, "a\nb")]}),
        ("malformed", {"statuses": [put(STATUS_OF, 1, math.nan)]}),
        ("malformed", {"statuses": [put(STATUS_OF, 3, math.inf)]}),
        ("malformed", {"statuses": [["a", 1.0]]}),
        ("id", {"contacts": [put(CONTACT_OF, 0, "")]}),
        ("id", {"contacts": [put(CONTACT_OF, 1, "x y")]}),
        *[("malformed", {"contacts": [put(CONTACT_OF, place, math.nan)]}) for place in (2, 4, 5, 6, 7, 8, 9)],
        ("malformed", {"contacts": [put(CONTACT_OF, 3, "yes")]}),
        ("malformed", {"first": [0]}),
        ("malformed", {"counts": [1, 1, 0]}),
        ("malformed", {"floors": []}),
        ("malformed", {"known": [1]}),
        ("malformed", {"first": [-1, 0]}),
        ("malformed", {"counts": [3, -1]}),
        ("malformed", {"floors": [0, MAX_STAMP + 1]}),
        ("malformed", {"known": [0, 2**64 - 1]}),
        ("malformed", {"counts": [MAX_STAMP, MAX_STAMP]}),
        ("malformed", {"glimpses": b""}),
        ("malformed", {"glimpses": bytes(47)}),
        ("malformed", {"glimpses": np.full(6, math.nan).tobytes()}),
        ("malformed", {"glimpses": np.full(6, -math.inf).tobytes()}),
        ("oversize", {"statuses": [STATUS_OF] * ((1 << 14) + 1)}),
        ("oversize", {"contacts": [CONTACT_OF] * ((1 << 14) + 1)}),
    ],
)  # fmt: skip
def test_what_cannot_be_is_refused_with_its_reason(reason, changes):
    with pytest.raises(MessageError) as caught:
        decode(bytes_of(**changes))
    assert caught.value.reason == reason


@given(st.data())
def test_garbage_raises_nothing_but_a_message_error(data):
    """Bytes changed, cut off or put in anywhere."""
    good = bytearray(bytes_of())
    for _ in range(data.draw(st.integers(1, 4))):
        place = data.draw(st.integers(0, max(len(good) - 1, 0)))
        match data.draw(st.sampled_from(["change", "cut", "insert"])):
            case "change" if good:
                good[place] = data.draw(st.integers(0, 255))
            case "cut":
                del good[place:]
            case _:
                good[place:place] = data.draw(st.binary(max_size=9))
    try:
        heard = decode(bytes(good))
    except MessageError:
        return
    assert decode(encode(heard)) is not None


JUNK = st.recursive(
    st.none() | st.booleans() | st.integers(-(2**63), 2**64 - 1) | st.floats() | st.text(max_size=3)
    | st.binary(max_size=48),
    lambda inner: st.lists(inner, max_size=3),
    max_leaves=6,
)  # fmt: skip


@given(st.integers(1, 12), JUNK)
def test_a_field_of_another_type_is_refused_or_harmless(place, value):
    wire = example()
    wire[place] = value
    with contextlib.suppress(MessageError):
        decode(msgspec.msgpack.encode(wire))


# --- contacts, as they are told on


FEW = st.integers(0, 3).map(float)
TOLD = st.builds(
    Contact, st.sampled_from(["a-t1", "b-t1"]), st.sampled_from("ab"), FEW, st.booleans(), *[FEW] * 6,
    st.booleans(),
)  # fmt: skip


def merged(*heard: list[Contact]) -> dict[str, Contact]:
    book = Contacts("c", 3.0, 10.0)
    for part in heard:
        book.merge(part, 9.0)
    return book.known


@given(st.lists(TOLD, max_size=8), st.data())
def test_contacts_may_be_heard_twice_late_and_in_any_order(told, data):
    """The newest estimate counts, whoever tells it first; what is over stays over."""
    once = merged(told)
    assert merged(told, told) == once
    assert merged(data.draw(st.permutations(told))) == once
    assert merged(*[[one] for one in told], told[::-1]) == once


@given(st.lists(TOLD, max_size=8))
def test_the_newest_estimate_counts(told):
    for task, contact in merged(told).items():
        same_task = [one for one in told if one.task == task]
        assert contact in same_task
        assert contact.over == any(one.over for one in same_task)
        assert contact.t == max(one.t for one in same_task if one.over == contact.over)


def test_to_close_a_contact_is_the_last_word():
    book = Contacts("a", 3.0, 10.0)
    open_one = Contact("b-t1", "b", 0.0, False, 5.0, 0.0, 0.0, 0.0, 0.0, 1.0)
    book.merge([open_one], 5.0)
    book.close("b-t1", 6.0)
    book.merge([Contact("b-t1", "b", 0.0, False, 50.0, 0.0, 0.0, 0.0, 0.0, 1.0)], 50.0)
    assert book.known["b-t1"].over
