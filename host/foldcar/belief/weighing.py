"""Draws realities and weighs them by trials: a draw that foresees the trials' outcomes better gets more weight.

A draw is a row of numbers that are standard normal before any trial. From them follow:

- the reality's scores: what the simulator does not know, by the priors or by measured values;
- an *unexplained error* of the simulator over designs, because no list of unknowns is complete: a common part, a smooth
  part and a part of each design alone, whose sizes are drawn, too;
- by how much cars of one design differ.

The log-odds of a design are the learned ones in that reality plus the unexplained error. A car of the design deviates
from them by a normal offset. The weight of a draw is the probability that it gives to the outcomes of all trials,
averaged over the offsets of the cars that drove. If few draws carry nearly all the weight, they are drawn again around
these, step by step (sequential Monte Carlo: Del Moral et al. 2006, doi:10.1111/j.1467-9868.2006.00553.x; the moves are
those of Cotter et al. 2013, doi:10.1214/13-STS421), so that there are always enough.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy
from numpy.typing import NDArray
from scipy.special import chdtri, expit, ndtr, ndtri

from foldcar.belief.learning import SLOPE, Learned
from foldcar.belief.priors import MAX_SCORE, NOMINAL_SCORES, PARAMETERS, FloatArray, ScorePrior

# Number of draws; fewer for many designs or cars, so that no array has much more than MAX_NUMBERS numbers.
MAX_DRAWS, MIN_DRAWS, MAX_NUMBERS = 30_000, 2_000, 10_000_000
# If fewer draws than this count effectively, 1 / sum(weight²), then MOVED_DRAWS of them are moved.
MIN_EFFECTIVE, MOVED_DRAWS = 1_000, 4_000
# Steps towards the trials' weights keep this fraction of the draws effective; then each draw is moved MOVES times.
KEPT, MOVES, MAX_STEPS = 0.5, 8, 60
# Size of the unexplained error in log-odds: median, and standard deviation of its logarithm, which gives a heavy tail.
UNEXPLAINED, UNEXPLAINED_LOG_SD = 0.6, 0.95
# Variances of its common, smooth and own part, relative to the size; the own part has a size of its own.
COMMON, SMOOTH, OWN = 0.5, 0.5, 0.25
# Length over which the smooth part changes, where each design parameter is 0 to 1; for several parameters times the root
# of their number. Number of waves whose sum is the smooth part.
LENGTH, WAVES = 0.3, 60
# Standard deviation of the log-odds of a design's cars: median, and standard deviation of its logarithm. Simulated cars
# with the workshop's differences have 0.6 to 1.9 in the width study.
CAR_SD, CAR_SD_LOG_SD = 0.8, 0.5
# The probability that a measured value is wrong altogether. The prior then holds as if nothing had been measured.
WRONG = 0.05
# The probability that everything is nearly as simulated: scores are then NEAR times as far from the nominal ones.
NOMINAL_CHANCE, NEAR = 0.3, 0.3
# The fraction of the difference between scenes, as simulated, that is applied to trials in known scenes.
SCENE_TRUST = 0.5
NODES, NODE_WEIGHTS = numpy.polynomial.hermite_e.hermegauss(9)
NODE_WEIGHTS = NODE_WEIGHTS / NODE_WEIGHTS.sum()


@dataclass(frozen=True)
class Trials:
    """Completed trials, grouped by car and scene.

    For each group: ``car`` (groups,) is the index of its car, ``passed`` and ``counted`` (groups,) are its numbers of
    trials, ``easier`` (groups,) is how much easier the scene is than all scenes, in log-odds. ``design`` (cars,) is the
    index of each car's design among the belief's, ``names`` are the cars' names, None for a car without a name.
    """

    design: NDArray[Any]
    names: tuple[str | None, ...]
    car: NDArray[Any]
    passed: FloatArray
    counted: FloatArray
    easier: FloatArray

    @classmethod
    def of_counts(cls, counts: Sequence[tuple[int, int, int]]) -> "Trials":
        """Return the trials of one car for each tuple (design, passed, counted), in average scenes."""
        design, passed, counted = (numpy.array(column) for column in zip(*counts, strict=True)) if counts else [[]] * 3
        cars = numpy.arange(len(counts))
        return cls(
            numpy.asarray(design, int), (None,) * len(counts), cars, numpy.asarray(passed, float),
            numpy.asarray(counted, float), numpy.zeros(len(counts)),
        )  # fmt: skip

    @property
    def driven(self) -> NDArray[Any]:
        """The indices of the driven designs, ascending."""
        return numpy.unique(self.design)

    def without(self, design: int) -> "Trials":
        """Return the trials of all other designs."""
        kept = self.design != design
        groups = kept[self.car]
        numbers = numpy.cumsum(kept) - 1
        names = tuple(name for name, is_kept in zip(self.names, kept.tolist(), strict=True) if is_kept)
        return Trials(
            self.design[kept], names, numbers[self.car[groups]], self.passed[groups], self.counted[groups],
            self.easier[groups],
        )  # fmt: skip

    def counts_of(self, design: int) -> tuple[int, int]:
        """Return how many trials of a design passed, and how many there are."""
        of_design = self.design[self.car] == design if len(self.car) else numpy.zeros(0, bool)
        return int(self.passed[of_design].sum()), int(self.counted[of_design].sum())


@dataclass(frozen=True)
class Prior:
    """What is believed before the trials.

    ``learned`` is the success rate in realities. ``designs`` (d, parameters) are those that the belief is about.
    ``known`` has narrower priors of the scores by the parameter's index, ``measured`` the indices of those that were
    measured. ``offsets`` (d,) are the designs' own differences from the learned log-odds.
    """

    learned: Learned
    designs: FloatArray
    known: Mapping[int, ScorePrior]
    measured: frozenset[int] = frozenset()
    offsets: FloatArray | float = 0.0

    def log_odds(self, scores: FloatArray, designs: NDArray[Any]) -> FloatArray:
        """Return the log-odds (n, d) in realities with ``scores`` (n, parameters), for designs by their indices."""
        offsets = numpy.broadcast_to(self.offsets, len(self.designs))[designs]
        return numpy.asarray(self.learned.log_odds(scores, self.designs[designs]) + offsets)

    @cached_property
    def frequencies(self) -> FloatArray:
        """The frequencies (parameters, WAVES / 2) of the smooth part.

        A sum of cosines and sines with normal amplitudes is a Gaussian process with a Matern covariance (Rahimi and Recht
        2007). The frequencies are evenly spread over its spectrum by an additive recurrence.
        """
        parameters = self.designs.shape[1]
        root = 2.0
        for _ in range(50):
            # The solution of root ** (parameters + 2) = root + 1, whose powers are far from fractions.
            root = (1 + root) ** (1 / (parameters + 2))
        steps = root ** -numpy.arange(1.0, parameters + 2)
        points = (0.5 + numpy.arange(1, WAVES // 2 + 1)[:, None] * steps) % 1
        # The spectrum of the Matern covariance of smoothness 5/2 is Student's t distribution with 5 degrees of freedom.
        scale = numpy.sqrt(5 / chdtri(5, points[:, 0])) / (LENGTH * numpy.sqrt(max(parameters, 1)))
        return numpy.asarray(ndtri(points[:, 1:]).T * scale)

    def smooth_columns(self, designs: FloatArray) -> FloatArray:
        """Return the waves (WAVES, d) at designs (d, parameters)."""
        angles = self.learned.unit(designs) @ self.frequencies
        return numpy.asarray(numpy.sqrt(2 / WAVES) * numpy.hstack([numpy.cos(angles), numpy.sin(angles)]).T)


# The columns of a draw. The own errors of the driven designs follow.
_SCORES = slice(0, len(PARAMETERS))
_WRONG = slice(_SCORES.stop, 2 * len(PARAMETERS))
_NEAR, _CAR, _SIZE, _OWN_SIZE, _COMMON = range(_WRONG.stop, _WRONG.stop + 5)
_SMOOTH = slice(_COMMON + 1, _COMMON + 1 + WAVES)


@dataclass(frozen=True)
class Draws:
    """Draws ``normal`` (n, columns), standard normal before any trial, with ``weights`` (n,) whose sum is 1.

    The own errors in the last columns are those of the ``driven`` designs.
    """

    prior: Prior
    driven: NDArray[Any]
    normal: FloatArray
    weights: FloatArray

    @property
    def effective(self) -> float:
        """The effective number of draws."""
        return effective_number(self.weights)

    @cached_property
    def wrong(self) -> NDArray[numpy.bool_]:
        """Whether the value measured of each parameter (n, parameters) is wrong; False where nothing was measured."""
        result = numpy.asarray(ndtr(self.normal[:, _WRONG]) < WRONG)
        result[:, [i for i in range(len(PARAMETERS)) if i not in self.prior.measured]] = False
        return result

    @cached_property
    def scores(self) -> FloatArray:
        """The realities' scores (n, parameters)."""
        free = self.normal[:, _SCORES]
        near = ndtr(self.normal[:, [_NEAR]]) < NOMINAL_CHANCE
        result = numpy.where(near, NOMINAL_SCORES + NEAR * (free - NOMINAL_SCORES), free)
        for index, known in self.prior.known.items():
            narrowed = known.mean + known.sd * free[:, index]
            result[:, index] = numpy.where(self.wrong[:, index], result[:, index], narrowed)
        return numpy.clip(result, -MAX_SCORE, MAX_SCORE)

    @cached_property
    def size(self) -> FloatArray:
        """The size (n,) of the unexplained error, in log-odds."""
        return UNEXPLAINED * numpy.exp(UNEXPLAINED_LOG_SD * self.normal[:, _SIZE])

    @cached_property
    def car_sd(self) -> FloatArray:
        """The standard deviation (n,) of the log-odds of a design's cars."""
        return CAR_SD * numpy.exp(CAR_SD_LOG_SD * self.normal[:, _CAR])

    @cached_property
    def _own_size(self) -> FloatArray:
        own = UNEXPLAINED * numpy.exp(UNEXPLAINED_LOG_SD * self.normal[:, _OWN_SIZE])
        return numpy.asarray(numpy.sqrt(OWN) * own)

    def unexplained(self, designs: NDArray[Any]) -> FloatArray:
        """Return the unexplained error (n, d) of the designs with these indices, without the parts of each alone."""
        smooth = self.normal[:, _SMOOTH] @ self.prior.smooth_columns(self.prior.designs[designs])
        common = numpy.sqrt(COMMON) * self.normal[:, [_COMMON]]
        return numpy.asarray(self.size[:, None] * (common + numpy.sqrt(SMOOTH) * smooth))

    def log_odds(self, designs: NDArray[Any]) -> FloatArray:
        """Return the log-odds (n, d) that a random car of each design (by index) passes in a random scene."""
        result = self.prior.log_odds(self.scores, designs) + self.unexplained(designs)
        own = numpy.random.default_rng(7).standard_normal(result.shape)
        columns = {int(design): _SMOOTH.stop + i for i, design in enumerate(self.driven)}
        for column, design in enumerate(designs.tolist()):
            if design in columns:
                own[:, column] = self.normal[:, columns[design]]
        return result + self._own_size[:, None] * own

    def car_log_likelihood(self, trials: Trials) -> tuple[FloatArray, FloatArray]:
        """Return log probabilities (n, cars, nodes) of each car's trials at nodes of its offset; and its log-odds."""
        log_odds = self.log_odds(self.driven)[:, numpy.searchsorted(self.driven, trials.design)]
        centre = centre_of_cars(log_odds, self.car_sd[:, None])
        # (n, cars, nodes)
        of_car = centre[:, :, None] + self.car_sd[:, None, None] * NODES
        result = numpy.zeros(of_car.shape)
        for car, passed, counted, easier in zip(
            trials.car.tolist(), trials.passed.tolist(), trials.counted.tolist(), trials.easier.tolist(), strict=True
        ):
            at = of_car[:, car] + easier
            result[:, car] += passed * at - counted * numpy.logaddexp(0, at)
        return result, of_car

    def log_likelihood(self, trials: Trials) -> FloatArray:
        """Return the log probability (n,) that each draw gives to the trials."""
        return numpy.asarray(self.log_likelihood_of_cars(trials).sum(axis=1))

    def log_likelihood_of_cars(self, trials: Trials) -> FloatArray:
        """Return the log probability (n, cars) that each draw gives to the trials of each car."""
        by_node, _ = self.car_log_likelihood(trials)
        top = by_node.max(axis=2, keepdims=True)
        return numpy.asarray(top[..., 0] + numpy.log(numpy.exp(by_node - top) @ NODE_WEIGHTS))

    def car_rates(self, trials: Trials) -> FloatArray:
        """Return the rate (n, cars) of each car that drove, given its own trials, under each draw."""
        by_node, of_car = self.car_log_likelihood(trials)
        probability = numpy.exp(by_node - by_node.max(axis=2, keepdims=True)) * NODE_WEIGHTS
        cumulated = probability.cumsum(axis=2) / probability.sum(axis=2, keepdims=True)
        drawn = numpy.random.default_rng(11).random((*cumulated.shape[:2], 1))
        node = (cumulated < drawn).sum(axis=2).clip(max=len(NODES) - 1)
        return numpy.asarray(expit(numpy.take_along_axis(of_car, node[:, :, None], axis=2)[..., 0]))


