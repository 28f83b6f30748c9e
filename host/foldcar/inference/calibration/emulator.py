"""An emulator of the simulator: how a drive goes in a cell, as smooth functions of the parameters.

A *cell* is a design in one scene, or in any scene of its environment. The emulator learns from a Bank of runs: sets of
parameters, drawn from the prior and then from posteriors, each simulated once in cells of the trials, and with random
designs of the family in random scenes, which predict what other trials would tell. Cars have their differences for all
runs of a set, as built ones have, so that the bank also tells how much of what scatters is the car's.

How a drive ends is the mean of small neural networks (scikit-learn), fitted by the likelihood of single runs: learning
from 24,000 runs of the width study under random parameters, they were 6 points off rates simulated apart (root mean
square), boosted trees 7, quadratic logistic regression and random Fourier features 8. Features of paths are smoother:
their means are polynomials of scores and cell, which there err less than networks (by a tenth of what runs scatter).
"""

import json
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from typing import Protocol

import numpy as np
from scipy.special import expit, logsumexp, ndtri
from scipy.stats import qmc
from sklearn.exceptions import ConvergenceWarning
from sklearn.neural_network import MLPClassifier
from sklearn.preprocessing import PolynomialFeatures
from threadpoolctl import threadpool_limits

from foldcar.errors import FoldcarError
from foldcar.inference.calibration.drive_features import ENDS, FEATURES
from foldcar.inference.calibration.experiment import CalibrationRun, Simulator, SweptExperiment
from foldcar.inference.calibration.observations import Cell, Observations
from foldcar.inference.calibration.parameters import PARAMETERS, FloatArray, values_of
from foldcar.inference.calibration.posterior import IntArray
from foldcar.statistics.built_cars import centre_factor

NETWORKS = 4
HIDDEN = (64, 64)
BATCH = 256
# Steps of the fit: more of them fit the single runs' noise.
STEPS, MOST_EPOCHS = 2400, 100
# The prior on weights, against that many runs.
PENALTY_RUNS, PENALTY_LIMITS = 2400.0, (0.05, 0.5)
# No simulation tells a probability closer to 0 or 1 than this logit: 1 in 400.
LARGEST_LOGIT = 6.0
# The log probability of an end that no run had.
UNKNOWN = -100.0
# Runs of each set of parameters: in at most so many of the trials' cells, and of that many designs of the family.
MOST_CELLS, OTHERS = 12, 2
# The first sets are spread wider than the prior, so that the emulator does not extrapolate at its edges.
WIDER = 1.2
# The second ones are draws of the first posterior, with noise.
NOISE = 0.4
# Least squares of features: added to the diagonal of their normal equations, as so many runs.
RIDGE = 3.0
# Of a feature's runs, this share at either end counts as no further off.
TAIL = 0.01
# A feature needs that many runs.
LEAST_RUNS = 100
MOST_SHARE, MOST_CAR_SD = 0.95, 3.0


class EndClassifier(Protocol):
    """What the emulator needs of scikit-learn's MLPClassifier."""

    classes_: IntArray

    def predict_log_proba(self, rows: FloatArray) -> FloatArray:
        """Return log probabilities (n, classes) by rows (n, parameters + inputs)."""


