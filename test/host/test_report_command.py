"""`foldcar report` as a user types it, on stores written as a sweep writes them."""

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
from foldcar.report.file_names import file_name_part
from foldcar.store.writer import write_store
from page_check import page_findings, study_of
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
    """What a page refers to, and its ids."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.references: list[str] = []
        self.ids: list[str] = []
        self.feed(html)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        for name, value in attrs:
            if name in ("href", "src", "xlink:href", "data"):
                self.references.append(str(value))
            if name == "id":
                self.ids.append(str(value))


def test_a_width_study_gives_one_page_and_five_figures_within_ten_seconds_and_the_same_again(
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
    figures.append("experiment_1_environments")
    names = [f"{figure}{suffix}" for figure in figures for suffix in (".pdf", ".png", ".svg")]
    assert sorted(path.name for path in folder.iterdir()) == sorted([*names, "index.html", "notes.txt"])

    html = (folder / "index.html").read_text()
    markup = re.sub(r"(<script)[^>]*>.*?(</script>)", r"\1>\2", html, flags=re.DOTALL)
    page = Page(markup)
    assert len(page.ids) == len(set(page.ids))
    assert all(reference.startswith("#") and reference[1:] in page.ids for reference in page.references)
    assert page_findings(markup) == []
    pdf = PdfReader(folder / f"{figures[1]}.pdf").pages[0]
    assert "passed (%)" in pdf.extract_text() and pdf.mediabox.width == pytest.approx(7.2 * 72, rel=0.1)
    assert not re.search(r"url\((?!#)|@import|<script [^>]*src|<link|<img", markup)
    (one,) = study_of(folder)["experiments"]
    assert {address for _, address in one["files"]} == {f"{figure}.svg" for figure in figures}
    assert any("No replay: the runs are of carsim build build-7, and the one here is " in text for text in one["remarks"])
    passed = sum(width_outcome({"width_mm": width}, sample) == "passed" for width in WIDTHS for sample in range(100))
    assert (sum(one["designs"]["passed"]), sum(one["designs"]["runs"])) == (passed, 3700)
    told = "\n".join(text for _, text in one["provenance"])
    for fact in (
        *FACTS.values(),
        f"foldcar report {study} -o {folder}",
        "friction 0.6",
        "100, seed 42",
        "120 s",
        "as in sample 3: bump, friction",
        "seed 42; spread: supply_v 0.2",
    ):
        assert fact in told

    rows = [line.split() for line in shown.splitlines()]
    assert ["65", "100", "0.0", "0.0", "-", "3.7", "-", "100", "0"] in rows
    at_80 = sum(width_outcome({"width_mm": 80.0}, sample) == "passed" for sample in range(100))
    assert [row[2] for row in rows if row[:1] == ["80"]] == [f"{at_80:.1f}"]
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
    kinds = ("feasibility", "outcomes", "slices", "success")
    names = [f"{start}_{kind}_by_{name}.svg" for kind in kinds for name in sorted(two)]
    names.append(f"{start}_map_by_width_mm_and_radius_mm.svg")
    assert sorted(path.name for path in folder.glob("*.svg")) == sorted(names)
    several, single, later = study_of(folder)["experiments"]
    assert any("Unfinished: 12 of 16 runs are stored" in text for text in several["remarks"])
    assert [one["label"] for one in several["parameters"]] == ["width", "radius"] and single["parameters"] == []
    assert any("Unfinished: 0 of 10 runs are stored" in text for text in later["remarks"])
    assert "Unfinished: 12 of 16 runs are stored" in shown


def test_a_study_where_no_run_passed_is_drawn(tmp_path: Path, report: Callable[..., tuple[int, str, str]]) -> None:
    store, folder = tmp_path / "study.db", tmp_path / "report"
    with write_store(store) as writer:
        writer.begin_study(FACTS, "build-7")
        add_experiment(writer, "1", {"width_mm": (80.0, 100.0)}, 3, lambda design, sample: "tipped", TOLD)
    assert report(store, "-o", folder, "--no-replay")[0] == 0
    page = (folder / "index.html").read_text()
    assert "No replay: the report was made with --no-replay." in page and '<script type="text/plain"' not in page
    (one,) = study_of(folder)["experiments"]
    assert one["designs"]["passed"] == [0, 0] and one["headline"]
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
    assert [one["id"] for one in study_of(folder)["experiments"]] == list(some)
