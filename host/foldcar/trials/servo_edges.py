"""Measures neutral and deadband of continuous-rotation servos from a person's observations.

Input: a car whose wheels turn freely, answers; or a function that commands a pulse and returns the observed direction.
Output: neutral and deadband in µs. A servo rests within its deadband, and turns in opposite directions below and above
it. The search for each limit of the deadband begins where the limit is expected.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass

from foldcar.errors import FoldcarError
from foldcar.link.car import ConnectedCar
from foldcar.link.parameters import read_parameters, set_parameter
from foldcar.statistics.words import count
from foldcar.trials.person import PersonAnswers, print_line

# The car ends an output test after PULSE_S; the test is renewed every RENEW_S while the person observes.
PULSE_S = 1.5
RENEW_S = 0.7
DIRECTIONS = {"f": "forward", "b": "backward", "n": "not"}
DIRECTION_OF = {"forward": 1, "backward": -1, "not": 0}
YES_OR_NO = {"y": "yes", "n": "no"}

# Outside any deadband, but below full speed.
MIN_PULSE_US, MAX_PULSE_US = 1300, 1700
# The servo driver's step is 4.88 µs: a servo does not feel what is finer.
RESOLUTION_US = 5
# The first distance from the expected limit at which the servo is tried; it doubles.
FIRST_STEP_US = 10
MAX_DEADBAND_US = 150
# For each servo: one for its direction, and three to seven for each limit.
USUAL_QUESTIONS = 9


@dataclass(frozen=True, slots=True)
class ServoEdges:
    """The servo rests from ``neutral_us - deadband_us`` to ``neutral_us + deadband_us``."""

    neutral_us: float
    deadband_us: float


def find_edges(direction_at: Callable[[int], int], expected: ServoEdges) -> ServoEdges:
    """Find the limits of the deadband of a servo that turns with direction 1 at MAX_PULSE_US.

    ``direction_at(pulse_us)`` returns -1, 0 (at rest) or 1. A servo that is as ``expected`` needs the fewest questions.
    Raises FoldcarError if the deadband is above ±150 µs, or if the servo does not change its direction.
    """
    observed = {MIN_PULSE_US: -1, MAX_PULSE_US: 1}

    def find_edge(minimum: int, expected_us: float) -> float:
        """Return the pulse (µs) from which on the servo turns with at least the direction ``minimum``."""
        return _find_edge(direction_at, observed, minimum, expected_us)

    # The servo rests from the lower edge on, where its direction becomes 0, to the upper edge, where it becomes 1.
    high = find_edge(1, expected.neutral_us + expected.deadband_us)
    low = find_edge(0, high - 2 * expected.deadband_us)
    edges = ServoEdges(neutral_us=(low + high) / 2, deadband_us=(high - low) / 2)
    if edges.deadband_us > MAX_DEADBAND_US:
        raise FoldcarError(f"a deadband of ±{edges.deadband_us:g} µs is above the maximum {MAX_DEADBAND_US} µs")
    # The search takes for granted that the servo turns backwards at MIN_PULSE_US. If an edge is at an end of the range,
    # the servo was never seen to change its direction.
    if min(low - MIN_PULSE_US, MAX_PULSE_US - high) < RESOLUTION_US:
        raise FoldcarError(
            f"the servo turns in the same direction at all pulses from {MIN_PULSE_US} to {MAX_PULSE_US} µs: is it a "
            "servo for continuous rotation, and is its trimmer in the middle?"
        )
    return edges


def _find_edge(direction_at: Callable[[int], int], observed: dict[int, int], minimum: int, expected_us: float) -> float:
    """Find the edge of a direction: the pulse (µs) from which on the servo turns with at least the direction ``minimum``.

    A direction is -1 (backwards), 0 (still) or 1 (forwards), and it grows with the pulse. ``observed`` has the directions
    that were observed so far, by pulse; new observations are added. ``direction_at`` observes a pulse. The search begins
    at ``expected_us`` and moves towards the edge in steps that double. As soon as it has seen both sides of the edge, it
    bisects.
    """
    # The edge lies between these two pulses.
    below = max(pulse for pulse, direction in observed.items() if direction < minimum)
    above = min(pulse for pulse, direction in observed.items() if direction >= minimum)
    pulse, step_us = round(expected_us), FIRST_STEP_US
    tried_above = tried_below = False
    while above - below > RESOLUTION_US:
        is_edge_passed = tried_above and tried_below
        if is_edge_passed or not below < pulse < above:
            pulse = (below + above) // 2
        observed[pulse] = direction_at(pulse)
        if observed[pulse] >= minimum:
            tried_above = True
            above, pulse = pulse, pulse - step_us
        else:
            tried_below = True
            below, pulse = pulse, pulse + step_us
        step_us *= 2
    return (below + above) / 2


def calibrate_outputs(car: ConnectedCar, outputs: list[int]) -> None:
    """Measure the servos of ``outputs`` (empty: all with a wheel) and save the results in the car.

    A servo that turns the wrong way is reversed if the person agrees. Raises FoldcarError if an output has no wheel, if
    a wheel stands or stays reversed, and as :func:`find_edges` does.
    """
    values = read_parameters(car)
    wheels = [number for number in range(1, 9) if values.get(f"CH{number}_SIDE")]
    for number in outputs:
        if number not in wheels:
            raise FoldcarError(f"--servo {number}: has no wheel; outputs with a wheel: {', '.join(map(str, wheels))}")
    # The running test: its output, its pulse, and when to renew it.
    active_test: list[tuple[int, int, float]] = []

    def renew() -> None:
        """Keep the link alive, and begin the running test again before the car ends it."""
        car.connection.receive(0.0)
        if active_test and time.monotonic() > active_test[0][2]:
            test_output(*active_test[0][:2])

    def test_output(number: int, pulse_us: int) -> None:
        """Let an output command a pulse until the person has answered."""
        car.test_output(number, pulse_us, PULSE_S)
        active_test[:] = [(number, pulse_us, time.monotonic() + RENEW_S)]

    def save(name: str, value: float) -> None:
        """Stop the wheel, and set a parameter in the car."""
        # A car that drives takes no parameters.
        active_test.clear()
        car.stop_trial()
        set_parameter(car, name, value)
        print_line(f"  {name} = {value:g} (was {values[name]:g})")

    answers = PersonAnswers(renew)
    chosen = outputs or wheels
    print_line("Lift the car so that its wheels turn freely. For each pulse type the direction in which the wheel")
    print_line("would drive the car: (f)orward, (b)ackward, (n)ot at all. Ctrl-C stops the wheel.")
    print_line(f"There are about {USUAL_QUESTIONS} questions for each of {count(len(chosen), 'servo')}.")
    # Servos of one kind have nearly the same deadband.
    deadband_us = values[f"CH{chosen[0]}_DEADBAND_US"]
    for number in chosen:
        side = {1: "left", 2: "right"}[int(values[f"CH{number}_SIDE"])]
        print_line(f"\nOutput {number}, {side}")

        def ask(pulse_us: int, number: int = number) -> int:
            """Return the direction, 1, 0 or -1, in which the wheel drives the car at a pulse, as the person sees it."""
            test_output(number, pulse_us)
            return DIRECTION_OF[answers.choice(f"  {pulse_us} µs: f, b or n? ", DIRECTIONS, None)]

        direction = _ask_direction(number, values, ask, answers, save)
        expected = ServoEdges(values[f"CH{number}_NEUTRAL_US"], deadband_us)

        def turn(pulse_us: int, ask: Callable[[int], int] = ask, direction: int = direction) -> int:
            """Return the direction in which the servo turns at a pulse: 1 as at MAX_PULSE_US, 0 or -1."""
            return ask(pulse_us) * direction

        edges = find_edges(turn, expected)
        deadband_us = edges.deadband_us
        save(f"CH{number}_NEUTRAL_US", edges.neutral_us)
        save(f"CH{number}_DEADBAND_US", edges.deadband_us)


def _ask_direction(
    number: int,
    values: dict[str, float],
    ask: Callable[[int], int],
    answers: PersonAnswers,
    save: Callable[[str, float], None],
) -> int:
    """Ask in which direction a servo's wheel turns at MAX_PULSE_US, and return it: 1 or -1.

    If the wheel turns backwards, the person is asked whether the servo is to be reversed; if so, this is saved. Raises
    FoldcarError if the wheel stands still, or if it turns backwards and is not to be reversed.
    """
    reversed_before = values[f"CH{number}_REVERSED"]
    direction_of_design = int(values[f"CH{number}_DIRECTION"])
    expected = -direction_of_design if reversed_before else direction_of_design
    observed = ask(MAX_PULSE_US)
    if observed == 0:
        raise FoldcarError(
            f"output {number} stands at {MAX_PULSE_US} µs: are the switch and the cells in order, is its plug on this "
            "output, with the brown lead at GND?"
        )
    if observed != expected:
        print_line("  It turns backwards. Is this the wheel of this output? If not, change the plugs and begin again.")
        if answers.choice("  Shall it be reversed (y or n)? ", YES_OR_NO, None) == "no":
            raise FoldcarError(f"output {number} turns backwards: put its plug where it belongs, and begin again")
        save(f"CH{number}_REVERSED", 0 if reversed_before else 1)
    return observed
