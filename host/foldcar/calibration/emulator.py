"""An emulator of the simulator: the probability that a design passes, as a smooth function of parameters and design.

It learns from a Bank of runs: sets of parameters, drawn from the prior and then from a first posterior, each simulated
once with every design that has trials, and with two random designs of the family, which predict what other trials would
tell. Each run has a scene and a scatter of its own, so that one run for each set of parameters is enough.

The function is the mean of small neural networks (scikit-learn), fitted by the likelihood of single runs. Learning from
24,000 runs of the width study under random parameters, it was 6 points off rates simulated apart (root mean square),
boosted trees 7, quadratic logistic regression and random Fourier features 8. Rates from 12 runs each, for 500 sets of
parameters the same effort, are 9 points off.
"""

import warnings
from collections.abc import Callable
from dataclasses import dataclass, fields

import numpy as np
from scipy.special import expit, logit, ndtri
from scipy.stats import qmc
from threadpoolctl import threadpool_limits

from foldcar.calibration.experiment import CalibrationRun, Simulator, SweptExperiment
from foldcar.calibration.parameters import PARAMETERS, FloatArray, values_of
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
# Designs of the family that each set of parameters is simulated with, beside those with trials.
OTHERS = 2
# The first sets are spread wider than the prior, so that the emulator does not extrapolate at its edges.
WIDER = 1.2
# The second ones are draws of the first posterior, with noise.
NOISE = 0.4


@dataclass(frozen=True)
class Emulator:
    """Weights and biases of each network's layers; made by :func:`fit`."""

    networks: tuple[tuple[tuple[FloatArray, FloatArray], ...], ...]

    def logits(self, scores: FloatArray, features: FloatArray) -> FloatArray:
        """Success logits (n, designs) of scores (n, parameters) and designs' features (designs, features)."""
        total = np.zeros((len(scores), len(features)))
        parameters = scores.shape[1]
        with threadpool_limits(1):
            for (first, bias), *others in self.networks:
                # The first layer's sum is taken apart into parameters and design.
                hidden = (scores @ first[:parameters])[:, None] + (features @ first[parameters:] + bias)[None]
                for weights, shift in others:
                    hidden = np.tanh(hidden) @ weights + shift
                total += expit(hidden[..., 0])
        return np.asarray(np.clip(logit(total / len(self.networks)), -LARGEST_LOGIT, LARGEST_LOGIT))


def fit(scores: FloatArray, features: FloatArray, passed: FloatArray, seed: int) -> Emulator:
    """The emulator of runs: scores (runs, parameters), features (runs, features), passed (runs,) as 0 and 1."""
    from sklearn.exceptions import ConvergenceWarning
    from sklearn.neural_network import MLPClassifier

    inputs, runs = np.hstack([scores, features]), len(scores)
    networks = []
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
            ).fit(inputs, passed)
            networks.append(tuple(zip(network.coefs_, network.intercepts_, strict=True)))
    return Emulator(tuple(networks))


IntArray = np.ndarray[tuple[int], np.dtype[np.int64]]


@dataclass(frozen=True)
class Bank:
    """Runs: ``scores`` (runs, parameters), ``designs`` (runs,) indices, ``passed`` (runs,) 0 and 1."""

    scores: FloatArray
    designs: IntArray
    passed: FloatArray

    def joined(self, other: "Bank") -> "Bank":
        """The runs of both."""
        return Bank(*(np.concatenate([getattr(one, field.name) for one in (self, other)]) for field in fields(self)))

    def emulator(self, features: FloatArray, seed: int) -> Emulator:
        """The emulator of these runs; ``features`` (designs, features) are of all designs. FoldcarError."""
        if len(np.unique(self.passed)) < 2:
            how = "pass" if self.passed.any() else "fail"
            raise FoldcarError(
                f"all {len(self.passed)} simulations of the designs with trials {how}, whatever the parameters: "
                "nothing can be inferred; check the listing and the designs"
            )
        return fit(self.scores, features[self.designs], self.passed, seed)


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


def simulate_bank(
    simulator: Simulator, scores: FloatArray, designs: tuple[int, ...], first: int, done: Callable[[int], None]
) -> Bank:
    """Simulate each row of ``scores`` with each of ``designs`` and with others; scatter begins at number ``first``."""
    family, scenes = len(simulator.experiment.designs), len(simulator.experiment.scenes)
    others = np.random.default_rng((simulator.seed, first)).integers(0, family, (len(scores), OTHERS))
    values = values_of(scores)
    rows = [(j, int(design)) for j in range(len(scores)) for design in (*designs, *others[j])]
    runs = (CalibrationRun(design, values[j], (first + j) % scenes, first + j) for j, design in rows)
    results = simulator.passed(runs, done)
    told = [i for i, result in enumerate(results) if result is not None]
    return Bank(
        scores[[rows[i][0] for i in told]],
        np.array([rows[i][1] for i in told], dtype=np.int64),
        np.array([float(bool(results[i])) for i in told]),
    )


def features_of(experiment: SweptExperiment) -> FloatArray:
    """The varied parameters of all designs (designs, features), each with mean 0 and variance 1."""
    varied = list(experiment.info.varied)
    table = np.array([[float(design.parameters[name]) for name in varied] for design in experiment.designs])
    spread = table.std(axis=0)
    return np.asarray((table - table.mean(axis=0)) / np.where(spread > 0, spread, 1.0))
