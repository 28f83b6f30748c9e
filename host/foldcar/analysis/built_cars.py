"""Success rates of a design from trials of built cars, which differ: a car is a random effect.

On the log-odds scale a car passes with centre + spread z, z standard normal over the cars of a design; its trials are
binomial. A design's rate is that of a further car of it, averaged over z. With a logistic function of slope 1 and a
standard deviation s that average is a logistic function of slope 1 / sqrt(1 + C s^2), within 0.011 (Zeger, Liang and
Albert 1988, doi:10.2307/2531734, C = 0.346): so a design of log-odds m has cars around sqrt(1 + C s^2) m.

The spread is unknown: SPREADS with weights. Beforehand it is half-normal (Gelman 2006), as wide as simulated cars with
the workshop's imperfections have it (0.6 to 1.9 in the width study); simulated cars of the design sharpen that, and
trials of several cars do.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy
from numpy.typing import ArrayLike, NDArray

from foldcar.analysis.rate import Rate, check_confidence
from foldcar.analysis.words import count

# Standard deviations of cars' log-odds, each for the range around it, and their weights beforehand.
SPREADS = numpy.array([0.0, 0.5, 1.0, 1.5, 2.0, 3.0])
SPREAD_SCALE = 1.3
PRIOR = numpy.array([0.5, 1.0, 1.0, 1.0, 1.5, 2.0]) * numpy.exp(-0.5 * (SPREADS / SPREAD_SCALE) ** 2)
PRIOR = PRIOR / PRIOR.sum()
# The part of the prior that stays beside what simulated cars say: the workshop's imperfections are assumptions.
UNTOLD = 0.2
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

    def _quantiles(self, parts: Sequence[float] | NDArray[Any]) -> NDArray[Any]:
        logs = likelihood([self])(FINE[:, None])[0][:, 0] + JEFFREYS
        density = numpy.exp(logs - logs.max())
        mass = density.cumsum() - density / 2
        found: NDArray[Any] = 1 / (1 + numpy.exp(-numpy.interp(parts, mass / density.sum(), FINE)))
        return found


@dataclass(frozen=True)
class Likelihood:
    """Log likelihoods of log-odds (…, designs), slopes, curvatures, interpolated between those at COARSE (c, designs)."""

    value: NDArray[Any]
    slope: NDArray[Any]
    curvature: NDArray[Any]

    def __call__(self, log_odds: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
        """Value and slope of the cubic Hermite spline, the curvature linear; beyond COARSE as at its ends."""
        step = COARSE[1] - COARSE[0]
        place = numpy.clip((log_odds - COARSE[0]) / step, 0, len(COARSE) - 1.0)
        i = numpy.minimum(place.astype(int), len(COARSE) - 2)
        at, t = (i, numpy.arange(i.shape[-1])), place - i
        next_at = (i + 1, at[1])
        first, rise = self.value[at], self.value[next_at] - self.value[at]
        a, b = step * self.slope[at] - rise, rise - step * self.slope[next_at]
        value = first + t * rise + t * (1 - t) * ((1 - t) * a + t * b)
        slope = (rise + (1 - 2 * t) * ((1 - t) * a + t * b) + t * (1 - t) * (b - a)) / step
        return value, slope, (1 - t) * self.curvature[at] + t * self.curvature[next_at]


def likelihood(designs: Sequence[BuiltCars]) -> Likelihood:
    """The likelihood of designs' log-odds, given the trials of their cars."""
    if not designs:
        return Likelihood(*numpy.zeros((3, len(COARSE), 0)))
    k, n, shift = (numpy.concatenate([getattr(one, name) for one in designs]) for name in ("passed", "counted", "shift"))
    starts = numpy.cumsum([0, *(len(one.passed) for one in designs[:-1])])
    some = numpy.array([_given(COARSE[:, None] + shift, k, n, spread) for spread in SPREADS.tolist()])
    value, slope, curvature = numpy.add.reduceat(some, starts, axis=-1).swapaxes(0, 1)
    with numpy.errstate(divide="ignore"):
        logs = value + numpy.log(numpy.array([one.weights for one in designs])).T[:, None]
    top = logs.max(axis=0)
    shares = numpy.exp(logs - top)
    total = shares.sum(axis=0)
    shares /= total
    mean = (shares * slope).sum(axis=0)
    bent = (shares * (curvature + slope**2)).sum(axis=0) - mean**2
    # A mixture may curve upwards far from its mode.
    return Likelihood(top + numpy.log(total), mean, numpy.minimum(bent, 0))


def _given(
    log_odds: NDArray[Any], k: NDArray[Any], n: NDArray[Any] | float, spread: float
) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
    """Of each car (m, cars) that passed k of n: the log likelihood of its design's log-odds, slope and curvature."""
    scale = numpy.sqrt(1 + SLOPE * spread**2)
    centre, z = scale * log_odds, numpy.zeros_like(log_odds)

    def chance(at: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any]]:
        rate = 1 / (1 + numpy.exp(-(centre + spread * at)))
        return rate, n * rate * (1 - rate)

    for _ in range(STEPS if spread else 0):
        rate, variance = chance(z)
        z += numpy.clip((spread * (k - n * rate) - z) / (1 + spread**2 * variance), -2, 2)
    width = 1 / numpy.sqrt(1 + spread**2 * chance(z)[1])
    terms = []
    for node, weight in zip(NODES, WEIGHTS, strict=True):
        at = z + width * node
        rate, variance = chance(at)
        theta = centre + spread * at
        score = scale * (k - n * rate)
        value = k * theta - n * numpy.logaddexp(0, theta) + (node**2 - at**2) / 2 + numpy.log(weight)
        terms.append((value, score, score**2 - scale**2 * variance))
    logs, scores, bends = (numpy.array(one) for one in zip(*terms, strict=True))
    top = logs.max(axis=0)
    shares = numpy.exp(logs - top)
    total = shares.sum(axis=0)
    shares /= total
    slope = (shares * scores).sum(axis=0)
    value = top + numpy.log(total * width / numpy.sqrt(2 * numpy.pi))
    return value, slope, (shares * bends).sum(axis=0) - slope**2


def shift(expected: Sequence[float | None], overall: float) -> float:
    """A car's shift from the share of simulated cars that pass in each of its trials' environments, None where unknown.

    ``overall``, 0 to 1 but neither, is simulation's rate over all environments; it counts as one more trial's.
    """
    known = [overall if one is None else one for one in (None, *expected)]
    share = sum(known) / len(known)
    return float(TRUST * (numpy.log(share / (1 - share)) - numpy.log(overall / (1 - overall))))


def simulated_weights(passed: ArrayLike, scenes: int) -> NDArray[Any]:
    """The weights of SPREADS from simulated cars of a design, of which each passed so many of ``scenes`` (cars,)."""
    k, cars = numpy.unique(numpy.asarray(passed, dtype=float), return_counts=True)
    at = numpy.repeat(COARSE[:, None], len(k), axis=1)
    some = numpy.array([_given(at, k, float(scenes), spread) for spread in SPREADS.tolist()]) @ cars
    logs = Likelihood(*some.swapaxes(0, 1).swapaxes(1, 2))(numpy.repeat(FINE[:, None], len(SPREADS), axis=1))[0]
    told = PRIOR * numpy.exp(logs + JEFFREYS[:, None] - logs.max()).sum(axis=0)
    found: NDArray[Any] = (1 - UNTOLD) * told / told.sum() + UNTOLD * PRIOR
    return found
