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
from dataclasses import dataclass, replace
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
class Trials:
    """Completed trials. The trials of one car in one scene form a group.

    These have an entry for each group: ``car`` (groups,) is the index of its car. ``passed`` and ``counted`` (groups,)
    are its numbers of passed trials and of all trials. ``scene_ease`` (groups,) is how much easier its scene is than an
    average scene, in log-odds.

    These have an entry for each car: ``design`` (cars,) is the index of its design among those of the belief. ``names``
    is its name, None for a car without a name.
    """

    design: NDArray[Any]
    names: tuple[str | None, ...]
    car: NDArray[Any]
    passed: FloatArray
    counted: FloatArray
    scene_ease: FloatArray

    @classmethod
    def of_counts(cls, counts: Sequence[tuple[int, int, int]]) -> "Trials":
        """Return the trials of one car for each tuple (design, passed, counted), in average scenes."""
        cars = len(counts)
        return cls(
            design=numpy.array([design for design, _, _ in counts], int),
            names=(None,) * cars,
            car=numpy.arange(cars),
            passed=numpy.array([passed for _, passed, _ in counts], float),
            counted=numpy.array([counted for _, _, counted in counts], float),
            scene_ease=numpy.zeros(cars),
        )

    @property
    def driven(self) -> NDArray[Any]:
        """The indices of the driven designs, ascending."""
        return numpy.unique(self.design)

    def without(self, design: int) -> "Trials":
        """Return the trials of all other designs. The remaining cars get new indices."""
        keeps_car = self.design != design
        keeps_group = keeps_car[self.car]
        # A car's new index is the number of kept cars before it.
        new_index_of_car = numpy.cumsum(keeps_car) - 1
        return Trials(
            design=self.design[keeps_car],
            names=tuple(self.names[car] for car in numpy.flatnonzero(keeps_car)),
            car=new_index_of_car[self.car[keeps_group]],
            passed=self.passed[keeps_group],
            counted=self.counted[keeps_group],
            scene_ease=self.scene_ease[keeps_group],
        )

    def counts_of(self, design: int) -> tuple[int, int]:
        """Return how many trials of a design passed, and how many there are."""
        if not len(self.car):
            return 0, 0
        is_of_design = self.design[self.car] == design
        return int(self.passed[is_of_design].sum()), int(self.counted[is_of_design].sum())


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
        process with a Matern covariance (Rahimi and Recht 2007). For this the frequencies must be spread over the
        spectrum of this covariance.
        """
        parameters = self.designs.shape[1]
        # An additive recurrence gives points that are evenly spread over a cube of side 1: multiples of fixed steps,
        # modulo 1. The best steps are the powers of the solution of root ** (parameters + 2) = root + 1, which is found
        # by iteration.
        root = 2.0
        for _ in range(50):
            root = (1 + root) ** (1 / (parameters + 2))
        steps = root ** -numpy.arange(1.0, parameters + 2)
        # The points (waves, 1 + parameters).
        points = (0.5 + numpy.arange(1, WAVES // 2 + 1)[:, None] * steps) % 1
        # The spectrum of the Matern covariance of smoothness 5/2 is Student's t distribution with 5 degrees of freedom:
        # a normal variable divided by the root of a chi-square variable over 5.
        normal, chi_square = ndtri(points[:, 1:]), chdtri(5, points[:, 0])
        scale = numpy.sqrt(5 / chi_square) / (LENGTH * numpy.sqrt(max(parameters, 1)))
        return numpy.asarray(normal.T * scale)

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
        is_wrong = numpy.asarray(ndtr(self.normal[:, _WRONG]) < WRONG)
        for index in range(len(PARAMETERS)):
            if index not in self.prior.measured:
                is_wrong[:, index] = False
        return is_wrong

    @cached_property
    def scores(self) -> FloatArray:
        """The realities' scores (n, parameters): how many standard deviations each parameter is above its median."""
        normal_scores = self.normal[:, _SCORES]
        # Some realities, a fraction NOMINAL_CHANCE of all, are close to nominal simulation. A normal number decides
        # which.
        near_scores = NOMINAL_SCORES + NEAR * (normal_scores - NOMINAL_SCORES)
        is_near_nominal = ndtr(self.normal[:, [_NEAR]]) < NOMINAL_CHANCE
        scores = numpy.where(is_near_nominal, near_scores, normal_scores)
        # What is known about a parameter, such as a measured value, narrows its scores. A wrong measurement does not.
        for index, prior in self.prior.known.items():
            narrowed = prior.mean + prior.sd * normal_scores[:, index]
            scores[:, index] = numpy.where(self.wrong[:, index], scores[:, index], narrowed)
        return numpy.clip(scores, -MAX_SCORE, MAX_SCORE)

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
        """The standard deviation (n,) of the part of the unexplained error that each design has alone, in log-odds."""
        own_size = UNEXPLAINED * numpy.exp(UNEXPLAINED_LOG_SD * self.normal[:, _OWN_SIZE])
        return numpy.asarray(numpy.sqrt(OWN) * own_size)

    def unexplained(self, designs: NDArray[Any]) -> FloatArray:
        """Return the unexplained error (n, d) of the designs with these indices, without the parts of each alone."""
        smooth = self.normal[:, _SMOOTH] @ self.prior.smooth_columns(self.prior.designs[designs])
        common = numpy.sqrt(COMMON) * self.normal[:, [_COMMON]]
        return numpy.asarray(self.size[:, None] * (common + numpy.sqrt(SMOOTH) * smooth))

    def log_odds(self, designs: NDArray[Any]) -> FloatArray:
        """Return the log-odds (n, d) that a random car of each design passes in a random scene, in each draw.

        ``designs`` (d,) are the indices of the designs.
        """
        log_odds = self.prior.log_odds(self.scores, designs) + self.unexplained(designs)
        # Each design has an error of its own. A draw contains those of the driven designs; those of the others are
        # random.
        own_errors = numpy.random.default_rng(OWN_ERROR_SEED).standard_normal(log_odds.shape)
        # The last columns of a draw are the errors of the driven designs.
        errors_of_driven = self.normal[:, _SMOOTH.stop :]
        driven_designs = self.driven.tolist()
        for column, design in enumerate(designs.tolist()):
            if design in driven_designs:
                own_errors[:, column] = errors_of_driven[:, driven_designs.index(design)]
        return log_odds + self._own_size[:, None] * own_errors

    def car_log_likelihood(self, trials: Trials) -> tuple[FloatArray, FloatArray]:
        """Return the log probability of each car's trials for certain log-odds of the car, and these log-odds.

        Both have the shape (n, cars, nodes). A car's log-odds of passing are normally distributed around those of its
        design. The nodes are values of this distribution, with the probabilities NODE_WEIGHTS.
        """
        driven_index_of_car = numpy.searchsorted(self.driven, trials.design)
        design_log_odds = self.log_odds(self.driven)[:, driven_index_of_car]
        centre = centre_of_cars(design_log_odds, self.car_sd[:, None])
        car_log_odds = centre[:, :, None] + self.car_sd[:, None, None] * NODES
        log_likelihood = numpy.zeros(car_log_odds.shape)
        for group, car in enumerate(trials.car.tolist()):
            log_odds = car_log_odds[:, car] + float(trials.scene_ease[group])
            passed, counted = float(trials.passed[group]), float(trials.counted[group])
            # The log probability of passing is log_odds - log(1 + odds), that of failing is -log(1 + odds).
            log_likelihood[:, car] += passed * log_odds - counted * numpy.logaddexp(0, log_odds)
        return log_likelihood, car_log_odds

    def log_likelihood(self, trials: Trials) -> FloatArray:
        """Return the log probability (n,) that each draw gives to the trials."""
        return numpy.asarray(self.log_likelihood_of_cars(trials).sum(axis=1))

    def log_likelihood_of_cars(self, trials: Trials) -> FloatArray:
        """Return the log probability (n, cars) that each draw gives to the trials of each car."""
        by_node, _ = self.car_log_likelihood(trials)
        # The greatest term is taken out of the sum, because exp of large negative numbers is 0.
        greatest = by_node.max(axis=2, keepdims=True)
        return numpy.asarray(greatest[..., 0] + numpy.log(numpy.exp(by_node - greatest) @ NODE_WEIGHTS))

    def car_rates(self, trials: Trials) -> FloatArray:
        """Draw the success rate (n, cars) of each car that drove, in each draw, given the car's own trials."""
        log_likelihood, car_log_odds = self.car_log_likelihood(trials)
        # A car's log-odds have the values of the nodes. This is the probability of each node.
        probabilities = numpy.exp(log_likelihood - log_likelihood.max(axis=2, keepdims=True)) * NODE_WEIGHTS
        cumulated = probabilities.cumsum(axis=2) / probabilities.sum(axis=2, keepdims=True)
        # Choose a node for each draw and car at random, with these probabilities: the first one whose cumulated
        # probability is not below a random number from 0 to 1.
        thresholds = numpy.random.default_rng(CAR_SEED).random((*cumulated.shape[:2], 1))
        nodes = (cumulated < thresholds).sum(axis=2).clip(max=len(NODES) - 1)
        drawn_log_odds = numpy.take_along_axis(car_log_odds, nodes[:, :, None], axis=2)[..., 0]
        return numpy.asarray(expit(drawn_log_odds))


