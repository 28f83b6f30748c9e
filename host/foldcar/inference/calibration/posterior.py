"""Draws the parameters from their posterior, given trials of built cars and an emulator of the simulator.

Car c of design d passes in scene s with probability logistic(l_ds(θ) + e_c), where l_ds(θ) is the simulator's logit. The
offsets e_c are normal. Each car has a part of its own, with the standard deviation of simulated cars. To this adds a
discrepancy with standard deviation τ, which no parameter explains. All cars of a design share it, similar designs share a
part of it, all designs another part. The e_c are integrated out by Laplace's method (Rasmussen and Williams 2006,
algorithm 3.1). τ is inferred, so that a misfit widens the posterior instead of biasing it.

Draws are made by sequential Monte Carlo with tempering (Chopin and Papaspiliopoulos 2020, chapter 17) and preconditioned
Crank-Nicolson moves, which leave the normal prior of the scores as it is.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq
from scipy.special import logsumexp

from foldcar.belief.priors import FloatArray, Parameter
from foldcar.statistics.gaussian_process import Factors, binomial, laplace

DISCREPANCY = Parameter(
    "discrepancy", "logit", "half-normal", 0.0, 0.7, 0.0,
    "difference between built cars of a design and its best simulation, one sd",
    "0.7 is 17 points at 50 %: two simulators of these cars differ by 18 points",
)  # fmt: skip
PARTICLES = 1000
MOVES = 12
# Fraction of the particles that stay effective in a step of the temperature.
EFFECTIVE = 0.5
# Fraction of moves to accept.
ACCEPTED = 0.3
# Added to variances, so that a covariance without a car's own part has a Cholesky root.
JITTER = 1e-9

IntArray = np.ndarray[tuple[int], np.dtype[np.int64]]
# The log-likelihood (n,) of scores (n, parameters) with discrepancies τ (n,).
Likelihood = Callable[[FloatArray, FloatArray], FloatArray]


@dataclass(frozen=True, slots=True)
class Posterior:
    """Equally likely draws: ``scores`` (n, parameters), τ (n,) as ``discrepancy``, ``log_likelihood`` (n,)."""

    scores: FloatArray
    discrepancy: FloatArray
    log_likelihood: FloatArray


def sample_posterior(likelihood: Likelihood, parameters: int, seed: int, particles: int = PARTICLES) -> Posterior:
    """Draw from the posterior of the scores (standard normal prior) and of the discrepancy.

    Sequential Monte Carlo: the likelihood's exponent, ``temperature``, rises from 0 to 1. At each step the particles are
    resampled by weight, then moved by MOVES Crank-Nicolson proposals, whose ``size`` adapts to the rate ACCEPTED.
    """
    stream = np.random.default_rng(seed)

    def log_likelihood(latent: FloatArray) -> FloatArray:
        return likelihood(latent[:, :parameters], np.asarray(DISCREPANCY.value(latent[:, parameters])))

    # The last column gives the discrepancy.
    latent = stream.standard_normal((particles, parameters + 1))
    current = log_likelihood(latent)
    temperature, size = 0.0, 0.5
    while temperature < 1:
        step = _next_step(current, 1 - temperature)
        weights = step * current
        kept = _resampled(np.exp(weights - logsumexp(weights)), stream)
        latent, current = latent[kept], current[kept]
        temperature = min(1.0, temperature + step)
        for _ in range(MOVES):
            # Such proposals keep the standard normal prior, so that only the likelihoods decide.
            proposal = np.sqrt(1 - size**2) * latent + size * stream.standard_normal(latent.shape)
            proposal_likelihood = log_likelihood(proposal)
            accepted = np.log(stream.random(particles)) < temperature * (proposal_likelihood - current)
            latent[accepted], current[accepted] = proposal[accepted], proposal_likelihood[accepted]
            size = float(np.clip(size * np.exp(accepted.mean() - ACCEPTED), 0.02, 0.95))
    return Posterior(latent[:, :parameters], np.asarray(DISCREPANCY.value(latent[:, parameters])), current)


@dataclass(frozen=True, slots=True)
class Outcomes:
    """Laplace's approximation of cars' offsets e = ``root`` f for draws (n,), where factors f are standard normal.

    ``root`` (n, cars, cars) is the Cholesky factor of the offsets' covariance before the trials.
    """

    root: FloatArray
    factors: Factors

    @property
    def evidence(self) -> FloatArray:
        """Log evidence (n,) of the outcomes, without the binomial coefficients."""
        return np.asarray(self.factors.evidence)

    def new_car(self, cross: FloatArray, variance: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return mean and variance (n,) of the offset of a car that was not driven, given the trials.

        ``cross`` (n, cars) are its covariances with the driven cars, ``variance`` (n,) is its prior variance. Its offset
        is ``loads`` times the driven cars' factors, plus a part of its own that trials do not change.
        """
        loads = np.linalg.solve(self.root, cross[..., None])[..., 0]
        # What the factors contribute before the trials, less what they contribute after them.
        reduction = (loads**2).sum(axis=1) - (np.einsum("nc,ncd->nd", loads, self.factors.root) ** 2).sum(axis=1)
        return (loads * self.factors.mode).sum(axis=1), np.maximum(variance - reduction, 0)


def outcomes(
    logits: FloatArray, passed: FloatArray, counted: FloatArray, car: IntArray, covariance: FloatArray
) -> Outcomes:
    """Infer cars' log-odds offsets by Laplace's method, for each of n draws of the parameters.

    A group is the trials of one car in one cell: ``passed`` of ``counted`` (groups,) by the car with index ``car``
    (groups,). ``logits`` (n, groups) are simulated. ``covariance`` (n, cars, cars) is the offsets' prior covariance.
    """
    root = np.linalg.cholesky(covariance + JITTER * np.eye(covariance.shape[1]))
    # Newton steps may overflow before they are halved.
    with np.errstate(over="ignore"):
        return Outcomes(np.asarray(root), laplace(root[:, car], logits, binomial(passed, counted)))


def _next_step(log_likelihood: FloatArray, limit: float) -> float:
    """Return the largest step of the temperature, up to ``limit``, that keeps the effective sample size.

    This size is (Σw)² / Σw² for the particles' weights w = likelihood^step; it stays at least EFFECTIVE of their number.
    """

    def excess(step: float) -> float:
        log_weights = step * log_likelihood
        return float(np.exp(2 * logsumexp(log_weights) - logsumexp(2 * log_weights))) / len(log_weights) - EFFECTIVE

    return limit if excess(limit) >= 0 else float(brentq(excess, 0.0, limit))


def _resampled(weights: FloatArray, stream: np.random.Generator) -> IntArray:
    """Return indices (n,) of a systematic resampling: n evenly spaced points of the cumulated weights (n,)."""
    points = (np.arange(len(weights)) + stream.random()) / len(weights)
    return np.searchsorted(np.cumsum(weights), points).clip(max=len(weights) - 1)
