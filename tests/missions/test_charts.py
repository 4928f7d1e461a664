"""The two statecharts as tables (Dymkou's slides, "Manager ..." and "Potential contractors statecharts")."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmbid.messages.survey import Contact
from swarmbid.missions import charts
from swarmbid.missions._charting import AreaDivided, Charting, TargetFound
from swarmbid.missions.charts import (
    ACCEPTED,
    ANNOUNCED,
    AWARDED,
    AWARDING,
    BUILDING_ONE,
    BUILDING_SEVERAL,
    CONTINUING,
    CONTRACTOR_CHART,
    CONTRACTOR_EVENTS,
    CONTRACTOR_STATES,
    DECLINED,
    DEFINING,
    FOUND,
    IDLE,
    MANAGER_CHART,
    MANAGER_EVENTS,
    MANAGER_STATES,
    MOVING,
    NEXT,
    NO_PROPOSAL,
    NOT_AWARDED,
    OFFERED,
    ONE_NEW,
    OTHER_BEST,
    OVER,
    OWN_BEST,
    PLANNING,
    PROPOSED,
    SEARCHING,
    SEVERAL_NEW,
    STATIC,
    TAKEN,
    TRACKING,
    UNABLE,
    WAITING,
    Progress,
)
from swarmbid.missions.separation import Subgroup
from swarmbid.negotiator import Stage

BOTH = [
    (MANAGER_CHART, MANAGER_STATES, MANAGER_EVENTS, SEARCHING),
    (CONTRACTOR_CHART, CONTRACTOR_STATES, CONTRACTOR_EVENTS, IDLE),
]
ANNOUNCING = [(FOUND, DEFINING), (STATIC, PLANNING), (ANNOUNCED, WAITING)]

MANAGER_WALKS = {
    "moving -> switch to track": [(FOUND, DEFINING), (MOVING, TRACKING)],
    "static, more than one proposal? no -> switch to track": [*ANNOUNCING, (NO_PROPOSAL, TRACKING)],
    "static, own bid better than all -> switch to track": [*ANNOUNCING, (OWN_BEST, TRACKING)],
    "static, award, accepted -> continue current job": [
        *ANNOUNCING, (OTHER_BEST, AWARDING), (ACCEPTED, CONTINUING),
    ],
    "static, award declined, next best asked, accepted": [
        *ANNOUNCING, (OTHER_BEST, AWARDING), (NEXT, AWARDING), (ACCEPTED, CONTINUING),
    ],
    "static, all decline -> switch to track": [
        *ANNOUNCING, (OTHER_BEST, AWARDING), (NEXT, AWARDING), (DECLINED, TRACKING),
    ],
    "static, declined, now the own bid is best -> switch to track": [
        *ANNOUNCING, (OTHER_BEST, AWARDING), (OWN_BEST, TRACKING),
    ],
    "a rival manager has it -> continue current job": [*ANNOUNCING, (TAKEN, CONTINUING)],
    "tracked to the end -> continue current job": [(FOUND, DEFINING), (MOVING, TRACKING), (OVER, CONTINUING)],
    "the contractor fails -> awarded again": [
        *ANNOUNCING, (OTHER_BEST, AWARDING), (ACCEPTED, CONTINUING),
        (OTHER_BEST, AWARDING), (ACCEPTED, CONTINUING),
    ],
}  # fmt: skip
CONTRACTOR_WALKS = {
    "one new target, awarded -> switch to track": [
        (ONE_NEW, BUILDING_ONE), (PROPOSED, OFFERED), (AWARDED, TRACKING), (OVER, IDLE),
    ],
    "one new target, not awarded -> continue current job": [
        (ONE_NEW, BUILDING_ONE), (PROPOSED, OFFERED), (NOT_AWARDED, IDLE),
    ],
    "several new targets, awarded -> switch to track": [
        (SEVERAL_NEW, BUILDING_SEVERAL), (PROPOSED, OFFERED), (AWARDED, TRACKING),
    ],
    "several new targets, not awarded -> continue current job": [
        (SEVERAL_NEW, BUILDING_SEVERAL), (PROPOSED, OFFERED), (NOT_AWARDED, IDLE),
    ],
    "one new target that it cannot do": [(ONE_NEW, BUILDING_ONE), (UNABLE, IDLE)],
    "several new targets, one of which it cannot do": [(SEVERAL_NEW, BUILDING_SEVERAL), (UNABLE, IDLE)],
    "an offer withdrawn": [(ONE_NEW, BUILDING_ONE), (PROPOSED, OFFERED), (UNABLE, IDLE)],
    "the target is over before the award": [(ONE_NEW, BUILDING_ONE), (PROPOSED, OFFERED), (OVER, IDLE)],
    "the contract goes to another later": [
        (ONE_NEW, BUILDING_ONE), (PROPOSED, OFFERED), (AWARDED, TRACKING), (NOT_AWARDED, IDLE),
    ],
}  # fmt: skip


@pytest.mark.parametrize(("chart", "states", "events", "first"), BOTH, ids=["manager", "contractor"])
class TestTables:
    def test_the_table_is_total(self, chart, states, events, first):
        assert set(chart) == {(state, event) for state in states for event in events}
        assert set(chart.values()) <= set(states)
        assert len(set(states)) == len(states) and len(set(events)) == len(events)

    def test_every_state_can_be_reached_and_none_is_a_trap(self, chart, states, events, first):
        def from_(state):
            reached, todo = {state}, [state]
            while todo:
                here = todo.pop()
                new = {chart[here, event] for event in events} - reached
                reached |= new
                todo += sorted(new)
            return reached

        assert from_(first) == set(states)
        rest = {CONTINUING, IDLE}
        assert all(from_(state) & rest for state in states)

    def test_every_event_means_something_somewhere(self, chart, states, events, first):
        for event in events:
            moves = any(chart[state, event] != state for state in states)
            assert moves or event == NEXT, event  # to ask the next bidder is to go on awarding

    def test_over_never_leaves_a_uav_busy(self, chart, states, events, first):
        for state in states:
            assert chart[state, OVER] in (SEARCHING, CONTINUING, IDLE, BUILDING_ONE, BUILDING_SEVERAL)


@pytest.mark.parametrize("walk", MANAGER_WALKS.values(), ids=MANAGER_WALKS)
def test_a_manager_walks_the_chart(walk):
    """Dymkou's slides, "Manager statecharts": each path from "found target" to its end."""
    progress = Progress(MANAGER_CHART, SEARCHING)
    for event, after in walk:
        progress.step("t", event)
        assert progress.state("t") == after


