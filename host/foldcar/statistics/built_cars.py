"""Success rates of a design from trials of built cars: cars of one design differ, so a car is a random effect.

A car's log-odds of passing are centre + spread z, where z is standard normal over the cars of a design. The trials of a
car are binomial. A design's rate is that of a further car, averaged over z. That average is a logistic function of slope
1 / :func:`centre_factor`, within 0.011 (Zeger, Liang and Albert 1988, doi:10.2307/2531734). So a design whose rate has
log-odds m has cars around centre_factor(spread) m.

The spread is unknown: each of SPREADS has a weight. The prior is half-normal (Gelman 2006), as wide as the spread of
simulated cars with the workshop's imperfections (0.6 to 1.9 in the width study). Simulated cars of the design and trials
of several cars sharpen it.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy
from numpy.typing import ArrayLike, NDArray

from foldcar.statistics.rate import Rate, check_confidence
from foldcar.statistics.words import count

# Standard deviations of cars' log-odds, each for the range around it, and their prior weights.
SPREADS = numpy.array([0.0, 0.5, 1.0, 1.5, 2.0, 3.0])
SPREAD_SCALE = 1.3
PRIOR = numpy.array([0.5, 1.0, 1.0, 1.0, 1.5, 2.0]) * numpy.exp(-0.5 * (SPREADS / SPREAD_SCALE) ** 2)
PRIOR = PRIOR / PRIOR.sum()
# Ranges of SPREADS: the spreads of all designs that one workshop builds are in the same range.
RANGES = SPREADS.reshape(3, 2)
# Weight of the prior in the mixture with the weights by simulated cars, whose imperfections are assumptions.
PRIOR_SHARE = 0.2
# (16 sqrt(3) / 15 pi)^2 of Zeger, Liang and Albert.
SLOPE = 0.346
# The fraction of a simulated difference between environments that is applied. Where simulation errs about single
# environments, applying all of it is worse than applying nothing (docs/statistics.md).
TRUST = 0.5
# Gauss-Hermite quadrature over z around the mode of each car's integrand, and the Newton steps that find the mode.
Z_NODES, Z_WEIGHTS = numpy.polynomial.hermite_e.hermegauss(15)
NEWTON_STEPS = 8
# Likelihoods are computed at the coarse log-odds and interpolated to the fine ones. Both reach to rates of 1e-6, where
# Jeffreys' distribution has mass.
COARSE_LOG_ODDS, FINE_LOG_ODDS = numpy.linspace(-16, 16, 97), numpy.linspace(-16, 16, 1601)
# Jeffreys' prior of the rate, Beta(1/2, 1/2), as a log density of its log-odds.
JEFFREYS_LOG_DENSITY = -(numpy.logaddexp(0, FINE_LOG_ODDS) + numpy.logaddexp(0, -FINE_LOG_ODDS)) / 2


def centre_factor(spread: float | NDArray[Any]) -> Any:
    """Return the log-odds of a design's median car divided by those of its rate, at least 1."""
    return numpy.sqrt(1 + SLOPE * spread**2)


