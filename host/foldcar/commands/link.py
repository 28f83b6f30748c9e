"""`foldcar link`: runs a design in a sampled environment as a simulated car for any MAVLink program."""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import typer

from foldcar.commands.listed_run import ListedRun, listed_run
from foldcar.commands.options import Components, Engine, ExperimentId, Listing, Sample, Settings, print_note

# Samples to which a host can move the car; drawing this many takes some seconds.
MAX_SAMPLES = 1000


def link(
    listing: Listing,
    experiment: ExperimentId,
    settings: Settings = None,
    sample: Sample = 0,
    speedup: Annotated[
        float, typer.Option(metavar="N", min=0.01, max=1000, help="Rate of simulated time relative to real time.")
    ] = 1.0,
    tcp: Annotated[
        int | None,
        typer.Option(
            metavar="PORT", min=0, max=65535, help="A loopback TCP port instead of a pseudo-terminal; 0: any free port."
        ),
    ] = None,
    reality: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="JSON of what car and ground truly are, unknown to the host."),
    ] = None,
    car: Annotated[
        str | None,
        typer.Option(metavar="NAME", help="Be the built car of that name, the same in every sample; else the sample's."),
    ] = None,
    engine: Engine = "multibody",
    components: Components = None,
) -> None:
    """Pose as a car on USB, simulated, until Ctrl-C.

    `foldcar log` moves the car to the sample of each trial.
    The first line printed is its port; typed lines inject faults (docs/carsim.md).

    \b
    Example: foldcar link scenarios/width_study.json --experiment 1 --set width=95
    """
    import json
    import sys

    from foldcar.car.body import car_json
    from foldcar.inference.calibration.environment import read_reality
    from foldcar.interrupts import message_on_signal
    from foldcar.link.simulated_car import simulated_car
    from foldcar.simulation.runner import CarsimError
    from foldcar.store.trial_records import checked_name

    built = None if car is None else checked_name(car, "--car")
    one = listed_run(listing, experiment, settings, sample, engine)
    if built is not None and reality is None and not one.experiment.variation:
        print_note(f"experiment {one.experiment.id} has no variation: {built} is as designed, like every other car")
    values = None if reality is None else read_reality(reality, engine)
    others = (k for k in range(min(one.experiment.environments, MAX_SAMPLES)) if k != sample)
    worlds = [_world(one, k, values, built) for k in (sample, *others)]
    # carsim ends when its reader does: see sim2d/src/reader_watch.h.
    design, stdin = car_json(one.design), sys.stdin.fileno()
    with (
        simulated_car(one.carsim.command, worlds, design, speedup, tcp, stdin) as linked,
        message_on_signal(lambda: "ended"),
    ):
        typer.echo(linked.port)
        if one.side_view_note:
            typer.echo(one.side_view_note, err=True)
        typer.echo(f"{one.design.type} in sample {sample}; Ctrl-C ends", err=True)
        assert linked.process.stdout is not None and linked.process.stderr is not None
        for line in linked.process.stdout:
            # A new port after an unplugged cable, or the answer to an injected fault.
            typer.echo(json.loads(line).get("port", line.rstrip("\n")))
        messages = linked.process.stderr.read().strip().splitlines()
        code = linked.process.wait()
    if code != 0:
        raise CarsimError(f"{one.carsim.binary} link: {messages[-1] if messages else f'exit code {code}'}")


def _world(one: ListedRun, k: int, reality: Mapping[str, float] | None, car: str | None) -> tuple[Any, Any]:
    """Body and scene of sample ``k``, as they are in ``reality``; the scene's id is the one that `foldcar log` expects.

    The name of a built ``car`` draws what belongs to the car; without one it is the sample's.
    """
    from foldcar.inference.calibration.environment import real_run
    from foldcar.scenes.fingerprint import scene_name

    scene, limits = one.environment.sample(k), one.carsim.limits().numbers
    if reality is None:
        body, true_scene = one.body_in(k, car), scene
    else:
        body, true_scene = real_run(one.experiment, one.nominal, scene, reality, k, limits, car)
    return body, {**true_scene, "id": scene_name(scene, k)}
