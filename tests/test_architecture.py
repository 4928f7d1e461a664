"""The shape of the code: small modules, everything public explained, nothing heavy at import."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

SOURCE = Path(__file__).resolve().parents[1] / "src" / "swarmbid"
MODULES = sorted(SOURCE.rglob("*.py"))
MOST_LINES = 450
"""About 400, with some room to finish a thought."""
HEAVY = ("matplotlib", "msgspec", "numba", "numpy", "pydantic", "pymap3d", "rich", "scipy", "typer", "yaml")


def name_of(module: Path) -> str:
    return module.relative_to(SOURCE).as_posix()


@pytest.mark.parametrize("module", MODULES, ids=name_of)
def test_module_can_be_read_in_one_sitting(module: Path) -> None:
    assert len(module.read_text(encoding="utf-8").splitlines()) <= MOST_LINES


@pytest.mark.parametrize("module", MODULES, ids=name_of)
def test_everything_public_says_what_it_is(module: Path) -> None:
    tree = ast.parse(module.read_text(encoding="utf-8"))
    assert ast.get_docstring(tree), "the module has no docstring"
    private = any(part.startswith("_") for part in module.relative_to(SOURCE).parts if part != "__init__.py")
    missing = [] if private else unexplained(tree, "")
    assert not missing, f"no docstring: {', '.join(missing)}"


def unexplained(node: ast.AST, prefix: str) -> list[str]:
    """Public classes, functions and methods below `node` that have no docstring."""
    found = []
    for item in ast.iter_child_nodes(node):
        if not isinstance(item, ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            continue
        if item.name.startswith("_"):
            continue
        if ast.get_docstring(item) is None:
            found.append(prefix + item.name)
        if isinstance(item, ast.ClassDef):
            found += unexplained(item, f"{item.name}.")
    return found


def test_a_function_without_docstring_is_noticed() -> None:
    tree = ast.parse('class A:\n    """It is."""\n    def b(self): ...\n    def _c(self): ...\n')
    assert unexplained(tree, "") == ["A.b"]


def test_importing_swarmbid_loads_nothing_heavy() -> None:
    code = f"import sys, swarmbid; print(*sorted(set(sys.modules) & set({HEAVY!r})))"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout.strip() == ""


@pytest.mark.parametrize("module", MODULES, ids=name_of)
def test_no_module_speaks_of_work_left_to_do(module: Path) -> None:
    text = module.read_text(encoding="utf-8")
    words = [word for word in ("TODO", "FIXME", "XXX", "NotImplementedError") if word in text]
    assert not words
