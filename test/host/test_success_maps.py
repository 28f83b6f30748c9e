"""Success over two design parameters and by an environment's parameter, from stores written as a sweep writes them."""

import math
import re
from pathlib import Path

import numpy
import pytest
from matplotlib.patches import Rectangle
from typer.testing import CliRunner

from foldcar.cli import app
from foldcar.report.design_matrix import design_matrix
from foldcar.report.design_table import Count, DesignTable, every, mean_interval, read_table, spread
from foldcar.report.environment_groups import environment_groups
from foldcar.report.environment_plot import joined_table
from foldcar.report.heat_map import draw_map, edges, is_open
from foldcar.report.map_plan import MOST_PANELS, Panel, plan_map
from foldcar.report.slices import Slices, draw_slices
from foldcar.report.success_plot import BLUE, GREEN, NAVY, success_colour
from foldcar.store.reader import Store
from foldcar.store.writer import write_store
from page_check import page_findings, study_of
from written_study import BUILD, FACTS, add_experiment, write_study

WIDTHS, RADII, SAMPLES = tuple(float(w) for w in range(60, 160, 20)), (40.0, 50.0, 60.0, 70.0), 20
HEIGHTS = (0.006, 0.018, 0.03)


def true_rate(x: float, y: float) -> float:
    """Success at x and y of a plane of log-odds."""
    return 1 / (1 + math.exp(-((x - 100) / 12 + (y - 55) / 6)))


def share_passes(rate: float, sample: int, samples: int) -> str:
    """The first of the samples pass, as many as the rate asks for."""
    return "passed" if sample < round(rate * samples) else "tipped"


def plane(x_name: str = "width_mm", y_name: str = "radius_mm", samples: int = 400) -> DesignTable:
    """Designs whose counts are the true rates, rounded to a run."""
    cells = {(x, y): Count(samples, round(samples * true_rate(x, y))) for x in WIDTHS for y in RADII}
    return DesignTable((x_name, y_name), cells)


