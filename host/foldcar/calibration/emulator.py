"""An emulator of the simulator: the probability that a design passes, as a smooth function of parameters and design.

Input: runs with their scores, the features of their designs and whether they passed; each run has a scene and a scatter
of its own, so that one run for each set of parameters is enough. Output: success logits.

The function is the mean of small neural networks (scikit-learn), fitted by the likelihood of single runs. Learning from
24,000 runs of the width study under random parameters, it was 6 points off rates simulated apart (root mean square),
boosted trees 7, quadratic logistic regression and random Fourier features 8. Rates from 12 runs each, for 500 sets of
parameters the same effort, are 9 points off.
"""

import warnings
from dataclasses import dataclass

import numpy as np
from scipy.special import expit, logit
from threadpoolctl import threadpool_limits

from foldcar.calibration.parameters import FloatArray

NETWORKS = 4
HIDDEN = (64, 64)
BATCH = 256
# Steps of the fit: more of them fit the single runs' noise.
STEPS, MOST_EPOCHS = 2400, 100
# The prior on weights, against that many runs.
PENALTY_RUNS, PENALTY_LIMITS = 2400.0, (0.05, 0.5)
# No simulation tells a probability closer to 0 or 1 than this logit: 1 in 400.
LARGEST_LOGIT = 6.0


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
