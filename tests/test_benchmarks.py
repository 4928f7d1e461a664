"""What the benchmarks compare with must be right, and so must their arithmetic."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest
from benchmarks import coalitions, insertion, instances, plain_cbba, quality
from benchmarks.measure import Table, interleave, median_ratio

from swarmbid.kernels.insertion import HOLD, SHIFT


@pytest.mark.parametrize("name", ["std-5-20", "std-10-50", "std-20-100"])
def test_plain_python_cbba_reaches_the_central_greedys_total(name: str):
    outcome = plain_cbba.run(instances.load(name))
    assert outcome.finished
    assert outcome.total == pytest.approx(instances.central_greedy(name), abs=1e-9)


def test_plain_python_cbba_is_cut_off_and_says_so():
    outcome = plain_cbba.run(instances.load("std-5-20"), cap=0.0)
    assert (outcome.finished, outcome.rounds) == (False, 1)


def test_missions_are_those_on_file():
    """std-5-20: 5 agents at 10 m/s with 10 tasks each at most, 20 tasks that fade by 0.01 1/s."""
    mission = instances.mission("std-5-20")
    assert (len(mission.agents), len(mission.tasks)) == (5, 20)
    assert {(agent.speed, agent.bundle_limit) for agent in mission.agents} == {(10.0, 10)}
    assert {task.discount for task in mission.tasks} == {0.01}


@pytest.mark.skipif(shutil.which("gcc") is None, reason="no C compiler")
@pytest.mark.parametrize(("rule", "windows"), [(SHIFT, False), (SHIFT, True), (HOLD, True)])
def test_c_and_the_kernel_find_the_same_insertions(tmp_path, rule: int, windows: bool):
    """300 tasks are more than a block of lanes; with windows some fit nowhere."""
    library = tmp_path / "family.so"
    insertion.build("gcc", library)
    case = insertion.Case(300, 4, rule, windows, seed=3)
    ours, theirs = case.outputs(), case.outputs()
    case.kernel(1, ours)
    insertion.load(library)(case, 1, theirs)
    fits = insertion.check_equal(case, ours, theirs)
    assert (fits == 300 - 4) is not windows  # those on the path are not counted
    theirs[0][np.argmax(theirs[0])] += 1e-6
    with pytest.raises(AssertionError):
        insertion.check_equal(case, ours, theirs)


def test_contenders_take_turns():
    """A, B, then B, A; a clock that counts its readings shows one tick to each."""
    order: list[str] = []
    ticks = iter(range(100))
    seconds = interleave(
        {"A": lambda: order.append("A"), "B": lambda: order.append("B")}, 2, clock=lambda: float(next(ticks))
    )
    assert "".join(order) == "ABBA"
    assert seconds == {"A": [1.0, 1.0], "B": [1.0, 1.0]}


def test_the_ratio_is_the_median_of_the_turns():
    """2/1, 9/3, 4/4: of 2, 3 and 1 the median is 2."""
    assert median_ratio([2.0, 9.0, 4.0], [1.0, 3.0, 4.0]) == 2.0


def test_a_table_prints_and_writes_what_was_promised():
    table = Table("Speed", ("what", "s"), rows=[("run", "0.5"), ("longer run", "10.0")])
    table.note("Two words\n   a line.")
    table.bars = [("fast", True), ("small", False)]
    assert table.text() == (
        "Speed\n\nwhat           s\nrun          0.5\nlonger run  10.0\nTwo words a line.\n"
        "[kept] fast\n[MISSED] small"
    )
    assert table.markdown() == (
        "## Speed\n\n| what | s |\n| --- | ---: |\n| run | 0.5 |\n| longer run | 10.0 |\n\n"
        "Two words a line.\n\n- **kept**: fast\n- **MISSED**: small\n"
    )


def test_the_c_library_leaves_the_arithmetic_of_the_process_alone(tmp_path: Path):
    """Linked with -ffast-math it would make subnormal numbers zero, here and in every test that follows."""
    compiler = shutil.which("gcc")
    if compiler is None:
        pytest.skip("no gcc on this machine")
    insertion.build(compiler, tmp_path / "insertion.so")
    insertion.load(tmp_path / "insertion.so")
    assert np.float64(5e-324) * 1.0 == 5e-324


def test_the_group_benchmark_measures_runs_that_agree():
    found = coalitions.measure(4, 8, 3, "distance_cost")
    assert found["status"] == "converged"
    assert found["cpu"] > 0.0 and found["bytes"] > found["messages"] > 0


def test_cbga_ends_clean_where_the_print_to_the_letter_does_not():
    """Pairs with windows: of the first two missions of the page's table the print ends neither clean."""
    shares = {name: quality.clean_share("L2", True, options, 2) for name, options in quality.READINGS}
    assert (shares["literal"], shares["cbga"]) == (0.0, 1.0)
