"""Cars as random effects, against sums over all cars there may be, other intervals, and cars with known rates."""

import numpy
import pytest
from scipy.optimize import brentq
from scipy.special import expit
from scipy.stats import beta, binom, norm

from foldcar.statistics.built_cars import PRIOR, RANGES, SLOPE, SPREADS, BuiltCars, likelihood, simulated_weights

Z = numpy.linspace(-9, 9, 3001)
MASS = norm.pdf(Z) * (Z[1] - Z[0])
ALIKE = numpy.eye(len(SPREADS))[0]


def centre(rate: float, spread: float) -> float:
    """The log-odds around which cars lie whose mean rate is that."""
    return float(brentq(lambda at: MASS @ expit(at + spread * Z) - rate, -40, 40))


def test_the_likelihood_is_the_mean_over_the_cars_that_there_may_be() -> None:
    cars = BuiltCars(numpy.array([3.0, 9.0]), numpy.array([4.0, 9.0]), numpy.array([0.3, -1.0]), PRIOR)
    at = numpy.array([-2.0, 0.4, 3.0])

    ((_, result),) = likelihood([cars])
    value, slope, curvature = (result(at, order)[:, 0] for order in range(3))

    def expected(m: float) -> float:
        car_likelihood = 0.0
        for spread, weight in zip(SPREADS, PRIOR, strict=True):
            chances = [
                MASS @ binom.pmf(k, n, expit((1 + SLOPE * spread**2) ** 0.5 * (m + shift) + spread * Z))
                for k, n, shift in ((3, 4, 0.3), (9, 9, -1.0))
            ]
            car_likelihood += weight * chances[0] * chances[1]
        return float(numpy.log(car_likelihood / 4))

    step = 1e-3
    ends = numpy.array([[expected(m + by) for by in (-step, 0, step)] for m in at])
    assert value == pytest.approx(ends[:, 1], abs=2e-3)
    assert slope == pytest.approx((ends[:, 2] - ends[:, 0]) / (2 * step), abs=5e-3)
    bent = (ends[:, 0] - 2 * ends[:, 1] + ends[:, 2]) / step**2
    assert curvature == pytest.approx(bent, abs=2e-2)
    # Several designs at a time are each as alone.
    other = BuiltCars.of_one_car(1, 5)
    ((_, both),), ((_, alone),) = likelihood([other, cars]), likelihood([other])
    assert both(at) == pytest.approx(numpy.column_stack([alone(at)[:, 0], value]))
    # Of one design the ranges' mixture is the whole.
    ranges = likelihood([cars], RANGES)
    mixed = numpy.log(sum(part * numpy.exp(spline(at)[:, 0]) for part, spline in ranges))
    assert sum(part for part, _ in ranges) == pytest.approx(1) and mixed == pytest.approx(value, abs=2e-3)


@pytest.mark.parametrize("spread", [1.0, 2.0])
def test_a_design_of_a_rate_has_cars_around_steeper_log_odds(spread: float) -> None:
    for rate in (0.05, 0.2, 0.5, 0.7):
        log_odds = numpy.log(rate / (1 - rate)) * (1 + SLOPE * spread**2) ** 0.5
        assert MASS @ expit(log_odds + spread * Z) == pytest.approx(rate, abs=0.012)


def test_alike_cars_have_jeffreys_interval_and_trials_of_one_car_tell_less_than_those_of_several() -> None:
    alike = BuiltCars(numpy.array([5.0]), numpy.array([12.0]), numpy.zeros(1), ALIKE).rate()
    assert [alike.low, alike.high] == pytest.approx(beta(5.5, 7.5).ppf([0.025, 0.975]), abs=2e-3)
    never = BuiltCars(numpy.array([0.0]), numpy.array([12.0]), numpy.zeros(1), ALIKE).rate()
    assert [never.low, never.high] == pytest.approx([0, beta(0.5, 12.5).ppf(0.975)], abs=2e-3)

    few, many = BuiltCars.of_one_car(6, 12).rate(), BuiltCars.of_one_car(300, 600).rate()
    four = BuiltCars(numpy.full(4, 1.5), numpy.full(4, 3.0), numpy.zeros(4), PRIOR).rate()
    assert four.half_width < few.half_width and "12 trials of 4 cars" in four.method
    # However often one car drives, it tells of itself.
    assert 2 * many.half_width > 0.45 and "600 trials of 1 car," in many.method
    # Simulation passes more often in the environments driven than in all: so would the design.
    easy = BuiltCars(numpy.array([6.0]), numpy.array([12.0]), numpy.array([1.0]), PRIOR).rate()
    assert expit(numpy.log(few.value / (1 - few.value)) - 1) == pytest.approx(easy.value, abs=0.05)


def test_cars_that_pass_everything_or_nothing_show_their_spread() -> None:
    torn, alike = simulated_weights([0, 10] * 10, 10), simulated_weights([5, 4, 6, 5] * 5, 10)
    assert (torn.sum(), alike.sum()) == pytest.approx((1, 1))
    assert torn @ SPREADS > 2 > 0.6 > alike @ SPREADS
    # Simulated cars of a known spread.
    random = numpy.random.default_rng(1)
    rates = [
        simulated_weights(random.binomial(10, expit(0.5 + spread * random.standard_normal(20))), 10) @ SPREADS
        for spread in (0.5, 2.0)
        for _ in range(20)
    ]
    assert numpy.mean(rates[:20]) == pytest.approx(0.7, abs=0.2)
    assert numpy.mean(rates[20:]) == pytest.approx(1.9, abs=0.25)


def test_the_interval_holds_the_rate_of_a_further_car_where_wilsons_does_not() -> None:
    random, intervals = numpy.random.default_rng(2), []
    for _ in range(80):
        rate = random.uniform()
        cars = expit(centre(rate, 1.5) + 1.5 * random.standard_normal(2))
        rate_ = BuiltCars(random.binomial(6, cars).astype(float), numpy.full(2, 6.0), numpy.zeros(2), PRIOR).rate()
        intervals.append(rate_.low <= rate <= rate_.high)
    assert numpy.mean(intervals) > 0.9
