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

import itertools
import json
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from scipy.special import expit, log_softmax, logsumexp, ndtri
from scipy.stats import qmc
from threadpoolctl import threadpool_limits

from foldcar.analysis.built_cars import centre_factor
from foldcar.calibration.drive_features import ENDS, FEATURES
from foldcar.calibration.experiment import CalibrationRun, Simulator, SweptExperiment
from foldcar.calibration.observations import BoolArray, Cell, Observations
from foldcar.calibration.parameters import PARAMETERS, FloatArray, values_of
from foldcar.calibration.posterior import IntArray
from foldcar.errors import FoldcarError

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


@dataclass(frozen=True)
class Emulator:
    """Weights and biases of each network's layers, and polynomials of features; made by :meth:`Bank.emulator`.

    ``ends`` are the columns of ENDS that the networks tell apart. ``designs`` is how many of a cell's inputs are its
    design's, ``coefficients`` (terms, FEATURES) belong to :func:`_terms`, ``bounds`` (2, FEATURES) are the least and the
    largest value of features. ``covariance`` (FEATURES, FEATURES) is that of runs about their means, ``shares``
    (FEATURES,) is the car's part of it, NaN for what too few runs had; ``car_sd`` is that of cars' logits.
    """

    ends: tuple[int, ...]
    networks: tuple[tuple[tuple[FloatArray, FloatArray], ...], ...]
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
        parameters = scores.shape[1]
        each = []
        with threadpool_limits(1):
            for (first, bias), *others in self.networks:
                # The first layer's sum is taken apart into parameters and cell.
                hidden = (scores @ first[:parameters])[:, None] + (inputs @ first[parameters:] + bias)[None]
                for weights, shift in others:
                    hidden = np.tanh(hidden) @ weights + shift
                if hidden.shape[-1] == 1:
                    # Of two classes scikit-learn has the logit of the second.
                    hidden = np.concatenate([np.zeros_like(hidden), hidden], axis=-1)
                each.append(log_softmax(hidden, axis=-1))
        found = np.full((len(scores), len(inputs), ENDS), UNKNOWN)
        found[..., list(self.ends)] = logsumexp(each, axis=0) - np.log(len(each))
        return np.asarray(found)

    def logits(self, scores: FloatArray, inputs: FloatArray) -> FloatArray:
        """Success logits (n, cells)."""
        return success_logits(self.end_chances(scores, inputs))

    def feature_means(self, scores: FloatArray, inputs: FloatArray) -> FloatArray:
        """Means (n, cells, FEATURES) of the features of drives that have them."""
        squares, design = _monomials(scores, 2), _design_terms(inputs, self.designs)
        lines, scenes = _monomials(scores, 1), inputs[:, self.designs :]
        split = squares.shape[1] * design.shape[1]
        smooth = self.coefficients[:split].reshape(squares.shape[1], design.shape[1], FEATURES)
        apart = self.coefficients[split:].reshape(lines.shape[1], scenes.shape[1], FEATURES)
        with threadpool_limits(1):
            per_cell = (
                np.tensordot(design, smooth, (1, 1)).transpose(1, 0, 2).reshape(squares.shape[1], len(inputs) * FEATURES)
            )
            per_scene = (
                np.tensordot(scenes, apart, (1, 1)).transpose(1, 0, 2).reshape(lines.shape[1], len(inputs) * FEATURES)
            )
            means = squares @ per_cell + lines @ per_scene
        return np.asarray(means.reshape(len(scores), len(inputs), FEATURES))


def success_logits(chances: FloatArray) -> FloatArray:
    """The logits (...,) of passing, by log probabilities (..., ENDS) of all ends."""
    found = chances[..., 0] - logsumexp(chances[..., 1:], axis=-1)
    return np.asarray(np.clip(found, -LARGEST_LOGIT, LARGEST_LOGIT))


def _monomials(values: FloatArray, degree: int) -> FloatArray:
    """The products (n, terms) of at most ``degree`` of the values (n, k)."""
    columns = [np.ones(len(values))]
    for number in range(1, degree + 1):
        for chosen in itertools.combinations_with_replacement(range(values.shape[1]), number):
            columns.append(np.prod(values[:, chosen], axis=1))
    return np.column_stack(columns)


