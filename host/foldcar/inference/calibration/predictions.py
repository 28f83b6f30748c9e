"""What a posterior predicts for trials: rates of designs, shares of trials, which further trials would tell most.

Input: a problem and draws of its posterior. Output: draws of rates, log scores (natural logarithms), expected information
in bits.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq
from scipy.special import expit, logsumexp
from scipy.stats import binom, entropy

from foldcar.inference.calibration.effects import HEIGHT_KEYS
from foldcar.inference.calibration.experiment import SweptExperiment
from foldcar.inference.calibration.inference import Inference, Problem
from foldcar.inference.calibration.parameters import NAMES, PARAMETERS, FloatArray
from foldcar.inference.calibration.posterior import DISCREPANCY, IntArray, Posterior
from foldcar.statistics.smoothed_simulation import smoothed_simulation

TRIALS = 10
# Heights relative to the environment's. Higher ones would ask the emulator for what it has seen little of.
HEIGHTS = (1.0, 0.85, 0.7)
MOST_DESIGNS = 12
# Groups of a parameter's values of which trials are to tell.
GROUPS = 5
_NODES, _WEIGHTS = np.polynomial.hermite_e.hermegauss(15)
_WEIGHTS = _WEIGHTS / _WEIGHTS.sum()


@dataclass(frozen=True)
class Rates:
    """Rates of designs: ``simulated`` (checked,) as runs with the published draws counted them, smoothed over designs.

    Draws (n, checked): ``calibrated`` are the simulator's under the posterior, ``predicted`` those of built cars.
    ``shifts`` (checked,) are the emulator's errors, to be added to its log-odds, ``variances`` (checked,) what is left of
    them: few runs counted them. ``emulator_error`` is the largest in the rate of a design with trials, beyond chance.
    """

    simulated: FloatArray
    calibrated: FloatArray
    predicted: FloatArray
    shifts: FloatArray
    variances: FloatArray
    emulator_error: float

    def errors(self, designs: IntArray) -> dict[int, tuple[float, float]]:
        """Shift and variance by the index of the checked ``designs``."""
        return dict(zip(designs.tolist(), zip(self.shifts.tolist(), self.variances.tolist(), strict=True), strict=True))


def rates_of(inference: Inference, experiment: SweptExperiment, seed: int) -> Rates:
    """Predict the rates of the checked designs; the emulator's log-odds are shifted to those that were simulated."""
    problem, posterior, designs = inference.problem, inference.posterior, inference.designs
    runs = np.column_stack([np.nansum(inference.table, axis=0), np.isfinite(inference.table).sum(axis=0)])
    varied = [list(experiment.varied(design).values()) for design in designs.tolist()]
    simulated = smoothed_simulation(np.array(varied), runs, inference.table.T)
    rates, logits = expit(simulated.mean), problem.logits(posterior.scores, designs)
    shifts = np.array([_shift(*pair) for pair in zip(logits[inference.chosen].T, rates, strict=True)])
    mean, variance = problem.offsets(posterior.scores, posterior.discrepancy, designs)
    beyond = abs(expit(logits).mean(axis=0) - rates) - np.sqrt(simulated.variance) * rates * (1 - rates)
    error = max(0.0, float(beyond[np.isin(designs, problem.observed.car_design)].max()))
    stream = np.random.default_rng(seed)
    offsets = mean + np.sqrt(variance) * stream.standard_normal(mean.shape)
    errors = stream.standard_normal((len(mean), simulated.columns.shape[1])) @ simulated.columns.T
    logits = logits + shifts + errors + np.sqrt(simulated.rest) * stream.standard_normal(mean.shape)
    return Rates(rates, expit(logits), expit(logits + offsets), shifts, simulated.variance, error)


def _shift(logits: FloatArray, rate: float) -> float:
    """What, added to logits (n,), makes their mean rate the ``rate``."""
    return float(brentq(lambda shift: expit(logits + shift).mean() - rate, -30, 30))


