"""Why a task went to whom it went, on missions small enough to know the answer."""

from __future__ import annotations

import dataclasses
import io
import json
from pathlib import Path
from typing import Any

import pytest

from generators import random_mission
from swarmbid import unserved
from swarmbid.errors import InputError
from swarmbid.missionfile import mission_to_dict
from swarmbid.model import Agent, Mission, Task
from swarmbid.network import Network, make_topology
from swarmbid.plan import make_plan
from swarmbid.references.sequential_greedy import sequential_greedy
from swarmbid.scores import make_score
from swarmbid.simulator import simulate
from swarmbid.trace import Header, Released, Result, Taken, Trace, read_trace
from swarmbid.why import Explanation, Step, explain

CAMERA = frozenset({"camera"})


def agent(id: str, x: float, y: float, **options: Any) -> Agent:
    """At 1 m/s, with a camera, at 0.1 score units a metre."""
    return Agent(id=id, position=(x, y, 0.0), **{"equipment": CAMERA, "fuel_per_metre": 0.1, **options})


# Everybody can be asked about "photo", which pays 20 at (100, 0) until 100 s.
SITE = Mission(
    agents=(
        agent("near", 90.0, 0.0),  # 10 m: bids 20 - 0.1 * 10 = 19
        agent("further", 100.0, -40.0),  # 40 m: bids 20 - 0.1 * 40 = 16
        agent("dear", 100.0, -90.0, fuel_per_metre=1.0),  # 90 m: 20 - 90 = -70
        agent("busy", 0.0, 0.0, bundle_limit=1, type="all"),  # prefers "hole", which pays 50 where it is
        agent("digger", 100.0, 1.0, type="digger"),
        agent("blind", 100.0, 1.0, equipment=frozenset()),
        agent("late", 100.0, 500.0),  # 500 m at 1 m/s, 400 s after the window
        agent("short", 100.0, 50.0, range=60.0, base=(100.0, 50.0, 0.0)),  # 50 m there, 50 m back
    ),
    tasks=(
        Task(
            id="photo", type="photo", position=(100.0, 0.0, 0.0),
            reward=20.0, end=100.0, duration=5.0, equipment=CAMERA,
        ),
        Task(id="hole", type="hole", position=(0.0, 0.0, 0.0), reward=50.0),
        Task(id="lift", type="photo", position=(0.0, 0.0, 0.0), equipment=frozenset({"crane"})),
    ),
    compatible={"digger": frozenset({"pit"}), "agent": frozenset({"photo"})},
)  # fmt: skip

# "second" pays r only on the way to "first", which v takes from it.
CHAIN = Mission(
    agents=(
        agent("r", 0.0, 0.0, fuel_per_metre=0.5),
        agent("v", 100.0, 20.0, fuel_per_metre=0.5, type="digger"),
    ),
    tasks=(
        Task(id="first", type="hole", position=(100.0, 10.0, 0.0), reward=100.0),
        Task(id="second", type="photo", position=(100.0, 0.0, 0.0), reward=20.0),
    ),
    compatible={"digger": frozenset({"hole"})},
)

# p's gain for "second" is 20 - 0.5 * 10 = 15 after "first", but "first" gained 60 - 0.5 * 100 = 10 only.
RISING = Mission(
    agents=(
        agent("p", 0.0, 0.0, fuel_per_metre=0.5),
        agent("q", 110.0, 16.0, fuel_per_metre=0.5, type="photographer"),  # bids 20 - 0.5 * 16 = 12
    ),
    tasks=(
        Task(id="first", type="hole", position=(100.0, 0.0, 0.0), reward=60.0),
        Task(id="second", type="photo", position=(110.0, 0.0, 0.0), reward=20.0),
    ),
    compatible={"photographer": frozenset({"photo"})},
)


def traced(tmp_path: Path, mission: Mission, **options: Any) -> Trace:
    path = tmp_path / "run.jsonl"
    simulate(mission, trace=path, **options)
    return read_trace(path)


def others(explanation: Explanation) -> dict[str, str]:
    return {other.agent: other.why for other in explanation.others}


