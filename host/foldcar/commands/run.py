"""`foldcar run`: simulates one design in one sampled environment, prints the result and optionally draws it."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from foldcar.commands.components_option import Components
from foldcar.commands.design_settings import Settings
from foldcar.commands.json_option import Json, print_json
from foldcar.commands.listed_run import ExperimentId, Listing, Sample, listed_run
from foldcar.commands.output_option import output_file
from foldcar.errors import FoldcarError

if TYPE_CHECKING:
    from foldcar.simulation.carsim import Carsim
    from foldcar.simulation.runner import Runner

PATH_INTERVAL_S = 0.02
LEAST_NAME_WIDTH = 22


def run(
    listing: Listing,
    experiment: ExperimentId,
    settings: Settings = None,
    sample: Sample = 0,
    plot: Annotated[
        Path | None, typer.Option(metavar="FILE", callback=output_file, help="Picture to draw (.png, .svg, .pdf).")
    ] = None,
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
    listed = listed_run(listing, experiment, settings, sample)
    carsim, chosen, design, variation = listed.carsim, listed.experiment, listed.design, listed.variation
    one = _Run(
        label=f"experiment {experiment}, sample {sample}",
        body=listed.body,
        scene=listed.scene,
        settings=chosen.settings(design, listed.nominal, carsim.parameter_table()),
        sample=sample,
    )
    with listed.environment.runner(carsim, listed.environment.dynamic) as runner:
        answer = one.by(runner)
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
        from foldcar.figures.ground import carsim_heights
        from foldcar.figures.run import draw_run

        path = _path(one, carsim, answer, plot)
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


@dataclass(frozen=True)
class _Run:
    """The parts of a run of docs/carsim.md."""

    label: str
    body: Mapping[str, Any]
    scene: Mapping[str, Any]
    settings: Mapping[str, Any]
    sample: int

    def by(self, runner: "Runner", **more: float) -> dict[str, Any]:
        """The runner's answer; ``more`` is added to the settings."""
        from foldcar.simulation.runner import RunRequest
        from foldcar.store.writer import canonical_json

        settings = canonical_json({**self.settings, **more})
        (answer,) = runner.run(
            {"car": canonical_json(self.body)},
            {"scene": canonical_json(self.scene)},
            [RunRequest("car", "scene", settings, self.label, self.sample)],
        )
        return answer


def _path(one: _Run, carsim: "Carsim", answer: Mapping[str, Any], plot: Path) -> list[list[float]]:
    """The car's path, simulated by a batch; where the Scenic program ended the run, the path ends."""
    native = {} if "error" in answer else one.by(carsim, path_interval_s=PATH_INTERVAL_S)
    if "path" not in native:
        raise FoldcarError(f"{plot}: a failed run has no picture")
    return [row for row in native["path"] if row[0] <= answer["elapsed_time_s"]]
