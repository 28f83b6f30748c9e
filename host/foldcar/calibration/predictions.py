"""What a posterior predicts for trials: shares of trials, scores of held-out ones, which further trials would tell most.

Input: success logits of designs under draws of the posterior (n, designs), discrepancies' sd τ (n). Output: intervals,
log scores (natural logarithms) and expected information in bits.
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import expit, logsumexp

from foldcar.calibration.effects import HEIGHT_KEYS
from foldcar.calibration.experiment import SweptExperiment
from foldcar.calibration.inference import Inference
from foldcar.calibration.parameters import NAMES, PARAMETERS, FloatArray
from foldcar.calibration.posterior import built_logits, log_likelihood, log_ways

TRIALS = 10
# Heights relative to the environment's. Higher ones would ask the emulator for what it has seen little of.
HEIGHTS = (1.0, 0.85, 0.7)
MOST_DESIGNS = 12
DRAWS = 1000
# Groups of a parameter's values of which trials are to tell.
GROUPS = 5


@dataclass(frozen=True, slots=True)
class NextTrials:
    """TRIALS trials of a design, by its index, with obstacles ``height`` times as high: what they are expected to tell.

    ``bits`` is their mutual information with all parameters, ``parameter`` the one that they tell most about.
    """

    design: int
    height: float
    bits: float
    parameter: str


def rank_next_trials(inference: Inference, experiment: SweptExperiment) -> list[NextTrials]:
    """Candidates by information, most first: designs with trials and others, evenly spaced over the family."""
    counts, posterior = inference.counts, inference.posterior
    some = slice(None, None, max(1, len(posterior.scores) // DRAWS))
    scores, tau = posterior.scores[some], posterior.discrepancy[some]
    spaced = np.linspace(0, len(experiment.designs) - 1, min(MOST_DESIGNS, len(experiment.designs))).round().astype(int)
    done = {d: (k, n) for d, k, n in zip(counts.designs, counts.passed, counts.counted, strict=True)}
    designs = sorted({*map(int, spaced), *counts.designs})
    found = []
    for height in HEIGHTS if _has_obstacles(experiment) else HEIGHTS[:1]:
        lowered = scores.copy()
        column = NAMES.index("obstacle_height")
        lowered[:, column] += np.log(height) / PARAMETERS[column].sd
        logits = inference.emulator.logits(lowered, inference.features[designs])
        for index, design in enumerate(designs):
            before = done.get(design, (0, 0)) if height == 1 else (0, 0)
            bits, alone = expected_bits(logits[:, index], tau, before, TRIALS, scores)
            found.append(NextTrials(design, height, bits, NAMES[int(np.argmax(alone))]))
    return sorted(found, key=lambda one: -one.bits)


def _has_obstacles(experiment: SweptExperiment) -> bool:
    return any(key in piece for scene in experiment.scenes for piece in scene["terrain"] for key in HEIGHT_KEYS)


def predicted_shares(logit: FloatArray, tau: FloatArray, counted: int, stream: np.random.Generator) -> FloatArray:
    """Draws (n,) of the share that passes of ``counted`` trials of another car of a design, by its logits (n,)."""
    none = np.zeros(1)
    built = built_logits(logit[:, None], tau, none, none, stream)[:, 0]
    return np.asarray(stream.binomial(counted, expit(built)) / counted)


def interval(values: FloatArray, confidence: float) -> tuple[float, float]:
    """The central interval of draws."""
    low, high = np.quantile(values, [(1 - confidence) / 2, (1 + confidence) / 2])
    return float(low), float(high)


def log_score(logit: FloatArray, tau: FloatArray, passed: int, counted: int) -> float:
    """The log probability of ``passed`` of ``counted`` trials of a design, averaged over draws (n,)."""
    found = log_likelihood(logit[:, None], tau, np.full(1, float(passed)), np.full(1, float(counted)))
    return float(logsumexp(found) - np.log(len(found)))


def expected_bits(
    logit: FloatArray, tau: FloatArray, done: tuple[int, int], more: int, scores: FloatArray
) -> tuple[float, FloatArray]:
    """Mutual information (bits) of how many of ``more`` trials of a design pass with all parameters, and with each.

    ``done`` is how many of how many trials passed before, of the same car; ``scores`` (n, parameters).
    """
    probabilities = np.exp(_counts_to_come(logit, tau, done, more))
    groups = [np.array_split(np.argsort(column, kind="stable"), GROUPS) for column in scores.T]
    alone = [_information(np.stack([probabilities[one].mean(axis=0) for one in some])) for some in groups]
    return _information(probabilities), np.array(alone)


def _counts_to_come(logit: FloatArray, tau: FloatArray, done: tuple[int, int], more: int) -> FloatArray:
    """Log probabilities (n, more + 1) of each count, given the trials done: joint over conditional."""
    passed, counted = (np.array([float(one)]) for one in done)
    counts = np.arange(more + 1.0)
    before = log_likelihood(logit[:, None], tau, passed, counted)
    together = log_likelihood(np.repeat(logit[:, None], more + 1, 1), tau, passed + counts, counted + more)
    # Ways to order the trials: those of the joint count, taken apart into before and after.
    ways = log_ways(passed, counted) + log_ways(counts, more) - log_ways(passed + counts, counted + more)
    return np.asarray(together - before + ways)


def _information(probabilities: FloatArray) -> float:
    """Mutual information (bits) of an outcome with the row, all rows equally likely."""

    def entropy(p: FloatArray) -> FloatArray:
        return np.asarray(-(p * np.log2(np.maximum(p, 1e-300))).sum(axis=-1))

    return max(0.0, float(entropy(probabilities.mean(axis=0)) - entropy(probabilities).mean()))
