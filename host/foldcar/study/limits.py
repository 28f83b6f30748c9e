"""Limits for the keys of listings and the options of commands. It imports almost nothing, so that help appears fast."""

from typing import Any

# Sampled environments of an experiment; samples are numbered 0 to MAX_ENVIRONMENTS - 1.
MAX_ENVIRONMENTS = 1_000_000
# Runs of an experiment in other realities.
MAX_REALITIES = 1_000_000
# SQLite's largest integer.
MAX_SEED = 2**63 - 1
# Simulator processes in parallel.
MAX_JOBS = 256


# Bounds of numbers in listings: far beyond every length, time, seed and count, and far within the range of a double.
MAX_NUMBER = 1e15
MIN_NUMBER = 1e-12
MAX_INTEGER = 2**63 - 1


def checked_threshold(rate: float) -> float:
    """Return the threshold ``rate``. Raises ValueError if it is not between 0 and 1."""
    if 0 < rate < 1:
        return rate
    # A number above 1 is probably a percentage.
    example = f": write {rate / 100:g} for {rate:g} %" if 1 < rate < 100 else ", as 0.75"
    raise ValueError(f"{rate:g} is not between 0 and 1: a threshold is a fraction of runs{example}")


def check_numbers(data: Any, path: str = "") -> None:
    """Raise ValueError, naming the place in ``data`` (parsed JSON), if a number is out of bounds."""
    if isinstance(data, dict):
        for key, value in data.items():
            check_numbers(value, f"{path}.{key}" if path else key)
    elif isinstance(data, list):
        for index, value in enumerate(data):
            check_numbers(value, f"{path}.{index}")
    elif isinstance(data, int) and not isinstance(data, bool) and abs(data) > MAX_INTEGER:
        raise ValueError(f"{path}: the number is above the limit {MAX_INTEGER} in size")
    elif isinstance(data, float) and (abs(data) > MAX_NUMBER or 0 < abs(data) < MIN_NUMBER):
        raise ValueError(
            f"{path}: {data:g} is out of bounds: write 0, or an absolute value from {MIN_NUMBER:g} to {MAX_NUMBER:g}"
        )
