"""`foldcar report` as a user types it, on stores written as a sweep writes them, and the figures for papers."""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy
import pytest
from matplotlib.collections import QuadMesh
from pypdf import PdfReader
from threadpoolctl import threadpool_limits
from typer.testing import CliRunner

import written_study
from browser import study_of
from foldcar.cli import app
from foldcar.outputs import file_name_part
from foldcar.report.page_data import page_data
from foldcar.report.paper_figures import (
    BLUE,
    GREEN,
    NAVY,
    axis_label,
    draw_effects,
    draw_feasibility,
    draw_map,
    drawings,
    error_percent,
    success_colour,
)
from foldcar.report.reported_experiment import read_experiments
from foldcar.store.reader import Store
from foldcar.store.writer import write_store
from written_study import add_experiment, add_trials, write_realities, write_study

WIDTHS, SAMPLES = tuple(float(width) for width in range(65, 250, 15)), 40
FACTS = {**written_study.FACTS, "listing_text": '{"experiments": "<&>"}'}
EXPERIMENT_FACTS = {
    "scenic_params": {"friction": 0.6},
    "condition": {"sample": 3, "objects": ["bump"], "params": ["friction"]},
    "variation": {"supply_v": 0.2},
}


def width_outcome(design: Mapping[str, float], sample: int) -> str:
    """Narrow cars tip, wide ones get stuck, medium ones pass; the thresholds move with the sample."""
    if design["width_mm"] < 80 + sample % 10:
        return "tipped"
    return "stuck" if design["width_mm"] > 190 - sample else "passed"


@pytest.fixture
def study(tmp_path: Path) -> Path:
    store = tmp_path / "study.db"
    with write_store(store) as writer:
        writer.begin_study(FACTS, "build-7")
        add_experiment(writer, "1", {"width_mm": WIDTHS}, SAMPLES, width_outcome, EXPERIMENT_FACTS)
    return store


def report(*arguments: str | Path) -> tuple[int, str]:
    """Exit code and output of the command, or its error."""
    done = CliRunner().invoke(app, ["report", *map(str, arguments)])
    return done.exit_code, done.output + (str(done.exception) if done.exit_code else "")


def test_a_width_study_gives_one_page_with_figures_and_the_same_again(study: Path, tmp_path: Path) -> None:
    folder = tmp_path / "report"
    folder.mkdir()
    (folder / "notes.txt").write_text("mine")
    (folder / "index.html").write_text("old")
    words = (study, "-o", folder, "--threshold", "0.8", "--threshold", "0.6")
    code, shown = report(*words)
    assert code == 0
    figures = [f"experiment_1_{kind}_by_width_mm" for kind in ("outcomes", "success", "feasibility")]
    names = [f"{figure}{suffix}" for figure in figures for suffix in (".pdf", ".png", ".svg")]
    assert sorted(path.name for path in folder.iterdir()) == sorted([*names, "index.html", "notes.txt"])

    pdf = PdfReader(folder / f"{figures[1]}.pdf").pages[0]
    assert "passed (%)" in pdf.extract_text() and pdf.mediabox.width == pytest.approx(7.2 * 72, rel=0.1)
    html = (folder / "index.html").read_text()
    assert html.startswith("<!doctype html>") and not re.search(r"<script [^>]*src|<link|<img", html)
    (experiment,) = study_of(folder)["experiments"]
    sentence = "may run beside the simulation; `foldcar view --run` shows its runs"
    assert any(sentence in text for text in experiment["remarks"])
    passed = [sum(width_outcome({"width_mm": width}, k) == "passed" for k in range(SAMPLES)) for width in WIDTHS]
    assert experiment["designs"]["passed"] == passed and experiment["thresholds"] == [0.6, 0.8]
    facts = " ".join(text for _, text in experiment["provenance"])
    for fact in (
        *(FACTS[name] for name in ("foldcar_version", "scenic_version", "created_utc", "command", "listing_text")),
        f"foldcar report {study} -o {folder} --threshold 0.6 --threshold 0.8",
        "friction 0.6",
        f"{SAMPLES}, seed 42",
        "120 s",
        "as in sample 3: bump, friction",
        "seed 42; spread: supply_v 0.2",
    ):
        assert fact in facts
    assert sorted(address for _, address in experiment["files"]) == sorted(f"{figure}.svg" for figure in figures)

    rows = [line.split() for line in shown.splitlines()]
    assert [row[2:4] for row in rows if row[:2] == ["80", "mm"]] == [[str(SAMPLES), f"{100 * passed[1] / SAMPLES:.1f}"]]
    assert shown.splitlines()[-1] == f"report: {folder / 'index.html'}" and "\x1b" not in shown

    first = {path.name: path.read_bytes() for path in folder.iterdir()}
    report(*words)
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == first
    assert first["notes.txt"] == b"mine"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["report", "study.db"]


