"""Success rates of many designs from few trials of each: the bias of simulation is assumed smooth over designs.

On the log-odds scale a design's rate is simulation's, smoothed over designs, plus a difference. The difference is a
Gaussian process over the designs' parameters (Kennedy and O'Hagan 2001, doi:10.1111/1467-9868.00294, with binomial
trials): a constant, a slope on simulation's own log-odds, a smooth part and a part of each design alone. Strengths and
lengths are averaged over a grid by their evidence, so rough differences pool little. A design's rate is that of a
further car of it; cars of a design differ (:mod:`foldcar.statistics.built_cars`).

A lone design that fails between good ones breaks the assumption. So each driven design's trials are predicted from those
of the others (:func:`contradictions`).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy
from numpy.typing import ArrayLike, NDArray

from foldcar.errors import FoldcarError
from foldcar.statistics.built_cars import COARSE_LOG_ODDS, RANGES, SPREADS, BuiltCars, likelihood
from foldcar.statistics.gaussian_process import (
    Factors,
    Likelihood,
    Matern,
    evidence_weights,
    farthest_first_designs,
    laplace,
    unit_range,
)
from foldcar.statistics.rate import Rate, check_confidence
from foldcar.statistics.smoothed_simulation import SmoothedSimulation, smoothed_simulation
from foldcar.statistics.words import listed

# Standard deviations, on the log-odds scale, of the constant difference and of its slope on simulation's log-odds.
CONSTANT, SLOPE = 1.5, 0.5
# The grid: standard deviation of the smooth part, its length as a fraction of the parameters' range, and standard
# deviation of the part of each design alone.
SMOOTH = (0.2, 0.7, 2.0)
LENGTHS = (0.15, 0.4, 1.0)
ALONE = (0.1, 0.3, 1.0)
# Largest number of driven designs that are pooled: the work grows with the cube of their number.
MAX_POOLED = 200
# A design contradicts the others if the two-sided p-value of its trials, given theirs, is below this
# (docs/statistics.md).
MIN_PROBABILITY = 0.05
# At least MIN_DRIVEN driven designs are compared; of more than MAX_CHECKED those with most trials.
MIN_DRIVEN, MAX_CHECKED = 3, 24
# Log-odds at which posteriors are tabulated, 1e-4 to 1 - 1e-4.
LOG_ODDS = numpy.linspace(-9.2, 9.2, 921)


@dataclass(frozen=True)
class Candidate:
    """One point of the grid of strengths and lengths, with the posterior of its factors.

    ``common`` (d, p) are functions with factors shared by the designs, ``own`` (d,) is the standard deviation of each
    design's own part. ``trials`` is the spline of the driven designs' log likelihood.
    """

    common: NDArray[Any]
    own: NDArray[Any]
    factors: Factors
    trials: Any


@dataclass(frozen=True)
class PooledBias:
    """The posterior of all designs' rates, by trials and simulation; made by :func:`pooled_bias`.

    ``simulated`` (d,) are simulation's smoothed log-odds. ``cars`` (d,) are the trials, None for a design without.
    ``weights`` are those of the candidates.
    """

    simulated: NDArray[Any]
    cars: tuple[BuiltCars | None, ...]
    candidates: tuple[Candidate, ...]
    weights: NDArray[Any]

    def rates(self, confidence: float = 0.95) -> list[Rate]:
        """Return the rate of a new car of each design: the median of its posterior, with the credible interval.

        A design's own trials enter by their exact likelihood; without trials the rate follows from neighbours and
        simulation. Raises FoldcarError if ``confidence`` is not between 0 and 1.
        """
        check_confidence(confidence)
        tail = (1 - confidence) / 2
        counts = [0 if car is None else int(car.counted.sum()) for car in self.cars]
        rates = []
        for car, counted, cumulative in zip(self.cars, counts, self._densities().cumsum(axis=1), strict=True):
            points = numpy.interp([tail, 0.5, 1 - tail], cumulative / cumulative[-1], LOG_ODDS)
            low, middle, high = (float(value) for value in 1 / (1 + numpy.exp(-points)))
            own_trials = "no trials" if car is None else car.text
            other_trials = f"{sum(counts) - counted} trials of others"
            method = f"{own_trials} of this design, {other_trials}, differences to simulation pooled"
            rates.append(Rate(middle, low, high, confidence, method))
        return rates

    def draws(self, number: int = 1000, seed: int = 0) -> NDArray[Any]:
        """Draw the rates (n, d) of new cars, 0 to 1, jointly for all designs.

        n is about ``number``: each candidate gets its weight's fraction of the draws, rounded.
        """
        random, log_odds = numpy.random.default_rng(seed), []
        for candidate, count in zip(self.candidates, numpy.round(number * self.weights).astype(int), strict=True):
            factors = (
                candidate.factors.mode
                + random.standard_normal((count, len(candidate.factors.mode))) @ candidate.factors.root.T
            )
            # First the factors of the common functions, then those of the driven designs' own deviations.
            common_count = candidate.common.shape[1]
            own = candidate.own * random.standard_normal((count, len(candidate.own)))
            own[:, self._driven] = candidate.own[self._driven] * factors[:, common_count:]
            log_odds.append(self.simulated + factors[:, :common_count] @ candidate.common.T + own)
        return numpy.asarray(1 / (1 + numpy.exp(-numpy.concatenate(log_odds))))

    @property
    def _driven(self) -> NDArray[Any]:
        """The indices of the designs with trials."""
        return numpy.flatnonzero([car is not None for car in self.cars])

    def _densities(self) -> NDArray[Any]:
        """Return the posterior densities (d, log-odds) of the designs' log-odds at LOG_ODDS.

        Laplace's approximation is normal. Dividing it by the normal approximation of a design's own likelihood leaves
        what simulation and the other designs' trials say. That is multiplied by the exact likelihood.
        """
        driven, exact = self._driven, numpy.zeros((len(self.cars), len(LOG_ODDS)))
        densities = numpy.zeros(exact.shape)
        # Many candidates share a spline.
        tables = {id(candidate.trials): candidate.trials(LOG_ODDS).T for candidate in self.candidates}
        for candidate, weight in zip(self.candidates, self.weights, strict=True):
            exact[driven], likelihood_of = tables[id(candidate.trials)], _likelihood_of_each([candidate.trials])
            # (designs, factors): log-odds are simulated + functions @ factors.
            functions = numpy.hstack([candidate.common, numpy.zeros((len(candidate.own), len(driven)))])
            functions[driven, candidate.common.shape[1] + numpy.arange(len(driven))] = candidate.own[driven]
            mean = (self.simulated + functions @ candidate.factors.mode)[:, None]
            # The own part of a driven design is one of the factors already.
            variance = ((functions @ candidate.factors.root) ** 2).sum(axis=1) + candidate.own**2
            variance[driven] -= candidate.own[driven] ** 2
            slope, curvature = numpy.zeros_like(mean), numpy.zeros_like(mean)
            _, driven_slope, driven_curvature = likelihood_of(mean[driven].T)
            slope[driven], curvature[driven] = driven_slope.T, driven_curvature.T
            # Remove the design's own trials from the approximation.
            variance = 1 / (1 / variance[:, None] + curvature)
            mean = mean - variance * slope
            logs = exact - (LOG_ODDS - mean) ** 2 / (2 * variance)
            density = numpy.exp(logs - logs.max(axis=1, keepdims=True))
            densities += weight * density / density.sum(axis=1, keepdims=True)
        return densities


def pooled_bias(
    parameters: ArrayLike,
    runs: ArrayLike,
    trials: ArrayLike,
    cars: Sequence[BuiltCars | None] | None = None,
    simulation: SmoothedSimulation | None = None,
) -> PooledBias:
    """Infer all designs' rates from few trials, with the difference to simulation smooth over designs (the file's head).

    ``parameters`` are (d, k), ``runs`` and ``trials`` (d, 2): numbers passed and in all. ``cars`` (d,) are each design's
    cars with their trials, None for a design without trials; if ``cars`` is None, each design has one car. ``simulation``
    is the result of :func:`smoothed_simulation` for these runs, computed if it is None. Raises FoldcarError if a table
    has the wrong shape, counts are impossible, or a design has no run.
    """
    x, run_counts, trial_counts = (numpy.asarray(values, dtype=float) for values in (parameters, runs, trials))
    shape = (len(x), 2)
    if x.ndim != 2 or run_counts.shape != shape or trial_counts.shape != shape or not numpy.all(numpy.isfinite(x)):
        raise FoldcarError("pooled rates need finite parameters (designs, k), and runs and trials (designs, 2)")
    possible = all(
        numpy.all((counts[:, 0] >= 0) & (counts[:, 0] <= counts[:, 1])) for counts in (run_counts, trial_counts)
    )
    if not possible or not numpy.all(run_counts[:, 1] >= 1):
        raise FoldcarError("pooled rates need 0 ≤ passed ≤ all, and at least 1 simulated run of each design")
    single_cars = [BuiltCars.of_one_car(*row) if row[1] else None for row in trial_counts.tolist()]
    if cars is None:
        built = tuple(single_cars)
    else:
        # Cars of designs without counted trials are ignored.
        built = tuple(single and own_cars for single, own_cars in zip(single_cars, cars, strict=True))
    if not len(x):
        return PooledBias(numpy.zeros(0), built, (), numpy.zeros(0))
    simulation = smoothed_simulation(x, run_counts) if simulation is None else simulation
    log_odds = simulation.mean
    scaled = unit_range(x)
    inducing, driven = farthest_first_designs(scaled), trial_counts[:, 1] > 0
    likelihoods = likelihood([own_cars for own_cars in built if own_cars is not None], RANGES)
    # The slope is zero at the mean of the driven designs, so it does not change their mean.
    centre = log_odds[driven].mean() if driven.any() else log_odds.mean()
    fixed_functions = (numpy.full(len(x), CONSTANT), SLOPE * (log_odds - centre), simulation.columns)
    candidates, evidence = [], []
    for length in LENGTHS:
        process = Matern(inducing, length).functions(scaled)
        residual_variance = numpy.maximum(1 - (process**2).sum(axis=1), 0)
        # Each likelihood is a pair: prior probability of its range of spreads, spline.
        grid = list(product(SMOOTH, ALONE, likelihoods))
        commons = [numpy.column_stack([*fixed_functions, smooth * process]) for smooth, _, _ in grid]
        owns = [numpy.sqrt(simulation.rest + alone**2 + smooth**2 * residual_variance) for smooth, alone, _ in grid]
        functions = [
            numpy.hstack([common[driven], numpy.diag(own[driven])]) for common, own in zip(commons, owns, strict=True)
        ]
        splines = [spline for _, _, (_, spline) in grid]
        posterior = laplace(numpy.array(functions), log_odds[driven], _likelihood_of_each(splines))
        for index, (_, _, (prior, spline)) in enumerate(grid):
            factors = Factors(posterior.mode[index], posterior.root[index], posterior.evidence[index])
            candidates.append(Candidate(commons[index], owns[index], factors, spline))
            evidence.append(factors.evidence + numpy.log(prior))
    return PooledBias(log_odds, built, tuple(candidates), evidence_weights(evidence))


def _likelihood_of_each(splines: Sequence[Any]) -> Likelihood:
    """Return the likelihood of log-odds (candidates, driven designs), with one cubic spline for each candidate.

    It evaluates all splines at once: value, slope and curvature of the polynomial a x³ + b x² + c x + d of each interval.
    """
    # (candidates, 4, intervals, designs)
    coefficients = numpy.array([spline.c for spline in splines])
    candidates, designs = numpy.ogrid[: len(splines), : coefficients.shape[3]]
    step = COARSE_LOG_ODDS[1] - COARSE_LOG_ODDS[0]

    def evaluate(log_odds: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
        inside = numpy.clip(log_odds, COARSE_LOG_ODDS[0], COARSE_LOG_ODDS[-1])
        interval = ((inside - COARSE_LOG_ODDS[0]) / step).astype(int).clip(0, len(COARSE_LOG_ODDS) - 2)
        x = inside - COARSE_LOG_ODDS[interval]
        a, b, c, d = numpy.moveaxis(coefficients[candidates, :, interval, designs], -1, 0)
        # A mixture of spreads may curve upwards far from its mode, but a Likelihood's curvature is at most 0.
        return ((a * x + b) * x + c) * x + d, (3 * a * x + 2 * b) * x + c, numpy.minimum(6 * a * x + 2 * b, 0)

    return evaluate


@dataclass(frozen=True)
class Contradictions:
    """Indices of driven ``designs`` that contradict the others, and of their ``undriven_neighbours``."""

    designs: tuple[int, ...] = ()
    undriven_neighbours: tuple[int, ...] = ()

    def remark(self, labels: Sequence[str]) -> list[str]:
        """Return a list with a sentence that names the contradictory designs by their ``labels``; [] without any."""
        if not self.designs:
            return []
        names = listed([labels[index] for index in self.designs])
        neighbours = [labels[index] for index in self.undriven_neighbours]
        more = [f"{len(neighbours) - 3} more"] if len(neighbours) > 3 else []
        neighbours_text = f" ({listed([*neighbours[:3], *more])})" if neighbours else ""
        pronoun = "it" if len(self.designs) == 1 else "them"
        return [
            f"The trials of {names} contradict those of the other designs: do not trust the rates of undriven designs "
            f"beside {pronoun}{neighbours_text}."
        ]


NO_CONTRADICTIONS = Contradictions()


def contradictions(
    parameters: ArrayLike,
    runs: ArrayLike,
    trials: ArrayLike,
    cars: Sequence[BuiltCars | None] | None = None,
    simulation: SmoothedSimulation | None = None,
) -> Contradictions:
    """Find driven designs whose trials contradict those of the other designs, and their undriven neighbours.

    Each design's trials are predicted from those of the others; improbable ones contradict. Arguments are those of
    :func:`pooled_bias`, but if ``cars`` is None, all cars of a design are alike.
    """
    all_parameters, run_counts, trial_counts = (
        numpy.asarray(values, dtype=float) for values in (parameters, runs, trials)
    )
    driven = numpy.flatnonzero(trial_counts[:, 1])
    if len(driven) < MIN_DRIVEN or not all_parameters.size:
        return NO_CONTRADICTIONS
    checked = driven[numpy.argsort(-trial_counts[driven, 1], kind="stable")][:MAX_CHECKED]
    # Cars that are alike count as one car that drove all trials.
    no_spread = (SPREADS == 0).astype(float)
    built = [
        BuiltCars(trial_counts[index, :1], trial_counts[index, 1:], numpy.zeros(1), no_spread)
        if cars is None
        else cars[index]
        for index in checked.tolist()
    ]
    smoothed = (smoothed_simulation(all_parameters, run_counts) if simulation is None else simulation).subset(checked)
    p_values = _p_values(all_parameters[checked], run_counts[checked], trial_counts[checked], built, smoothed)
    flagged = sorted(checked[p_values < MIN_PROBABILITY].tolist())
    if not flagged:
        return NO_CONTRADICTIONS
    neighbours = numpy.flatnonzero(_undriven_neighbours(unit_range(all_parameters), driven, flagged))
    return Contradictions(tuple(flagged), tuple(neighbours.tolist()))


def _p_values(
    parameters: NDArray[Any], runs: NDArray[Any], trials: NDArray[Any], built: Sequence[BuiltCars | None],
    smoothed: SmoothedSimulation,
) -> NDArray[Any]:  # fmt: skip
    """Return the two-sided p-value (d,) of each design's trials, predicted from the trials of the other designs.

    Arguments are those of :func:`pooled_bias`; every design has ``built`` cars.
    """
    random, p_values = numpy.random.default_rng(1), []
    for index, cars in enumerate(built):
        # Each of these designs has trials, and so cars.
        assert cars is not None
        other_trials = trials.copy()
        other_trials[index] = 0
        posterior = pooled_bias(parameters, runs, other_trials, built, smoothed)
        rates = posterior.draws()[:, index].clip(1e-9, 1 - 1e-9)
        predicted = cars.count_draws(rates, random)
        tails = (predicted <= cars.passed.sum()).mean(), (predicted >= cars.passed.sum()).mean()
        p_values.append(2 * float(min(tails)))
    return numpy.array(p_values)


def _undriven_neighbours(unit: NDArray[Any], driven: NDArray[Any], flagged: Sequence[int]) -> NDArray[Any]:
    """Return a mask (d,) of the undriven designs that have no driven design between themselves and a flagged one.

    ``unit`` (d, k) are parameters scaled to 0 to 1, ``driven`` and ``flagged`` indices. A design lies between two others
    if it is nearer to both than they are to each other: the relative neighbourhood of Toussaint (1980,
    doi:10.1016/0031-3203(80)90066-7). With one parameter, its value lies between theirs.
    """
    result = numpy.zeros(len(unit), dtype=bool)
    to_driven = numpy.sqrt(((unit[:, None] - unit[driven][None]) ** 2).sum(axis=2))
    for index in flagged:
        to_flagged = numpy.sqrt(((unit - unit[index]) ** 2).sum(axis=1))
        # (d, driven designs)
        is_between = (to_driven < to_flagged[:, None]) & (to_flagged[driven] < to_flagged[:, None]) & (driven != index)
        result |= ~is_between.any(axis=1)
    result[driven] = False
    return result