@pytest.mark.parametrize("walk", CONTRACTOR_WALKS.values(), ids=CONTRACTOR_WALKS)
def test_a_contractor_walks_the_chart(walk):
    """Dymkou's slides, "Potential contractors statecharts": each path from "new message"."""
    progress = Progress(CONTRACTOR_CHART, IDLE)
    for event, after in walk:
        progress.step("t", event)
        assert progress.state("t") == after


def test_only_what_is_under_contract_is_tracked():
    """ "Wait for the contract": a contractor that was awarded nothing never switches to track."""
    into = {pair for pair, after in CONTRACTOR_CHART.items() if after == TRACKING and pair[0] != TRACKING}
    assert into == {(OFFERED, AWARDED)}


def test_a_manager_awards_only_after_it_has_waited_for_proposals():
    into = {pair for pair, after in MANAGER_CHART.items() if after == AWARDING and pair[0] != AWARDING}
    assert (WAITING, OTHER_BEST) in into
    assert all(event == OTHER_BEST for _, event in into)
    assert not any(state in (SEARCHING, DEFINING, PLANNING) for state, _ in into)


@given(st.lists(st.tuples(st.sampled_from("ab"), st.sampled_from(MANAGER_EVENTS)), max_size=30))
def test_targets_do_not_mix(steps):
    """The state of one target depends on what happened to it alone, and only changes are told."""
    together = Progress(MANAGER_CHART, SEARCHING)
    alone = {name: Progress(MANAGER_CHART, SEARCHING) for name in "ab"}
    for task, event in steps:
        before = together.state(task)
        told = together.step(task, event)
        alone[task].step(task, event)
        assert together.state(task) == alone[task].state(task)
        assert told == (None if together.state(task) == before else together.state(task))


# --- what the Contract Net tells, put into the charts


def contact(moving: bool = False) -> Contact:
    return Contact("u1-t1", "u1", 3.0, moving, 5.0, 10.0, 20.0, 0.0, 0.0, 2.0)


def states(told, role):
    assert all(isinstance(one, Stage) for one in told)
    return [one.state for one in told if one.role == role]


def followed(
    charting: Charting, role: str, *stages: str, task: str = "u1-t1", holder: str = "", others=("u2",)
) -> list[str]:
    told = [one for name in stages for one in charting.follow(Stage(task, role, name), holder, others)]
    return states(told, role)


