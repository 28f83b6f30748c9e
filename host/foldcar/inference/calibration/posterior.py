"""Draws of the parameters from their posterior, given trials of built cars and an emulator of the simulator.

Model of outcomes: car c of design d passes in scene s with probability logistic(l_ds(θ) + e_c). l_ds(θ) is the
simulator's. e_c are normal: each car has a part of its own, with the standard deviation that simulated cars have, and
shares with the other cars of its design, and in parts with cars of like designs and with all cars, a discrepancy with
standard deviation τ, which is what no parameter explains. The e_c are integrated out by Laplace's method (Rasmussen and
Williams 2006, algorithm 3.1).

Model of features of a path: normal about the simulator's mean, with the covariance that simulated runs have. A part of
it is the car's, the same in all its drives, and here, too, a discrepancy is added: of each family of features κ times as
large as the scatter of runs (:class:`Features`). τ and all κ are inferred, so that a misfit widens the posterior rather
than biases it, and what the simulator has wrong in one family does not spoil the others.

Draws are made by sequential Monte Carlo with tempering (Chopin and Papaspiliopoulos 2020, chapter 17) and preconditioned
Crank-Nicolson moves, which leave the normal prior of the scores as it is.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.linalg import eigh
from scipy.optimize import brentq
from scipy.special import logsumexp

from foldcar.inference.calibration.drive_features import FAMILY_NAMES, FAMILY_OF
from foldcar.inference.calibration.parameters import FloatArray, Parameter
from foldcar.statistics.gaussian_process import Factors, binomial, laplace

DISCREPANCY = Parameter(
    "discrepancy", "logit", "half-normal", 0.0, 0.7, 0.0,
    "what separates built cars of a design from the best simulation of it, one sd",
    "0.7 is 17 points at 50 %: two simulators of these cars differ by 18 points",
)  # fmt: skip
PATH_DISCREPANCY = Parameter(
    "path_discrepancy", "×", "half-normal", 0.0, 1.0, 0.0,
    "what separates paths of built cars of a design from simulated ones, one sd, relative to the scatter of runs",
    "1: two simulators' paths of these cars differ by about half their scatter, in one family by as much as it",
)  # fmt: skip
PARTICLES = 1000
MOVES = 12
# Share of the particles that a step of the temperature leaves effective.
EFFECTIVE = 0.5
ACCEPTED = 0.3
# Added to variances, so that a covariance without a car's own part has a root.
JITTER = 1e-9
# A feature farther off than this many standard deviations says no more than one at them.
FARTHEST = 4.0

IntArray = np.ndarray[tuple[int], np.dtype[np.int64]]
# The log-likelihood (n,) of scores (n, parameters) with discrepancies τ (n,) and κ (n, families).
Likelihood = Callable[[FloatArray, FloatArray, FloatArray], FloatArray]


@dataclass(frozen=True, slots=True)
class Posterior:
    """Equally likely draws: ``scores`` (n, parameters), τ (n), κ (n, families), ``log_likelihood`` (n)."""

    scores: FloatArray
    discrepancy: FloatArray
    path_discrepancy: FloatArray
    log_likelihood: FloatArray


def sample_posterior(likelihood: Likelihood, parameters: int, seed: int, particles: int = PARTICLES) -> Posterior:
    """Draws of the posterior of scores, standard normal before, and of the discrepancies."""
    stream = np.random.default_rng(seed)

    def of(latent: FloatArray) -> FloatArray:
        tau, kappa = _discrepancies(latent[:, parameters:])
        return likelihood(latent[:, :parameters], tau, kappa)

    latent = stream.standard_normal((particles, parameters + 1 + len(FAMILY_NAMES)))
    found = of(latent)
    temperature, size = 0.0, 0.5
    while temperature < 1:
        step = _next_step(found, 1 - temperature)
        weights = step * found
        kept = _resampled(np.exp(weights - logsumexp(weights)), stream)
        latent, found = latent[kept], found[kept]
        temperature = min(1.0, temperature + step)
        for _ in range(MOVES):
            moved = np.sqrt(1 - size**2) * latent + size * stream.standard_normal(latent.shape)
            there = of(moved)
            taken = np.log(stream.random(particles)) < temperature * (there - found)
            latent[taken], found[taken] = moved[taken], there[taken]
            size = float(np.clip(size * np.exp(taken.mean() - ACCEPTED), 0.02, 0.95))
    return Posterior(latent[:, :parameters], *_discrepancies(latent[:, parameters:]), found)


def _discrepancies(latent: FloatArray) -> tuple[FloatArray, FloatArray]:
    tau, kappa = DISCREPANCY.value(latent[:, 0]), PATH_DISCREPANCY.value(latent[:, 1:])
    return np.asarray(tau), np.asarray(kappa)


@dataclass(frozen=True, slots=True)
class Outcomes:
    """Laplace's approximation of cars' offsets e = ``root`` f for draws (n,), with factors f that are standard normal.

    ``root`` (n, cars, cars) is the Cholesky factor of the offsets' covariance before the trials.
    """

    root: FloatArray
    factors: Factors

    @property
    def evidence(self) -> FloatArray:
        """The log evidence (n,) of the outcomes, without the binomial coefficients."""
        return np.asarray(self.factors.evidence)

    def further(self, cross: FloatArray, variance: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Mean and variance (n,) of another car's offset, by its covariances ``cross`` (n, cars), and its own before."""
        loads = np.linalg.solve(self.root, cross[..., None])[..., 0]
        known = (loads**2).sum(axis=1) - (np.einsum("nc,ncd->nd", loads, self.factors.root) ** 2).sum(axis=1)
        return (loads * self.factors.mode).sum(axis=1), np.maximum(variance - known, 0)