def test_the_winner_its_bid_and_its_start_are_named(tmp_path: Path):
    found = explain(traced(tmp_path, SITE), "photo")
    assert (found.task, found.winner, found.bid, found.start) == ("photo", "near", 19.0, 10.0)
    assert found.outcome == "Done by near, from 10 s; its bid of 19 won."
    assert found.needs == "type photo, reward 20, start of service 0 to 100 s, 5 s of service, needs camera"


def test_the_history_tells_who_bid_and_who_was_outbid_by_whom_with_what(tmp_path: Path):
    """All bid at 0 s, in order of id; the messages arrive for the next round, at 1 s."""
    assert explain(traced(tmp_path, SITE), "photo").history == (
        Step(0.0, "further", "bids 16 (as stop 1)"),
        Step(0.0, "near", "bids 19 (as stop 1)"),
        Step(1.0, "further", "is outbid by near with 19 (had bid 16)"),
    )


def test_each_of_the_others_has_its_reason(tmp_path: Path):
    found = explain(traced(tmp_path, SITE), "photo")
    assert others(found) == {
        "blind": "it carries no camera",
        "busy": "its bundle is full with 1 tasks",
        "dear": "as stop 1 it would gain -70: not worth a bid",
        "digger": "its type, digger, does no photo tasks",
        "further": "as stop 1 it would gain 16, less than the bid of 19; it once bid 16",
        "late": "it would be 400 s late even doing nothing else",
        "short": "it cannot fly there and back even doing nothing else",
    }
    assert [other.agent for other in found.others] == sorted(others(found))
    numbers = {other.agent: (other.best_bid, other.gain) for other in found.others}
    assert numbers["further"] == (16.0, 16.0)
    assert numbers["dear"] == (None, -70.0)
    assert numbers["late"] == (None, None)


def test_a_task_that_an_agent_gives_up_says_which_loss_made_it(tmp_path: Path):
    """The way by "second" to "first" is 110 m instead of sqrt(100^2 + 10^2) = 100.498756 m.

    So it gains 20 - 0.5 * 9.501244 = 15.2494, as stop 1; alone it would gain 20 - 0.5 * 100 = -30.
    """
    trace = traced(tmp_path, CHAIN, insertion="shift")
    found = explain(trace, "second")
    assert found.history == (
        Step(0.0, "r", "bids 15.2494 (as stop 1)"),
        Step(1.0, "r", "gives it up, having lost first"),
    )
    assert others(found)["r"] == "as stop 1 it would gain -30: not worth a bid; it once bid 15.2494"
    assert (found.winner, found.bid, found.start) == (None, None, None)
    assert found.outcome.startswith("Done by nobody (no_gain). The best offer left, by r, is -30;")
    # 100 - 0.5 * 100.498756 = 49.7506 for r against 100 - 0.5 * 10 = 95 for v.
    assert explain(trace, "first").history[-1] == Step(1.0, "r", "is outbid by v with 95 (had bid 49.7506)")


def test_a_task_that_is_given_up_without_a_loss_says_so_too(tmp_path: Path):
    trace = traced(tmp_path, SITE)
    released = Released(t=1.0, agent="near", task="photo")
    trace = dataclasses.replace(trace, records=(released, *trace.records))
    assert explain(trace, "photo").history[0] == Step(1.0, "near", "gives it up for a better bundle")


def test_an_unserved_task_says_why_and_has_no_history(tmp_path: Path):
    found = explain(traced(tmp_path, SITE), "lift")
    assert (found.winner, found.bid, found.start, found.history) == (None, None, None, ())
    assert found.outcome == (
        "Done by nobody (no_capable_agent). It needs crane; no agent that may do it carries all of that."
    )
    assert others(found)["near"] == "it carries no crane"
    assert len(found.others) == len(SITE.agents)


def test_a_gain_above_the_bid_that_won_is_explained_by_the_rule_that_bids_never_rise(tmp_path: Path):
    found = explain(traced(tmp_path, RISING), "second")
    assert (found.winner, found.bid) == ("q", 12.0)
    assert others(found)["p"] == (
        "as stop 2 it would gain 15, more than the bid of 12,"
        " but with what it has taken it may bid 10 at most (bids never rise); it once bid 10"
    )
    unwarped = explain(traced(tmp_path, RISING, warp=False), "second")
    assert (unwarped.winner, unwarped.bid) == ("p", 15.0)


