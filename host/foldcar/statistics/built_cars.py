"""Success rates of a design from trials of built cars, which differ: a car is a random effect.

On the log-odds scale a car passes with centre + spread z, z standard normal over the cars of a design; its trials are
binomial. A design's rate is that of a further car of it, averaged over z. With a logistic function of slope 1 and a
standard deviation s that average is a logistic function of slope 1 / :func:`centre_factor`, within 0.011 (Zeger, Liang
and Albert 1988, doi:10.2307/2531734): so a design of log-odds m has cars around centre_factor(s) m.

The spread is unknown: SPREADS with weights. Beforehand it is half-normal (Gelman 2006), as wide as simulated cars with
the workshop's imperfections have it (0.6 to 1.9 in the width study); simulated cars of the design sharpen that, and
trials of several cars do.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy
from numpy.typing import ArrayLike, NDArray

from foldcar.statistics.rate import Rate, check_confidence
from foldcar.statistics.words import count

# Standard deviations of cars' log-odds, each for the range around it, and their weights beforehand.
SPREADS = numpy.array([0.0, 0.5, 1.0, 1.5, 2.0, 3.0])
SPREAD_SCALE = 1.3
PRIOR = numpy.array([0.5, 1.0, 1.0, 1.0, 1.5, 2.0]) * numpy.exp(-0.5 * (SPREADS / SPREAD_SCALE) ** 2)
PRIOR = PRIOR / PRIOR.sum()
# Ranges of SPREADS, in one of which those of all designs of a workshop are.
RANGES = SPREADS.reshape(3, 2)
# The part of the prior that stays beside what simulated cars say: the workshop's imperfections are assumptions.
UNTOLD = 0.2
# (16 sqrt(3) / 15 pi)^2 of Zeger, Liang and Albert.
SLOPE = 0.346
# How much of what simulation finds of environments is believed: where it errs about single ones, all of it is worse than
# nothing (docs/statistics.md).
TRUST = 0.5
# Quadrature over z (Gauss-Hermite) around the mode of each car's integrand, and the Newton steps that find it.
NODES, WEIGHTS = numpy.polynomial.hermite_e.hermegauss(15)
STEPS = 8
# Log-odds at which likelihoods are computed, and those to which they are interpolated: Jeffreys' distribution has mass at
# rates of 1e-6.
COARSE, FINE = numpy.linspace(-16, 16, 97), numpy.linspace(-16, 16, 1601)
# Jeffreys' Beta(1/2, 1/2) of the rate, as a log density of its log-odds.
JEFFREYS = -(numpy.logaddexp(0, FINE) + numpy.logaddexp(0, -FINE)) / 2


def centre_factor(spread: float | NDArray[Any]) -> Any:
    """By what factor the log-odds of a design's middle car are farther from 0 than those of its rate."""
    return numpy.sqrt(1 + SLOPE * spread**2)


@dataclass(frozen=True)
class BuiltCars:
    """The trials of cars of one design: ``passed`` of ``counted`` (cars,) of each, at least one trial.

    ``shift`` (cars,): by how much, in log-odds, simulation passes more often in the car's environments than in all.
    ``weights`` are those of SPREADS.
    """

    passed: NDArray[Any]
    counted: NDArray[Any]
    shift: NDArray[Any]
    weights: NDArray[Any]

    @classmethod
    def one(cls, passed: float, counted: float) -> "BuiltCars":
        """Trials that are all of one car, of whose kind nothing else is known."""
        return cls(numpy.array([passed]), numpy.array([counted]), numpy.zeros(1), PRIOR)

    @property
    def spread(self) -> float:
        """The standard deviation of the cars' log-odds: its mean, before these trials."""
        return float(self.weights @ SPREADS)

    @property
    def text(self) -> str:
        """``12 trials of 1 car``."""
        return f"{count(int(self.counted.sum()), 'trial')} of {count(len(self.counted), 'car')}"

    def rate(self, confidence: float = 0.95) -> Rate:
        """The rate of a further car of the design: the trials' share less their shift; beforehand as Jeffreys has it.

        Without spread and shift it has Jeffreys' interval.
        """
        check_confidence(confidence)
        tail = (1 - confidence) / 2
        low, high = self._quantiles([tail, 1 - tail]).tolist()
        low, high = (0.0 if not self.passed.any() else low), (1.0 if (self.passed == self.counted).all() else high)
        share, by = self.passed.sum() / self.counted.sum(), numpy.exp(-self.shift @ self.counted / self.counted.sum())
        value = min(max(float(share * by / (share * by + 1 - share)), low), high)
        return Rate(value, low, high, confidence, f"{self.text}, for a further car of the design")

    def draws(self, number: int, random: numpy.random.Generator) -> NDArray[Any]:
        """Draws (number,) of the rate of a further car."""
        return self._quantiles(random.random(number))

    def count_draws(self, rates: NDArray[Any], random: numpy.random.Generator) -> NDArray[Any]:
        """Draws (n,) of how many of as many trials of as many other cars pass, by rates (n,) of the design."""
        spread = random.choice(SPREADS, (len(rates), 1), p=self.weights)
        centre = centre_factor(spread) * numpy.log(rates / (1 - rates))[:, None]
        log_odds = centre + self.shift + spread * random.standard_normal((len(rates), len(self.shift)))
        return numpy.asarray(random.binomial(self.counted.astype(int), 1 / (1 + numpy.exp(-log_odds))).sum(axis=1))

    def _quantiles(self, parts: Sequence[float] | NDArray[Any]) -> NDArray[Any]:
        ((_, spline),) = likelihood([self])
        logs = spline(FINE)[:, 0] + JEFFREYS
        density = numpy.exp(logs - logs.max())
        mass = density.cumsum() - density / 2
        return numpy.asarray(1 / (1 + numpy.exp(-numpy.interp(parts, mass / density.sum(), FINE))))


