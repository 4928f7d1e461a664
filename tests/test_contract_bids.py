"""Comparing bids by hand (Dymkou's slides, "Compare bids"), as pure functions and in a whole conversation."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmbid.algorithms._contract_bids import best, diagonal, with_take_overs
from swarmbid.algorithms.contract_net import ContractNet
from swarmbid.messages.acts import AS_CONTRACTOR, PROPOSE, Act
from swarmbid.model import Agent, Mission, Task


def proposal(bid: float, *path: str, worth: float = 0.0) -> Act:
    return Act(
        1, PROPOSE, "new", AS_CONTRACTOR, bid=bid, path=tuple((name, 0.0) for name in path), worth=worth
    )


def test_a_manager_with_tasks_compares_the_diagonal():
    """Slides: each agent bids on its own proposal, c_11, c_22, c_33."""
    table = diagonal({0: proposal(3.0), 1: proposal(7.0, "old"), 2: proposal(5.0)})
    assert table == {(0, 0): 3.0, (1, 1): 7.0, (2, 2): 5.0}
    assert best(table) == (1, 1)


def test_an_idle_manager_also_scores_the_paths_of_the_others_for_itself():
    """Slides: c_31, c_32, c_33. Flying agent 1's path is worth 20 to agent 2, and agent 1's 9 are lost."""
    proposals = {0: proposal(3.0), 1: proposal(7.0, "old", worth=9.0), 2: proposal(5.0)}
    table = with_take_overs(proposals, 2, lambda act: 20.0)
    assert table == {(0, 0): 3.0, (1, 1): 7.0, (2, 2): 5.0, (2, 1): 11.0}
    assert best(table) == (2, 1)


def test_a_take_over_that_loses_what_it_gains_is_not_awarded():
    proposals = {0: proposal(5.0), 1: proposal(7.0, "old", worth=9.0)}
    assert best(with_take_overs(proposals, 0, lambda act: 15.9)) == (1, 1)
    assert best(with_take_overs(proposals, 0, lambda act: 16.0)) == (1, 1)  # a tie moves nothing
    assert best(with_take_overs(proposals, 0, lambda act: 16.1)) == (0, 1)


def test_a_take_over_that_is_no_better_moves_nothing_whoever_manages():
    proposals = {1: proposal(7.0, "old", worth=9.0), 2: proposal(5.0)}
    assert best(with_take_overs(proposals, 2, lambda act: 16.0)) == (1, 1)


def test_what_the_manager_cannot_fly_is_not_awarded_to_it():
    proposals = {0: proposal(5.0), 1: proposal(0.5, "old", worth=9.0)}
    table = with_take_overs(proposals, 0, lambda act: -math.inf)
    assert table[0, 1] == -math.inf
    assert best(table) == (0, 0)


def test_equal_bids_go_to_the_higher_id_and_no_bids_to_nobody():
    assert best(diagonal({0: proposal(4.0), 2: proposal(4.0), 1: proposal(4.0)})) == (2, 2)
    assert best({}) == (-1, -1)


bids = st.sampled_from([0.0, 0.5, 1.0, 2.0, 3.5])


@given(
    st.dictionaries(st.integers(0, 5), st.tuples(bids, bids, bids, st.booleans()), max_size=6),
    st.integers(0, 5),
)
def test_what_is_awarded_improves_the_team_most(drawn, manager):
    """Against the total of the team counted out for each possible award."""
    proposals = {
        row: proposal(bid, *(["old"] if busy and row != manager else []), worth=old)
        for row, (bid, old, _, busy) in drawn.items()
    }
    flown = {id(proposals[row]): value for row, (_, _, value, _) in drawn.items()}
    flyer, proposer = best(with_take_overs(proposals, manager, lambda act: flown[id(act)]))
    before = {row: act.worth if act.path else 0.0 for row, act in proposals.items()}
    totals = {}
    for row, act in proposals.items():
        totals[row, row] = sum(before.values()) + act.bid
        if act.path and row != manager:
            totals[manager, row] = sum(before.values()) - act.worth + flown[id(act)]
    if not totals:
        assert (flyer, proposer) == (-1, -1)
        return
    assert totals[flyer, proposer] == max(totals.values())
    if flyer != proposer:  # nothing moves for nothing
        assert totals[flyer, proposer] > max(totals[row, row] for row in proposals)


# --- in a conversation: a at 0, b at 10, speed 1, u (20) at 2, then t (20) at 3; score 20 - way


def team(take_over: bool) -> dict[str, ContractNet]:
    mission = Mission(
        agents=(
            Agent(id="a", position=(0.0, 0.0, 0.0), bundle_limit=2),
            Agent(id="b", position=(10.0, 0.0, 0.0)),
        ),
        tasks=(),
    )
    return {
        name: ContractNet(name, mission, "distance_cost", take_over=take_over and name == "a")
        for name in ("a", "b")
    }


def talk(agents: dict[str, ContractNet], begin: float, until: float) -> None:
    now = begin
    while now < until:
        for name, agent in agents.items():
            for message in agent.tick(now):
                for other, hearer in agents.items():
                    if other != name:
                        hearer.receive(message, now)
        now += 1.0


@pytest.mark.parametrize(
    ("take_over", "busy", "a_flies", "b_flies"),
    [
        # a is idle. u then t: 20 + 20 - 3 = 37 of b's 20 - 8 = 12 lost: 25. b would gain 20 - 0 = 20.
        (True, False, ["u", "t"], []),
        # The same by the diagonal: t lies on b's way, its 20 beat a's 20 - 3 = 17.
        (False, False, [], ["t", "u"]),
        # a has v at 1: diagonal. t gains it 20 - 2 = 18; b is better.
        (True, True, ["v"], ["t", "u"]),
    ],
)
def test_who_flies_what_when_the_manager_is_idle_or_not(take_over, busy, a_flies, b_flies):
    agents = team(take_over)
    agents["b"].announce(Task(id="u", position=(2.0, 0.0, 0.0), reward=20.0), 0.0, keep=True)
    if busy:
        agents["a"].announce(Task(id="v", position=(1.0, 0.0, 0.0), reward=20.0), 0.0, keep=True)
    talk(agents, 0.0, 10.0)
    agents["a"].announce(Task(id="t", position=(3.0, 0.0, 0.0), reward=20.0), 10.0)
    talk(agents, 10.0, 40.0)
    assert agents["a"].bundle == a_flies
    assert agents["b"].bundle == b_flies
    assert agents["a"].outcomes() == agents["b"].outcomes()
