"""Numbers from a trace: by hand on a small one, and equal to what a run counted itself."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmbid.errors import InputError
from swarmbid.metrics import Metrics, gini, measure, winner_changes
from swarmbid.network import Network, make_topology
from swarmbid.scenarios import uniform
from swarmbid.simulator import simulate
from swarmbid.trace import (
    Agreed,
    Dropped,
    Header,
    Outbid,
    Record,
    Released,
    Result,
    Sent,
    Taken,
    Trace,
    read_trace,
)

# Three agents on a line, two tasks with service. a flies 30 m to t1 and 10 m on to t2, b flies 20 m to
# t3, c does nothing, and t4 is left over.
MISSION: dict[str, Any] = {
    "version": 1,
    "agents": [
        {"id": "a", "position": [0, 0, 0], "speed": 2},
        {"id": "b", "position": [0, 50, 0], "speed": 4},
        {"id": "c", "position": [0, 90, 0]},
    ],
    "tasks": [
        {"id": "t1", "position": [30, 0, 0], "duration": 5},
        {"id": "t2", "position": [40, 0, 0]},
        {"id": "t3", "position": [20, 50, 0], "duration": 1},
        {"id": "t4", "position": [0, 9000, 0]},
    ],
}


def visit(task: str, start: float, end: float, leg: float) -> dict[str, Any]:
    return {"task": task, "arrival": start, "start": start, "end": end, "leg": leg, "score": 1.0}


PLAN: dict[str, Any] = {
    "kind": "plan",
    "version": 1,
    "mission": "mission",
    "algorithm": "cbba",
    "score_name": "time_discounted",
    "total_score": 3.0,
    "honest_score": 2.5,
    "agents": [
        {
            "agent": "a",
            "distance": 40.0,
            "finish": 25.0,
            "score": 2.0,
            "visits": [visit("t1", 15.0, 20.0, 30.0), visit("t2", 25.0, 25.0, 10.0)],
        },
        {
            "agent": "b",
            "distance": 20.0,
            "finish": 6.0,
            "score": 1.0,
            "visits": [visit("t3", 5.0, 6.0, 20.0)],
        },
        {"agent": "c", "distance": 0.0, "finish": 0.0, "score": 0.0, "visits": []},
    ],
    "unserved": [{"task": "t4", "reason": "no_gain", "detail": "Too far."}],
}


def taken(t: float, agent: str, task: str, bid: float) -> Taken:
    return Taken(t=t, agent=agent, task=task, bid=bid, position=0, start=0.0)


def outbid(t: float, agent: str, task: str, by: str) -> Outbid:
    return Outbid(t=t, agent=agent, task=task, bid=0.0, by=by, by_bid=9.0)


def sent(t: float, agent: str, entries: int, size: int, lost: int = 0) -> Sent:
    return Sent(t=t, agent=agent, sequence=1, entries=entries, bytes=size, receivers=2, lost=lost)


RESULT = Result(t=3.0, status="converged", rounds=2, last_bid_round=1, declared_round=4, plan=PLAN, reason="")
RECORDS: tuple[Record, ...] = (
    taken(0.0, "a", "t1", 5.0),
    taken(0.0, "b", "t1", 7.0),
    taken(0.0, "b", "t3", 2.0),
    sent(0.0, "a", 1, 100),
    sent(0.0, "b", 2, 130, lost=1),
    Dropped(t=1.0, agent="c", sender="a", reason="gap"),
    Dropped(t=1.0, agent="a", sender="b", reason="stale"),
    Dropped(t=1.0, agent="c", sender="b", reason="gap"),
    outbid(1.0, "a", "t1", "b"),
    Released(t=2.0, agent="b", task="t1", because=None),
    taken(2.0, "a", "t1", 5.0),
    sent(2.0, "a", 3, 70, lost=2),
    Agreed(t=3.0, agent="a"),
    RESULT,
)


def trace_of(records: tuple[Record, ...]) -> Trace:
    return Trace("run.jsonl", Header(swarmbid="0", mission=MISSION, algorithm="cbba"), records)


def test_every_number_of_a_small_trace_is_what_one_counts_by_hand():
    assert measure(trace_of(RECORDS)) == Metrics(
        status="converged",
        rounds=2,
        last_bid_round=1,
        declared_round=4,
        messages=3,
        bytes=300,  # 100 + 130 + 70
        entries=6,  # 1 + 2 + 3
        bytes_per_broadcast=100.0,  # 300 / 3
        lost=3,  # 0 + 1 + 2
        dropped={"gap": 2, "stale": 1},
        winner_changes={"t1": 1},  # b leads at 0 s with 7 over 5; a at 2 s
        makespan=25.0,  # t2 ends last
        total_distance=60.0,  # 40 + 20
        score=3.0,
        honest_score=2.5,
        # Work: a 40 m / 2 m/s + 5 s = 25 s, b 20 m / 4 m/s + 1 s = 6 s, c 0 s. The differences of the
        # nine ordered pairs sum to 2 * (19 + 25 + 6) = 100; over 2 * 9 * the mean 31 / 3 that is 100 / 186.
        gini=pytest.approx(100 / 186),
        num_agents=3,
        num_tasks=4,
        served=3,
        unserved=1,
    )


def test_the_metrics_are_ready_for_json():
    metrics = measure(trace_of(RECORDS))
    found = json.loads(json.dumps(metrics.to_dict(), allow_nan=False))
    assert found == metrics.to_dict()
    assert list(found)[:3] == ["status", "rounds", "last_bid_round"]
    assert found["dropped"] == {"gap": 2, "stale": 1}


def test_a_run_without_messages_and_visits_has_zeros_and_no_division_by_zero():
    idle = [{**one, "visits": [], "distance": 0.0, "finish": 0.0} for one in PLAN["agents"]]
    plan = {**PLAN, "agents": idle, "unserved": []}
    result = Result(t=0.0, status="not_converged", reason="cut", plan=plan)
    metrics = measure(trace_of((result,)))
    assert (metrics.messages, metrics.bytes, metrics.bytes_per_broadcast) == (0, 0, 0.0)
    assert (metrics.makespan, metrics.total_distance, metrics.gini) == (0.0, 0.0, 0.0)
    assert (metrics.dropped, metrics.winner_changes, metrics.served) == ({}, {}, 0)
    assert (metrics.status, metrics.rounds, metrics.declared_round) == ("not_converged", None, None)


def test_an_agent_that_the_plan_leaves_out_counts_as_one_without_work():
    """Without c in the plan the work is still 25, 6 and 0 s."""
    plan = {**PLAN, "agents": PLAN["agents"][:2]}
    metrics = measure(trace_of((Result(t=0.0, status="converged", plan=plan),)))
    assert metrics.gini == pytest.approx(100 / 186)


def test_a_run_that_was_stopped_has_no_metrics():
    with pytest.raises(InputError, match=r"run\.jsonl: has no result record: the run was stopped"):
        measure(trace_of(RECORDS[:-1]))


def test_a_broken_plan_is_refused_with_the_name_of_the_file():
    with pytest.raises(InputError, match=r"^run\.jsonl: agents"):
        measure(trace_of((Result(t=0.0, status="converged", plan={**PLAN, "agents": 3}),)))


# --- who led


def test_bids_of_one_instant_are_no_change_whatever_their_order():
    bids = [taken(0.0, agent, "t", bid) for agent, bid in (("a", 1.0), ("b", 3.0), ("c", 2.0))]
    assert winner_changes(bids) == winner_changes(bids[::-1]) == {}


def test_among_equal_bids_the_higher_id_leads_in_the_order_of_bytes():
    """z has the bytes 7A, ü C3 BC: ü is higher. So the third record changes nothing, the fourth does."""
    records = [
        taken(0.0, "z", "t", 1.0),
        taken(1.0, "ü", "t", 1.0),
        taken(2.0, "a", "t", 1.0),
        outbid(3.0, "ü", "t", "z"),
    ]
    assert winner_changes(records[:1]) == {}
    assert winner_changes(records[:2]) == winner_changes(records[:3]) == {"t": 1}
    assert winner_changes(records) == {"t": 2}


def test_a_task_that_is_given_up_and_taken_again_changes_only_to_another_agent():
    again = [taken(0.0, "a", "t", 2.0), Released(t=1.0, agent="a", task="t"), taken(2.0, "a", "t", 1.0)]
    assert winner_changes(again) == {}
    other = [*again[:2], taken(2.0, "b", "t", 1.0)]
    assert winner_changes(other) == {"t": 1}


def test_a_lower_bid_of_the_leader_itself_can_hand_over_the_lead():
    """a leads with 5 over b's 3; a's new bid of 2 leaves b in the lead."""
    records = [taken(0.0, "a", "t", 5.0), taken(0.0, "b", "t", 3.0), taken(1.0, "a", "t", 2.0)]
    assert winner_changes(records) == {"t": 1}


# --- inequality


def test_gini_of_known_lists():
    """[1, 3]: pairs differ by 2 twice, 4 / (2 * 4 * 2) = 1/4. One of n with everything: (n - 1) / n."""
    assert gini([1.0, 3.0]) == gini([3.0, 1.0]) == 0.25
    assert gini([0.0, 0.0, 0.0, 0.0, 8.0]) == pytest.approx(4 / 5)
    assert gini([2.0] * 7) == pytest.approx(0.0)
    assert gini([]) == gini([0.0, 0.0]) == gini([5.0]) == 0.0


@given(st.lists(st.integers(0, 1000), min_size=1, max_size=12))
def test_gini_is_the_mean_absolute_difference_over_twice_the_mean(values: list[int]):
    total = sum(values)
    pairs = sum(abs(a - b) for a in values for b in values)
    expected = pairs / (2 * len(values) * total) if total else 0.0
    assert gini([float(value) for value in values]) == pytest.approx(expected, abs=1e-12)


# --- a real run


@pytest.mark.parametrize("mode", ["rounds", "asynchronous"])
def test_the_metrics_of_a_real_run_are_what_the_run_counted(tmp_path: Path, mode: str):
    here = uniform.make(1, agents=8, tasks=40, bundle_limit=4, fuel_per_metre=0.01, duration_max=20.0)
    network = Network(make_topology("ring", 8), seed=2, loss=0.3)
    path = tmp_path / "run.jsonl"
    run = simulate(here, network=network, mode=mode, trace=path)
    metrics = measure(read_trace(path))
    assert run.converged
    assert (metrics.status, metrics.rounds) == (run.status, run.rounds)
    assert (metrics.last_bid_round, metrics.declared_round) == (run.last_bid_round, run.declared_round)
    assert (metrics.messages, metrics.bytes, metrics.entries) == (run.messages, run.bytes, run.entries)
    assert metrics.bytes_per_broadcast == run.bytes / run.messages
    assert metrics.dropped == run.dropped
    assert sum(metrics.dropped.values()) > 0
    assert metrics.lost > 0
    assert (metrics.score, metrics.honest_score) == (run.plan.total_score, run.plan.honest_score)
    assert metrics.total_distance == sum(one.distance for one in run.plan.agents)
    # Bundles of 4 leave at least 40 - 8 * 4 = 8 tasks over; an agent without a base ends with its last one.
    assert (metrics.num_agents, metrics.num_tasks) == (8, 40)
    assert metrics.served == sum(len(path) for path in run.paths.values()) <= 32
    assert metrics.unserved == 40 - metrics.served
    assert metrics.makespan == max(one.finish for one in run.plan.agents)
    assert 0.0 < metrics.gini < 7 / 8
