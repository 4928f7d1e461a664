"""Runs in simulated time: their status, their record, their determinism."""

from __future__ import annotations

import io
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from swarmbid.errors import InputError
from swarmbid.model import Agent, Mission, Task
from swarmbid.network import FixedTopology, Network, Partition, make_topology
from swarmbid.references.sequential_greedy import sequential_greedy
from swarmbid.scenarios import uniform
from swarmbid.simulator import Run, simulate
from swarmbid.verify import verify


def mission(seed: int = 1, **options: object) -> Mission:
    return uniform.make(seed, **{"agents": 8, "tasks": 20, "bundle_limit": 4, **options})


def ring(seed: int = 0, num_agents: int = 8, **faults: object) -> Network:
    return Network(make_topology("ring", num_agents), seed=seed, **faults)  # type: ignore[arg-type]


def recorded(**options: object) -> tuple[Run, list[dict[str, object]]]:
    """Run with a trace; return it with its records."""
    file = io.BytesIO()
    run = simulate(mission(), trace=file, **options)  # type: ignore[arg-type]
    return run, [json.loads(line) for line in file.getvalue().splitlines()]


def test_a_run_converges_to_a_plan_that_can_be_executed():
    run = simulate(mission(), network=ring())
    assert run.status == "converged"
    assert (run.reason, run.disagreements, run.false_agreements) == ("", [], 0)
    assert verify(run.mission, run.plan, run.score) == []


def test_agreement_follows_the_last_bid_and_is_known_within_two_diameters():
    """News crosses a ring of 8 in 4 rounds; that all hold it comes back in 4 more. No quiet rounds."""
    run = simulate(mission(), network=ring())
    assert run.last_bid_round <= run.rounds <= run.last_bid_round + 4
    assert run.declared_round is not None
    assert run.rounds < run.declared_round <= run.rounds + 4 + 1


def test_the_trace_tells_what_the_run_counted():
    run, records = recorded(network=ring(loss=0.2))
    assert records[0]["kind"] == "trace"
    assert records[-1]["kind"] == "result"
    sent = [record for record in records if record["kind"] == "sent"]
    dropped = [record for record in records if record["kind"] == "dropped"]
    assert len(sent) == run.messages
    assert sum(record["bytes"] for record in sent) == run.bytes
    assert sum(record["entries"] for record in sent) == run.entries
    assert len(dropped) == sum(run.dropped.values())
    taken = [record["t"] for record in records if record["kind"] == "taken"]
    assert int(max(taken)) + 1 == run.last_bid_round
    assert sum(record["lost"] for record in sent) > 0


SCRIPT = """
import sys
from swarmbid.network import Network, make_topology
from swarmbid.scenarios import uniform
from swarmbid.simulator import simulate
mission = uniform.make(3, agents=7, tasks=15, bundle_limit=3)
faults = dict(loss=0.3, delay=1.0, duplicate=0.2)
network = Network(make_topology("tree", 7, seed=4), seed=5, **faults)
simulate(mission, network=network, seed=6, mode=sys.argv[2], trace=sys.argv[1])
"""


@pytest.mark.parametrize("mode", ["rounds", "asynchronous"])
def test_one_seed_gives_the_same_bytes_whatever_the_hash_seed(tmp_path: Path, mode: str):
    traces = []
    for hash_seed in ("0", "1", "4242"):
        path = tmp_path / f"{hash_seed}.jsonl"
        environment = {**os.environ, "PYTHONHASHSEED": hash_seed}
        subprocess.run([sys.executable, "-c", SCRIPT, str(path), mode], check=True, env=environment)
        traces.append(path.read_bytes())
    assert traces[0] == traces[1] == traces[2]
    assert len(traces[0].splitlines()) > 100


def test_another_seed_gives_another_run():
    first, _ = recorded(network=ring(seed=1, loss=0.3))
    other, _ = recorded(network=ring(seed=2, loss=0.3))
    assert first.messages != other.messages
    assert first.paths == other.paths  # the agreement is the same all the same


def test_messages_that_go_through_their_bytes_change_nothing():
    """What is rehearsed is what flies: the same trace, record by record."""
    _, direct = recorded(network=ring(loss=0.3, delay=1.0))
    _, encoded = recorded(network=ring(loss=0.3, delay=1.0), through_bytes=True)
    assert direct == encoded


@pytest.mark.parametrize("mode", ["rounds", "asynchronous"])
@pytest.mark.parametrize(
    "faults",
    [
        {"loss": 0.3},
        {"loss": 0.7},
        {"loss": 0.31, "burst": 5.0},
        {"delay": 3.0},
        {"duplicate": 0.5, "replay": 0.1},
        {"loss": 0.2, "delay": 2.0, "duplicate": 0.2, "replay": 0.05},
        {"freeze": ((3.0, 33.0),)},
        {"partitions": (Partition(groups=((0, 1, 2, 3), (4, 5, 6, 7)), start=1.0, end=40.0),)},
    ],
    ids=lambda faults: "-".join(faults),
)
def test_faults_change_how_long_it_takes_and_not_what_is_agreed(mode: str, faults: dict[str, object]):
    """The same allocation as with a central greedy, nobody ever wrong about agreement, no conflict."""
    for seed in range(3):
        here = mission(seed)
        run = simulate(
            here,
            score="time_discounted",
            insertion="hold",
            network=ring(seed, **faults),
            seed=seed,
            mode=mode,
        )
        assert run.converged, run.reason
        assert run.false_agreements == 0
        assert run.paths == sequential_greedy(here, "time_discounted", insertion="hold").paths