@dataclass(frozen=True)
class Emulator:
    """Networks for the ends of drives, polynomials for their features; made by :meth:`Bank.emulator`.

    The first ``designs`` of a cell's inputs are its design's. ``coefficients`` (terms, FEATURES) belong to
    :func:`_terms`, ``bounds`` (2, FEATURES) are the least and the largest value of features. ``covariance`` (FEATURES,
    FEATURES) is that of runs about their means, ``shares`` (FEATURES,) the car's part of it, NaN where too few runs have
    the feature. ``car_sd`` is the standard deviation of cars' logits.
    """

    networks: tuple[EndClassifier, ...]
    designs: int
    coefficients: FloatArray
    bounds: FloatArray
    covariance: FloatArray
    shares: FloatArray
    car_sd: float

    @property
    def middle(self) -> float:
        """By what factor the logit of the middle car is farther from 0 than that of the cars' mean rate."""
        return float(centre_factor(self.car_sd))

    def end_chances(self, scores: FloatArray, inputs: FloatArray) -> FloatArray:
        """Log probabilities (n, cells, ENDS) of how a drive ends, by scores (n, parameters) and inputs (cells, k)."""
        rows = np.hstack([np.repeat(scores, len(inputs), axis=0), np.tile(inputs, (len(scores), 1))])
        with threadpool_limits(1):
            each = [network.predict_log_proba(rows) for network in self.networks]
        chances = np.full((len(rows), ENDS), UNKNOWN)
        chances[:, self.networks[0].classes_] = logsumexp(each, axis=0) - np.log(len(each))
        return chances.reshape(len(scores), len(inputs), ENDS)

    def logits(self, scores: FloatArray, inputs: FloatArray) -> FloatArray:
        """Success logits (n, cells)."""
        return success_logits(self.end_chances(scores, inputs))

    def feature_means(self, scores: FloatArray, inputs: FloatArray) -> FloatArray:
        """Means (n, cells, FEATURES) of the features of drives that have them."""
        of_scores, of_designs, lines, scenes = _factors(scores, inputs, self.designs)
        split = of_scores.shape[1] * of_designs.shape[1]
        smooth = self.coefficients[:split].reshape(of_scores.shape[1], of_designs.shape[1], FEATURES)
        apart = self.coefficients[split:].reshape(lines.shape[1], scenes.shape[1], FEATURES)
        with threadpool_limits(1):
            means = np.einsum("ns,cd,sdf->ncf", of_scores, of_designs, smooth, optimize=True)
            return np.asarray(means + np.einsum("nl,cs,lsf->ncf", lines, scenes, apart, optimize=True))


def success_logits(chances: FloatArray) -> FloatArray:
    """The logits (...,) of passing, by log probabilities (..., ENDS) of all ends."""
    logits = chances[..., 0] - logsumexp(chances[..., 1:], axis=-1)
    return np.asarray(np.clip(logits, -LARGEST_LOGIT, LARGEST_LOGIT))


def _factors(scores: FloatArray, inputs: FloatArray, designs: int) -> tuple[FloatArray, ...]:
    """The factors of the polynomials' terms: squares of scores by powers of a design's, scores by scenes."""
    of_designs = PolynomialFeatures(3 if designs == 1 else 2).fit_transform(inputs[:, :designs])
    squares, lines = (PolynomialFeatures(degree).fit_transform(scores) for degree in (2, 1))
    return squares, of_designs, lines, inputs[:, designs:]


def _terms(scores: FloatArray, inputs: FloatArray, designs: int) -> FloatArray:
    """The terms (runs, terms) of features' polynomials, by each run's scores and inputs."""
    squares, of_designs, lines, scenes = _factors(scores, inputs, designs)
    products = (squares[:, :, None] * of_designs[:, None], lines[:, :, None] * scenes[:, None])
    return np.hstack([product.reshape(len(scores), -1) for product in products])


