"""The CBGA paper reproduced: its numbers as data, what is counted, and that the page says what was found."""

from __future__ import annotations

import json
import math
import re
import xml.etree.ElementTree as ElementTree
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from swarmbid.errors import InputError
from swarmbid.experiments import hunt2014
from swarmbid.experiments.hunt2014 import Reproduction, _cases, _curves, _figure3, _paths
from swarmbid.experiments.hunt2014._cases import Outcome, Point, Step, play
from swarmbid.experiments.hunt2014._paper import paper
from swarmbid.experiments.hunt2014._runs import Results, play_all
from swarmbid.experiments.hunt2014._stats import Effect, Level, effect, stated_effect, verdict
from swarmbid.model import Agent, Mission, Task

PAGE = Path(__file__).parents[2] / "docs" / "hunt2014.md"
FLOOR = (0.0, 0.0, 0.0)


def outcome(**changes: object) -> Outcome:
    """A run of three rounds that scored 1,000."""
    base = Outcome(
        score=1000.0,
        completed=10,
        settled=True,
        sound=True,
        clean=True,
        changes=20,
        own=12,
        sent=30,
        bytes=4000,
        entries=90,
        rounds=3,
        together=0.5,
        seconds=0.0,
        steps=(Step(10, 10, 800), Step(10, 20, 1000)),
    )
    return replace(base, **changes)


def made_up(figures: tuple[int, ...] = (3, 5, 6, 7, 8, 10)) -> Reproduction:
    """Results in which every number says where it comes from: 1,000 a column, 10 a seat, 1 an agent."""
    runs: dict[Point, tuple[Outcome, ...]] = {}
    for figure in figures:
        for place, point in enumerate(hunt2014.points(figure, (1, 2, 5, 10))):
            runs[point] = tuple(
                outcome(
                    score=1000.0 + 7.0 * place + luck, changes=10 + place + luck, seconds=0.1 + 0.01 * luck
                )
                for luck in range(3)
            )
    return Reproduction(figures, (1, 2, 5, 10), 3, 0, Results(runs))


# --- the paper's numbers as data


def test_the_stated_means_are_those_of_the_text() -> None:
    found = {stated.name: (stated.level.mean, stated.level.sd) for stated in paper().levels}
    assert found == {
        "steps-single-5": (24, 8),
        "steps-pairs-5": (10, 2),
        "steps-single-10": (47, 14),
        "steps-pairs-10": (23, 4),
        "score-base": (5756, 722),
        "score-quitting": (5962, 708),
        "score-team": (6106, 601),
        "score-both": (6216, 634),
    }
    # The text's own differences: 14 and 24 steps; 206, then another 144.
    assert found["steps-single-5"][0] - found["steps-pairs-5"][0] == 14
    assert found["steps-single-10"][0] - found["steps-pairs-10"][0] == 24
    assert found["score-quitting"][0] - found["score-base"][0] == 206
    assert found["score-team"][0] - found["score-quitting"][0] == 144


def test_each_stated_mean_stands_in_its_quote() -> None:
    for stated in paper().levels:
        for number in (stated.level.mean, stated.level.sd):
            assert f"{number:,.0f}" in stated.quote, stated.name


def test_what_the_text_does_not_say_in_numbers_is_labelled_with_our_reading() -> None:
    for stated in paper().effects:
        assert stated.source in ("text", "derived")
        assert (stated.source == "derived") == bool(stated.reading), stated.name
        assert stated.quote and stated.where
        assert stated.figure in hunt2014.FIGURES
    assert {stated.source for stated in paper().levels} == {"text"}
    assert all(item["why"] for item in paper().settings)


def test_every_statement_is_about_points_that_its_figure_runs() -> None:
    for stated in paper().effects:
        wanted = {side for name in ("printed", "repaired") for side in stated.sides(name)}
        for sizes in (hunt2014.SIZES, hunt2014.QUICK_SIZES):
            assert wanted <= set(hunt2014.points(stated.figure, sizes)), stated.name


