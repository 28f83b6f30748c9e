"""`foldcar report` as a user types it, on stores written as a sweep writes them."""

import re
import sys
import time
from collections.abc import Callable, Mapping
from html.parser import HTMLParser
from itertools import product
from pathlib import Path
from typing import Any

import pytest
from pypdf import PdfReader

from foldcar.cli import main
from foldcar.report.file_names import file_name_part
from foldcar.store.writer import (
    PlannedDesign,
    PlannedExperiment,
    StoreWriter,
    write_store,
)
from page_check import page_findings
from written_study import RULE

WIDTHS = tuple(float(width) for width in range(65, 250, 5))
FACTS = {
    "foldcar_version": "0.1.0",
    "scenic_version": "3.1.1",
    "carsim_build": "build-7",
    "listing_name": "study.json",
    "listing_text": '{"experiments": "<&>"}',
    "command": "foldcar sweep study.json --store study.db",
    "created_utc": "2025-01-02T03:04:05",
}
Outcome = Callable[[Mapping[str, float], int], str]


def width_outcome(design: Mapping[str, float], sample: int) -> str:
    """Narrow cars tip, wide ones get stuck, medium ones pass; the thresholds move with the sample."""
    if design["width_mm"] < 80 + sample % 10:
        return "tipped"
    return "stuck" if design["width_mm"] > 190 - sample % 40 else "passed"


def add_experiment(
    writer: StoreWriter,
    name: str,
    varied: Mapping[str, tuple[float, ...]],
    samples: int,
    stored: int,
    outcome: Outcome,
) -> None:
    """Plan every combination of ``varied`` in ``samples`` environments; the first ``stored`` have results."""
    environment = writer.environment(f"environment of {name}")
    facts: dict[str, Any] = {
        "vehicle_type": "W_B_W",
        "varied": varied,
        "fixed": {"height_mm": 50.0},
        "timeout_s": 120.0,
        "speed_m_s": None,
        "yaw_rate_rad_s": 0.0,
        "scenic_program": "step_pyramids.scenic",
        "scenic_params": {"friction": 0.6},
        "seed": 42,
        "condition": {"sample": 3, "objects": ["bump"], "params": ["friction"]},
        "variation": {"supply_v": 0.2},
        "variation_seed": 42,
        **RULE,
    }
    spread = writer.spread("nominal")
    plan = PlannedExperiment(name, "car", "pyramids", environment, spread, samples, facts)
    designs = [
        {**dict(zip(varied, values, strict=True)), "height_mm": 50.0} for values in product(*varied.values())
    ]
    writer.put_experiment(
        plan, [PlannedDesign(design, {"id": name, **design}, {"time_limit_s": 120}) for design in designs]
    )
    for sample in range(samples):
        writer.put_sample(environment, sample, {"of": name, "sample": sample})
        writer.put_draw(spread, sample, {})
    for sample in range(stored):
        chunk = []
        for run in writer.planned_runs(plan, sample):
            design = designs[run.design]
            ending = {
                "outcome": outcome(design, sample),
                "elapsed_time_s": 2.0 + run.design / 100,
                "distance_to_target_m": 0.1,
                "consumed_energy_j": 3.0,
                "max_roll_rad": 0.2,
                "max_pitch_rad": 0.3,
            }
            chunk.append((run, ending))
        writer.add_results(chunk)


@pytest.fixture
def study(tmp_path: Path) -> Path:
    """A finished width study: 37 widths in 100 environments."""
    store = tmp_path / "study.db"
    with write_store(store) as writer:
        writer.begin_study(FACTS, "build-7")
        add_experiment(writer, "1", {"width_mm": WIDTHS}, 100, 100, width_outcome)
    return store