def _design_terms(inputs: FloatArray, designs: int) -> FloatArray:
    """The products (n, terms) of the inputs (n, k) that are a design's: of one parameter to the third power."""
    return _monomials(inputs[:, :designs], 3 if designs == 1 else 2)


def _terms(scores: FloatArray, inputs: FloatArray, designs: int) -> FloatArray:
    """The terms (runs, terms) of features' polynomials: squares of scores by the design's, and lines by the scene."""
    design = _design_terms(inputs, designs)
    smooth = _monomials(scores, 2)[:, :, None] * design[:, None]
    apart = _monomials(scores, 1)[:, :, None] * inputs[:, None, designs:]
    return np.hstack([one.reshape(len(scores), -1) for one in (smooth, apart)])


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
        return Bank(*(np.concatenate([getattr(one, field.name) for one in (self, other)]) for field in fields(self)))

    def chosen(self, kept: BoolArray) -> "Bank":
        """Those of the runs (runs,)."""
        return Bank(*(getattr(self, field.name)[kept] for field in fields(self)))

    def emulator(self, inputs: FloatArray, designs: int, seed: int) -> Emulator:
        """The emulator of these runs; the first ``designs`` of all ``inputs`` (cells, k) are a design's. FoldcarError."""
        passed = self.ends == 0
        if len(np.unique(passed)) < 2:
            how = "pass" if passed.any() else "fail"
            raise FoldcarError(
                f"all {len(passed)} simulations of the designs with trials {how}, whatever the parameters: "
                "nothing can be inferred; check the listing and the designs"
            )
        ends, networks = _fit_ends(np.hstack([self.scores, inputs[self.cells]]), self.ends, seed)
        found = Emulator(ends, networks, designs, *self._polynomials(inputs, designs), 0.0)
        return replace(found, car_sd=self._car_sd(found, inputs))

    def _polynomials(self, inputs: FloatArray, designs: int) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Coefficients, bounds, covariance and cars' shares as in Emulator."""
        terms = _terms(self.scores, inputs[self.cells], designs)
        coefficients = np.zeros((terms.shape[1], FEATURES))
        bounds, left = np.full((2, FEATURES), np.nan), np.full(self.features.shape, np.nan)
        for feature, column in enumerate(self.features.T):
            had = np.isfinite(column)
            if had.sum() < LEAST_RUNS:
                continue
            bounds[:, feature] = np.quantile(column[had], [TAIL, 1 - TAIL])
            known, some = np.clip(column[had], *bounds[:, feature]), terms[had]
            # The mean is not shrunk.
            middle, ridge = known.mean(), RIDGE * np.eye(terms.shape[1])
            with threadpool_limits(1):
                coefficients[:, feature] = np.linalg.solve(some.T @ some + ridge, some.T @ (known - middle))
            coefficients[0, feature] += middle
            left[had, feature] = known - some @ coefficients[:, feature]
        covariance = _covariance(left)
        return coefficients, bounds, covariance, self._shares(left, covariance)

    def _shares(self, left: FloatArray, covariance: FloatArray) -> FloatArray:
        known = np.isfinite(np.diag(covariance))
        shares = np.full(FEATURES, np.nan)
        for feature in np.flatnonzero(known):
            # Given the features before it, of runs that have them all.
            order = np.flatnonzero(known[: feature + 1])
            root = np.linalg.inv(np.linalg.cholesky(covariance[np.ix_(order, order)]))[-1]
            rest = left[:, order] @ root
            had = np.isfinite(rest)
            product = self._of_one_car(had, rest[had], np.ones(int(had.sum())))
            shares[feature] = np.clip(product, 0, MOST_SHARE)
        return shares

    def _car_sd(self, emulator: Emulator, inputs: FloatArray) -> float:
        """The sd of cars' logits: what pairs of runs of one car pass or fail together beyond those of other cars."""
        chance = self.pass_chances(emulator, inputs).clip(*expit([-LARGEST_LOGIT, LARGEST_LOGIT]))
        rest, slope = (self.ends == 0) - chance, chance * (1 - chance)
        every = np.ones(len(rest), dtype=bool)
        return float(np.sqrt(np.clip(self._of_one_car(every, rest, slope), 0, MOST_CAR_SD**2)))

    def pass_chances(self, emulator: Emulator, inputs: FloatArray) -> FloatArray:
        """With what probability each of the runs (runs,) passes, by the emulator."""
        chance = np.empty(len(self.scores))
        for cell in np.unique(self.cells):
            rows = self.cells == cell
            chance[rows] = np.exp(emulator.end_chances(self.scores[rows], inputs[[cell]])[:, 0, 0])
        return chance

    def _of_one_car(self, chosen: BoolArray, rest: FloatArray, slope: FloatArray) -> float:
        """The mean product of two residuals of one car, in units of their slopes, less that of two cars of a set.

        ``rest`` and ``slope`` (chosen runs,). What two cars of a set share is the emulator's error.
        """
        one_car, one_set = (
            np.array([_pairs(groups[chosen], rest), _pairs(groups[chosen], slope)])
            for groups in (self._same_car, self.sets)
        )
        two_cars = one_set - one_car
        return float(one_car[0] / max(one_car[1], 1e-9) - two_cars[0] / max(two_cars[1], 1e-9))

    @property
    def _same_car(self) -> IntArray:
        return self.sets * (int(self.cars.max()) + 1) + self.cars


