"""What each of several design parameters does to success, by one smooth model of all of them.

A parameter's effect is the mean rate over combinations of the other parameters, the same ones for each of its values
(partial dependence, Friedman 2001, doi:10.1214/aos/1013203451): those that were run at every value, or where too few
were, all of them by the model. Raw averages show effects that are none where combinations are unequal. Its importance is
the share of the variance of success over designs that would go if only it were fixed: Sobol's total index over what was
run, for combinations that differ in it alone.

Runs of different designs in one environment are not independent. The posterior's covariance is therefore the sandwich
S (M + 1) S (Mueller 2013, doi:10.3982/ECTA9097), S the inverse curvature and M = sum over environments of the outer
product of the gradients of their log-likelihood: were all runs independent, it would be S on average.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy
from numpy.typing import ArrayLike, NDArray

from foldcar.statistics.gaussian_process import SuccessModel, functions_of, success_model
from foldcar.statistics.rate import check_confidence

DRAWS = 400
# Fewer environments than these do not tell how runs depend on each other.
MIN_ENVIRONMENTS = 5
# Combinations of the other parameters: at least so many, or else all that were run; at most so many, and curves of them.
MIN_COMBINATIONS, MAX_COMBINATIONS, MAX_CURVES = 3, 200, 20
# Values of a parameter between its ends if it has more of them.
MAX_VALUES = 40


@dataclass(frozen=True)
class Effect:
    """Success over the values ``grid`` (v,): ``mean`` (v,) and ``curves`` (c, v) of single combinations.

    ``low`` and ``high`` (v,) are the 95 % band of the differences between the values: how far success at a value may be
    above or below the mean over all values, about the mean curve. ``level`` is the 95 % interval of that mean over all
    values. All values share the environments, so the differences are known better than the level.
    ``combinations`` of the others are averaged; ``run``: all of them were run at every value, none is the model's alone.
    ``rises``: how probable it is that the mean at the first value, and at the last, is above that of its neighbour.
    """

    grid: NDArray[Any]
    mean: NDArray[Any]
    low: NDArray[Any]
    high: NDArray[Any]
    level: tuple[float, float]
    curves: NDArray[Any]
    combinations: int
    run: bool
    rises: tuple[float, float]


@dataclass(frozen=True)
class Importance:
    """The share of the variance that one parameter carries, alone or with others, 0 to 1, with its 95 % interval."""

    share: float
    low: float
    high: float


@dataclass(frozen=True)
class Effects:
    """Made by :func:`fit_effects`: ``parameters`` (d, k) of the designs with runs, and draws of the model's factors."""

    model: SuccessModel
    parameters: NDArray[Any]
    factors: tuple[NDArray[Any], ...]

    def rates(self, parameters: NDArray[Any]) -> NDArray[Any]:
        """Draws (draws, m) of the rates of designs (m, k) within the range of those that were run."""
        scaled, found = (parameters - self.model.low) / self.model.span, []
        random = numpy.random.default_rng(1)
        for candidate, drawn in zip(self.model.candidates, self.factors, strict=True):
            functions = functions_of(candidate.process, candidate.strength, scaled)
            left = numpy.sqrt(numpy.maximum(candidate.strength**2 - (functions[:, 1:] ** 2).sum(axis=1), 0))
            found.append(drawn @ functions.T + left * random.standard_normal((len(drawn), len(scaled))))
        return numpy.asarray(1 / (1 + numpy.exp(-numpy.concatenate(found))))

    def effect(self, parameter: int) -> Effect:
        """The effect of the parameter with that index."""
        values = numpy.unique(self.parameters[:, parameter])
        chosen, run = self._combinations([parameter])
        grid = values if len(values) <= MAX_VALUES else numpy.linspace(values[0], values[-1], MAX_VALUES)
        drawn = self._over(chosen, [parameter], grid[:, None])
        means = drawn.mean(axis=1)
        level = means.mean(axis=1)
        low, high = level.mean() + numpy.quantile(means - level[:, None], (0.025, 0.975), axis=0)
        lowest, highest = numpy.quantile(level, (0.025, 0.975)).tolist()
        shown = numpy.unique(numpy.linspace(0, len(chosen) - 1, MAX_CURVES).round().astype(int))
        curves = numpy.median(drawn[:, shown], axis=0)
        first, last = (float((means[:, end] > means[:, inner]).mean()) for end, inner in ((0, 1), (-1, -2)))
        mean = means.mean(axis=0)
        return Effect(grid, mean, low, high, (lowest, highest), curves, len(chosen), run, (first, last))

    def standardised(
        self, places: Sequence[int], values: ArrayLike, confidence: float = 0.95
    ) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
        """The rate and its band (rate, low, high), each (m,), at values (m, k) of the parameters at ``places``.

        Means over the same combinations of the others, as :class:`Effect`. FoldcarError outside the range of the designs.
        """
        check_confidence(confidence)
        self.model.scaled(values, places)
        means = self._over(self._combinations(places)[0], places, numpy.asarray(values, dtype=float)).mean(axis=1)
        low, high = numpy.quantile(means, [(1 - confidence) / 2, (1 + confidence) / 2], axis=0)
        return means.mean(axis=0), low, high

    def _over(self, chosen: NDArray[Any], places: Sequence[int], values: NDArray[Any]) -> NDArray[Any]:
        """Draws (draws, combinations, m) at values (m, k) of the parameters at ``places`` with each combination."""
        points = numpy.repeat(chosen, len(values), axis=0)
        points[:, list(places)] = numpy.tile(values, (len(chosen), 1))
        return self.rates(points).reshape(-1, len(chosen), len(values))

    def _combinations(self, places: Sequence[int]) -> tuple[NDArray[Any], bool]:
        """Combinations of the other parameters as designs, and whether each was run at every value of those."""
        others = numpy.delete(self.parameters, list(places), axis=1)
        values = len(numpy.unique(self.parameters[:, list(places)], axis=0))
        kinds, index, counts = numpy.unique(others, axis=0, return_index=True, return_counts=True)
        whole = index[counts == values]
        run = len(whole) >= min(MIN_COMBINATIONS, len(kinds))
        chosen = numpy.sort(whole if run else index)
        if len(chosen) > MAX_COMBINATIONS:
            chosen = chosen[numpy.linspace(0, len(chosen) - 1, MAX_COMBINATIONS).round().astype(int)]
        return self.parameters[chosen].copy(), run

    def importance(self) -> list[Importance]:
        """The importance of each parameter; none where all designs pass alike, so that there is nothing to share."""
        drawn = self._drawn
        total = drawn.var(axis=1)
        if numpy.median(total) < 1e-6:
            return []
        result = []
        for parameter in range(self.parameters.shape[1]):
            shares = self._carried(parameter) / total
            low, middle, high = numpy.quantile(shares.clip(0, 1), (0.025, 0.5, 0.975))
            result.append(Importance(float(middle), float(low), float(high)))
        return result

    @cached_property
    def _drawn(self) -> NDArray[Any]:
        return self.rates(self.parameters)

    def _carried(self, parameter: int) -> NDArray[Any]:
        """The mean variance (draws,) of the rate over the parameter's values, the other parameters fixed."""
        others = numpy.delete(self.parameters, parameter, axis=1)
        _, group, counts = numpy.unique(others, axis=0, return_inverse=True, return_counts=True)
        group = group.ravel()
        kept = counts[group] > 1
        drawn, group = self._drawn[:, kept], group[kept]
        if kept.mean() < 0.5:
            # As good as no two designs differ in it alone: the model's rates at its values.
            values = numpy.unique(self.parameters[:, parameter])
            values = values[numpy.unique(numpy.linspace(0, len(values) - 1, 9).round().astype(int))]
            rows = numpy.unique(numpy.linspace(0, len(others) - 1, MAX_COMBINATIONS).round().astype(int))
            points = numpy.repeat(self.parameters[rows], len(values), axis=0)
            points[:, parameter] = numpy.tile(values, len(rows))
            drawn, group = self.rates(points), numpy.repeat(numpy.arange(len(rows)), len(values))
        sizes = numpy.bincount(group)
        number = numpy.maximum(sizes, 1)
        first = numpy.array([numpy.bincount(group, row) for row in drawn]) / number
        second = numpy.array([numpy.bincount(group, row) for row in drawn**2]) / number
        return numpy.asarray(((second - first**2) * sizes).sum(axis=1) / sizes.sum())


