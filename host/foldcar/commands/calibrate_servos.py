"""`foldcar calibrate-servos`: measures neutral and deadband of each wheel's servo by observing the wheel."""

import contextlib
from typing import Annotated

import typer

from foldcar.commands.options import Port
from foldcar.errors import FoldcarError


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
    from foldcar.link.ports import choose_port
    from foldcar.trials.servo_edges import calibrate_outputs

    stopped = "stopped: the results for the outputs before this one are saved"
    with said(lambda: stopped), raised(), contextlib.ExitStack() as stack:
        car = greet(choose_port(port))
        stack.callback(car.connection.close)
        try:
            calibrate_outputs(car, output or [])
        finally:
            # If possible; the car ends a test that is not renewed by itself.
            with contextlib.suppress(FoldcarError):
                car.stop_trial()
    typer.echo("\nsaved in the car; `foldcar params save FILE` keeps a copy")