def outcomes(
    logits: FloatArray, passed: FloatArray, counted: FloatArray, car: IntArray, covariance: FloatArray
) -> Outcomes:
    """Infer cars' offsets from groups of trials: ``passed`` of ``counted`` (groups,), each of one ``car`` in one cell.

    ``logits`` (n, groups) are simulated, ``covariance`` (n, cars, cars) is that of the offsets before the trials.
    """
    root = np.linalg.cholesky(covariance + JITTER * np.eye(covariance.shape[1]))
    # Steps that are too long may overflow before they are halved.
    with np.errstate(over="ignore"):
        return Outcomes(np.asarray(root), laplace(root[:, car], logits, binomial(passed, counted)))


class Features:
    """Features of trials against their simulated means, the covariance of runs taken apart into independent parts.

    ``observed`` (trials, features), NaN where unknown, with standard deviations ``errors`` (trials, features) of what was
    measured; ``covariance`` (features, features) of runs; ``shares`` (features,): what part of a feature's variance,
    given the features before it, is the car's; ``car`` and ``alike`` (trials, trials): whether two trials are of one car,
    and how far they share their discrepancy, 0 to 1.
    """

    def __init__(
        self, observed: FloatArray, errors: FloatArray, covariance: FloatArray, shares: FloatArray,
        car: FloatArray, alike: FloatArray,
    ) -> None:  # fmt: skip
        self._known = np.isfinite(observed)
        self._observed = np.where(self._known, observed, 0.0)
        self._whitening = np.zeros((*observed.shape, observed.shape[1]))
        for trial, known in enumerate(self._known):
            root = np.linalg.cholesky(covariance[np.ix_(known, known)] + np.diag(errors[trial, known] ** 2))
            self._whitening[trial][np.ix_(known, known)] = np.linalg.inv(root)
        self._parts = []
        for feature, share in enumerate(shares):
            rows = np.flatnonzero(self._known[:, feature])
            if not len(rows):
                continue
            own = share * car[np.ix_(rows, rows)] + (1 - share) * np.eye(len(rows))
            # Directions in which both parts are diagonal, the first with variance 1.
            spread, turn = eigh(alike[np.ix_(rows, rows)], own)
            self._parts.append((feature, rows, turn, np.maximum(spread, 0)))

    def residuals(self, means: FloatArray) -> FloatArray:
        """What is left (..., trials, features), in standard deviations of runs and independent of the features before.

        ``means`` (..., trials, features); NaN where a feature is unknown.
        """
        left = np.where(self._known, self._observed - means, 0.0)
        parts = np.einsum("tij,...tj->...ti", self._whitening, left)
        return np.where(self._known, parts, np.nan)

    def log_likelihood(self, means: FloatArray, kappa: FloatArray) -> FloatArray:
        """The log density (n,) of what was observed, but for a constant, at means (n, trials, features).

        ``kappa`` (n, families).
        """
        left = np.clip(self.residuals(means), -FARTHEST, FARTHEST)
        result = np.zeros(len(means))
        for feature, rows, turn, spread in self._parts:
            variance = 1 + kappa[:, [FAMILY_OF[feature]]] ** 2 * spread
            result -= 0.5 * ((left[:, rows, feature] @ turn) ** 2 / variance + np.log(variance)).sum(axis=1)
        return result


def _next_step(found: FloatArray, most: float) -> float:
    """The largest step of the temperature, up to ``most``, that leaves EFFECTIVE of the particles effective."""

    def excess(step: float) -> float:
        return float(np.exp(2 * logsumexp(step * found) - logsumexp(2 * step * found))) / len(found) - EFFECTIVE

    return most if excess(most) >= 0 else float(brentq(excess, 0.0, most))


def _resampled(weights: FloatArray, stream: np.random.Generator) -> IntArray:
    """Indices of a systematic resampling."""
    places = (np.arange(len(weights)) + stream.random()) / len(weights)
    return np.searchsorted(np.cumsum(weights), places).clip(max=len(weights) - 1)
