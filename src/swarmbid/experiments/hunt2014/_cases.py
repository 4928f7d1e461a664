"""What is run: experiments of the paper, each by two algorithms, and what is taken down of a run."""

from __future__ import annotations

import io
import time
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise, zip_longest
from typing import Any

from swarmbid.experiments._cleanliness import judge_state
from swarmbid.model import Mission
from swarmbid.network import Network, make_topology
from swarmbid.rng import stream
from swarmbid.scenarios import hunt2014
from swarmbid.scores import make_score
from swarmbid.simulator import Run, simulate
from swarmbid.trace import Outbid, Released, Sent, Taken, read_trace
from swarmbid.verify import verify

Paths = Mapping[str, Sequence[str]]
"""Agent id -> task ids in order of doing."""

SCORE = make_score("distance_cost")
"""What agents bid by: eq. (7), a metre and a second of service cost 1 each."""
INSERTION = "shift"
"""Eq. (1): a task goes wherever the whole path gains most; later visits may slip."""
TASKS = 20
AT_ONCE = 1e-6
"""s from sending to arrival where agents act in turn."""
JUDGED = "fours"
"""The experiment whose final states are judged: Fig. 7's."""
PATIENCE = 100
"""Rounds after which a negotiation that has not settled is given up (those that settle need far fewer)."""


@dataclass(frozen=True)
class Experiment:
    """One of the paper's experiments.

    Parameters
    ----------
    title : for legends. options : of the scenario.
    """

    title: str
    options: Mapping[str, Any]


EXPERIMENTS = {
    "single": Experiment("one agent a task", {"agents_required": 1}),
    "pairs": Experiment("two agents a task", {"agents_required": 2}),
    "mix": Experiment("ten of each", {"family": "mixed", "agents_required": 2}),
    "fours": Experiment("four agents a task", {"agents_required": 4}),
    "kits_1": Experiment("#1: A, B", {"family": "a_b"}),
    "kits_2": Experiment("#2: A, B, AB", {"family": "a_b_ab"}),
    "kits_3": Experiment("#3: A, AB, ABC", {"family": "a_ab_abc"}),
    "follow_2": Experiment("#2: follow-ups", {"family": "follow_up"}),
    "follow_3": Experiment("#3: follow-ups at any time", {"family": "follow_up_open"}),
}
"""Name -> experiment. Fig. 10's first is "pairs"."""

MODES: dict[str, dict[str, bool]] = {
    "base": {"quitting": False, "team_rewards": False},
    "quitting": {"quitting": True, "team_rewards": False},
    "team": {"quitting": False, "team_rewards": True},
    "both": {"quitting": True, "team_rewards": True},
}
"""Fig. 7's four ways to run CBGA. The other figures are run with neither, for the paper introduces both
after them (Figs. 3 to 6) or does not mention them (Figs. 8 to 11)."""


@dataclass(frozen=True)
class Variant:
    """An algorithm with options, as it appears in a column of the page."""

    title: str
    algorithm: str
    options: Mapping[str, Any] = field(default_factory=dict)


VARIANTS = {
    "literal": Variant("literal", "cbga_printed", {"reading": "literal", "warp": False}),
    "printed": Variant(
        "printed", "cbga_printed", {"reading": "charitable", "warp": True, "release_late": True}
    ),
    "repaired": Variant("repaired", "cbga", {"dissolve": 0.5}),
}
"""Column -> algorithm. Tasks for one agent are CBBA's ("Consensus from CBBA"): see `algorithm_of`."""
PLAIN = Variant("CBBA", "cbba")


@dataclass(frozen=True, order=True)
class Point:
    """A place in a figure: one algorithm, one experiment, one number of agents.

    Parameters
    ----------
    variant, experiment, mode : keys of `VARIANTS`, `EXPERIMENTS`, `MODES`.
    tasks : how many. timed : whether to measure the computing time, and nothing that would add to it.
    in_turn : whether agents act one after the other, each with all that was said before it, not in rounds.
    """

    variant: str
    experiment: str
    agents: int
    mode: str = "base"
    tasks: int = TASKS
    timed: bool = False
    in_turn: bool = False


@dataclass(frozen=True)
class Step:
    """What was said in one round: messages, and the entries and bytes in them."""

    messages: int
    entries: int
    bytes: int


@dataclass(frozen=True)
class Outcome:
    """What is taken down of one run.

    Parameters
    ----------
    score : rewards of the seats of completed tasks, less the metres flown.
    completed : tasks. settled : whether all agents came to know that they agree.
    sound : whether `verify` found nothing wrong with the plan.
    clean : whether the agents' own state could be executed (`_cleanliness.judge_state`): at rest, agreed, no
        seat too many or too few, equipment and prerequisites met, no waiting in a circle, no window missed.
        Judged for `JUDGED` only.
    changes : once for each agent and round, a change of its beliefs: a broadcast of something new.
    own : the same of its own bundle alone.
    sent : broadcasts in all, those included that settle whether all agree. bytes, entries : of these.
    rounds : until beliefs stayed equal.
    together : share of the tasks done in a group after which the whole group goes on to its next task
        together; None if there was no such task.
    seconds : of computing, 0 unless it was measured.
    steps : what was said round by round.
    """

    score: float
    completed: int
    settled: bool
    sound: bool
    clean: bool
    changes: int
    own: int
    sent: int
    bytes: int
    entries: int
    rounds: int
    together: float | None
    seconds: float
    steps: tuple[Step, ...]