class TestCharting:
    def test_a_found_target_is_told_with_its_type_and_evidence(self):
        charting = Charting("u1")
        first, *told = charting.found(contact(moving=True), "3 m/s")
        assert first == TargetFound("u1-t1", 10.0, 20.0, True, "3 m/s")
        assert states(told, "manager") == [DEFINING, TRACKING]

    def test_a_static_one_is_planned_for(self):
        told = Charting("u1").found(contact(), "0 m/s")[1:]
        assert states(told, "manager") == [DEFINING, PLANNING]

    @pytest.mark.parametrize(
        ("stages", "said"),
        [
            (("announced", "contracted"), [WAITING, TRACKING]),
            (("announced", "awarded", "contracted"), [WAITING, AWARDING, CONTINUING]),
            (("announced", "awarded", "announced", "awarded", "contracted"), [WAITING, AWARDING, CONTINUING]),
            (("announced", "awarded", "announced", "contracted"), [WAITING, AWARDING, TRACKING]),
            (("announced", "yielded"), [WAITING, CONTINUING]),
            (("announced", "awarded", "contracted", "announced", "awarded", "contracted"),
             [WAITING, AWARDING, CONTINUING, AWARDING, CONTINUING]),
            (("announced", "contracted", "done"), [WAITING, TRACKING, CONTINUING]),
            (("announced", "waiting", "unserved"), [WAITING, CONTINUING]),
            (("announced", "cancelled"), [WAITING, CONTINUING]),
        ],
    )  # fmt: skip
    def test_a_conversation_is_followed_as_manager(self, stages, said):
        charting = Charting("u1")
        charting.found(contact(), "")
        assert followed(charting, "manager", *stages) == said

    @pytest.mark.parametrize(
        ("stages", "said"),
        [
            (("proposed", "confirmed", "contracted"), [BUILDING_ONE, OFFERED, TRACKING]),
            (("proposed", "idle"), [BUILDING_ONE, OFFERED, IDLE]),
            (("refused",), [BUILDING_ONE, IDLE]),
            (("proposed", "refused"), [BUILDING_ONE, OFFERED, IDLE]),
            (("proposed", "contracted", "started", "done"), [BUILDING_ONE, OFFERED, TRACKING, IDLE]),
            (("proposed", "contracted", "started", "failed"), [BUILDING_ONE, OFFERED, TRACKING, IDLE]),
            (("proposed", "contracted", "started", "released"), [BUILDING_ONE, OFFERED, TRACKING, IDLE]),
            (("contracted",), [BUILDING_ONE, OFFERED, TRACKING]),
        ],
    )
    def test_a_conversation_is_followed_as_contractor(self, stages, said):
        assert followed(Charting("u2"), "contractor", *stages) == said

    def test_a_second_new_target_makes_them_several(self):
        charting = Charting("u2")
        assert followed(charting, "contractor", "proposed", task="a") == [BUILDING_ONE, OFFERED]
        assert followed(charting, "contractor", "proposed", task="b") == [BUILDING_SEVERAL, OFFERED]

    def test_a_contract_that_another_holds_is_not_the_own(self):
        """A manager that adopts a holder's contract continues its current job."""
        charting = Charting("u1")
        charting.found(contact(), "")
        assert followed(charting, "manager", "announced") == [WAITING]
        assert followed(charting, "manager", "contracted", holder="u2") == [CONTINUING]

    @pytest.mark.parametrize("others", [(), ("u2",)])
    def test_with_or_without_another_proposal_its_own_contract_is_tracking(self, others):
        """ "More than one proposal?" no, and "own bid better" yes: both switch to track."""
        charting = Charting("u1")
        charting.found(contact(), "")
        stages = ("announced", "contracted")
        assert followed(charting, "manager", *stages, holder="u1", others=others) == [WAITING, TRACKING]

    def test_a_hand_over_ends_the_track(self):
        charting = Charting("u1")
        charting.found(contact(moving=True), "")
        stages = ("announced", "contracted", "announced", "awarded", "contracted")
        assert followed(charting, "manager", *stages) == [AWARDING, CONTINUING]

    def test_it_says_who_left_the_search_and_who_joined(self):
        charting = Charting("u1")
        assert charting.divided(["u1", "u2"]) == AreaDivided(("u1", "u2"), "the search begins")
        assert charting.divided(["u1"]).because == "u2 left the search"
        assert charting.divided(["u1", "u3"]).because == "u3 joined"
        assert charting.divided(["u1", "u2"]).because == "u3 left the search, u2 joined"

    def test_it_says_how_targets_were_separated(self):
        charting = Charting("u1")
        charting.divided(["u1", "u2"])
        told = charting.separated([Subgroup(("1", "k"), (0.0, 0.0)), Subgroup(("2", "n"), (9.0, 0.0))])
        assert told == AreaDivided(("u1", "u2"), "targets separated: 1 and k; 2 and n")


def test_the_words_of_a_chart_are_told_apart():
    words = [*MANAGER_STATES, *CONTRACTOR_STATES]
    assert len(set(words)) == len(words) - 1  # both track
    assert charts.TRACKING in MANAGER_STATES and charts.TRACKING in CONTRACTOR_STATES
