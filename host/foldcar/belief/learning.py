"""Learns the success rate as a function of reality and design. Each run to learn from has a reality of its own.

The log-odds of passing are learned by a penalised logistic regression. For a reality with scores z (K,) and a design with
parameters x they are

    quadratics(z) . a + (1, z) G g(x),

where g(x) has a constant, the parameters, their products, and bumps around some designs. So every score acts differently
on different designs, and every two scores act together. The score of a spread stands for the spread itself, because the
effect of a spread grows with it: at a score of -2.5 and at -1 there is hardly any. Each scene has an offset of its own,
because some scenes are easier than others. The penalty shrinks all coefficients towards 0. The nominal runs are learned
from, too, but with little weight, because they are all of one reality.

Tested on realities with known rates, this simple model was better than gradient boosting, neural networks and random
features.

The regression is solved by Newton's method in numpy: importing scikit-learn takes longer than the whole answer of
`foldcar select`. A test compares the result with scikit-learn's.
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy
from scipy.special import expit

from foldcar.belief.priors import NAMES, NOMINAL_SCORES, PARAMETERS, FloatArray
from foldcar.car.variation import workshop_spreads
from foldcar.errors import FoldcarError
from foldcar.store.designs import DesignCounts
from foldcar.store.reality_runs import BLOCK, CHECK, RealityRuns

# Bumps for each design parameter, and for all parameters together.
BUMPS_PER_PARAMETER, MAX_BUMPS = 12, 24
# Variances of the coefficients, and of the scenes' offsets, before any run. Chosen by the error at held-out realities.
COEFFICIENT_VARIANCE, SCENE_VARIANCE = 0.1, 0.3
NEWTON_STEPS, TOLERANCE = 25, 1e-6
# The nominal runs of a design count as so many runs.
NOMINAL_RUNS = 20.0
# Variance of the log-odds of single designs around the smooth function. A nominal run of a design tells as much about it
# as NOMINAL_TRUST runs in other realities.
DESIGN_VARIANCE, NOMINAL_TRUST = 0.3, 0.25
# Log-odds beyond these were not learned from any run: rates of 0.2 % and 99.8 %.
MAX_LOG_ODDS = 6.0
WHEEL_SPREAD = "wheel_spread"
# Rounded means: sqrt(2 / pi) of a half-normal variable of scale 1, exp(0.5² / 2) of the log-normal wheel spread.
HALF_NORMAL_MEAN, WHEEL_SPREAD_MEAN = 0.8, 1.1
# Variance of logistic noise relative to a normal one, squared: (16 sqrt(3) / 15 pi)^2 (Zeger, Liang and Albert 1988,
# doi:10.2307/2531734). A mean of logistic functions over a normal offset of variance v is nearly a logistic function
# whose log-odds are divided by sqrt(1 + SLOPE v).
SLOPE = 0.346


@dataclass(frozen=True)
class Learned:
    """The learned success rate.

    ``low`` and ``span`` (parameters,) map design parameters to 0 to 1. ``centres`` (bumps, parameters) and ``length`` are
    the bumps'. ``coefficients`` are those of :func:`_features`. ``scene_offsets`` are log-odds by sample, with mean 0.
    ``error`` is the root mean square error of the rate (0 to 1) on the check groups, which were not learned from; None
    without check groups. ``runs`` is the number of runs. ``design_offsets`` (designs,) are by how much each design that
    was learned from differs from the smooth function, in log-odds.
    """

    low: FloatArray
    span: FloatArray
    centres: FloatArray
    length: float
    coefficients: FloatArray
    scene_offsets: Mapping[int, float] = field(default_factory=dict)
    error: float | None = None
    runs: int = 0
    design_offsets: FloatArray = field(default_factory=lambda: numpy.zeros(0))

    def log_odds(self, scores: FloatArray, designs: FloatArray) -> FloatArray:
        """Return the log-odds (n, d) that a random car of each design passes in a random scene.

        ``scores`` (n, K) are those of n realities, and ``designs`` (d, parameters) the parameters of d designs.
        """
        inputs = _regression_inputs(scores)
        quadratics = _quadratics(inputs)
        number = quadratics.shape[1]
        # The file's head has the formula. The first term is the same for all designs.
        first_term = quadratics @ self.coefficients[:number]
        # The matrix G has a row for the constant and for each score, and a column for each feature of a design.
        matrix = self.coefficients[number:].reshape(1 + inputs.shape[1], -1)
        effects_on_designs = matrix @ self._design_features(designs).T
        second_term = _with_constant(inputs) @ effects_on_designs
        log_odds_in_average_scene = first_term[:, None] + second_term
        # Over random scenes, log-odds are closer to 0.
        log_odds = log_odds_in_average_scene / numpy.sqrt(1 + SLOPE * self._scene_variance)
        return numpy.asarray(numpy.clip(log_odds, -MAX_LOG_ODDS, MAX_LOG_ODDS))

    @property
    def _scene_variance(self) -> float:
        """The variance of the scenes' offsets (log-odds); 0 if no offset is known."""
        return float(numpy.var(list(self.scene_offsets.values()))) if self.scene_offsets else 0.0

    def unit(self, designs: FloatArray) -> FloatArray:
        """Return design parameters scaled to 0 to 1 over the family."""
        return (numpy.asarray(designs, float) - self.low) / self.span

    def _design_features(self, designs: FloatArray) -> FloatArray:
        """Return the features (d, features) of designs (d, parameters), g(x) in the file's head."""
        return _design_features(self.unit(designs), self.centres, self.length)