def _pairs(groups: IntArray, values: FloatArray) -> float:
    """The sum of the products of each two values (n,) of one group."""
    _, index = np.unique(groups, return_inverse=True)
    return float((np.bincount(index, values) ** 2 - np.bincount(index, values**2)).sum())


def _covariance(left: FloatArray) -> FloatArray:
    """The covariance (FEATURES, FEATURES) of residuals, NaN where they are unknown, by what each pair of features has."""
    known = np.isfinite(left)
    filled = np.where(known, left, 0.0)
    both = known.astype(float).T @ known
    found = filled.T @ filled / np.maximum(both, 1)
    usable = np.diag(both) >= LEAST_RUNS
    some = found[np.ix_(usable, usable)]
    scale = np.sqrt(np.diag(some))
    # Pairs that no run had together are taken as independent; what is no covariance is made the nearest one.
    values, vectors = np.linalg.eigh(some / np.outer(scale, scale))
    some = (vectors * np.maximum(values, 1e-3)) @ vectors.T * np.outer(scale, scale)
    found = np.full((FEATURES, FEATURES), np.nan)
    found[np.ix_(usable, usable)] = some
    return found


def _fit_ends(inputs: FloatArray, ends: IntArray, seed: int) -> tuple[tuple[int, ...], Any]:
    """The ends that runs had, and networks that tell them apart by inputs (runs, k)."""
    from sklearn.exceptions import ConvergenceWarning
    from sklearn.neural_network import MLPClassifier

    runs, networks = len(inputs), []
    # The sums of several threads would depend on their number.
    with threadpool_limits(1), warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)
        for number in range(NETWORKS):
            network = MLPClassifier(
                HIDDEN,
                activation="tanh",
                alpha=float(np.clip(PENALTY_RUNS / runs, *PENALTY_LIMITS)),
                learning_rate_init=3e-3,
                batch_size=min(BATCH, runs),
                max_iter=min(MOST_EPOCHS, -(-STEPS * BATCH // runs)),
                n_iter_no_change=MOST_EPOCHS,
                random_state=(seed * NETWORKS + number) % 2**32,
            ).fit(inputs, ends)
            networks.append(tuple(zip(network.coefs_, network.intercepts_, strict=True)))
    return tuple(int(end) for end in np.unique(ends)), tuple(networks)


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
    varied = list(experiment.info.varied)
    table = np.array([[float(design.parameters[name]) for name in varied] for design in experiment.designs])
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
    told = [(row, drive) for row, drive in zip(rows, drives, strict=True) if drive is not None]
    sets, cell_of, car_of = (np.array([row[i] for row, _ in told], dtype=np.int64) for i in range(3))
    ends = np.array([drive.end for _, drive in told], dtype=np.int64)
    return Bank(scores[sets], first + sets, cell_of, car_of, ends, np.array([drive.features for _, drive in told]))
