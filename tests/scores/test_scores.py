"""What each score says a visit is worth, by hand; and that the kernels bid the same."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from swarmbid.errors import InputError
from swarmbid.model import Agent, Mission, Task
from swarmbid.scores import Score, make_score
from swarmbid.simulator import simulate

AGENT = Agent(id="a", position=(0.0, 0.0, 0.0), speed=2.0, fuel_per_metre=0.5)
TASK = Task(
    id="t", position=(3.0, 4.0, 0.0), reward=100.0, start=10.0, end=60.0, duration=4.0, discount=0.01,
    revisit_at=30.0, revisit_width=10.0,
)  # fmt: skip
MISSION = Mission(agents=(AGENT,), tasks=(TASK,))


@pytest.mark.parametrize(
    ("score", "expected"),
    [
        # 100 e^{-0.01 (20 - 10)} less fuel for the leg of 8 m
        (make_score("time_discounted"), 100.0 * math.exp(-0.1) - 4.0),
        # the same, fuel for the 5 m from the agent's initial position
        (make_score("time_discounted", fuel="start"), 100.0 * math.exp(-0.1) - 2.5),
        # 100 - 1 * 8 m - 1 * 4 s (Hunt 2014, eq. (7))
        (make_score("distance_cost"), 88.0),
        # 100 - 2 * 8 m - 0 * 4 s
        (make_score("distance_cost", metre_cost=2.0, second_cost=0.0), 84.0),
        # 20 s is within 10 to 60 s: the whole reward, less fuel
        (make_score("time_window"), 96.0),
        # ten seconds, one width, before the peak: 1/e of the reward
        (make_score("revisit"), 100.0 / math.e - 4.0),
        (make_score(lambda visit: visit.reward - visit.start + visit.revisit_rate), 80.1),
    ],
    ids=["discounted", "fuel-from-start", "distance", "weights", "window", "revisit", "own"],
)
def test_a_visit_at_20_s_after_8_m_is_worth(score: Score, expected: float):
    assert score.value(MISSION, AGENT, TASK, 20.0, 8.0) == pytest.approx(expected, rel=1e-12)


def test_outside_its_window_a_visit_is_worth_nothing():
    assert make_score("time_window").value(MISSION, AGENT, TASK, 61.0, 8.0) == 0.0


def test_an_early_agent_waits_for_the_scheduled_time_of_a_revisit():
    """5 m at 2 m/s arrive at 2.5 s; the window opens at 10 s, the peak is at 30 s."""
    run = simulate(MISSION, score="revisit")
    assert run.paths == {"a": [("t", 30.0)]}
    assert run.plan.total_score == 100.0 - 2.5


def test_a_revisit_after_its_window_is_made_at_the_windows_end():
    late = Task(id="t", position=(3.0, 4.0, 0.0), reward=9.0, end=20.0, revisit_at=30.0, revisit_width=10.0)
    run = simulate(Mission(agents=(AGENT,), tasks=(late,)), score="revisit")
    assert run.paths == {"a": [("t", 20.0)]}


def test_the_declared_fuel_is_reported_beside_the_true_one():
    """One agent, two tasks in a row at 10 and 20 m: from the start 30 m of fuel, along the path 20 m."""
    agent = Agent(id="a", position=(0.0, 0.0, 0.0), fuel_per_metre=1.0)
    tasks = tuple(Task(id=f"t{x}", position=(float(x), 0.0, 0.0), reward=100.0) for x in (10, 20))
    run = simulate(
        Mission(agents=(agent,), tasks=tasks),
        score=make_score("time_discounted", fuel="start"),
        insertion="append",
    )
    assert run.plan.total_score == 200.0 - 30.0
    assert run.plan.honest_score == 200.0 - 20.0


OWN = """
import math

def score(visit):
    return visit.reward * math.exp(-visit.discount * (visit.start - visit.window_start)) - (
        visit.fuel_per_metre * visit.leg
    )
"""


def test_a_score_of_your_own_is_one_function_in_one_file(tmp_path: Path):
    """The built-in score written again as a user would: the same plan, the same bids to 1e-9."""
    path = tmp_path / "mine.py"
    path.write_text(OWN)
    agents = tuple(
        Agent(id=f"a{i}", position=(30.0 * i, 5.0 * i, 0.0), fuel_per_metre=0.1, bundle_limit=3)
        for i in range(3)
    )
    tasks = tuple(
        Task(
            id=f"t{j}", position=(9.0 * j, 40.0 - 7.0 * j, 0.0), reward=50.0 + j, discount=0.02, start=5.0 * j
        )
        for j in range(8)
    )
    mission = Mission(agents=agents, tasks=tasks)
    for insertion in ("hold", "shift", "append"):
        mine = simulate(mission, score=str(path), insertion=insertion)
        built_in = simulate(mission, score="time_discounted", insertion=insertion)
        assert mine.paths == built_in.paths, insertion
        assert mine.plan.total_score == pytest.approx(built_in.plan.total_score, rel=1e-9)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (None, "mine.py: cannot be read: No such file or directory. Name a readable file."),
        ("def score(visit:", "mine.py: cannot be run: SyntaxError"),
        ("value = 3", "mine.py: score: is not defined. Define a function: def score(visit): ..."),
    ],
)
def test_a_file_that_holds_no_score_is_refused(tmp_path: Path, text: str | None, says: str):
    path = tmp_path / "mine.py"
    if text is not None:
        path.write_text(text)
    with pytest.raises(InputError) as caught:
        make_score(str(path))
    assert says in str(caught.value)


def test_a_score_that_cannot_be_compiled_is_refused_with_the_reason(tmp_path: Path):
    path = tmp_path / "mine.py"
    path.write_text("def score(visit):\n    return visit.nothing\n")
    with pytest.raises(InputError) as caught:
        simulate(MISSION, score=str(path))
    assert "score mine.py: cannot be compiled" in str(caught.value)
    assert "nothing" in str(caught.value)


@pytest.mark.parametrize(
    ("name", "options", "says"),
    [
        ("time_discounted", {"fuel": "air"}, "fuel: is 'air'. Give 'path' or 'start'."),
        ("distance_cost", {"metre_cost": -1.0}, "metre_cost: is -1.0. Give a finite number, 0 or more."),
        (
            "distance_cost",
            {"metre_cots": 1.0},
            "metre_cots: is no parameter of it. Did you mean 'metre_cost'?",
        ),
        ("time_window", {"x": 1.0}, "x: is no parameter of it. It has none."),
        ("revist", {}, "there is no score 'revist'. Did you mean 'revisit'?"),
    ],
)
def test_a_wrong_score_is_refused_with_the_mend(name: str, options: dict[str, object], says: str):
    with pytest.raises(InputError) as caught:
        make_score(name, **options)
    assert says in str(caught.value)
