"""`foldcar params` shows and sets a car's parameters, and saves, loads and compares files of them.

`foldcar calibrate-servos` measures neutral and dead band of each wheel's servo by observing the wheel.
"""

import contextlib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from foldcar.commands.options import Json, Port, output_file, print_result
from foldcar.errors import FoldcarError
from foldcar.typed import did_you_mean

if TYPE_CHECKING:
    from foldcar.link.car import Car

ParameterFile = Annotated[
    Path, typer.Argument(metavar="FILE", help="Parameter file: lines of NAME VALUE, comments after #.")
]

params = typer.Typer(
    name="params",
    help="Read and set a car's parameters.\n\n\b\nExample: foldcar params save car95.parm",
    no_args_is_help=True,
    rich_markup_mode=None,
)


@params.command()
def get(
    names: Annotated[list[str] | None, typer.Argument(metavar="NAME", help="Parameters to show; default: all.")] = None,
    port: Port = None,
    as_json: Json = False,
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
    _print_parameters(as_json, {name: values[name] for name in names or values})


@params.command("set")
def set_one(
    name: Annotated[str, typer.Argument(metavar="NAME", help="Name of the parameter.")],
    value: Annotated[float, typer.Argument(metavar="VALUE", help="Its new value.")],
    port: Port = None,
    as_json: Json = False,
) -> None:
    """Set one parameter and save it in the car.

    \b
    Example: foldcar params set CH1_NEUTRAL_US 1512
    """
    from foldcar.link.parameters import set_parameter

    with _car(port) as car:
        set_parameter(car, name, value)
    _print_parameters(as_json, {name: value})


@params.command()
def save(
    file: Annotated[Path, typer.Argument(metavar="FILE", callback=output_file, help="File to write.")],
    port: Port = None,
    as_json: Json = False,
) -> None:
    """Write all parameters of the car to a file.

    The file has lines of NAME VALUE, as MAVProxy and Mission Planner read them.

    \b
    Example: foldcar params save car95.parm
    """
    from foldcar.link.parameters import read_parameters, write_file

    with _car(port) as car:
        identity = car.identity()
        values = read_parameters(car)
    name = identity.name or "a car without a design"
    write_file(file, values, f"parameters of {name} ({identity.hash or 'no car.json'}), firmware {identity.build}")
    print_result(as_json, {"file": file, "parameters": _numbers(values)}, f"{file}: {len(values)} parameters")


@params.command()
def load(file: ParameterFile, port: Port = None, as_json: Json = False) -> None:
    """Set the car's parameters to the values in a file.

    Parameters that are not in the file keep their values. Nothing is set if the car lacks one of them.

    \b
    Example: foldcar params load car95.parm
    """
    from foldcar.link.parameters import differences, read_file, read_parameters, set_parameter, value_text

    file_values = read_file(file)
    set_values: dict[str, float] = {}
    refused: list[str] = []
    with _car(port) as car:
        car_values = read_parameters(car)
        unknown = [name for name in file_values if name not in car_values]
        if unknown:
            close = did_you_mean(unknown[0].upper(), car_values)
            raise FoldcarError(f"{file}: {unknown[0]}: the car has no such parameter; nothing was set{close}")
        differing = [name for name, _, _ in differences(car_values, file_values) if name in file_values]
        for name in differing:
            try:
                set_parameter(car, name, file_values[name])
                set_values[name] = file_values[name]
                if not as_json:
                    typer.echo(f"{name:<16} {value_text(file_values[name])}")
            except FoldcarError as error:
                refused.append(str(error))
                typer.echo(f"{error}", err=True)
    unchanged = len(file_values) - len(differing)
    result = {"set": set_values, "unchanged": unchanged, "refused": refused}
    print_result(as_json, result, f"{len(set_values)} parameters set, {unchanged} unchanged")
    if refused:
        raise FoldcarError(
            f"{file}: {len(refused)} of {len(file_values)} parameters were refused, the first is {refused[0]}"
        )


@params.command()
def diff(file: ParameterFile, port: Port = None, as_json: Json = False) -> None:
    """Show how the car's parameters differ from a file's.

    \b
    Example: foldcar params diff car95.parm
    """
    from foldcar.link.parameters import differences, read_file, read_parameters

    file_values = read_file(file)
    with _car(port) as car:
        rows = differences(read_parameters(car), file_values)
    differing = {name: _numbers({"car": in_car, "file": in_file}) for name, in_car, in_file in rows}
    lines = [f"{name:<16} {_text(in_car):>12} {_text(in_file):>12}" for name, in_car, in_file in rows]
    one_sided = sum(in_car is None or in_file is None for _, in_car, in_file in rows)
    one_sided_text = f"; {one_sided} are only in the car or only in the file" if one_sided else ""
    print_result(
        as_json,
        {"compared": len(file_values), "differing": differing},
        *([f"{'':<16} {'car':>12} {'file':>12}", *lines] if rows else []),
        f"{len(rows) - one_sided} of {len(file_values)} parameters differ{one_sided_text}",
    )


@params.command()
def confirm(port: Port = None, as_json: Json = False) -> None:
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
        if design.source != dialect.FOLDCAR_DESIGN_SOURCE_NONE:
            car.acknowledge_fault(without_design=True)
        values = read_parameters(car)
    names = ("WHEEL_RADIUS_M", "TRACK_M", *(f"CH{n}_SIDE" for n in range(1, CHANNELS + 1)))
    lines = [f"acknowledged: {fault}"] if fault is not None else []
    lines.append("until it restarts, the car drives by these parameters:")
    _print_parameters(as_json, {name: values[name] for name in names}, *lines, acknowledged=fault)


def calibrate_servos(
    port: Port = None,
    output: Annotated[
        list[int] | None,
        typer.Option(metavar="N", min=1, max=8, help="Servo output; may be repeated; default: all with a wheel."),
    ] = None,
) -> None:
    """Measure each servo's neutral and dead band (µs).

    Lift the car first, because its wheels turn. The command asks in which direction each wheel turns.

    \b
    Example: foldcar calibrate-servos --output 1
    """
    from foldcar.interrupts import message_on_signal
    from foldcar.trials.servo_edges import calibrate_outputs

    stopped = "stopped: the results for the outputs before this one are saved"
    with message_on_signal(lambda: stopped), _car(port) as car:
        try:
            calibrate_outputs(car, output or [])
        finally:
            # Stop if possible; otherwise the car ends the test itself, as the host no longer renews it.
            with contextlib.suppress(FoldcarError):
                car.stop_trial()
    typer.echo("\nsaved in the car; `foldcar params save FILE` keeps a copy")


def _print_parameters(as_json: bool, values: Mapping[str, float], *lines: str, **json_entries: Any) -> None:
    """Print parameters, one a line, after the ``lines``; as JSON, with the ``json_entries`` and without the lines."""
    rows = (f"{name:<16} {_text(value)}" for name, value in values.items())
    print_result(as_json, {**json_entries, "parameters": _numbers(values)}, *lines, *rows)


@contextlib.contextmanager
def _car(port: str | None) -> Iterator["Car"]:
    """Yield the car at ``port`` (None: the only port with a board); close the connection at the end of the block."""
    from foldcar.link.car import greet
    from foldcar.link.stream import choose_port

    car = greet(choose_port(port))
    try:
        yield car
    finally:
        car.connection.close()


def _numbers(values: "Mapping[str, float] | Mapping[str, float | None]") -> dict[str, float | None]:
    """Return the values rounded to the shortest decimals that give the car's 32-bit numbers."""
    return {name: None if value is None else float(_text(value)) for name, value in values.items()}


def _text(value: float | None) -> str:
    """Return a parameter's value as text; "-" for None."""
    from foldcar.link.parameters import value_text

    return "-" if value is None else value_text(value)
