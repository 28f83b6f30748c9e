"""What a posterior predicts for trials: rates of designs, shares of trials, which further trials would tell most.

Input: a problem and draws of its posterior. Output: draws of rates, log scores (natural logarithms), expected information
in bits.
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import expit, logsumexp
from scipy.stats import binom

from foldcar.analysis.gaussian_process import can_be_smooth, success_model
from foldcar.calibration.effects import HEIGHT_KEYS
from foldcar.calibration.experiment import SweptExperiment
from foldcar.calibration.inference import Inference, Problem
from foldcar.calibration.parameters import NAMES, PARAMETERS, FloatArray
from foldcar.calibration.posterior import DISCREPANCY, IntArray

TRIALS = 10
# Heights relative to the environment's. Higher ones would ask the emulator for what it has seen little of.
HEIGHTS = (1.0, 0.85, 0.7)
MOST_DESIGNS = 12
DRAWS = 1000
# Groups of a parameter's values of which trials are to tell.
GROUPS = 5
_NODES, _WEIGHTS = np.polynomial.hermite_e.hermegauss(15)
_WEIGHTS = _WEIGHTS / _WEIGHTS.sum()


@dataclass(frozen=True, slots=True)
class NextTrials:
    """TRIALS trials of a further car of a design, by its index, with obstacles ``height`` times as high.

    ``bits`` is their mutual information with all parameters, ``parameter`` the one that they tell most about: the
    discrepancy if all parameters were measured.
    """

    design: int
    height: float
    bits: float
    parameter: str


@dataclass(frozen=True)
class Rates:
    """Rates of designs: ``simulated`` (checked,) as runs with the published draws counted them, smoothed over designs.

    Draws (n, checked): ``calibrated`` are the simulator's under the posterior, ``predicted`` those of built cars.
    """

    simulated: FloatArray
    calibrated: FloatArray
    predicted: FloatArray


def rates_of(inference: Inference, experiment: SweptExperiment, seed: int) -> Rates:
    """The rates of the checked designs; the emulator's are shifted (log-odds) to what was simulated."""
    problem, posterior, designs = inference.problem, inference.posterior, inference.designs
    simulated = _smooth(inference, experiment)
    cells = len(problem.observed.cells)
    logits = problem.emulator.logits(posterior.scores, problem.inputs[cells + designs])
    shifts = np.array([_shift(one[inference.chosen], rate) for one, rate in zip(logits.T, simulated, strict=True)])
    tau, stream = posterior.discrepancy, np.random.default_rng(seed)
    outcomes = problem.outcomes(posterior.scores, tau)
    offsets = np.empty_like(logits)
    for column, design in enumerate(designs.tolist()):
        mean, variance = problem.further(outcomes, tau, design)
        offsets[:, column] = mean + np.sqrt(variance) * stream.standard_normal(len(tau))
    return Rates(simulated, expit(logits + shifts), expit(logits + shifts + offsets))


def _smooth(inference: Inference, experiment: SweptExperiment) -> FloatArray:
    varied = list(experiment.info.varied)
    x = np.array([[float(experiment.designs[one].parameters[name]) for name in varied] for one in inference.designs])
    if can_be_smooth(x):
        return np.asarray(success_model(x, inference.passed, inference.counted).rates(x)[0])
    return (inference.passed + 0.5) / (inference.counted + 1)


def _shift(logits: FloatArray, rate: float) -> float:
    """What makes the mean rate of logits (n,) the rate, by bisection."""
    low, high = -12.0, 12.0
    for _ in range(40):
        middle = (low + high) / 2
        low, high = (middle, high) if expit(logits + middle).mean() < rate else (low, middle)
    return low