@dataclass(frozen=True)
class NominalRuns:
    """The nominal runs: their reality's ``scores`` (parameters,), and counts (designs,) of passed runs and of all."""

    scores: FloatArray
    passed: FloatArray
    counted: FloatArray


def nominal_runs(variation: Collection[str], counts: DesignCounts) -> NominalRuns:
    """Return how many nominal runs each design of an experiment has, how many passed, and in which reality they are.

    ``variation`` has the names of the quantities that vary between the cars of these runs.
    """
    scores = numpy.array(NOMINAL_SCORES)
    wheel_quantities = {name for name, quantity in workshop_spreads().items() if quantity.per == "wheel"}
    if wheel_quantities.intersection(variation):
        # NOMINAL_SCORES are those of a car whose wheels are all alike. In these runs the wheels of a car differ by the
        # usual amount, which is the median of the parameter WHEEL_SPREAD. The score of a median is 0.
        scores[NAMES.index(WHEEL_SPREAD)] = 0.0
    return NominalRuns(scores, numpy.array(counts.passed, float), numpy.array(counts.counted, float))


def learn(runs: RealityRuns, designs: FloatArray, nominal: NominalRuns | None = None) -> Learned:
    """Learn the success rate as a function of reality and design, from runs in many realities.

    ``runs`` are these runs. ``nominal`` are runs in nominal simulation, if there are any. ``designs`` (designs,
    parameters) are the parameters of the family's designs.

    The first CHECK runs of every BLOCK runs are of one design in one reality. They are a check group: the fraction of
    them that passed is nearly the success rate. To measure the error, the function is first learned without the check
    groups, and then compared with them. Raises FoldcarError if there are no runs.
    """
    runs = runs.taken(numpy.isfinite(runs.passed))
    if not len(runs):
        raise FoldcarError("there are no runs in other realities to learn from")
    low, span = designs.min(axis=0), numpy.ptp(designs, axis=0)
    # A parameter that does not vary must not divide by 0.
    span = numpy.where(span > 0, span, 1.0)
    centres = _distant_designs((designs - low) / span)
    # All of the function but its coefficients.
    unlearned = Learned(low, span, centres, length=_mean_spacing(centres), coefficients=numpy.zeros(0))
    error = None
    in_check_group = runs.number % BLOCK < CHECK
    if in_check_group.any() and not in_check_group.all():
        without_checks = _fit_coefficients(unlearned, runs.taken(~in_check_group), designs, nominal)
        error = _check_error(without_checks, runs.taken(in_check_group), designs)
    learned = _fit_coefficients(unlearned, runs, designs, nominal)
    return replace(learned, error=error, design_offsets=_design_offsets(learned, runs, designs, nominal))


