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
from typing import Any, NamedTuple

import numpy
from numpy.typing import ArrayLike, NDArray

from foldcar.statistics.gaussian_process import SuccessModel, basis_functions, logistic, success_model
from foldcar.statistics.rate import check_confidence

DRAWS = 400
# With fewer environments the dependence of runs cannot be estimated.
MIN_ENVIRONMENTS = 5
# Combinations of the other parameters: at least this many must have been run at every value; at most this many are
# averaged, and this many are shown as curves.
MIN_COMBINATIONS, MAX_COMBINATIONS, MAX_CURVES = 3, 200, 20
# A parameter with more values is shown at this many between its ends.
MAX_VALUES = 40
# The probabilities below the ends of a 95 % interval.
INTERVAL_95 = (0.025, 0.975)
# Below this variance of their rates, the designs do not differ.
MIN_VARIANCE = 1e-6
# The variance over a parameter is read from the designs if at least this fraction of them differs from another in this
# parameter alone. Otherwise it is computed at up to MAX_VARIANCE_VALUES of the parameter's values.
MIN_PARTNERS, MAX_VARIANCE_VALUES = 0.5, 9


@dataclass(frozen=True)
class Effect:
    """Success over the values ``grid`` (v,) of one parameter.

    ``mean`` (v,) is averaged over combinations of the other parameters, ``curves`` (c, v) are single combinations.
    ``low`` and ``high`` (v,) are the 95 % band of the mean curve's shape: its differences from the mean over all values.
    ``level`` is the 95 % interval of that mean. All values share the environments, so the shape is known better than the
    level. ``combinations`` is the number of combinations averaged. ``each_was_run`` is whether each of them was run at
    every value.
    ``rises`` are the probabilities that the first value, and the last, has a higher mean than its neighbour.
    """

    grid: NDArray[Any]
    mean: NDArray[Any]
    low: NDArray[Any]
    high: NDArray[Any]
    level: tuple[float, float]
    curves: NDArray[Any]
    combinations: int
    each_was_run: bool
    rises: tuple[float, float]


@dataclass(frozen=True)
class Importance:
    """The fraction of the variance due to one parameter, alone or with others, 0 to 1, with its 95 % interval."""

    share: float
    low: float
    high: float


class _Combinations(NamedTuple):
    """Designs (c, k), one for each combination of some parameters, and whether all combinations are complete."""

    designs: NDArray[Any]
    are_complete: bool


