"""`foldcar link`: runs a design in a sampled environment as a simulated car for any MAVLink program."""

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
        int, typer.Option(metavar="K", min=0, help="Number of the sampled environment and built car.")
    ] = 0,
    speedup: Annotated[
        float, typer.Option(metavar="N", min=0.01, max=1000, help="Rate of simulated time relative to real time.")
    ] = 1.0,
    tcp: Annotated[
        int | None,
        typer.Option(
            metavar="PORT", min=0, max=65535, help="A loopback TCP port instead of a pseudo-terminal; 0: any free port."
        ),
    ] = None,
    components: Components = None,
) -> None:
    """Simulate a car on USB until Ctrl-C. The first line printed is its port; typed lines inject faults."""
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
                # A new port after an unplugged cable, or the answer to an injected fault.
                typer.echo(json.loads(line).get("port", line.rstrip("\n")))
            said = car.process.stderr.read().strip().splitlines()
            code = car.process.wait()
        if code != 0:
            raise CarsimError(f"{carsim.binary} link: {said[-1] if said else f'exit code {code}'}")
    except KeyboardInterrupt:
        typer.echo("ended", err=True)
