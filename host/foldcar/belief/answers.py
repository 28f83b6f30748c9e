"""Reads answers from weighted draws of realities: rates with intervals, chances, what the trials have taught.

Every answer is a weighted mean or a weighted quantile over the same draws, so answers never contradict each other.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy
from scipy.special import expit, gammaln

from foldcar.belief.learning import Learned
from foldcar.belief.priors import PARAMETERS, FloatArray, ScorePrior, UnknownParameter
from foldcar.belief.trials import Trials
from foldcar.belief.weighing import (
    CAR_SD,
    UNEXPLAINED,
    Draws,
    Prior,
    centre_of_cars,
    effective_number,
    normalised,
    weigh,
)

# All intervals contain the value with this probability.
CONFIDENCE = 0.95
# The probabilities of a value below the lower end and below the upper end of an interval.
INTERVAL = (1 - CONFIDENCE) / 2, (1 + CONFIDENCE) / 2
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
# Two thirds of a normal distribution lie within this many standard deviations.
TWO_THIRDS_SD = 0.97
# Standard deviations of scores, by which is divided, are raised to this.
MIN_SD = 1e-9
# The same random numbers each time, so that the same trials give the same answers.
SURPRISE_SEED, REALITIES_SEED = 5, 3
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
        """The built cars that drove, each with its trials and its estimated success rate.

        The rate of a car differs from that of its design, because no two built cars are equal.
        """
        if not self.driven:
            return []
        # Each weighted draw of the posterior has a rate for each car.
        rates = estimates(self.draws.car_rates(self.trials), self.draws.weights)
        cars = len(self.trials.design)
        # A car has several groups of trials, one for each scene.
        passed = numpy.bincount(self.trials.car, self.trials.passed, minlength=cars)
        counted = numpy.bincount(self.trials.car, self.trials.counted, minlength=cars)
        return [
            CarAnswer(
                design=int(self.trials.design[car]),
                name=self.trials.names[car],
                passed=int(passed[car]),
                counted=int(counted[car]),
                rate=rates[car],
            )
            for car in range(cars)
        ]

    @cached_property
    def unknowns(self) -> list[Unknown]:
        """What the trials have taught about each of PARAMETERS."""
        return [self._unknown(index, parameter) for index, parameter in enumerate(PARAMETERS)]

    def _unknown(self, index: int, parameter: UnknownParameter) -> Unknown:
        """Return what is known about a parameter before and after the trials; ``index`` is its index in PARAMETERS."""
        scores_before, scores_after = self.before.scores[:, index], self.draws.scores[:, index]
        before = _median_estimate(scores_before, self.before.weights)
        after = _median_estimate(scores_after, self.draws.weights)
        # Shift and narrowing are divided by the first of these, so it must not be 0.
        sd_before = max(_sd(scores_before, self.before.weights), MIN_SD)
        sd_after = _sd(scores_after, self.draws.weights)
        measured = None
        chance_of_wrong_value = 0.0
        if index in self.draws.prior.measured:
            measured_score = self.draws.prior.known[index].mean
            measured = float(parameter.value(measured_score))
            chance_of_wrong_value = float(self.draws.weights @ self.draws.wrong[:, index])
        return Unknown(
            parameter,
            before=_in_unit(parameter, before),
            after=_in_unit(parameter, after),
            shift=(after.value - before.value) / sd_before,
            narrowed=1 - (sd_after / sd_before) ** 2,
            measured=measured,
            wrong=chance_of_wrong_value,
        )

    @cached_property
    def unexplained(self) -> tuple[float, float]:
        """The median size of the unexplained error (log-odds) before and after the trials."""
        return UNEXPLAINED, _median_estimate(self.draws.size, self.draws.weights).value

    @property
    def unexplained_has_grown(self) -> bool:
        """Whether the unexplained error had to grow: something is wrong that the list of unknowns does not have."""
        before, after = self.unexplained
        return after > GROWN * before

    @cached_property
    def car_sd(self) -> tuple[float, float]:
        """By how much cars of a design differ (log-odds, median) before and after the trials."""
        return CAR_SD, _median_estimate(self.draws.car_sd, self.draws.weights).value

    def single_cars(self, design: int) -> tuple[float, float]:
        """Return an interval (low, high): two thirds of the further cars of a design have a success rate within it."""
        log_odds = self.draws.log_odds(numpy.array([design]))[:, 0]
        median_log_odds = _median_estimate(log_odds, self.draws.weights).value
        # By how much the log-odds of the cars differ, as known after the trials. The log-odds of the design belong to the
        # mean rate of its cars, and are not quite the middle of the cars' log-odds.
        _, car_sd = self.car_sd
        centre = centre_of_cars(numpy.asarray(median_log_odds), car_sd)
        half_width = TWO_THIRDS_SD * car_sd
        return float(expit(centre - half_width)), float(expit(centre + half_width))

    @cached_property
    def surprises(self) -> list[Surprise]:
        """The driven designs whose number of passed trials is improbable, judged by the trials of all other designs."""
        if len(self.trials.driven) < 2:
            return []

        def trial_count(design: int) -> int:
            """Return the number of trials of a design."""
            _, counted = self.trials.counts_of(design)
            return int(counted)

        # Only the designs with the most trials are judged.
        most_trials_first = sorted(self.trials.driven.tolist(), key=trial_count, reverse=True)
        surprises = []
        for design in sorted(most_trials_first[:MAX_COMPARED]):
            passed, counted = self.trials.counts_of(design)
            # Random numbers of passed trials, as the trials of the other designs make them probable.
            expected_passed = self._passed_by_other_designs(design)
            # The probabilities of so few passed trials, and of so many.
            chance_of_so_few = (expected_passed <= passed).mean()
            chance_of_so_many = (expected_passed >= passed).mean()
            if min(chance_of_so_few, chance_of_so_many) < SURPRISE:
                low, high = numpy.quantile(expected_passed / counted, INTERVAL).tolist()
                expected = Estimate(float(expected_passed.mean()) / counted, low, high)
                surprises.append(Surprise(design, passed, counted, expected))
        return surprises

    def _passed_by_other_designs(self, design: int) -> FloatArray:
        """Draw at random how many trials of a design pass, as predicted from the trials of all other designs alone.

        ``design`` is its index. The result has SURPRISE_DRAWS random numbers of passed trials. They are for new cars of
        the design: as many as drove, each with as many trials as the car that drove.
        """
        # Weighted draws of the posterior, from which so many are chosen by their weights.
        draws = self._draws_without(design)
        random = numpy.random.default_rng(SURPRISE_SEED)
        chosen = random.choice(len(draws.weights), SURPRISE_DRAWS, p=draws.weights)
        log_odds = draws.log_odds(numpy.array([design]))[chosen, 0]
        car_sd = draws.car_sd[chosen]
        passed = numpy.zeros(SURPRISE_DRAWS)
        for car in numpy.flatnonzero(self.trials.design == design):
            trials_of_car = int(self.trials.counted[self.trials.car == car].sum())
            # A new car deviates at random from the other cars of its design.
            car_log_odds = centre_of_cars(log_odds, car_sd) + car_sd * random.standard_normal(SURPRISE_DRAWS)
            passed += random.binomial(trials_of_car, expit(car_log_odds))
        return passed

    def _draws_without(self, design: int) -> Draws:
        """Return draws whose weights follow from the trials of all designs but this one."""
        log_likelihoods = self.draws.log_likelihood_of_cars(self.trials)
        of_design = log_likelihoods[:, self.trials.design == design].sum(axis=1)
        # The present weights contain the likelihood of this design's trials, so it is divided out. A tiny number avoids
        # the logarithm of 0.
        weights = normalised(numpy.log(self.draws.weights + 1e-300) - of_design)
        if effective_number(weights) >= MIN_EFFECTIVE_WITHOUT:
            return replace(self.draws, weights=weights)
        # Too few draws have weight now, because all draws were made to fit this design's trials. So make new ones.
        return weigh(self.draws.prior, self.trials.without(design))

    def realities(self, number: int) -> tuple[FloatArray, FloatArray]:
        """Draw ``number`` realities by their weights, and return their values and the rates of the designs in them.

        The values (number, parameters) are in the parameters' units. The rates are (number, d). They do not contain the
        errors that the simulator makes at each design independently, so that curves over the designs are smooth.
        """
        weights = self.draws.weights
        random = numpy.random.default_rng(REALITIES_SEED)
        chosen = random.choice(len(weights), number, p=weights)
        realities = replace(self.draws, normal=self.draws.normal[chosen], weights=weights[chosen])
        designs = numpy.arange(len(realities.prior.designs))
        log_odds = realities.prior.log_odds(realities.scores, designs) + realities.unexplained(designs)
        values = [parameter.value(realities.scores[:, index]) for index, parameter in enumerate(PARAMETERS)]
        return numpy.column_stack(values), numpy.asarray(expit(log_odds))


def believe(
    learned: Learned,
    designs: FloatArray,
    trials: Trials,
    known: dict[int, ScorePrior] | None = None,
    measured: Sequence[int] = (),
    offsets: FloatArray | float = 0.0,
) -> Answers:
    """Return what is probable about the success of ``designs`` (d, parameters) before and after ``trials`` of built cars.

    ``learned`` is the success rate of a design as a function of the simulator's uncertain parameters, as learned from
    simulation. ``known`` are priors of single unknown parameters that are
    narrower than usual, by the parameter's index in PARAMETERS; ``measured`` are the indices of the parameters that were
    measured. ``offsets`` (d,) are differences of single designs from the learned log-odds.
    """
    prior = Prior(learned, designs, known or {}, frozenset(measured), offsets)
    before = weigh(prior, Trials.of_counts([]))
    has_trials = len(trials.car) > 0
    after = weigh(prior, trials) if has_trials else before
    return Answers(before, after, trials)


def estimates(values: FloatArray, weights: FloatArray) -> list[Estimate]:
    """Return the weighted mean and interval of each column of ``values`` (n, columns)."""
    means = weights @ values
    # The rows of each column in ascending order, and the weight of all values up to each of them.
    order = numpy.argsort(values, axis=0)
    cumulated_weights = numpy.cumsum(weights[order], axis=0)
    column_estimates = []
    for column in range(values.shape[1]):
        # The ends of the interval are the weighted quantiles at the two probabilities of INTERVAL.
        positions = numpy.searchsorted(cumulated_weights[:, column], INTERVAL)
        # Rounding can make the last cumulated weight less than a probability.
        positions = positions.clip(max=len(values) - 1)
        low, high = values[order[positions, column], column]
        column_estimates.append(Estimate(float(means[column]), float(low), float(high)))
    return column_estimates


def log_binomials(counted: int) -> FloatArray:
    """Return the logarithms (counted + 1,) of the numbers of ways to pass 0, 1, … of ``counted`` trials."""
    passed = numpy.arange(counted + 1)
    return numpy.asarray(gammaln(counted + 1) - gammaln(passed + 1) - gammaln(counted - passed + 1))


def _median_estimate(values: FloatArray, weights: FloatArray) -> Estimate:
    """Return the weighted median of ``values`` (n,) with its interval."""
    order = numpy.argsort(values)
    cumulated_weights = numpy.cumsum(weights[order])
    low_end, high_end = INTERVAL
    positions = numpy.searchsorted(cumulated_weights, [low_end, 0.5, high_end]).clip(max=len(values) - 1)
    low, median, high = values[order[positions]].tolist()
    return Estimate(median, low, high)


def _sd(values: FloatArray, weights: FloatArray) -> float:
    """Return the weighted standard deviation of ``values`` (n,)."""
    mean = weights @ values
    return float(numpy.sqrt(weights @ (values - mean) ** 2))


def _in_unit(parameter: UnknownParameter, scores: Estimate) -> Estimate:
    """Convert an estimate of a parameter's score to the parameter's unit."""
    return Estimate(
        value=float(parameter.value(scores.value)),
        low=float(parameter.value(scores.low)),
        high=float(parameter.value(scores.high)),
    )
