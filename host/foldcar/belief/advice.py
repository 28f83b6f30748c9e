"""Values what a person could do next: drive a car again, build a car, measure the obstacles or the car.

The value of a step is by how much it is expected to raise the rate of the design that is recommended afterwards. For each
result that the step may have, the draws get other weights, and with these another design may have the highest expected
rate. The mean of this highest rate over all results, minus the highest rate now, is the gain of the step (the knowledge
gradient: Frazier, Powell and Dayanik 2008, doi:10.1137/070693424). The highest of several noisy means is too high, so one
half of the draws chooses the design, and the other half says how good it is.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy
from numpy.typing import NDArray
from scipy.special import logit

from foldcar.belief.answers import Answers, log_binomials
from foldcar.belief.priors import NAMES, FloatArray
from foldcar.belief.weighing import NODE_WEIGHTS, NODES, centre_of_cars

# An afternoon: this many trials of one car.
AFTERNOON_TRIALS = 10
# Draws and designs that are used to value steps; of more designs those with the highest chance to be the best.
STEP_DRAWS, MAX_CANDIDATES = 4_000, 60
# Results of a measurement that are tried.
RESULTS = 30
# Cars that may be driven again; of more, those with the highest rates.
MAX_CARS = 12
# Another afternoon is not worth it if it is expected to gain less than this rate.
MIN_GAIN = 0.01
# A design fails almost surely if its rate is below FAILS with a probability of 97.5 %: it is no step.
FAILS = 0.05
# Rates are kept this far from 0 and 1, where log-odds are infinite.
MIN_RATE = 1e-9
# The weight of the mean rate beside the chance to be best, so small that it only orders designs of the same chance.
TIE_BREAK = 1e-3
# Steps are valued with the same random numbers each time.
RESAMPLING_SEED = 13


@dataclass(frozen=True, slots=True)
class AdvisedStep:
    """Something to do next, and by how much the rate of the recommended design is expected to rise.

    ``kind``: *drive* the car with index ``car`` again, *build* a car of the design with index ``design`` (with ``second``
    if cars of it have driven), or *measure* the parameter called ``parameter``. ``gain`` is a rate, 0 to 1.
    """

    kind: Literal["drive", "build", "measure"]
    gain: float
    minutes: float
    design: int | None = None
    car: int | None = None
    second: bool = False
    parameter: str = ""

    @property
    def gain_per_hour(self) -> float:
        """The gain of an hour of this work."""
        return self.gain * 60 / self.minutes


def steps(
    answers: Answers,
    build_min: float,
    drive_min: Callable[[int], float],
    measurable: Mapping[str, tuple[float, float]],
    trials: int = AFTERNOON_TRIALS,
) -> list[AdvisedStep]:
    """Return the possible steps, the greatest gain for an hour of work first.

    A step is to build a car and drive it, to drive a car again, or to measure a parameter. ``build_min`` are the minutes
    to build a car. ``drive_min`` returns the minutes of one trial of the design with the given index. ``measurable`` has
    the measurements that were not made yet, by the parameter's name: the minutes of work, and the precision, which is the
    standard deviation of the measured score. ``trials`` is the number of trials that a car drives.
    """
    valuation = _Valuation(answers)
    advised_steps = []
    for design in valuation.candidates.tolist():
        gain = valuation.gain(valuation.new_car_outcomes(design, trials))
        minutes = build_min + trials * drive_min(design)
        was_driven = design in valuation.driven_designs
        advised_steps.append(AdvisedStep("build", gain, minutes, design=design, second=was_driven))
    for car, outcomes in valuation.driven_car_outcomes(trials).items():
        design = int(answers.trials.design[car])
        minutes = trials * drive_min(design)
        advised_steps.append(AdvisedStep("drive", valuation.gain(outcomes), minutes, design=design, car=car))
    for name, (minutes, precision) in measurable.items():
        gain = valuation.gain(valuation.measurement_results(NAMES.index(name), precision))
        advised_steps.append(AdvisedStep("measure", gain, minutes, parameter=name))
    return sorted(advised_steps, key=lambda step: -step.gain_per_hour)


class _Valuation:
    """Computes how much the next steps, such as trials of a new car, are worth.

    It uses STEP_DRAWS draws of equal weight. A draw is a possible reality, in which every design has a certain success
    rate.
    """

    def __init__(self, answers: Answers) -> None:
        """Choose the draws. ``answers`` has many draws with weights."""
        self._answers = answers
        self._draw_indices = _resampled(answers.draws.weights)
        # For each chosen draw, the success rates of the designs (draws, d) and their log-odds.
        self._rates = answers.rates[self._draw_indices]
        self._log_odds = logit(self._rates.clip(MIN_RATE, 1 - MIN_RATE))
        # The standard deviation of the log-odds of a design's cars (draws, 1).
        self._car_sd = answers.draws.car_sd[self._draw_indices][:, None]
        # The rate that is expected without any step, which is a step with a single result, which is certain.
        self._rate_now = self._expected_rate(numpy.ones((STEP_DRAWS, 1)))
        self.driven_designs = set(answers.trials.driven.tolist())

    @property
    def candidates(self) -> NDArray[Any]:
        """The indices of at most MAX_CANDIDATES designs that may be worth building, the most promising first.

        Designs that fail almost surely are left out.
        """
        high_rates = numpy.quantile(self._rates, 0.975, axis=0)
        may_pass = numpy.flatnonzero(high_rates >= FAILS)
        # The chance to be the best design; designs with the same chance are ordered by their mean rate.
        mean_rates = self._rates[:, may_pass].mean(axis=0)
        promise = self._answers.best_chances[may_pass] + TIE_BREAK * mean_rates
        most_promising = numpy.argsort(-promise, kind="stable")[:MAX_CANDIDATES]
        return may_pass[most_promising]

    def gain(self, outcomes: FloatArray) -> float:
        """Return the gain of a step, a rate of 0 to 1; ``outcomes`` (draws, results) are its results' probabilities."""
        return max(0.0, self._expected_rate(outcomes) - self._rate_now)

    def _expected_rate(self, outcomes: FloatArray) -> float:
        """Return the expected rate of the design that is recommended once the result of a step is known.

        ``outcomes`` (draws, results) are the probabilities of the step's results in each draw.
        """
        # If the same draws chose a design and judged it, its rate would look too good. So the draws are divided into two
        # halves. Systematic resampling makes neighbouring draws alike, so every second draw represents all of them.
        even, odd = slice(0, None, 2), slice(1, None, 2)
        # For each result and design, the sum over draws of the result's probability times the rate: (results, d).
        even_rates = outcomes[even].T @ self._rates[even]
        odd_rates = outcomes[odd].T @ self._rates[odd]
        total = 0.0
        for even_rates_of_result, odd_rates_of_result in zip(even_rates, odd_rates, strict=True):
            # Each half chooses the design with the highest rate, and the other half says how good it is.
            total += even_rates_of_result[odd_rates_of_result.argmax()]
            total += odd_rates_of_result[even_rates_of_result.argmax()]
        return float(total / len(self._rates))

    def new_car_outcomes(self, design: int, trials: int) -> FloatArray:
        """Return the probabilities (draws, trials + 1) that a new car of the design passes 0, 1, … of ``trials``."""
        centre = centre_of_cars(self._log_odds[:, [design]], self._car_sd)
        car_log_odds = centre + self._car_sd * NODES
        return _pass_count_probabilities(car_log_odds, NODE_WEIGHTS[None], trials)

    def driven_car_outcomes(self, trials: int) -> dict[int, FloatArray]:
        """Return the probabilities that a car passes 0, 1, … of further ``trials``, for cars that drove already.

        The result has an array (draws, trials + 1) by the car's index. If there are more than MAX_CARS cars, it has those
        with the highest rates.
        """
        if not self._answers.driven:
            return {}
        car_odds = self._answers.draws.car_odds(self._answers.trials)
        # The car's own trials make some of its possible log-odds more probable than others.
        probabilities = car_odds.probabilities()
        cars = self._answers.cars
        best_cars = sorted(range(len(cars)), key=lambda car: -cars[car].rate.value)[:MAX_CARS]
        outcomes = {}
        for car in best_cars:
            outcomes[car] = _pass_count_probabilities(
                log_odds=car_odds.log_odds[self._draw_indices, car],
                weights=probabilities[self._draw_indices, car],
                trials=trials,
            )
        return outcomes

    def measurement_results(self, parameter: int, precision: float) -> FloatArray:
        """Return the probability of each possible result of a measurement in each draw: (draws, RESULTS).

        ``parameter`` is the index of the measured parameter. Its measured score is normally distributed around the true
        score, with the standard deviation ``precision``. For the computation there are only RESULTS different results.
        """
        scores = self._answers.draws.scores[self._draw_indices, parameter]
        # The results are the midpoints of equally probable parts of the scores' distribution.
        results = numpy.quantile(scores, (numpy.arange(RESULTS) + 0.5) / RESULTS)
        # The standard deviation is at least the distance of two results. Otherwise each draw would have only one possible
        # result.
        sd = max(precision, float(numpy.ptp(results)) / RESULTS)
        distances = (scores[:, None] - results) / sd
        density = numpy.exp(-(distances**2) / 2)
        return numpy.asarray(density / density.sum(axis=1, keepdims=True))


