"""How long one waits before anything happens: import, help, and a plan of the example with a warm cache."""

from __future__ import annotations

import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from functools import partial
from pathlib import Path

from benchmarks.measure import ROOT, Table, interleave

EXAMPLE = ROOT / "examples" / "substations.yaml"
EMPTY = "python -c pass"
HEAVY = ("numba", "scipy", "matplotlib", "pydantic", "yaml")
"""Packages that `import swarmbid` must not bring along."""


def run(quick: bool = False) -> Table:
    """Measure every start, taking turns with an empty Python."""
    command = str(Path(sys.executable).with_name("swarmbid"))
    with tempfile.TemporaryDirectory() as folder:
        plan = str(Path(folder) / "plan.json")
        contenders = {
            EMPTY: [sys.executable, "-c", "pass"],
            "import swarmbid": [sys.executable, "-c", "import swarmbid"],
            "swarmbid --help": [command, "--help"],
            "swarmbid plan examples/substations.yaml": [command, "plan", str(EXAMPLE), "-o", plan],
        }
        cpu: dict[str, list[float]] = {name: [] for name in contenders}
        environment = {**os.environ, "PYTHONPYCACHEPREFIX": str(Path(folder) / "bytecode")}
        environment.pop("PYTHONDONTWRITEBYTECODE", None)
        calls = {
            name: partial(_start, arguments, environment, cpu[name]) for name, arguments in contenders.items()
        }
        for call in calls.values():
            call()
        wall = interleave(calls, 5 if quick else 15, clock=time.perf_counter)
    # The first call of each, without bytecode, does not count.
    busy = {name: statistics.median(taken[1:]) for name, taken in cpu.items()}
    table = Table("Start-up", ("what", "CPU s", "beyond an empty Python", "wall s", "quickest"))
    for name, seconds in wall.items():
        beyond = busy[name] - busy[EMPTY]
        table.rows.append(
            (
                name, f"{busy[name]:.3f}", f"{beyond:.3f}", f"{statistics.median(seconds):.3f}",
                f"{min(seconds):.3f}",
            )
        )  # fmt: skip
    table.note("""
        Whole processes, taking turns, medians and the quickest; bytecode and compiled kernels are on disk.
        Whether a promise was kept is told from the quickest wall s: on a shared machine the others measure
        the neighbours too.
    """)
    quickest = {name: min(taken) for name, taken in wall.items()}
    imported = quickest["import swarmbid"] - quickest[EMPTY]
    brought = _brought_along()
    table.bars = [
        (f"`import swarmbid` adds {imported:.3f} s, promised less than 0.1", imported < 0.1),
        (f"`import swarmbid` brings along {brought or 'none'} of {', '.join(HEAVY)}", not brought),
    ]
    for name, bar in (("swarmbid --help", 0.3), ("swarmbid plan examples/substations.yaml", 1.5)):
        taken = quickest[name]
        table.bars.append((f"`{name}` takes {taken:.3f} s, promised less than {bar:g}", taken < bar))
    return table


def _start(arguments: list[str], environment: dict[str, str], cpu: list[float]) -> None:
    """Run a command to its end; append its CPU s to `cpu`."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run(
        arguments, cwd=ROOT, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
        env=environment, check=False,
    )  # fmt: skip
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu.append(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)
    # 1 says that the mission cannot be served fully, which is an answer.
    if done.returncode not in (0, 1) or "Traceback" in done.stderr:
        raise RuntimeError(f"{' '.join(arguments)} failed: {done.stderr}")


def _brought_along() -> str:
    program = f"import sys, swarmbid; print(*[name for name in {HEAVY} if name in sys.modules])"
    done = subprocess.run(
        [sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, check=True
    )
    return done.stdout.strip()
