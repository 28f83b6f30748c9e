"""Limits that a listing's keys and the options of commands share. It imports next to nothing: help is printed at once."""

from typing import Any

# Sampled environments of an experiment, the samples 0 to MAX_ENVIRONMENTS - 1.
MAX_ENVIRONMENTS = 1_000_000
# SQLite's largest whole number.
MAX_SEED = 2**63 - 1
# Processes that simulate side by side.
MAX_JOBS = 256


# Far beyond every length, time, seed and count, and far within what a double holds.
LARGEST = 1e15
SMALLEST = 1e-12
LARGEST_WHOLE = 2**63 - 1
SHOWN = 40


def checked_threshold(share: float) -> float:
    """A threshold of success; ValueError if it is not a share of runs."""
    if not 0 < share < 1:
        percent = f": write {share / 100:g} for {share:g} %" if 1 < share < 100 else ", as 0.75"
        raise ValueError(f"{share:g} is not between 0 and 1: a threshold is a share of runs{percent}")
    return share


def check_numbers(data: Any, path: str = "") -> None:
    """ValueError, naming the place in ``data`` (parsed JSON), if a number or a text in it is out of these bounds."""
    if isinstance(data, dict):
        for key, value in data.items():
            _check_text(path or "the file", key)
            check_numbers(value, f"{path}.{key}" if path else key)
    elif isinstance(data, list):
        for index, value in enumerate(data):
            check_numbers(value, f"{path}.{index}")
    elif isinstance(data, str):
        _check_text(path, data)
    elif isinstance(data, int) and not isinstance(data, bool) and abs(data) > LARGEST_WHOLE:
        shown = f"a number of {len(str(abs(data)))} digits" if data.bit_length() < 10_000 else "a number"
        raise ValueError(f"{path}: {shown} is above the limit {LARGEST_WHOLE} in size")
    elif isinstance(data, float) and (abs(data) > LARGEST or 0 < abs(data) < SMALLEST):
        raise ValueError(f"{path}: {data:g} is no number to compute with: its size is not in {SMALLEST:g} to {LARGEST:g}")


def _check_text(path: str, text: str) -> None:
    if any("\ud800" <= letter <= "\udfff" for letter in text):
        raise ValueError(f"{path}: {ascii(text)[:SHOWN]} holds what is no character")
