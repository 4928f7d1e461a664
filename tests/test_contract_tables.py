"""The two tables of the Contract Net: total, absorbing, and one walk for each rule with its source."""

from __future__ import annotations

import pytest

from swarmbid.algorithms import _contract_tables as tables
from swarmbid.algorithms._contract_tables import CONTRACTOR, MANAGER, NOTHING
from swarmbid.algorithms.contract_net import ContractNet

TABLES = {
    "manager": (MANAGER, tables.MANAGER_STATES, tables.MANAGER_EVENTS),
    "contractor": (CONTRACTOR, tables.CONTRACTOR_STATES, tables.CONTRACTOR_EVENTS),
}
FINAL = ("done", "cancelled")
ROLES = pytest.mark.parametrize("role", TABLES)


def outgoing(role: str, state: str) -> set[str]:
    return {after for (before, _), (_, after) in TABLES[role][0].items() if before == state}


@ROLES
def test_there_is_an_entry_for_every_pair_and_for_no_other(role):
    table, states, events = TABLES[role]
    assert len(set(states)) == len(states)
    assert len(set(events)) == len(events)
    assert set(table) == {(state, event) for state in states for event in events}


@ROLES
def test_every_entry_leads_to_a_state_by_an_action_that_there_is(role):
    table, states, _ = TABLES[role]
    for (before, event), (action, after) in table.items():
        assert after in states, (before, event)
        if action == NOTHING:
            assert after == before, (before, event)
        else:
            assert callable(getattr(ContractNet, f"_{role}_{action}", None)), action


@ROLES
def test_there_is_no_action_that_no_entry_uses(role):
    used = {f"_{role}_{action}" for action, _ in TABLES[role][0].values()}
    there = {name for name in dir(ContractNet) if name.startswith(f"_{role}_")} - {"_contractor_lost"}
    assert there <= used


@ROLES
def test_every_event_matters_somewhere_and_every_state_can_be_reached(role):
    table, states, events = TABLES[role]
    assert {event for (_, event), (action, _) in table.items() if action != NOTHING} == set(events)
    reached = {"idle"}
    while more := {after for state in reached for after in outgoing(role, state)} - reached:
        reached |= more
    assert reached == set(states)


@ROLES
@pytest.mark.parametrize("state", FINAL)
def test_what_is_over_stays_over(role, state):
    assert outgoing(role, state) == {state}


@ROLES
def test_whatever_is_not_over_can_still_end_in_each_way(role):
    """No task may ever be left without an end: it is done, failed, cancelled or unserved."""
    table, states, _ = TABLES[role]
    for state in states:
        if state in FINAL or (role, state) == ("contractor", "unserved"):
            continue
        for event, end in tables.ENDINGS.items():
            assert table[state, event] == ("close", end)


def test_a_started_task_goes_only_by_its_holder_or_its_end():
    """A started task is not taken away by a better bid, an award or a rival's contract."""
    leaves = {event for event in tables.CONTRACTOR_EVENTS if CONTRACTOR["started", event][1] != "started"}
    assert leaves == {*tables.ENDINGS, "taken over", "finish", "fail", "give back"}


def test_nothing_is_started_that_is_not_under_contract():
    begins = {state for (state, event), (action, _) in CONTRACTOR.items() if action == "start"}
    assert begins == {"contracted"}
    assert {state for (state, _), (_, after) in CONTRACTOR.items() if after == "started"} == {
        "contracted",
        "started",
    }


def test_a_contract_is_in_force_only_after_a_confirmation_or_with_somebody_who_has_it():
    """Award in three steps: from "awarded" only a confirmation, or a holder's own word, leads on."""
    leads = {event for event in tables.MANAGER_EVENTS if MANAGER["awarded", event][1] == "contracted"}
    assert leads == {"confirm", "holder"}


