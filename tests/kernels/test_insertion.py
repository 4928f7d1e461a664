"""The insertion kernel against the slow twin: every task at every place of a random path."""

from __future__ import annotations

import dataclasses
import random

import numpy as np
import pytest

from generators import random_mission
from naive import SCORES, Judge, Path
from swarmbid.arrays import MissionArrays
from swarmbid.kernels import insertion
from swarmbid.kernels.lanes import BLOCK
from swarmbid.model import Agent, Mission, Task
from swarmbid.scores import Score, make_score

RULES = {"hold": insertion.HOLD, "shift": insertion.SHIFT, "append": insertion.APPEND}
SEEDS = 36


def score_named(label: str) -> Score:
    """The built-in score that `naive.SCORES[label]` is the twin of."""
    name, _, option = label.partition(" ")
    return make_score(name, **dict([option.split("=")] if option else []))


def random_path(judge: Judge, rng: random.Random) -> Path:
    """A path that the rule allows, grown by insertions at random places."""
    path: Path = []
    for task_id in rng.sample(sorted(judge.tasks), k=rng.randint(0, len(judge.tasks))):
        places = list(range(len(path) + 1))
        rng.shuffle(places)
        for place in places:
            longer = judge.insert(path, place, judge.tasks[task_id])
            if longer is not None:
                path = longer
                break
    return path


class KernelView:
    """The arrays of one agent on one path, and what the kernel says about them."""

    def __init__(self, mission: Mission, agent: Agent, score: Score, rule: str, path: Path) -> None:
        self.arrays = arrays = MissionArrays(mission)
        length = len(path)
        table = arrays.task_table(agent, score, lambda table: score.fill(table, arrays))
        vector = arrays.agent_vector(agent, score.cost_per_metre(agent))
        rows = np.array([arrays.task_row[task_id] for task_id, _ in path], np.int64)
        times = np.array([start for _, start in path])
        self.starts, self.legs, self.values = np.zeros(length), np.zeros(length), np.zeros(length)
        self.flown = insertion.path_state(
            table, vector, rows, length, times, RULES[rule], self.starts, self.legs, self.values
        )
        count = arrays.num_tasks
        self.gain, self.position, self.start = np.zeros(count), np.zeros(count, np.int64), np.zeros(count)
        insertion.evaluate(
            table, np.arange(count), count, vector, rows, length, self.starts, self.legs, self.values,
            self.flown, RULES[rule], insertion.first_position(RULES[rule], length), length,
            self.gain, self.position, self.start,
        )  # fmt: skip
        fixed = score.fixed(arrays, agent)
        if fixed is not None:
            self.gain -= fixed


def cases(label: str, rule: str, seed: int):
    """A mission, each of its agents, the twin's judge and a random path."""
    mission = random_mission(
        seed,
        ties=seed % 2 == 0,
        tasks=(1, 9),
        ranges=seed % 3 == 0,
        revisits=label == "revisit",
        reward_scale=10.0 if label == "distance_cost" else 1.0,
    )
    if seed % 5 == 0:  # a third type may do only half of the task types
        kinds = {f"kind{j % 2}" for j in range(len(mission.tasks))}
        mission = dataclasses.replace(
            mission,
            tasks=tuple(
                dataclasses.replace(task, type=f"kind{j % 2}") for j, task in enumerate(mission.tasks)
            ),
            compatible={"agent": frozenset(sorted(kinds)[:1])},
        )
    if seed % 7 == 0:
        mission = dataclasses.replace(mission, distance_step=0.5)
    rng = random.Random(seed)
    for agent in mission.agents:
        judge = Judge(mission, agent, SCORES[label], rule)
        yield mission, agent, judge, random_path(judge, rng)


@pytest.mark.parametrize("rule", RULES)
@pytest.mark.parametrize("label", SCORES)
def test_every_insertion_is_timed_and_valued_as_by_the_twin(label: str, rule: str):
    """Gains to 1e-9; the place is the earliest of the best ones, the start the one it is promised."""
    fitting = 0
    for seed in range(SEEDS):
        for mission, agent, judge, path in cases(label, rule, seed):
            view = KernelView(mission, agent, score_named(label), rule, path)
            on_path = {task_id for task_id, _ in path}
            for row, task in enumerate(view.arrays.tasks):
                if task.id in on_path:
                    continue
                best = judge.best_insertion(path, task)
                where = f"seed {seed}, agent {agent.id}, task {task.id}, path {path}"
                if best is None:
                    assert view.gain[row] == -np.inf, where
                    continue
                fitting += 1
                gain, position, _ = best
                assert view.gain[row] == pytest.approx(gain, rel=1e-9, abs=1e-9), where
                chosen = judge.insert(path, int(view.position[row]), task)
                assert chosen is not None, where
                assert view.start[row] == chosen[view.position[row]][1], where
                if view.position[row] != position:  # only where rounding alone parts the two
                    again = judge.gain(path, chosen, int(view.position[row]))
                    assert again == pytest.approx(gain, rel=1e-12, abs=1e-12), where
                    assert rule == "shift" or judge.terms[task.id].cost > 0.0, where
    assert fitting > SEEDS  # the comparison above is not of infeasible insertions only


