"""Which further trials would tell the parameters apart: expected information over designs and heights of obstacles."""

from dataclasses import dataclass

import numpy as np

from foldcar.calibration.effects import HEIGHT_KEYS
from foldcar.calibration.experiment import SweptExperiment
from foldcar.calibration.inference import Inference
from foldcar.calibration.parameters import NAMES, PARAMETERS
from foldcar.calibration.predictions import expected_bits

TRIALS = 10
# Heights relative to the environment's. Higher ones would ask the emulator for what it has seen little of.
HEIGHTS = (1.0, 0.85, 0.7)
MOST_DESIGNS = 12
DRAWS = 1000


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
