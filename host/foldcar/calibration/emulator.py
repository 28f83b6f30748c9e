"""An emulator of the simulator: the probability that a design passes, as a smooth function of parameters and design.

Input: runs with their scores, the features of their designs and whether they passed; each run has a scene and a scatter
of its own, so that one run for each set of parameters is enough. Output: success logits.

The function is the mean of small neural networks (scikit-learn), fitted by the likelihood of single runs. On runs that it
had not seen it was closer to simulated rates than quadratic and cubic logistic regression and boosted trees.
"""

import warnings
from dataclasses import dataclass

import numpy as np
from threadpoolctl import threadpool_limits

from foldcar.calibration.parameters import FloatArray

NETWORKS = 3
HIDDEN = (32, 32)
PENALTY = 0.1
EPOCHS = 60
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
        for layers in self.networks:
            (first, bias), *others = layers
            # The first layer's sum is taken apart into parameters and design.
            hidden = (scores @ first[:parameters])[:, None] + (features @ first[parameters:] + bias)[None]
            for weights, bias in others:
                hidden = np.tanh(hidden) @ weights + bias
            total += hidden[..., 0]
        return np.clip(total / len(self.networks), -LARGEST_LOGIT, LARGEST_LOGIT)


def fit(scores: FloatArray, features: FloatArray, passed: FloatArray, seed: int) -> Emulator:
    """The emulator of runs: scores (runs, parameters), features (runs, features), passed (runs,) as 0 and 1."""
    from sklearn.exceptions import ConvergenceWarning
    from sklearn.neural_network import MLPClassifier

    inputs = np.hstack([scores, features])
    networks = []
    # The sums of several threads would depend on their number.
    with threadpool_limits(1), warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)
        for number in range(NETWORKS):
            network = MLPClassifier(
                HIDDEN, activation="tanh", alpha=PENALTY, learning_rate_init=3e-3, batch_size=min(256, len(inputs)),
                max_iter=EPOCHS, random_state=seed * NETWORKS + number,
            ).fit(inputs, passed)  # fmt: skip
            networks.append(tuple(zip(network.coefs_, network.intercepts_, strict=True)))
    return Emulator(tuple(networks))
