"""The published page is what a run says, and the figures in it are what they are called."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import pytest

from swarmbid.datasets import toptw as dataset
from swarmbid.errors import InputError
from swarmbid.experiments import toptw
from swarmbid.experiments.toptw import Comparison, Trial

PAGE = Path(__file__).parents[2] / "docs" / "toptw.md"
WHOLE_FAMILY = "c2"
ONE_EACH = ["pr01", "r101", "rc201"]


def printed(rows: list[list[str]]) -> list[str]:
    """Table rows as the page has them, without the last (which sums up all)."""
    return ["| " + " | ".join(cells) + " |" for cells in rows[:-1]]


@pytest.fixture(scope="module")
def family() -> Comparison:
    return toptw.run(instances=[name for name in dataset.instances() if name.startswith(WHOLE_FAMILY)])


@pytest.fixture(scope="module")
def single() -> Comparison:
    return toptw.run(instances=ONE_EACH, vehicles=[2])


def trial(**changes: object) -> Trial:
    """Half of the best known reward of 100; KU Leuven's mean misses a tenth."""
    base = Trial("c101", 1, "time_window", 50.0, 100.0, 90.0, 5, 3, True, ())
    return dataclasses.replace(base, **changes)


def test_the_page_holds_what_a_fresh_run_of_a_family_says(family: Comparison):
    page = PAGE.read_text(encoding="utf-8").splitlines()
    by_family, by_instance = family.table()[1], family.table(every_instance=True)[1]
    assert len(by_family) == 4 + 1 and len(by_instance) == 4 * 4 + 1
    for line in printed(by_family) + printed(by_instance):
        assert line in page


def test_the_page_holds_what_a_fresh_run_of_other_instances_says(single: Comparison):
    page = PAGE.read_text(encoding="utf-8").splitlines()
    lines = printed(single.table(every_instance=True)[1])
    assert len(lines) == 3
    for line in lines:
        assert line in page


def test_the_page_covers_every_instance_and_every_size_of_fleet():
    """37 instances by 4 sizes, 7 families by 4 sizes, and the line of all twice."""
    rows = [
        line.split(" | ")[:2] for line in PAGE.read_text(encoding="utf-8").splitlines() if line[:2] == "| "
    ]
    cells = [(name.removeprefix("| "), size) for name, size in rows]
    expected = {
        (name, str(size)) for name in [*dataset.instances(), *toptw.FAMILIES] for size in (1, 2, 3, 4)
    }
    assert expected <= set(cells)
    assert cells.count(("all", "1-4")) == 2


def test_the_prose_of_the_page_is_that_of_the_program(single: Comparison):
    """Whoever edits the page by hand loses it at the next run; the figures are compared above."""

    def prose(page: str) -> list[str]:
        return [
            line for line in page.splitlines() if line[:1] != "|" and not line.startswith("Plain CBBA coll")
        ]

    assert prose(single.page()) == prose(PAGE.read_text(encoding="utf-8"))


def test_every_plan_is_verified_and_every_run_agrees(family: Comparison, single: Comparison):
    for comparison in (family, single):
        assert comparison.problems() == []
        assert comparison.overall().verified and comparison.overall().converged


def test_no_plan_beats_the_best_known(family: Comparison, single: Comparison):
    """A negative gap would be a wrong reader or a wrong check, not a discovery."""
    for found in (*family.trials, *single.trials):
        assert 0.0 <= found.gap < 1.0


def test_a_gap_is_the_missing_share_of_the_best_known():
    """(100 - 50) / 100 and (100 - 90) / 100; the second score collects 25."""
    row = Comparison((trial(), trial(score="distance_cost", reward=25.0))).by_family()[0]
    assert (row.name, row.vehicles, row.instances) == ("c1", 1, 1)
    assert (row.gap, row.leuven_gap, row.second_gap) == (0.5, pytest.approx(0.1), 0.75)


def test_a_family_has_the_mean_gap_and_the_worst():
    """Gaps of 0.5 and 0.2: mean 0.35, worst 0.5; rewards of 50 and 80, mean 65."""
    trials = [trial(), trial(instance="c102", reward=80.0)]
    trials += [dataclasses.replace(one, score="distance_cost") for one in trials]
    row = Comparison(tuple(trials)).by_family()[0]
    assert (row.gap, row.worst_gap, row.reward) == (pytest.approx(0.35), 0.5, 65.0)


@pytest.mark.parametrize("which", ["time_window", "distance_cost"])
def test_a_bad_plan_or_no_agreement_is_said_loudly(which: str):
    good = {name: trial(score=name) for name in toptw.SCORES}
    torn = dataclasses.replace(good[which], converged=False)
    wrong = dataclasses.replace(good[which], violations=("task t1: window",))
    for bad, words, column in ((torn, "did not agree", "agreed"), (wrong, "t1: window", "verified")):
        comparison = Comparison(tuple({**good, which: bad}.values()))
        assert [words in problem for problem in comparison.problems()] == [True]
        headings, rows = comparison.table()
        assert rows[0][headings.index(column)] == "NO"
        assert "NOT every" in comparison.summary()


def test_each_family_has_its_name():
    assert [toptw.family(name) for name in ("c101", "c204", "r106", "r201", "rc101", "rc204", "pr13")] == [
        "c1", "c2", "r1", "r2", "rc1", "rc2", "pr",
    ]  # fmt: skip


def test_quick_takes_the_first_of_each_family():
    seen: list[tuple[int, int]] = []
    comparison = toptw.run(quick=True, vehicles=[1], progress=lambda done, of: seen.append((done, of)))
    assert [row.name for row in comparison.by_instance()] == [
        "c101", "c201", "pr01", "r101", "r201", "rc101", "rc201",
    ]  # fmt: skip
    assert seen == [(done, 7) for done in range(1, 8)]


def test_the_figures_are_ready_for_json(single: Comparison):
    data = json.loads(json.dumps(single.to_dict()))
    assert len(data["trials"]) == 2 * len(ONE_EACH)
    assert {found["score"] for found in data["trials"]} == {"time_window", "distance_cost"}
    assert data["families"][0]["gap"] == single.by_family()[0].gap


@pytest.mark.parametrize(("names", "sizes"), [(["c999"], [1]), (["c101"], [5]), ([], [1])])
def test_what_is_not_known_is_refused(names: list[str], sizes: list[int]):
    with pytest.raises(InputError):
        toptw.run(instances=names, vehicles=sizes)
