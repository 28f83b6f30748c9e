"""`foldcar calibrate`: infers the simulator's parameters from the trials of a store."""

import re
from pathlib import Path
from typing import Annotated

import typer

from foldcar.commands.options import Jobs, Json, Seed, SimulatedTrialsInstead, output_store, print_result
from foldcar.errors import FoldcarError
from foldcar.installation import usable_processors

# What a name may be, so that it can be typed and stand in the names of experiments.
NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,39}")
DEFAULT_RUNS = 24_000
MIN_RUNS, MAX_RUNS = 500, 10_000_000


def calibrate(
    store: Annotated[
        Path,
        typer.Argument(metavar="STORE", callback=output_store, help="A store with a swept experiment and trials of it."),
    ],
    name: Annotated[str, typer.Option(metavar="NAME", help="Name of the calibration in the store.")] = "trials",
    experiment: Annotated[
        str | None, typer.Option(metavar="ID", help="Experiment whose trials count; default: the only one with trials.")
    ] = None,
    runs: Annotated[
        int, typer.Option(metavar="N", min=MIN_RUNS, max=MAX_RUNS, help="Runs to simulate, roughly.")
    ] = DEFAULT_RUNS,
    seed: Seed = 1,
    jobs: Jobs = None,
    leave_one_out: Annotated[
        bool, typer.Option("--leave-one-out", help="Also predict each design from the trials of the others.")
    ] = False,
    simulated_trials: SimulatedTrialsInstead = False,
    evidence: Annotated[
        str,
        typer.Option(metavar="WHAT", help="What of trials counts: outcomes; times, too; or all, paths, too."),
    ] = "paths",
    known: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME=VALUE", help="A measured value; replaces that of `foldcar trials measure`."),
    ] = None,
    replace: Annotated[bool, typer.Option("--replace", help="Replace the calibration of that name.")] = False,
    as_json: Json = False,
) -> None:
    """Infer the simulator's parameters from trials.

    Friction, servos, heights, centre of mass, track and scatter, each with a prior, as far as the trials tell: by
    outcomes, times, and paths by a film (`foldcar track`) or by a simulated car's log. The store keeps the result:
    `foldcar sweep LISTING --calibration NAME` simulates under it. It says which parameters the trials cannot tell apart,
    and which further trials would.

    \b
    Example: foldcar calibrate study.db --name published --leave-one-out
    """
    from foldcar.commands.progress_bar import TerminalBar
    from foldcar.commands.tables import print_calibration
    from foldcar.inference.calibration.experiment import Simulator, nominal_counts, read_experiment
    from foldcar.inference.calibration.inference import infer, plan
    from foldcar.inference.calibration.observations import EVIDENCE, experiment_with_trials, observe
    from foldcar.inference.calibration.parameters import built_priors, measured_priors, measured_value
    from foldcar.inference.calibration.summary import summarise
    from foldcar.interrupts import message_on_signal
    from foldcar.simulation.carsim import Carsim
    from foldcar.store.calibrations import check_calibration_name, measured_values, new_calibration, write_calibrations
    from foldcar.store.reader import Store

    if not NAME.fullmatch(name):
        raise FoldcarError(f'--name "{name}": a name is at most 40 letters, digits, _ . or -, a letter or digit first')
    if evidence not in EVIDENCE:
        raise FoldcarError(f"--evidence {evidence}: not one of {', '.join(EVIDENCE)}")
    given = dict(measured_value(text, "--known") for text in known or [])
    with Store.open(store) as opened:
        check_calibration_name(opened, name, replace)
        chosen = read_experiment(opened, experiment_with_trials(opened, experiment))
        observed = observe(opened, chosen, simulated_trials, evidence)
        nominal = nominal_counts(opened, chosen)
        # They were measured on built cars and their obstacles.
        stored = {} if simulated_trials else measured_values(opened, chosen.info.id)
    priors = {} if simulated_trials else built_priors(chosen.info.vehicle_type, observed.from_sheets)
    priors |= measured_priors({**stored, **given}, f"{store}: measured")
    carsim = Carsim()
    simulator = Simulator(chosen, carsim, jobs or usable_processors(), seed)
    planned = plan(runs, observed, len(chosen.designs)).runs
    with message_on_signal(lambda: "stopped: nothing is stored"), TerminalBar("calibrate", planned) as bar:
        inference = infer(simulator, observed, runs, bar.done, priors)
        summary = summarise(inference, chosen, nominal, seed, planned, leave_one_out)
    made = new_calibration(name, chosen.info.id, carsim.build, inference.draws, summary)

    with write_calibrations(store) as writer:
        writer.put(made, replace)
    if as_json:
        print_result(True, {"store": store, "name": name, "draws": [dict(draw) for draw in made.draws], **summary})
    else:
        print_calibration(made)
        typer.echo(f'calibration "{name}": {len(made.draws)} draws; store: {store}')
