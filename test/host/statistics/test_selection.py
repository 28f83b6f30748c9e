"""Choosing designs, cars, trials and environments on plain arrays, against independent computations."""

from itertools import product

import numpy
import pytest
from scipy.optimize import brentq
from scipy.special import expit
from scipy.stats import binom, norm

from foldcar.statistics.pooled_bias import contradictions
from foldcar.statistics.rate import wilson_interval
from foldcar.statistics.selection import (
    ABOVE,
    BELOW,
    BEST,
    END,
    LOWER_EDGE,
    MIDDLE,
    UPPER_EDGE,
    Effort,
    choose_designs,
    correlation_within_cars,
    expected_loss,
    first_designs,
    gain_per_hour,
    informative_environments,
    least_effort,
    split_sample_best,
    trials_needed,
    trials_to_decide,
    value_of_trials,
)

WIDTHS = numpy.arange(65.0, 250.0, 5.0)


def test_first_designs_mark_the_region() -> None:
    # Feasible from 95 to 140 mm, as in the publication's figure 6.
    rates = numpy.where((WIDTHS >= 95) & (WIDTHS <= 140), 0.9, numpy.where(WIDTHS > 140, 0.4, 0.1))
    doubt = numpy.where(WIDTHS < 100, 0.5, 0.1)

    placed = [(WIDTHS[design.index], design.place) for design in first_designs(WIDTHS[:, None], rates, doubt, 0.75)]

    assert [place for _, place in placed] == [MIDDLE, LOWER_EDGE, ABOVE, BELOW, UPPER_EDGE]
    places = {place: width for width, place in placed}
    assert (places[LOWER_EDGE], places[UPPER_EDGE]) == (95, 140)
    assert 115 <= places[MIDDLE] <= 120 and places[BELOW] < 95 and places[ABOVE] > 140
    # A rate at the threshold reaches it.
    assert [
        (WIDTHS[design.index], design.place) for design in first_designs(WIDTHS[:, None], rates, doubt, 0.9)
    ] == placed
    (best,) = first_designs(WIDTHS[:, None], rates, doubt, 0.95)
    assert best.place == BEST
    assert [design.place for design in first_designs(WIDTHS[:, None], rates, doubt, 0.05)] == [MIDDLE, END, END]


def test_first_designs_of_two_parameters_are_on_the_level_set() -> None:
    grid = numpy.array(list(product(range(11), range(11))), dtype=float)
    away = numpy.hypot(grid[:, 0] - 5, grid[:, 1] - 5)

    placed = first_designs(grid, 1 / (1 + numpy.exp(away - 3.2)), numpy.zeros(len(grid)), 0.5)

    distance = [away[design.index] for design in placed]
    assert distance[0] == 0
    for design, far in zip(placed[1:], distance[1:], strict=True):
        assert (2.2 <= far <= 3.2) if "edge" in design.place else (far > 3.2)
    first, second = (grid[design.index] for design in placed if "edge" in design.place)
    assert numpy.hypot(*(first - second)) > 3


def test_the_value_of_trials_is_what_they_improve() -> None:
    random = numpy.random.default_rng(5)
    p = random.random((200, 3))
    value = value_of_trials(p, 0.6, 4)

    for design in range(3):
        best, wrong = 0.0, 0.0
        for passed in range(5):
            weight = binom.pmf(passed, 4, p[:, design])
            share = weight.mean()
            best += share * numpy.average(p, axis=0, weights=weight).max()
            above = numpy.average(p >= 0.6, axis=0, weights=weight)
            wrong += share * numpy.minimum(above, 1 - above).mean()
        assert value.choice[design] == pytest.approx(best - p.mean(axis=0).max())
        above = (p >= 0.6).mean(axis=0)
        assert value.threshold[design] == pytest.approx(numpy.minimum(above, 1 - above).mean() - wrong)


def test_within_the_zone_no_side_is_wrong() -> None:
    """A design that lies at the threshold is worth no trial; of one that may be far on either side each trial tells."""
    near, far = (axis.ravel() for axis in numpy.meshgrid(numpy.linspace(0.66, 0.84, 50), [0.5, 0.95]))
    draws = numpy.column_stack([near, far, numpy.full(100, 0.99)])

    assert value_of_trials(draws, 0.75, 10, 0.1).threshold == pytest.approx([0, 0.5 / 3, 0], abs=0.02)
    assert value_of_trials(draws, 0.75, 10).threshold[0] > 0.02
    best, loss = expected_loss([[0.5, 0.6], [0.9, 0.6]])
    assert (best, loss) == (0, pytest.approx(0.05))
    # A twin of a chosen design tells nothing more.
    random = numpy.random.default_rng(6)
    first, second = random.beta(2, 2, 400), random.beta(4, 4, 400)
    assert choose_designs(numpy.column_stack([first, first, second]), 0.5, 10, 2, [0]) == [2, 1]
    # 10 trials of 3 min and a car of 60 min are 1.5 h; of three designs each counts as one of 20.
    gain = gain_per_hour(draws, 0.75, 0.1, [[60.0 + 10 * 3.0] * 3, [1e9] * 3])
    assert gain == pytest.approx(value_of_trials(draws, 0.75, 10, 0.1).threshold[1] * 3 / 20 / 1.5)


