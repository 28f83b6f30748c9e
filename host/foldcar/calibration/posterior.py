"""Draws of the parameters from their posterior, given counts of trials and a success probability for each design.

Model: a built car of design d passes with probability logistic(logit p_d(θ) + δ_d). p_d(θ) is the simulator's. The
discrepancy δ_d, normal with standard deviation τ, is what no parameter explains (among it, that all trials of a design
are of one car); τ is inferred too, so that a misfit widens the posterior rather than biases it. δ_d is integrated out
by quadrature: the likelihood of many trials is narrower than fixed Gauss-Hermite nodes are apart, hence nodes about the
mode of the integrand, spread by its curvature there (Liu and Pierce 1994, doi:10.1093/biomet/81.3.624). Draws are made
by sequential Monte Carlo with tempering (Chopin and Papaspiliopoulos 2020, chapter 17) and preconditioned Crank-Nicolson
moves, which leave the normal prior of the scores as it is.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.special import expit, gammaln, log_expit, logsumexp

from foldcar.calibration.parameters import FloatArray, Parameter

DISCREPANCY = Parameter(
    "discrepancy", "logit", "half-normal", 0.0, 0.7, 0.0,
    "what separates built cars of a design from the best simulation of it, one sd",
    "0.7 is 17 points at 50 %: two simulators of these cars differ by 18 points",
)  # fmt: skip
PARTICLES = 2000
MOVES = 12
# Share of the particles that a step of the temperature leaves effective.
EFFECTIVE = 0.5
ACCEPTED = 0.3
_NODES, _WEIGHTS = np.polynomial.hermite_e.hermegauss(15)
# Without the standard normal density, which is in the integrand.
_LOG_WEIGHTS = np.log(_WEIGHTS / _WEIGHTS.sum()) + _NODES**2 / 2
NEWTON_STEPS = 8

# Success logits (n, designs) of scores (n, parameters).
Logits = Callable[[FloatArray], FloatArray]


@dataclass(frozen=True, slots=True)
class Posterior:
    """Equally likely draws: ``scores`` (n, parameters), ``discrepancy`` τ (n), ``log_likelihood`` (n)."""

    scores: FloatArray
    discrepancy: FloatArray
    log_likelihood: FloatArray


def sample_posterior(
    logits: Logits, parameters: int, passed: FloatArray, counted: FloatArray, seed: int, particles: int = PARTICLES
) -> Posterior:
    """Draws given ``passed`` of ``counted`` trials of each design (designs,), in the order of the logits' columns."""
    stream = np.random.default_rng(seed)

    def likelihood(latent: FloatArray) -> FloatArray:
        tau = np.asarray(DISCREPANCY.value(latent[:, -1]))
        return np.asarray(log_likelihood(logits(latent[:, :-1]), tau, passed, counted).sum(axis=1))

    latent = stream.standard_normal((particles, parameters + 1))
    found = likelihood(latent)
    temperature, size = 0.0, 0.5
    while temperature < 1:
        step = _next_step(found, 1 - temperature)
        weights = step * found
        kept = _resampled(np.exp(weights - logsumexp(weights)), stream)
        latent, found = latent[kept], found[kept]
        temperature = min(1.0, temperature + step)
        for _ in range(MOVES):
            moved = np.sqrt(1 - size**2) * latent + size * stream.standard_normal(latent.shape)
            there = likelihood(moved)
            taken = np.log(stream.random(particles)) < temperature * (there - found)
            latent[taken], found[taken] = moved[taken], there[taken]
            size = float(np.clip(size * np.exp(taken.mean() - ACCEPTED), 0.02, 0.95))
    return Posterior(latent[:, :-1], np.asarray(DISCREPANCY.value(latent[:, -1])), found)


def log_likelihood(logit: FloatArray, tau: FloatArray, passed: FloatArray, counted: FloatArray) -> FloatArray:
    """Log probability (n, designs) of the counts, given simulated logits (n, designs) and discrepancies' sd τ (n)."""
    shares = binomial_normal(logit, tau[:, None], passed, counted)[1]
    return np.asarray(log_ways(passed, counted) + logsumexp(shares, axis=-1))


def log_ways(passed: Any, counted: Any) -> Any:
    """Logarithm of the binomial coefficient: in how many orders ``passed`` of ``counted`` trials pass."""
    return gammaln(counted + 1) - gammaln(passed + 1) - gammaln(counted - passed + 1)


def built_logits(
    logit: FloatArray, tau: FloatArray, passed: FloatArray, counted: FloatArray, stream: np.random.Generator
) -> FloatArray:
    """Draws of the built cars' logits (n, designs) after these trials (0 of 0: none): simulation plus discrepancy."""
    nodes, weights = binomial_normal(logit, tau[:, None], passed, counted)
    cumulated = np.exp(weights - logsumexp(weights, axis=-1, keepdims=True)).cumsum(axis=-1)
    chosen = (stream.random((*logit.shape, 1)) > cumulated).sum(axis=-1).clip(max=nodes.shape[-1] - 1)
    return np.asarray(np.take_along_axis(nodes, chosen[..., None], axis=-1)[..., 0])


def _next_step(found: FloatArray, most: float) -> float:
    """The largest step of the temperature, up to ``most``, that leaves EFFECTIVE of the particles effective."""

    def effective(step: float) -> float:
        return float(np.exp(2 * logsumexp(step * found) - logsumexp(2 * step * found))) / len(found)

    if effective(most) >= EFFECTIVE:
        return most
    low, high = 0.0, most
    for _ in range(40):
        middle = (low + high) / 2
        low, high = (middle, high) if effective(middle) >= EFFECTIVE else (low, middle)
    return low


def _resampled(weights: FloatArray, stream: np.random.Generator) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
    """Indices of a systematic resampling."""
    places = (np.arange(len(weights)) + stream.random()) / len(weights)
    return np.searchsorted(np.cumsum(weights), places).clip(max=len(weights) - 1)


def binomial_normal(
    mean: FloatArray, sd: FloatArray, passed: FloatArray, counted: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Log-odds (..., nodes) and the logarithms of their shares of the likelihood, but for the binomial coefficient.

    Log-odds are normal with ``mean`` and ``sd``, of which ``passed`` of ``counted`` came; all (...,) or broadcast so.
    Their log-likelihood is logsumexp of the shares; the shares are also the log-odds' posterior.
    """
    # Log-odds are mean + sd e, the integrand is binomial times the standard normal density of e.
    share = (passed + 0.5) / (counted + 1)
    known = sd**2 * counted * share * (1 - share)
    longest = 1 / np.maximum(sd, 1e-9)
    # Where counts as normal as the log-odds have it; then Newton's steps, none longer than 1 in log-odds.
    e = known / (1 + known) * (np.log(share / (1 - share)) - mean) * longest
    for _ in range(NEWTON_STEPS):
        rate = expit(mean + sd * e)
        slope = sd * (passed - counted * rate) - e
        e = e + np.clip(slope / (1 + sd**2 * counted * rate * (1 - rate)), -longest, longest)
    rate = expit(mean + sd * e)
    spread = (1 / np.sqrt(1 + sd**2 * counted * rate * (1 - rate)))[..., None]
    at = e[..., None] + spread * _NODES
    log_odds = mean[..., None] + sd[..., None] * at
    passing, failing = passed[..., None], (counted - passed)[..., None]
    shares = passing * log_expit(log_odds) + failing * log_expit(-log_odds) - at**2 / 2 + np.log(spread)
    return log_odds, shares + _LOG_WEIGHTS