def _design_offsets(learned: Learned, runs: RealityRuns, designs: FloatArray, nominal: NominalRuns | None) -> FloatArray:
    """Return by how much the log-odds of each design (designs,) differ from the smooth function that was learned.

    A smooth function of several parameters cannot follow every single design. Without these offsets, the designs that
    look best would be those that the function overestimates. An offset is large if the design passed more runs than the
    function says, and if it has many runs. ``nominal`` are runs in nominal simulation, which count less.

    In other words, the offsets are the coefficients of a penalised logistic regression with one coefficient for each
    design, after one step of Newton's method from 0: gradient / curvature of the penalised log-likelihood.
    """
    number = len(designs)
    learned_rates = _rates_of_runs(learned, runs, designs)
    gradient = numpy.bincount(runs.design, runs.passed - learned_rates, minlength=number)
    curvature = numpy.bincount(runs.design, learned_rates * (1 - learned_rates), minlength=number)
    if nominal is not None:
        nominal_rates = expit(learned.log_odds(nominal.scores[None], designs)[0])
        weights = NOMINAL_TRUST * nominal.counted
        gradient = gradient + NOMINAL_TRUST * nominal.passed - weights * nominal_rates
        curvature = curvature + weights * nominal_rates * (1 - nominal_rates)
    return numpy.asarray(gradient / (curvature + 1 / DESIGN_VARIANCE))


def _rates_of_runs(learned: Learned, runs: RealityRuns, designs: FloatArray) -> FloatArray:
    """Return the learned success rate (n,) of each run."""
    rates = numpy.empty(len(runs))
    for design in numpy.unique(runs.design).tolist():
        is_of_design = runs.design == design
        log_odds = learned.log_odds(runs.scores[is_of_design], designs[[design]])
        rates[is_of_design] = expit(log_odds[:, 0])
    return rates


def _fit_coefficients(unlearned: Learned, runs: RealityRuns, designs: FloatArray, nominal: NominalRuns | None) -> Learned:
    """Fit the coefficients and the scenes' offsets to runs, and return ``unlearned`` with them.

    ``runs`` are the runs in other realities. ``nominal`` are those in nominal simulation, if there are any. ``designs``
    (designs, parameters) are the designs of the family. The fit is a penalised logistic regression. Its table has a row
    for each run, with the features of the run's reality and design, and with a column for each scene.
    """
    design_features = unlearned._design_features(designs)
    features = _features(_regression_inputs(runs.scores), design_features[runs.design])
    number = features.shape[1]
    # The column of a scene is 1 for the runs in this scene.
    samples, scene_of_run = numpy.unique(runs.sample, return_inverse=True)
    is_in_scene = (scene_of_run[:, None] == numpy.arange(len(samples))).astype(float)
    rows = _Rows(numpy.hstack([features, is_in_scene]), passed=runs.passed, counted=numpy.ones(len(runs)))
    if nominal is not None:
        rows = rows.with_rows(_rows_of_nominal_runs(nominal, design_features, len(samples)))
    variances = numpy.repeat([COEFFICIENT_VARIANCE, SCENE_VARIANCE], [number, len(samples)])
    coefficients = penalised_logistic(rows.table, rows.passed, rows.counted, variances)
    scene_coefficients = coefficients[number:]
    offsets = scene_coefficients - scene_coefficients.mean()
    scene_offsets = dict(zip(samples.tolist(), offsets.tolist(), strict=True))
    return replace(unlearned, coefficients=coefficients[:number], scene_offsets=scene_offsets, runs=len(runs))


class _Rows(NamedTuple):
    """The data of the regression: a row of ``table`` for ``counted`` runs, of which ``passed`` passed."""

    table: FloatArray
    passed: FloatArray
    counted: FloatArray

    def with_rows(self, other: "_Rows") -> "_Rows":
        """Return these rows, followed by those of ``other``."""
        return _Rows(
            table=numpy.vstack([self.table, other.table]),
            passed=numpy.concatenate([self.passed, other.passed]),
            counted=numpy.concatenate([self.counted, other.counted]),
        )