@dataclass(frozen=True)
class Bank:
    """Runs: ``scores`` (runs, parameters), ``cells`` (runs,) as rows of the inputs, ``cars`` (runs,), 0 and more.

    ``ends`` (runs,) are indices of ENDS, ``features`` (runs, FEATURES). Cars of ``sets`` (runs,) of parameters differ.
    """

    scores: FloatArray
    sets: IntArray
    cells: IntArray
    cars: IntArray
    ends: IntArray
    features: FloatArray

    def joined(self, other: "Bank") -> "Bank":
        """The runs of both."""
        return Bank(*(np.concatenate([getattr(bank, field.name) for bank in (self, other)]) for field in fields(self)))

    def emulator(self, inputs: FloatArray, designs: int, seed: int) -> Emulator:
        """Fit to these runs; the first ``designs`` of all ``inputs`` (cells, k) are a design's. Raises FoldcarError."""
        passed = self.ends == 0
        if len(np.unique(passed)) < 2:
            how = "pass" if passed.any() else "fail"
            raise FoldcarError(
                f"all {len(passed)} simulations of the designs with trials {how}, whatever the parameters: "
                "nothing can be inferred; check the listing and the designs"
            )
        networks = _fit_ends(np.hstack([self.scores, inputs[self.cells]]), self.ends, seed)
        result = Emulator(networks, designs, *self._polynomials(inputs, designs), 0.0)
        return replace(result, car_sd=self._car_sd(result, inputs))

    def _polynomials(self, inputs: FloatArray, designs: int) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Coefficients, bounds, covariance and cars' shares as in Emulator."""
        terms = _terms(self.scores, inputs[self.cells], designs)
        coefficients = np.zeros((terms.shape[1], FEATURES))
        bounds, residuals = np.full((2, FEATURES), np.nan), np.full(self.features.shape, np.nan)
        for feature, column in enumerate(self.features.T):
            known = np.isfinite(column)
            if known.sum() < LEAST_RUNS:
                continue
            bounds[:, feature] = np.quantile(column[known], [TAIL, 1 - TAIL])
            values, rows = np.clip(column[known], *bounds[:, feature]), terms[known]
            # The mean is not shrunk.
            middle, ridge = values.mean(), RIDGE * np.eye(terms.shape[1])
            with threadpool_limits(1):
                coefficients[:, feature] = np.linalg.solve(rows.T @ rows + ridge, rows.T @ (values - middle))
            coefficients[0, feature] += middle
            residuals[known, feature] = values - rows @ coefficients[:, feature]
        covariance = _covariance(residuals)
        return coefficients, bounds, covariance, self._shares(residuals, covariance)

    def _shares(self, residuals: FloatArray, covariance: FloatArray) -> FloatArray:
        usable, shares = np.isfinite(np.diag(covariance)), np.full(FEATURES, np.nan)
        for feature in np.flatnonzero(usable):
            # Given the features before it, of runs that have them all.
            order = np.flatnonzero(usable[: feature + 1])
            own = residuals[:, order] @ np.linalg.inv(np.linalg.cholesky(covariance[np.ix_(order, order)]))[-1]
            shares[feature] = np.clip(self._of_one_car(own, np.isfinite(own).astype(float)), 0, MOST_SHARE)
        return shares

    def _car_sd(self, emulator: Emulator, inputs: FloatArray) -> float:
        """The sd of cars' logits: what pairs of runs of one car pass or fail together beyond those of other cars."""
        chance = self.pass_chances(emulator, inputs).clip(*expit([-LARGEST_LOGIT, LARGEST_LOGIT]))
        product = self._of_one_car((self.ends == 0) - chance, chance * (1 - chance))
        return float(np.sqrt(np.clip(product, 0, MOST_CAR_SD**2)))

    def pass_chances(self, emulator: Emulator, inputs: FloatArray) -> FloatArray:
        """With what probability each of the runs (runs,) passes, by the emulator."""
        chance = np.empty(len(self.scores))
        for cell in np.unique(self.cells):
            rows = self.cells == cell
            chance[rows] = np.exp(emulator.end_chances(self.scores[rows], inputs[[cell]])[:, 0, 0])
        return chance

    def _of_one_car(self, residuals: FloatArray, slopes: FloatArray) -> float:
        """The mean product of two residuals of one car, in units of their slopes, less that of two cars of a set.

        ``residuals`` (runs,), NaN where unknown, and ``slopes`` (runs,). What two cars of a set share is the emulator's
        error.
        """
        cars = self.sets * (int(self.cars.max()) + 1) + self.cars
        values = np.stack([np.nan_to_num(residuals), slopes])
        one_car, one_set = _pair_products(cars, values), _pair_products(self.sets, values)
        two_cars = one_set - one_car
        return float(one_car[0] / max(one_car[1], 1e-9) - two_cars[0] / max(two_cars[1], 1e-9))


def _pair_products(groups: IntArray, values: FloatArray) -> FloatArray:
    """For each row of ``values`` (k, n), the sum of the products of each two values of one group (n,)."""
    _, index = np.unique(groups, return_inverse=True)
    return np.array([(np.bincount(index, row) ** 2 - np.bincount(index, row**2)).sum() for row in values])


def _covariance(residuals: FloatArray) -> FloatArray:
    """The covariance (FEATURES, FEATURES) of residuals by the runs that have both; NaN where too few have one."""
    known = np.isfinite(residuals)
    filled = np.where(known, residuals, 0.0)
    both = known.astype(float).T @ known
    usable = np.ix_(*2 * [np.diag(both) >= LEAST_RUNS])
    known_part = (filled.T @ filled / np.maximum(both, 1))[usable]
    scale = np.sqrt(np.outer(np.diag(known_part), np.diag(known_part)))
    # Pairs that no run had together are taken as independent; what is no covariance is made the nearest one.
    values, vectors = np.linalg.eigh(known_part / scale)
    covariance = np.full((FEATURES, FEATURES), np.nan)
    covariance[usable] = (vectors * np.maximum(values, 1e-3)) @ vectors.T * scale
    return covariance