def weigh(prior: Prior, trials: Trials, seed: int = 1) -> Draws:
    """Draw realities from the prior and weigh them by the trials. Equal input gives equal draws.

    Without trials all draws have the same weight. If the trials leave weight to only a few draws, these are moved, so
    that the answers do not rest on a handful of draws.
    """
    random = numpy.random.default_rng(seed)
    # The largest arrays have this many numbers for each draw, so there are fewer draws if it is large.
    numbers_per_draw = max(1, len(prior.designs), len(NODES) * len(trials.design))
    draw_count = int(numpy.clip(MAX_NUMBERS // numbers_per_draw, MIN_DRAWS, MAX_DRAWS))
    columns = _SMOOTH.stop + len(trials.driven)
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
    number, power, stride = len(log_likelihood), 0.0, FIRST_STRIDE
    for _ in range(MAX_STEPS):
        step = _largest_step(log_likelihood, 1 - power)
        power += step
        chosen = random.choice(number, number, p=normalised(step * log_likelihood))
        draws = replace(draws, normal=draws.normal[chosen])
        log_likelihood = log_likelihood[chosen]
        for _ in range(MOVES):
            # A random step to a new draw. Such steps leave the standard normal distribution, which is the prior,
            # unchanged. So only the likelihood decides whether the new draw is accepted.
            noise = random.standard_normal(draws.normal.shape)
            proposed = replace(draws, normal=numpy.sqrt(1 - stride**2) * draws.normal + stride * noise)
            proposed_log_likelihood = proposed.log_likelihood(trials)
            log_ratio = power * (proposed_log_likelihood - log_likelihood)
            is_accepted = numpy.log(random.random(number)) < log_ratio
            draws = replace(draws, normal=numpy.where(is_accepted[:, None], proposed.normal, draws.normal))
            log_likelihood = numpy.where(is_accepted, proposed_log_likelihood, log_likelihood)
            # Draws separate fastest if about a quarter of the steps is accepted. A longer stride is accepted less often.
            change = 1.2 if is_accepted.mean() > 0.25 else 0.8
            stride = float(numpy.clip(stride * change, MIN_STRIDE, 1.0))
        if power >= 1:
            break
    return draws


def _largest_step(log_likelihood: FloatArray, limit: float) -> float:
    """Return the largest step of the power of the likelihood, at most ``limit``, that leaves enough draws.

    Enough means that at least the fraction KEPT of the draws is effective after the step. It is found by bisection.
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
