"""`foldcar gallery`: draws each environment, three samples from above and from the side."""

from pathlib import Path
from typing import Annotated

import typer

from foldcar.commands.options import Json, output_folder, print_json
from foldcar.errors import FoldcarError
from foldcar.study.limits import GREATEST_SEED


def gallery(
    scenarios: Annotated[list[Path], typer.Argument(metavar="SCENARIO", help="Scenic programs.")],
    output: Annotated[
        Path, typer.Option("-o", "--output", metavar="DIR", callback=output_folder, help="Folder for the pictures.")
    ],
    seed: Annotated[
        int, typer.Option(metavar="S", min=0, max=GREATEST_SEED, help="The same seed gives the same pictures.")
    ] = 42,
    as_json: Json = False,
) -> None:
    """Draw environments, NAME.png for each NAME.scenic.

    A picture shows three samples from above, and the ground under the wheels from the side.

    \b
    Example: foldcar gallery scenarios/two_bumps.scenic scenarios/gaussian_hills.scenic -o pictures
    """
    from foldcar.figures.gallery import SAMPLES, draw_gallery
    from foldcar.output_folder import make_output_folder
    from foldcar.scenes.source import open_environment
    from foldcar.simulation.carsim import Carsim
    from foldcar.simulation.heights import carsim_heights

    names = [program.stem for program in scenarios]
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise FoldcarError(f"{output / twice}.png: two programs have this name")
    heights = carsim_heights(Carsim())
    make_output_folder(output)
    files = []
    for program in scenarios:
        source = open_environment(program, {}, seed)
        scenes = [{"id": f"{seed}/{k}", **source.sample(k)} for k in range(SAMPLES)]
        file = output / f"{program.stem}.png"
        draw_gallery(scenes, file, heights, program.stem)
        files.append(file)
        if not as_json:
            typer.echo(file)
    if as_json:
        print_json({"files": files})
