"""`foldcar model` writes a car of a listing in the file format of another simulator."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from foldcar.commands.options import (
    Components,
    Listing,
    OutputFolder,
    Sample,
    Settings,
    design_settings,
    print_lines,
)
from foldcar.errors import FoldcarError

if TYPE_CHECKING:
    from foldcar.car.design import Design
    from foldcar.simulation.carsim import PulseTrain
    from foldcar.study import listing as listings

FORMATS = ("mjcf", "urdf", "webots")
# The time limit of a car that occurs in no experiment of the listing.
TIME_LIMIT_S = 120.0


def model(
    listing: Listing,
    vehicle: Annotated[str, typer.Option(metavar="ID", help="Vehicle of the listing.")],
    to: Annotated[str, typer.Option(metavar="FORMAT", help=f"One of {', '.join(FORMATS)}.")],
    output: OutputFolder,
    settings: Settings = None,
    environment: Annotated[
        str | None, typer.Option(metavar="ID", help="Environment of the listing to put the car in.")
    ] = None,
    sample: Sample = 0,
    components: Components = None,
) -> None:
    """Write a car for MuJoCo, URDF readers or Webots.

    The files are MJCF, URDF, or a Webots PROTO with its world and controller. They are named after car and sample.

    \b
    Example: foldcar model scenarios/width_study.json --vehicle 1 --set width=95 --to mjcf -o models
    """
    from foldcar.car.body import body_json
    from foldcar.commands.listed_run import listed_family
    from foldcar.models.exported_car import car_name, scene_name
    from foldcar.outputs import atomic_file, make_output_folder
    from foldcar.statistics.words import design_text

    if to not in FORMATS:
        raise FoldcarError(f"--to {to}: not one of {', '.join(FORMATS)}")
    if to == "urdf" and environment is not None:
        raise FoldcarError("--environment: URDF describes robots only; leave it out or choose mjcf or webots")
    listing_data, family = listed_family(listing, vehicle, [])
    chosen_settings = design_settings(settings)
    varied_keys = [key for key, values in family.choices.items() if len(values) > 1]
    design = family.narrowed(chosen_settings).single()
    body = body_json(design)
    car = car_name(vehicle, {key: design.values[key] for key in varied_keys} | chosen_settings)
    scene = _scene(listing, listing_data, environment, sample)
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

        ground = smooth_ground(scene, carsim_heights(Carsim())) if scene is not None else None
        # The world that the listing names gives the first part of the new world's name.
        listed_world = listing_data.environments[environment].wbt_filename if environment is not None else None
        prefix = f"{Path(listed_world).stem}_" if listed_world else ""
        controller_folder = f"controllers/{CONTROLLER}"
        drive_name = f"{car}{surroundings}"
        pulses, settling_s = _drive(listing, listing_data, vehicle, environment, design)
        comment = f"{design.type}, {design_text(design.columns)}"
        files[f"protos/{car}.proto"] = webots_proto(body, car, comment)
        files[f"worlds/{prefix}{drive_name}.wbt"] = webots_world(body, car, scene, ground, drive_name)
        files[f"{controller_folder}/{CONTROLLER}.py"] = controller_program()
        files[f"{controller_folder}/{drive_name}.json"] = controller_drive(body, pulses, settling_s)
    make_output_folder(output)
    for name, text in files.items():
        target = output / name
        target.parent.mkdir(parents=True, exist_ok=True)
        with atomic_file(target) as binary:
            binary.write(text.encode())
    print_lines(*(output / name for name in files))


def _drive(
    file: Path, listed: "listings.Listing", vehicle: str, environment: str | None, design: "Design"
) -> "tuple[PulseTrain, float]":
    """Return the firmware's servo pulses of a drive, and how long the car stands before them (s).

    The drive is that of the listing's first experiment with this vehicle and environment. Without such an experiment the
    car drives straight ahead at full speed.
    """
    from foldcar.car.body import body_json, firmware_parameters, full_speed_m_s
    from foldcar.simulation.carsim import Carsim, ask_pulses
    from foldcar.study.experiments import read_study

    carsim, body = Carsim(), body_json(design)
    experiment_name = _first_experiment(listed, vehicle, environment)
    settings: dict[str, Any]
    if experiment_name is None:
        settings = {
            "speed_m_s": full_speed_m_s(design),
            "time_limit_s": TIME_LIMIT_S,
            "parameters": firmware_parameters(design, body),
        }
    else:
        (experiment,) = read_study(file, experiment_name).experiments
        settings = experiment.settings(design, body, carsim.parameter_table())
    # carsim answers with the pulses that the firmware would give to the servos.
    (pulses,) = ask_pulses(carsim, [settings])
    return pulses, carsim.limits().trial.settling_s


def _first_experiment(listed: "listings.Listing", vehicle: str, environment: str | None) -> str | None:
    """Return the name of the listing's first experiment with this vehicle and environment, or None.

    If ``environment`` is None, any environment will do.
    """
    for name, experiment in listed.experiments.items():
        if experiment.veh_id == vehicle and environment in (None, experiment.env_id):
            return name
    return None


def _scene(file: Path, listing_data: "listings.Listing", environment: str | None, sample: int) -> dict[str, Any] | None:
    """Return the scene of a sample of the listed environment; None if ``environment`` is None. Raises FoldcarError."""
    if environment is None:
        return None
    from foldcar.scenes.source import open_environment

    if environment not in listing_data.environments:
        known = ", ".join(listing_data.environments)
        raise FoldcarError(f'{file}: has no environment "{environment}"; known: {known}')
    entry = listing_data.environments[environment]
    program = file.parent / entry.scenic_filename
    if not program.is_file():
        raise FoldcarError(f"{file}: environments.{environment}.scenic_filename: {program} is not a file")
    condition = entry.condition.model_dump(exclude_none=True) if entry.condition else None
    return open_environment(program, dict(entry.scenic_params), entry.seed, condition).sample(sample)
