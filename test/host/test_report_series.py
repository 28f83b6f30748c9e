"""The numbers of a report: counts by parameter, Wilson intervals, colours and labels."""

import math
from collections import Counter
from dataclasses import replace
from types import SimpleNamespace

import pytest

from foldcar.analysis.rate import wilson_interval
from foldcar.figures.page import inline_svg
from foldcar.report.axis import ParameterAxis, extent_text, parameter_label, value_text
from foldcar.report.headline import headline
from foldcar.report.series import Extent, Tally, summarise
from foldcar.report.success_plot import BLUE, GREEN, NAVY, error_bar_percent, success_colour
from foldcar.report.trial_series import TrialGroup, TrialSummary, TrialTally
from foldcar.simulation.results import Recorded, Result


def result(sample: int, outcome: str, time_s: float, **design: float | str) -> Result:
    return Result("1", "1", "1", sample, outcome, {"elapsed_time_s": time_s}, None, design, {})


# Newcombe (1998), "Two-sided confidence intervals for the single proportion", table I, method 3.
@pytest.mark.parametrize(
    ("successes", "runs", "low", "high"),
    [(81, 263, 0.2553, 0.3662), (15, 148, 0.0624, 0.1605), (0, 20, 0.0, 0.1611), (1, 29, 0.0061, 0.1718)],
)
def test_wilson_interval_is_the_published_one(successes: int, runs: int, low: float, high: float) -> None:
    assert wilson_interval(successes, runs) == pytest.approx((low, high), abs=5e-5)


def test_wilson_interval_is_the_closed_form() -> None:
    z = 1.959963984540054
    for runs in (1, 7, 100):
        for successes in range(runs + 1):
            share = successes / runs
            middle = (share + z * z / (2 * runs)) / (1 + z * z / runs)
            half = z * math.sqrt(share * (1 - share) / runs + (z / (2 * runs)) ** 2) / (1 + z * z / runs)
            assert wilson_interval(successes, runs) == pytest.approx((middle - half, middle + half), abs=1e-9)


def test_error_bars_are_never_negative() -> None:
    for passed in (0, 100):
        tally = Tally()
        for k in range(100):
            tally.add(result(k, "passed" if k < passed else "stuck", 2.0))
        assert min(error_bar_percent(tally)) >= 0.0


def test_one_varied_parameter_is_counted_by_value() -> None:
    rows = [
        result(0, "tipped", 1.0, width_mm=65.0, radius_mm=60.0),
        result(1, "passed", 3.0, width_mm=65.0, radius_mm=60.0),
        result(0, "passed", 2.0, width_mm=100.0, radius_mm=60.0),
        result(1, "passed", 2.5, width_mm=100.0, radius_mm=60.0),
    ]
    summary = summarise(iter(reversed(rows)), {"width_mm": (65.0, 100.0, 120.0)})
    (series,) = summary.series
    assert list(series.tallies) == [65.0, 100.0]
    narrow, wide = series.tallies.values()
    assert (narrow.runs, narrow.passed, narrow.success, narrow.outcomes["tipped"]) == (2, 1, 0.5, 1)
    assert (wide.success, wide.mean_time_s, narrow.mean_time_s) == (1.0, 2.25, 3.0)
    assert [(run.value, run.outcome, run.time_s) for run in summary.timed] == [
        (65.0, "tipped", 1.0),
        (100.0, "passed", 2.0),
    ]
    assert (summary.total.runs, summary.total.passed) == (4, 3)


def test_recorded_numbers_and_truths_are_averaged_by_value() -> None:
    def with_recorded(width: float, **values: object) -> Result:
        recorded = {name: Recorded("final", value) for name, value in values.items()}
        recorded["track"] = Recorded("series", [[0.25, 1.0]])
        return replace(result(0, "terminated", 1.0, width_mm=width), recorded=recorded)

    rows = [
        with_recorded(65.0, height=0.5, won=True, side="left"),
        with_recorded(65.0, height=1, won=False),
        with_recorded(65.0, height=-3.0),
        with_recorded(95.0, won=True),
    ]
    summary = summarise(rows, {"width_mm": (65.0, 95.0)})
    narrow, wide = summary.series[0].tallies.values()
    assert narrow.recorded == {"height": Extent(3, -1.5, -3.0, 1.0), "won": Extent(2, 1.0, 0.0, 1.0)}
    assert wide.recorded == {"won": Extent(1, 1.0, 1.0, 1.0)}
    assert (summary.total.recorded["won"].mean, summary.total.seen) == (2 / 3, ["passed", "terminated"])
    assert extent_text(narrow.recorded["height"]) == "-0.5 (-3 to 1)"


