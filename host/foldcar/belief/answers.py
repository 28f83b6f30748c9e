"""Reads answers from weighted draws of realities: rates with intervals, chances, what the trials have taught.

Every answer is a weighted mean or a weighted quantile over the same draws, so answers never contradict each other.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy
from scipy.special import expit, gammaln

from foldcar.belief.learning import Learned
from foldcar.belief.priors import PARAMETERS, FloatArray, ScorePrior, UnknownParameter
from foldcar.belief.weighing import (
    CAR_SD,
    UNEXPLAINED,
    Draws,
    Prior,
    Trials,
    centre_of_cars,
    effective_number,
    normalised,
    weigh,
)

# All intervals contain the value with this probability.
CONFIDENCE = 0.95
# A design *reaches* a threshold if its chance is at least REACHES, *probably* if it is at least PROBABLY.
REACHES, PROBABLY = 0.975, 0.8
# An unknown has moved if its median has moved by this many standard deviations of the prior, and is narrowed if this
# fraction of the prior's variance is gone.
MOVED, NARROWED = 0.6, 0.25
# The unexplained error has grown if its median is this many times the prior's.
GROWN = 1.6
# A trial is a surprise if results at least as far out have a smaller probability, given all other designs' trials.
SURPRISE = 0.025
# Leaving out a design's trials must leave this many effective draws.
MIN_EFFECTIVE_WITHOUT = 300
SURPRISE_DRAWS = 4_000
# Of more driven designs, those with most trials are compared with the others.
MAX_COMPARED = 8


@dataclass(frozen=True, slots=True)
class Estimate:
    """A mean with the ends of its central interval of CONFIDENCE."""

    value: float
    low: float
    high: float


@dataclass(frozen=True, slots=True)
class CarAnswer:
    """A car that drove: its ``design`` (index), its ``name``, its trials, and its own ``rate``."""

    design: int
    name: str | None
    passed: int
    counted: int
    rate: Estimate


@dataclass(frozen=True)
class Unknown:
    """What the trials have taught about a parameter of the simulator.

    ``before`` and ``after`` are its median and interval in its own unit. ``shift`` is how far the median moved, in
    standard deviations of the prior, ``narrowed`` the fraction of the prior's variance that is gone. ``measured`` is the
    measured value, None if it was not measured; ``wrong`` is the probability that this measurement is wrong.
    """

    parameter: UnknownParameter
    before: Estimate
    after: Estimate
    shift: float
    narrowed: float
    measured: float | None = None
    wrong: float = 0.0

    @property
    def taught(self) -> bool:
        """Whether the trials say something about it."""
        return abs(self.shift) >= MOVED or self.narrowed >= NARROWED


@dataclass(frozen=True)
class Surprise:
    """A driven ``design`` whose trials are unlike what all others say: ``expected`` is the interval of its fraction."""

    design: int
    passed: int
    counted: int
    expected: Estimate


@dataclass(frozen=True)
class Answers:
    """Answers about d designs, from ``draws`` weighed by ``trials``; ``before`` are draws without trials."""

    before: Draws
    draws: Draws
    trials: Trials

    @property
    def learned(self) -> Learned:
        """The success rate as it was learned from runs in realities."""
        return self.draws.prior.learned

    @property
    def driven(self) -> bool:
        """Whether there are trials."""
        return bool(len(self.trials.car))

    @cached_property
    def rates(self) -> FloatArray:
        """The success rate (n, d) of a further car of each design under each draw."""
        return numpy.asarray(expit(self.draws.log_odds(numpy.arange(len(self.draws.prior.designs)))))

    @cached_property
    def expected(self) -> FloatArray:
        """The expected success rate (d,) of a further car of each design."""
        return numpy.asarray(self.draws.weights @ self.rates)

    @cached_property
    def built(self) -> list[Estimate]:
        """The success rate of a further car of each design."""
        return estimates(self.rates, self.draws.weights)

    @property
    def best(self) -> int:
        """The index of the design with the highest expected rate."""
        return int(self.expected.argmax())

    def chances(self, threshold: float) -> FloatArray:
        """Return the probability (d,) that each design's rate is at least ``threshold`` (0 to 1)."""
        return numpy.asarray(self.draws.weights @ (self.rates >= threshold))

    @cached_property
    def best_chances(self) -> FloatArray:
        """The probability (d,) that each design is the best."""
        best = self.rates.argmax(axis=1)
        return numpy.bincount(best, self.draws.weights, minlength=self.rates.shape[1]).astype(float)

    @cached_property
    def cars(self) -> list[CarAnswer]:
        """The cars that drove, with their own rates."""
        if not self.driven:
            return []
        rates = estimates(self.draws.car_rates(self.trials), self.draws.weights)
        cars = len(self.trials.design)
        passed = numpy.bincount(self.trials.car, self.trials.passed, minlength=cars).astype(int).tolist()
        counted = numpy.bincount(self.trials.car, self.trials.counted, minlength=cars).astype(int).tolist()
        columns = zip(self.trials.design.tolist(), self.trials.names, passed, counted, rates, strict=True)
        return [CarAnswer(*column) for column in columns]

    @cached_property
    def unknowns(self) -> list[Unknown]:
        """What the trials have taught about each of PARAMETERS."""
        known, measured, result = self.draws.prior.known, self.draws.prior.measured, []
        for index, parameter in enumerate(PARAMETERS):
            before, after = (_central(draws.scores[:, index], draws.weights) for draws in (self.before, self.draws))
            sd_before, sd_after = (_sd(draws.scores[:, index], draws.weights) for draws in (self.before, self.draws))
            value = float(parameter.value(known[index].mean)) if index in measured else None
            wrong = float(self.draws.weights @ self.draws.wrong[:, index]) if index in measured else 0.0
            result.append(
                Unknown(
                    parameter, _in_unit(parameter, before), _in_unit(parameter, after),
                    (after.value - before.value) / max(sd_before, 1e-9), 1 - (sd_after / max(sd_before, 1e-9)) ** 2,
                    value, wrong,
                )
            )  # fmt: skip
        return result

    @cached_property
    def unexplained(self) -> tuple[float, float]:
        """The median size of the unexplained error (log-odds) before and after the trials."""
        return UNEXPLAINED, _central(self.draws.size, self.draws.weights).value

    @property
    def grown(self) -> bool:
        """Whether the unexplained error had to grow: something is wrong that the list of unknowns does not have."""
        before, after = self.unexplained
        return after > GROWN * before

    @cached_property
    def car_sd(self) -> tuple[float, float]:
        """By how much cars of a design differ (log-odds, median) before and after the trials."""
        return CAR_SD, _central(self.draws.car_sd, self.draws.weights).value

    def single_cars(self, design: int) -> tuple[float, float]:
        """Return the interval that contains the own rate of two of three further cars of a design, at the median draw."""
        log_odds = self.draws.log_odds(numpy.array([design]))[:, 0]
        car_sd = self.car_sd[1]
        centre = centre_of_cars(numpy.asarray(_central(log_odds, self.draws.weights).value), car_sd)
        # Two thirds of a normal distribution lie within 0.97 standard deviations.
        return float(expit(centre - 0.97 * car_sd)), float(expit(centre + 0.97 * car_sd))

    @cached_property
    def surprises(self) -> list[Surprise]:
        """The driven designs whose trials are unlike what the trials of all other designs say."""
        result = []
        most = sorted(self.trials.driven.tolist(), key=lambda design: -self.trials.counts_of(design)[1])[:MAX_COMPARED]
        for design in sorted(most) if len(self.trials.driven) > 1 else []:
            log_odds, car_sd, weights = self._without(design)
            random = numpy.random.default_rng(5)
            chosen = random.choice(len(weights), SURPRISE_DRAWS, p=weights)
            passed, counted = self.trials.counts_of(design)
            totals = numpy.zeros(SURPRISE_DRAWS)
            for car in numpy.flatnonzero(self.trials.design == design):
                # Another car of the design drives as often.
                centre = centre_of_cars(log_odds[chosen], car_sd[chosen])
                of_car = centre + car_sd[chosen] * random.standard_normal(SURPRISE_DRAWS)
                totals += random.binomial(int(self.trials.counted[self.trials.car == car].sum()), expit(of_car))
            if min((totals <= passed).mean(), (totals >= passed).mean()) < SURPRISE:
                low, high = numpy.quantile(totals / counted, [(1 - CONFIDENCE) / 2, (1 + CONFIDENCE) / 2]).tolist()
                expected = Estimate(float(totals.mean()) / counted, low, high)
                result.append(Surprise(design, passed, counted, expected))
        return result

    def _without(self, design: int) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return log-odds (n,) of a design, the cars' standard deviations (n,) and weights (n,) without its trials."""
        draws, others = self.draws, self.trials.without(design)
        own = draws.log_likelihood_of_cars(self.trials)[:, self.trials.design == design].sum(axis=1)
        weights = normalised(numpy.log(draws.weights + 1e-300) - own)
        if effective_number(weights) < MIN_EFFECTIVE_WITHOUT:
            # The draws stand where the left-out trials are; others must be drawn.
            draws = weigh(draws.prior, others)
            weights = draws.weights
        return draws.log_odds(numpy.array([design]))[:, 0], draws.car_sd, weights

    def realities(self, number: int) -> tuple[FloatArray, FloatArray]:
        """Return ``number`` realities drawn by their weights: their values and rates.

        The values (number, parameters) are in the parameters' units. The rates (number, d) of the designs are without
        the unexplained errors of each design alone, so that neighbouring designs have similar rates.
        """
        weights = self.draws.weights
        chosen = numpy.random.default_rng(3).choice(len(weights), number, p=weights)
        drawn = Draws(self.draws.prior, self.draws.driven, self.draws.normal[chosen], weights[chosen])
        designs = numpy.arange(len(drawn.prior.designs))
        log_odds = drawn.prior.log_odds(drawn.scores, designs) + drawn.unexplained(designs)
        values = [parameter.value(drawn.scores[:, i]) for i, parameter in enumerate(PARAMETERS)]
        return numpy.column_stack(values), numpy.asarray(expit(log_odds))


