"""`foldcar report` as a user types it, on stores written as a sweep writes them."""

import json
import re
import sys
import time
from collections.abc import Callable, Mapping
from html.parser import HTMLParser
from pathlib import Path

import pytest
from pypdf import PdfReader

import written_study
from foldcar.cli import main
from foldcar.report.paper_figures import file_name_part
from foldcar.store.writer import write_store
from written_study import add_experiment

WIDTHS = tuple(float(width) for width in range(65, 250, 5))
FACTS = {**written_study.FACTS, "listing_text": '{"experiments": "<&>"}'}
TOLD = {
    "scenic_params": {"friction": 0.6},
    "condition": {"sample": 3, "objects": ["bump"], "params": ["friction"]},
    "variation": {"supply_v": 0.2},
}


def width_outcome(design: Mapping[str, float], sample: int) -> str:
    """Narrow cars tip, wide ones get stuck, medium ones pass; the thresholds move with the sample."""
    if design["width_mm"] < 80 + sample % 10:
        return "tipped"
    return "stuck" if design["width_mm"] > 190 - sample % 40 else "passed"


@pytest.fixture
def study(tmp_path: Path) -> Path:
    """A finished width study: 37 widths in 100 environments."""
    store = tmp_path / "study.db"
    with write_store(store) as writer:
        writer.begin_study(FACTS, "build-7")
        add_experiment(writer, "1", {"width_mm": WIDTHS}, 100, width_outcome, TOLD)
    return store


@pytest.fixture
def report(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Callable[..., tuple[int, str, str]]:
    def run(*arguments: str | Path) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["foldcar", "report", *map(str, arguments)])
        with pytest.raises(SystemExit) as end:
            main()
        printed = capsys.readouterr()
        return int(end.value.code or 0), printed.out, printed.err

    return run


