"""`foldcar calibrate`: infers the simulator's parameters from the trials of a store."""

import re
from pathlib import Path
from typing import Annotated

import typer

from foldcar.commands.options import Jobs, Json, Seed, SimulatedTrials, output_store, print_result
from foldcar.errors import FoldcarError
from foldcar.installation import usable_processors

# Names of calibrations: easy to type, and allowed as a part of an experiment's name.
NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,39}")
DEFAULT_RUNS = 24_000
MIN_RUNS, MAX_RUNS = 500, 10_000_000


def calibrate(
    store: Annotated[
        Path,
        typer.Argument(metavar="STORE", callback=output_store, help="Store with a swept experiment and its trials."),
    ],
    name: Annotated[str, typer.Option(metavar="NAME", help="Name of the calibration in the store.")] = "trials",
    experiment: Annotated[
        str | None, typer.Option(metavar="ID", help="Experiment whose trials to use; default: the only one with trials.")
    ] = None,
    runs: Annotated[
        int, typer.Option(metavar="N", min=MIN_RUNS, max=MAX_RUNS, help="Approximate number of runs to simulate.")
    ] = DEFAULT_RUNS,
    seed: Seed = 1,
    jobs: Jobs = None,
    leave_one_out: Annotated[
        bool, typer.Option("--leave-one-out", help="Also predict each design from the trials of the other designs.")
    ] = False,
    simulated_trials: SimulatedTrials = False,
    known: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=VALUE", help="Use this measured value; it replaces the value of `foldcar trials measure`."
        ),
    ] = None,
    replace: Annotated[bool, typer.Option("--replace", help="Replace an existing calibration of that name.")] = False,
    as_json: Json = False,
) -> None:
    """Infer the simulator's parameters from trials.

    The parameters are friction, servos, obstacle heights, centre of mass, track and the scatter of starts and wheels.
    Each has a prior, which the trials' outcomes update. Measure obstacle heights, centre of mass and track first
    (`foldcar trials measure`).

    The store keeps the result, and `foldcar sweep LISTING --calibration NAME` simulates with it. The summary names
    parameters that the trials cannot tell apart.

    \b
    Example: foldcar calibrate study.db --name published --leave-one-out
    """
    from foldcar.belief.priors import built_priors, measured_priors, measured_value
    from foldcar.commands.progress_bar import TerminalBar
    from foldcar.commands.tables import print_calibration
    from foldcar.inference.calibration.experiment import Simulator, nominal_counts, read_experiment
    from foldcar.inference.calibration.inference import infer, plan
    from foldcar.inference.calibration.observations import experiment_with_trials, observe
    from foldcar.inference.calibration.summary import summarise
    from foldcar.interrupts import message_on_signal
    from foldcar.simulation.carsim import Carsim
    from foldcar.store.calibrations import check_calibration_name, measured_values, new_calibration, write_calibrations
    from foldcar.store.reader import Store

    if not NAME.fullmatch(name):
        raise FoldcarError(f'--name "{name}": a name is at most 40 letters, digits, _ . or -, a letter or digit first')
    known_values = dict(measured_value(text, "--known") for text in known or [])
    with Store.open(store) as reader:
        check_calibration_name(reader, name, replace)
        swept_experiment = read_experiment(reader, experiment_with_trials(reader, experiment))
        observations = observe(reader, swept_experiment, simulated_trials)
        nominal = nominal_counts(reader, swept_experiment)
        # The stored values were measured on built cars and real obstacles, so they do not apply to simulated trials.
        stored = {} if simulated_trials else measured_values(reader, swept_experiment.info.id)
    priors = (
        {}
        if simulated_trials
        else built_priors(swept_experiment.info.vehicle_type, observations.from_sheets, observations.supply_ratio)
    )
    priors |= measured_priors({**stored, **known_values}, f"{store}: measured")
    carsim = Carsim()
    simulator = Simulator(swept_experiment, carsim, jobs or usable_processors(), seed)
    planned_runs = plan(runs, observations, len(swept_experiment.designs)).runs
    with message_on_signal(lambda: "stopped: nothing was stored"), TerminalBar("calibrate", planned_runs) as bar:
        inference = infer(simulator, observations, runs, bar.done, priors)
        summary = summarise(inference, swept_experiment, nominal, seed, planned_runs, leave_one_out)
    calibration = new_calibration(name, swept_experiment.info.id, carsim.build, inference.draws, summary)

    with write_calibrations(store) as writer:
        writer.put(calibration, replace)
    if as_json:
        print_result(True, {"store": store, "name": name, "draws": [dict(draw) for draw in calibration.draws], **summary})
    else:
        print_calibration(calibration)
        typer.echo(f'calibration "{name}": {len(calibration.draws)} draws; store: {store}')
