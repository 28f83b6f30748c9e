"""`foldcar link`: a design in a sampled environment as a simulated car that any MAVLink program can drive."""

from pathlib import Path
from typing import Annotated

import typer

from foldcar.commands.components_option import Components
from foldcar.commands.design_settings import Settings, design_settings


def link(
    listing: Annotated[Path, typer.Argument(metavar="LISTING", help="Experiment listing (JSON).")],
    experiment: Annotated[str, typer.Option(metavar="ID", help="Experiment of the listing.")],
    settings: Settings = None,
    sample: Annotated[
        int, typer.Option(metavar="K", min=0, help="Which sampled environment, and nearby car.")
    ] = 0,
    speedup: Annotated[
        float, typer.Option(metavar="N", min=0.01, max=1000, help="How much faster than the clock.")
    ] = 1.0,
    tcp: Annotated[
        int | None,
        typer.Option(metavar="PORT", min=0, max=65535, help="A loopback TCP port, not a terminal; 0: any free one."),
    ] = None,
    components: Components = None,
) -> None:
    """Pose as a car on USB until Ctrl-C. The first line printed is the port; faults may be typed (docs/carsim.md)."""
    import json
    import sys

    from foldcar.car.body import body_json
    from foldcar.car.car_file import car_json
    from foldcar.car.variation.vary_body import vary_body
    from foldcar.commands.end_signals import end_like_ctrl_c
    from foldcar.link.simulated_car import simulated_car
    from foldcar.simulation.carsim import Carsim
    from foldcar.simulation.runner import CarsimError
    from foldcar.study.environments import Environment
    from foldcar.study.experiments import read_study

    (chosen,) = read_study(listing, experiment).experiments
    design = chosen.family.narrowed(design_settings(settings or [])).single()
    environment = Environment(chosen)
    variation = environment.variation(sample)
    nominal = body_json(design)
    carsim = Carsim()
    body = vary_body(nominal, variation, carsim.limits().numbers) if variation else nominal
    scene = environment.sample(sample)
    end_like_ctrl_c()
    try:
        with simulated_car(
            carsim.binary, body, scene, car_json(design), speedup, tcp, sys.stdin.fileno()
        ) as car:
            typer.echo(car.port)
            typer.echo(f"{design.type} in sample {sample}; Ctrl-C ends", err=True)
            assert car.process.stdout is not None and car.process.stderr is not None
            for line in car.process.stdout:
                # Another port after a pulled cable; what became of a fault that was typed.
                typer.echo(json.loads(line).get("port", line.rstrip("\n")))
            said = car.process.stderr.read().strip().splitlines()
            code = car.process.wait()
        if code != 0:
            raise CarsimError(f"{carsim.binary} link: {said[-1] if said else f'exit code {code}'}")
    except KeyboardInterrupt:
        typer.echo("ended", err=True)