def test_without_warping_a_higher_gain_is_not_blamed_on_it(tmp_path: Path):
    """The run was warped; its header is made to say that it was not."""
    trace = traced(tmp_path, RISING)
    header = trace.header
    bare = type(header)(
        swarmbid=header.swarmbid, mission=header.mission, algorithm=header.algorithm,
        options={**header.options, "warp": False}, score=header.score,
    )  # fmt: skip
    found = explain(dataclasses.replace(trace, header=bare), "second")
    assert others(found)["p"] == "as stop 2 it would gain 15, more than the bid of 12; it once bid 10"


@pytest.mark.parametrize(
    ("insertion", "says"),
    [
        # "mid" lies on p's way to "first": no metre more. Behind it, 50 m back: 20 - 0.5 * 50 = -5.
        ("shift", "as stop 1 it would gain 20, more than the bid of 18,"),
        ("append", "as stop 2 it would gain -5: not worth a bid"),
    ],
)
def test_offers_follow_the_insertion_rule_of_the_run(tmp_path: Path, insertion: str, says: str):
    """q, 4 m away, bids 20 - 0.5 * 4 = 18; p bids its 10 for "first" at most."""
    q = agent("q", 50.0, 4.0, fuel_per_metre=0.5, type="photographer")
    mid = Task(id="mid", type="photo", position=(50.0, 0.0, 0.0), reward=20.0)
    mission = dataclasses.replace(RISING, agents=(RISING.agents[0], q), tasks=(RISING.tasks[0], mid))
    found = explain(traced(tmp_path, mission, insertion=insertion), "mid")
    assert (found.winner, found.bid) == ("q", 18.0)
    assert others(found)["p"].startswith(says)


def test_equal_offers_are_called_equal(tmp_path: Path):
    """Both stand 10 m away; among equal bids the higher id wins."""
    task = Task(id="t", position=(0.0, 0.0, 0.0), reward=3.0)
    twins = Mission(agents=(agent("a", 10.0, 0.0), agent("b", -10.0, 0.0)), tasks=(task,))
    found = explain(traced(tmp_path, twins), "t")
    assert found.winner == "b"
    assert others(found) == {"a": "as stop 1 it would gain 2, as much as the bid of 2; it once bid 2"}


def test_the_text_lists_it_all_in_columns(tmp_path: Path):
    lines = str(explain(traced(tmp_path, SITE), "photo")).splitlines()
    assert lines[0].startswith("photo: type photo, reward 20, ")
    assert lines[1:4] == ["Done by near, from 10 s; its bid of 19 won.", "", "What happened"]
    assert lines[4] == "  round 1  further bids 16 (as stop 1)"
    assert lines[6] == "  round 2  further is outbid by near with 19 (had bid 16)"
    assert lines[8] == "The others, given what they do in the end"
    assert lines[9] == "  blind    it carries no camera"
    assert len(lines) == 9 + 7


def test_an_asynchronous_run_is_told_in_seconds(tmp_path: Path):
    found = explain(traced(tmp_path, CHAIN, mode="asynchronous", seed=3), "second")
    assert not found.in_rounds
    first = found.history[0]
    assert f"  {first.t:.6g} s" in str(found)
    assert "round" not in str(found)


@pytest.mark.parametrize(
    ("window", "says"),
    [
        ({}, "type task, reward 1"),
        ({"start": 5.0}, "type task, reward 1, not before 5 s"),
        ({"start": 5.0, "end": 9.5}, "type task, reward 1, start of service 5 to 9.5 s"),
        ({"equipment": frozenset({"b", "a"})}, "type task, reward 1, needs a, b"),
    ],
)
def test_what_a_task_needs_is_said_in_words(tmp_path: Path, window: dict[str, Any], says: str):
    one = Mission(agents=(), tasks=(Task(id="t", position=(0.0, 0.0, 0.0), **window),))
    assert explain(traced(tmp_path, one), "t").needs == says


