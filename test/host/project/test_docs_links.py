"""Links in the README and in docs/ lead to files and headings that exist."""

import re
from pathlib import Path

import pytest

PROJECT = Path(__file__).resolve().parents[3]
PAGES = [*sorted(PROJECT.glob("*.md")), *sorted((PROJECT / "docs").glob("*.md")), PROJECT / "sim2d" / "README.md"]
LINK = re.compile(r"\]\(([^()\s]+)\)")
HEADING = re.compile(r"^#+ (.+)$", re.MULTILINE)


def anchor(heading: str) -> str:
    """What GitHub makes of a heading."""
    return re.sub(r"[^\w\- ]", "", heading.strip().lower()).replace(" ", "-")


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(PROJECT)))
def test_links_lead_somewhere(page: Path) -> None:
    for link in LINK.findall(page.read_text(encoding="utf-8")):
        if link.startswith(("http://", "https://")):
            continue
        name, _, heading = link.partition("#")
        target = page.parent / name if name else page
        assert target.exists(), link
        if heading:
            assert heading in map(anchor, HEADING.findall(target.read_text(encoding="utf-8"))), link


def test_every_page_is_reached_from_the_readme() -> None:
    assert "docs/start.md" in LINK.findall((PROJECT / "README.md").read_text(encoding="utf-8"))
    linked = set(LINK.findall((PROJECT / "docs" / "start.md").read_text(encoding="utf-8")))
    assert {page.name for page in (PROJECT / "docs").glob("*.md")} - {"start.md"} <= linked


def test_the_files_to_add_to_exist() -> None:
    section = (PROJECT / "CONTRIBUTING.md").read_text(encoding="utf-8").partition("\n## Where to add\n")[2]
    rows = [row for row in section.partition("\n## ")[0].splitlines() if row.startswith("|")][2:]
    named = {row.split("|")[1].strip(): re.findall(r"`([\w./]+/[\w./]*)`", row) for row in rows}

    assert {"a sensor", "a kind of terrain", "a metric of a run"} <= set(named)
    assert [row for row, files in named.items() if not files] == []
    assert [file for files in named.values() for file in files if not (PROJECT / file).exists()] == []
    # A metric that needs more places than these is declared twice somewhere.
    assert len(named["a metric of a run"]) <= 4
