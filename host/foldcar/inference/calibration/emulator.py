"""Emulates the simulator: the success of each cell as a smooth function of the parameters.

A *cell* is a design in one scene, or in any scene of its environment. The emulator learns from a Bank of runs. Parameters
are drawn from the prior, later around a first posterior. Each set of parameters is simulated once in cells of the trials,
and with random designs of the family in random scenes. A car keeps its differences in all runs of a set, as built cars
do, so the bank also shows how much of the scatter belongs to the car.

The emulator is the mean of small neural networks (scikit-learn), fitted to the likelihood of single runs. Trained with
24,000 runs of the width study under random parameters, they were 6 points off separately simulated rates (root mean
square); boosted trees were 7 off, quadratic logistic regression and random Fourier features 8.
"""

import json
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from typing import Protocol

import numpy as np
from scipy.special import expit, logit, ndtri
from scipy.stats import qmc
from sklearn.exceptions import ConvergenceWarning
from sklearn.neural_network import MLPClassifier
from threadpoolctl import threadpool_limits

from foldcar.belief.priors import PARAMETERS, FloatArray, values_of
from foldcar.errors import FoldcarError
from foldcar.inference.calibration.experiment import CalibrationRun, Simulator, SweptExperiment
from foldcar.inference.calibration.observations import Cell, Observations
from foldcar.inference.calibration.posterior import IntArray
from foldcar.statistics.built_cars import centre_factor

NETWORKS = 4
HIDDEN = (64, 64)
BATCH = 256
# Steps of gradient descent: more would fit the noise of single runs. An epoch uses every run once.
STEPS, MAX_EPOCHS = 2400, 100
# L2 penalty of the weights: PENALTY_RUNS divided by the number of runs, within the limits.
PENALTY_RUNS, PENALTY_LIMITS = 2400.0, (0.05, 0.5)
# Predicted logits are clipped to ± this, a probability of 1 in 400: a bank cannot show rates closer to 0 or 1.
MAX_LOGIT = 6.0
# Runs of each set of parameters: in at most MAX_CELLS cells of trials, and of OTHERS random designs of the family.
MAX_CELLS, OTHERS = 12, 2
# The first sets are spread wider than the prior, so that the emulator does not extrapolate at its edges.
WIDENING = 1.2
# Standard deviation of the noise added to draws of the first posterior, in scores.
NOISE = 0.4
# Largest estimate of the standard deviation between cars, in log-odds.
MAX_CAR_SD = 3.0


class PassClassifier(Protocol):
    """The part of scikit-learn's MLPClassifier that the emulator uses."""

    def predict_proba(self, rows: FloatArray) -> FloatArray:
        """Return probabilities (n, 2) of failing and passing for rows (n, parameters + inputs)."""


@dataclass(frozen=True)
class Emulator:
    """Predicts success from parameters and a cell's inputs; :meth:`Bank.emulator` fits it.

    The first ``designs`` numbers of a cell's inputs describe its design. ``car_sd`` is the standard deviation of the
    success logits of cars of one design.
    """

    networks: tuple[PassClassifier, ...]
    designs: int
    car_sd: float

    @property
    def centre_factor(self) -> float:
        """The median car's logit, divided by the logit of the cars' mean rate."""
        return float(centre_factor(self.car_sd))

    def logits(self, scores: FloatArray, inputs: FloatArray) -> FloatArray:
        """Return success logits (n, cells) for scores (n, parameters) and inputs (cells, k)."""
        rows = np.hstack([np.repeat(scores, len(inputs), axis=0), np.tile(inputs, (len(scores), 1))])
        with threadpool_limits(1):
            rate = np.mean([network.predict_proba(rows)[:, 1] for network in self.networks], axis=0)
        clipped = np.clip(rate, *expit([-MAX_LOGIT, MAX_LOGIT]))
        return np.asarray(logit(clipped)).reshape(len(scores), len(inputs))


