"""The runs that the emulator learns from: sets of parameters, drawn from the prior and then from a first posterior.

Input: a simulator, the designs with trials, a number of runs. Output: a Bank of runs with their results. Each set of
parameters is simulated once with every design that has trials, and with two random designs of the family, which predict
what other trials would tell.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.special import ndtri
from scipy.stats import qmc

from foldcar.calibration.emulator import Emulator, fit
from foldcar.calibration.experiment import SweptExperiment
from foldcar.calibration.parameters import PARAMETERS, FloatArray, values_of
from foldcar.calibration.simulation import CalibrationRun, Simulator
from foldcar.errors import FoldcarError

OTHERS = 2
# The first sets are spread wider than the prior, so that the emulator does not extrapolate at its edges.
WIDER = 1.2
# The second ones are draws of the first posterior, with noise.
NOISE = 0.4

IntArray = np.ndarray[tuple[int], np.dtype[np.int64]]


@dataclass(frozen=True)
class Bank:
    """Runs: ``scores`` (runs, parameters), ``designs`` (runs,) indices, ``passed`` (runs,) 0 and 1."""

    scores: FloatArray
    designs: IntArray
    passed: FloatArray

    def joined(self, other: "Bank") -> "Bank":
        """The runs of both."""
        return Bank(
            np.vstack([self.scores, other.scores]),
            np.concatenate([self.designs, other.designs]),
            np.concatenate([self.passed, other.passed]),
        )

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