# --- statistics


def test_the_effect_of_stated_means_is_their_ratio_and_their_distance_in_spreads() -> None:
    """24 ± 8 to 10 ± 2: ratio 0.417; d = -14 / sqrt((64 + 4) / 2) = -2.40. The spread of the ratio's
    logarithm is sqrt((2/10)^2/100 + (8/24)^2/100) = 0.0389, so it is 0.417 times or over e^0.0762."""
    found = stated_effect(Level(10.0, 2.0, 100), Level(24.0, 8.0, 100))
    assert found.ratio == pytest.approx(10 / 24)
    assert found.size == pytest.approx(-14 / math.sqrt(34))
    assert (found.low, found.high) == pytest.approx(
        (0.41667 * math.exp(-0.0762), 0.41667 * math.exp(0.0762)), rel=1e-3
    )
    assert found.p < 1e-20


def test_the_papers_own_p_values_follow_from_its_means() -> None:
    """Team rewards against quitting: "only significant to p < 0.15"; both against neither: p < 0.01."""
    stated = {one.name: one.stated for one in paper().effects}
    team, both = stated["team-beats-quitting"], stated["both-help"]
    assert team is not None and 0.05 < team.p < 0.15
    assert both is not None and both.p < 0.01


def test_p_is_that_of_welchs_test_and_the_interval_holds_the_ratio() -> None:
    rng = np.random.default_rng(1)
    first, second = rng.normal(110.0, 9.0, 40), rng.normal(100.0, 20.0, 50)
    found = effect(first, second, 0, "test")
    assert found.p == pytest.approx(stats.ttest_ind(first, second, equal_var=False).pvalue)
    assert found.ratio == pytest.approx(first.mean() / second.mean())
    assert found.low < found.ratio < found.high
    # Normal theory: the ratio's logarithm spreads by sqrt(9^2/40/110^2 + 20^2/50/100^2) = 0.031.
    assert math.log(found.high / found.low) == pytest.approx(2 * 1.96 * 0.031, rel=0.25)
    assert effect(first, second, 0, "test") == found
    assert effect(first, second, 1, "test").low != found.low


def test_samples_that_are_too_small_are_not_measured() -> None:
    found = effect(np.array([1.0]), np.array([2.0, 3.0]), 0, "x")
    assert math.isnan(found.ratio) and verdict(found, "less", 0.01) == "not measured"


@pytest.mark.parametrize(
    ("ratio", "low", "high", "p", "says", "expected"),
    [
        (0.5, 0.4, 0.6, 0.001, "less", "as reported"),
        (0.8, 0.7, 0.9, 0.001, "less", "same direction"),
        (0.8, 0.7, 0.9, 0.02, "less", "not significant"),
        (0.5, 0.4, 0.6, 0.001, "more", "opposite"),
        (1.5, 1.4, 1.6, 0.001, "less", "opposite"),
        (1.1, 0.9, 1.3, 0.5, "similar", "as reported"),
        (1.4, 1.2, 1.6, 0.001, "similar", "not significant"),
        (1.9, 1.7, 2.1, 0.001, "similar", "opposite"),
    ],
)
def test_verdicts(ratio: float, low: float, high: float, p: float, says: str, expected: str) -> None:
    """The paper states 0.45 to 0.55 where it states a size; similar is within a factor of 1.5."""
    stated = Effect(0.5, 0.45, 0.55, -1.0, 0.0, 100) if says == "less" else None
    assert verdict(Effect(ratio, low, high, 0.0, p, 9), says, 0.01, stated, within=1.5) == expected


# --- what is taken down of a run


def pair_mission(**changes: object) -> Mission:
    """Two agents at 0 m; a pair's task at 30 m and 40 m, a single one that follows it at the same place."""
    place = (30.0, 40.0, 0.0)
    tasks = (
        Task(id="lift", position=place, reward=100.0, agents_required=2, **changes),
        Task(id="look", position=place, reward=60.0, prerequisites=("lift",)),
    )
    return Mission(agents=(Agent(id="a", position=FLOOR), Agent(id="b", position=FLOOR)), tasks=tasks)