def _rows_of_nominal_runs(nominal: NominalRuns, design_features: FloatArray, scenes: int) -> _Rows:
    """Return a row of the regression for each design with nominal runs.

    Nominal runs are simulated with the nominal values of the simulator's parameters. ``design_features`` (designs,
    features) describe the designs. The rate of a design counts as if it came from at most NOMINAL_RUNS runs. The
    regression has a column for the effect of each scene. The nominal runs are averages over the scenes, so their rows
    are 0 in these ``scenes`` columns.
    """
    has_runs = nominal.counted > 0
    inputs = _regression_inputs(nominal.scores[None])
    inputs_of_rows = numpy.repeat(inputs, int(has_runs.sum()), axis=0)
    features = _features(inputs_of_rows, design_features[has_runs])
    no_scene = numpy.zeros((len(features), scenes))
    counted = numpy.minimum(NOMINAL_RUNS, nominal.counted[has_runs])
    rates = nominal.passed[has_runs] / nominal.counted[has_runs]
    return _Rows(numpy.hstack([features, no_scene]), passed=counted * rates, counted=counted)


def penalised_logistic(
    features: FloatArray, passed: FloatArray, counted: FloatArray, variances: FloatArray
) -> FloatArray:
    """Fit a penalised logistic regression and return its coefficients (m,).

    A row of the data has ``features`` (n, m), and ``passed`` (n,) of its ``counted`` (n,) runs passed. The coefficients
    maximise log-likelihood - sum(coefficient² / (2 variance)), where ``variances`` (m,) are positive. The function is
    strictly concave, so there is one maximum. It is found by Newton's method.
    """
    coefficients = numpy.zeros(features.shape[1])
    objective = _objective(features, passed, counted, variances, coefficients)
    for _ in range(NEWTON_STEPS):
        rates = expit(features @ coefficients)
        gradient = features.T @ (passed - counted * rates) - coefficients / variances
        variances_of_rows = counted * rates * (1 - rates)
        curvature = features.T @ (features * variances_of_rows[:, None])
        curvature[numpy.diag_indices(len(coefficients))] += 1 / variances
        step = numpy.linalg.solve(curvature, gradient)
        new_objective = _objective(features, passed, counted, variances, coefficients + step)
        # A full step may lead beyond the maximum, to a smaller value. Then it is halved until it does not.
        while new_objective < objective - TOLERANCE:
            step = step / 2
            new_objective = _objective(features, passed, counted, variances, coefficients + step)
        coefficients, objective = coefficients + step, new_objective
        if numpy.abs(step).max() < TOLERANCE:
            break
    return coefficients


def _objective(
    features: FloatArray, passed: FloatArray, counted: FloatArray, variances: FloatArray, coefficients: FloatArray
) -> float:
    """Return the penalised log-likelihood that :func:`penalised_logistic` maximises."""
    log_odds = features @ coefficients
    penalty = (coefficients**2 / variances).sum() / 2
    return float(passed @ log_odds - counted @ numpy.logaddexp(0, log_odds) - penalty)


