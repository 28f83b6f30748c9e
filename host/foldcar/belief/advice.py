"""Values what a person could do next: drive a car again, build a car, measure the obstacles or the car.

The value of a step is by how much it is expected to raise the rate of the design that is recommended afterwards. For each
result that the step may have, the draws get other weights, and with these another design may have the highest expected
rate. The mean of this highest rate over all results, minus the highest rate now, is the gain of the step (the knowledge
gradient: Frazier, Powell and Dayanik 2008, doi:10.1137/070693424). The highest of several noisy means is too high, so one
half of the draws chooses the design, and the other half says how good it is.
"""

from collections.abc import Callable, Iterable, Mapping
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

    ``build_min`` are the minutes to build a car, ``drive_min`` gives those of one trial of a design (by index).
    ``measurable`` has the minutes and the precision (standard deviation of the score) of each measurement that was not
    made yet, by the parameter's name. ``trials`` is the number of trials that a car drives.
    """
    view = _View(answers)
    result = [
        AdvisedStep("build", view.gain(view.new_car(design, trials)), build_min + trials * drive_min(design),
             design=design, second=design in view.driven)
        for design in view.candidates.tolist()
    ]  # fmt: skip
    result += [
        AdvisedStep("drive", view.gain(outcomes), trials * drive_min(design), design=design, car=car)
        for car, design, outcomes in view.known_cars(trials)
    ]
    result += [
        AdvisedStep("measure", view.gain(view.measured(NAMES.index(name), precision)), minutes, parameter=name)
        for name, (minutes, precision) in measurable.items()
    ]
    return sorted(result, key=lambda step: -step.gain_per_hour)


class _View:
    """The draws with which steps are valued: STEP_DRAWS of equal weight."""

    def __init__(self, answers: Answers) -> None:
        self._answers = answers
        random = numpy.random.default_rng(13)
        weights = answers.draws.weights
        # Systematic resampling has less noise than independent choices.
        positions = (numpy.arange(STEP_DRAWS) + random.random()) / STEP_DRAWS
        self._chosen = numpy.searchsorted(numpy.cumsum(weights), positions).clip(max=len(weights) - 1)
        self._rates = answers.rates[self._chosen]
        self._log_odds = logit(self._rates.clip(1e-9, 1 - 1e-9))
        self._car_sd = answers.draws.car_sd[self._chosen][:, None]
        # Neighbours in this order are alike, so both halves represent all draws.
        self._halves = slice(0, None, 2), slice(1, None, 2)
        self._now = self._cross_fitted(numpy.ones((STEP_DRAWS, 1)))
        self.driven = set(answers.trials.driven.tolist())

    @property
    def candidates(self) -> NDArray[Any]:
        """The designs that may be worth building: not those that fail almost surely, at most MAX_CANDIDATES."""
        high = numpy.quantile(self._rates, 0.975, axis=0)
        alive = numpy.flatnonzero(high >= FAILS)
        # Thompson's chance, and the mean rate as a tie-break.
        worth = self._answers.best_chances[alive] + 1e-3 * self._rates[:, alive].mean(axis=0)
        return alive[numpy.argsort(-worth, kind="stable")[:MAX_CANDIDATES]]

    def gain(self, outcomes: FloatArray) -> float:
        """Return the gain of a step whose results have the probabilities ``outcomes`` (draws, results) in each draw."""
        return max(0.0, self._cross_fitted(outcomes) - self._now)

    def _cross_fitted(self, outcomes: FloatArray) -> float:
        """Return the expected rate of the design that is recommended after one of the ``outcomes`` (draws, results)."""
        # (results, designs) for each half: the sum over draws of the probability of the result times the rate.
        first, second = (outcomes[half].T @ self._rates[half] for half in self._halves)
        results = numpy.arange(len(first))
        by_other = first[results, second.argmax(axis=1)].sum() + second[results, first.argmax(axis=1)].sum()
        return float(by_other / len(self._rates))

    def new_car(self, design: int, trials: int) -> FloatArray:
        """Return the probabilities (draws, trials + 1) that a new car of the design passes 0, 1, … of ``trials``."""
        centre = centre_of_cars(self._log_odds[:, [design]], self._car_sd)
        return _counts(centre + self._car_sd * NODES, numpy.broadcast_to(NODE_WEIGHTS, (1, len(NODES))), trials)

    def known_cars(self, trials: int) -> Iterable[tuple[int, int, FloatArray]]:
        """Yield for each car that drove its index, its design, and probabilities as :meth:`new_car`."""
        if not self._answers.driven:
            return
        by_node, of_car = self._answers.draws.car_log_likelihood(self._answers.trials)
        best = sorted(range(len(self._answers.cars)), key=lambda car: -self._answers.cars[car].rate.value)[:MAX_CARS]
        for car in best:
            design = int(self._answers.trials.design[car])
            logs = by_node[self._chosen, car]
            weights = numpy.exp(logs - logs.max(axis=1, keepdims=True)) * NODE_WEIGHTS
            yield car, design, _counts(of_car[self._chosen, car], weights / weights.sum(axis=1, keepdims=True), trials)

    def measured(self, parameter: int, precision: float) -> FloatArray:
        """Return the probabilities (draws, RESULTS) of results of a measurement, whose ``precision`` is a score's sd."""
        scores = self._answers.draws.scores[self._chosen, parameter]
        results = numpy.quantile(scores, (numpy.arange(RESULTS) + 0.5) / RESULTS)
        # Neighbouring results must overlap, or each draw would have a result of its own.
        width = max(precision, float(numpy.ptp(results)) / RESULTS)
        density = numpy.exp(-(((scores[:, None] - results) / width) ** 2) / 2)
        return numpy.asarray(density / density.sum(axis=1, keepdims=True))


def _counts(log_odds: FloatArray, weights: FloatArray, trials: int) -> FloatArray:
    """Return probabilities (draws, trials + 1) of counts, for cars with ``log_odds`` (draws, nodes) of ``weights``."""
    passed = numpy.arange(trials + 1)
    all_failed = -trials * numpy.logaddexp(0, log_odds)
    logs = log_binomials(trials) + all_failed[:, :, None] + passed * log_odds[:, :, None]
    return numpy.asarray((numpy.exp(logs) * weights[:, :, None]).sum(axis=1))