def test_the_score_pays_each_seat_of_completed_tasks_and_charges_every_metre() -> None:
    mission = pair_mission()
    both = {"a": ["lift", "look"], "b": ["lift"]}
    assert _cases.completed_tasks(mission, both) == {"lift", "look"}
    # 2 seats of 100 and one of 60, less 50 m for each of the two agents.
    assert _cases.paid(mission, both, {"lift", "look"}) == 2 * 100 + 60 - 2 * 50
    # Alone on a task of two: nothing is completed, nor what depends on it; the way is paid all the same.
    alone: dict[str, list[str]] = {"a": ["lift", "look"], "b": []}
    assert _cases.completed_tasks(mission, alone) == set()
    assert _cases.paid(mission, alone, set()) == -50


def test_a_group_without_the_equipment_completes_nothing() -> None:
    mission = pair_mission(equipment=frozenset({"crane"}))
    assert _cases.completed_tasks(mission, {"a": ["lift"], "b": ["lift"]}) == set()


def test_groups_that_go_on_together_are_counted() -> None:
    """After t1 both go to t2 (together), after t2 one goes to t3 and one stays (apart); after t3, done by
    one, and at the end of all, nothing is asked: 1 of 2."""
    assert _cases.together({"a": ["t1", "t2", "t3"], "b": ["t1", "t2"]}) == 0.5
    assert _cases.together({"a": ["t1"], "b": ["t1"]}) is None
    assert _cases.together({"a": ["t1", "t2"], "b": []}) is None


def test_a_run_counts_changes_own_changes_and_all_that_was_sent() -> None:
    """One agent alone takes its tasks in one round and tells nobody anything twice."""
    found = play(Point("repaired", "single", 1), 0, 0)
    assert (found.changes, found.own, found.settled, found.sound) == (1, 1, True, True)
    found = play(Point("repaired", "single", 5), 0, 0)
    assert 5 <= found.own <= found.changes <= found.sent
    assert found.steps[0].messages == 5
    assert len(found.steps) == found.rounds
    assert sum(step.messages for step in found.steps) <= found.sent


def test_what_never_settled_has_no_number_of_steps_but_a_score() -> None:
    point = Point("printed", "fours", 10)
    results = Results({point: (outcome(), outcome(settled=False, score=500.0, changes=900))})
    assert results.sample(point, "steps").tolist() == [20.0]
    assert results.sample(point, "links").tolist() == [20.0 * 9]
    assert results.sample(point, "score").tolist() == [1000.0, 500.0]
    assert results.share(point, "settled") == 0.5


def test_vectors_are_two_numbers_a_seat_and_triples_three_an_assignment() -> None:
    """20 tasks of L seats: 2 * 20 * L. Full plans: 3 * 20 * L is more. In bytes, with 10 stamps of 8:
    20 * 2 * 10 + 80 = 480 for the vectors, 40 * 12 + 80 = 560 for 40 triples."""
    assert [_figure3.vectors(seats) for seats in (1, 2, 4)] == [40, 80, 160]
    assert _figure3.vector_bytes(2) == 480
    assert _figure3.triple_bytes(40) == 560
    # Two rounds of 10 messages, with 1 and with 2 triples each: 3 and 6 numbers.
    found = _figure3.triples([outcome()])
    assert found.numbers[:2] == (3.0, 6.0) and math.isnan(found.numbers[2])
    assert found.run_bytes == 10 * (12 + 80) + 10 * (24 + 80)
    assert _figure3.old_vectors([outcome()], 2).run_bytes == 20 * 480
    assert _figure3.measured([outcome()]).bytes[:2] == (80.0, 100.0)


# --- runs


