"""Figures for papers beside the page, from stores written as a sweep writes them."""

import re
from pathlib import Path
from typing import Any

import numpy
import pytest
from matplotlib.collections import QuadMesh
from threadpoolctl import threadpool_limits
from typer.testing import CliRunner

from foldcar.cli import app
from foldcar.figures.page import inline_svg
from foldcar.report.across_plot import across_rates
from foldcar.report.effect_plots import draw_effects, draw_map, edges
from foldcar.report.environment_groups import environment_groups
from foldcar.report.page_data import Experiment, page_data, read_experiments
from foldcar.report.paper_figures import drawings
from foldcar.report.parameter_plots import BLUE, GREEN, NAVY, axis_label, draw_feasibility, error_percent, success_colour
from foldcar.store.reader import Store
from foldcar.store.writer import write_store
from written_study import BUILD, FACTS, add_experiment, add_trials, write_study

WIDTHS, RADII, SAMPLES = tuple(float(w) for w in range(60, 160, 20)), (40.0, 50.0, 60.0, 70.0), 20
HEIGHTS = (0.006, 0.018, 0.03)


def passes(design: Any, sample: int) -> str:
    """Wider and larger cars pass in more of the samples."""
    share = 1 / (1 + numpy.exp(-((design["width_mm"] - 100) / 12 + (design["radius_mm"] - 55) / 6)))
    return "passed" if sample < round(share * SAMPLES) else "tipped"