@pytest.mark.parametrize("rate", [0.5, 0.65, 0.9])
def test_trials_tell_the_side_as_likely_as_not(rate: float) -> None:
    number = trials_to_decide([rate], 0.75)

    passed = numpy.arange(number + 1)
    ends = numpy.array([wilson_interval(int(k), number) for k in passed])
    decided = (ends[:, 0] > 0.75) | (ends[:, 1] < 0.75)
    assert binom.pmf(passed[decided], number, rate).sum() == pytest.approx(0.5, abs=0.12)


@pytest.mark.parametrize(("rate", "car_sd"), [(0.5, 1.0), (0.8, 2.0), (0.95, 0.7)])
def test_trials_of_few_cars_vary_as_their_correlation_says(rate: float, car_sd: float) -> None:
    """The variance of the share that passes, over 20,000 sets of 3 cars with 5 trials each, against its closed form."""
    alike, random = correlation_within_cars([rate], car_sd), numpy.random.default_rng(2)
    centre = brentq(lambda at: expit(at + car_sd * norm.ppf((numpy.arange(2000) + 0.5) / 2000)).mean() - rate, -20, 20)

    passed = random.binomial(5, expit(centre + car_sd * random.standard_normal((20_000, 3)))).sum(axis=1)

    assert (passed / 15).mean() == pytest.approx(rate, abs=0.005)
    assert (passed / 15).var() == pytest.approx(rate * (1 - rate) * (1 + 4 * alike) / 15, rel=0.05)


def test_cars_and_trials_are_the_quickest_that_suffice() -> None:
    """Against all numbers of cars and trials of each; without differences of cars one car is the quickest."""

    def worth(trials: int, alike: float) -> float:
        return trials / (1 + (trials - 1) * alike)

    for alike, car_min, needed in product((0.05, 0.5), (10.0, 90.0), (5, 30)):
        plans = product(range(1, 50), range(1, 10 * needed + 1))
        enough = [m * (car_min + 3.5 * n) for m, n in plans if m * worth(n, alike) >= needed - 1e-9]
        effort = least_effort(needed, alike, car_min, 3.5)
        assert effort.trials == effort.cars * effort.each
        assert effort.cars * car_min + effort.trials * 3.5 == pytest.approx(min(enough))
    assert least_effort(30, 0.0, 90.0, 3.5) == Effort(1, 30, 30)
    assert least_effort(30, 0.0, 90.0, 3.5, [12]) == Effort(0, 18, 30)
    more = least_effort(10, 0.2, 90.0, 3.5, [12])
    assert more.cars * worth(more.each, 0.2) + worth(max(12, more.each), 0.2) >= 10 and more.cars >= 1


@pytest.mark.parametrize("rate", [0.5, 0.8, 1.0])
def test_trials_needed_are_the_fewest_that_suffice(rate: float) -> None:
    number = trials_needed([rate], 0.15)

    def half_width(n: int) -> float:
        low, high = wilson_interval(round(rate * n), n)
        return (high - low) / 2

    # Whole numbers of passed trials lie beside the rate.
    assert half_width(number + 2) <= 0.15 < half_width(number - 3)


def test_environments_represent_all_and_tell_designs_apart() -> None:
    random = numpy.random.default_rng(8)
    hardness = random.random(100)
    passed = (numpy.array([0.9, 0.5, 0.3])[:, None] > hardness).astype(float)
    passed[0, 7] = numpy.nan

    chosen = informative_environments(passed, 20, excluded=[3])

    assert chosen == informative_environments(passed, 20, excluded=[3]) and len(set(chosen)) == 20
    assert not {3, 7} & set(chosen)
    shares = numpy.nanmean(passed, axis=1)
    assert numpy.abs(passed[:, chosen].mean(axis=1) - shares).max() <= 0.05
    spread = numpy.ptp(passed[:, chosen], axis=0)
    assert list(spread) == sorted(spread, reverse=True)
    assert len(informative_environments(passed, 500)) == 99


def test_the_best_is_not_quoted_from_the_environments_that_chose_it() -> None:
    random = numpy.random.default_rng(9)
    tables = (random.random((100, 30, 40)) < 0.5).astype(float)

    quoted = [k / n for _, k, n in map(split_sample_best, tables)]

    assert numpy.mean(quoted) == pytest.approx(0.5, abs=0.03) and tables.mean(axis=2).max(axis=1).mean() > 0.6


def test_designs_beside_a_contradiction_in_two_parameters() -> None:
    """Driven in a cross: the centre fails. Beside it are those between it and the arms, none beyond them."""
    grid = numpy.array(list(product(range(5), range(5))), dtype=float)
    driven = [(0, 2), (4, 2), (2, 0), (2, 4), (2, 2)]
    passed = [(0, 30) if cell == (2, 2) else (30, 30) if cell in driven else (0, 0) for cell in map(tuple, grid)]

    flagged = contradictions(grid, numpy.tile([95, 100], (25, 1)), passed)

    assert [tuple(grid[index]) for index in flagged.designs] == [(2, 2)]
    assert {tuple(grid[index]) for index in flagged.undriven_neighbours} == set(product((1, 2, 3), (1, 2, 3))) - {(2, 2)}