@pytest.fixture
def report(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> Callable[..., tuple[int, str, str]]:
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


def test_a_width_study_gives_one_page_and_five_figures_within_ten_seconds(
    study: Path, tmp_path: Path, report: Callable[..., tuple[int, str, str]]
) -> None:
    folder = tmp_path / "report"
    started_s = time.process_time()
    code, shown, said = report(study, "-o", folder)
    # Of the processor: what else the machine does takes none of it.
    assert time.process_time() - started_s < 10.0
    assert (code, said) == (0, "")
    figures = [f"experiment_1_{kind}_by_width_mm" for kind in ("outcomes", "success", "time", "feasibility")]
    figures.append("experiment_1_environments")
    names = [f"{figure}{suffix}" for figure in figures for suffix in (".pdf", ".png", ".svg")]
    assert sorted(path.name for path in folder.iterdir()) == sorted([*names, "index.html"])

    page = Page((folder / "index.html").read_text())
    assert len(page.ids) == len(set(page.ids))
    assert all(reference.startswith("#") and reference[1:] in page.ids for reference in page.references)
    html = (folder / "index.html").read_text()
    assert page_findings(html) == []
    pdf = PdfReader(folder / f"{figures[1]}.pdf").pages[0]
    assert "passed (%)" in pdf.extract_text() and pdf.mediabox.width == pytest.approx(7.2 * 72, rel=0.1)
    assert html.count("<svg") == 2 * len(figures)
    assert not re.search(r"url\((?!#)|@import|<script [^>]*src|<link|<img", html)
    assert "No replay: the runs are of carsim build build-7, and the one here is " in page.text
    passed = sum(
        width_outcome({"width_mm": width}, sample) == "passed" for width in WIDTHS for sample in range(100)
    )
    assert f"{passed} of 3700 runs passed" in page.text
    for fact in (
        *FACTS.values(),
        f"foldcar report {study} -o {folder}",
        "friction = 0.6",
        "100, seed 42",
        "120 s",
        "as in sample 3:\nbump, friction",
        "seed 42; spread: supply_v = 0.2",
    ):
        assert fact in page.text

    rows = [line.split() for line in shown.splitlines()]
    assert ["65", "100", "0.0", "0.0", "-", "3.7", "-", "100", "0"] in rows
    at_80 = sum(width_outcome({"width_mm": 80.0}, sample) == "passed" for sample in range(100))
    assert [row[2] for row in rows if row[:1] == ["80"]] == [f"{at_80:.1f}"]
    assert shown.splitlines()[-1] == f"report: {folder / 'index.html'}"
    assert "\x1b" not in shown


def test_the_same_store_gives_the_same_figures_and_replaces_the_old_ones(
    study: Path, tmp_path: Path, report: Callable[..., tuple[int, str, str]]
) -> None:
    folder = tmp_path / "report"
    folder.mkdir()
    (folder / "notes.txt").write_text("mine")
    (folder / "index.html").write_text("old")
    report(study, "-o", folder)
    first = {path.name: path.read_bytes() for path in folder.iterdir()}
    report(study, "-o", folder)
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == first
    assert first["notes.txt"] == b"mine"
    assert first["index.html"].startswith(b"<!doctype html>")
    assert sorted(path.name for path in tmp_path.iterdir() if path.name.startswith(".")) == []


def test_several_experiments_and_several_parameters_and_unfinished_ones(
    tmp_path: Path, report: Callable[..., tuple[int, str, str]]
) -> None:
    store, folder = tmp_path / "study.db", tmp_path / "report"
    with write_store(store) as writer:
        writer.begin_study(FACTS, "build-7")
        two = {"width_mm": (80.0, 100.0), "radius_mm": (50.0, 60.0)}
        add_experiment(writer, "a/b", two, 4, 3, width_outcome)
        add_experiment(writer, "single", {}, 2, 2, lambda design, sample: "timeout")
        add_experiment(writer, "later", {"width_mm": (80.0, 100.0)}, 5, 0, width_outcome)
    code, shown, _ = report(store, "-o", folder)
    assert code == 0
    start = f"experiment_{file_name_part('a/b')}"
    kinds = ("feasibility", "outcomes", "slices", "success")
    names = [f"{start}_{kind}_by_{name}.svg" for kind in kinds for name in sorted(two)]
    names.append(f"{start}_map_by_width_mm_and_radius_mm.svg")
    assert sorted(path.name for path in folder.glob("*.svg")) == sorted(names)
    text = Page((folder / "index.html").read_text()).text
    for sentence in (
        "Unfinished: 12 of 16 runs are stored",
        "2 parameters vary (width (mm), radius (mm))",
        "One design: no parameter varies",
        "Unfinished: 0 of 10 runs are stored",
        "No run is stored yet.",
    ):
        assert sentence in text
    assert "Unfinished: 12 of 16 runs are stored" in shown


def test_a_study_where_no_run_passed_is_drawn(
    tmp_path: Path, report: Callable[..., tuple[int, str, str]]
) -> None:
    store, folder = tmp_path / "study.db", tmp_path / "report"
    with write_store(store) as writer:
        writer.begin_study(FACTS, "build-7")
        add_experiment(writer, "1", {"width_mm": (80.0, 100.0)}, 3, 3, lambda design, sample: "tipped")
    assert report(store, "-o", folder, "--no-replay")[0] == 0
    page = (folder / "index.html").read_text()
    assert "No replay: the report was made with --no-replay." in page and '<script type="text/plain"' not in page
    assert "In simulation, no width passes a single environment." in page
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
        add_experiment(writer, "1", {"width_mm": (80.0, 100.0)}, 3, 0, width_outcome)
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

    some = ("a b", "a_b", "../x")
    store, folder = tmp_path / "study.db", tmp_path / "report"
    with write_store(store) as writer:
        writer.begin_study(FACTS, "build-7")
        for number, name in enumerate(some):
            widths = (80.0, 100.0 + number)
            add_experiment(writer, name, {"width_mm": widths}, 2, 2, lambda design, sample: "passed")
    assert report(store, "-o", folder)[0] == 0

    files = [path.name for path in folder.iterdir()]
    assert len({name.lower() for name in files}) == len(files) == 12 * len(some) + 1
    # The widest car of an experiment stands on the axis of its figure.
    drawn = {path.read_text() for path in folder.glob("*success*.svg")}
    assert len(drawn) == len(some)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["report", "study.db"]
    page = Page((folder / "index.html").read_text())
    assert len(page.ids) == len(set(page.ids))
