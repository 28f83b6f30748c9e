"""Success rates of many designs from few trials of each: the bias of simulation is assumed smooth over designs.

On the log-odds scale a design's rate is simulation's, smoothed over designs, plus a difference. The difference is a
Gaussian process over the designs' parameters (Kennedy and O'Hagan 2001, doi:10.1111/1467-9868.00294, with binomial
trials): a constant, a slope on simulation's own log-odds, a smooth part and a part of each design alone. Strengths and
lengths are averaged over a grid by their evidence, so rough differences pool little. A design's rate is that of a
further car of it; cars of a design differ (:mod:`foldcar.statistics.built_cars`).

A lone design that fails between good ones breaks the assumption. So each driven design's trials are predicted from those
of the others (:func:`contradictions`).
"""

import pickle
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
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
# At most so many driven designs are pooled: the work grows with the cube of their number.
MAX_POOLED = 200
# A design contradicts the others if theirs make its trials less probable than this (both tails; docs/statistics.md).
MIN_PROBABILITY = 0.05
# At least MIN_DRIVEN driven designs are compared; of more than MAX_CHECKED those with most trials.
MIN_DRIVEN, MAX_CHECKED = 3, 24
# Log-odds at which posteriors are tabulated, 1e-4 to 1 - 1e-4.
LOG_ODDS = numpy.linspace(-9.2, 9.2, 921)


