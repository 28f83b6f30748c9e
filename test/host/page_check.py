"""What HTML asks of a page that a browser forgives: names of attributes, ids, one main part."""

import json
import re
from html.parser import HTMLParser
from pathlib import Path
from typing import Any


class _Reader(HTMLParser):
    def __init__(self) -> None:
        super().__init__()
        self.findings: list[str] = []
        self.ids: list[str] = []
        self.mains = 0

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.mains += tag == "main"
        names = [name for name, _ in attrs]
        if len(set(names)) < len(names):
            self.findings.append(f"{tag}: an attribute stands twice")
        for name, value in attrs:
            # HTML has no namespaces but for these two, inside SVG.
            if ":" in name and name not in ("xmlns:xlink", "xlink:href"):
                self.findings.append(f"{tag}: attribute {name}")
            if name == "id":
                self.ids.append(str(value))


def page_findings(text: str) -> list[str]:
    """What is wrong with a page, without its scripts; the W3C's validator and axe find no more today."""
    reader = _Reader()
    reader.feed(text)
    twice = sorted({name for name in reader.ids if reader.ids.count(name) > 1})
    findings = reader.findings + [f"id {name} stands twice" for name in twice]
    return findings if reader.mains == 1 else [*findings, f"{reader.mains} main parts"]


def study_of(folder: Path) -> dict[str, Any]:
    """The data (page_data.py) of the report's page in that folder."""
    page = (folder / "index.html").read_text(encoding="utf-8")
    found = re.search(r'<script type="application/json" id="study">(.*?)</script>', page)
    assert found is not None
    study: dict[str, Any] = json.loads(found[1])
    return study
