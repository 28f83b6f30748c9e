"""Puts carsim, the pages' scripts and the examples into the package where a wheel is built, as in a checkout.

A wheel fits every Python and one system. PlatformIO builds carsim, Emscripten carsim.wasm, npm the scripts.
FOLDCAR_BUILD_DIR names a folder of programs that are built already, such as .pio/build. The program with MuJoCo is left
out where the build has no package `mujoco` (Python 3.10), carsim.wasm where there is no Emscripten.

FOLDCAR_WHEEL=any makes the wheel for every system instead: without native programs, it runs carsim.wasm with Node.
"""

import importlib.util
import os
import shutil
import subprocess
import sys
from pathlib import Path

from setuptools import Distribution, setup
from setuptools.command.bdist_wheel import bdist_wheel
from setuptools.command.build_py import build_py
from setuptools.errors import SetupError

ROOT = Path(__file__).resolve().parent
# PlatformIO's environments; in the package the programs have these names.
PROGRAMS = ("carsim", "carsim_mujoco")
WASM = "carsim.wasm"
BUNDLES = ROOT / "host" / "foldcar" / "bundles"
FOR_ANY_SYSTEM = os.environ.get("FOLDCAR_WHEEL") == "any"
# What `foldcar new --example` writes.
EXAMPLES = ("scenarios/*.*", "patterns/*.json", "examples/*.*")


class BuildWithPrograms(build_py):
    """The modules and data files, then the programs, unless the install is editable and so uses the checkout's."""

    def run(self) -> None:
        """Copy all into the build folder."""
        if not self.editable_mode and not BUNDLES.is_dir():
            bundle()
        super().run()
        if self.editable_mode:
            return
        names = PROGRAMS if importlib.util.find_spec("mujoco") else PROGRAMS[:1]
        built = os.environ.get("FOLDCAR_BUILD_DIR")
        folder = Path(built) if built else build(names)
        for pattern in EXAMPLES:
            for file in ROOT.glob(pattern):
                target = Path(self.build_lib) / "foldcar" / "examples" / file.relative_to(ROOT)
                target.parent.mkdir(parents=True, exist_ok=True)
                shutil.copy(file, target)
        package = Path(self.build_lib) / "foldcar"
        for name in () if FOR_ANY_SYSTEM else names:
            shutil.copy(folder / name / "program", package / name)
        module = folder.parent / "wasm" / WASM
        if module.is_file():
            shutil.copy(module, package / WASM)
        elif FOR_ANY_SYSTEM:
            raise SetupError("a wheel for every system needs carsim.wasm: install Emscripten")


class ProgramWheel(bdist_wheel):
    """A wheel for every Python on this system."""

    def get_tag(self) -> tuple[str, str, str]:
        """The tag: the programs, not Python, bind the wheel to the system."""
        return ("py3", "none", "any" if FOR_ANY_SYSTEM else super().get_tag()[2])


class ProgramDistribution(Distribution):
    """Goes where packages for one system go."""

    def has_ext_modules(self) -> bool:
        """Programs count as extensions do."""
        return not FOR_ANY_SYSTEM


def build(names: tuple[str, ...]) -> Path:
    """Have PlatformIO build the programs; the folder of their folders. SetupError if that fails."""
    if shutil.which("g++") is None:
        needs = "needs g++ (Debian, Ubuntu: apt-get install g++); foldcar's wheel needs none"
        raise SetupError(f"carsim is built from its sources here, which {needs}")
    environments = [word for name in names for word in ("-e", name)]
    for command in (
        [sys.executable, str(ROOT / "tools" / "seed_platformio.py"), "--if-unreachable"],
        [sys.executable, "-m", "platformio", "run", "-d", str(ROOT), *environments],
    ):
        if subprocess.run(command, cwd=ROOT, check=False).returncode != 0:
            raise SetupError(f"carsim was not built: see the message of {Path(command[1]).name} above")
    built = Path(os.environ.get("PLATFORMIO_BUILD_DIR") or ROOT / ".pio" / "build")
    if subprocess.run([sys.executable, "tools/carsim_build.py", str(built.parent / "wasm")], cwd=ROOT).returncode != 0:
        raise SetupError("carsim.wasm was not built: see the message above")
    return built


def bundle() -> None:
    """Have npm and esbuild bundle the pages' scripts. SetupError if that fails."""
    if subprocess.run([sys.executable, str(ROOT / "tools" / "web_bundles.py")], cwd=ROOT, check=False).returncode != 0:
        raise SetupError("the pages' scripts were not bundled: see the message of npm above")


setup(
    cmdclass={"build_py": BuildWithPrograms, "bdist_wheel": ProgramWheel},
    distclass=ProgramDistribution,
)