@dataclass(frozen=True)
class Candidate:
    """One point of the grid: functions ``common`` to designs (d, p), each design's ``own`` deviation (d,), their factors.

    ``trials`` is the spline of the driven designs' likelihood.
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
        """Return the rate of a further car of each design; without trials it follows from neighbours and simulation.

        A design's own trials enter by their exact likelihood. Raises FoldcarError if ``confidence`` is not between 0 and
        1.
        """
        check_confidence(confidence)
        tail = (1 - confidence) / 2
        counts = [0 if car is None else int(car.counted.sum()) for car in self.cars]
        rates = []
        for car, counted, cumulative in zip(self.cars, counts, self._densities().cumsum(axis=1), strict=True):
            points = numpy.interp([tail, 0.5, 1 - tail], cumulative / cumulative[-1], LOG_ODDS)
            low, middle, high = (float(value) for value in 1 / (1 + numpy.exp(-points)))
            own = "no trials" if car is None else car.text
            method = f"{own} of this design, {sum(counts) - counted} trials of others, differences to simulation pooled"
            rates.append(Rate(middle, low, high, confidence, method))
        return rates

    def draws(self, number: int = 1000, seed: int = 0) -> NDArray[Any]:
        """Draw the rates of further cars, 0 to 1, jointly for all designs.

        The result is (n, d), where n is ``number`` except for rounding: each candidate gets draws by its weight.
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
        return numpy.flatnonzero([car is not None for car in self.cars])

    def _densities(self) -> NDArray[Any]:
        """Return densities (d, log-odds) at LOG_ODDS: the likelihood of a design's own trials times a normal prior.

        The prior is what simulation and the other designs' trials say.
        """
        seen, own = self._driven, numpy.zeros((len(self.cars), len(LOG_ODDS)))
        densities, tabulated = (
            numpy.zeros(own.shape),
            {id(candidate.trials): candidate.trials(LOG_ODDS).T for candidate in self.candidates},
        )
        for candidate, weight in zip(self.candidates, self.weights, strict=True):
            own[seen], of_trials = tabulated[id(candidate.trials)], _likelihood_of_each([candidate.trials])
            functions = numpy.hstack([candidate.common, numpy.zeros((len(candidate.own), len(seen)))])
            functions[seen, candidate.common.shape[1] + numpy.arange(len(seen))] = candidate.own[seen]
            middle = (self.simulated + functions @ candidate.factors.mode)[:, None]
            variance = ((functions @ candidate.factors.root) ** 2).sum(axis=1) + candidate.own**2
            variance[seen] -= candidate.own[seen] ** 2
            slope, curvature = numpy.zeros_like(middle), numpy.zeros_like(middle)
            slope[seen], curvature[seen] = (part.T for part in of_trials(middle[seen].T)[1:])
            # Remove the design's own trials from the approximation.
            variance = 1 / (1 / variance[:, None] + curvature)
            middle = middle - variance * slope
            logs = own - (LOG_ODDS - middle) ** 2 / (2 * variance)
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
    """Pool ``trials`` (d, 2), passed and all, of designs with ``parameters`` (d, k) and simulated ``runs`` (d, 2).

    ``cars`` (d,) are the cars of each design with their trials, None for a design without; without ``cars`` each design
    has one car. ``simulation`` is the result of :func:`smoothed_simulation` for these runs, computed if it is None.
    Raises FoldcarError if a table has the wrong shape, counts are impossible, or a design has no run.
    """
    x, f, y = (numpy.asarray(values, dtype=float) for values in (parameters, runs, trials))
    if x.ndim != 2 or f.shape != (len(x), 2) or y.shape != (len(x), 2) or not numpy.all(numpy.isfinite(x)):
        raise FoldcarError("pooled rates need finite parameters (designs, k), and runs and trials (designs, 2)")
    if not all(numpy.all((k[:, 0] >= 0) & (k[:, 0] <= k[:, 1])) for k in (f, y)) or not numpy.all(f[:, 1] >= 1):
        raise FoldcarError("pooled rates need 0 ≤ passed ≤ all, and at least 1 simulated run of each design")
    one_each = [BuiltCars.of_one_car(*row) if row[1] else None for row in y.tolist()]
    built = tuple(one_each if cars is None else (own and own_cars for own, own_cars in zip(one_each, cars, strict=True)))
    if not len(x):
        return PooledBias(numpy.zeros(0), built, (), numpy.zeros(0))
    simulation = smoothed_simulation(x, f) if simulation is None else simulation
    log_odds = simulation.mean
    scaled = unit_range(x)
    inducing, seen = farthest_first_designs(scaled), y[:, 1] > 0
    of_trials = likelihood([cars for cars in built if cars is not None], RANGES)
    # The slope is zero at the mean of the driven designs, so it does not change their mean.
    centre = log_odds[seen].mean() if seen.any() else log_odds.mean()
    constant = (numpy.full(len(x), CONSTANT), SLOPE * (log_odds - centre), simulation.columns)
    candidates, evidence = [], []
    for length in LENGTHS:
        process = Matern(inducing, length).functions(scaled)
        residual_variance = numpy.maximum(1 - (process**2).sum(axis=1), 0)
        grid = list(product(SMOOTH, ALONE, of_trials))
        commons = [numpy.column_stack([*constant, smooth * process]) for smooth, _, _ in grid]
        owns = [numpy.sqrt(simulation.rest + alone**2 + smooth**2 * residual_variance) for smooth, alone, _ in grid]
        functions = [
            numpy.hstack([common[seen], numpy.diag(own[seen])]) for common, own in zip(commons, owns, strict=True)
        ]
        posterior = laplace(
            numpy.array(functions), log_odds[seen], _likelihood_of_each([trials for _, _, (_, trials) in grid])
        )
        for index, (_, _, (prior, trials)) in enumerate(grid):
            factors = Factors(posterior.mode[index], posterior.root[index], posterior.evidence[index])
            candidates.append(Candidate(commons[index], owns[index], factors, trials))
            evidence.append(factors.evidence + numpy.log(prior))
    return PooledBias(log_odds, built, tuple(candidates), evidence_weights(evidence))


