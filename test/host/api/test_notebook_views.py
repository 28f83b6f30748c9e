"""What a notebook shows of a study, its advice, its comparison and a scene; and the figures that a script gets."""

import io
import json
import re
from base64 import b64decode
from pathlib import Path
from typing import Any

import numpy
import pytest
from matplotlib.figure import Figure
from PIL import Image

import foldcar
from conftest import STEP_PYRAMIDS
from foldcar.report import reported_experiment
from foldcar.simulation.carsim import Carsim
from foldcar.study.experiments import read_study
from foldcar.study.sweep import Sweep
from study_car import listing_of
from swept_listing import foldcar as command

TRIALS = "vehicle_type,outcome,source,width_mm,car_name\n" + "W_B_W,passed,notes,95,<b>Ada</b>\n" * 3


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory, carsim_binary: Path) -> foldcar.Study:
    """Three widths in four environments, and a hundred runs in other realities."""
    folder = tmp_path_factory.mktemp("notebook")
    listing = folder / "l.json"
    listing.write_text(json.dumps(listing_of(STEP_PYRAMIDS, {"width": [80, 95, 245]}, timeout=60, environments=4)))
    Sweep(read_study(listing), folder / "<study>.db", Carsim(carsim_binary), "a test", realities=100).run(2)
    return foldcar.Study(folder / "<study>.db")


def pictures(html: str) -> list[Any]:
    """The pictures of the HTML, each of which must be small and show something."""
    found = [b64decode(data) for data in re.findall(r"data:image/png;base64,([^\"]+)", html)]
    assert max(map(len, found), default=0) < 150_000
    images = [numpy.asarray(Image.open(io.BytesIO(png)).convert("RGB")) for png in found]
    assert all(image.std() > 10 for image in images)
    return images


def test_a_study_is_a_table_and_a_picture(study: foldcar.Study) -> None:
    html = study._repr_html_()

    assert len(pictures(html)) == 1
    assert "<td>3 designs</td><td>12 runs</td><td>0 trials</td>" in html
    assert "<study>" not in html and "&lt;study&gt;" in html
    assert repr(study).splitlines()[1:] == ["  experiment 1: W_B_W, step_pyramids.scenic, 3 designs, 12 runs, 0 trials"]


def test_advice_and_comparison_are_words_with_a_picture(study: foldcar.Study) -> None:
    advice, comparison = study.select(), study.compare()

    assert len(pictures(advice._repr_html_())) == 1
    assert advice[0].works in advice._repr_html_() and advice[0].works in repr(advice)
    # Without trials a notebook shows a sentence, and nothing to draw.
    assert repr(comparison) == comparison.sentence
    assert comparison._repr_html_() == f"<p><b>{comparison.sentence}</b></p>"


def test_a_comparison_names_each_design(study: foldcar.Study) -> None:
    file = study.path.with_name("trials.csv")
    file.write_text(TRIALS)
    driven = study.path.with_name("driven.db")
    driven.write_bytes(study.path.read_bytes())

    command("trials", "import", driven, file, "--experiment", "1")

    comparison = foldcar.Study(driven).compare()

    (line,) = repr(comparison).splitlines()[1:]
    assert re.fullmatch(r"  experiment 1, 95 mm: .* in simulation, 100 % \(44 % to 100 %\) in trials; .*", line)
    assert len(pictures(comparison._repr_html_())) == 1
    assert "<b>Ada" not in comparison._repr_html_()


def test_a_scene_is_seen_from_above() -> None:
    scene = foldcar.environment(STEP_PYRAMIDS, seed=42).scene(1)

    assert len(pictures(scene._repr_html_())) == 1
    assert repr(scene).endswith("seed=42, params={}).scene(1)")


def test_an_unknown_parameter_is_refused_when_the_environment_is_created() -> None:
    with pytest.raises(foldcar.FoldcarError, match="param rise: unknown; the program's parameters are: course_x_max"):
        foldcar.environment(STEP_PYRAMIDS, params={"rise": 3})


def test_figures_have_the_rates_of_the_study(study: foldcar.Study) -> None:
    figure = Figure()

    axes = study.plot_success(figure=figure)

    assert axes.figure is figure
    (line,) = [line for line in axes.lines if line.get_label() == "simulation, 95 % band"]
    widths, percents = line.get_data()
    rates = study.runs.groupby("width_mm")["passed"].mean()
    assert widths.tolist() == rates.index.tolist()
    assert percents.tolist() == pytest.approx((100 * rates.astype(float)).tolist())
    bars = study.plot_outcomes().patches
    assert sum(bar.get_height() for bar in bars) == pytest.approx(100 * len(rates))


def test_what_cannot_be_drawn_is_said(study: foldcar.Study) -> None:
    with pytest.raises(
        foldcar.FoldcarError, match="plot_effects: experiment 1 has nothing to draw here; its report shows"
    ):
        study.plot_effects()
    with pytest.raises(foldcar.FoldcarError, match='plot_success: there is no experiment "2"; there are 1'):
        study.plot_success(experiment="2")


def test_pictures_of_a_study_are_of_one_reading(study: foldcar.Study, monkeypatch: pytest.MonkeyPatch) -> None:
    read = []
    original = reported_experiment.read_experiments
    monkeypatch.setattr(reported_experiment, "read_experiments", lambda *a, **k: read.append(k) or original(*a, **k))
    fresh = foldcar.Study(study.path)

    for _ in range(2):
        fresh.plot_success(figure=Figure())
        fresh.select()._repr_html_()
    fresh.select(simulated_trials=True)._repr_html_()
    fresh.reload()
    fresh.plot_outcomes(figure=Figure())

    assert read == [{"simulated_trials": simulated} for simulated in (False, True, False)]