@dataclass(frozen=True)
class Effects:
    """What :func:`fit_effects` has learned about the effects of the parameters on success.

    ``model`` is the fitted Gaussian process. ``parameters`` (d, k) are the parameters of the designs with runs.
    ``factors`` has, for each candidate of the model, draws of the coefficients of its basis functions.
    ``designs_differ`` is whether the designs passed at different rates.
    """

    model: SuccessModel
    parameters: NDArray[Any]
    factors: tuple[NDArray[Any], ...]
    designs_differ: bool = True

    def rates(self, parameters: NDArray[Any]) -> NDArray[Any]:
        """Draw success rates of m designs with ``parameters`` (m, k) from the posterior of the model: (draws, m).

        Each row is one possible set of rates of all these designs. Repeated calls return the same draws. The parameters
        must be within the range of the designs that were run.
        """
        scaled = (parameters - self.model.low) / self.model.span
        random = numpy.random.default_rng(1)
        log_odds_of_candidates = []
        for candidate, drawn_factors in zip(self.model.candidates, self.factors, strict=True):
            functions = basis_functions(candidate.process, candidate.strength, scaled)
            represented_log_odds = drawn_factors @ functions.T
            # What the basis functions do not represent is drawn as noise.
            noise = random.standard_normal(represented_log_odds.shape)
            residual = numpy.sqrt(candidate.residual_variance(functions)) * noise
            log_odds_of_candidates.append(represented_log_odds + residual)
        return logistic(numpy.concatenate(log_odds_of_candidates))

    def effect(self, parameter: int) -> Effect:
        """Return how success changes with the parameter of this index, averaged over the other parameters."""
        combinations = self._combinations([parameter])
        grid = numpy.unique(self.parameters[:, parameter])
        if len(grid) > MAX_VALUES:
            grid = numpy.linspace(grid[0], grid[-1], MAX_VALUES)
        # Draws of the rates at each value, for each combination: (draws, combinations, values).
        rates = self._rates_over(combinations.designs, [parameter], grid[:, None])
        # The mean over the combinations: a curve over the values for each draw.
        mean_curves = rates.mean(axis=1)
        level_low, level_high = numpy.quantile(mean_curves.mean(axis=1), INTERVAL_95).tolist()
        low, high = _band_of_shape(mean_curves)
        number = len(combinations.designs)
        shown_rates = rates[:, _evenly_spaced(number, MAX_CURVES)]
        rises_towards_first = mean_curves[:, 0] > mean_curves[:, 1]
        rises_towards_last = mean_curves[:, -1] > mean_curves[:, -2]
        return Effect(
            grid,
            mean=mean_curves.mean(axis=0),
            low=low,
            high=high,
            level=(level_low, level_high),
            curves=numpy.median(shown_rates, axis=0),
            combinations=number,
            each_was_run=combinations.are_complete,
            rises=(float(rises_towards_first.mean()), float(rises_towards_last.mean())),
        )

    def standardised(
        self, indices: Sequence[int], values: ArrayLike, confidence: float = 0.95
    ) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
        """Return success as a function of the parameters at ``indices``, averaged over all other parameters.

        ``values`` (m, k) has the values of these k parameters at m places. Returns the rates at these places and the ends
        of their bands, (rate, low, high), each (m,). All rates are averaged over the same combinations of the other
        parameters. Raises FoldcarError if a value is outside the range of the designs.
        """
        check_confidence(confidence)
        # This result is not needed. But the call raises FoldcarError if a value is outside the range of the designs.
        self.model.scaled(values, indices)
        combinations = self._combinations(indices)
        rates = self._rates_over(combinations.designs, indices, numpy.asarray(values, dtype=float))
        means = rates.mean(axis=1)
        low, high = numpy.quantile(means, [(1 - confidence) / 2, (1 + confidence) / 2], axis=0)
        return means.mean(axis=0), low, high

    def _rates_over(self, combinations: NDArray[Any], indices: Sequence[int], values: NDArray[Any]) -> NDArray[Any]:
        """Draw rates (draws, combinations, m) at values (m, k) of the parameters at ``indices`` in each combination."""
        # One design for each combination and value.
        designs = numpy.repeat(combinations, len(values), axis=0)
        designs[:, list(indices)] = numpy.tile(values, (len(combinations), 1))
        return self.rates(designs).reshape(-1, len(combinations), len(values))

    def _combinations(self, indices: Sequence[int]) -> _Combinations:
        """Return the combinations of the other parameters, over which effects of those at ``indices`` are averaged.

        A combination is complete if it was run with every value of the parameters at ``indices``. Incomplete ones are
        returned only if there are too few complete ones. A combination is returned as one of the designs that have it,
        so its values of the parameters at ``indices`` are arbitrary.
        """
        other_parameters = numpy.delete(self.parameters, list(indices), axis=1)
        number_of_values = len(numpy.unique(self.parameters[:, list(indices)], axis=0))
        combinations, first_designs, counts = numpy.unique(
            other_parameters, axis=0, return_index=True, return_counts=True
        )
        complete_designs = first_designs[counts == number_of_values]
        enough_complete = len(complete_designs) >= min(MIN_COMBINATIONS, len(combinations))
        designs = numpy.sort(complete_designs if enough_complete else first_designs)
        if len(designs) > MAX_COMBINATIONS:
            designs = designs[_evenly_spaced(len(designs), MAX_COMBINATIONS)]
        return _Combinations(self.parameters[designs], are_complete=bool(enough_complete))

    def importance(self) -> list[Importance]:
        """Return the importance of each parameter: the fraction of the variance of success that is due to it.

        The list is empty if all designs have the same rate, because then there is no variance.
        """
        if not self.designs_differ:
            return []
        # The variance between the designs' rates, for each draw.
        total_variance = self._design_draws.var(axis=1)
        if numpy.median(total_variance) < MIN_VARIANCE:
            return []
        low_end, high_end = INTERVAL_95
        importances = []
        for parameter in range(self.parameters.shape[1]):
            # With several draws of the rates, there are several values of the fraction.
            fractions = self._variance_over(parameter) / total_variance
            low, median, high = numpy.quantile(fractions.clip(0, 1), (low_end, 0.5, high_end))
            importances.append(Importance(float(median), float(low), float(high)))
        return importances

    @cached_property
    def _design_draws(self) -> NDArray[Any]:
        """Draws of the rates (draws, d) of the designs that were run."""
        return self.rates(self.parameters)

    def _variance_over(self, parameter: int) -> NDArray[Any]:
        """Return how much the success rate varies with one design parameter while the others are fixed.

        ``parameter`` is its index. The result is the variance of the rate over the parameter's values, averaged over the
        designs. It is computed for each posterior draw of the model, and has the shape (draws,).
        """
        other_parameters = numpy.delete(self.parameters, parameter, axis=1)
        # The designs of a group differ in this parameter alone.
        _, group, counts = numpy.unique(other_parameters, axis=0, return_inverse=True, return_counts=True)
        group = group.ravel()
        has_partner = counts[group] > 1
        if has_partner.mean() >= MIN_PARTNERS:
            return _variance_within_groups(self._design_draws[:, has_partner], group[has_partner])
        # Too few designs differ in this parameter alone. So take some designs, set the parameter to some of its values,
        # and use the model's rates.
        values = numpy.unique(self.parameters[:, parameter])
        values = values[_evenly_spaced(len(values), MAX_VARIANCE_VALUES)]
        chosen = _evenly_spaced(len(self.parameters), MAX_COMBINATIONS)
        designs = numpy.repeat(self.parameters[chosen], len(values), axis=0)
        designs[:, parameter] = numpy.tile(values, len(chosen))
        group_of_design = numpy.repeat(numpy.arange(len(chosen)), len(values))
        return _variance_within_groups(self.rates(designs), group_of_design)


