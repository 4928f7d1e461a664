"""What every negotiator must do with messages and time (`swarmbid.negotiator`)."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from typing import Any, cast

import numpy as np

from swarmbid.errors import SwarmbidError
from swarmbid.messages import KINDS, Beliefs, Message, decode, encode
from swarmbid.negotiator import (
    Agreed,
    Doubted,
    MessageDropped,
    Negotiator,
    TaskOutbid,
    TaskReleased,
    TaskTaken,
)
from swarmbid.rng import stream
from swarmbid.testing._team import SHAPES, Broken, Check, Make, Team, mission_of, state

MOST_WORDS = 12
"""Messages in a minute that an agent may send when all agree: a heartbeat, no more."""


def agrees(make: Make) -> None:
    for number, shape in enumerate(SHAPES):
        for windows in (False, True):
            team = Team(make, mission_of(number, agents=3 + number % 3, windows=windows), shape)
            team.settle(f"on a {shape} graph the agents")
            team.check_assignment()


def agrees_on_bad_links(make: Make) -> None:
    for seed in range(4):
        team = Team(make, mission_of(seed), SHAPES[seed], seed=seed, copies=2, loss=0.3, delay=3)
        team.settle(f"on a {SHAPES[seed]} graph with loss, delay and duplicates the agents")
        team.check_assignment()


def small_missions(make: Make) -> None:
    alone = Team(make, mission_of(1, agents=1, tasks=2))
    alone.settle("an agent alone")
    if not alone.path_tasks("a0"):
        raise Broken("an agent alone does nothing, although every task pays")
    idle = Team(make, mission_of(1, agents=2, tasks=0))
    idle.settle("two agents without a task")
    idle.check_assignment()


def never_agrees_unheard(make: Make) -> None:
    mission = mission_of(2, agents=3)
    one = make("a0", mission)
    for now in range(60):
        due = one.next_tick()
        if due is not None and due <= now:
            one.tick(float(now))
        if one.agreed:
            raise Broken(f"an agent of three that has heard nobody says after {now} s that all agree")


def takes_duplicates(make: Make) -> None:
    for seed in range(2):
        once, thrice = Team(make, mission_of(seed), "ring"), Team(make, mission_of(seed), "ring", copies=3)
        for team in (once, thrice):
            team.settle("with every message tripled, the agents" if team is thrice else "the agents")
        for name, one in once.agents.items():
            if state(one) != state(thrice.agents[name]):
                raise Broken(f"{name} ends with other beliefs when every message arrives three times")


def drops_old_messages(make: Make) -> None:
    for seed in range(3):
        team = Team(make, mission_of(seed, tasks=9), "line")
        for _ in range(7):
            team.round()
            for name, one in team.agents.items():
                before = state(one)
                for neighbour in team.neighbours[name]:
                    for message in reversed([word for _, sender, word in team.sent if sender == neighbour]):
                        one.receive(message, team.now + 0.8)
                if state(one) != before:
                    raise Broken(
                        f"{name} changed its mind in round {team.now:g} on messages that it already had"
                    )
        team.settle("after many old messages, the agents")
        team.check_assignment()


def falls_silent(make: Make) -> None:
    team = Team(make, mission_of(4), "ring")
    team.settle()
    for _ in range(10):
        team.round()
    settled, said = {name: one.digest for name, one in team.agents.items()}, len(team.sent)
    for _ in range(60):
        team.round()
    for name, one in team.agents.items():
        if one.digest != settled[name]:
            raise Broken(f"{name} changed its beliefs although nothing happened")
        words = sum(sender == name for _, sender, _ in team.sent[said:])
        if words > MOST_WORDS:
            raise Broken(f"{name} sent {words} messages in the minute after all had agreed")


def twins(make: Make) -> None:
    for shape in ("complete", "line"):
        first, second, wired = (Team(make, mission_of(5), shape, wire=wire) for wire in (False, False, True))
        for team in (first, second, wired):
            for _ in range(12):
                team.round()
        for other, how in ((second, "the same messages"), (wired, "the same messages, sent as bytes,")):
            for mine, theirs in zip(first.sent, other.sent, strict=False):
                if _frozen(mine) != _frozen(theirs):
                    raise Broken(f"given {how} {mine[1]} says something else at {mine[0]:g} s")
            if len(first.sent) != len(other.sent):
                raise Broken(
                    f"given {how} the agents send {len(other.sent)} messages instead of {len(first.sent)}"
                )


def leaves_messages_alone(make: Make) -> None:
    team = Team(make, mission_of(6), "ring")
    kept: list[tuple[Any, Any]] = []
    for _ in range(10):
        said = len(team.sent)
        team.round()
        for _, _, message in team.sent[said:]:
            kept.append((message, _frozen(message)))
        for message, then in kept:
            if _frozen(message) != then:
                raise Broken(f"a message of {getattr(message, 'sender', '?')} changed after it had been sent")


def reading_changes_nothing(make: Make) -> None:
    def look(one: Negotiator) -> None:
        for _ in range(3):
            seen = (one.next_tick(), one.path, one.agreed, one.digest, one.beliefs())
            if seen != (one.next_tick(), one.path, one.agreed, one.digest, one.beliefs()):
                raise Broken(f"{one.agent_id} answers differently when it is asked twice")
            one.path.clear()
            one.beliefs().clear()

    seen, unseen = Team(make, mission_of(7), "ring"), Team(make, mission_of(7), "ring")
    for _ in range(12):
        seen.round(extra=look)
        unseen.round()
    for mine, theirs in zip(unseen.sent, seen.sent, strict=False):
        if _frozen(mine) != _frozen(theirs):
            raise Broken(f"{mine[1]} says something else at {mine[0]:g} s after it was looked at")
    if len(seen.sent) != len(unseen.sent):
        raise Broken("the number of messages depends on whether the agents are looked at")


def extra_ticks(make: Make) -> None:
    team = Team(make, mission_of(8), "ring")

    def again(one: Negotiator) -> None:
        before = (state(one), one.next_tick())
        if one.tick(team.now):
            raise Broken(f"{one.agent_id} speaks twice when it is ticked twice at {team.now:g} s")
        if before[0] != state(one):
            raise Broken(f"{one.agent_id} changes its mind when it is ticked twice at {team.now:g} s")

    for _ in range(15):
        team.round(extra=again)
    for seed in range(2):
        team = Team(make, mission_of(seed), "ring", extra_ticks=True)
        team.settle("ticked three times as often, the agents")
        team.check_assignment()


def tells_what_happened(make: Make) -> None:
    for seed in range(3):
        team = Team(make, mission_of(seed), "ring")
        team.settle()
        for name, one in team.agents.items():
            held: set[str] = set()
            agreed = False
            for event in team.events[name]:
                if isinstance(event, TaskTaken):
                    held.add(event.task)
                elif isinstance(event, TaskOutbid | TaskReleased):
                    held.discard(event.task)
                elif isinstance(event, Agreed | Doubted):
                    agreed = isinstance(event, Agreed)
            if held != set(team.path_tasks(name)):
                raise Broken(
                    f"by its events {name} holds {sorted(held)}, by its path {sorted(team.path_tasks(name))}"
                )
            if agreed != one.agreed:
                raise Broken(
                    f"the last of the events Agreed and Doubted of {name} says {agreed}, it says {one.agreed}"
                )
            if one.events():
                raise Broken(f"{name} tells the same events twice")


def drops_garbage(make: Make) -> None:
    clean, dirty = Team(make, mission_of(9), "complete"), Team(make, mission_of(9), "complete")
    for number in range(6):
        clean.round()
        dirty.round()
        one = dirty.agents["a0"]
        if number == 0:
            continue
        for what, thing in [*_wrong_types(), *_wrong_words(dirty)]:
            before = (state(one), one.next_tick())
            one.receive(thing, dirty.now + 0.8)
            dropped = [event for event in one.events() if isinstance(event, MessageDropped)]
            if before != (state(one), one.next_tick()):
                raise Broken(f"{what} changed what the agent believes, plans or when it ticks")
            if len(dropped) != 1 or not dropped[0].reason:
                raise Broken(f"{what} was not reported as one MessageDropped with a reason")
    for team in (clean, dirty):
        team.settle("after garbage, the agents" if team is dirty else "the agents")
    for name, one in clean.agents.items():
        if state(one) != state(dirty.agents[name]):
            raise Broken(f"{name} ends with other beliefs after garbage was sent to a0")


def survives_mangled_bytes(make: Make) -> None:
    rng = stream(10, "mangle")
    team = Team(make, mission_of(10), "complete")
    for _ in range(3):
        team.round()
    words = [
        encode(message) for _, sender, message in team.sent if isinstance(message, KINDS) and sender != "a0"
    ]
    one = team.agents["a0"]
    for _ in range(300):
        data = bytearray(words[int(rng.integers(len(words)))])
        for _ in range(int(rng.integers(1, 4))):
            data[int(rng.integers(len(data)))] = int(rng.integers(256))
        try:
            message = decode(bytes(data))
        except SwarmbidError:
            continue
        one.receive(cast(Message, message), team.now)
        team.now += 1.0
        one.tick(team.now)
        known = {agent.id for agent in team.mission.agents}
        for task, holders in one.beliefs().items():
            for holder, bid in holders:
                if holder not in known or not 0.0 <= bid < float("inf"):
                    raise Broken(
                        f"a mangled message made it believe that {holder!r} wins {task} with a bid of {bid}"
                    )


def _wrong_types() -> list[tuple[str, Any]]:
    things = [None, 7, float("nan"), "text", b"\x00\xff", {}, [], object(), Beliefs]
    return [(f"{thing!r:.40} in place of a message", thing) for thing in things]


def _wrong_words(team: Team) -> list[tuple[str, Any]]:
    """Words of a1 to a0, made wrong in one way each; all of it news if it were right."""
    found = [
        ("its own message, looped back", message) for _, sender, message in team.sent[-9:] if sender == "a0"
    ]
    words: list[Any] = [message for _, sender, message in team.sent if sender == "a1"]
    changes: list[tuple[str, Callable[[Any], dict[str, Any]]]] = [
        ("a message of an unknown sender", lambda m: {"sender": "stranger"}),
        ("a message under its own name", lambda m: {"sender": "a0", "sequence": m.sequence + 1}),
        ("a message with an old sequence", lambda m: {"sequence": 1, "since": 0}),
        (
            "a message about an unknown agent",
            lambda m: _newer(m) | {"agent_ids": ("stranger", *m.agent_ids[1:])},
        ),
        ("a message about an unknown task", lambda m: _newer(m) | {"task_ids": ("nothing", *m.task_ids[1:])}),
    ]
    for what, number in (("a bid of NaN", np.nan), ("an infinite bid", np.inf), ("a negative bid", -1.0)):
        changes.append((what, partial(_with_bids, number)))
    for what, change in changes:
        with suppress(SwarmbidError, TypeError, AttributeError, IndexError):
            # Where such a message cannot even be made, or has no such field, there is nothing to test.
            found.append((what, dataclasses.replace(words[-1], **change(words[-1]))))
    return found


def _with_bids(number: float, message: Any) -> dict[str, Any]:
    if not message.bids.size:
        raise IndexError("there is no bid in this message that could be made wrong")
    return _newer(message) | {"bids": np.full(message.bids.shape, number)}


def _newer(message: Any) -> dict[str, Any]:
    return {"sequence": message.sequence + 1, "since": 0}


def _frozen(item: Any) -> Any:
    """A message, or a record of one, as something that can be compared."""
    if isinstance(item, tuple):
        return tuple(_frozen(part) for part in item)
    return encode(item) if isinstance(item, KINDS) else repr(item)


CHECKS = (
    Check("agrees", "On every connected graph all agents come to the same beliefs, one agent a task, and "
          "know it. Look first at ties (one order of bids for all), then at stamps.", agrees),
    Check("agrees_on_bad_links", "Lost, late and doubled messages delay an agreement; they do not prevent "
          "it. Repeat what may be lost until everybody's digest is known to be equal.", agrees_on_bad_links),
    Check("small_missions", "One agent, or no task at all, is a mission like any other.", small_missions),
    Check("never_agrees_unheard", "Agreement is the digest of every live agent being equal to one's own. "
          "Having heard nothing for a while is no sign of it.", never_agrees_unheard),
    Check("takes_duplicates", "A network may deliver a message twice; the second must change nothing. "
          "Compare its sequence with that of the last one taken in.", takes_duplicates),
    Check("drops_old_messages", "Messages overtake each other. One that is older than what was taken in "
          "from its sender is dropped.", drops_old_messages),
    Check("falls_silent", "When all agree and nothing changes there is nothing to say but a heartbeat every "
          "few seconds. Let next_tick say when that is due, and tick return an empty list.", falls_silent),
    Check("twins", "Same messages at the same times, same words, byte for byte: no clock, no randomness, no "
          "iteration over sets, no state shared between agents.", twins),
    Check("leaves_messages_alone", "A message goes to many receivers and may still be under way: copy what "
          "goes into it and what is taken out of it.", leaves_messages_alone),
    Check("reading_changes_nothing", "next_tick, path, agreed, digest and beliefs only answer. A driver may "
          "ask as often as it likes, and may change the lists that it was given.", reading_changes_nothing),
    Check("extra_ticks", "A driver may tick too often. With nothing due, tick returns an empty list and "
          "changes nothing.", extra_ticks),
    Check("tells_what_happened", "Traces, metrics and explanations are made of events alone: every task that "
          "enters or leaves the path is reported once, and so are Agreed and Doubted.", tells_what_happened),
    Check("drops_garbage", "A peer's bad message never raises. It changes nothing and becomes one "
          "MessageDropped event with a reason. Test everything before the first change.", drops_garbage),
    Check("survives_mangled_bytes", "Whatever decode lets through may be said by a broken peer: it must "
          "neither raise nor bring an unknown agent or an impossible bid into the beliefs.",
          survives_mangled_bytes),
)  # fmt: skip