@dataclass(frozen=True)
class Bank:
    """Runs: ``scores`` (runs, parameters); ``cells`` (runs,), rows of the inputs; ``cars`` (runs,); ``passed`` (runs,).

    Runs of one of the ``sets`` (runs,) share their parameters. Cars of different sets differ.
    """

    scores: FloatArray
    sets: IntArray
    cells: IntArray
    cars: IntArray
    passed: FloatArray

    def joined(self, other: "Bank") -> "Bank":
        """Return the runs of both banks."""
        return Bank(*(np.concatenate([getattr(bank, field.name) for bank in (self, other)]) for field in fields(self)))

    def emulator(self, inputs: FloatArray, designs: int, seed: int) -> Emulator:
        """Fit an emulator to the runs.

        The first ``designs`` columns of the cells' ``inputs`` (cells, k) describe designs. Raises FoldcarError if all
        runs passed or all failed.
        """
        if len(np.unique(self.passed)) < 2:
            verb = "pass" if self.passed.any() else "fail"
            raise FoldcarError(
                f"all {len(self.passed)} simulations of the designs with trials {verb}, whatever the parameters: "
                "nothing can be inferred; check the listing and the designs"
            )
        networks = _fit(np.hstack([self.scores, inputs[self.cells]]), self.passed, seed)
        # The cars' spread is estimated from the residuals of the emulator without spread.
        result = Emulator(networks, designs, 0.0)
        return replace(result, car_sd=self._car_sd(result, inputs))

    def _car_sd(self, emulator: Emulator, inputs: FloatArray) -> float:
        """Estimate the standard deviation of the success logits of cars of one design.

        Two runs of one car share the car's offset and the emulator's error, so their residuals correlate; two runs of
        different cars of one parameter set share only the error. The variance of offsets is the difference of the two
        mean products of residuals, each divided by the product of the slopes of rate by logit, rate (1 - rate).
        """
        rate = np.empty(len(self.scores))
        for cell in np.unique(self.cells):
            rows = self.cells == cell
            rate[rows] = expit(emulator.logits(self.scores[rows], inputs[[cell]])[:, 0])
        # Cars have numbers within their set; here each car of each set has its own.
        cars = self.sets * (int(self.cars.max()) + 1) + self.cars
        # (2, runs); each product below is the pair (of residuals, of slopes).
        residuals_and_slopes = np.stack([self.passed - rate, rate * (1 - rate)])
        same_car, same_set = _pair_products(cars, residuals_and_slopes), _pair_products(self.sets, residuals_and_slopes)
        different_cars = same_set - same_car
        variance = same_car[0] / max(same_car[1], 1e-9) - different_cars[0] / max(different_cars[1], 1e-9)
        return float(np.sqrt(np.clip(variance, 0, MAX_CAR_SD**2)))


def _pair_products(groups: IntArray, values: FloatArray) -> FloatArray:
    """Return (k,): for each row of ``values`` (k, n), the sum of products of ordered pairs within the groups (n,).

    In each group it is (Σx)² - Σx².
    """
    _, index = np.unique(groups, return_inverse=True)
    return np.array([(np.bincount(index, row) ** 2 - np.bincount(index, row**2)).sum() for row in values])