def count_chances(
    problem: Problem, offset: tuple[FloatArray, FloatArray], logits: FloatArray, counted: int
) -> FloatArray:
    """Log probabilities (n, counted + 1) of how many of ``counted`` trials of a further car pass.

    By its design's simulated logits (n,), and mean and variance (n,) of its discrepancy.
    """
    (mean, variance), own = offset, problem.emulator.car_sd**2
    at = problem.emulator.middle * logits + mean
    nodes = expit(at[:, None] + np.sqrt(variance + own)[:, None] * _NODES)
    return np.asarray(np.log(binom.pmf(np.arange(counted + 1)[:, None], counted, nodes[:, None]) @ _WEIGHTS + 1e-300))


def share_interval(chances: FloatArray, confidence: float) -> tuple[float, float]:
    """The central interval of the share that passes, by log probabilities (n, counted + 1) of counts."""
    cumulated = np.exp(chances).mean(axis=0).cumsum()
    low, high = np.searchsorted(cumulated, [(1 - confidence) / 2, (1 + confidence) / 2])
    return low / (len(cumulated) - 1), min(high, len(cumulated) - 1) / (len(cumulated) - 1)


def log_score(chances: FloatArray, passed: int) -> float:
    """The log probability that ``passed`` trials pass, averaged over draws, by log probabilities (n, counted + 1)."""
    return float(logsumexp(chances[:, passed]) - np.log(len(chances)))


def rank_next_trials(inference: Inference, experiment: SweptExperiment) -> list[NextTrials]:
    """Candidates by information, most first: designs with trials and others, evenly spaced over the family."""
    problem = inference.problem
    some = slice(None, None, max(1, len(inference.posterior.scores) // DRAWS))
    scores, tau = inference.posterior.scores[some], inference.posterior.discrepancy[some]
    spaced = np.linspace(0, len(experiment.designs) - 1, min(MOST_DESIGNS, len(experiment.designs))).round().astype(int)
    designs: IntArray = np.union1d(spaced, problem.observed.car_design)
    outcomes = problem.outcomes(scores, tau)
    offsets = [problem.further(outcomes, tau, design) for design in designs.tolist()]
    found = []
    for height in HEIGHTS if _has_obstacles(experiment) else HEIGHTS[:1]:
        lowered = scores.copy()
        column = NAMES.index("obstacle_height")
        lowered[:, column] += np.log(height) / PARAMETERS[column].sd
        logits = problem.emulator.logits(lowered, problem.inputs[len(problem.observed.cells) + designs])
        for design, offset, one in zip(designs.tolist(), offsets, logits.T, strict=True):
            bits, alone = expected_bits(count_chances(problem, offset, one, TRIALS), scores)
            # The draws of a measured parameter are equal, and their groups differ by chance only.
            most = max(problem.free, key=lambda index: alone[index], default=None)
            found.append(NextTrials(design, height, bits, DISCREPANCY.name if most is None else NAMES[most]))
    return sorted(found, key=lambda one: -one.bits)


def _has_obstacles(experiment: SweptExperiment) -> bool:
    return any(key in piece for scene in experiment.scenes for piece in scene["terrain"] for key in HEIGHT_KEYS)


def expected_bits(chances: FloatArray, scores: FloatArray) -> tuple[float, FloatArray]:
    """Mutual information (bits) of a count with all parameters, and with each: log probabilities (n, counts) by draw.

    ``scores`` (n, parameters) of the draws.
    """
    probabilities = np.exp(chances)
    groups = [np.array_split(np.argsort(column, kind="stable"), GROUPS) for column in scores.T]
    alone = [_information(np.stack([probabilities[one].mean(axis=0) for one in some])) for some in groups]
    return _information(probabilities), np.array(alone)


def _information(probabilities: FloatArray) -> float:
    """Mutual information (bits) of an outcome with the row, all rows equally likely."""

    def entropy(p: FloatArray) -> FloatArray:
        return np.asarray(-(p * np.log2(np.maximum(p, 1e-300))).sum(axis=-1))

    return max(0.0, float(entropy(probabilities.mean(axis=0)) - entropy(probabilities).mean()))