@dataclass(frozen=True)
class BuiltCars:
    """The trials of cars of one design: each car ``passed`` (cars,) of its ``counted`` (cars,) trials, at least one.

    ``shift`` (cars,) is how much easier the car's environments are than all environments, in simulated log-odds.
    ``weights`` are the probabilities of SPREADS.
    """

    passed: NDArray[Any]
    counted: NDArray[Any]
    shift: NDArray[Any]
    weights: NDArray[Any]

    @classmethod
    def of_one_car(cls, passed: float, counted: float) -> "BuiltCars":
        """Return trials of a single car in average environments, with the prior of the spread."""
        return cls(numpy.array([passed]), numpy.array([counted]), numpy.zeros(1), PRIOR)

    @property
    def spread(self) -> float:
        """The mean standard deviation of the cars' log-odds under ``weights``, without these trials."""
        return float(self.weights @ SPREADS)

    @property
    def text(self) -> str:
        """``12 trials of 1 car``."""
        return f"{count(int(self.counted.sum()), 'trial')} of {count(len(self.counted), 'car')}"

    def rate(self, confidence: float = 0.95) -> Rate:
        """Estimate the rate of a new car of the design.

        The value is the fraction that passed, corrected for the shift. The interval is the posterior's under Jeffreys'
        prior. Raises FoldcarError if ``confidence`` is not between 0 and 1.
        """
        check_confidence(confidence)
        tail = (1 - confidence) / 2
        low, high = self._quantiles([tail, 1 - tail]).tolist()
        # As usual for Jeffreys' interval, an end is 0 if no trial passed, and 1 if all passed.
        low, high = (0.0 if not self.passed.any() else low), (1.0 if (self.passed == self.counted).all() else high)
        fraction = self.passed.sum() / self.counted.sum()
        # Shifts say how much easier the environments of the trials are; the mean shift is taken back from the odds.
        odds_ratio = numpy.exp(-self.shift @ self.counted / self.counted.sum())
        value = min(max(float(fraction * odds_ratio / (fraction * odds_ratio + 1 - fraction)), low), high)
        return Rate(value, low, high, confidence, f"{self.text}, for a further car of the design")

    def draws(self, number: int, random: numpy.random.Generator) -> NDArray[Any]:
        """Draw success rates (number,) of a new car from their posterior."""
        return self._quantiles(random.random(number))

    def count_draws(self, rates: NDArray[Any], random: numpy.random.Generator) -> NDArray[Any]:
        """Draw numbers (n,) of passed trials if new cars repeat these trials, given rates (n,) of the design."""
        spread = random.choice(SPREADS, (len(rates), 1), p=self.weights)
        centre = centre_factor(spread) * numpy.log(rates / (1 - rates))[:, None]
        log_odds = centre + self.shift + spread * random.standard_normal((len(rates), len(self.shift)))
        return numpy.asarray(random.binomial(self.counted.astype(int), 1 / (1 + numpy.exp(-log_odds))).sum(axis=1))

    def _quantiles(self, probabilities: Sequence[float] | NDArray[Any]) -> NDArray[Any]:
        """Return quantiles of the posterior of a new car's rate, tabulated over log-odds."""
        ((_, spline),) = likelihood([self])
        log_density = spline(FINE_LOG_ODDS)[:, 0] + JEFFREYS_LOG_DENSITY
        density = numpy.exp(log_density - log_density.max())
        mass = density.cumsum() - density / 2
        return numpy.asarray(1 / (1 + numpy.exp(-numpy.interp(probabilities, mass / density.sum(), FINE_LOG_ODDS))))


def likelihood(designs: Sequence[BuiltCars], ranges: Iterable[NDArray[Any]] = (SPREADS,)) -> list[tuple[float, Any]]:
    """Return the log likelihood of each design's log-odds given its cars, once for each of ``ranges`` of the spread.

    Each item is a pair: the prior probability of the range, and a CubicSpline from log-odds (m,) to log likelihoods
    (m, designs).

    The spreads of all designs are in the same range, because one workshop builds their cars. Independent spreads would
    average out: the mean spread of many designs would seem to be known. A design's weights are a mixture of PRIOR and of
    weights by simulated cars; the range restricts the first part only.
    """
    from scipy.interpolate import CubicSpline

    if not designs:
        return [(1.0, CubicSpline(COARSE_LOG_ODDS, numpy.zeros((len(COARSE_LOG_ODDS), 0))))]
    cars = numpy.hstack([(design.passed, design.counted, design.shift) for design in designs])
    # Many cars have the same numbers of trials: each combination is computed once.
    (passed, counted, shifts), car_index = numpy.unique(cars, axis=1, return_inverse=True)
    starts = numpy.cumsum([0, *(len(design.passed) for design in designs[:-1])])
    # (spreads, log-odds, distinct cars)
    by_car = numpy.array(
        [_car_log_likelihood(COARSE_LOG_ODDS[:, None] + shifts, passed, counted, spread) for spread in SPREADS.tolist()]
    )
    # (spreads, log-odds, designs): the sums over each design's cars.
    by_spread = numpy.add.reduceat(by_car[:, :, car_index.ravel()], starts, axis=2)
    result = []
    # (designs, spreads)
    weights = numpy.array([design.weights for design in designs])
    # The fraction of each design's weights that comes from PRIOR.
    prior_fraction = (weights / PRIOR).min(axis=1, keepdims=True)
    # Weights without a part of PRIOR are not restricted, so all ranges would give the same result.
    for range_ in ranges if prior_fraction.any() else (SPREADS,):
        prior_in_range = numpy.where(numpy.isin(SPREADS, range_), PRIOR, 0)
        restricted = weights + prior_fraction * (prior_in_range / prior_in_range.sum() - PRIOR)
        with numpy.errstate(divide="ignore"):
            logs = by_spread + numpy.log(restricted.clip(0)).T[:, None]
        # Sum over spreads; the maximum is subtracted so that exp does not underflow.
        top = logs.max(axis=0)
        log_sum = top + numpy.log(numpy.exp(logs - top).sum(axis=0))
        result.append((float(prior_in_range.sum()), CubicSpline(COARSE_LOG_ODDS, log_sum)))
    return result


