"""Measures neutral and deadband of continuous-rotation servos from a person's observations.

Input: a car whose wheels turn freely, answers; or a function that drives a pulse and returns the observed direction.
Output: neutral and deadband in µs. A servo rests within its deadband and turns in opposite directions below and above it;
two bisections find the two limits.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass

from foldcar.errors import FoldcarError
from foldcar.link.car import Car
from foldcar.link.parameters import read_parameters, set_parameter
from foldcar.trials.person import Answers, say

# The car ends an output test after PULSE_S; the test is renewed every RENEW_S while the person observes.
PULSE_S = 1.5
RENEW_S = 0.7
WAYS = {"f": "forward", "b": "backward", "n": "not"}

# Outside any deadband, but below full speed.
LOWEST_US, HIGHEST_US = 1300, 1700
# Below the servo driver's step of 4.88 µs.
RESOLUTION_US = 2
MAX_DEADBAND_US = 150


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
    if edges.deadband_us > MAX_DEADBAND_US:
        raise FoldcarError(f"a deadband of ±{edges.deadband_us:g} µs is above the maximum {MAX_DEADBAND_US} µs")
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


def calibrate_outputs(car: Car, outputs: list[int]) -> None:
    """Measure the servos of those outputs, all with a wheel if there are none, and save the results in the car.

    FoldcarError if an output has no wheel, or as for :func:`find_edges`.
    """
    values = read_parameters(car)
    wheels = [number for number in range(1, 9) if values.get(f"CH{number}_SIDE")]
    for number in outputs:
        if number not in wheels:
            raise FoldcarError(f"--output {number}: has no wheel; those with one are {', '.join(map(str, wheels))}")
    # The output that is tested, its pulse, and when to renew the test.
    shown: list[tuple[int, int, float]] = []

    def renew() -> None:
        car.connection.receive(0.0)
        if shown and time.monotonic() > shown[0][2]:
            show(*shown[0][:2])

    def show(number: int, pulse_us: int) -> None:
        car.test_output(number, pulse_us, PULSE_S)
        shown[:] = [(number, pulse_us, time.monotonic() + RENEW_S)]

    answers = Answers(renew)
    say("Lift the car so that its wheels turn freely. For each pulse type the direction in which the wheel")
    say("would drive the car: (f)orward, (b)ackward, (n)ot at all. Ctrl-C stops the wheel.")
    for number in outputs or wheels:
        side = {1: "left", 2: "right"}[int(values[f"CH{number}_SIDE"])]
        direction = int(values[f"CH{number}_DIRECTION"])
        say(f"\nOutput {number}, {side}")

        def turns(pulse_us: int, number: int = number, direction: int = direction) -> int:
            show(number, pulse_us)
            way = answers.choice(f"  {pulse_us} µs: f, b or n? ", WAYS, None)
            return {"forward": 1, "backward": -1, "not": 0}[way] * direction

        edges = find_edges(turns)
        shown.clear()
        car.stop_trial()
        for name, value in {"NEUTRAL_US": edges.neutral_us, "DEADBAND_US": edges.deadband_us}.items():
            set_parameter(car, f"CH{number}_{name}", value)
            say(f"  CH{number}_{name} = {value:g} (was {values[f'CH{number}_{name}']:g})")