def _fit(inputs: FloatArray, passed: FloatArray, seed: int) -> tuple[PassClassifier, ...]:
    """Fit NETWORKS networks with different random starts to inputs (runs, k) and outcomes (runs,), 0 or 1."""
    runs = len(inputs)
    # Sums of several threads would depend on the number of threads.
    with threadpool_limits(1), warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)
        return tuple(
            MLPClassifier(
                HIDDEN,
                activation="tanh",
                alpha=float(np.clip(PENALTY_RUNS / runs, *PENALTY_LIMITS)),
                learning_rate_init=3e-3,
                batch_size=min(BATCH, runs),
                # Epochs for about STEPS steps, rounded up.
                max_iter=min(MAX_EPOCHS, -(-STEPS * BATCH // runs)),
                # Never stop early.
                n_iter_no_change=MAX_EPOCHS,
                random_state=(seed * NETWORKS + number) % 2**32,
            ).fit(inputs, passed)
            for number in range(NETWORKS)
        )


def prior_scores(sets: int, seed: int) -> FloatArray:
    """Return scores (sets, parameters) that cover the prior evenly: a scrambled Sobol sequence."""
    with np.errstate(all="ignore"):
        sequence = qmc.Sobol(len(PARAMETERS), seed=seed).random_base2(int(np.ceil(np.log2(max(2, sets)))))[:sets]
    return np.asarray(WIDENING * ndtri(np.clip(sequence, 1e-6, 1 - 1e-6)))


def scores_near(draws: FloatArray, sets: int, seed: int) -> FloatArray:
    """Return scores (sets, parameters): randomly chosen ``draws`` (n, parameters) of a posterior, with added noise."""
    stream = np.random.default_rng(seed)
    chosen = draws[stream.integers(0, len(draws), sets)]
    return np.asarray(chosen + NOISE * stream.standard_normal(chosen.shape))


def cell_inputs(experiment: SweptExperiment, cells: Sequence[Cell]) -> tuple[FloatArray, int]:
    """Return the emulator's inputs (cells + designs, k), and how many of the k columns describe the design.

    The rows are the cells, then each design in any scene. A row has the varied parameters, each with mean 0 and variance
    1 over the designs, and an indicator for each scene, all 0 for any scene.
    """
    table = np.array([list(experiment.varied(design).values()) for design in range(len(experiment.designs))])
    spread = table.std(axis=0)
    standardised = (table - table.mean(axis=0)) / np.where(spread > 0, spread, 1.0)
    scene_columns: dict[str, int] = {}
    for cell in cells:
        if cell.scene is not None:
            scene_columns.setdefault(json.dumps(cell.scene), len(scene_columns))
    scenes = np.zeros((len(cells) + len(standardised), len(scene_columns)))
    for row, cell in enumerate(cells):
        if cell.scene is not None:
            scenes[row, scene_columns[json.dumps(cell.scene)]] = 1.0
    designs = np.vstack([standardised[[cell.design for cell in cells]], standardised])
    return np.hstack([designs, scenes]), standardised.shape[1]


def simulate_bank(
    simulator: Simulator,
    scores: FloatArray,
    observed: Observations,
    first: int,
    done: Callable[[int], None],
) -> Bank:
    """Simulate the sets of parameters that are the rows of ``scores`` (sets, parameters); set i has number ``first`` + i.

    Each set is simulated in at most MAX_CELLS cells of the trials, and with OTHERS designs of the family in any scene.
    ``done`` is called with numbers of finished runs. Failed simulations are left out.
    """
    experiment, stream = simulator.experiment, np.random.default_rng((simulator.seed, first))
    cells, cars = len(observed.cells), len(observed.car_design)
    runs: list[CalibrationRun] = []
    # For each run: number of the set, input row, car. The input rows are the trials' cells, then one for each design of
    # the family in any scene.
    run_keys: list[tuple[int, int, int]] = []
    cars_in_cell = [np.unique(observed.car[observed.cell == cell]) for cell in range(cells)]
    for index, values in enumerate(values_of(scores)):
        chosen = np.sort(stream.permutation(cells)[:MAX_CELLS])
        drives = [(int(cell), int(stream.choice(cars_in_cell[cell])), observed.cells[cell]) for cell in chosen]
        for other, design in enumerate(stream.integers(0, len(experiment.designs), OTHERS)):
            drives.append((cells + int(design), cars + other, Cell(int(design), None)))
        for input_row, car, cell in drives:
            scene = experiment.scenes[int(stream.integers(len(experiment.scenes)))] if cell.scene is None else cell.scene
            run_keys.append((first + index, input_row, car))
            # The numbers are seeds: a car keeps its deviations in all drives of a set; a drive has its own.
            car_number = (first + index) * (cars + OTHERS) + car
            drive_number = first * (MAX_CELLS + OTHERS) + len(runs)
            runs.append(CalibrationRun(cell.design, values, scene, car_number, drive_number))
    passed = simulator.passes(runs, done)
    computed = np.isfinite(passed)
    run_sets, input_rows, run_cars = np.array(run_keys, dtype=np.int64)[computed].T
    return Bank(scores[run_sets - first], run_sets, input_rows, run_cars, passed[computed])
