"""The confidence interval of a share of successes."""


def wilson_interval(successes: int, runs: int, confidence: float = 0.95) -> tuple[float, float]:
    """Wilson's score interval (low, high) of the success probability; ``runs`` is at least 1."""
    from scipy.stats import binomtest

    interval = binomtest(successes, runs).proportion_ci(confidence_level=confidence, method="wilson")
    return float(interval.low), float(interval.high)
