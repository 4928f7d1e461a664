"""One insertion evaluation against the same loop in SIMD C.

An evaluation is one task at one position, the whole suffix of the path re-timed. Both sides do all
tasks x all positions of one path with tasks as lanes; C is built at bench time with all that a
compiler offers (see `insertion.c`) and linked to the vector mathematics library.
"""

from __future__ import annotations

import ctypes
import json
import os
import shutil
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numba import njit

from benchmarks.measure import Table, in_child, interleave, median_ratio
from swarmbid import arrays
from swarmbid.kernels import insertion
from swarmbid.kernels.lanes import BLOCK

BAR = 1.2
FLAGS = ("-O3", "-march=native", "-ffast-math", "-fopenmp-simd")
CASES = (
    # name, tasks, path length, rule, biting windows
    ("1000 tasks, path of 10", 1000, 10, insertion.SHIFT, False),
    ("1000 tasks, path of 30", 1000, 30, insertion.SHIFT, False),
    ("200 tasks, path of 5", 200, 5, insertion.SHIFT, False),
    ("50 tasks, path of 5", 50, 5, insertion.SHIFT, False),
    ("1000 tasks, path of 10, windows", 1000, 10, insertion.SHIFT, True),
    ("1000 tasks, path of 10, promised times held", 1000, 10, insertion.HOLD, True),
)


@njit
def repeat_evaluate(  # type: ignore[no-untyped-def]
    repeats, tasks, columns, agent, path, length, starts, legs, values, total, rule, gain, position, times
):
    """Call the kernel from compiled code, a block of tasks at a time, as `build_bundle` does."""
    # Not cached on disk: Numba would not notice that the kernel has changed.
    num_tasks = tasks.shape[1]
    for _ in range(repeats):
        for first in range(0, num_tasks, BLOCK):
            count = min(BLOCK, num_tasks - first)
            insertion.evaluate(
                tasks, columns[first:], count, agent, path, length, starts, legs, values, total, rule,
                0, length, gain[first:], position[first:], times[first:],
            )  # fmt: skip


