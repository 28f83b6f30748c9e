"""Effects of design parameters on success, by one smooth model of all of them.

Averages of the runs at each value mislead where the values were run with different combinations of the other parameters.
So a parameter's effect is its partial dependence (Friedman 2001, doi:10.1214/aos/1013203451): the mean rate over the same
combinations at each value. These are the combinations that were run at every value, or all if those are too few. A
parameter's importance is the fraction of the variance of success that would vanish if it were fixed: Sobol's total index
over the designs that were run.

Runs of different designs in one environment are not independent. The posterior's covariance is therefore the sandwich
S (M + 1) S (Mueller 2013, doi:10.3982/ECTA9097). S is the inverse curvature. M is the sum over environments of the outer
product of the gradients of their log-likelihood. If all runs were independent, the sandwich would be S on average.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy
from numpy.typing import ArrayLike, NDArray

from foldcar.statistics.gaussian_process import SuccessModel, basis_functions, success_model
from foldcar.statistics.rate import check_confidence

DRAWS = 400
# With fewer environments the dependence of runs cannot be estimated.
MIN_ENVIRONMENTS = 5
# Combinations of the other parameters: at least this many must have been run at every value; at most this many are
# averaged, and this many are shown as curves.
MIN_COMBINATIONS, MAX_COMBINATIONS, MAX_CURVES = 3, 200, 20
# A parameter with more values is shown at this many between its ends.
MAX_VALUES = 40


@dataclass(frozen=True)
class Effect:
    """Success over the values ``grid`` (v,) of one parameter.

    ``mean`` (v,) is averaged over combinations of the other parameters, ``curves`` (c, v) are single combinations.
    ``low`` and ``high`` (v,) are the 95 % band of the mean curve's shape: its differences from the mean over all values.
    ``level`` is the 95 % interval of that mean. All values share the environments, so the shape is known better than the
    level. ``combinations`` is the number of combinations averaged; ``run`` is whether all were run at every value.
    ``rises`` are the probabilities that the first value, and the last, has a higher mean than its neighbour.
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
    """The fraction of the variance due to one parameter, alone or with others, 0 to 1, with its 95 % interval."""

    share: float
    low: float
    high: float