class Page(HTMLParser):
    """What a page refers to, its ids, and its text."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.references: list[str] = []
        self.ids: list[str] = []
        self.text = ""
        self.feed(html)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        for name, value in attrs:
            if name in ("href", "src", "xlink:href", "data"):
                self.references.append(str(value))
            if name == "id":
                self.ids.append(str(value))

    def handle_data(self, data: str) -> None:
        self.text += data


def test_a_width_study_gives_one_page_and_four_figures_within_ten_seconds_and_the_same_again(
    study: Path, tmp_path: Path, report: Callable[..., tuple[int, str, str]]
) -> None:
    folder = tmp_path / "report"
    folder.mkdir()
    (folder / "notes.txt").write_text("mine")
    (folder / "index.html").write_text("old")
    started_s = time.process_time()
    code, shown, said = report(study, "-o", folder)
    # Of the processor: what else the machine does takes none of it.
    assert time.process_time() - started_s < 10.0
    assert (code, said) == (0, "")
    figures = [f"experiment_1_{kind}_by_width_mm" for kind in ("outcomes", "success", "time", "feasibility")]
    names = [f"{figure}{suffix}" for figure in figures for suffix in (".pdf", ".png", ".svg")]
    assert sorted(path.name for path in folder.iterdir()) == sorted([*names, "index.html", "notes.txt"])

    html = (folder / "index.html").read_text()
    page = Page(html)
    assert len(page.ids) == len(set(page.ids))
    pdf = PdfReader(folder / f"{figures[1]}.pdf").pages[0]
    assert "passed (%)" in pdf.extract_text() and pdf.mediabox.width == pytest.approx(7.2 * 72, rel=0.1)
    assert not re.search(r"<script [^>]*src|<link|<img", html)
    data = json.loads(re.search(r'<script type="application/json" id="study">(.*?)</script>', html, re.DOTALL)[1])  # type: ignore[index]
    (one,) = data["experiments"]
    assert any("No replay: the runs are of carsim build build-7, and the one here is " in text for text in one["remarks"])
    passed = [sum(width_outcome({"width_mm": width}, k) == "passed" for k in range(100)) for width in WIDTHS]
    assert one["designs"]["passed"] == passed
    facts = " ".join(text for _, text in one["provenance"])
    for fact in (
        *(FACTS[name] for name in ("foldcar_version", "scenic_version", "created_utc", "command", "listing_text")),
        f"foldcar report {study} -o {folder}",
        "friction 0.6",
        "100, seed 42",
        "120 s",
        "as in sample 3: bump, friction",
        "seed 42; spread: supply_v 0.2",
    ):
        assert fact in facts
    assert sorted(address for _, address in one["files"]) == sorted(f"{figure}.svg" for figure in figures)

    rows = [line.split() for line in shown.splitlines()]
    assert ["65", "mm", "100", "0.0", "0.0", "-", "3.7", "100", "0"] in rows
    at_80 = sum(width_outcome({"width_mm": 80.0}, sample) == "passed" for sample in range(100))
    assert [row[3] for row in rows if row[:2] == ["80", "mm"]] == [f"{at_80:.1f}"]
    assert shown.splitlines()[-1] == f"report: {folder / 'index.html'}"
    assert "\x1b" not in shown

    first = {path.name: path.read_bytes() for path in folder.iterdir()}
    report(study, "-o", folder)
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == first
    assert first["notes.txt"] == b"mine" and html.startswith("<!doctype html>")
    assert sorted(path.name for path in tmp_path.iterdir() if path.name.startswith(".")) == []


def test_several_experiments_and_several_parameters_and_unfinished_ones(
    tmp_path: Path, report: Callable[..., tuple[int, str, str]]
) -> None:
    store, folder = tmp_path / "study.db", tmp_path / "report"
    with write_store(store) as writer:
        writer.begin_study(FACTS, "build-7")
        two = {"width_mm": (80.0, 100.0), "radius_mm": (50.0, 60.0)}
        add_experiment(writer, "a/b", two, 4, width_outcome, TOLD, 3)
        add_experiment(writer, "single", {}, 2, lambda design, sample: "timeout", TOLD)
        add_experiment(writer, "later", {"width_mm": (80.0, 100.0)}, 5, width_outcome, TOLD, 0)
    code, shown, _ = report(store, "-o", folder)
    assert code == 0
    start = f"experiment_{file_name_part('a/b')}"
    svgs = {path.name for path in folder.glob("*.svg")}
    # Of several parameters nothing is averaged as the runs have it.
    assert {f"{start}_effects.svg", f"{start}_importance.svg"} < svgs
    assert len(svgs) == 3 and all(name.startswith(start) for name in svgs)
    said = " ".join(shown.split())
    for sentence in (
        "Unfinished: 12 of 16 runs are stored",
        "In simulation no design passes a single environment",
        "Unfinished: 0 of 10 runs are stored",
        "No run is stored yet.",
    ):
        assert sentence in said


def test_a_study_where_no_run_passed_is_drawn(tmp_path: Path, report: Callable[..., tuple[int, str, str]]) -> None:
    store, folder = tmp_path / "study.db", tmp_path / "report"
    with write_store(store) as writer:
        writer.begin_study(FACTS, "build-7")
        add_experiment(writer, "1", {"width_mm": (80.0, 100.0)}, 3, lambda design, sample: "tipped", TOLD)
    assert report(store, "-o", folder, "--no-replay")[0] == 0
    page = (folder / "index.html").read_text()
    assert "No replay: the report was made with --no-replay." in page and '<script type="text/plain"' not in page
    assert "In simulation no design passes a single environment." in page
    drawn = (folder / "experiment_1_time_by_width_mm.svg").read_text()
    assert "no run passed" in drawn
    assert "limit 120 s" in drawn


def test_mistakes_are_one_line_and_leave_nothing(
    study: Path, tmp_path: Path, report: Callable[..., tuple[int, str, str]]
) -> None:
    text, empty = tmp_path / "text.db", tmp_path / "empty.db"
    text.write_text("no database, but long enough to be taken for one by its size alone " * 20)
    with write_store(empty) as writer:
        writer.begin_study(FACTS, "build-7")
        add_experiment(writer, "1", {"width_mm": (80.0, 100.0)}, 3, width_outcome, TOLD, 0)
    before = sorted(path.name for path in tmp_path.iterdir())
    for store, folder, part in (
        (tmp_path / "none.db", tmp_path / "out", "none.db: "),
        (text, tmp_path / "out", "text.db: "),
        (empty, tmp_path / "out", "empty.db: contains no runs yet"),
        (study, text, "text.db: not a folder"),
    ):
        code, _, said = report(store, "-o", folder)
        assert code == 2
        assert said.startswith("foldcar: error: ")
        assert said.count("\n") == 1
        assert part in said
        assert sorted(path.name for path in tmp_path.iterdir()) == before


NAMES = ("a b", "a_b", "A_b", "a/b", "../x", "", " ", "ü", "中文", "x" * 300, "x" * 299 + "y", "con", "a_b_" + "0" * 8)


def test_every_experiment_has_figures_of_its_own_whatever_its_name(
    tmp_path: Path, report: Callable[..., tuple[int, str, str]]
) -> None:
    parts = [file_name_part(name) for name in NAMES]
    assert len({part.lower() for part in parts}) == len(NAMES)
    assert max(map(len, parts)) < 60 and all(part.isascii() and "/" not in part for part in parts)

    some = ("a_b", "../x")
    store, folder = tmp_path / "study.db", tmp_path / "report"
    with write_store(store) as writer:
        writer.begin_study(FACTS, "build-7")
        for number, name in enumerate(some):
            widths = (80.0, 100.0 + number)
            add_experiment(writer, name, {"width_mm": widths}, 2, lambda design, sample: "passed", TOLD)
    assert report(store, "-o", folder)[0] == 0

    files = [path.name for path in folder.iterdir()]
    assert len({name.lower() for name in files}) == len(files) == 12 * len(some) + 1
    # The widest car of an experiment stands on the axis of its figure.
    drawn = {path.read_text() for path in folder.glob("*success*.svg")}
    assert len(drawn) == len(some)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["report", "study.db"]
    page = Page((folder / "index.html").read_text())
    assert len(page.ids) == len(set(page.ids))