class Case:
    """One path and its candidate tasks, as the kernels want them."""

    def __init__(self, num_tasks: int, length: int, rule: int, windows: bool, seed: int = 0) -> None:
        rng = np.random.default_rng(seed)
        tasks = np.zeros((arrays.NUM_TASK_ROWS, num_tasks))
        tasks[arrays.X] = rng.uniform(0.0, 1000.0, num_tasks)
        tasks[arrays.Y] = rng.uniform(0.0, 1000.0, num_tasks)
        tasks[arrays.OPEN] = rng.uniform(0.0, 300.0, num_tasks) if windows else 0.0
        tasks[arrays.READY] = tasks[arrays.OPEN]
        tasks[arrays.REFERENCE] = tasks[arrays.OPEN]
        tasks[arrays.END] = tasks[arrays.OPEN] + rng.uniform(20.0, 120.0, num_tasks) if windows else np.inf
        tasks[arrays.DURATION] = rng.uniform(1.0, 5.0, num_tasks)
        tasks[arrays.REWARD] = rng.uniform(50.0, 150.0, num_tasks)
        tasks[arrays.DECAY] = 0.01
        agent = np.zeros(arrays.NUM_AGENT_SLOTS)
        agent[arrays.AGENT_X] = agent[arrays.AGENT_Y] = 500.0
        agent[arrays.SLOWNESS] = 0.1
        agent[arrays.COST_PER_METRE] = 0.001
        agent[arrays.RANGE] = agent[arrays.LATEST_RETURN] = np.inf
        self.tasks, self.agent, self.rule = tasks, agent, rule
        self.path = np.zeros(length, np.int64)
        self.held = np.zeros(length)
        self.starts, self.legs, self.values = np.zeros(length), np.zeros(length), np.zeros(length)
        self.total = 0.0
        self.gain, self.place, self.times = self.outputs()
        self.length = 0
        for _ in range(length):
            self._take_best()

    def outputs(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return fresh arrays for gain, position and start of service."""
        num_tasks = self.tasks.shape[1]
        return np.zeros(num_tasks), np.zeros(num_tasks, np.int64), np.zeros(num_tasks)

    def inputs(self) -> tuple[Any, ...]:
        """Return what `evaluate` reads, in its order."""
        columns = np.arange(self.tasks.shape[1])
        return (self.tasks, columns, self.agent, self.path, self.length, self.starts, self.legs, self.values,
                self.total, self.rule)  # fmt: skip

    def kernel(self, repeats: int, outputs: tuple[np.ndarray, np.ndarray, np.ndarray]) -> None:
        """Evaluate with swarmbid's kernel."""
        repeat_evaluate(repeats, *self.inputs(), *outputs)

    @property
    def evaluations(self) -> int:
        """How many (task, position) pairs one call evaluates."""
        return self.tasks.shape[1] * (self.length + 1)

    def _take_best(self) -> None:
        """Insert the best task, so that the path is one that an agent would have."""
        self.kernel(1, (self.gain, self.place, self.times))
        allowed = self.gain.copy()
        allowed[self.path[: self.length]] = -np.inf
        task = int(np.argmax(allowed))
        if not allowed[task] > -np.inf:
            raise RuntimeError("The benchmark's mission has no path this long; widen its windows.")
        n, at = int(self.place[task]), self.length
        self.path[n + 1 : at + 1] = self.path[n:at]
        self.held[n + 1 : at + 1] = self.held[n:at]
        self.path[n], self.held[n] = task, self.times[task]
        self.length += 1
        self.total = insertion.path_state(
            self.tasks, self.agent, self.path, self.length, self.held, self.rule,
            self.starts, self.legs, self.values,
        )  # fmt: skip


def build(compiler: str, library: Path, *more: str) -> None:
    """Compile `insertion.c`."""
    source = Path(__file__).with_name("insertion.c")
    # Linked apart, for to link with -ffast-math makes the whole process flush subnormal numbers to zero.
    parts = library.with_suffix(".o")
    subprocess.run([compiler, *FLAGS, *more, "-fPIC", "-c", str(source), "-o", str(parts)], check=True)
    subprocess.run([compiler, "-shared", str(parts), "-o", str(library), "-lm"], check=True)


def load(library: Path) -> Callable[..., None]:
    """Return the repeating entry of a compiled `insertion.c`."""
    function = ctypes.CDLL(str(library)).repeat_evaluate
    double, integer, pointer = ctypes.c_double, ctypes.c_int64, ctypes.c_void_p
    function.restype = None
    function.argtypes = [
        integer, pointer, integer, pointer, pointer, integer, pointer, pointer, pointer, double, integer,
        pointer, pointer, pointer,
    ]  # fmt: skip

    def call(case: Case, repeats: int, outputs: tuple[np.ndarray, np.ndarray, np.ndarray]) -> None:
        function(
            repeats, case.tasks.ctypes.data, case.tasks.shape[1], case.agent.ctypes.data,
            case.path.ctypes.data, case.length, case.starts.ctypes.data, case.legs.ctypes.data,
            case.values.ctypes.data, case.total, case.rule, *(array.ctypes.data for array in outputs),
        )  # fmt: skip

    return call


def check_equal(case: Case, ours: tuple[np.ndarray, ...], theirs: tuple[np.ndarray, ...]) -> int:
    """Raise unless both sides found the same insertions; return how many tasks fit somewhere."""
    fits = ours[0] > -np.inf
    if not np.array_equal(fits, theirs[0] > -1e299):
        raise AssertionError("The kernel and C disagree about which tasks fit.")
    np.testing.assert_allclose(ours[0][fits], theirs[0][fits], rtol=1e-9, atol=1e-9)
    # A task that is on the path already could go before or after itself: a tie, decided by the last bit.
    fits[case.path[: case.length]] = False
    np.testing.assert_array_equal(ours[1][fits], theirs[1][fits])
    np.testing.assert_allclose(ours[2][fits], theirs[2][fits], rtol=1e-9, atol=1e-9)
    return int(fits.sum())


def measure(folder: Path, turns: int, work: int) -> list[dict[str, float]]:
    """Time every case in this process; ns per evaluation, medians, and the median of their ratios."""
    family, decay_only = load(folder / "family.so"), load(folder / "decay_only.so")
    found = []
    for _, num_tasks, length, rule, windows in CASES:
        case = Case(num_tasks, length, rule, windows)
        ours, theirs, third = case.outputs(), case.outputs(), case.outputs()
        case.kernel(1, ours)
        family(case, 1, theirs)
        decay_only(case, 1, third)
        fits = check_equal(case, ours, theirs)
        check_equal(case, ours, third)
        repeats = max(1, work // case.evaluations)
        contenders = {
            "ours": partial(case.kernel, repeats, ours),
            "c": partial(family, case, repeats, theirs),
            "decay": partial(decay_only, case, repeats, third),
        }
        seconds = interleave(contenders, turns)
        count = repeats * case.evaluations
        per = {name: statistics.median(taken) / count * 1e9 for name, taken in seconds.items()}
        found.append({**per, "ratio": median_ratio(seconds["ours"], seconds["c"]), "fits": fits})
    return found


def run(quick: bool = False) -> Table:
    """Measure every case in several processes."""
    table = Table(
        "An insertion evaluation against SIMD C",
        ("case", "ours, ns", "C, ns", "ratio", "same process", "C decay only, ns", "ratio to that"),
    )
    compiler = os.environ.get("CC") or shutil.which("gcc") or shutil.which("cc")
    if compiler is None:
        table.note("Skipped: no C compiler (gcc) on this machine.")
        return table
    processes, turns, work = (2, 7, 200_000) if quick else (7, 15, 500_000)
    with tempfile.TemporaryDirectory() as folder:
        build(compiler, Path(folder) / "family.so")
        build(compiler, Path(folder) / "decay_only.so", "-DDECAY_ONLY")
        arguments = (folder, str(turns), str(work))
        children = [in_child("benchmarks.insertion", *arguments) for _ in range(processes)]
    worst = 0.0
    for number, (name, *_, windows) in enumerate(CASES):
        found = [child[number] for child in children]
        ours = statistics.median(one["ours"] for one in found)
        c, decay = (min(one[key] for one in found) for key in ("c", "decay"))
        worst = max(worst, ours / c)
        table.rows.append(
            (
                f"{name} ({found[0]['fits']} fit)" if windows else name,
                f"{ours:.2f}", f"{c:.2f}", f"{ours / c:.2f}",
                f"{statistics.median(one['ratio'] for one in found):.2f}",
                f"{decay:.2f}", f"{ours / decay:.2f}",
            )
        )  # fmt: skip
    table.note(f"""
        One evaluation is one task at one position, the whole suffix of the path re-timed; a call does all
        tasks x all positions of one path. C: `gcc {" ".join(FLAGS)}`, vector exponential of the C
        library; once with the whole family of scores (the same work), once with the time-discounted reward
        alone. Outputs equal to 1e-9.
    """)
    table.note(f"""
        {processes} processes; in each {turns} turns, the sides taking turns, medians. Ours is the median of
        the processes, C the best of them, for where its memory happens to lie can cost it a half; the ratio
        within the same process is the median.
    """)
    table.bars.append((f"worst ratio {worst:.2f} to C at its best, promised at most {BAR}", worst <= BAR))
    return table


if __name__ == "__main__":
    print(json.dumps(measure(Path(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3]))))