def lift(seats: int) -> Trace:
    """p bids 8 for the lift, q 6; they do it together at 20 s. r, 40 m away at 0.1 a metre, could gain 6."""
    here = (0.0, 0.0, 0.0)
    mission = Mission(
        agents=(agent("p", 0.0, 0.0), agent("q", 0.0, 20.0), agent("r", 0.0, 40.0)),
        tasks=(
            Task(id="dig", position=here),
            Task(
                id="lift", position=here, reward=10.0, agents_required=seats, equipment=CAMERA,
                prerequisites=("dig",),
            ),
        ),
    )  # fmt: skip
    paths = {"p": [("dig", 0.0), ("lift", 20.0)], "q": [("lift", 20.0)]}
    plan = make_plan(mission, paths, make_score("time_window"), "hand", "shift")
    taken = [
        Taken(t=0.0, agent=name, task="lift", bid=bid, position=0, start=20.0)
        for name, bid in (("p", 7.0), ("q", 6.0), ("p", 8.0))
    ]
    header = Header(
        swarmbid="0", mission=mission_to_dict(mission), algorithm="hand", score={"name": "time_window"}
    )
    return Trace("hand", header, (*taken, Result(t=1.0, status="converged", plan=plan.to_dict())))


def test_a_group_is_named_with_its_bids():
    """The lowest of them is what another member would have to beat."""
    found = explain(lift(seats=2), "lift")
    assert (found.winner, found.bid, found.start) == ("p, q", 6.0, 20.0)
    assert found.outcome == "Done by p, q together, from 20 s; their bids of 8, 6 won."
    assert found.needs == "type task, reward 10, needs camera, 2 agents, after dig"
    assert others(found) == {"r": "as stop 1 it would gain 6, as much as the bid of 6"}
    assert explain(lift(seats=0), "lift").needs.endswith("as many agents as bring that, after dig")


def test_of_agents_that_each_mean_to_do_it_alone_one_is_named():
    assert explain(lift(seats=1), "lift").outcome == "Done by p, from 20 s; its bid of 8 won."


def test_the_dictionary_goes_through_json_unchanged(tmp_path: Path):
    trace = traced(tmp_path, SITE)
    for task in SITE.tasks:
        found = explain(trace, task.id)
        data = json.loads(json.dumps(found.to_dict(), allow_nan=False))
        assert list(data) == [field.name for field in dataclasses.fields(Explanation)]
        assert data["winner"] == found.winner
        assert [Step(**step) for step in data["history"]] == list(found.history)
        assert [other["why"] for other in data["others"]] == list(others(found).values())


# --- what cannot be explained


def test_an_unknown_task_is_refused_with_the_nearest_name(tmp_path: Path):
    trace = traced(tmp_path, SITE)
    with pytest.raises(InputError) as caught:
        explain(trace, "foto")
    assert str(caught.value) == f"{trace.source}: task: has no task 'foto'. Did you mean 'photo'?"
    with pytest.raises(InputError, match=r"has no task 'zzz'. It has 3 tasks; the plan lists them."):
        explain(trace, "zzz")


def test_a_run_that_was_stopped_cannot_be_explained(tmp_path: Path):
    trace = traced(tmp_path, SITE)
    trace = dataclasses.replace(trace, records=trace.records[:-1])
    with pytest.raises(InputError, match="has no result record"):
        explain(trace, "photo")


def test_that_the_agents_did_not_agree_is_said(tmp_path: Path):
    path = tmp_path / "cut_short.jsonl"
    network = Network(make_topology("line", len(SITE.agents)))
    simulate(SITE, network=network, max_rounds=1, trace=path)
    found = explain(read_trace(path), "photo")
    assert found.outcome.endswith("But the agents did not agree: the beliefs still differed after 1 rounds.")


@pytest.mark.parametrize(
    ("score", "says"),
    [
        ({}, "score: has no name. Run it again"),
        ({"name": "custom", "source": ""}, "unasked. Give that score, if you trust it: --score FILE.py."),
        ({"name": "custom", "source": "a.py"}, "if you trust it: --score a.py."),
        ({"name": "a.py"}, "which is not run unasked."),
        ({"name": "lost_since"}, "there is no score 'lost_since'"),
    ],
)  # fmt: skip
def test_a_score_that_cannot_be_had_is_refused(tmp_path: Path, score: dict[str, Any], says: str):
    path = tmp_path / "run.jsonl"
    traced(tmp_path, SITE)
    first, *rest = path.read_text().splitlines(keepends=True)
    path.write_text(json.dumps({**json.loads(first), "score": score}) + "\n" + "".join(rest))
    with pytest.raises(InputError) as caught:
        explain(read_trace(path), "photo")
    assert says in str(caught.value)


