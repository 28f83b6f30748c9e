"""`foldcar run`: simulates one design in one sampled environment, prints the result and optionally draws it."""

from pathlib import Path
from typing import Annotated

import typer

from foldcar.commands.listed_run import ExperimentId, Listing, Sample, listed_run, simulated_run
from foldcar.commands.options import Components, Engine, Json, Settings, output_file, print_json

LEAST_NAME_WIDTH = 22


def run(
    listing: Listing,
    experiment: ExperimentId,
    settings: Settings = None,
    sample: Sample = 0,
    plot: Annotated[
        Path | None, typer.Option(metavar="FILE", callback=output_file, help="Picture to draw (.png, .svg, .pdf).")
    ] = None,
    engine: Engine = "multibody",
    components: Components = None,
    as_json: Json = False,
) -> None:
    """Simulate one car in one environment.

    Prints outcome, metrics with their units in the names, and recorded values. Exit code 1 if the run failed.

    \b
    Example: foldcar run scenarios/width_study.json --experiment 1 --set width=115 --sample 3 --plot run.png
    """
    from foldcar.commands.run_text import answer_lines, answer_object, variation_text
    from foldcar.figures.output import check_format

    if plot is not None:
        check_format(plot)
    listed = listed_run(listing, experiment, settings, sample, engine)
    carsim, chosen, design, variation = listed.carsim, listed.experiment, listed.design, listed.variation
    one, answer = simulated_run(listed, sample)
    if listed.side_view_note:
        typer.echo(listed.side_view_note, err=True)
    lines = [
        ("experiment", f"{experiment}: vehicle {chosen.family.vehicle} in environment {chosen.environment}"),
        ("design", f"{design.type} " + " ".join(f"{key}={value:g}" for key, value in design.values.items())),
        ("sample", f"{sample} (seed {chosen.seed})"),
        *(
            [("variation", f"{variation_text(variation)} (seed {chosen.variation_seed})")]
            if variation
            else []
        ),
        ("success", listed.environment.success.text),
        *answer_lines(answer),
    ]
    width = max(LEAST_NAME_WIDTH, *(len(name) + 1 for name, _ in lines))
    if not as_json:
        for name, text in lines:
            typer.echo(f"{name:<{width}}{text}")
    if plot is not None:
        from foldcar.figures.run import draw_run
        from foldcar.simulation.heights import carsim_heights

        path = one.path(carsim, answer, plot)
        draw_run(one.body, one.scene, answer, path, carsim_heights(carsim), plot)
        if not as_json:
            typer.echo(f"{'picture':<{width}}{plot}")
    if as_json:
        print_json(
            {
                "experiment": experiment,
                "vehicle": chosen.family.vehicle,
                "environment": chosen.environment,
                "vehicle_type": design.type,
                "design": design.columns,
                "sample": sample,
                "seed": chosen.seed,
                "variation": variation,
                "variation_seed": chosen.variation_seed,
                **answer_object(answer),
                "picture": plot,
            }
        )
    if "error" in answer:
        raise typer.Exit(1)

