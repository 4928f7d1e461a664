"""What README and the documentation say is what happens."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from docs import generate

from docpages import ROOT, check_command, matches, play

DOCS = ROOT / "docs"
WRITTEN = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted(DOCS.rglob("*.md"))]
PLAYED = [
    page for page in WRITTEN if "```" in page.read_text(encoding="utf-8") and "benchmarks" not in page.name
]
LINK = re.compile(r"\]\(([^)\s]+)\)|src=\"([^\"]+)\"")


def name_of(page: Path) -> str:
    return page.relative_to(ROOT).as_posix()


@pytest.mark.parametrize("page", PLAYED, ids=name_of)
def test_every_block_of_code_does_what_the_page_says(page: Path, tmp_path: Path, rewrite: bool) -> None:
    assert play(page, tmp_path, rewrite=rewrite) > 0


@pytest.mark.parametrize("name", generate.PAGES)
def test_generated_page_is_current(name: str) -> None:
    found = (DOCS / name).read_text(encoding="utf-8")
    assert found == generate.PAGES[name](), "run: python -m docs.generate"


@pytest.mark.parametrize("page", WRITTEN, ids=name_of)
def test_links_lead_somewhere(page: Path) -> None:
    for link in (first or second for first, second in LINK.findall(page.read_text(encoding="utf-8"))):
        if link.startswith("https://"):
            continue
        target, _, anchor = link.partition("#")
        file = (page.parent / target).resolve() if target else page
        assert file.exists(), f"{name_of(page)}: {link}"
        if anchor and file.suffix == ".md":
            assert anchor in anchors(file), f"{name_of(page)}: {link}"


def anchors(page: Path) -> set[str]:
    """Names that headings get: small letters, digits and hyphens."""
    heads = re.findall(r"^#+ (.+)$", page.read_text(encoding="utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", head).strip().lower().replace(" ", "-") for head in heads}


def test_every_page_is_in_the_menu_and_every_entry_is_a_page() -> None:
    menu = re.findall(r": ([\w/-]+\.md)$", (ROOT / "mkdocs.yml").read_text(encoding="utf-8"), re.MULTILINE)
    pages = {page.relative_to(DOCS).as_posix() for page in DOCS.rglob("*.md")}
    assert set(menu) == pages
    assert len(menu) == len(set(menu))


def test_pages_do_not_use_anything_from_elsewhere() -> None:
    """Pictures and styles are files of this repository, so that the pages show without a network."""
    for page in WRITTEN:
        for link in re.findall(r"!\[[^]]*\]\(([^)]+)\)|src=\"([^\"]+)\"", page.read_text(encoding="utf-8")):
            assert not any(part.startswith("http") for part in link), f"{name_of(page)}: {link}"


def test_an_answer_that_differs_is_noticed(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text('```python\nprint(1 + 1)\n```\n\n```text title="prints"\n3\n```\n', encoding="utf-8")
    (tmp_path / "a").mkdir()
    with pytest.raises(pytest.fail.Exception, match=r"page.md:6"):
        play(page, tmp_path / "a", rewrite=False)
    (tmp_path / "b").mkdir()
    assert play(page, tmp_path / "b", rewrite=True) == 2
    assert "\n2\n" in page.read_text(encoding="utf-8")


def test_dots_stand_for_anything_and_nothing_else_does() -> None:
    assert matches("a ... c\n", "a b b c\n")
    assert not matches("a . c\n", "a b c\n")
    assert not matches("a ... c\n", "a b d\n")


@pytest.mark.parametrize(
    "line",
    ["make x", "python -m nowhere", "pytest tests/none.py", "pytest tests/test_docs.py::x", "rm -rf build"],
)
def test_a_command_that_names_nothing_is_noticed(line: str) -> None:
    with pytest.raises(AssertionError):
        check_command(line)


def test_an_empty_answer_is_filled_in_its_place(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text('a\n```python\nprint(2)\n```\nb\n```text title="prints"\n```\nc\n', encoding="utf-8")
    (tmp_path / "a").mkdir()
    play(page, tmp_path / "a", rewrite=True)
    expected = 'a\n```python\nprint(2)\n```\nb\n```text title="prints"\n2\n```\nc\n'
    assert page.read_text(encoding="utf-8") == expected


def test_one_seed_gives_one_trace_whatever_the_hash_seed(tmp_path: Path) -> None:
    code = (
        "from swarmbid.missionfile import load_mission; from swarmbid.simulator import simulate\n"
        "from swarmbid.network import Network, make_topology\n"
        f"mission = load_mission({str(ROOT / 'examples/quickstart.yaml')!r})\n"
        "network = Network(make_topology('line', 3), seed=7, loss=0.4, delay=1.0, duplicate=0.2)\n"
        "import sys; simulate(mission, network=network, trace=sys.argv[1])\n"
    )
    traces = []
    for hash_seed in ("1", "2"):
        trace = tmp_path / f"{hash_seed}.jsonl"
        environment = {**os.environ, "PYTHONHASHSEED": hash_seed}
        subprocess.run([sys.executable, "-c", code, str(trace)], check=True, env=environment)
        traces.append(trace.read_bytes())
    assert traces[0] == traces[1]
    assert traces[0].count(b"\n") > 20