WALKS = {
    # Slides, "Manager statecharts", and FIPA SC00029H: (source, role, [(event, action, state), ...]).
    "procedure diagram": ("manager", [
        ("in charge", "announce", "announced"), ("proposals", "award", "awarded"),
        ("confirm", "contract", "contracted"), ("over: done", "close", "done"),
    ]),
    "own bid better than every proposal: switch to track": ("manager", [
        ("in charge", "announce", "announced"), ("own bid best", "take", "contracted"),
    ]),
    "accepted? no: next best proposal if one is left": ("manager", [
        ("in charge", "announce", "announced"), ("proposals", "award", "awarded"),
        ("failure", "next_best", "announced"), ("proposals", "award", "awarded"),
        ("confirm", "contract", "contracted"),
    ]),
    "accepted? no, none left: switch to track": ("manager", [
        ("in charge", "announce", "announced"), ("proposals", "award", "awarded"),
        ("failure", "next_best", "announced"), ("own bid best", "take", "contracted"),
    ]),
    "no confirm: revoke, award the next best": ("manager", [
        ("in charge", "announce", "announced"), ("proposals", "award", "awarded"),
        ("confirm_by passed", "revoke", "announced"), ("proposals", "award", "awarded"),
    ]),
    "winner lost before it confirms": ("manager", [
        ("in charge", "announce", "announced"), ("proposals", "award", "awarded"),
        ("contractor lost", "next_best", "announced"),
    ]),
    "no proposals: back-off until the latest start": ("manager", [
        ("in charge", "announce", "announced"), ("reply_by passed", "back_off", "waiting"),
        ("back-off over", "reopen", "announced"), ("reply_by passed", "back_off", "waiting"),
        ("latest start passed", "give_up", "unserved"),
    ]),
    "all refuse: parked, and reopened by who can": ("manager", [
        ("in charge", "announce", "announced"), ("refusals", "park", "unserved"),
        ("can now", "resume", "announced"), ("proposals", "award", "awarded"),
    ]),
    "failure in execution: called for again": ("manager", [
        ("in charge", "announce", "announced"), ("own bid best", "take", "contracted"),
        ("failure", "reopen", "announced"), ("failures", "park", "failed"),
        ("latest start passed", "give_up", "failed"),
    ]),
    "two managers: one yields, and leads again if the other is gone": ("manager", [
        ("in charge", "announce", "announced"), ("rival", "withdraw", "yielded"),
        ("in charge", "announce", "announced"), ("holder", "adopt", "contracted"),
    ]),
    "sub-contract: nobody can, the holder keeps it": ("manager", [
        ("hand over", "announce", "announced"), ("kept", "keep", "contracted"),
    ]),
    "an idle manager takes a whole path over": ("manager", [
        ("in charge", "announce", "announced"), ("take-over best", "take_over", "contracted"),
    ]),
    "... and awards itself the rest of it": ("manager", [
        ("claim", "claim", "awarded"), ("confirm", "contract", "contracted"),
    ]),
    "contractor: procedure diagram": ("contractor", [
        ("can do", "propose", "proposed"), ("award stands", "confirm", "confirmed"),
        ("contract", "take", "contracted"), ("start", "start", "started"), ("finish", "finish", "done"),
    ]),
    "contractor: not awarded, drop the tentative path": ("contractor", [
        ("can do", "propose", "proposed"), ("awarded elsewhere", "drop", "idle"),
    ]),
    "contractor: withdrawn, and proposes anew": ("contractor", [
        ("can do", "propose", "proposed"), ("award stale", "decline", "released"),
        ("can do", "propose", "proposed"),
    ]),
    "contractor: refuses, and can later": ("contractor", [
        ("cannot do", "refuse", "refused"), ("can do", "propose", "proposed"),
    ]),
    "contractor: its confirmation came too late": ("contractor", [
        ("can do", "propose", "proposed"), ("award stands", "confirm", "confirmed"),
        ("awarded elsewhere", "release", "released"),
    ]),
    "contractor: its manager yielded before the start": ("contractor", [
        ("can do", "propose", "proposed"), ("award stands", "confirm", "confirmed"),
        ("contract", "take", "contracted"), ("awarded elsewhere", "release", "released"),
    ]),
    "contractor: taken over as it is by another manager": ("contractor", [
        ("contract", "take", "contracted"), ("start", "start", "started"),
        ("contract", "renew", "started"), ("awarded elsewhere", NOTHING, "started"),
        ("finish", "finish", "done"),
    ]),
    "contractor: hand-over while under way": ("contractor", [
        ("contract", "take", "contracted"), ("start", "start", "started"),
        ("taken over", "hand_over", "released"),
    ]),
    "contractor: fails, and does not forget it": ("contractor", [
        ("contract", "take", "contracted"), ("start", "start", "started"), ("fail", "fail", "failed"),
        ("cannot do", "refuse", "failed"),
    ]),
    "contractor: cancelled under way": ("contractor", [
        ("contract", "take", "contracted"), ("start", "start", "started"),
        ("over: cancelled", "close", "cancelled"), ("contract", NOTHING, "cancelled"),
        ("over: done", NOTHING, "cancelled"),
    ]),
}  # fmt: skip


@pytest.mark.parametrize("rule", WALKS)
def test_walk(rule):
    role, steps = WALKS[rule]
    state = "idle"
    for event, action, after in steps:
        assert TABLES[role][0][state, event] == (action, after), (state, event)
        state = after
