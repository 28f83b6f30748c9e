"""`foldcar gallery`: draws each environment, three samples from above and from the side."""

from pathlib import Path
from typing import Annotated

import typer

from foldcar.errors import FoldcarError
from foldcar.study.limits import GREATEST_SEED


def gallery(
    scenarios: Annotated[
        list[Path],
        typer.Argument(metavar="SCENARIO...", help="Scenic programs"),
    ],
    output: Annotated[
        Path, typer.Option("-o", "--output", help="folder for the pictures; created if missing")
    ],
    seed: Annotated[
        int, typer.Option("--seed", min=0, max=GREATEST_SEED, help="the same seed gives the same pictures")
    ] = 42,
) -> None:
    """Draw environments: NAME.png for each program NAME.scenic."""
    from foldcar.figures.gallery import SAMPLES, draw_gallery
    from foldcar.figures.ground import carsim_heights
    from foldcar.scenes.source import open_environment
    from foldcar.simulation.carsim import Carsim

    names = [program.stem for program in scenarios]
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise FoldcarError(f"{output / twice}.png: two programs have this name")
    heights = carsim_heights(Carsim())
    output.mkdir(parents=True, exist_ok=True)
    for program in scenarios:
        source = open_environment(program, {}, seed)
        scenes = [{"id": f"{seed}/{k}", **source.sample(k)} for k in range(SAMPLES)]
        file = output / f"{program.stem}.png"
        draw_gallery(scenes, file, heights, program.stem)
        typer.echo(file)