def weigh(prior: Prior, trials: Trials, seed: int = 1) -> Draws:
    """Return draws of realities, weighed by the trials; the same for the same input.

    Without trials all draws have the same weight.
    """
    random = numpy.random.default_rng(seed)
    width = max(1, len(prior.designs), len(NODES) * len(trials.design))
    number = int(numpy.clip(MAX_NUMBERS // width, MIN_DRAWS, MAX_DRAWS))
    normal = random.standard_normal((number, _SMOOTH.stop + len(trials.driven)))
    draws = Draws(prior, trials.driven, normal, numpy.full(number, 1 / number))
    if not len(trials.car):
        return draws
    likelihood = draws.log_likelihood(trials)
    weighed = Draws(prior, trials.driven, normal, normalised(likelihood))
    if weighed.effective >= MIN_EFFECTIVE:
        return weighed
    equal = numpy.full(min(number, MOVED_DRAWS), 1 / min(number, MOVED_DRAWS))
    few = Draws(prior, trials.driven, normal[:MOVED_DRAWS], equal)
    return _moved(few, trials, likelihood[:MOVED_DRAWS], random)


def effective_number(weights: FloatArray) -> float:
    """Return the effective number of draws with these weights, whose sum is 1."""
    return float(1 / (weights**2).sum())


def centre_of_cars(log_odds: FloatArray, car_sd: Any) -> FloatArray:
    """Return the log-odds around which cars scatter with ``car_sd``, so that their mean rate is that of ``log_odds``."""
    return numpy.asarray(log_odds * numpy.sqrt(1 + SLOPE * car_sd**2))


def normalised(log_weights: FloatArray) -> FloatArray:
    """Return weights (n,) with the sum 1 from their logarithms up to a constant."""
    weights = numpy.exp(log_weights - log_weights.max())
    return numpy.asarray(weights / weights.sum())


def _moved(draws: Draws, trials: Trials, likelihood: FloatArray, random: numpy.random.Generator) -> Draws:
    """Return draws of equal weight: resampled and moved, while the trials' weight grows from 0 to 1."""
    number, power, stride = len(likelihood), 0.0, 0.5
    for _ in range(MAX_STEPS):
        step = _largest_step(likelihood, 1 - power)
        power += step
        chosen = random.choice(number, number, p=normalised(step * likelihood))
        draws, likelihood = Draws(draws.prior, draws.driven, draws.normal[chosen], draws.weights), likelihood[chosen]
        for _ in range(MOVES):
            # This proposal leaves the standard normal distribution unchanged, so the likelihood alone decides.
            proposed = numpy.sqrt(1 - stride**2) * draws.normal + stride * random.standard_normal(draws.normal.shape)
            new = Draws(draws.prior, draws.driven, proposed, draws.weights)
            new_likelihood = new.log_likelihood(trials)
            taken = numpy.log(random.random(number)) < power * (new_likelihood - likelihood)
            normal = numpy.where(taken[:, None], proposed, draws.normal)
            draws = Draws(draws.prior, draws.driven, normal, draws.weights)
            likelihood = numpy.where(taken, new_likelihood, likelihood)
            # Strides that are accepted about every fourth time explore fastest.
            stride = float(numpy.clip(stride * (1.2 if taken.mean() > 0.25 else 0.8), 0.02, 1.0))
        if power >= 1:
            break
    return draws


def _largest_step(likelihood: FloatArray, limit: float) -> float:
    """Return the largest power, at most ``limit``, of the likelihood that keeps the fraction KEPT of draws effective."""

    def effective(power: float) -> float:
        return effective_number(normalised(power * likelihood))

    if effective(limit) >= KEPT * len(likelihood):
        return limit
    low, high = 0.0, limit
    for _ in range(40):
        middle = (low + high) / 2
        low, high = (middle, high) if effective(middle) >= KEPT * len(likelihood) else (low, middle)
    return max(low, 1e-6)
