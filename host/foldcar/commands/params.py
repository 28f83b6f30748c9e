"""`foldcar params` shows and sets a car's parameters.

`foldcar calibrate-servos` measures neutral and dead band of each wheel's servo by observing the wheel.
"""

import contextlib
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Annotated

import typer

from foldcar.commands.options import Port
from foldcar.errors import FoldcarError
from foldcar.typed import decimal_number, did_you_mean

if TYPE_CHECKING:
    from foldcar.link.car import ConnectedCar

params = typer.Typer(
    name="params",
    help="Read and set a car's parameters.\n\n\b\nExample: foldcar params get CH1_NEUTRAL_US",
    no_args_is_help=True,
    rich_markup_mode=None,
)


@params.command()
def get(
    names: Annotated[list[str] | None, typer.Argument(metavar="NAME", help="Parameters to show; default: all.")] = None,
    port: Port = None,
) -> None:
    """Show parameters and their values.

    \b
    Example: foldcar params get CH1_NEUTRAL_US CH1_DEADBAND_US
    """
    from foldcar.link.parameters import read_parameters

    with _car(port) as car:
        values = read_parameters(car)
    for name in names or values:
        if name not in values:
            raise FoldcarError(f"{name}: the car has no such parameter{did_you_mean(name.upper(), values)}")
    _print_parameters({name: values[name] for name in names or values})


@params.command("set")
def set_one(
    name: Annotated[str, typer.Argument(metavar="NAME", help="Name of the parameter.")],
    value: Annotated[str, typer.Argument(metavar="VALUE", help="Its new value.")],
    port: Port = None,
) -> None:
    """Set one parameter and save it in the car.

    \b
    Example: foldcar params set CH1_NEUTRAL_US 1512
    """
    from foldcar.link.parameters import set_parameter

    try:
        new_value = decimal_number(value)
    except ValueError:
        raise FoldcarError(f'VALUE: "{value}" is not a number; write it with a decimal point, such as 1512.5') from None
    with _car(port) as car:
        set_parameter(car, name, new_value)
    _print_parameters({name: new_value})


@params.command()
def confirm(port: Port = None) -> None:
    """Allow a car without a readable car.json to drive.

    The car then uses its stored parameters until it restarts. The command prints these parameters.

    \b
    Example: foldcar params confirm
    """
    from foldcar.car.body import CHANNELS
    from foldcar.link.parameters import read_parameters

    with _car(port) as car:
        design, dialect = car.request("FOLDCAR_DESIGN"), car.dialect
        if design.source == dialect.FOLDCAR_DESIGN_SOURCE_FILE:
            raise FoldcarError(f"the car has a design, {design.name}: there is nothing to confirm")
        if design.source == dialect.FOLDCAR_DESIGN_SOURCE_REFUSED:
            raise FoldcarError("the car refuses its own car.json: load the design again with `foldcar flash`")
        fault = car.fault_text()
        # With this source, a person has confirmed already that the car drives without its file.
        is_confirmed = design.source == dialect.FOLDCAR_DESIGN_SOURCE_NONE
        if not is_confirmed:
            car.acknowledge_fault(without_design=True)
        values = read_parameters(car)
    names = ("WHEEL_RADIUS_M", "TRACK_M", *(f"CH{n}_SIDE" for n in range(1, CHANNELS + 1)))
    lines = [f"acknowledged: {fault}"] if fault is not None else []
    lines.append("until it restarts, the car drives by these parameters:")
    _print_parameters({name: values[name] for name in names}, *lines)


def calibrate_servos(
    port: Port = None,
    servo: Annotated[
        list[int] | None,
        typer.Option(metavar="N", min=1, max=8, help="Output of a servo; may be repeated; default: all with a wheel."),
    ] = None,
) -> None:
    """Measure each servo's neutral and dead band (µs).

    Lift the car first, because its wheels turn. The command asks in which direction each wheel turns.

    \b
    Example: foldcar calibrate-servos --servo 1
    """
    from foldcar.interrupts import message_on_signal
    from foldcar.trials.servo_edges import calibrate_outputs

    stopped = "stopped: the results for the outputs before this one are saved"
    with message_on_signal(lambda: stopped), _car(port) as car:
        try:
            calibrate_outputs(car, servo or [])
        finally:
            # Stop if possible; otherwise the car ends the test itself, as the host no longer renews it.
            with contextlib.suppress(FoldcarError):
                car.stop_trial()
    typer.echo("\nsaved in the car")


def _print_parameters(values: Mapping[str, float], *lines: str) -> None:
    """Print the ``lines``, then a line for each parameter with its value."""
    from foldcar.link.parameters import value_text

    for line in lines:
        typer.echo(line)
    for name, value in values.items():
        typer.echo(f"{name:<16} {value_text(value)}")


@contextlib.contextmanager
def _car(port: str | None) -> Iterator["ConnectedCar"]:
    """Yield the car at ``port`` (None: the only port with a board); close the connection at the end of the block."""
    from foldcar.link.car import greeted
    from foldcar.link.stream import choose_port

    with greeted(choose_port(port)) as car:
        yield car