def test_runs_do_not_depend_on_their_order_or_on_the_number_of_processes() -> None:
    points = [Point("repaired", "single", 2), Point("printed", "pairs", 3), Point("printed", "single", 2)]
    one = play_all(dict.fromkeys(points, 2), seed=4, workers=1, progress=None)
    two = play_all(dict.fromkeys(reversed(points), 2), seed=4, workers=2, progress=None)
    assert dict(one.runs) == dict(two.runs)
    other = play_all(dict.fromkeys(points, 2), seed=5, workers=1, progress=None)
    assert dict(one.runs) != dict(other.runs)


def test_runs_of_one_number_share_their_mission_over_algorithms_and_experiments() -> None:
    def places(point: Point, run: int) -> list[object]:
        mission = _cases.mission_of(point, run, 0)
        return [item.position for item in (*mission.agents[:2], *mission.tasks)]

    first = places(Point("printed", "pairs", 5), 3)
    assert places(Point("repaired", "kits_3", 10, "both"), 3) == first
    assert places(Point("printed", "pairs", 5), 4) != first


@pytest.fixture(scope="module")
def tiny() -> Reproduction:
    return hunt2014.run(quick=True, figures=[10], runs=2, workers=1)


def test_a_tiny_run_of_a_figure_has_all_its_points_and_no_problem(tiny: Reproduction) -> None:
    assert len(tiny.results.runs) == 3 * 4 * 2
    assert {len(runs) for runs in tiny.results.runs.values()} == {2}
    assert tiny.problems() == []
    names = {one.stated.name for one in tiny.findings()}
    assert names == {"follow-ups-talk-less", "open-follow-ups-score-less", "open-follow-ups-talk-more"}
    assert {one.variant for one in tiny.findings()} == {"printed", "repaired"}


def test_the_figures_are_ready_for_json(tiny: Reproduction) -> None:
    data = json.loads(json.dumps(tiny.to_dict(), allow_nan=False))
    point = Point("repaired", "pairs", 10)
    entry = next(one for one in data["points"] if one["experiment"] == "pairs" and one["agents"] == 10)
    assert (entry["variant"], entry["runs"]) == ("printed", 2)
    entry = next(
        one
        for one in data["points"]
        if (one["variant"], one["experiment"], one["agents"]) == ("repaired", "pairs", 10)
    )
    assert entry["score"]["mean"] == tiny.results.level(point, "score").mean


def test_one_seed_draws_one_picture_byte_by_byte(tiny: Reproduction) -> None:
    pictures = tiny.pictures()
    assert list(pictures) == ["hunt2014-10.svg"]
    assert tiny.pictures() == pictures
    again = hunt2014.run(quick=True, figures=[10], runs=2, workers=1).pictures()
    assert again == pictures
    assert "<dc:date>" not in pictures["hunt2014-10.svg"]


@pytest.mark.parametrize("figure", _paths.RUNS)
def test_paths_are_drawn_with_a_line_for_each_agent(figure: int) -> None:
    found = hunt2014.run(figures=[figure], workers=1)
    assert found.results.runs == {}
    (drawn,) = found.drawings().values()
    agents = len(_paths.mission_shown(figure, 0).agents)
    for axes in drawn.axes:
        assert len([line for line in axes.lines if line.get_label()[:1] == "a"]) == agents
        assert axes.get_xlabel() == "time, s"


def test_every_figure_is_drawn_and_is_svg() -> None:
    pictures = made_up().pictures()
    assert list(pictures) == [f"hunt2014-{figure}.svg" for figure in (3, 5, 6, 7, 8, 10)]
    for text in pictures.values():
        assert ElementTree.fromstring(text).tag == "{http://www.w3.org/2000/svg}svg"


@pytest.mark.parametrize(("figures", "runs"), [([2], 1), ([7, 12], 1), ([7], 0)])
def test_figures_without_results_and_no_runs_are_refused(figures: list[int], runs: int) -> None:
    with pytest.raises(InputError):
        hunt2014.run(figures=figures, runs=runs, workers=1)


