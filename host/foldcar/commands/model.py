"""`foldcar model`: writes a car of a listing in the file format of another simulator."""

import re
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from foldcar.commands.components_option import Components
from foldcar.commands.design_settings import Settings
from foldcar.errors import FoldcarError
from foldcar.study.limits import MOST_ENVIRONMENTS

if TYPE_CHECKING:
    from foldcar.study.listing import Listing

FORMATS = ("mjcf", "urdf", "webots")


def model(
    listing: Annotated[Path, typer.Argument(metavar="LISTING", help="Experiment listing (JSON).")],
    vehicle: Annotated[str, typer.Option(metavar="ID", help="Vehicle of the listing.")],
    to: Annotated[str, typer.Option(metavar="FORMAT", help=f"One of {', '.join(FORMATS)}.")],
    output: Annotated[Path, typer.Option("-o", "--output", metavar="DIR", help="Folder for the files.")],
    settings: Settings = None,
    environment: Annotated[
        str | None, typer.Option(metavar="ID", help="Environment of the listing for the car's surroundings.")
    ] = None,
    sample: Annotated[
        int,
        typer.Option(metavar="K", min=0, max=MOST_ENVIRONMENTS - 1, help="Number of the environment's sample."),
    ] = 0,
    components: Components = None,
) -> None:
    """Write one car as MJCF, URDF or a Webots PROTO with its world."""
    from foldcar.atomic_file import atomic_file
    from foldcar.car.body import body_json
    from foldcar.commands.listed_design import listed_family

    if to not in FORMATS:
        raise FoldcarError(f"--to {to}: not one of {', '.join(FORMATS)}")
    if to == "urdf" and environment is not None:
        raise FoldcarError("--environment: URDF describes robots only; leave it out or choose mjcf or webots")
    listed, family = listed_family(listing, vehicle, settings or [])
    design = family.single()
    body = body_json(design)
    scene, grid = _ground(listing, listed, environment, sample)
    described = f"{design.type} " + " ".join(f"{key}={value:g}" for key, value in design.values.items())
    for name, text in _files(to, listed, vehicle, environment, described, body, scene, grid).items():
        file = output / name
        file.parent.mkdir(parents=True, exist_ok=True)
        with atomic_file(file) as binary:
            binary.write(text.encode())
        typer.echo(str(file))


def _files(
    to: str,
    listed: "Listing",
    vehicle: str,
    environment: str | None,
    described: str,
    body: dict[str, Any],
    scene: dict[str, Any] | None,
    grid: Any,
) -> dict[str, str]:
    """Texts by file name."""
    # PROTO names consist of letters and digits.
    name = f"Foldcar{re.sub('[^A-Za-z0-9]', '', vehicle)}"
    if to == "mjcf":
        from foldcar.models.mjcf import mjcf

        return {f"{name}.xml": mjcf(body, scene, grid)}
    if to == "urdf":
        from foldcar.models.urdf import urdf

        return {f"{name}.urdf": urdf(body, name)}
    from foldcar.models.webots_car import webots_proto
    from foldcar.models.webots_world import webots_world

    world = listed.environments[environment].wbt_filename if environment is not None else None
    return {
        f"protos/{name}.proto": webots_proto(body, name, described),
        f"worlds/{Path(world).name if world else f'{name}.wbt'}": webots_world(body, name, scene, grid),
    }


def _ground(
    file: Path, listed: "Listing", environment: str | None, sample: int
) -> tuple[dict[str, Any] | None, Any]:
    """The sampled scene and the grid of its smooth ground."""
    if environment is None:
        return None, None
    from foldcar.models.ground import smooth_ground
    from foldcar.scenes.source import open_environment
    from foldcar.simulation.carsim import Carsim

    if environment not in listed.environments:
        known = ", ".join(listed.environments)
        raise FoldcarError(f'{file}: environments: has no "{environment}"; known: {known}')
    one = listed.environments[environment]
    program = file.parent / one.scenic_filename
    if not program.is_file():
        raise FoldcarError(f"{file}: environments.{environment}.scenic_filename: {program} is not a file")
    condition = one.condition.model_dump(exclude_none=True) if one.condition else None
    scene = open_environment(program, dict(one.scenic_params), one.seed, condition).sample(sample)
    return scene, smooth_ground(scene, Carsim())
