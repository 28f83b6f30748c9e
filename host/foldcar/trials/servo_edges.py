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
FORWARDS, AT_REST = 1, 0
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
    """Find the limits of a servo's deadband, the range of pulses at which the servo rests.

    ``direction_at(pulse_us)`` returns the direction in which the servo turns: -1, 0 (at rest) or 1. At MAX_PULSE_US it
    must be 1. The closer the servo is to ``expected``, the fewer pulses are tried. Raises FoldcarError if the deadband
    is above ±150 µs, or if the servo does not change its direction.
    """
    observed = {MIN_PULSE_US: -1, MAX_PULSE_US: 1}
    # The servo turns backwards below the lower edge, rests between the edges, and turns forwards above the upper edge.
    expected_upper_us = expected.neutral_us + expected.deadband_us
    upper_us = _find_edge(direction_at, observed, FORWARDS, expected_upper_us)
    expected_lower_us = upper_us - 2 * expected.deadband_us
    lower_us = _find_edge(direction_at, observed, AT_REST, expected_lower_us)
    edges = ServoEdges(neutral_us=(lower_us + upper_us) / 2, deadband_us=(upper_us - lower_us) / 2)
    if edges.deadband_us > MAX_DEADBAND_US:
        raise FoldcarError(f"a deadband of ±{edges.deadband_us:g} µs is above the maximum {MAX_DEADBAND_US} µs")
    # That the servo turns backwards at MIN_PULSE_US was only assumed. If an edge is at an end of the range of pulses,
    # the servo turned in the same direction at every pulse that was tried.
    margin_us = min(lower_us - MIN_PULSE_US, MAX_PULSE_US - upper_us)
    if margin_us < RESOLUTION_US:
        raise FoldcarError(
            f"the servo turns in the same direction at all pulses from {MIN_PULSE_US} to {MAX_PULSE_US} µs: is it a "
            "servo for continuous rotation, and is its trimmer in the middle?"
        )
    return edges


def _find_edge(
    direction_at: Callable[[int], int], observed: dict[int, int], min_direction: int, expected_us: float
) -> float:
    """Find the pulse (µs) from which on the servo's direction is at least ``min_direction``.

    A direction is -1 (backwards), 0 (at rest) or 1 (forwards), and it grows with the pulse. ``direction_at`` observes
    it. ``observed`` has all observations so far, by pulse, and new ones are added.

    The search begins at ``expected_us`` and goes towards the edge in steps that double. When it has passed the edge, it
    halves the interval that contains the edge until that is narrow enough.
    """
    # The edge lies between these two pulses.
    below_us = max(pulse_us for pulse_us, direction in observed.items() if direction < min_direction)
    above_us = min(pulse_us for pulse_us, direction in observed.items() if direction >= min_direction)
    next_us = round(expected_us)
    step_us = FIRST_STEP_US
    has_tried_below = has_tried_above = False
    while above_us - below_us > RESOLUTION_US:
        has_passed_edge = has_tried_below and has_tried_above
        is_between = below_us < next_us < above_us
        if has_passed_edge or not is_between:
            next_us = (below_us + above_us) // 2
        tried_us = next_us
        observed[tried_us] = direction_at(tried_us)
        if observed[tried_us] >= min_direction:
            has_tried_above = True
            above_us = tried_us
            next_us = tried_us - step_us
        else:
            has_tried_below = True
            below_us = tried_us
            next_us = tried_us + step_us
        step_us *= 2
    return (below_us + above_us) / 2


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
    """Ask a person in which direction a wheel turns at MAX_PULSE_US, and return it: 1 (forwards) or -1 (backwards).

    ``number`` is the servo's output, and ``values`` are the car's parameters. ``ask`` asks for the direction at a pulse,
    and ``save`` sets a parameter of the car. If the wheel turns the wrong way, and the person agrees, the servo is
    reversed. Raises FoldcarError if the wheel stands still, or if it turns the wrong way and is not reversed.
    """
    is_reversed = bool(values[f"CH{number}_REVERSED"])
    expected_direction = int(values[f"CH{number}_DIRECTION"])
    if is_reversed:
        expected_direction = -expected_direction
    direction = ask(MAX_PULSE_US)
    if direction == AT_REST:
        raise FoldcarError(
            f"output {number} stands at {MAX_PULSE_US} µs: are the switch and the cells in order, is its plug on this "
            "output, with the brown lead at GND?"
        )
    if direction != expected_direction:
        print_line("  It turns backwards. Is this the wheel of this output? If not, change the plugs and begin again.")
        if answers.choice("  Shall it be reversed (y or n)? ", YES_OR_NO, None) == "no":
            raise FoldcarError(f"output {number} turns backwards: put its plug where it belongs, and begin again")
        save(f"CH{number}_REVERSED", 0 if is_reversed else 1)
    return direction
