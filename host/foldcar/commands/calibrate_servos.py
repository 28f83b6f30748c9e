"""`foldcar calibrate-servos`: measures neutral and deadband of each wheel's servo by observing the wheel."""

import contextlib
import time
from typing import TYPE_CHECKING, Annotated

import typer

from foldcar.commands.options import Port
from foldcar.errors import FoldcarError

if TYPE_CHECKING:
    from foldcar.link.car import Car

# The car ends an output test after PULSE_S; the test is renewed every RENEW_S while the person observes.
PULSE_S = 1.5
RENEW_S = 0.7


def calibrate_servos(
    port: Port = None,
    output: Annotated[
        list[int] | None,
        typer.Option(metavar="N", min=1, max=8, help="Only this output; may be repeated; default: all with a wheel."),
    ] = None,
) -> None:
    """Find each servo's neutral and deadband (µs).

    Lift the car first: its wheels turn.

    \b
    Example: foldcar calibrate-servos --output 1
    """
    from foldcar.interrupts import raised, said
    from foldcar.link.car import greet
    from foldcar.link.parameters import read_parameters, set_parameter
    from foldcar.link.ports import choose_port
    from foldcar.trials.person import Answers
    from foldcar.trials.servo_edges import find_edges

    def stopped() -> str:
        return "stopped: the results for the outputs before this one are saved"

    with said(stopped), raised(), contextlib.ExitStack() as stack:
        car = greet(choose_port(port))
        stack.callback(_still, car)
        values = read_parameters(car)
        wheels = [n for n in range(1, 9) if values.get(f"CH{n}_SIDE")]
        for number in output or []:
            if number not in wheels:
                raise FoldcarError(f"--output {number}: has no wheel; those with one are {', '.join(map(str, wheels))}")
        shown: list[tuple[int, int, float]] = []

        def renew() -> None:
            """Renew the output test, so that the wheel continues to turn."""
            car.connection.receive(0.0)
            if shown and time.monotonic() > shown[0][2]:
                _show(*shown[0][:2])

        def _show(number: int, pulse_us: int) -> None:
            car.test_output(number, pulse_us, PULSE_S)
            shown[:] = [(number, pulse_us, time.monotonic() + RENEW_S)]

        answers = Answers(renew)
        typer.echo("Lift the car so that its wheels turn freely. For each pulse type the direction in which the wheel")
        typer.echo("would drive the car: (f)orward, (b)ackward, (n)ot at all. Ctrl-C stops the wheel.")
        for number in output or wheels:
            side = {1: "left", 2: "right"}[int(values[f"CH{number}_SIDE"])]
            direction = int(values[f"CH{number}_DIRECTION"])
            typer.echo(f"\nOutput {number}, {side}")

            def turns(pulse_us: int, number: int = number, direction: int = direction) -> int:
                _show(number, pulse_us)
                ways = {"f": "forward", "b": "backward", "n": "not"}
                way = answers.choice(f"  {pulse_us} µs: f, b or n? ", ways, None)
                return {"forward": 1, "backward": -1, "not": 0}[way] * direction

            edges = find_edges(turns)
            shown.clear()
            car.stop_trial()
            found = {"NEUTRAL_US": edges.neutral_us, "DEADBAND_US": edges.deadband_us}
            for name, value in found.items():
                set_parameter(car, f"CH{number}_{name}", value)
                typer.echo(f"  CH{number}_{name} = {value:g} (was {values[f'CH{number}_{name}']:g})")
    typer.echo("\nsaved in the car; `foldcar params save FILE` keeps a copy")


def _still(car: "Car") -> None:
    """Stop the pulses if possible; the car ends a test that is not renewed by itself."""
    with contextlib.suppress(FoldcarError):
        car.stop_trial()
    car.connection.close()