def _band_of_shape(curves: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return the 95 % band (low, high), each (values,), that shows how uncertain the shape of ``curves`` is.

    ``curves`` (draws, values) are draws of one curve of rates. Their levels, the means over the values, differ too. So
    they are shifted to the same level before the quantiles are taken.
    """
    levels = curves.mean(axis=1)
    shapes = curves - levels[:, None]
    low, high = levels.mean() + numpy.quantile(shapes, INTERVAL_95, axis=0)
    # A shifted rate may be below 0 or above 1.
    return low.clip(0, 1), high.clip(0, 1)


def _variance_within_groups(rates: NDArray[Any], group: NDArray[Any]) -> NDArray[Any]:
    """Return the variance of each row of ``rates`` (draws, m) within groups of columns, averaged over the columns.

    ``group`` (m,) has the number of the group to which each column belongs. The result is (draws,).
    """
    variances = numpy.empty_like(rates)
    for number in numpy.unique(group):
        is_member = group == number
        variances[:, is_member] = rates[:, is_member].var(axis=1, keepdims=True)
    return numpy.asarray(variances.mean(axis=1))


def _evenly_spaced(number: int, max_number: int) -> NDArray[Any]:
    """Return at most ``max_number`` of the indices below ``number``, evenly spaced, the first and the last included."""
    return numpy.unique(numpy.linspace(0, number - 1, max_number).round().astype(int))


def _centred_gradients(functions: NDArray[Any], residual: NDArray[Any], environment_index: NDArray[Any]) -> NDArray[Any]:
    """Return the gradients (functions, environments) of the log-likelihoods of the environments, with the mean 0.

    ``functions`` (runs, functions) are the basis functions at each run's design, and ``residual`` (runs,) is 1 or 0 for a
    passed or failed run, minus its predicted rate. ``environment_index`` (runs,) is the environment of each run.
    """
    gradients = numpy.array([numpy.bincount(environment_index, column * residual) for column in functions.T])
    return numpy.asarray(gradients - gradients.mean(axis=1, keepdims=True))


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
    design_index = numpy.asarray(design)
    _, environment_index = numpy.unique(numpy.asarray(environment), return_inverse=True)
    has_passed = numpy.asarray(passed, dtype=float)
    passed_runs = numpy.bincount(design_index, has_passed, minlength=len(designs))
    counted_runs = numpy.bincount(design_index, minlength=len(designs))
    model = success_model(designs, passed_runs, counted_runs)
    scaled = (designs - model.low) / model.span
    environments = int(environment_index.max()) + 1
    random = numpy.random.default_rng(0)
    drawn_factors = []
    for candidate in model.candidates:
        mode, root = candidate.factors.mode, candidate.factors.root
        number = max(1, round(DRAWS * candidate.weight))
        noise = random.standard_normal((number, len(mode)))
        if environments < MIN_ENVIRONMENTS:
            # The plain posterior, as if runs were independent.
            drawn_factors.append(mode + noise @ root.T)
            continue
        functions = basis_functions(candidate.process, candidate.strength, scaled)
        residual = has_passed - logistic(functions @ mode)[design_index]
        gradients = _centred_gradients(functions[design_index], residual, environment_index)
        # Student's t, because the gradients' covariance is estimated from this many environments.
        degrees_of_freedom = environments - 1
        scale = numpy.sqrt(environments / random.chisquare(degrees_of_freedom, number))[:, None]
        # A row of ``step`` has the covariance M + 1 of the file's head, and root root' is S. So the draws have the
        # covariance S (M + 1) S, which is the sandwich.
        step = scale * random.standard_normal((number, environments)) @ gradients.T + noise
        drawn_factors.append(mode + step @ root @ root.T)
    has_runs = counted_runs > 0
    rates = passed_runs[has_runs] / counted_runs[has_runs]
    return Effects(model, designs[has_runs], tuple(drawn_factors), designs_differ=bool(numpy.ptp(rates) > 0))