# --- the page


def test_the_page_has_the_numbers_of_the_results() -> None:
    """A level of each kind, and every effect, as computed here from the made-up runs."""
    found = made_up()
    page = found.page()
    cells = {cell.strip() for line in page.splitlines() if line.startswith("|") for cell in line.split("|")}
    for one in found.findings():
        ratio = f"{one.effect.ratio:.2f} ({one.effect.low:.2f} to {one.effect.high:.2f})"
        assert any(cell.startswith(ratio) for cell in cells), one.stated.name
        assert one.verdict in cells
    for point in found.results.runs:
        if not point.timed and point.experiment in ("kits_1", "fours"):
            level = found.results.level(point, "score")
            assert f"{level.mean:,.0f} ± {level.sd:,.0f}" in cells
    assert found.summary() in page
    changed = replace(
        found, results=Results({p: (*runs, outcome(score=77777.0)) for p, runs in found.results.runs.items()})
    )
    assert changed.page() != page


def test_the_published_page_holds_what_a_fresh_run_of_two_agents_says() -> None:
    """One row of Fig. 5 in all its countings, as many runs by each algorithm as the page says."""
    said = re.search(r"(\d+) runs a point, seed 0", PAGE.read_text(encoding="utf-8"))
    assert said is not None
    points = [Point(variant, "single", 2) for variant in ("printed", "repaired")]
    fresh = play_all(dict.fromkeys(points, int(said[1])), seed=0, workers=1, progress=None)
    row = _curves.table(5, fresh, (2,))[1][0]
    assert row[:2] == ["one agent a task", "2"]
    assert "| " + " | ".join(row) + " |" in PAGE.read_text(encoding="utf-8").splitlines()


def test_the_published_page_has_every_figure_and_the_prose_of_the_program() -> None:
    """Whoever edits the page by hand loses it at the next run."""

    def prose(page: str) -> list[str]:
        return [line for line in page.splitlines() if line[:1] != "|" and "a point" not in line]

    published = PAGE.read_text(encoding="utf-8")
    assert prose(published) == prose(made_up(hunt2014.FIGURES).page())
    for figure in hunt2014.FIGURES:
        assert f"(images/hunt2014-{figure}.svg)" in published
        assert (PAGE.parent / "images" / f"hunt2014-{figure}.svg").is_file()


def test_levels_are_called_no_reproduction_and_times_stand_apart() -> None:
    page = made_up().page()
    assert "their level is no reproduction" in page
    before, times = page.split("## Figure 6")
    assert "computing time, two agents" not in before
    assert "computing time, two agents" in times and "depend on the machine" in times


def test_a_run_of_ours_that_fails_is_a_problem_and_one_of_the_print_is_a_finding() -> None:
    def problems(variant: str, experiment: str, **facts: bool) -> list[str]:
        point = Point(variant, experiment, 10)
        return Reproduction((5,), (10,), 2, 0, Results({point: (outcome(), outcome(**facts))})).problems()

    assert problems("repaired", "pairs", settled=False) == [
        "repaired, pairs, 10 agents, base: 50 % of the runs did not agree"
    ]
    assert problems("repaired", "single", sound=False) == [
        "repaired, single, 10 agents, base: 50 % of the runs ended in a plan that breaks a rule"
    ]
    assert problems("printed", "pairs", settled=False, sound=False) == []


def test_the_table_has_a_line_for_each_statement_and_the_literal_reading_on_request() -> None:
    found = made_up((7,))
    headings, rows = found.table()
    assert headings == ["figure", "what", "paper", "printed", "verdict", "repaired", "verdict"]
    assert len(rows) == 4 and all(len(row) == len(headings) for row in rows)
    assert "literal" in found.table(every_instance=True)[0]
    assert found.figure_table(7)[1][0][:2] == ["neither", "5,756 ± 722"]
