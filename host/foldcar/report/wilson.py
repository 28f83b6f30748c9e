"""The Wilson score interval (Wilson 1927) of a success probability."""


def wilson_interval(successes: int, runs: int, confidence: float = 0.95) -> tuple[float, float]:
    """Wilson's score interval (low, high), each 0 to 1, for ``successes`` of ``runs``, which is at least 1."""
    from scipy.stats import binomtest

    interval = binomtest(successes, runs).proportion_ci(confidence_level=confidence, method="wilson")
    return float(interval.low), float(interval.high)