def _fit_ends(inputs: FloatArray, ends: IntArray, seed: int) -> tuple[EndClassifier, ...]:
    """Networks that tell the ends of runs by inputs (runs, k)."""
    runs = len(inputs)
    # The sums of several threads would depend on their number.
    with threadpool_limits(1), warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)
        return tuple(
            MLPClassifier(
                HIDDEN,
                activation="tanh",
                alpha=float(np.clip(PENALTY_RUNS / runs, *PENALTY_LIMITS)),
                learning_rate_init=3e-3,
                batch_size=min(BATCH, runs),
                max_iter=min(MOST_EPOCHS, -(-STEPS * BATCH // runs)),
                n_iter_no_change=MOST_EPOCHS,
                random_state=(seed * NETWORKS + number) % 2**32,
            ).fit(inputs, ends)
            for number in range(NETWORKS)
        )


def prior_scores(sets: int, seed: int) -> FloatArray:
    """Scores (sets, parameters) that fill the prior evenly: a scrambled Sobol sequence."""
    with np.errstate(all="ignore"):
        sequence = qmc.Sobol(len(PARAMETERS), seed=seed).random_base2(int(np.ceil(np.log2(max(2, sets)))))[:sets]
    return np.asarray(WIDER * ndtri(np.clip(sequence, 1e-6, 1 - 1e-6)))


def near_scores(draws: FloatArray, sets: int, seed: int) -> FloatArray:
    """Scores (sets, parameters) around draws of a posterior."""
    stream = np.random.default_rng(seed)
    chosen = draws[stream.integers(0, len(draws), sets)]
    return np.asarray(chosen + NOISE * stream.standard_normal(chosen.shape))


def cell_inputs(experiment: SweptExperiment, cells: Sequence[Cell]) -> tuple[FloatArray, int]:
    """The inputs (cells + designs, k) of the cells and of each design in any scene, and how many of k are a design's.

    The varied parameters, each with mean 0 and variance 1 over the designs, and 1 for the scene that the cell is in.
    """
    table = np.array([list(experiment.varied(design).values()) for design in range(len(experiment.designs))])
    spread = table.std(axis=0)
    design = (table - table.mean(axis=0)) / np.where(spread > 0, spread, 1.0)
    known: dict[str, int] = {}
    place = [None if cell.scene is None else known.setdefault(json.dumps(cell.scene), len(known)) for cell in cells]
    scenes = np.zeros((len(cells) + len(design), len(known)))
    for row, column in enumerate(place):
        if column is not None:
            scenes[row, column] = 1.0
    designs = np.vstack([design[[cell.design for cell in cells]], design])
    return np.hstack([designs, scenes]), design.shape[1]


def simulate_bank(
    simulator: Simulator,
    scores: FloatArray,
    observed: Observations,
    first: int,
    done: Callable[[int], None],
) -> Bank:
    """Simulate each row of ``scores`` in cells of the trials and with other designs; sets are numbered from ``first``."""
    experiment, stream = simulator.experiment, np.random.default_rng((simulator.seed, first))
    cells, cars = len(observed.cells), len(observed.car_design)
    runs: list[CalibrationRun] = []
    rows: list[tuple[int, int, int]] = []
    drivers = [np.unique(observed.car[observed.cell == cell]) for cell in range(cells)]
    for index, values in enumerate(values_of(scores)):
        chosen = np.sort(stream.permutation(cells)[:MOST_CELLS])
        drives_of = [(int(cell), int(stream.choice(drivers[cell])), observed.cells[cell]) for cell in chosen]
        for other, design in enumerate(stream.integers(0, len(experiment.designs), OTHERS)):
            drives_of.append((cells + int(design), cars + other, Cell(int(design), None)))
        for row, car, cell in drives_of:
            scene = experiment.scenes[int(stream.integers(len(experiment.scenes)))] if cell.scene is None else cell.scene
            rows.append((index, row, car))
            # What scatters from drive to drive has a number of its own.
            drive = first * (MOST_CELLS + OTHERS) + len(runs)
            runs.append(CalibrationRun(cell.design, values, scene, (first + index) * (cars + OTHERS) + car, drive))
    drives = simulator.drives(runs, done)
    driven = [(row, drive) for row, drive in zip(rows, drives, strict=True) if drive is not None]
    sets, cell_of, car_of = (np.array([row[i] for row, _ in driven], dtype=np.int64) for i in range(3))
    ends = np.array([drive.end for _, drive in driven], dtype=np.int64)
    return Bank(scores[sets], first + sets, cell_of, car_of, ends, np.array([drive.features for _, drive in driven]))