def _resampled(weights: FloatArray) -> NDArray[Any]:
    """Choose STEP_DRAWS draws with probabilities ``weights`` (n,), and return their indices in ascending order.

    This is systematic resampling: the draws are chosen at equal distances along the cumulated weights, from a random
    start. It has less noise than independent choices.
    """
    random = numpy.random.default_rng(RESAMPLING_SEED)
    positions = (numpy.arange(STEP_DRAWS) + random.random()) / STEP_DRAWS
    indices = numpy.searchsorted(numpy.cumsum(weights), positions)
    # Rounding can leave the last cumulated weight below 1.
    return indices.clip(max=len(weights) - 1)


def _pass_count_probabilities(log_odds: FloatArray, weights: FloatArray, trials: int) -> FloatArray:
    """Return the probabilities (draws, trials + 1) that a car passes 0, 1, … of ``trials``.

    In each draw, the car's log-odds of passing a trial have the values ``log_odds`` (draws, nodes), with the
    probabilities ``weights`` (draws or 1, nodes).
    """
    # The probability of k passed trials is binomial(trials, k) * odds^k / (1 + odds)^trials. The last axis is k.
    passed = numpy.arange(trials + 1)
    log_all_failed = -trials * numpy.logaddexp(0, log_odds)
    log_probabilities = log_binomials(trials) + log_all_failed[:, :, None] + passed * log_odds[:, :, None]
    return numpy.asarray((numpy.exp(log_probabilities) * weights[:, :, None]).sum(axis=1))
