"""Measures neutral and deadband of continuous-rotation servos from a person's observations.

Input: a car whose wheels turn freely, answers; or a function that commands a pulse and returns the observed direction.
Output: neutral and deadband in µs. A servo rests within its deadband, and turns in opposite directions below and above
it. Two bisections find the two limits.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass

from foldcar.errors import FoldcarError
from foldcar.link.car import Car
from foldcar.link.parameters import read_parameters, set_parameter
from foldcar.trials.person import Answers, print_line

# The car ends an output test after PULSE_S; the test is renewed every RENEW_S while the person observes.
PULSE_S = 1.5
RENEW_S = 0.7
DIRECTIONS = {"f": "forward", "b": "backward", "n": "not"}

# Outside any deadband, but below full speed.
MIN_PULSE_US, MAX_PULSE_US = 1300, 1700
# Below the servo driver's step of 4.88 µs.
RESOLUTION_US = 2
MAX_DEADBAND_US = 150


@dataclass(frozen=True, slots=True)
class ServoEdges:
    """The servo rests from ``neutral_us - deadband_us`` to ``neutral_us + deadband_us``."""

    neutral_us: float
    deadband_us: float


def find_edges(direction_at: Callable[[int], int]) -> ServoEdges:
    """Find the limits of the deadband; ``direction_at(pulse_us)`` returns -1, 0 (at rest) or 1 (long pulses).

    Raises FoldcarError if the direction at 1300 or 1700 µs is wrong or the deadband is above ±150 µs.
    """
    if direction_at(MIN_PULSE_US) != -1:
        raise FoldcarError(f"at {MIN_PULSE_US} µs the wheel does not turn as it should: is it wired to this output?")
    if direction_at(MAX_PULSE_US) != 1:
        raise FoldcarError(f"at {MAX_PULSE_US} µs the wheel does not turn as it should: is the direction set right?")
    # The servo rests from the lower edge on, where its direction becomes 0, to the upper edge, where it becomes 1.
    directions = {MIN_PULSE_US: -1, MAX_PULSE_US: 1}
    low = _edge(direction_at, directions, 0)
    high = _edge(direction_at, directions, 1)
    edges = ServoEdges((low + high) / 2, (high - low) / 2)
    if edges.deadband_us > MAX_DEADBAND_US:
        raise FoldcarError(f"a deadband of ±{edges.deadband_us:g} µs is above the maximum {MAX_DEADBAND_US} µs")
    return edges


def _edge(direction_at: Callable[[int], int], directions: dict[int, int], minimum: int) -> float:
    """Return, by bisection, the pulse (µs) from which on the servo turns with at least the direction ``minimum``.

    ``directions`` has the observed directions by pulse, and gets the new ones.
    """
    longest_below = max(pulse for pulse, direction in directions.items() if direction < minimum)
    shortest_above = min(pulse for pulse, direction in directions.items() if direction >= minimum)
    while shortest_above - longest_below > RESOLUTION_US:
        middle = (longest_below + shortest_above) // 2
        directions[middle] = direction_at(middle)
        if directions[middle] < minimum:
            longest_below = middle
        else:
            shortest_above = middle
    return (longest_below + shortest_above) / 2


def calibrate_outputs(car: Car, outputs: list[int]) -> None:
    """Measure the servos of ``outputs`` (empty: all with a wheel) and save the results in the car.

    Raises FoldcarError if an output has no wheel, and as :func:`find_edges` does.
    """
    values = read_parameters(car)
    wheels = [number for number in range(1, 9) if values.get(f"CH{number}_SIDE")]
    for number in outputs:
        if number not in wheels:
            raise FoldcarError(f"--output {number}: has no wheel; outputs with a wheel: {', '.join(map(str, wheels))}")
    # The running test: its output, its pulse, and when to renew it.
    active_test: list[tuple[int, int, float]] = []

    def renew() -> None:
        car.connection.receive(0.0)
        if active_test and time.monotonic() > active_test[0][2]:
            test_output(*active_test[0][:2])

    def test_output(number: int, pulse_us: int) -> None:
        car.test_output(number, pulse_us, PULSE_S)
        active_test[:] = [(number, pulse_us, time.monotonic() + RENEW_S)]

    answers = Answers(renew)
    print_line("Lift the car so that its wheels turn freely. For each pulse type the direction in which the wheel")
    print_line("would drive the car: (f)orward, (b)ackward, (n)ot at all. Ctrl-C stops the wheel.")
    for number in outputs or wheels:
        side = {1: "left", 2: "right"}[int(values[f"CH{number}_SIDE"])]
        direction = int(values[f"CH{number}_DIRECTION"])
        print_line(f"\nOutput {number}, {side}")

        def direction_at(pulse_us: int, number: int = number, direction: int = direction) -> int:
            test_output(number, pulse_us)
            answer = answers.choice(f"  {pulse_us} µs: f, b or n? ", DIRECTIONS, None)
            return {"forward": 1, "backward": -1, "not": 0}[answer] * direction

        edges = find_edges(direction_at)
        active_test.clear()
        car.stop_trial()
        for name, value in {"NEUTRAL_US": edges.neutral_us, "DEADBAND_US": edges.deadband_us}.items():
            set_parameter(car, f"CH{number}_{name}", value)
            print_line(f"  CH{number}_{name} = {value:g} (was {values[f'CH{number}_{name}']:g})")