def likelihood(designs: Sequence[BuiltCars], ranges: Iterable[NDArray[Any]] = (SPREADS,)) -> list[tuple[float, Any]]:
    """The log likelihood of designs given their cars: CubicSplines of log-odds, (m,) -> (m, designs), with probabilities.

    One for each of ``ranges`` in which what is assumed of the spread may be: cars of all designs are made in the same
    workshop. Were it drawn for each design, its mean over many designs would be taken for known. Of what a design's
    weights are, the largest part that is the PRIOR is the assumption.
    """
    from scipy.interpolate import CubicSpline

    if not designs:
        return [(1.0, CubicSpline(COARSE, numpy.zeros((len(COARSE), 0))))]
    cars = numpy.hstack([(design.passed, design.counted, design.shift) for design in designs])
    # Many cars have the same trials.
    (k, n, shifts), which = numpy.unique(cars, axis=1, return_inverse=True)
    starts = numpy.cumsum([0, *(len(design.passed) for design in designs[:-1])])
    each = numpy.array([_given(COARSE[:, None] + shifts, k, n, spread) for spread in SPREADS.tolist()])
    some, result = numpy.add.reduceat(each[:, :, which.ravel()], starts, axis=2), []
    weights = numpy.array([design.weights for design in designs])
    assumed = (weights / PRIOR).min(axis=1, keepdims=True)
    for range_ in ranges if assumed.any() else (SPREADS,):
        part = numpy.where(numpy.isin(SPREADS, range_), PRIOR, 0)
        with numpy.errstate(divide="ignore"):
            logs = some + numpy.log((weights + assumed * (part / part.sum() - PRIOR)).clip(0)).T[:, None]
        top = logs.max(axis=0)
        result.append((float(part.sum()), CubicSpline(COARSE, top + numpy.log(numpy.exp(logs - top).sum(axis=0)))))
    return result


def _given(log_odds: NDArray[Any], k: NDArray[Any], n: NDArray[Any] | float, spread: float) -> NDArray[Any]:
    """The log likelihood of designs' log-odds (m, cars) of which a car passed k of n (cars,)."""
    centre, z = centre_factor(spread) * log_odds, numpy.zeros(1)
    for _ in range(STEPS if spread else 0):
        rate = 1 / (1 + numpy.exp(-(centre + spread * z)))
        z = z + numpy.clip((spread * (k - n * rate) - z) / (1 + spread**2 * n * rate * (1 - rate)), -2, 2)
    rate = 1 / (1 + numpy.exp(-(centre + spread * z)))
    width = 1 / numpy.sqrt(1 + spread**2 * n * rate * (1 - rate))
    at = z + width * NODES[:, None, None]
    theta = centre + spread * at
    logs = k * theta - n * numpy.logaddexp(0, theta) + ((NODES[:, None, None] ** 2 - at**2) / 2)
    top = logs.max(axis=0)
    total = numpy.tensordot(WEIGHTS, numpy.exp(logs - top), axes=1)
    return numpy.asarray(top + numpy.log(total * width / numpy.sqrt(2 * numpy.pi)))


def shift(expected: Sequence[float | None], overall: float) -> float:
    """A car's shift from the share of simulated cars that pass in each of its trials' environments, None where unknown.

    ``overall``, 0 to 1 but neither, is simulation's rate over all environments; it counts as one more trial's.
    """
    known = [overall if rate is None else rate for rate in (None, *expected)]
    share = sum(known) / len(known)
    return float(TRUST * (numpy.log(share / (1 - share)) - numpy.log(overall / (1 - overall))))


def simulated_weights(passed: ArrayLike, scenes: int) -> NDArray[Any]:
    """The weights of SPREADS from simulated cars of a design, of which each passed so many of ``scenes`` (cars,)."""
    from scipy.interpolate import CubicSpline

    k, cars = numpy.unique(numpy.asarray(passed, dtype=float), return_counts=True)
    some = [_given(COARSE[:, None], k, float(scenes), spread) @ cars for spread in SPREADS.tolist()]
    logs = CubicSpline(COARSE, numpy.array(some).T)(FINE)
    informed = PRIOR * numpy.exp(logs + JEFFREYS[:, None] - logs.max()).sum(axis=0)
    return numpy.asarray((1 - UNTOLD) * informed / informed.sum() + UNTOLD * PRIOR)
