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

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy
from numpy.typing import NDArray
from scipy.special import chdtri, expit, ndtr, ndtri

from foldcar.belief.learning import SLOPE, Learned
from foldcar.belief.priors import MAX_SCORE, NOMINAL_SCORES, PARAMETERS, FloatArray, ScorePrior
from foldcar.belief.trials import Trials

# Number of draws; fewer for many designs or cars, so that no array has much more than MAX_NUMBERS numbers.
MAX_DRAWS, MIN_DRAWS, MAX_NUMBERS = 30_000, 2_000, 10_000_000
# If fewer draws than this count effectively, 1 / sum(weight²), then MOVED_DRAWS of them are moved.
MIN_EFFECTIVE, MOVED_DRAWS = 1_000, 4_000
# Steps towards the trials' weights keep this fraction of the draws effective; then each draw is moved MOVES times.
KEPT, MOVES, MAX_STEPS = 0.5, 8, 60
# How far a draw is moved at first, and at least: the standard deviation of the new random part, up to 1.
FIRST_STRIDE, MIN_STRIDE = 0.5, 0.02
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
# The same random numbers each time: for own errors of designs that were not driven, and for rates of cars.
OWN_ERROR_SEED, CAR_SEED = 7, 11
# A normal distribution is represented by 9 values with probabilities (Gauss-Hermite quadrature).
NODES, NODE_WEIGHTS = numpy.polynomial.hermite_e.hermegauss(9)
NODE_WEIGHTS = NODE_WEIGHTS / NODE_WEIGHTS.sum()


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
        """The frequencies (parameters, WAVES / 2) of the waves whose sum is the smooth part of the unexplained error.

        The sum of cosines and sines with these frequencies and with normal amplitudes is approximately a Gaussian
        process with a Matern covariance of smoothness 5/2, if the frequencies are distributed like the spectrum of this
        covariance (Rahimi and Recht 2007). The spectrum is Student's t distribution with 5 degrees of freedom.
        """
        parameters = self.designs.shape[1]
        points = _evenly_spread_points(WAVES // 2, 1 + parameters)
        # Student's t is a normal variable divided by the root of a chi-square variable over 5.
        chi_square = chdtri(5, points[:, 0])
        normal = ndtri(points[:, 1:])
        scale = numpy.sqrt(5 / chi_square) / (LENGTH * numpy.sqrt(max(parameters, 1)))
        return numpy.asarray(normal.T * scale)

    def smooth_columns(self, designs: FloatArray) -> FloatArray:
        """Return the waves (WAVES, d) of the smooth part of the unexplained error at designs (d, parameters)."""
        angles = self.learned.unit(designs) @ self.frequencies
        return numpy.asarray(numpy.sqrt(2 / WAVES) * numpy.hstack([numpy.cos(angles), numpy.sin(angles)]).T)


def _evenly_spread_points(number: int, dimensions: int) -> FloatArray:
    """Return points (number, dimensions) that are evenly spread over a cube of side 1, by an additive recurrence.

    They are the multiples of fixed steps, modulo 1. The best steps are the powers of 1 / root, where root is the solution
    of root ** (dimensions + 1) = root + 1.
    """
    root = 2.0
    # 50 iterations are exact to rounding.
    for _ in range(50):
        root = (1 + root) ** (1 / (dimensions + 1))
    steps = root ** -numpy.arange(1.0, dimensions + 1)
    multiples = numpy.arange(1, number + 1)[:, None] * steps
    return numpy.asarray((0.5 + multiples) % 1)


class CarOdds(NamedTuple):
    """Possible log-odds of each car that drove, and the log probability of the car's own trials with each of them.

    A car's log-odds of passing are normally distributed around those of its design. This distribution is represented by
    nodes: values with the probabilities NODE_WEIGHTS. Both arrays are (draws, cars, nodes).
    """

    log_odds: FloatArray
    log_likelihood: FloatArray

    def probabilities(self) -> FloatArray:
        """Return how probable each node is (draws, cars, nodes), given the car's own trials."""
        greatest = self.log_likelihood.max(axis=2, keepdims=True)
        probabilities = numpy.exp(self.log_likelihood - greatest) * NODE_WEIGHTS
        return numpy.asarray(probabilities / probabilities.sum(axis=2, keepdims=True))


# The columns of a draw.
_SCORE_COLUMNS = slice(0, len(PARAMETERS))
_WRONG_COLUMNS = slice(len(PARAMETERS), 2 * len(PARAMETERS))
_NEAR_COLUMN = 2 * len(PARAMETERS)
_CAR_SD_COLUMN = _NEAR_COLUMN + 1
_SIZE_COLUMN = _NEAR_COLUMN + 2
_OWN_SIZE_COLUMN = _NEAR_COLUMN + 3
_COMMON_COLUMN = _NEAR_COLUMN + 4
_SMOOTH_COLUMNS = slice(_NEAR_COLUMN + 5, _NEAR_COLUMN + 5 + WAVES)
# From here on, a column for each driven design.
_FIRST_OWN_ERROR_COLUMN = _NEAR_COLUMN + 5 + WAVES


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
        is_wrong = numpy.asarray(ndtr(self.normal[:, _WRONG_COLUMNS]) < WRONG)
        for index in range(len(PARAMETERS)):
            if index not in self.prior.measured:
                is_wrong[:, index] = False
        return is_wrong

    @cached_property
    def scores(self) -> FloatArray:
        """The realities' scores (n, parameters): how many standard deviations each parameter is above its median.

        What is known about a parameter, such as a measured value, narrows its scores. A wrong measurement does not.
        """
        normal_scores = self.normal[:, _SCORE_COLUMNS]
        # Some realities, a fraction NOMINAL_CHANCE of all, are close to nominal simulation. A normal number of the draw
        # decides whether it is one of them.
        close_scores = NOMINAL_SCORES + NEAR * (normal_scores - NOMINAL_SCORES)
        is_close = ndtr(self.normal[:, [_NEAR_COLUMN]]) < NOMINAL_CHANCE
        scores = numpy.where(is_close, close_scores, normal_scores)
        for index, prior in self.prior.known.items():
            narrowed = prior.mean + prior.sd * normal_scores[:, index]
            is_wrong = self.wrong[:, index]
            scores[:, index] = numpy.where(is_wrong, scores[:, index], narrowed)
        return numpy.clip(scores, -MAX_SCORE, MAX_SCORE)

    @cached_property
    def size(self) -> FloatArray:
        """The size (n,) of the unexplained error, in log-odds."""
        return UNEXPLAINED * numpy.exp(UNEXPLAINED_LOG_SD * self.normal[:, _SIZE_COLUMN])

    @cached_property
    def car_sd(self) -> FloatArray:
        """The standard deviation (n,) of the log-odds of a design's cars."""
        return CAR_SD * numpy.exp(CAR_SD_LOG_SD * self.normal[:, _CAR_SD_COLUMN])

    @cached_property
    def _own_size(self) -> FloatArray:
        """The standard deviation (n,) of the part of the unexplained error that each design has alone, in log-odds."""
        own_size = UNEXPLAINED * numpy.exp(UNEXPLAINED_LOG_SD * self.normal[:, _OWN_SIZE_COLUMN])
        return numpy.asarray(numpy.sqrt(OWN) * own_size)

    def unexplained(self, designs: NDArray[Any]) -> FloatArray:
        """Return the unexplained error (n, d) of the designs with these indices, without the parts of each alone."""
        smooth = self.normal[:, _SMOOTH_COLUMNS] @ self.prior.smooth_columns(self.prior.designs[designs])
        common = numpy.sqrt(COMMON) * self.normal[:, [_COMMON_COLUMN]]
        return numpy.asarray(self.size[:, None] * (common + numpy.sqrt(SMOOTH) * smooth))

    def log_odds(self, designs: NDArray[Any]) -> FloatArray:
        """Return the log-odds (n, d) that a random car of each design passes in a random scene, in each draw.

        ``designs`` (d,) are the indices of the designs.
        """
        log_odds = self.prior.log_odds(self.scores, designs) + self.unexplained(designs)
        # The error of each design alone: a draw contains those of the driven designs, the others are drawn here.
        own_errors = numpy.random.default_rng(OWN_ERROR_SEED).standard_normal(log_odds.shape)
        driven_designs = self.driven.tolist()
        for column, design in enumerate(designs.tolist()):
            if design in driven_designs:
                column_of_draw = _FIRST_OWN_ERROR_COLUMN + driven_designs.index(design)
                own_errors[:, column] = self.normal[:, column_of_draw]
        return log_odds + self._own_size[:, None] * own_errors

    def car_odds(self, trials: Trials) -> CarOdds:
        """Return possible log-odds of success of each car that drove, and the log-likelihood of its own trials.

        The cars of a design scatter around it, with the standard deviation ``car_sd`` of each draw. This normal
        distribution is represented by a few values, the nodes. The arrays have the shape (draws, cars, nodes).
        """
        # The log-odds of each car's design (draws, cars).
        driven_index_of_car = numpy.searchsorted(self.driven, trials.design)
        design_log_odds = self.log_odds(self.driven)[:, driven_index_of_car]
        car_sd = self.car_sd[:, None]
        centre = centre_of_cars(design_log_odds, car_sd)
        # The nodes are a third axis.
        car_log_odds = centre[:, :, None] + car_sd[:, :, None] * NODES
        log_likelihood = numpy.zeros(car_log_odds.shape)
        for group, car in enumerate(trials.car.tolist()):
            log_odds = car_log_odds[:, car] + float(trials.scene_ease[group])
            passed, counted = float(trials.passed[group]), float(trials.counted[group])
            # The log probability of passing is log_odds - log(1 + odds), that of failing is -log(1 + odds).
            log_likelihood[:, car] += passed * log_odds - counted * numpy.logaddexp(0, log_odds)
        return CarOdds(car_log_odds, log_likelihood)

    def log_likelihood(self, trials: Trials) -> FloatArray:
        """Return the log probability (n,) that each draw gives to the trials."""
        return numpy.asarray(self.log_likelihood_of_cars(trials).sum(axis=1))

    def log_likelihood_of_cars(self, trials: Trials) -> FloatArray:
        """Return the log probability (n, cars) that each draw gives to the trials of each car."""
        by_node = self.car_odds(trials).log_likelihood
        # The greatest term is taken out of the sum, because exp of large negative numbers is 0.
        greatest = by_node.max(axis=2, keepdims=True)
        return numpy.asarray(greatest[..., 0] + numpy.log(numpy.exp(by_node - greatest) @ NODE_WEIGHTS))

    def car_rates(self, trials: Trials) -> FloatArray:
        """Draw the success rate (n, cars) of each car that drove, in each draw, given the car's own trials."""
        car_odds = self.car_odds(trials)
        cumulated = car_odds.probabilities().cumsum(axis=2)
        # For each draw and car, the index of a node that is drawn with these probabilities (draws, cars, 1): of the first
        # one whose cumulated probability is not below a random number from 0 to 1.
        thresholds = numpy.random.default_rng(CAR_SEED).random((*cumulated.shape[:2], 1))
        nodes = (cumulated < thresholds).sum(axis=2, keepdims=True)
        nodes = nodes.clip(max=len(NODES) - 1)
        drawn_log_odds = numpy.take_along_axis(car_odds.log_odds, nodes, axis=2)
        return numpy.asarray(expit(drawn_log_odds[:, :, 0]))


def weigh(prior: Prior, trials: Trials, seed: int = 1) -> Draws:
    """Draw realities from the prior and weigh them by the trials. Equal input gives equal draws.

    Without trials all draws have the same weight. If the trials leave weight to a few draws only, the answers would rest
    on these few. Then other draws are returned, which are moved towards them and have equal weights.
    """
    random = numpy.random.default_rng(seed)
    # The largest arrays have this many numbers for each draw, so there are fewer draws if it is large.
    numbers_per_draw = max(1, len(prior.designs), len(NODES) * len(trials.design))
    draw_count = int(numpy.clip(MAX_NUMBERS // numbers_per_draw, MIN_DRAWS, MAX_DRAWS))
    columns = _FIRST_OWN_ERROR_COLUMN + len(trials.driven)
    normal = random.standard_normal((draw_count, columns))
    draws = Draws(prior, trials.driven, normal, _equal_weights(draw_count))
    if not len(trials.car):
        return draws
    log_likelihood = draws.log_likelihood(trials)
    weighed_draws = Draws(prior, trials.driven, normal, normalised(log_likelihood))
    if weighed_draws.effective >= MIN_EFFECTIVE:
        return weighed_draws
    moved_count = min(draw_count, MOVED_DRAWS)
    unmoved_draws = Draws(prior, trials.driven, normal[:moved_count], _equal_weights(moved_count))
    return _moved(unmoved_draws, trials, log_likelihood[:moved_count], random)


def _equal_weights(number: int) -> FloatArray:
    """Return ``number`` equal weights with the sum 1."""
    return numpy.full(number, 1 / number)


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


def _moved(draws: Draws, trials: Trials, log_likelihood: FloatArray, random: numpy.random.Generator) -> Draws:
    """Turn draws from the prior into draws from the belief after the trials, all of equal weight.

    This is a sequential Monte Carlo sampler. The trials count with a power that grows in steps from 0 to 1. At each step
    the draws are resampled, and then moved by a random walk, so that equal draws separate. ``log_likelihood`` (n,) is the
    log probability that each of the draws gives to the trials.
    """
    number = len(log_likelihood)
    walk = _RandomWalk(trials, random)
    power = 0.0
    for _ in range(MAX_STEPS):
        step = _largest_step(log_likelihood, 1 - power)
        power += step
        chosen = random.choice(number, number, p=normalised(step * log_likelihood))
        draws = replace(draws, normal=draws.normal[chosen])
        log_likelihood = log_likelihood[chosen]
        for _ in range(MOVES):
            draws, log_likelihood = walk.moved(draws, log_likelihood, power)
        if power >= 1:
            break
    return draws


class _RandomWalk:
    """Moves draws at random so that they keep their distribution: the prior times a power of the trials' likelihood."""

    def __init__(self, trials: Trials, random: numpy.random.Generator) -> None:
        self._trials, self._random = trials, random
        self._stride = FIRST_STRIDE

    def moved(self, draws: Draws, log_likelihood: FloatArray, power: float) -> tuple[Draws, FloatArray]:
        """Move each draw by one random step of a Metropolis sampler. Return the draws and their log-likelihoods (n,).

        The distribution that the steps preserve is the prior times the trials' likelihood to the power of ``power``, 0 to
        1. ``log_likelihood`` (n,) is that of the given ``draws``. A draw whose step is rejected stays where it is.
        """
        # A step that mixes the draw with noise like this preserves the standard normal distribution, which is the prior.
        # So only the likelihood decides whether the new draw is accepted.
        noise = self._random.standard_normal(draws.normal.shape)
        kept_part = numpy.sqrt(1 - self._stride**2) * draws.normal
        proposed = replace(draws, normal=kept_part + self._stride * noise)
        proposed_log_likelihood = proposed.log_likelihood(self._trials)
        log_ratio = power * (proposed_log_likelihood - log_likelihood)
        is_accepted = numpy.log(self._random.random(len(log_ratio))) < log_ratio
        # Draws separate fastest if about a quarter of the steps is accepted. A longer stride is accepted less often.
        change = 1.2 if is_accepted.mean() > 0.25 else 0.8
        self._stride = float(numpy.clip(self._stride * change, MIN_STRIDE, 1.0))
        normal = numpy.where(is_accepted[:, None], proposed.normal, draws.normal)
        return replace(draws, normal=normal), numpy.where(is_accepted, proposed_log_likelihood, log_likelihood)


def _largest_step(log_likelihood: FloatArray, limit: float) -> float:
    """Return by how much the power of the likelihood may grow in one step, at most by ``limit``.

    The likelihood is multiplied into the weights of random draws step by step, with powers whose sum is 1. A step makes
    the weights unequal, so that fewer draws are effective. The result is the largest step after which at least the
    fraction KEPT of the draws is effective, found by bisection.
    """

    def keeps_enough(power: float) -> bool:
        """Return whether enough draws are effective if the likelihood counts with this power."""
        weights = normalised(power * log_likelihood)
        return effective_number(weights) >= KEPT * len(log_likelihood)

    if keeps_enough(limit):
        return limit
    low, high = 0.0, limit
    # 40 bisections are exact to 1e-12.
    for _ in range(40):
        middle = (low + high) / 2
        if keeps_enough(middle):
            low = middle
        else:
            high = middle
    # The step is never 0, so that the power always grows.
    return max(low, 1e-6)