@pytest.mark.parametrize(
    ("loss", "burst", "factor"), [(0.3, None, 1.43), (0.7, None, 3.34), (0.31, 5.0, 3.0)]
)
def test_rounds_under_loss_stay_within_twice_what_the_loss_explains(loss, burst, factor):
    """2 * T0 / (1 - p) for independent losses, 6 * T0 for bursts; T0 is the worst run without loss."""
    lossless = max(simulate(mission(seed), network=ring()).rounds for seed in range(8))
    worst = max(
        simulate(mission(seed), network=ring(seed, loss=loss, burst=burst)).rounds for seed in range(8)
    )
    assert worst <= 2 * factor * lossless


def test_a_network_in_pieces_does_not_converge_and_says_so():
    """Two pairs. Each pair agrees with itself; the tasks are planned twice but counted once."""
    network = Network(FixedTopology([(1,), (0,), (3,), (2,)]))
    here = mission(agents=4, tasks=6)
    run = simulate(here, network=network)
    assert run.status == "not_converged"
    assert run.reason == "the network is in 2 pieces that cannot hear each other"
    assert run.declared_round is None
    tasks = [entry["task"] for entry in run.disagreements]
    assert tasks == sorted(tasks) and tasks
    for entry in run.disagreements:
        camps = [set(camp["agents"]) for camp in entry["beliefs"]]
        assert set().union(*camps) == {agent.id for agent in here.agents}
    planned = [task for path in run.paths.values() for task, _ in path]
    assert len(planned) == len(set(planned))
    complete = simulate(here)
    assert run.plan.total_score <= complete.plan.total_score


def test_too_few_rounds_end_as_not_converged():
    """A ring of 8 needs 4 rounds for news to arrive anywhere: after 2 the beliefs differ."""
    run = simulate(mission(), network=ring(), max_rounds=2)
    assert run.status == "not_converged"
    assert run.reason == "the beliefs still differed after 2 rounds"
    assert run.disagreements


def test_nobody_and_nothing_are_missions_too():
    place = (0.0, 0.0, 0.0)
    agent, task = Agent(id="a", position=place), Task(id="t", position=place)
    nobody = simulate(Mission(agents=(), tasks=(task,)))
    assert (nobody.status, nobody.paths, nobody.rounds) == ("converged", {}, 0)
    assert [left.task for left in nobody.plan.unserved] == ["t"]
    nothing = simulate(Mission(agents=(agent,), tasks=()))
    assert (nothing.status, nothing.paths) == ("converged", {"a": []})
    one = simulate(Mission(agents=(agent,), tasks=(task,)))
    assert (one.status, one.paths, one.rounds) == ("converged", {"a": [("t", 0.0)]}, 1)


def test_reception_stamps_give_the_same_result_in_rounds():
    for seed in range(5):
        here = mission(seed)
        run = simulate(here, network=ring(), stamps="reception", full_every=1, idle_every=1)
        assert run.converged
        assert run.paths == simulate(here, network=ring()).paths


def test_the_classic_way_of_talking_reaches_the_same_plan_with_more_bytes():
    """Full states in every period, as in the papers, against changes only."""
    classic = simulate(mission(), network=ring(), full_every=1, idle_every=1)
    ours = simulate(mission(), network=ring())
    assert classic.paths == ours.paths
    assert classic.rounds == ours.rounds
    assert ours.bytes < classic.bytes


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"algorithm": "cbbaa"}, "there is no algorithm 'cbbaa'. Did you mean 'cb"),
        ({"score": "time"}, "there is no score 'time'"),
        ({"mode": "turns"}, "mode: is 'turns'. Choose one of: rounds, asynchronous."),
        ({"insertion": "push"}, "insertion: is 'push'. Choose one of: hold, shift, append."),
        ({"network": ring(num_agents=5)}, "is for 5 agents, the mission has 8"),
        ({"patience": 3}, "patience"),
        ({"period": 0.0}, "period"),
        ({"stamps": "wall"}, "stamps: is 'wall'"),
    ],
)
def test_what_cannot_be_run_is_refused_with_the_mend(options: dict[str, object], says: str):
    with pytest.raises(InputError) as caught:
        simulate(mission(), **options)  # type: ignore[arg-type]
    assert says in str(caught.value)


def test_a_mission_that_needs_groups_or_an_order_is_refused_not_botched():
    here = (0.0, 0.0, 0.0)
    tasks = (
        Task(id="lift", position=here, agents_required=2),
        Task(id="dig", position=here),
        Task(id="lay", position=here, prerequisites=("dig",)),
    )
    agents = (Agent(id="a", position=here), Agent(id="b", position=here))
    with pytest.raises(InputError) as caught:
        simulate(Mission(agents=agents, tasks=tasks))
    assert [fault.why for fault in caught.value.faults] == [
        "cannot: task lift needs more than one agent",
        "cannot: task lay needs other tasks done first",
    ]


def test_cbaa_gives_each_agent_one_task_at_most():
    for seed in range(5):
        here = mission(seed, agents=5, tasks=7)
        run = simulate(here, algorithm="cbaa", network=ring(num_agents=5))
        assert run.converged
        assert all(len(path) <= 1 for path in run.paths.values())
        assert sum(len(path) for path in run.paths.values()) == 5
