"""`foldcar link` simulates a car in a sampled environment and lets any MAVLink program control it."""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import typer

from foldcar.commands.listed_run import ListedRun, listed_run
from foldcar.commands.options import Components, Engine, ExperimentId, Listing, Sample, Settings, print_note

# Largest number of samples that a host can choose from; drawing this many takes some seconds.
MAX_SAMPLES = 1000


def link(
    listing: Listing,
    experiment: ExperimentId,
    settings: Settings = None,
    sample: Sample = 0,
    speedup: Annotated[
        float, typer.Option(metavar="N", min=0.01, max=1000, help="Ratio of simulated time to real time.")
    ] = 1.0,
    tcp: Annotated[
        int | None,
        typer.Option(
            metavar="PORT", min=0, max=65535, help="Use a loopback TCP port, not a pseudo-terminal; 0: any free port."
        ),
    ] = None,
    reality: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="JSON file with the true parameters of car and ground, hidden from the host."),
    ] = None,
    car: Annotated[
        str | None,
        typer.Option(
            metavar="NAME", help="Simulate the same built car in all samples; default: a different car in each sample."
        ),
    ] = None,
    engine: Engine = "multibody",
    components: Components = None,
) -> None:
    """Simulate a car on USB until Ctrl-C.

    The first line printed is the car's port, to which `foldcar log` and other MAVLink programs connect. `foldcar log`
    also chooses the sample for each trial. Type a line to inject a fault (docs/carsim.md).

    \b
    Example: foldcar link scenarios/width_study.json --experiment 1 --set width=95
    """
    import json
    import sys

    from foldcar.car.body import car_json
    from foldcar.interrupts import message_on_signal
    from foldcar.link.simulated_car import simulated_car
    from foldcar.simulation.runner import CarsimError
    from foldcar.store.trial_records import checked_name
    from foldcar.study.reality_environment import read_reality

    car_name = None if car is None else checked_name(car, "--car")
    run = listed_run(listing, experiment, settings, sample, engine)
    if car_name is not None and reality is None and not run.experiment.variation:
        print_note(f"experiment {run.experiment.id} has no variation: {car_name} has the nominal body, as all cars have")
    real_values = None if reality is None else read_reality(reality, engine).values
    sample_count = min(run.experiment.environments, MAX_SAMPLES)
    # The car starts in the first world; the host may move it to the others.
    samples = [sample, *(other for other in range(sample_count) if other != sample)]
    worlds = [_scene_and_reality(run, world_sample, real_values, car_name) for world_sample in samples]
    # carsim ends when the process that reads its output ends: see sim2d/src/reader_watch.h.
    design, stdin = car_json(run.design), sys.stdin.fileno()
    with (
        simulated_car(run.carsim.command, run.body, worlds, design, speedup, tcp, stdin) as linked,
        message_on_signal(lambda: "ended"),
    ):
        typer.echo(linked.port)
        if run.side_view_note:
            typer.echo(run.side_view_note, err=True)
        typer.echo(f"{run.design.type} in sample {sample}; Ctrl-C ends", err=True)
        assert linked.process.stdout is not None and linked.process.stderr is not None
        for line in linked.process.stdout:
            # carsim prints a new port after an unplugged cable, and an answer to each injected fault.
            typer.echo(json.loads(line).get("port", line.rstrip("\n")))
        messages = linked.process.stderr.read().strip().splitlines()
        code = linked.process.wait()
    if code != 0:
        reason = messages[-1] if messages else f"exit code {code}"
        raise CarsimError(f"{run.carsim.binary} link: {reason}")


def _scene_and_reality(
    run: ListedRun, sample: int, values: Mapping[str, float] | None, car: str | None
) -> tuple[Any, Any]:
    """Return the scene of a sample, and how the real car and ground differ from the design and the scene.

    These differences are called the reality. The scene has the id that `foldcar log` expects. ``values`` are the
    parameters of a reality file, or None if none was given. ``car`` is the name of a built car, which is the same in all
    samples. If it is None, each sample has another car of the design.
    """
    from foldcar.belief.reality import drawn_reality
    from foldcar.car.variation import named_car
    from foldcar.scenes.fingerprint import scene_name

    scene = run.environment.sample(sample)
    scene_with_id = {**scene, "id": scene_name(scene, sample)}
    if values is None:
        return scene_with_id, run.variation_in(sample, car)
    experiment = run.experiment
    reality = drawn_reality(
        values,
        listed=experiment.variation,
        seed=experiment.variation_seed,
        drive=sample,
        # What identifies the car among all cars of the design.
        car=sample if car is None else named_car(car),
    )
    return scene_with_id, reality