def _likelihood_of_each(splines: Sequence[Any]) -> Likelihood:
    """Return the likelihood of log-odds (candidates, driven designs), by one spline for each candidate."""
    coefficients = numpy.array([spline.c for spline in splines])
    candidates, designs, step = (
        *numpy.ogrid[: len(splines), : coefficients.shape[3]],
        COARSE_LOG_ODDS[1] - COARSE_LOG_ODDS[0],
    )

    def at(log_odds: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
        inside = numpy.clip(log_odds, COARSE_LOG_ODDS[0], COARSE_LOG_ODDS[-1])
        place = ((inside - COARSE_LOG_ODDS[0]) / step).astype(int).clip(0, len(COARSE_LOG_ODDS) - 2)
        x, (a, b, c, d) = (
            inside - COARSE_LOG_ODDS[place],
            numpy.moveaxis(coefficients[candidates, :, place, designs], -1, 0),
        )
        # A mixture of spreads may curve upwards far from its mode.
        return ((a * x + b) * x + c) * x + d, (3 * a * x + 2 * b) * x + c, numpy.minimum(6 * a * x + 2 * b, 0)

    return at


@dataclass(frozen=True)
class Contradictions:
    """Indices of driven ``designs`` that contradict the others, and of their ``undriven_neighbours``."""

    designs: tuple[int, ...] = ()
    undriven_neighbours: tuple[int, ...] = ()

    def remark(self, labels: Sequence[str]) -> list[str]:
        """Return a sentence that names them, in a list; an empty list without any."""
        if not self.designs:
            return []
        names, neighbours = (
            listed([labels[index] for index in self.designs]),
            [labels[index] for index in self.undriven_neighbours],
        )
        neighbours_text = (
            f" ({listed([*neighbours[:3], *[f'{len(neighbours) - 3} more'] * (len(neighbours) > 3)])})"
            if neighbours
            else ""
        )
        return [
            f"The trials of {names} contradict those of the other designs: rates of designs not driven beside "
            f"{'it' if len(self.designs) == 1 else 'them'}{neighbours_text} are not to be trusted."
        ]


NONE = Contradictions()


def contradictions(
    parameters: ArrayLike,
    runs: ArrayLike,
    trials: ArrayLike,
    cars: Sequence[BuiltCars | None] | None = None,
    simulation: SmoothedSimulation | None = None,
) -> Contradictions:
    """Find driven designs whose trials contradict those of the others; arguments as of :func:`pooled_bias`.

    Without ``cars``, all cars of a design are alike.
    """
    x, f, y = (numpy.asarray(values, dtype=float) for values in (parameters, runs, trials))
    driven = numpy.flatnonzero(y[:, 1])
    if len(driven) < MIN_DRIVEN or not x.size:
        return NONE
    checked = driven[numpy.argsort(-y[driven, 1], kind="stable")][:MAX_CHECKED]
    no_spread = (SPREADS == 0).astype(float)
    built = [
        BuiltCars(y[index, :1], y[index, 1:], numpy.zeros(1), no_spread) if cars is None else cars[index]
        for index in checked.tolist()
    ]
    smoothed = (smoothed_simulation(x, f) if simulation is None else simulation).subset(checked)
    probable = _probabilities(pickle.dumps((x[checked], f[checked], y[checked], built, smoothed)))
    flagged = sorted(checked[probable < MIN_PROBABILITY].tolist())
    if not flagged:
        return NONE
    return Contradictions(
        tuple(flagged), tuple(numpy.flatnonzero(_undriven_neighbours(unit_range(x), driven, flagged)).tolist())
    )


# A live page is recomputed while a sweep runs, so results are cached. Arrays have no hash, their bytes do.
@lru_cache(32)
def _probabilities(facts: bytes) -> NDArray[Any]:
    """Return the two-sided p-value (d,) of each design's trials, given those of the others."""
    x, f, y, built, smoothed = pickle.loads(facts)
    random, probabilities = numpy.random.default_rng(1), []
    for index, cars in enumerate(built):
        others = y.copy()
        others[index] = 0
        rate = pooled_bias(x, f, others, built, smoothed).draws()[:, index].clip(1e-9, 1 - 1e-9)
        counts = cars.count_draws(rate, random)
        tails = (counts <= cars.passed.sum()).mean(), (counts >= cars.passed.sum()).mean()
        probabilities.append(2 * float(min(tails)))
    return numpy.array(probabilities)


def _undriven_neighbours(unit: NDArray[Any], driven: NDArray[Any], flagged: Sequence[int]) -> NDArray[Any]:
    """Return a mask (d,) of the undriven designs that have no driven design between themselves and a flagged one.

    A design lies between two others if it is nearer to both than they are to each other: the relative neighbourhood of
    Toussaint (1980, doi:10.1016/0031-3203(80)90066-7). With one parameter, its value lies between theirs.
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
