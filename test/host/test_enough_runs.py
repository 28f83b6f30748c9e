"""What the report says of the number of environments and of times."""

from types import SimpleNamespace
from typing import Any

import numpy
import pytest

from foldcar.analysis.stopping import convergence
from foldcar.report.limited_times import limited_times
from foldcar.report.settling import draw_settling, settling_text
from foldcar.simulation.results import NUMBERS, OUTCOMES
from foldcar.store.frames import RunArrays


def test_designs_near_the_threshold_are_named_and_those_far_away_are_not() -> None:
    labels, successes = ["65 mm", "95 mm", "150 mm", "180 mm"], numpy.array([7, 100, 73, 56])

    text = settling_text(labels, successes, numpy.full(4, 100), 0.75)

    assert text.startswith("1 of 4 designs is not decided against 75 % (150 mm). Nearest to it, 150 mm: 73 of 100 passed")
    decided = settling_text(labels, numpy.array([7, 100, 98, 6]), numpy.full(4, 100), 0.75)
    assert decided.startswith("No design's 95 % interval holds 75 %")
    alone = settling_text(["the design"], numpy.array([3]), numpy.array([4]), 0.75)
    assert alone.startswith("3 of 4 passed: not decided against 75 %")


@pytest.mark.parametrize("narrow", [False, True])
def test_curves_end_at_the_rates_of_all_runs(narrow: bool) -> None:
    results = numpy.random.default_rng(1007).random(5000) < 0.7
    (axes,) = draw_settling({"95 mm": convergence(results)}, 0.75, narrow).axes

    x, y = axes.lines[0].get_data()

    assert (x[0], x[-1], y[-1]) == (1, 5000, pytest.approx(100 * results.mean())) and len(x) <= 200


def test_runs_that_never_cross_take_the_limit_whenever_they_ended() -> None:
    # Two designs of two runs; the one that tipped did so after 0.5 s.
    outcome = numpy.array([OUTCOMES.index(name) for name in ("passed", "tipped", "passed", "passed")], dtype=numpy.uint8)
    metrics = numpy.full((4, len(NUMBERS)), numpy.nan)
    metrics[:, NUMBERS.index("elapsed_time_s")] = [2.0, 0.5, 3.0, 5.0]
    runs = RunArrays(numpy.array([0, 0, 1, 1]), numpy.array([0, 1, 0, 1]), outcome, metrics)

    info: Any = SimpleNamespace(success_defined=True, until=None, searched=False, timeout_s=120.0, varied=["width_mm"])

    times = limited_times(runs, [{"width_mm": 65.0}, {"width_mm": 95.0}], info)["width_mm"]

    assert {value: time.mean_s for value, time in times.items()} == {65.0: (2 + 120) / 2, 95.0: 4.0}
    assert all(time.low_s < time.mean_s < time.high_s <= 120 for time in times.values())