@pytest.fixture(scope="module")
def two(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A study over width and radius, and of bumps of three heights, one experiment each."""
    store = tmp_path_factory.mktemp("maps") / "study.db"
    write_study(store, {"width_mm": WIDTHS, "radius_mm": RADII}, SAMPLES, passes)
    with write_store(store) as writer:
        writer.begin_study(FACTS, BUILD)
        for height in HEIGHTS:
            facts = {"scenic_program": "bumps.scenic", "scenic_params": {"bump_height": height, "gap": 0.3}}
            good = round(10 * (1 - height / 0.03))
            ended = lambda d, s, good=good: "passed" if s < good else "tipped"  # noqa: E731
            add_experiment(writer, f"{height:g}", {"radius_mm": RADII}, 10, ended, facts)
        unset = {"scenic_program": "bumps.scenic", "scenic_params": {"gap": 0.3}}
        add_experiment(writer, "own", {"radius_mm": RADII}, 10, lambda d, s: "passed", unset)
    return store


@pytest.fixture(scope="module")
def experiments(two: Path) -> dict[str, Experiment]:
    with Store.open(two) as store:
        return {one.name: one for one in read_experiments(store)}


def test_several_parameters_have_effects_and_a_map_and_no_raw_average(experiments: dict[str, Experiment]) -> None:
    one = experiments["1"]

    names = [each.name for each in drawings(one.designs, one.effects, one.places, one.thresholds, 0)]

    assert names == [
        "experiment_1_effects", "experiment_1_importance", "experiment_1_map_by_width_mm_and_radius_mm",
    ]  # fmt: skip


def test_the_map_has_the_rates_of_the_designs_and_the_effects_their_means(experiments: dict[str, Experiment]) -> None:
    one = experiments["1"]
    assert one.effects is not None
    passed, runs = one.designs.counted.T
    shares = (passed / runs).reshape(len(WIDTHS), len(RADII))

    with threadpool_limits(1):
        axes = draw_map(one.designs, one.effects, one.places, (0, 1), (0.5, 0.75)).axes[0]
        (across, _) = draw_effects(one.designs, one.effects, one.places, (0.5,)).axes[:2]

    (mesh,) = [each for each in axes.collections if isinstance(each, QuadMesh)]
    assert numpy.asarray(mesh.get_array()).reshape(len(RADII), len(WIDTHS)) == pytest.approx(100 * shares.T, abs=12)
    mean = next(line for line in across.lines if line.get_marker() == "o")
    assert mean.get_ydata() == pytest.approx(100 * shares.mean(axis=1), abs=8)


def test_the_region_is_tinted_where_simulation_and_trials_together_say_so(tmp_path: Path) -> None:
    store = tmp_path / "s.db"
    write_study(store, {"width_mm": WIDTHS}, 100, lambda design, sample: "passed")
    with Store.open(store) as opened:
        (before,) = page_data(opened)["experiments"]
    add_trials(store, [({"width_mm": 100.0}, sample, "tipped") for sample in range(20)])

    with Store.open(store) as opened:
        (one,) = read_experiments(opened)
        axes = draw_feasibility(one.designs, (0.75,)).axes[0]

    assert before["designs"]["verdict"] == ["good"] * len(WIDTHS)
    assert one.designs.believed[2] is not None and one.designs.believed[2][0] < 0.3
    tinted = [patch.get_x() + patch.get_width() / 2 for patch in axes.patches]
    assert 100.0 not in tinted


def test_colours_are_the_papers_and_of_any_thresholds() -> None:
    assert [success_colour(s, (0.5, 0.75)) for s in (0.49, 0.5, 0.75, 0.76)] == [NAVY, BLUE, BLUE, GREEN]
    assert [success_colour(s, (0.9,)) for s in (0.9, 0.91)] == [NAVY, GREEN]
    assert len({success_colour(s, (0.2, 0.4, 0.6, 0.8)) for s in (0.1, 0.3, 0.5, 0.7, 0.9)}) == 5


def test_labels_borders_and_bars() -> None:
    assert [axis_label(name) for name in ("wheel_radius_mm", "supply_v", "tyre_pattern")] == [
        "wheel radius (mm)", "supply (V)", "tyre pattern",
    ]  # fmt: skip
    assert edges(numpy.array([0.0, 2.0, 6.0])).tolist() == [-1, 1, 4, 8]
    assert numpy.min(error_percent(1.0, (0.9, 1.0 - 1e-12))) == 0


def test_experiments_that_differ_in_one_number_are_a_group(experiments: dict[str, Experiment]) -> None:
    designs = {name: one.designs for name, one in experiments.items()}
    (group,) = environment_groups(one.info for one in designs.values())

    rates = across_rates(group, designs)

    assert (group.parameter, tuple(group.experiments), group.others) == ("bump_height", HEIGHTS, {"gap": 0.3})
    assert group.remarks == (
        "Experiment own does not set bump_height: the program's own value is not in the store; it is not drawn.",
    )
    assert list(rates) == [f"{radius:g} mm" for radius in RADII]
    assert all(counts == [(round(10 * (1 - height / 0.03)), 10) for height in HEIGHTS] for counts in rates.values())


def test_the_report_shows_the_environments_parameter_and_takes_options(tmp_path: Path) -> None:
    store, folder = tmp_path / "study.db", tmp_path / "report"
    with write_store(store) as writer:
        writer.begin_study(FACTS, BUILD)
        for height, samples in zip(HEIGHTS, (5, 5, 2), strict=True):
            facts = {"scenic_program": "bumps.scenic", "scenic_params": {"bump_height": height}}
            add_experiment(writer, f"{height:g}", {}, samples, lambda d, s: "passed", facts)
    words = ["report", str(store), "-o", str(folder), "--no-replay", "--threshold", "0.8", "--threshold", "0.6"]
    done = CliRunner().invoke(app, [*words, "--sample", "3"])
    assert done.exit_code == 0, done.output
    names = {path.name for path in folder.iterdir()}
    assert names == {"index.html", *(f"across_1_bump_height_success.{suffix}" for suffix in ("svg", "png", "pdf"))}
    html = (folder / "index.html").read_text()
    assert "--threshold 0.6 --threshold 0.8 --sample 3" in html
    assert len(re.findall("There is no environment 3 here", done.output)) == 1

    refused = CliRunner().invoke(app, [*words, "--sample", "5"])
    assert refused.exit_code != 0 and "--sample: 5 is not among" in str(refused.exception)


def test_inlined_figures_share_no_names() -> None:
    svg = (
        '<?xml version="1.0"?>\n<!DOCTYPE svg>\n<svg width="10pt" height="5pt" viewBox="0 0 10 5">'
        '<metadata>made</metadata><defs><g id="a"/></defs><use xlink:href="#a" clip-path="url(#c)"/></svg>'
    )
    inlined = inline_svg(svg, "one", 'width < "95"')
    assert inlined == (
        '<svg role="img" aria-label="width &lt; &quot;95&quot;" viewBox="0 0 10 5">'
        '<defs><g id="one-a"/></defs><use xlink:href="#one-a" clip-path="url(#one-c)"/></svg>'
    )