@pytest.mark.parametrize("rule", RULES)
def test_path_state_is_the_twins_schedule(rule: str):
    for seed in range(SEEDS):
        for mission, agent, judge, path in cases("time_discounted", rule, seed):
            view = KernelView(mission, agent, score_named("time_discounted"), rule, path)
            assert view.starts.tolist() == [start for _, start in path]
            assert view.legs.tolist() == [
                judge.metres(judge.leave(path, k)[0], judge.tasks[task_id].position)
                for k, (task_id, _) in enumerate(path)
            ]
            assert view.values.sum() == pytest.approx(judge.path_score(path), rel=1e-12, abs=1e-12)


LINE = [Task(id=f"t{k}", position=(10.0 * k, 0.0, 0.0), reward=10.0, discount=0.01) for k in range(4)]
START = Agent(id="a", position=(0.0, 0.0, 0.0), speed=1.0, base=(0.0, 0.0, 0.0))


def test_of_equal_places_the_earliest_is_taken():
    """A task without discount or fuel gains its reward wherever it stands: before t1, so place 0."""
    plain = [dataclasses.replace(task, discount=0.0) for task in LINE]
    mission = Mission(agents=(START,), tasks=tuple(plain))
    view = KernelView(mission, START, make_score("time_discounted"), "shift", [("t1", 10.0), ("t3", 30.0)])
    assert view.gain.tolist()[0::2] == [10.0, 10.0]
    assert view.position.tolist()[0::2] == [0, 0]


def test_range_counts_the_way_back():
    """t3 and back is 60 m: in reach with 60 m of range, out of reach with 59 m; t2 needs 40 m."""
    for reach, fits in ((60.0, [True, True, True, True]), (59.0, [True, True, True, False])):
        agent = dataclasses.replace(START, range=reach)
        view = KernelView(
            Mission(agents=(agent,), tasks=tuple(LINE)), agent, make_score("time_discounted"), "hold", []
        )
        assert (view.gain > -np.inf).tolist() == fits


def test_the_latest_return_counts_the_way_back():
    """At 1 m/s t3 and back takes 60 s; with an endurance of 59 s it is out of reach."""
    for endurance, fits in ((60.0, [True, True, True, True]), (59.0, [True, True, True, False])):
        agent = dataclasses.replace(START, endurance=endurance)
        view = KernelView(
            Mission(agents=(agent,), tasks=tuple(LINE)), agent, make_score("time_discounted"), "hold", []
        )
        assert (view.gain > -np.inf).tolist() == fits


def test_held_times_leave_no_room_where_shifting_does():
    """t2 is promised for 20 s, the earliest there is. A 5 s service at t1 on the way would delay it.

    Held: t1 can only come after t2, at 20 + 10 = 30 s. Shifting: t1 at 10 s, t2 slips to 25 s.
    """
    slow = [dataclasses.replace(task, duration=5.0 if task.id == "t1" else 0.0) for task in LINE]
    mission = Mission(agents=(START,), tasks=tuple(slow))
    score = make_score("time_discounted")
    held = KernelView(mission, START, score, "hold", [("t2", 20.0)])
    assert (held.position[1], held.start[1]) == (1, 30.0)
    shifted = KernelView(mission, START, score, "shift", [("t2", 20.0)])
    assert (shifted.position[1], shifted.start[1]) == (0, 10.0)


def test_a_full_block_of_lanes_is_as_good_as_one_lane():
    """As many tasks as there are lanes; each gains what the twin says it gains alone."""
    rng = random.Random(1)
    many = tuple(
        Task(
            id=f"t{k:03}",
            position=(rng.uniform(0, 100), rng.uniform(0, 100), 0.0),
            reward=5.0,
            discount=0.01,
        )
        for k in range(BLOCK)
    )
    path: Path = []
    judge = Judge(Mission(agents=(START,), tasks=many), START, SCORES["time_discounted"], "shift")
    for task in many[:3]:
        path = judge.insert(path, len(path), task) or path
    view = KernelView(judge.mission, START, make_score("time_discounted"), "shift", path)
    for row in range(3, BLOCK):
        best = judge.best_insertion(path, many[row])
        assert best is not None
        assert view.gain[row] == pytest.approx(best[0], rel=1e-9)