def test_a_score_of_ones_own_is_given_again_and_then_explained_by(tmp_path: Path):
    def score(visit: Any) -> float:
        return 3.0 * visit.reward

    trace = traced(tmp_path, SITE, score=make_score(score))
    with pytest.raises(InputError, match="not run unasked"):
        explain(trace, "photo")
    found = explain(trace, "photo", score=make_score(score))
    assert found.winner is not None


def test_a_path_too_long_to_try_every_place_is_said_to_be(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(unserved, "MOST_STEPS", 0)
    found = explain(traced(tmp_path, SITE), "photo")
    assert others(found)["further"] == "not examined: there are too many places; it once bid 16"


# --- on random missions


def random_trace(tmp_path: Path, seed: int, fuel: str, insertion: str) -> tuple[Mission, Trace]:
    mission = random_mission(seed, ties=seed % 2 == 1, agents=(2, 5), tasks=(4, 10))
    network = Network(make_topology("ring", len(mission.agents)), seed=seed, loss=0.2)
    score = make_score("time_discounted", fuel=fuel)
    trace = traced(tmp_path, mission, score=score, insertion=insertion, network=network)
    assert trace.finished().status == "converged"
    return mission, trace


def test_with_diminishing_gains_no_other_could_gain_more_than_the_bid_that_won(tmp_path: Path, effort: int):
    """Else it would have bid: what it could add to its final path it could add before, for no less.

    The winner and its bid are those of the central greedy; the bid is the last that the winner made.
    """
    compared = 0
    for seed in range(20 * effort):
        mission, trace = random_trace(tmp_path, seed, "start", "hold")
        greedy = sequential_greedy(mission, make_score("time_discounted", fuel="start"), insertion="hold")
        for task in mission.tasks:
            found = explain(trace, task.id)
            assert (found.winner, found.bid) == greedy.bids.get(task.id, (None, None))
            assert len(found.others) == len(mission.agents) - (found.winner is not None)
            bids = [step for step in found.history if step.agent == found.winner]
            if found.winner is not None:
                assert bids[-1].what.startswith(f"bids {found.bid:.6g} ")
            for other in found.others:
                if other.gain is not None:
                    # 1e-9 for the rounding of sums; what nobody won is worth a bid to nobody.
                    assert other.gain <= (found.bid or 0.0) + 1e-9, (seed, task.id, other)
                    compared += 1
    assert compared > 100


@pytest.mark.parametrize("insertion", ["shift", "hold", "append"])
def test_with_rising_gains_more_than_the_bid_that_won_has_its_reason(
    tmp_path: Path, insertion: str, effort: int
):
    for seed in range(20 * effort):
        mission, trace = random_trace(tmp_path, seed, "path", insertion)
        for task in mission.tasks:
            for other in explain(trace, task.id).others:
                assert ("more than" in other.why) == ("bids never rise" in other.why), (seed, other)


def test_it_says_that_an_incomplete_group_was_dissolved():
    """Two agents, three seats wanted at `lift`: each that had bid on it quits, and that is told once."""
    mission = Mission(
        agents=tuple(Agent(id=name, position=(0.0, 0.0, 0.0)) for name in ("a", "b")),
        tasks=(
            Task(id="far", position=(90.0, 0.0, 0.0), reward=100.0, agents_required=2, end=1.0),
            Task(id="lift", position=(5.0, 0.0, 0.0), reward=100.0, agents_required=2, end=4.0),
            Task(id="pair", position=(3.0, 0.0, 0.0), reward=50.0, agents_required=2),
        ),
    )
    slow = dataclasses.replace(mission.agents[0], speed=2.0)
    trace_file = io.BytesIO()
    mission = dataclasses.replace(mission, agents=(slow, mission.agents[1]))
    simulate(mission, algorithm="cbga", score="distance_cost", trace=trace_file)
    trace_file.seek(0)
    said = str(explain(read_trace(trace_file), "lift"))
    assert said.count("a quits: with 1 in it, its group is not complete") == 1
    assert "gives it up" not in said