@pytest.fixture(scope="module")
def two(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A study over width and radius, and of bumps of three heights, one experiment each."""
    store = tmp_path_factory.mktemp("maps") / "study.db"
    varied = {"width_mm": WIDTHS, "radius_mm": RADII}
    write_study(store, varied, SAMPLES, lambda d, s: share_passes(true_rate(d["width_mm"], d["radius_mm"]), s, SAMPLES))
    with write_store(store) as writer:
        writer.begin_study(FACTS, BUILD)
        for height in HEIGHTS:
            facts = {"scenic_program": "bumps.scenic", "scenic_params": {"bump_height": height, "gap": 0.3}}
            rate = 1 - height / 0.03
            add_experiment(
                writer, f"{height:g}", {"radius_mm": RADII}, 10, lambda d, s, r=rate: share_passes(r, s, 10), facts
            )
        unset = {"scenic_program": "bumps.scenic", "scenic_params": {"gap": 0.3}}
        add_experiment(writer, "own", {"radius_mm": RADII}, 10, lambda d, s: "passed", unset)
        other = {"scenic_program": "bumps.scenic", "scenic_params": {"bump_height": 0.04, "gap": 0.5}}
        add_experiment(writer, "other gap", {"radius_mm": RADII}, 10, lambda d, s: "passed", other)
    return store


def test_the_contour_follows_the_line_where_the_true_rate_is_at_the_threshold() -> None:
    plan = plan_map(plane())
    assert plan is not None and (plan.x, plan.y, plan.choice) == ("width_mm", "radius_mm", "")
    (panel,) = plan.panels
    surface = panel.surface
    assert surface is not None
    x, y, rate, low, high = surface
    for at in range(10, 71, 20):
        # Where log-odds of 3 to 1 lie on the plane, at this radius.
        true_x = 100 + 12 * (math.log(3) - (y[at] - 55) / 6)
        if x[0] < true_x < x[-1]:
            assert numpy.interp(0.75, rate[at], x) == pytest.approx(true_x, abs=3.0)
    inside = [(low[j, i], true_rate(x[i], y[j]), high[j, i]) for i in range(0, 81, 8) for j in range(0, 81, 8)]
    assert numpy.mean([below <= true <= above for below, true, above in inside]) > 0.9

    figure = draw_map(plan, (0.5, 0.75))
    shown = {text.get_text() for text in figure.axes[0].texts}
    assert f"{100 * true_rate(100, 50):.0f}" in shown


def test_designs_that_were_not_run_have_neither_cell_nor_contour() -> None:
    whole = plane()
    table = DesignTable(whole.names, {at: count for at, count in whole.cells.items() if at[0] < 120 or at[1] > 50})
    plan = plan_map(table)
    assert plan is not None
    axes = draw_map(plan, (0.75,)).axes[0]
    assert len(axes.patches) == len(table.cells) == len(WIDTHS) * len(RADII) - 4
    lines = [path.vertices for one in axes.collections for path in one.get_paths() if len(path.vertices)]
    assert lines and not any(((line[:, 0] > 112) & (line[:, 1] < 53)).any() for line in lines)


def test_the_parameters_that_matter_most_are_the_axes_and_the_others_are_fixed_and_said() -> None:
    cells = {
        (x, flat, y): Count(100, round(100 * true_rate(x, y)))
        for x in WIDTHS
        for flat in range(6)
        for y in RADII
    }  # fmt: skip
    plan = plan_map(DesignTable(("width_mm", "flat", "radius_mm"), cells))
    assert plan is not None and {plan.x, plan.y} == {"width_mm", "radius_mm"}
    assert [panel.fixed for panel in plan.panels] == [{"flat": value} for value in (0, 2, 3, 5)]
    assert len(plan.panels) == MOST_PANELS
    assert "flat 0, 2, 3, 5 of 6 values" in plan.choice
    assert plan_map(DesignTable(("width_mm",), {(x,): Count(3, 1) for x in WIDTHS})) is None


def test_a_map_of_a_search_leaves_out_parameters_of_which_it_ran_one_value() -> None:
    names = ("length_mm", "width_mm", "radius_mm", "height_mm")
    cells = {(60.0, x, y, 50.0): count for (x, y), count in plane().cells.items() if (x, y) != (60.0, 40.0)}
    plan = plan_map(DesignTable(names, cells))

    assert plan is not None and {plan.x, plan.y} == {"width_mm", "radius_mm"}
    assert plan.choice == "" and not plan.middle.fixed
    cell_count = sum(isinstance(patch, Rectangle) for patch in draw_map(plan, (0.5,)).axes[0].patches)
    assert cell_count == len(cells)
    assert design_matrix(plan.middle) is not None
    for along in (plan.x, plan.y):
        assert draw_slices(Slices(plan.middle, along), (0.5,)).axes
    # Designs that a search scattered: a panel may hold one of them.
    single = {(60.0, 65.0, 40.0, 50.0): Count(5, 1), (75.0, 85.0, 56.0, 50.0): Count(5, 4)}
    scattered = plan_map(DesignTable(names, single))
    assert scattered is not None and draw_slices(Slices(scattered.middle, scattered.y), (0.5,)).axes


def test_single_runs_and_few_designs_have_no_model() -> None:
    single = {(x, y): Count(1, int(x > 90)) for x in WIDTHS for y in RADII}
    assert Panel("x", "y", {}, DesignTable(("x", "y"), single)).model is None
    few = {(x, 1.0): Count(9, 3) for x in WIDTHS}
    assert Panel("x", "y", {}, DesignTable(("x", "y"), few)).model is None


def test_the_mean_interval_holds_for_designs_that_share_all_environments() -> None:
    # All designs pass in the same environments: the mean of many is as uncertain as one.
    low, high = mean_interval([Count(20, 10)] * 12)
    alone_low, alone_high = Count(20, 10).interval
    assert low < alone_low < 0.5 < alone_high < high
    assert 0 <= mean_interval([Count(20, 10, stopped=True)] * 12)[0] < alone_low


def test_cells_reach_half_way_to_their_neighbours_and_an_open_one_holds_the_highest_threshold() -> None:
    assert edges([10, 20, 40]).tolist() == [5, 15, 30, 50]
    assert is_open(Count(20, 14), (0.5, 0.75)) and not is_open(Count(20, 20), (0.5, 0.75))
    assert spread([1, 2, 3, 4, 5, 6, 7], 3) == [1, 4, 7] and every([1, 2, 3, 4, 5], 3) == [1, 3, 5]


def test_colours_of_any_thresholds() -> None:
    assert [success_colour(s, (0.6, 0.8)) for s in (0.59, 0.6, 0.8, 0.81)] == [NAVY, BLUE, BLUE, GREEN]
    assert [success_colour(s, (0.9,)) for s in (0.9, 0.91)] == [NAVY, GREEN]
    assert len({success_colour(s, (0.2, 0.4, 0.6, 0.8)) for s in (0.1, 0.3, 0.5, 0.7, 0.9)}) == 5


def test_experiments_that_differ_in_one_number_are_a_group(two: Path) -> None:
    with Store.open(two) as store:
        infos = store.info().experiments
        (group,) = environment_groups(infos.values())
        assert (group.parameter, tuple(group.experiments), group.others) == ("bump_height", HEIGHTS, {"gap": 0.3})
        assert group.remarks == (
            "Experiment own does not set bump_height: the program's own value is not in the store; it is not drawn.",
        )
        name, table = joined_table(store, group)
        assert (name, table.names) == ("bump_height", ("bump_height", "radius_mm"))
        assert {values: (one.runs, one.passed) for values, one in table.cells.items()} == {
            (height, radius): (10, round(10 * (1 - height / 0.03))) for height in HEIGHTS for radius in RADII
        }
        assert len(read_table(store, infos["1"]).cells) == len(WIDTHS) * len(RADII)


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
    assert page_findings(re.sub(r"<script.*?</script>", "", html, flags=re.DOTALL)) == []
    assert "--threshold 0.6 --threshold 0.8 --sample 3" in html
    *_, last = study_of(folder)["experiments"]
    assert (last["designs"]["passed"], last["designs"]["runs"]) == ([2], [2])

    refused = CliRunner().invoke(app, [*words, "--sample", "5"])
    assert refused.exit_code != 0 and "--sample: 5 is not among" in str(refused.exception)
