"""Success rates of many designs from few trials of each: the difference of trials and simulation is smooth.

On the log-odds scale a design's rate is simulation's, smoothed over designs, plus a difference. The difference is a
Gaussian process over the designs' parameters: a constant, a slope on simulation's own log-odds, a smooth part and one of
each design alone (Kennedy and O'Hagan 2001, doi:10.1111/1467-9868.00294, with binomial trials). How strong and how smooth
it is, is averaged over a grid by the evidence, so that rough differences pool little. A design's rate is that of a
further car of it; its trials are of cars that differ (:mod:`foldcar.statistics.built_cars`).

That the difference is smooth is an assumption: a lone design that fails between good ones breaks it. So each driven
design's trials are predicted from those of the others (:func:`contradictions`).
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
from foldcar.statistics.built_cars import COARSE, RANGES, SPREADS, BuiltCars, likelihood
from foldcar.statistics.gaussian_process import (
    Factors,
    Likelihood,
    Matern,
    laplace,
    shares_of,
    spread_designs,
    unit_range,
)
from foldcar.statistics.rate import Rate, check_confidence
from foldcar.statistics.smoothed_simulation import SmoothedSimulation, smoothed_simulation
from foldcar.statistics.words import listed

# Standard deviations, on the log-odds scale, of the constant difference and of its slope on simulation's log-odds.
CONSTANT, SLOPE = 1.5, 0.5
# The grid: standard deviation and length (as a part of the parameters' range) of the smooth part; of one design's own.
SMOOTH = (0.2, 0.7, 2.0)
LENGTHS = (0.15, 0.4, 1.0)
ALONE = (0.1, 0.3, 1.0)
# Designs with trials that are pooled at most: the work grows with the cube of their number.
MAX_POOLED = 200
# Results that the others' trials make less probable than this contradict them (both tails; docs/statistics.md).
MIN_PROBABILITY = 0.05
# Fewer driven designs say nothing of each other; of more than MAX_CHECKED those with most trials are checked.
MIN_DRIVEN, MAX_CHECKED = 3, 24
# Log-odds at which posteriors are tabulated, 1e-4 to 1 - 1e-4.
LOG_ODDS = numpy.linspace(-9.2, 9.2, 921)


@dataclass(frozen=True)
class Candidate:
    """One point of the grid: the common functions (d, p), each design's own deviation (d,), the factors of both.

    ``trials`` is the likelihood of the driven designs, a spline.
    """

    common: NDArray[Any]
    own: NDArray[Any]
    factors: Factors
    trials: Any


@dataclass(frozen=True)
class PooledBias:
    """What trials and simulation say of all designs; made by :func:`pooled_bias`.

    ``simulated`` (d,) are simulation's smoothed log-odds, ``cars`` (d,) the trials, None of designs without, ``weights``
    those of the candidates.
    """

    simulated: NDArray[Any]
    cars: tuple[BuiltCars | None, ...]
    candidates: tuple[Candidate, ...]
    weights: NDArray[Any]

    def rates(self, confidence: float = 0.95) -> list[Rate]:
        """Return the rate of a further car of each design; those without trials have theirs from their neighbours.

        Intervals are without a normal approximation of a design's own trials.
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
        """About ``number`` draws (draws, d) of the true rates of further cars, 0 to 1, of all designs jointly.

        They say what a trial at one design tells of another.
        """
        random, found = numpy.random.default_rng(seed), []
        for candidate, share in zip(self.candidates, numpy.round(number * self.weights).astype(int), strict=True):
            factors = (
                candidate.factors.mode
                + random.standard_normal((share, len(candidate.factors.mode))) @ candidate.factors.root.T
            )
            shared = candidate.common.shape[1]
            alone = candidate.own * random.standard_normal((share, len(candidate.own)))
            alone[:, self._seen] = candidate.own[self._seen] * factors[:, shared:]
            found.append(self.simulated + factors[:, :shared] @ candidate.common.T + alone)
        return numpy.asarray(1 / (1 + numpy.exp(-numpy.concatenate(found))))

    @property
    def _seen(self) -> NDArray[Any]:
        return numpy.flatnonzero([car is not None for car in self.cars])

    def _densities(self) -> NDArray[Any]:
        """The densities (d, log-odds) at LOG_ODDS: likelihood of the own trials times what all else says, normal."""
        seen, own = self._seen, numpy.zeros((len(self.cars), len(LOG_ODDS)))
        densities, tabulated = (
            numpy.zeros(own.shape),
            {id(candidate.trials): candidate.trials(LOG_ODDS).T for candidate in self.candidates},
        )
        for candidate, weight in zip(self.candidates, self.weights, strict=True):
            own[seen], of_trials = tabulated[id(candidate.trials)], _each([candidate.trials])
            functions = numpy.hstack([candidate.common, numpy.zeros((len(candidate.own), len(seen)))])
            functions[seen, candidate.common.shape[1] + numpy.arange(len(seen))] = candidate.own[seen]
            middle = (self.simulated + functions @ candidate.factors.mode)[:, None]
            variance = ((functions @ candidate.factors.root) ** 2).sum(axis=1) + candidate.own**2
            variance[seen] -= candidate.own[seen] ** 2
            slope, curvature = numpy.zeros_like(middle), numpy.zeros_like(middle)
            slope[seen], curvature[seen] = (part.T for part in of_trials(middle[seen].T)[1:])
            # The own trials' part of the approximation is taken out again.
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

    ``cars`` (d,) tell which cars drove them, None of designs without trials; else those of a design are all of one car.
    ``simulation`` is what :func:`smoothed_simulation` makes of these designs and runs, made here if it is None.
    """
    x, f, y = (numpy.asarray(values, dtype=float) for values in (parameters, runs, trials))
    if x.ndim != 2 or f.shape != (len(x), 2) or y.shape != (len(x), 2) or not numpy.all(numpy.isfinite(x)):
        raise FoldcarError("pooled rates need finite parameters (designs, k), and runs and trials (designs, 2)")
    if not all(numpy.all((k[:, 0] >= 0) & (k[:, 0] <= k[:, 1])) for k in (f, y)) or not numpy.all(f[:, 1] >= 1):
        raise FoldcarError("pooled rates need 0 ≤ passed ≤ all, and at least 1 simulated run of each design")
    one_each = [BuiltCars.one(*row) if row[1] else None for row in y.tolist()]
    built = tuple(one_each if cars is None else (one and known for one, known in zip(one_each, cars, strict=True)))
    if not len(x):
        return PooledBias(numpy.zeros(0), built, (), numpy.zeros(0))
    simulation = smoothed_simulation(x, f) if simulation is None else simulation
    log_odds = simulation.mean
    scaled = unit_range(x)
    spanning, seen = spread_designs(scaled), y[:, 1] > 0
    of_trials = likelihood([cars for cars in built if cars is not None], RANGES)
    # The slope turns around the driven designs: it says nothing of them on the whole.
    centre = log_odds[seen].mean() if seen.any() else log_odds.mean()
    constant = (numpy.full(len(x), CONSTANT), SLOPE * (log_odds - centre), simulation.columns)
    candidates, evidence = [], []
    for length in LENGTHS:
        process = Matern(spanning, length).functions(scaled)
        left = numpy.maximum(1 - (process**2).sum(axis=1), 0)
        grid = list(product(SMOOTH, ALONE, of_trials))
        commons = [numpy.column_stack([*constant, smooth * process]) for smooth, _, _ in grid]
        owns = [numpy.sqrt(simulation.rest + alone**2 + smooth**2 * left) for smooth, alone, _ in grid]
        functions = [
            numpy.hstack([common[seen], numpy.diag(own[seen])]) for common, own in zip(commons, owns, strict=True)
        ]
        found = laplace(numpy.array(functions), log_odds[seen], _each([trials for _, _, (_, trials) in grid]))
        for at, (_, _, (prior, trials)) in enumerate(grid):
            factors = Factors(found.mode[at], found.root[at], found.evidence[at])
            candidates.append(Candidate(commons[at], owns[at], factors, trials))
            evidence.append(factors.evidence + numpy.log(prior))
    return PooledBias(log_odds, built, tuple(candidates), shares_of(evidence))


def _each(splines: Sequence[Any]) -> Likelihood:
    """The likelihood of each of the driven designs at log-odds of its own; a spline for each candidate."""
    coefficients = numpy.array([spline.c for spline in splines])
    candidates, designs, step = *numpy.ogrid[: len(splines), : coefficients.shape[3]], COARSE[1] - COARSE[0]

    def at(log_odds: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
        inside = numpy.clip(log_odds, COARSE[0], COARSE[-1])
        place = ((inside - COARSE[0]) / step).astype(int).clip(0, len(COARSE) - 2)
        x, (a, b, c, d) = inside - COARSE[place], numpy.moveaxis(coefficients[candidates, :, place, designs], -1, 0)
        # A mixture of spreads may curve upwards far from its mode.
        return ((a * x + b) * x + c) * x + d, (3 * a * x + 2 * b) * x + c, numpy.minimum(6 * a * x + 2 * b, 0)

    return at


@dataclass(frozen=True)
class Contradictions:
    """Indices of driven ``designs`` that contradict the others, and of those not driven ``beside`` them."""

    designs: tuple[int, ...] = ()
    beside: tuple[int, ...] = ()

    def remark(self, labels: Sequence[str]) -> list[str]:
        """A sentence that names them, if there are any."""
        if not self.designs:
            return []
        named, some = listed([labels[index] for index in self.designs]), [labels[index] for index in self.beside]
        which = f" ({listed([*some[:3], *[f'{len(some) - 3} more'] * (len(some) > 3)])})" if some else ""
        return [
            f"The trials of {named} contradict those of the other designs: rates of designs not driven beside "
            f"{'it' if len(self.designs) == 1 else 'them'}{which} are not to be trusted."
        ]


NONE = Contradictions()


def contradictions(
    parameters: ArrayLike,
    runs: ArrayLike,
    trials: ArrayLike,
    cars: Sequence[BuiltCars | None] | None = None,
    simulation: SmoothedSimulation | None = None,
) -> Contradictions:
    """Check designs (d, k) with runs and trials (d, 2), passed and all, as :func:`pooled_bias` takes them.

    ``cars`` (d,) drove the trials, None of designs without; else all cars of a design are alike.
    """
    x, f, y = (numpy.asarray(values, dtype=float) for values in (parameters, runs, trials))
    driven = numpy.flatnonzero(y[:, 1])
    if len(driven) < MIN_DRIVEN or not x.size:
        return NONE
    checked = driven[numpy.argsort(-y[driven, 1], kind="stable")][:MAX_CHECKED]
    alike = (SPREADS == 0).astype(float)
    built = [
        BuiltCars(y[at, :1], y[at, 1:], numpy.zeros(1), alike) if cars is None else cars[at] for at in checked.tolist()
    ]
    smoothed = (smoothed_simulation(x, f) if simulation is None else simulation).of(checked)
    probable = _probabilities(pickle.dumps((x[checked], f[checked], y[checked], built, smoothed)))
    flagged = sorted(checked[probable < MIN_PROBABILITY].tolist())
    if not flagged:
        return NONE
    return Contradictions(tuple(flagged), tuple(numpy.flatnonzero(_beside(unit_range(x), driven, flagged)).tolist()))


# A page is made again and again while a sweep runs. Arrays have no hash, their bytes do.
@lru_cache(32)
def _probabilities(facts: bytes) -> NDArray[Any]:
    """How probable each design's trials (d,), or less probable ones, are by the others'."""
    x, f, y, built, smoothed = pickle.loads(facts)
    random, probabilities = numpy.random.default_rng(1), []
    for index, one in enumerate(built):
        others = y.copy()
        others[index] = 0
        rate = pooled_bias(x, f, others, built, smoothed).draws()[:, index].clip(1e-9, 1 - 1e-9)
        counts = one.count_draws(rate, random)
        tails = (counts <= one.passed.sum()).mean(), (counts >= one.passed.sum()).mean()
        probabilities.append(2 * float(min(tails)))
    return numpy.array(probabilities)


def _beside(unit: NDArray[Any], driven: NDArray[Any], flagged: Sequence[int]) -> NDArray[Any]:
    """Whether designs are not driven and no driven one lies between them and a flagged one.

    Between: nearer to both than they are to each other (the relative neighbourhood of Toussaint 1980,
    doi:10.1016/0031-3203(80)90066-7); of one parameter, between their values.
    """
    result = numpy.zeros(len(unit), dtype=bool)
    apart = numpy.sqrt(((unit[:, None] - unit[driven][None]) ** 2).sum(axis=2))
    for index in flagged:
        away = numpy.sqrt(((unit - unit[index]) ** 2).sum(axis=1))
        result |= ~((apart < away[:, None]) & (away[driven] < away[:, None]) & (driven != index)).any(axis=1)
    result[driven] = False
    return result