def test_several_experiments_and_several_parameters_and_unfinished_ones(tmp_path: Path) -> None:
    store, folder = tmp_path / "study.db", tmp_path / "report"
    with write_store(store) as writer:
        writer.begin_study(FACTS, "build-7")
        two = {"width_mm": (80.0, 100.0), "radius_mm": (50.0, 60.0)}
        add_experiment(writer, "a/b", two, 4, width_outcome, EXPERIMENT_FACTS, 3)
        add_experiment(writer, "../x", {"width_mm": (80.0, 100.0)}, 3, lambda design, sample: "tipped", EXPERIMENT_FACTS)
        add_experiment(writer, "later", {"width_mm": (80.0, 100.0)}, 5, width_outcome, EXPERIMENT_FACTS, 0)
    code, shown = report(store, "-o", folder)
    assert code == 0
    starts = [f"experiment_{file_name_part(name)}" for name in ("a/b", "../x")]
    # Of several parameters nothing is averaged as the runs have it.
    kinds = [f"{starts[0]}_{kind}" for kind in ("effects", "map_by_width_mm_and_radius_mm")]
    kinds += [f"{starts[1]}_{kind}_by_width_mm" for kind in ("feasibility", "success", "outcomes")]
    assert {path.name for path in folder.glob("*.svg")} == {f"{kind}.svg" for kind in kinds}
    assert sorted(path.name for path in tmp_path.iterdir()) == ["report", "study.db"]
    text = " ".join(shown.split())
    for sentence in (
        "Unfinished: 12 of 16 planned runs are here.",
        "In simulation no run passed",
        "Unfinished: 0 of 10 planned runs are here.",
        "No run is stored yet.",
    ):
        assert sentence in text


def test_tables_and_sentences_round_no_rate_to_0_or_100_per_cent(tmp_path: Path, foldcar: Any) -> None:
    """One run of 3000 differs from all others of its design."""
    write_study(
        tmp_path / "s.db", {"width_mm": [95.0, 115.0]}, 3000,
        lambda design, sample: "tipped" if (sample == 7) == (design["width_mm"] == 95) else "passed",
    )  # fmt: skip

    report, select = foldcar("report", "s.db", "-o", "r"), foldcar("select", "s.db")

    assert (report.returncode, select.returncode) == (0, 0), report.stderr + select.stderr
    rows = [line.split("  ") for line in report.stdout.splitlines() if line.strip().startswith(("95 mm", "115 mm"))]
    assert [[cell.strip() for cell in row if cell.strip()][1:4] for row in rows] == [
        ["3000", ">99.9", "99.8–>99.9"], ["3000", "<0.1", "<0.1–0.2"],
    ]  # fmt: skip
    for text in (report.stdout, select.stdout):
        assert not re.search(r"(?<![\d.])(0|0\.0|100|100\.0)( %|\)|–| \()", text), text


def test_mistakes_are_one_line_and_leave_nothing(study: Path, tmp_path: Path) -> None:
    text, empty = tmp_path / "text.db", tmp_path / "empty.db"
    text.write_text("no database, but long enough to be taken for one by its size alone " * 20)
    with write_store(empty) as writer:
        writer.begin_study(FACTS, "build-7")
        add_experiment(writer, "1", {"width_mm": (80.0, 100.0)}, 3, width_outcome, EXPERIMENT_FACTS, 0)
    before = sorted(path.name for path in tmp_path.iterdir())
    for store, folder, part in (
        (tmp_path / "none.db", tmp_path / "out", "none.db: "),
        (text, tmp_path / "out", "text.db: "),
        (empty, tmp_path / "out", "empty.db: contains no runs yet"),
        (study, text, "text.db: not a folder"),
    ):
        code, output = report(store, "-o", folder)
        assert code != 0 and part in output and output.count("\n") <= 1
        assert sorted(path.name for path in tmp_path.iterdir()) == before


NAMES = ("a b", "a_b", "A_b", "a/b", "../x", "", " ", "ü", "中文", "x" * 300, "x" * 299 + "y", "con", "a_b_" + "0" * 8)


def test_every_experiment_has_files_of_its_own_whatever_its_name() -> None:
    parts = [file_name_part(name) for name in NAMES]

    assert len({part.lower() for part in parts}) == len(NAMES)
    assert max(map(len, parts)) < 60 and all(part.isascii() and "/" not in part for part in parts)