def trial_chances(
    problem: Problem, posterior: Posterior, counts: Mapping[int, int], errors: Mapping[int, tuple[float, float]]
) -> dict[int, FloatArray]:
    """Log probabilities (n, trials + 1) of how many trials of a further car pass, by a design's number of trials.

    ``errors`` are the emulator's shifts and variances, as in Rates, by the design's index.
    """
    designs = np.array(list(counts))
    means, variances = problem.offsets(posterior.scores, posterior.discrepancy, designs)
    logits, chances = problem.logits(posterior.scores, designs), {}
    for i, (design, counted) in enumerate(counts.items()):
        shift, variance = errors[design]
        chances[design] = count_chances(problem, logits[:, i] + shift, means[:, i], variances[:, i] + variance, counted)
    return chances


def count_chances(
    problem: Problem, logits: FloatArray, mean: FloatArray, variance: FloatArray, counted: int
) -> FloatArray:
    """Log probabilities (n, counted + 1) of how many of ``counted`` trials of a further car pass.

    By its design's simulated logits (n,), and mean and variance (n,) of its discrepancy.
    """
    spread = np.sqrt(variance + problem.emulator.car_sd**2)
    nodes = expit((problem.emulator.middle * logits + mean)[:, None] + spread[:, None] * _NODES)
    return np.asarray(np.log(binom.pmf(np.arange(counted + 1)[:, None], counted, nodes[:, None]) @ _WEIGHTS + 1e-300))


def share_interval(chances: FloatArray, confidence: float) -> tuple[float, float]:
    """The central interval of the share that passes, by log probabilities (n, counted + 1) of counts."""
    cumulated = np.exp(chances).mean(axis=0).cumsum()
    low, high = np.searchsorted(cumulated, [(1 - confidence) / 2, (1 + confidence) / 2])
    return low / (len(cumulated) - 1), min(high, len(cumulated) - 1) / (len(cumulated) - 1)


def log_score(chances: FloatArray, passed: int) -> float:
    """The log probability that ``passed`` trials pass, averaged over draws, by log probabilities (n, counted + 1)."""
    return float(logsumexp(chances[:, passed]) - np.log(len(chances)))


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


def rank_next_trials(inference: Inference, experiment: SweptExperiment) -> list[NextTrials]:
    """Candidates by information, most first: designs with trials and others, evenly spaced over the family."""
    problem, scores, tau = inference.problem, inference.posterior.scores, inference.posterior.discrepancy
    spaced = np.linspace(0, len(experiment.designs) - 1, min(MOST_DESIGNS, len(experiment.designs))).round().astype(int)
    designs: IntArray = np.union1d(spaced, problem.observed.car_design)
    means, variances = problem.offsets(scores, tau, designs)
    column, ranked = NAMES.index("obstacle_height"), []
    pieces = [piece for scene in experiment.scenes for piece in scene["terrain"]]
    for height in HEIGHTS if any(key in piece for piece in pieces for key in HEIGHT_KEYS) else HEIGHTS[:1]:
        lowered = scores.copy()
        lowered[:, column] += np.log(height) / PARAMETERS[column].sd
        logits = problem.logits(lowered, designs)
        for i, design in enumerate(designs.tolist()):
            chances = count_chances(problem, logits[:, i], means[:, i], variances[:, i], TRIALS)
            bits, alone = expected_bits(chances, scores)
            # The draws of a measured parameter are equal, and their groups differ by chance only.
            most = max(problem.free, key=lambda index: alone[index], default=None)
            ranked.append(NextTrials(design, height, bits, DISCREPANCY.name if most is None else NAMES[most]))
    return sorted(ranked, key=lambda trials: -trials.bits)


def expected_bits(chances: FloatArray, scores: FloatArray) -> tuple[float, FloatArray]:
    """Mutual information (bits) of a count with all parameters, and with each: log probabilities (n, counts) by draw.

    ``scores`` (n, parameters) of the draws.
    """
    probabilities = np.exp(chances)
    groups = [np.array_split(np.argsort(column, kind="stable"), GROUPS) for column in scores.T]
    alone = [_information(np.stack([probabilities[rows].mean(axis=0) for rows in of_one])) for of_one in groups]
    return _information(probabilities), np.array(alone)


def _information(probabilities: FloatArray) -> float:
    """Mutual information (bits) of an outcome with the row, all rows equally likely."""
    return max(0.0, float(entropy(probabilities.mean(axis=0), base=2) - entropy(probabilities, base=2, axis=1).mean()))
