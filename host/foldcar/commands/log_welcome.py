"""Shows and checks the connected car before any trial: design, firmware, battery, faults, parameters."""

import typer

from foldcar.car.body import body_json
from foldcar.car.design import Design
from foldcar.commands.log_options import LogOptions
from foldcar.commands.typed_answers import TypedAnswers
from foldcar.errors import FoldcarError
from foldcar.link.car import Car, CarIdentity
from foldcar.link.parameters import read_file, read_parameters, set_parameter
from foldcar.simulation.carsim import Carsim
from foldcar.study.experiments import TRIAL_LIMIT, Experiment
from foldcar.study.family import Family
from foldcar.trials.identity import check_build, design_of, is_calibrated, parameter_deviations
from foldcar.typed import did_you_mean

SIMULATED_TEXT = "SIMULATED CAR"


def welcome(
    car: Car, experiment: Experiment, family: Family, carsim: Carsim, options: LogOptions, answers: TypedAnswers
) -> tuple[CarIdentity, Design]:
    """Print the car's identity and state; FoldcarError with a remedy if it cannot drive the experiment's trials."""
    identity = car.identity()
    battery = car.battery_v()
    typer.echo(f"car       {identity.name or 'without a design'} ({identity.hash or 'no car.json'}) at {car.port}")
    typer.echo(f"firmware  {identity.build}")
    if identity.simulated:
        typer.echo(f"{SIMULATED_TEXT}: its trials are stored as simulated and do not count as trials of built cars")
    elif identity.simulated is None:
        typer.echo("its firmware does not say whether it is simulated: its trials do not count until someone does")
    typer.echo(f"battery   {'unreadable' if battery is None else f'{battery:.2f} V'}")
    design = design_of(identity, experiment, family)
    if not options.any_build:
        check_build(identity, carsim.firmware)
    _end_earlier_trial(car)
    _clear_fault(car, options, answers)
    values = read_parameters(car)
    table = carsim.parameter_table()
    settings = experiment.settings(design, body_json(design), table)
    expected = {name: row.default for name, row in table.items()} | settings["parameters"]
    _fit_time_limit(car, values, settings["time_limit_s"])
    if options.parameters is not None:
        expected = read_file(options.parameters)
        unknown = [name for name in expected if name not in values]
        if unknown:
            close = did_you_mean(unknown[0].upper(), values)
            raise FoldcarError(f"{options.parameters}: {unknown[0]}: the car has no such parameter{close}")
        missing = [name for name in values if name not in expected]
        if missing:
            typer.echo(f"{options.parameters} lacks {len(missing)} of the car's parameters; these are not compared")
    against = options.parameters or "the design"
    differing = [row for row in parameter_deviations(values, expected) if row[0] != TRIAL_LIMIT]
    if differing:
        typer.echo(f"parameters that differ from {against}:")
    for name, has, wanted in differing:
        typer.echo(f"  {name:<16} {has:g} instead of {wanted:g}{'  (calibrated)' if is_calibrated(name) else ''}")
    if not differing:
        typer.echo(f"parameters as in {against}")
    return identity, design


def _end_earlier_trial(car: Car) -> None:
    """Stop a car that drives on because the program before was ended, and learn its state as it is now.

    Left alone, it would latch the fault of a silent host at our next long pause, after faults were asked for.
    """
    car.connection.catch_up()
    if car.request("FOLDCAR_TRIAL").state == car.dialect.FOLDCAR_STATE_RUNNING:
        car.stop_trial()
        typer.echo("driving   an earlier trial, which is stopped now")
        car.connection.catch_up()
        car.request("FOLDCAR_TRIAL")


def _clear_fault(car: Car, options: LogOptions, answers: TypedAnswers) -> None:
    fault = car.fault_text()
    if fault is None:
        return
    typer.echo(f"fault     {fault}")
    if not options.yes and answers.line("Acknowledge it? [Y/n] ").lower() not in ("", "y", "yes"):
        raise FoldcarError(f"the car has a fault that is not acknowledged: {fault}")
    car.acknowledge_fault()


def _fit_time_limit(car: Car, values: dict[str, float], time_limit_s: float) -> None:
    """Raise the car's limit of trial times (s) to the experiment's if it is lower."""
    if values.get(TRIAL_LIMIT, time_limit_s) < time_limit_s:
        set_parameter(car, TRIAL_LIMIT, time_limit_s)
        typer.echo(f"{TRIAL_LIMIT} set from {values[TRIAL_LIMIT]:g} to {time_limit_s:g} s for this experiment")