def _check_error(learned: Learned, checks: RealityRuns, designs: FloatArray) -> float | None:
    """Return the root mean square error of the learned rate on check groups, or None if no group has several runs.

    The learned rate is compared with the fraction of the group's runs that passed. This fraction differs from the true
    rate by chance, because the group has few runs. The variance of the chance is estimated and subtracted.
    """
    # A group consists of the runs of one block with the same design.
    runs_of_groups: dict[tuple[int, int], list[int]] = {}
    blocks = (checks.number // BLOCK).tolist()
    for run, group in enumerate(zip(blocks, checks.design.tolist(), strict=True)):
        runs_of_groups.setdefault(group, []).append(run)
    learned_rates = _rates_of_runs(learned, checks, designs)
    squared_errors = []
    for runs in runs_of_groups.values():
        if len(runs) < 2:
            continue
        passed_fraction = checks.passed[runs].mean()
        # The unbiased estimate of p (1 - p) / n, where p is the true rate and n the number of runs.
        variance_of_chance = passed_fraction * (1 - passed_fraction) / (len(runs) - 1)
        # All runs of a group have the same learned rate.
        difference = learned_rates[runs[0]] - passed_fraction
        squared_errors.append(difference**2 - variance_of_chance)
    if not squared_errors:
        return None
    return float(numpy.sqrt(max(0.0, numpy.mean(squared_errors))))


def _features(scores: FloatArray, design_features: FloatArray) -> FloatArray:
    """Return the features (n, m) of runs with ``scores`` (n, K) of designs with ``design_features`` (n, d)."""
    products = _with_constant(scores)[:, :, None] * design_features[:, None, :]
    return numpy.hstack([_quadratics(scores), products.reshape(len(scores), -1)])


def _regression_inputs(scores: FloatArray) -> FloatArray:
    """Return the inputs of the regression that learns success rates, for ``scores`` (n, parameters), in the same shape.

    A score is the value of one of the simulator's unknown parameters on a scale on which it is standard normal. For most
    parameters the input is the score. Some parameters are standard deviations, such as that of the car's start. Their
    effect is proportional to their value, not to their score, so the input is the value minus its mean.
    """
    inputs = numpy.array(scores, dtype=float)
    for index, parameter in enumerate(PARAMETERS):
        if parameter.prior == "half-normal":
            inputs[:, index] = parameter.value(scores[:, index]) / parameter.sd - HALF_NORMAL_MEAN
        elif parameter.name == WHEEL_SPREAD:
            inputs[:, index] = parameter.value(scores[:, index]) - WHEEL_SPREAD_MEAN
    return inputs


def _with_constant(values: FloatArray) -> FloatArray:
    """Return values (n, m) with a column of ones before them (n, 1 + m)."""
    return numpy.hstack([numpy.ones((len(values), 1)), values])


def _quadratics(values: FloatArray) -> FloatArray:
    """Return half the products of every two columns (n, m), squares included."""
    first, second = numpy.triu_indices(values.shape[1])
    return values[:, first] * values[:, second] / 2


def _design_features(unit: FloatArray, centres: FloatArray, length: float) -> FloatArray:
    """Return g(x) of designs ``unit`` (d, parameters), whose parameters are 0 to 1: (d, features)."""
    centred = 2 * unit - 1
    squared_distances = ((unit[:, None] - centres) ** 2).sum(axis=2)
    bumps = numpy.exp(-squared_distances / (2 * length**2))
    return numpy.hstack([_with_constant(centred), _quadratics(centred), bumps])


def _distant_designs(designs: FloatArray) -> FloatArray:
    """Choose some designs that are far from each other. Return them as (chosen, parameters).

    ``designs`` (designs, parameters) have their parameters scaled to 0 to 1. The first chosen design is the one nearest
    to the mean. Each further one is the one that is farthest from those chosen before.
    """
    parameters = designs.shape[1]
    designs = numpy.unique(designs, axis=0)
    number = min(len(designs), BUMPS_PER_PARAMETER * parameters, MAX_BUMPS)

    def squared_distances(point: FloatArray) -> FloatArray:
        """Return the squared distance of each design to a point."""
        return numpy.asarray(((designs - point) ** 2).sum(axis=1))

    chosen = [int(squared_distances(designs.mean(axis=0)).argmin())]
    # The squared distance of each design to the nearest chosen one.
    nearest = squared_distances(designs[chosen[0]])
    while len(chosen) < number:
        farthest = int(nearest.argmax())
        chosen.append(farthest)
        nearest = numpy.minimum(nearest, squared_distances(designs[farthest]))
    return designs[chosen]


def _mean_spacing(centres: FloatArray) -> float:
    """Return the mean distance of the bumps' centres to their nearest neighbours; 1 for a single one."""
    if len(centres) < 2:
        return 1.0
    distances = numpy.sqrt(((centres[:, None] - centres) ** 2).sum(axis=2))
    distances[numpy.diag_indices(len(centres))] = numpy.inf
    return float(distances.min(axis=1).mean())