def test_the_map_has_the_rates_of_the_designs_and_the_effects_their_means(tmp_path: Path) -> None:
    widths, radii, samples = tuple(float(width) for width in range(60, 160, 20)), (40.0, 50.0, 60.0, 70.0), 20

    def passes(design: Any, sample: int) -> str:
        """Wider and larger cars pass in more of the samples."""
        share = 1 / (1 + numpy.exp(-((design["width_mm"] - 100) / 12 + (design["radius_mm"] - 55) / 6)))
        return "passed" if sample < round(share * samples) else "tipped"

    with Store.open(write_study(tmp_path / "s.db", {"width_mm": widths, "radius_mm": radii}, samples, passes)) as store:
        (experiment,) = read_experiments(store)
    assert experiment.effects is not None
    passed, runs = experiment.evidence.run_counts.T
    shares = (passed / runs).reshape(len(widths), len(radii))

    names = [
        drawing.name
        for drawing in drawings(
            experiment.columns, experiment.effects, experiment.parameter_indices, experiment.thresholds
        )
    ]
    with threadpool_limits(1):
        axes = draw_map(experiment.columns, experiment.effects, experiment.parameter_indices, (0, 1), (0.5, 0.75)).axes[0]
        (across, _) = draw_effects(experiment.columns, experiment.effects, experiment.parameter_indices, (0.5,)).axes[:2]

    assert names == ["experiment_1_effects", "experiment_1_map_by_width_mm_and_radius_mm"]
    (mesh,) = [collection for collection in axes.collections if isinstance(collection, QuadMesh)]
    assert numpy.asarray(mesh.get_array()).reshape(len(radii), len(widths)) == pytest.approx(100 * shares.T, abs=12)
    mean = next(line for line in across.lines if line.get_marker() == "o")
    assert mean.get_ydata() == pytest.approx(100 * shares.mean(axis=1), abs=8)


@pytest.mark.parametrize("judged", [True, False])
def test_the_table_of_a_large_family_has_its_best_designs_if_success_is_defined(judged: bool, tmp_path: Path) -> None:
    widths = [float(width) for width in range(60, 140)]
    # Nothing is said of built cars. A design passes in as many of 20 samples as its width is above 100 mm, at most 20.
    store = write_study(
        tmp_path / "s.db", {"width_mm": widths}, 20,
        lambda design, sample: "passed" if sample < design["width_mm"] - 100 else "stuck", success_defined=judged,
    )  # fmt: skip

    code, shown = report(store, "-o", tmp_path / "report")

    assert code == 0 and f"The table has the {'best' if judged else 'first'} 60 of 80 designs" in shown
    shown_widths = [float(width) for width in re.findall(r"^(\d+) mm +20 ", shown, re.MULTILINE)]
    # Equal designs in the order of the family.
    best_first = sorted(widths, key=lambda width: -min(20, max(0, width - 100)))
    assert shown_widths == (best_first if judged else widths)[:60]


def test_designs_that_all_pass_have_their_figures(tmp_path: Path) -> None:
    varied = {"width_mm": (80.0, 100.0), "radius_mm": (40.0, 50.0)}
    with Store.open(write_study(tmp_path / "s.db", varied, 20, lambda design, sample: "passed")) as store:
        (experiment,) = read_experiments(store)

    assert experiment.effects is not None
    args = experiment.columns, experiment.effects, experiment.parameter_indices, experiment.thresholds
    assert [drawing.name for drawing in drawings(*args)][-1] == "experiment_1_map_by_width_mm_and_radius_mm"


def test_the_region_is_tinted_where_simulation_and_trials_together_say_so(tmp_path: Path) -> None:
    widths = tuple(float(width) for width in range(60, 160, 20))
    store = write_study(tmp_path / "s.db", {"width_mm": widths}, 100, lambda design, sample: "passed")
    write_realities(store, lambda scores, design: 4 + 3 * scores["friction"])
    with Store.open(store) as opened:
        (before,) = page_data(opened)["experiments"]
    add_trials(store, [({"width_mm": 100.0}, sample, "tipped") for sample in range(20)])

    with Store.open(store) as opened:
        (experiment,) = read_experiments(opened)
        axes = draw_feasibility(experiment.columns, (0.75,)).axes[0]
        (at,) = (k for k, name in enumerate(experiment.columns.names) if name == "100 mm")

    assert before["designs"]["verdict"] == ["good"] * len(widths)
    built = experiment.columns.built[at]
    assert built is not None and built[0] < 0.3
    assert 100.0 not in [patch.get_x() + patch.get_width() / 2 for patch in axes.patches]


def test_colours_labels_and_bars() -> None:
    assert [success_colour(s, (0.5, 0.75)) for s in (0.49, 0.5, 0.75, 0.76)] == [NAVY, BLUE, BLUE, GREEN]
    assert len({success_colour(s, (0.2, 0.4, 0.6, 0.8)) for s in (0.1, 0.3, 0.5, 0.7, 0.9)}) == 5
    labels = [axis_label(name) for name in ("wheel_radius_mm", "supply_v")]
    assert labels == ["wheel radius (mm)", "supply (V)"]
    assert numpy.min(error_percent(1.0, (0.9, 1.0 - 1e-12))) == 0