def believe(
    learned: Learned,
    designs: FloatArray,
    trials: Trials,
    known: dict[int, ScorePrior] | None = None,
    measured: Sequence[int] = (),
    offsets: FloatArray | float = 0.0,
) -> Answers:
    """Return the answers about ``designs`` (d, parameters) after ``trials``.

    ``known`` has narrower priors by the parameter's index. ``measured`` are the indices of those that were measured.
    ``offsets`` (d,) are the designs' own differences from the learned log-odds.
    """
    prior = Prior(learned, designs, known or {}, frozenset(measured), offsets)
    none = Trials.of_counts([])
    before = weigh(prior, none)
    return Answers(before, weigh(prior, trials) if len(trials.car) else before, trials)


def estimates(values: FloatArray, weights: FloatArray) -> list[Estimate]:
    """Return the weighted mean and interval of each column of ``values`` (n, columns)."""
    order = numpy.argsort(values, axis=0)
    cumulated = numpy.cumsum(weights[order], axis=0)
    means = weights @ values
    result = []
    for column in range(values.shape[1]):
        at = numpy.searchsorted(cumulated[:, column], [(1 - CONFIDENCE) / 2, (1 + CONFIDENCE) / 2])
        low, high = values[order[at.clip(max=len(values) - 1), column], column]
        result.append(Estimate(float(means[column]), float(low), float(high)))
    return result


def log_binomials(counted: int) -> FloatArray:
    """Return the logarithms (counted + 1,) of the numbers of ways to pass 0, 1, … of ``counted`` trials."""
    passed = numpy.arange(counted + 1)
    return numpy.asarray(gammaln(counted + 1) - gammaln(passed + 1) - gammaln(counted - passed + 1))


def _central(values: FloatArray, weights: FloatArray) -> Estimate:
    """Return the weighted median of ``values`` (n,) with its interval."""
    order = numpy.argsort(values)
    at = numpy.searchsorted(numpy.cumsum(weights[order]), [(1 - CONFIDENCE) / 2, 0.5, (1 + CONFIDENCE) / 2])
    low, middle, high = values[order[at.clip(max=len(values) - 1)]].tolist()
    return Estimate(middle, low, high)


def _sd(values: FloatArray, weights: FloatArray) -> float:
    mean = weights @ values
    return float(numpy.sqrt(weights @ (values - mean) ** 2))


def _in_unit(parameter: UnknownParameter, scores: Estimate) -> Estimate:
    """Return an estimate of a score in the parameter's unit."""
    return Estimate(*(float(parameter.value(score)) for score in (scores.value, scores.low, scores.high)))