@dataclass(frozen=True)
class Effects:
    """A fit by :func:`fit_effects`: ``parameters`` (d, k) of the designs with runs, and draws of the model's factors.

    ``designs_differ`` is whether the designs passed at different rates.
    """

    model: SuccessModel
    parameters: NDArray[Any]
    factors: tuple[NDArray[Any], ...]
    designs_differ: bool = True

    def rates(self, parameters: NDArray[Any]) -> NDArray[Any]:
        """Draw the rates (draws, m) of designs with parameters (m, k), within the range of the designs that were run."""
        scaled, log_odds = (parameters - self.model.low) / self.model.span, []
        random = numpy.random.default_rng(1)
        for candidate, drawn in zip(self.model.candidates, self.factors, strict=True):
            functions = basis_functions(candidate.process, candidate.strength, scaled)
            # Between the inducing designs the functions lack this variance; the first function is the constant.
            residual_sd = numpy.sqrt(numpy.maximum(candidate.strength**2 - (functions[:, 1:] ** 2).sum(axis=1), 0))
            log_odds.append(drawn @ functions.T + residual_sd * random.standard_normal((len(drawn), len(scaled))))
        return numpy.asarray(1 / (1 + numpy.exp(-numpy.concatenate(log_odds))))

    def effect(self, parameter: int) -> Effect:
        """Return success over the values of the parameter with this index, averaged over the other parameters."""
        values = numpy.unique(self.parameters[:, parameter])
        combinations, all_run = self._combinations([parameter])
        grid = values if len(values) <= MAX_VALUES else numpy.linspace(values[0], values[-1], MAX_VALUES)
        # (draws, combinations, values)
        draws = self._draws_over(combinations, [parameter], grid[:, None])
        mean_curves = draws.mean(axis=1)
        levels = mean_curves.mean(axis=1)
        # The band shows the uncertainty of the curve's shape: the draws are shifted to a common level.
        low, high = levels.mean() + numpy.quantile(mean_curves - levels[:, None], (0.025, 0.975), axis=0)
        # A shifted draw may leave the range of rates.
        low, high = low.clip(0, 1), high.clip(0, 1)
        level_low, level_high = numpy.quantile(levels, (0.025, 0.975)).tolist()
        # Single combinations, evenly spaced by index.
        shown = numpy.unique(numpy.linspace(0, len(combinations) - 1, MAX_CURVES).round().astype(int))
        curves = numpy.median(draws[:, shown], axis=0)
        first_is_higher, last_is_higher = (
            float((mean_curves[:, end] > mean_curves[:, neighbour]).mean()) for end, neighbour in ((0, 1), (-1, -2))
        )
        return Effect(
            grid,
            mean_curves.mean(axis=0),
            low,
            high,
            level=(level_low, level_high),
            curves=curves,
            combinations=len(combinations),
            run=all_run,
            rises=(first_is_higher, last_is_higher),
        )

    def standardised(
        self, indices: Sequence[int], values: ArrayLike, confidence: float = 0.95
    ) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
        """Return the rate and its band (rate, low, high), each (m,), at values (m, k) of the parameters at ``indices``.

        As in :class:`Effect`, all values have the same combinations of the other parameters. Raises FoldcarError outside
        the range of the designs.
        """
        check_confidence(confidence)
        self.model.scaled(values, indices)
        means = self._draws_over(self._combinations(indices)[0], indices, numpy.asarray(values, dtype=float)).mean(axis=1)
        low, high = numpy.quantile(means, [(1 - confidence) / 2, (1 + confidence) / 2], axis=0)
        return means.mean(axis=0), low, high

    def _draws_over(self, combinations: NDArray[Any], indices: Sequence[int], values: NDArray[Any]) -> NDArray[Any]:
        """Draw rates (draws, combinations, m) at values (m, k) of the parameters at ``indices`` in each combination."""
        designs = numpy.repeat(combinations, len(values), axis=0)
        designs[:, list(indices)] = numpy.tile(values, (len(combinations), 1))
        return self.rates(designs).reshape(-1, len(combinations), len(values))

    def _combinations(self, indices: Sequence[int]) -> tuple[NDArray[Any], bool]:
        """Return combinations (c, k) of the parameters other than those at ``indices``, as one design for each.

        Also returns whether each combination was run at every value of the parameters at ``indices``. Otherwise these are
        all combinations.
        """
        others = numpy.delete(self.parameters, list(indices), axis=1)
        values = len(numpy.unique(self.parameters[:, list(indices)], axis=0))
        combinations, first_rows, counts = numpy.unique(others, axis=0, return_index=True, return_counts=True)
        complete = first_rows[counts == values]
        all_run = len(complete) >= min(MIN_COMBINATIONS, len(combinations))
        chosen = numpy.sort(complete if all_run else first_rows)
        if len(chosen) > MAX_COMBINATIONS:
            chosen = chosen[numpy.linspace(0, len(chosen) - 1, MAX_COMBINATIONS).round().astype(int)]
        return self.parameters[chosen].copy(), all_run

    def importance(self) -> list[Importance]:
        """Return the importance of each parameter; an empty list if all designs have the same rate.

        The draws then differ by chance only, and fractions of their variance mean nothing.
        """
        if not self.designs_differ:
            return []
        total_variance = self._design_draws.var(axis=1)
        if numpy.median(total_variance) < 1e-6:
            return []
        result = []
        for parameter in range(self.parameters.shape[1]):
            fractions = self._variance_over(parameter) / total_variance
            low, middle, high = numpy.quantile(fractions.clip(0, 1), (0.025, 0.5, 0.975))
            result.append(Importance(float(middle), float(low), float(high)))
        return result

    @cached_property
    def _design_draws(self) -> NDArray[Any]:
        """Draws of the rates (draws, d) of the designs that were run."""
        return self.rates(self.parameters)

    def _variance_over(self, parameter: int) -> NDArray[Any]:
        """Return the mean variance (draws,) of the rate over the parameter's values with the other parameters fixed."""
        others = numpy.delete(self.parameters, parameter, axis=1)
        _, group, counts = numpy.unique(others, axis=0, return_inverse=True, return_counts=True)
        group = group.ravel()
        # Designs that have another one with the same other parameters.
        has_partner = counts[group] > 1
        rates, group = self._design_draws[:, has_partner], group[has_partner]
        if has_partner.mean() < 0.5:
            # Too few designs differ in this parameter alone: use the model's rates at its values.
            values = numpy.unique(self.parameters[:, parameter])
            # At most 9 values and MAX_COMBINATIONS designs, evenly spaced by index.
            values = values[numpy.unique(numpy.linspace(0, len(values) - 1, 9).round().astype(int))]
            rows = numpy.unique(numpy.linspace(0, len(others) - 1, MAX_COMBINATIONS).round().astype(int))
            designs = numpy.repeat(self.parameters[rows], len(values), axis=0)
            designs[:, parameter] = numpy.tile(values, len(rows))
            rates, group = self.rates(designs), numpy.repeat(numpy.arange(len(rows)), len(values))
        sizes = numpy.bincount(group)
        divisors = numpy.maximum(sizes, 1)
        mean = numpy.array([numpy.bincount(group, row) for row in rates]) / divisors
        mean_square = numpy.array([numpy.bincount(group, row) for row in rates**2]) / divisors
        return numpy.asarray(((mean_square - mean**2) * sizes).sum(axis=1) / sizes.sum())


