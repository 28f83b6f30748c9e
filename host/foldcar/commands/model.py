"""`foldcar model`: writes a car of a listing in the file format of another simulator."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from foldcar.commands.options import Components, Json, Settings, design_settings, output_folder, print_json
from foldcar.errors import FoldcarError
from foldcar.study.limits import MOST_ENVIRONMENTS

if TYPE_CHECKING:
    from foldcar.car.design import Design
    from foldcar.simulation.carsim import PulseTrain
    from foldcar.study.listing import Listing

FORMATS = ("mjcf", "urdf", "webots")
# Of a car that no experiment of the listing drives.
TIME_LIMIT_S = 120.0


def model(
    listing: Annotated[Path, typer.Argument(metavar="LISTING", help="Experiment listing (JSON).")],
    vehicle: Annotated[str, typer.Option(metavar="ID", help="Vehicle of the listing.")],
    to: Annotated[str, typer.Option(metavar="FORMAT", help=f"One of {', '.join(FORMATS)}.")],
    output: Annotated[
        Path, typer.Option("-o", "--output", metavar="DIR", callback=output_folder, help="Folder for the files.")
    ],
    settings: Settings = None,
    environment: Annotated[
        str | None, typer.Option(metavar="ID", help="Environment of the listing for the car's surroundings.")
    ] = None,
    sample: Annotated[
        int,
        typer.Option(metavar="K", min=0, max=MOST_ENVIRONMENTS - 1, help="Number of the environment's sample."),
    ] = 0,
    components: Components = None,
    as_json: Json = False,
) -> None:
    """Write one car for MuJoCo, URDF's readers or Webots.

    MJCF, URDF, or a Webots PROTO with its world and controller. Files are named after car and sample.

    \b
    Example: foldcar model scenarios/width_study.json --vehicle 1 --set width=95 --to mjcf -o models
    """
    from foldcar.atomic_file import atomic_file
    from foldcar.car.body import body_json
    from foldcar.commands.listed_design import listed_family
    from foldcar.models.exported_car import car_name, scene_name
    from foldcar.output_folder import make_output_folder

    if to not in FORMATS:
        raise FoldcarError(f"--to {to}: not one of {', '.join(FORMATS)}")
    if to == "urdf" and environment is not None:
        raise FoldcarError("--environment: URDF describes robots only; leave it out or choose mjcf or webots")
    listed, family = listed_family(listing, vehicle, [])
    chosen = design_settings(settings or [])
    varied = [key for key, values in family.choices.items() if len(values) > 1]
    design = family.narrowed(chosen).single()
    body = body_json(design)
    car = car_name(vehicle, {key: design.values[key] for key in varied} | chosen)
    scene = _scene(listing, listed, environment, sample)
    surroundings = f"_{scene_name(environment, sample)}" if environment is not None else ""
    files = {}
    if to == "mjcf":
        from foldcar.models.mjcf import mjcf
        from foldcar.simulation.carsim import Carsim
        from foldcar.simulation.engines import MUJOCO

        name = f"{car}{surroundings}"
        files[f"{name}.xml"] = mjcf(Carsim(engine=MUJOCO), body, scene, name)
    elif to == "urdf":
        from foldcar.models.urdf import urdf

        files[f"{car}.urdf"] = urdf(body, car)
    else:
        from foldcar.models.ground import smooth_ground
        from foldcar.models.webots_car import webots_proto
        from foldcar.models.webots_world import CONTROLLER, controller_drive, controller_program, webots_world
        from foldcar.simulation.carsim import Carsim
        from foldcar.simulation.heights import carsim_heights

        grid = smooth_ground(scene, carsim_heights(Carsim())) if scene is not None else None
        file = listed.environments[environment].wbt_filename if environment is not None else None
        prefix = f"{Path(file).stem}_" if file else ""
        controller = f"controllers/{CONTROLLER}"
        drive = f"{car}{surroundings}"
        values = " ".join(f"{key}={value:g}" for key, value in design.values.items())
        files = {
            f"protos/{car}.proto": webots_proto(body, car, f"{design.type} {values}"),
            f"worlds/{prefix}{drive}.wbt": webots_world(body, car, scene, grid, drive),
            f"{controller}/{CONTROLLER}.py": controller_program(),
            f"{controller}/{drive}.json": controller_drive(body, *_drive(listing, listed, vehicle, environment, design)),
        }
    make_output_folder(output)
    for name, text in files.items():
        target = output / name
        target.parent.mkdir(parents=True, exist_ok=True)
        with atomic_file(target) as binary:
            binary.write(text.encode())
    written = [output / name for name in files]
    if as_json:
        print_json({"files": written})
    else:
        typer.echo("\n".join(map(str, written)))


def _drive(
    file: Path, listed: "Listing", vehicle: str, environment: str | None, design: "Design"
) -> "tuple[PulseTrain, float]":
    """The firmware's pulses, and how long the car stands before them (s).

    They are those of the listing's first experiment with vehicle and environment, else full speed straight on.
    """
    from foldcar.car.body import body_json, full_speed_m_s
    from foldcar.car.car_file import firmware_parameters
    from foldcar.simulation.carsim import Carsim, ask_pulses
    from foldcar.study.experiments import read_study

    carsim, body = Carsim(), body_json(design)
    settings: dict[str, Any] = {
        "speed_m_s": full_speed_m_s(design),
        "time_limit_s": TIME_LIMIT_S,
        "parameters": firmware_parameters(design, body),
    }
    for name, one in listed.experiments.items():
        if one.veh_id == vehicle and environment in (None, one.env_id):
            (experiment,) = read_study(file, name).experiments
            settings = experiment.settings(design, body, carsim.parameter_table())
            break
    (pulses,) = ask_pulses(carsim, [settings])
    return pulses, carsim.limits().trial.settling_s


def _scene(file: Path, listed: "Listing", environment: str | None, sample: int) -> dict[str, Any] | None:
    """The environment's sample."""
    if environment is None:
        return None
    from foldcar.scenes.source import open_environment

    if environment not in listed.environments:
        known = ", ".join(listed.environments)
        raise FoldcarError(f'{file}: environments: has no "{environment}"; known: {known}')
    one = listed.environments[environment]
    program = file.parent / one.scenic_filename
    if not program.is_file():
        raise FoldcarError(f"{file}: environments.{environment}.scenic_filename: {program} is not a file")
    condition = one.condition.model_dump(exclude_none=True) if one.condition else None
    return open_environment(program, dict(one.scenic_params), one.seed, condition).sample(sample)