@dataclass(frozen=True)
class Standardised:
    """Success over some of the parameters of :class:`Effects`, those at ``places``."""

    effects: Effects
    places: tuple[int, ...]

    def rates(self, parameters: ArrayLike, confidence: float = 0.95) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
        """The rate and its band (rate, low, high), each (m,) and 0 to 1, at parameters (m, k). Raises FoldcarError."""
        return self.effects.standardised(self.places, parameters, confidence)


def fit_effects(parameters: ArrayLike, design: ArrayLike, environment: ArrayLike, passed: ArrayLike) -> Effects:
    """Fit to designs (d, k) and runs (n,): index of the design, of the environment, 1 if passed. Raises FoldcarError."""
    x = numpy.asarray(parameters, dtype=float)
    at, where = numpy.asarray(design), numpy.asarray(environment)
    ended = numpy.asarray(passed, dtype=float)
    counted = numpy.bincount(at, minlength=len(x))
    model = success_model(x, numpy.bincount(at, ended, minlength=len(x)), counted)
    scaled = (x - model.low) / model.span
    random, factors = numpy.random.default_rng(0), []
    _, where = numpy.unique(where, return_inverse=True)
    clusters = int(where.max()) + 1
    for candidate in model.candidates:
        number = max(1, round(DRAWS * candidate.weight))
        noise = random.standard_normal((number, len(candidate.factors.mode)))
        if clusters < MIN_ENVIRONMENTS:
            factors.append(candidate.factors.mode + noise @ candidate.factors.root.T)
            continue
        functions = functions_of(candidate.process, candidate.strength, scaled)
        rest = ended - 1 / (1 + numpy.exp(-(functions @ candidate.factors.mode)))[at]
        gradients = numpy.array([numpy.bincount(where, column[at] * rest, clusters) for column in functions.T])
        gradients -= gradients.mean(axis=1, keepdims=True)
        # As Student's t: the gradients' spread is known from so many environments.
        freedom = clusters - 1
        scale = numpy.sqrt(clusters / random.chisquare(freedom, number))[:, None]
        step = scale * random.standard_normal((number, clusters)) @ gradients.T + noise
        factors.append(candidate.factors.mode + step @ candidate.factors.root @ candidate.factors.root.T)
    return Effects(model, x[counted > 0], tuple(factors))
