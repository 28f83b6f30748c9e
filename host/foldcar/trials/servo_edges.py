"""Neutral and deadband of a continuous-rotation servo, from what a person sees at a few pulses.

A servo turns one way below its deadband, stands inside it, turns the other way above. Two bisections find the ends.
Input: a function that shows a pulse and tells which way the servo turns. Output: neutral and deadband in µs.
"""

from collections.abc import Callable
from dataclasses import dataclass

from foldcar.errors import FoldcarError

# Far outside any deadband, and not full speed.
LOWEST_US, HIGHEST_US = 1300, 1700
# Less than the servo driver's step of 4.88 µs.
RESOLUTION_US = 2
MOST_DEADBAND_US = 150


@dataclass(frozen=True, slots=True)
class ServoEdges:
    """The servo stands from ``neutral_us - deadband_us`` to ``neutral_us + deadband_us``."""

    neutral_us: float
    deadband_us: float


def find_edges(turns: Callable[[int], int]) -> ServoEdges:
    """``turns(pulse_us)`` is -1, 0 or 1: the way the servo turns, 1 with growing pulses. FoldcarError."""
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
    """The pulse from which on the answer is ``least`` or more; what was seen before is not asked again."""
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
