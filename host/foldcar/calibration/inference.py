"""A calibration from trials: simulated runs, their emulator, the posterior, a simulated check of it.

Input: trials counted, a simulator of their experiment. Output: an Inference. The same input, number of runs and seed give
the same numbers, on any number of processes.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType

import numpy as np

from foldcar.calibration.emulator import (
    OTHERS,
    Emulator,
    IntArray,
    features_of,
    near_scores,
    prior_scores,
    simulate_bank,
)
from foldcar.calibration.experiment import CalibrationRun, Simulator, TrialCounts
from foldcar.calibration.parameters import PARAMETERS, FloatArray, values_of
from foldcar.calibration.posterior import Posterior, sample_posterior

# Shares of the runs: from the prior, from the first posterior; the rest checks the result.
FIRST, SECOND = 0.55, 0.3

# The published draws; fewer runs than LEAST_RUNS teach nothing.
DRAWS = 100
LEAST_RUNS = 500  # as `foldcar calibrate` says


@dataclass(frozen=True)
class Inference:
    """Everything a summary is made of. ``logits`` (n, designs with trials) are those under the posterior's draws.

    ``chosen`` are the indices of the published draws, ``checked`` their simulated success rates (designs with trials,),
    each from ``check_runs`` runs. ``features`` (designs, features) are the emulator's. ``known`` maps the indices of
    parameters that were measured to their scores.
    """

    counts: TrialCounts
    emulator: Emulator
    features: FloatArray
    posterior: Posterior
    logits: FloatArray
    chosen: IntArray
    checked: FloatArray
    check_runs: int
    known: Mapping[int, float] = field(default_factory=dict)

    @property
    def draws(self) -> list[dict[str, float]]:
        """The published draws by name."""
        return values_of(self.posterior.scores[self.chosen])


@dataclass(frozen=True, slots=True)
class Plan:
    """How many sets of parameters are drawn from the prior and around the first posterior, and scenes for each check."""

    first: int
    second: int
    scenes: int
    runs: int


def plan(runs: int, designs: int) -> Plan:
    """About ``runs`` simulated runs for ``designs`` designs with trials; at least LEAST_RUNS."""
    runs = max(LEAST_RUNS, runs)
    each = designs + OTHERS
    first, second = int(FIRST * runs / each), int(SECOND * runs / each)
    scenes = max(1, int((1 - FIRST - SECOND) * runs / (DRAWS * designs)))
    return Plan(first, second, scenes, each * (first + second) + DRAWS * designs * scenes)


def infer(
    simulator: Simulator,
    counts: TrialCounts,
    runs: int,
    done: Callable[[int], None] = lambda runs: None,
    known: Mapping[int, float] = MappingProxyType({}),
) -> Inference:
    """Infer the parameters but for ``known`` ones; ``done`` is told of finished runs, Plan.runs in all. FoldcarError."""
    seed, features = simulator.seed, features_of(simulator.experiment)
    planned = plan(runs, len(counts.designs))
    bank = simulate_bank(simulator, prior_scores(planned.first, seed), counts.designs, 0, done)
    first = posterior_of(bank.emulator(features, seed), features, counts, seed, known)
    near = near_scores(first.scores, planned.second, seed)
    bank = bank.joined(simulate_bank(simulator, near, counts.designs, planned.first, done))
    emulator = bank.emulator(features, seed)
    posterior = posterior_of(emulator, features, counts, seed, known)
    chosen = np.random.default_rng(seed).choice(len(posterior.scores), DRAWS, replace=False)
    # Each of the published draws in scenes of its own.
    drawn = [values for values in values_of(posterior.scores[chosen]) for _ in range(planned.scenes)]
    scenes, sets = len(simulator.experiment.scenes), planned.first + planned.second
    check = (
        CalibrationRun(design, values, number % scenes, sets + number)
        for number, values in enumerate(drawn)
        for design in counts.designs
    )
    results = simulator.passed(check, done)
    table = np.array([np.nan if one is None else float(one) for one in results])
    checked = np.nanmean(table.reshape(DRAWS, planned.scenes, len(counts.designs)), axis=(0, 1))
    logits = emulator.logits(posterior.scores, features[list(counts.designs)])
    return Inference(counts, emulator, features, posterior, logits, chosen, checked, planned.scenes * DRAWS, dict(known))


def posterior_of(
    emulator: Emulator, features: FloatArray, counts: TrialCounts, seed: int, known: Mapping[int, float]
) -> Posterior:
    """The posterior given these trials and the scores of ``known`` parameters."""
    wanted = features[list(counts.designs)]
    passed, counted = np.array(counts.passed, dtype=float), np.array(counts.counted, dtype=float)

    def pinned(scores: FloatArray) -> FloatArray:
        scores = scores.copy()
        for index, score in known.items():
            scores[:, index] = score
        return scores

    found = sample_posterior(
        lambda scores: emulator.logits(pinned(scores), wanted), len(PARAMETERS), passed, counted, seed
    )
    return replace(found, scores=pinned(found.scores))