def algorithm_of(point: Point) -> tuple[str, dict[str, Any]]:
    """Return the name of the algorithm and its options."""
    variant = VARIANTS[point.variant]
    if point.experiment == "single" and point.variant == "repaired":
        return PLAIN.algorithm, dict(PLAIN.options)
    return variant.algorithm, {**variant.options, **MODES[point.mode]}


def mission_of(point: Point, run: int, seed: int) -> Mission:
    """Make the mission of one run.

    Runs of one number share positions, windows and durations over all experiments and algorithms, so
    that differences between these are not differences of luck.
    """
    drawn = int(stream(seed, "hunt2014", "mission", run).integers(2**31))
    options = EXPERIMENTS[point.experiment].options
    return hunt2014.make(drawn, agents=point.agents, tasks=point.tasks, **options)


def negotiate(point: Point, run: int, seed: int, trace: io.BytesIO | None = None) -> Run:
    """Let the agents of one run negotiate."""
    algorithm, options = algorithm_of(point)
    network = None
    if point.in_turn:
        # What is said arrives before the next agent acts; phases within a round are drawn for each run.
        network = Network(make_topology("complete", point.agents), latency=AT_ONCE)
    return simulate(
        mission_of(point, run, seed), algorithm=algorithm, score=SCORE, insertion=INSERTION,
        network=network, seed=run, mode="asynchronous" if point.in_turn else "rounds", trace=trace,
        max_rounds=None if algorithm == PLAIN.algorithm else PATIENCE, **options,
    )  # fmt: skip


def play(point: Point, run: int, seed: int) -> Outcome:
    """Run once and take down what the figures need."""
    record = None if point.timed else io.BytesIO()
    began = time.process_time()
    done = negotiate(point, run, seed, record)
    seconds = time.process_time() - began if point.timed else 0.0
    paths = {one.agent_id: [task_id for task_id, _ in one.path] for one in done.negotiators}
    completed = completed_tasks(done.mission, paths)
    own, steps = (0, ()) if record is None else _said(record, done.rounds)
    return Outcome(
        score=paid(done.mission, paths, completed),
        completed=len(completed),
        settled=done.converged,
        sound=not verify(done.mission, done.plan, done.score),
        clean=point.experiment == JUDGED and judge_state(done.negotiators, done.mission)["clean"],
        changes=done.changes,
        own=own,
        sent=done.messages,
        bytes=done.bytes,
        entries=done.entries,
        rounds=done.rounds,
        together=together(paths),
        seconds=seconds,
        steps=steps,
    )


def completed_tasks(mission: Mission, paths: Paths) -> set[str]:
    """Return the tasks with a complete group: enough agents, all equipment, prerequisites completed.

    Parameters
    ----------
    paths : of the agents as they see them, be they agreed or not.
    """
    members: dict[str, set[str]] = {}
    for agent_id, path in paths.items():
        for task_id in path:
            members.setdefault(task_id, set()).add(agent_id)
    carried = {agent.id: agent.equipment for agent in mission.agents}
    formed = {
        task.id
        for task in mission.tasks
        if len(members.get(task.id, ())) >= task.agents_required
        and task.equipment <= frozenset().union(*(carried[one] for one in members[task.id]))
    }
    tasks = {task.id: task for task in mission.tasks}
    done: set[str] = set()
    while True:
        found = {name for name in formed if done >= set(tasks[name].prerequisites)}
        if found == done:
            return done
        done = found


def paid(mission: Mission, paths: Paths, completed: set[str]) -> float:
    """Return the paper's score: each seat of a completed task pays its reward; every metre costs 1."""
    places = {task.id: task.position for task in mission.tasks}
    metres = 0.0
    for agent in mission.agents:
        stops = [agent.position, *(places[task_id] for task_id in paths[agent.id])]
        metres += sum(mission.distance(here, there) for here, there in pairwise(stops))
    return sum(task.reward * task.agents_required for task in mission.tasks if task.id in completed) - metres


def together(paths: Paths) -> float | None:
    """Return the share of group tasks after which the whole group goes on to the same next task.

    Counted over tasks of two or more agents after which at least one of them has another task.
    """
    following: dict[str, dict[str, str | None]] = {}
    for agent_id, path in paths.items():
        for task, after in zip_longest(path, path[1:]):
            following.setdefault(task, {})[agent_id] = after
    groups = [set(after.values()) for after in following.values() if len(after) > 1]
    asked = [found for found in groups if found != {None}]
    return sum(len(found) == 1 for found in asked) / len(asked) if asked else None


def _said(record: io.BytesIO, rounds: int) -> tuple[int, tuple[Step, ...]]:
    """Return how often own bundles changed, and what was said in each round while beliefs changed."""
    record.seek(0)
    trace = read_trace(record)
    said: list[Counter[str]] = [Counter() for _ in range(rounds)]
    for message in trace.of(Sent):
        if message.t < rounds:
            said[int(message.t)].update(messages=1, entries=message.entries, bytes=message.bytes)
    own = {(event.agent, event.t) for event in trace.records if isinstance(event, Taken | Outbid | Released)}
    return len(own), tuple(Step(one["messages"], one["entries"], one["bytes"]) for one in said)


def outcomes(points: Iterable[Point], run: int, seed: int) -> list[tuple[Point, Outcome]]:
    """Play one run at each of several points; what a worker does at a time."""
    return [(point, play(point, run, seed)) for point in points]