def _car_log_likelihood(log_odds: NDArray[Any], k: NDArray[Any], n: NDArray[Any] | float, spread: float) -> NDArray[Any]:
    """Return the log likelihood (m, cars) of log-odds (m, cars) of a design whose car passed k of n trials (cars,).

    The likelihood of the car's own log-odds, centre + spread z, is averaged over the standard normal z by Gauss-Hermite
    quadrature around the mode of the integrand (adaptive: Liu and Pierce 1994, doi:10.2307/2337136).
    """
    centre, z = centre_factor(spread) * log_odds, numpy.zeros(1)
    # Without spread the mode is 0. A full step may overshoot, so it is limited.
    for _ in range(NEWTON_STEPS if spread else 0):
        rate = 1 / (1 + numpy.exp(-(centre + spread * z)))
        z = z + numpy.clip((spread * (k - n * rate) - z) / (1 + spread**2 * n * rate * (1 - rate)), -2, 2)
    rate = 1 / (1 + numpy.exp(-(centre + spread * z)))
    width = 1 / numpy.sqrt(1 + spread**2 * n * rate * (1 - rate))
    # (nodes, m, cars)
    z_nodes = z + width * Z_NODES[:, None, None]
    theta = centre + spread * z_nodes
    # The weights are those for exp(-node²/2), but the integrand has exp(-z²/2).
    logs = k * theta - n * numpy.logaddexp(0, theta) + ((Z_NODES[:, None, None] ** 2 - z_nodes**2) / 2)
    top = logs.max(axis=0)
    total = numpy.tensordot(Z_WEIGHTS, numpy.exp(logs - top), axes=1)
    return numpy.asarray(top + numpy.log(total * width / numpy.sqrt(2 * numpy.pi)))


def shift(expected: Sequence[float | None], overall: float) -> float:
    """Return how much easier a car's environments are than all environments, in log-odds, shrunk by TRUST.

    ``expected`` is the fraction of simulated cars that pass in the environment of each trial, None where unknown.
    ``overall``, between 0 and 1, is simulation's rate over all environments; it counts as one further trial.
    """
    rates = [overall if rate is None else rate for rate in (None, *expected)]
    mean = sum(rates) / len(rates)
    return float(TRUST * (numpy.log(mean / (1 - mean)) - numpy.log(overall / (1 - overall))))


def simulated_weights(passed: ArrayLike, scenes: int) -> NDArray[Any]:
    """Return the weights of SPREADS given simulated cars of a design.

    Each car drove in the same number of ``scenes`` and passed in ``passed`` (cars,) of them.
    """
    from scipy.interpolate import CubicSpline

    passed_counts, cars = numpy.unique(numpy.asarray(passed, dtype=float), return_counts=True)
    by_spread = [
        _car_log_likelihood(COARSE_LOG_ODDS[:, None], passed_counts, float(scenes), spread) @ cars
        for spread in SPREADS.tolist()
    ]
    # (fine log-odds, spreads)
    logs = CubicSpline(COARSE_LOG_ODDS, numpy.array(by_spread).T)(FINE_LOG_ODDS)
    informed = PRIOR * numpy.exp(logs + JEFFREYS_LOG_DENSITY[:, None] - logs.max()).sum(axis=0)
    return numpy.asarray((1 - PRIOR_SHARE) * informed / informed.sum() + PRIOR_SHARE * PRIOR)
