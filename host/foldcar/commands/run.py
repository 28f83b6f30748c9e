"""`foldcar run`: one design in one sampled environment, its result as text, its picture if asked for."""

from pathlib import Path
from typing import Annotated

import typer

from foldcar.errors import FoldcarError

PATH_INTERVAL_S = 0.02


def run(
    listing: Annotated[Path, typer.Argument(metavar="LISTING", help="Experiment listing (JSON).")],
    experiment: Annotated[str, typer.Option(metavar="ID", help="Experiment of the listing.")],
    settings: Annotated[
        list[str] | None,
        typer.Option(
            "--set", metavar="NAME=MM", help="Choose a design parameter, e.g. width=95 or W.length=60."
        ),
    ] = None,
    sample: Annotated[int, typer.Option(metavar="K", min=0, help="Which sampled environment.")] = 0,
    plot: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Picture to draw (.png, .svg, .pdf).")
    ] = None,
) -> None:
    """Run one car in one environment and say how it went."""
    from foldcar.body import body_json
    from foldcar.carsim import Carsim, RunRequest
    from foldcar.experiments import read_study
    from foldcar.figures.output import check_format
    from foldcar.store_writer import canonical_json
    from foldcar.sweep import Environment

    if plot is not None:
        check_format(plot)
    (chosen,) = read_study(listing, experiment).experiments
    design = chosen.family.narrowed(_settings(settings or [])).single()
    carsim = Carsim()
    body = body_json(design)
    request = chosen.settings(design, body, carsim.parameter_table())
    if plot is not None:
        request["path_interval_s"] = PATH_INTERVAL_S
    scene = Environment(chosen).sample(sample)
    label = f"experiment {experiment}, sample {sample}"
    (result,) = carsim.run(
        {"car": canonical_json(body)},
        {"scene": canonical_json(scene)},
        [RunRequest("car", "scene", canonical_json(request), label)],
    )
    for name, value in (
        ("experiment", f"{experiment}: vehicle {chosen.family.vehicle} in environment {chosen.environment}"),
        ("design", f"{design.type} " + " ".join(f"{key}={value:g}" for key, value in design.values.items())),
        ("sample", f"{sample} (seed {chosen.seed})"),
        ("outcome", result["outcome"]),
        ("elapsed_time_s", f"{result['elapsed_time_s']:.3f}"),
        ("distance_to_target_m", f"{result['distance_to_target_m']:.3f}"),
        ("consumed_energy_j", f"{result['consumed_energy_j']:.3f}"),
        ("max_roll_rad", f"{result['max_roll_rad']:.3f}"),
        ("max_pitch_rad", f"{result['max_pitch_rad']:.3f}"),
    ):
        typer.echo(f"{name:<22}{value}")
    if plot is not None:
        from foldcar.figures.ground import carsim_heights
        from foldcar.figures.run import draw_run

        draw_run(body, scene, result, result["path"], carsim_heights(carsim), plot)
        typer.echo(f"{'picture':<22}{plot}")


def _settings(words: list[str]) -> dict[str, float]:
    settings = {}
    for word in words:
        key, equals, text = word.partition("=")
        try:
            settings[key] = float(text)
        except ValueError:
            equals = ""
        if not equals:
            raise FoldcarError(f"--set {word}: is not NAME=MM, as in --set width=95")
    return settings