@dataclass(frozen=True)
class Standardised:
    """Success as a function of the parameters at ``indices``, averaged over the other parameters of ``effects``."""

    effects: Effects
    indices: tuple[int, ...]

    def rates(self, parameters: ArrayLike, confidence: float = 0.95) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
        """Return the rate and its band (rate, low, high), each (m,) and 0 to 1, at parameters (m, k).

        Raises FoldcarError outside the range of the designs.
        """
        return self.effects.standardised(self.indices, parameters, confidence)


def fit_effects(parameters: ArrayLike, design: ArrayLike, environment: ArrayLike, passed: ArrayLike) -> Effects:
    """Fit the model to designs with ``parameters`` (d, k) and their runs, and draw its factors.

    ``design``, ``environment`` and ``passed`` (runs,) are each run's index of the design, index of the environment, and 1
    if it passed, else 0. The draws' covariance is a sandwich estimate with environments as clusters, because runs in one
    environment are not independent. Raises FoldcarError if there are runs of fewer than 4 designs or a parameter does not
    vary.
    """
    designs = numpy.asarray(parameters, dtype=float)
    design_index, environment_index = numpy.asarray(design), numpy.asarray(environment)
    has_passed = numpy.asarray(passed, dtype=float)
    counted = numpy.bincount(design_index, minlength=len(designs))
    model = success_model(designs, numpy.bincount(design_index, has_passed, minlength=len(designs)), counted)
    scaled = (designs - model.low) / model.span
    random, factors = numpy.random.default_rng(0), []
    _, environment_index = numpy.unique(environment_index, return_inverse=True)
    clusters = int(environment_index.max()) + 1
    for candidate in model.candidates:
        number = max(1, round(DRAWS * candidate.weight))
        noise = random.standard_normal((number, len(candidate.factors.mode)))
        if clusters < MIN_ENVIRONMENTS:
            # The plain posterior, as if runs were independent.
            factors.append(candidate.factors.mode + noise @ candidate.factors.root.T)
            continue
        functions = basis_functions(candidate.process, candidate.strength, scaled)
        residual = has_passed - 1 / (1 + numpy.exp(-(functions @ candidate.factors.mode)))[design_index]
        gradients = numpy.array(
            [numpy.bincount(environment_index, column[design_index] * residual, clusters) for column in functions.T]
        )
        gradients -= gradients.mean(axis=1, keepdims=True)
        # Student's t, because the gradients' covariance is estimated from this many environments.
        degrees_of_freedom = clusters - 1
        scale = numpy.sqrt(clusters / random.chisquare(degrees_of_freedom, number))[:, None]
        # The covariance of S (gradients + noise), which is the sandwich; root root.T is S, noise has the covariance 1.
        step = scale * random.standard_normal((number, clusters)) @ gradients.T + noise
        factors.append(candidate.factors.mode + step @ candidate.factors.root @ candidate.factors.root.T)
    rates = numpy.bincount(design_index, has_passed, minlength=len(designs))[counted > 0] / counted[counted > 0]
    return Effects(model, designs[counted > 0], tuple(factors), bool(numpy.ptp(rates) > 0))
