"""Measures neutral and deadband of a continuous-rotation servo from a person's observations.

Input: a function that drives a pulse and returns the observed direction. Output: neutral and deadband in µs. The servo
rests within its deadband and turns in opposite directions below and above it; two bisections find the two limits.
"""

from collections.abc import Callable
from dataclasses import dataclass

from foldcar.errors import FoldcarError

# Outside any deadband, but below full speed.
LOWEST_US, HIGHEST_US = 1300, 1700
# Below the servo driver's step of 4.88 µs.
RESOLUTION_US = 2
MOST_DEADBAND_US = 150


@dataclass(frozen=True, slots=True)
class ServoEdges:
    """The servo rests from ``neutral_us - deadband_us`` to ``neutral_us + deadband_us``."""

    neutral_us: float
    deadband_us: float


def find_edges(turns: Callable[[int], int]) -> ServoEdges:
    """Find the limits of the deadband; ``turns(pulse_us)`` is the direction: -1, 0 (at rest) or 1 (at long pulses).

    FoldcarError if the directions at 1300 or 1700 µs are wrong or the deadband is above ±150 µs.
    """
    if turns(LOWEST_US) != -1:
        raise FoldcarError(f"at {LOWEST_US} µs the wheel does not turn as it should: is it wired to this output?")
    if turns(HIGHEST_US) != 1:
        raise FoldcarError(f"at {HIGHEST_US} µs the wheel does not turn as it should: is the direction set right?")
    seen = {LOWEST_US: -1, HIGHEST_US: 1}
    low = _edge(turns, seen, 0)
    high = _edge(turns, seen, 1)
    edges = ServoEdges((low + high) / 2, (high - low) / 2)
    if edges.deadband_us > MOST_DEADBAND_US:
        raise FoldcarError(f"a deadband of ±{edges.deadband_us:g} µs is above the maximum {MOST_DEADBAND_US} µs")
    return edges


def _edge(turns: Callable[[int], int], seen: dict[int, int], least: int) -> float:
    """The least pulse (µs) at which the direction is ``least`` or more; ``seen`` holds earlier observations."""
    below = max(pulse for pulse, way in seen.items() if way < least)
    above = min(pulse for pulse, way in seen.items() if way >= least)
    while above - below > RESOLUTION_US:
        middle = (below + above) // 2
        seen[middle] = turns(middle)
        if seen[middle] < least:
            below = middle
        else:
            above = middle
    return (below + above) / 2
