"""`swarmbid reproduce`, and scenarios with groups, as they are typed."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from swarmbid.experiments import hunt2014


def quickly(monkeypatch: pytest.MonkeyPatch) -> None:
    """Stay in this process, at one number of agents."""
    monkeypatch.setattr(hunt2014, "QUICK_SIZES", (2,))
    monkeypatch.setattr("os.cpu_count", lambda: 1)


def test_one_figure_prints_what_the_paper_states_and_what_was_found(
    swarmbid, monkeypatch: pytest.MonkeyPatch
):
    quickly(monkeypatch)
    typed = swarmbid("reproduce", "hunt2014", "--figure", "5", "--quick", "--runs", "2")
    assert (typed.status, typed.err) == (0, "")
    assert "score, two agents a task against one, 2 agents" in typed.out
    assert "settled, repaired" in typed.out
    assert "2 runs a point." in typed.out


def test_everything_is_written_with_its_pictures(swarmbid, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    quickly(monkeypatch)
    monkeypatch.setattr(hunt2014, "FIGURES", (8, 11))
    words = ["reproduce", "hunt2014", "--quick", "--runs", "2", "--write", "page.md", "--json", "--seed", "4"]
    typed = swarmbid(*words)
    assert typed.status == 0
    assert json.loads(typed.out)["seed"] == 4
    page = (tmp_path / "page.md").read_text(encoding="utf-8")
    pictures = sorted(found.name for found in (tmp_path / "images").iterdir())
    assert pictures == ["hunt2014-11.svg", "hunt2014-8.svg"]
    assert all(f"(images/{name})" in page for name in pictures)


def test_single_figures_can_be_drawn(swarmbid, tmp_path: Path):
    typed = swarmbid("reproduce", "hunt2014", "--figure", "4", "--pictures", "drawn")
    assert (typed.status, typed.err) == (0, "")
    assert [found.name for found in (tmp_path / "drawn").iterdir()] == ["hunt2014-4.svg"]


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["hunt2014", "--figure", "2"], "Choose some of 3, 4, 5"),
        (["hunt2014", "--figure", "7", "--write", "page.md"], "needs every figure"),
        (["hunt2014", "--figure", "4", "--pictures", "quickstart.yaml"], "is no directory"),
        (["toptw"], "swarmbid bench toptw"),
        (["hunt2015"], "Did you mean 'hunt2014'"),
    ],
)
def test_what_cannot_be_reproduced_is_refused(swarmbid, words: list[str], message: str):
    typed = swarmbid("reproduce", *words)
    assert typed.status == 2
    assert message in typed.err


def test_a_scenario_with_groups_is_rehearsed_on_a_bad_network(swarmbid):
    words = [
        "-a",
        "cbga",
        "--agents",
        "10",
        "--agents-required",
        "4",
        "--loss",
        "0.5",
        "--seed",
        "3",
        "--json",
    ]
    typed = swarmbid("simulate", "hunt2014", *words)
    found = json.loads(typed.out)
    assert found["run"]["status"] == "converged"
    assert found["violations"] == []
    visits = [visit["task"] for one in found["plan"]["agents"] for visit in one["visits"]]
    assert visits and all(visits.count(task) == 4 for task in visits)


@pytest.mark.parametrize(
    ("what", "message"),
    [("uniform", "is no option of uniform"), ("quickstart.yaml", "--agents-required: is for scenarios")],
)
def test_agents_required_is_for_scenarios_that_have_it(swarmbid, what: str, message: str):
    typed = swarmbid("simulate", what, "--agents-required", "2")
    assert typed.status == 2
    assert message in typed.err
