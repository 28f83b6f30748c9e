"""What may move simulated cars: multibody or Box2D's side view, in one program, or MuJoCo, in another like it."""

import os
from dataclasses import dataclass
from pathlib import Path

from foldcar.installation import packaged_program, source_tree
from foldcar.simulation.runner import CarsimError

BINARY_VARIABLE = "FOLDCAR_CARSIM"


@dataclass(frozen=True, slots=True)
class Engine:
    """A program of carsim's: the variable that may name it, PlatformIO's environment and make's target that build it.

    ``title`` is what the program calls its engine, without the version, "" for multibody; ``options`` are words that
    stand before the program's command.
    """

    variable: str
    environment: str
    target: str
    title: str = ""
    options: tuple[str, ...] = ()


MULTIBODY, SIDE_VIEW, MUJOCO = "multibody", "side-view", "mujoco"
# What users choose from.
OFFERED = (SIDE_VIEW, MULTIBODY, MUJOCO)
# MuJoCo otherwise: how far results depend on details that a designer cannot know.
HALF_STEP, ELLIPSOID = "mujoco-half-step", "mujoco-ellipsoid-tyres"
MUJOCO_ENVIRONMENT = "carsim_mujoco"
_MUJOCO = ("FOLDCAR_CARSIM_MUJOCO", MUJOCO_ENVIRONMENT, "mujoco")
ENGINES = {
    MULTIBODY: Engine(BINARY_VARIABLE, "carsim", "setup"),
    SIDE_VIEW: Engine(BINARY_VARIABLE, "carsim", "setup", "side-view", ("--side-view",)),
    MUJOCO: Engine(*_MUJOCO, "MuJoCo"),
    HALF_STEP: Engine(*_MUJOCO, "MuJoCo, half step", ("--half-step",)),
    ELLIPSOID: Engine(*_MUJOCO, "MuJoCo, ellipsoid tyres", ("--ellipsoid-tyres",)),
}


def engine_title(told: str) -> str:
    """What a program calls its engine, without the version: "MuJoCo, half step" of "MuJoCo 4.0.0, half step"."""
    name, *choices = told.split(", ")
    return ", ".join([name.partition(" ")[0], *choices])


def engine_of(told: str) -> str:
    """The key in ENGINES of what a program calls its engine, "" for multibody; CarsimError if there is none."""
    title = engine_title(told)
    for key, engine in ENGINES.items():
        if engine.title == title:
            return key
    raise CarsimError(f"{told}: an engine that this foldcar does not know")


def find_carsim(engine: str = MULTIBODY) -> Path:
    """The simulator that the engine's variable names, else the wheel's own, else the one built in the checkout."""
    program = ENGINES[engine]
    named = os.environ.get(program.variable)
    if named:
        if not os.access(named, os.X_OK) or not Path(named).is_file():
            raise CarsimError(f"{program.variable}: {named} is no program")
        return Path(named)
    packaged = packaged_program(program.environment)
    if packaged is not None:
        # The program looks for the library there (tools/mujoco_library.py).
        if program.environment == MUJOCO_ENVIRONMENT and not any((packaged.parents[1] / "mujoco").glob("libmujoco.*")):
            remedy = "run `pip install 'foldcar[mujoco]'` (Python 3.11 or newer)"
            raise CarsimError(f"no package mujoco in {packaged.parents[1]}: {remedy}")
        return packaged
    what = "carsim with MuJoCo" if program.environment == MUJOCO_ENVIRONMENT else "carsim"
    project = source_tree()
    if project is None:
        raise CarsimError(f"this foldcar came without {what}: install a wheel, or let {program.variable} name it")
    binary = project / ".pio" / "build" / program.environment / "program"
    if not binary.is_file():
        raise CarsimError(f"no {what} built at {binary}: run `make {program.target}`")
    return binary