def test_several_varied_parameters_are_counted_each_over_the_others() -> None:
    rows = [
        result(
            0,
            "passed" if width == 80.0 and radius == 60.0 else "stuck",
            2.0,
            width_mm=width,
            radius_mm=radius,
        )
        for width in (80.0, 90.0)
        for radius in (50.0, 60.0)
    ]
    summary = summarise(rows, {"width_mm": (80.0, 90.0), "radius_mm": (50.0, 60.0)})
    assert [series.parameter for series in summary.series] == ["width_mm", "radius_mm"]
    shares = [[tally.success for tally in series.tallies.values()] for series in summary.series]
    assert shares == [[0.5, 0.0], [0.0, 0.5]]
    assert summary.timed == []


def test_no_varied_parameter_leaves_the_total() -> None:
    summary = summarise([result(0, "fault", 1.0, width_mm=80.0)], {})
    assert (summary.series, summary.timed, summary.total.outcomes["fault"]) == ([], [], 1)
    assert summary.total.mean_time_s is None


@pytest.mark.parametrize(
    ("success", "colour"), [(1.0, GREEN), (0.76, GREEN), (0.75, BLUE), (0.5, BLUE), (0.49, NAVY), (0.0, NAVY)]
)
def test_success_has_the_papers_colours(success: float, colour: str) -> None:
    assert success_colour(success) == colour


def test_labels_take_their_unit_from_the_name() -> None:
    assert parameter_label("wheel_radius_mm") == "wheel radius (mm)"
    assert parameter_label("supply_v") == "supply (V)"
    assert parameter_label("tyre_pattern") == "tyre pattern"
    assert (value_text(95.0), value_text(12.5), value_text("soft")) == ("95", "12.5", "soft")


def test_numbers_stand_to_scale_and_texts_side_by_side() -> None:
    numbers = ParameterAxis([65.0, 70.0, 100.0])
    assert [numbers.place(value) for value in numbers.values] == [65.0, 70.0, 100.0]
    assert numbers.bar_width == pytest.approx(4.0)
    texts = ParameterAxis(["hard", "soft"])
    assert [texts.place(value) for value in texts.values] == [0, 1]


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


def headline_of(
    passed: dict[float, int],
    runs: int,
    trials: dict[float, tuple[int, int]] | None = None,
    simulation: str = "simulation",
) -> str:
    """The headline of a study of widths with so many of ``runs`` passed, and trials passed and counted."""
    results = [
        result(sample, "passed" if sample < count else "stuck", 1.0, w_mm=width)
        for width, count in passed.items()
        for sample in range(runs)
    ]
    summary = summarise(results, {"w_mm": tuple(passed)})
    tallies = {width: TrialTally(number, good) for width, (good, number) in (trials or {}).items()}
    total = TrialTally(sum(one.counted for one in tallies.values()), 0)
    built = TrialGroup(total, {"w_mm": tallies})
    info = SimpleNamespace(success_defined=True, planned_runs=len(results), simulation=simulation)
    return " ".join(headline(info, summary, TrialSummary(built, TrialGroup(), 0, Counter()), 0.75))  # type: ignore[arg-type]


def test_the_headline_says_no_more_than_the_counts() -> None:
    some = headline_of({65.0: 7, 70.0: 90, 75.0: 100, 80.0: 80, 85.0: 20}, 100, {75.0: (3, 12), 65.0: (0, 10)})
    few = headline_of({65.0: 4, 70.0: 4}, 4)

    # 80 of 100: Wilson's interval begins at 71.1 %.
    assert "cars with a w of 70 to 80 mm pass more than 75 %" in some and "too, for 70 to 75 mm" in some
    # 3 of 12: 8.9 to 53.2 %, below 96.3 %; 0 of 10: 0 to 27.8 %, which meets 3.4 to 13.7 %.
    assert "optimistic at 75 mm; not contradicted at 65 mm" in some
    # 4 of 4: from 51.0 % on.
    assert "leave all of them open" in few and "No trial of a built car counts yet" in few
    assert "no w passes a single environment" in headline_of({65.0: 0, 70.0: 0}, 5)


def test_the_headline_names_the_engine() -> None:
    said = headline_of({65.0: 2, 70.0: 100}, 100, {70.0: (0, 10)}, "MuJoCo")

    assert said.startswith("In MuJoCo, cars with a w of 70 mm pass") and "MuJoCo is optimistic at 70" in said
    assert "imulation" not in said
