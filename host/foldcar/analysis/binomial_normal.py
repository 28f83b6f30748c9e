"""Counts of a design whose log-odds are normal: the integral of binomial times normal, by nodes about its highest point.

The likelihood of many runs or trials is narrower than fixed Gauss-Hermite nodes are apart, hence nodes about the mode of
the integrand, spread by its curvature there (Liu and Pierce 1994, doi:10.1093/biomet/81.3.624).
"""

from typing import Any

import numpy
from numpy.typing import NDArray

_NODES, _WEIGHTS = numpy.polynomial.hermite_e.hermegauss(15)
# Without the standard normal density, which is in the integrand.
_LOG_WEIGHTS = numpy.log(_WEIGHTS / _WEIGHTS.sum()) + _NODES**2 / 2
NEWTON_STEPS = 8


def binomial_normal(
    mean: NDArray[Any], sd: NDArray[Any], passed: NDArray[Any], counted: NDArray[Any]
) -> tuple[NDArray[Any], NDArray[Any]]:
    """Log-odds (..., nodes) and the logarithms of their shares of the likelihood, but for the binomial coefficient.

    Log-odds are normal with ``mean`` and ``sd``, of which ``passed`` of ``counted`` came; all (...,) or broadcast so.
    Their log-likelihood is logsumexp of the shares; the shares are also the log-odds' posterior.
    """
    from scipy.special import expit, log_expit

    # Log-odds are mean + sd e, the integrand is binomial times the standard normal density of e.
    share = (passed + 0.5) / (counted + 1)
    known = sd**2 * counted * share * (1 - share)
    longest = 1 / numpy.maximum(sd, 1e-9)
    # Where counts as normal as the log-odds have it; then Newton's steps, none longer than 1 in log-odds.
    e = known / (1 + known) * (numpy.log(share / (1 - share)) - mean) * longest
    for _ in range(NEWTON_STEPS):
        rate = expit(mean + sd * e)
        slope = sd * (passed - counted * rate) - e
        e = e + numpy.clip(slope / (1 + sd**2 * counted * rate * (1 - rate)), -longest, longest)
    rate = expit(mean + sd * e)
    spread = (1 / numpy.sqrt(1 + sd**2 * counted * rate * (1 - rate)))[..., None]
    at = e[..., None] + spread * _NODES
    log_odds = mean[..., None] + sd[..., None] * at
    passing, failing = passed[..., None], (counted - passed)[..., None]
    shares = passing * log_expit(log_odds) + failing * log_expit(-log_odds) - at**2 / 2 + numpy.log(spread)
    return log_odds, shares + _LOG_WEIGHTS
