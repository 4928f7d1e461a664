"""Plays a page of the documentation: every block of code on it is run, every answer compared.

A page is played from top to bottom in an empty directory that has the repository's ``examples``:

    ```python                      run; all of a page's blocks share their names
    ```text title="prints"         what the Python block before printed
    ```yaml title="FILE"           written to FILE, as is every block with a title
    ```console                     lines ``$ command``, each with what it answers; ``# exit 2`` after a
                                   command says how it ends if not well
    ```sh                          for the reader's own machine: only checked to name what exists

``...`` in an answer stands for anything. Blocks in other languages are for the eye. With
``pytest --rewrite`` wrong answers are written anew.
"""

from __future__ import annotations

import contextlib
import importlib.util
import io
import os
import re
import shlex
import sys
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[1]
BLOCK = re.compile(r"^```(\w+)(?: title=\"([^\"]+)\")?[^\n]*\n(.*?)^```$", re.DOTALL | re.MULTILINE)
PLUG_INS = re.compile(r"src/swarmbid/(\w+)/(\w+)\.py")
EXIT = re.compile(r"\s+# exit (\d+)$")


class Page:
    """One page while it is played.

    Parameters
    ----------
    path : the page. workplace : directory that it is played in, the current one.
    """

    def __init__(self, path: Path, workplace: Path) -> None:
        self.path = path
        self.workplace = workplace
        self.names: dict[str, Any] = {"__name__": "__docs__"}
        self.printed = ""
        self.played = 0

    def play(self) -> tuple[str, str]:
        """Return (the page, the page with the answers that were really given)."""
        said = self.path.read_text(encoding="utf-8")
        return said, BLOCK.sub(self._block, said)

    def _block(self, found: re.Match[str]) -> str:
        language, title, body = found.groups()
        answer = body
        if title == "prints":
            answer = self._compared(body, self.printed)
        elif title:
            self._write(title, body)
        elif language == "python":
            self.printed = self._run_python(body, found)
        elif language == "console":
            answer = self._console(body)
        elif language == "sh":
            for line in body.splitlines():
                check_command(line)
        else:
            return found[0]
        self.played += 1
        start, end = found.start(3) - found.start(), found.end(3) - found.start()
        return found[0][:start] + answer + found[0][end:]

    def _compared(self, said: str, found: str) -> str:
        found = "".join(f"{line.rstrip()}\n" for line in found.rstrip().splitlines())
        return said if matches(said, found) else found

    def _write(self, title: str, body: str) -> None:
        file = self.workplace / title
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(body, encoding="utf-8")
        plug_in = PLUG_INS.fullmatch(title)
        if plug_in:
            # As good as a file of the package, without writing into it.
            package = importlib.import_module(f"swarmbid.{plug_in[1]}")
            if str(file.parent) not in package.__path__:
                package.__path__.append(str(file.parent))
            importlib.invalidate_caches()

    def _run_python(self, body: str, found: re.Match[str]) -> str:
        line = found.string[: found.start(3)].count("\n")
        code = compile("\n" * line + body, str(self.path), "exec")
        out = io.StringIO()
        with contextlib.redirect_stdout(out):
            exec(code, self.names)
        return out.getvalue()

    def _console(self, body: str) -> str:
        parts = re.split(r"^(?=\$ )", body, flags=re.MULTILINE)
        assert parts[0] == "", f"{self.path.name}: a console block begins with a command"
        return "".join(self._command(part) for part in parts[1:])

    def _command(self, part: str) -> str:
        head, _, said = part.partition("\n")
        ends = EXIT.search(head)
        command = EXIT.sub("", head)[2:]
        status, found = run_swarmbid(shlex.split(command))
        wanted = int(ends[1]) if ends else 0
        assert status == wanted, f"{self.path.name}: {command} ended with {status}, not {wanted}:\n{found}"
        return f"{head}\n" + self._compared(said, found)


def matches(said: str, found: str) -> bool:
    """Whether an answer is what the page says, with ``...`` for anything."""
    pattern = re.escape(said).replace(re.escape("..."), ".*?")
    return re.fullmatch(pattern, found, re.DOTALL) is not None


def run_swarmbid(words: list[str]) -> tuple[int, str]:
    """Run one ``swarmbid`` command in this process; return (exit status, output and errors)."""
    assert words[0] == "swarmbid", f"only swarmbid is run here, not {words[0]}"
    from swarmbid.cli import main

    out = io.StringIO()
    before, sys.argv = sys.argv, words
    try:
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(out):
            main()
    except SystemExit as end:
        return int(end.code or 0), out.getvalue()
    finally:
        sys.argv = before
    raise AssertionError("main() ends the process")


def check_command(line: str) -> None:
    """Fail unless a command for the reader's own machine names targets, modules and files that exist."""
    words = shlex.split(line, comments=True)
    if not words:
        return
    program = Path(words[0]).name
    if program == "make":
        targets = re.findall(r"^([a-z]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE)
        wrong = [word for word in words[1:] if word not in targets]
    elif program.startswith("python") and words[1:2] == ["-m"]:
        wrong = [] if importlib.util.find_spec(words[2]) else [words[2]]
    elif program == "pytest":
        paths = [word.partition("::")[0] for word in words[1:] if not word.startswith("-") and "/" in word]
        wrong = [path for path in paths if not (ROOT / path).exists()]
        tests = [word.partition("::")[2] for word in words[1:] if "::" in word]
        files = [ROOT / path for path in paths if path.endswith(".py") and path not in wrong]
        text = "".join(file.read_text(encoding="utf-8") for file in files)
        wrong += [name for name in tests if f"def {name}(" not in text]
    elif program == "swarmbid":
        from swarmbid.cli import app

        commands = [command.name for command in app.registered_commands]
        wrong = [word for word in words[1:2] if word not in commands]
    else:
        wrong = [line]
    assert not wrong, f"there is no {', '.join(wrong)} (in: {line})"


@contextlib.contextmanager
def workplace(directory: Path) -> Any:
    """Make `directory` the current one, with the examples in it; undo everything that pages did."""
    (directory / "examples").symlink_to(ROOT / "examples", target_is_directory=True)
    before, paths = Path.cwd(), {}
    for folder in ("algorithms", "scores", "scenarios", "datasets"):
        package = importlib.import_module(f"swarmbid.{folder}")
        paths[package] = list(package.__path__)
    modules = set(sys.modules)
    os.chdir(directory)
    try:
        yield
    finally:
        os.chdir(before)
        for package, path in paths.items():
            package.__path__[:] = path
        for name in set(sys.modules) - modules:
            file = getattr(sys.modules[name], "__file__", None) or ""
            if file.startswith(str(directory)):
                del sys.modules[name]


def play(path: Path, directory: Path, *, rewrite: bool) -> int:
    """Play one page; fail with the first answer that differs. Return how many blocks were played."""
    with workplace(directory):
        page = Page(path, directory)
        said, played = page.play()
    if rewrite and said != played:
        path.write_text(played, encoding="utf-8")
    elif said != played:
        for number, (old, new) in enumerate(zip(said.splitlines(), played.splitlines(), strict=False), 1):
            if old != new:
                pytest.fail(f"{path.name}:{number}\n  the page says: {old}\n  it really is:  {new}")
        pytest.fail(f"{path.name}: answers end differently")
    return page.played
