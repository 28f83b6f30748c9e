"""Compiles carsim outside PlatformIO: its sources, flags and include folders, for WebAssembly and for other compilers.

Usage: carsim_build.py FOLDER    builds FOLDER/carsim.wasm with Emscripten (`make setup`)

The flags are those of platformio.ini's section [host]; carsim with PlatformIO must have been built, which fetches
libraries and writes the generated headers. The module has no JavaScript of its own: host/foldcar/simulation/web/carsim.js
loads it.
"""

import configparser
import os
import shlex
import shutil
import subprocess
import sys
from collections.abc import Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
# Not of this program: the board's hardware, ArduinoJson, MuJoCo.
OTHER_LIBRARIES = ("feather_hal", "design_json", "mujoco_car")
# A port that is a terminal or a socket: not in a page.
NATIVE_LIBRARIES = ("linked_car",)
# ccache, where it is installed, compiles once what is compiled again.
EMCC = [*(["ccache"] if shutil.which("ccache") else []), "em++"]
WASM_FLAGS = ("-O2", "-fwasm-exceptions")
LINK_FLAGS = ("--no-entry", "-sSTANDALONE_WASM", "-sALLOW_MEMORY_GROWTH", "-sEXPORTED_FUNCTIONS=_malloc,_free")


class BuildError(Exception):
    """A compiler is missing or failed."""


def host_flags() -> list[str]:
    """Return the compiler's flags of platformio.ini's section [host], without level of optimisation and folders."""
    ini = configparser.ConfigParser(interpolation=None)
    ini.read(ROOT / "platformio.ini", encoding="utf-8")
    return [flag for flag in shlex.split(ini["host"]["build_flags"]) if not flag.startswith(("-O", "-I", "-W"))]


def sources(without: Sequence[str] = ()) -> list[Path]:
    """Return the sources of firmware, simulator and Box2D, but for the libraries named. Raises BuildError."""
    skipped = (*OTHER_LIBRARIES, *without)
    folders = [folder for base in ("firmware/lib", "sim2d/lib") for folder in sorted((ROOT / base).iterdir())]
    files = files_in(folder for folder in folders if folder.name not in skipped)
    box2d = downloaded("box2d")
    if box2d is None:
        raise BuildError("Box2D is missing: make setup fetches it")
    return files + sorted((box2d / "src").rglob("*.cpp"))


def files_in(folders: Iterable[Path | str]) -> list[Path]:
    """Return the C++ sources in these folders of the project."""
    return [file for folder in folders for file in sorted((ROOT / folder).glob("*.cpp"))]


def include_options() -> list[str]:
    """Return the options that name all folders with headers."""
    folders = [*sorted((ROOT / "firmware/lib").iterdir()), *sorted((ROOT / "sim2d/lib").iterdir()), ROOT / "sim2d/src"]
    folders += [ROOT / ".pio/mavlink", ROOT / ".pio/build_id/carsim", ROOT / ".pio/firmware_id"]
    for library in ("box2d", "nlohmann_json"):
        folder = downloaded(library)
        folders += [folder / "include", folder / "src"] if folder else []
    return [f"-I{folder}" for folder in folders if folder.is_dir() and folder.name not in ("feather_hal", "mujoco_car")]


def downloaded(library: str) -> Path | None:
    """Return the folder of a library that PlatformIO has fetched; None if there is none."""
    core = Path(os.environ.get("PLATFORMIO_CORE_DIR") or ROOT / ".pio-core")
    folders = (ROOT / ".pio/libdeps/carsim" / library, core / "lib" / library)
    return next((folder for folder in folders if folder.is_dir()), None)


def compiled(compiler: Sequence[str], options: Sequence[str], files: Sequence[Path], folder: Path) -> list[str]:
    """Compile the files into the folder, several at once. Returns the object files. Raises BuildError."""

    def compile_one(numbered: tuple[int, Path]) -> str:
        number, source = numbered
        result = str(folder / f"{number}.o")
        run(*compiler, *options, "-c", str(source), "-o", result)
        return result

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        return list(pool.map(compile_one, enumerate(files)))


def joined(files: Sequence[Path], folder: Path) -> list[Path]:
    """Write a source for each folder of ``files`` that includes them all, because most time goes into their headers."""
    by_folder: dict[Path, list[Path]] = {}
    for file in files:
        by_folder.setdefault(file.parent, []).append(file)
    results = []
    for number, group in enumerate(by_folder.values()):
        result = folder / f"{number}_{group[0].parent.name}.cpp"
        result.write_text("".join(f'#include "{file}"\n' for file in group), encoding="utf-8")
        results.append(result)
    return results


def run(*command: str) -> None:
    """Run a compiler. Raises BuildError with its message."""
    try:
        # What Debian's Emscripten needs of its own libraries is built already; its folder may not be writable.
        environment = {**os.environ, "EM_FROZEN_CACHE": "1"}
        result = subprocess.run(command, capture_output=True, text=True, check=False, env=environment)
    except FileNotFoundError as error:
        raise BuildError(f"{command[0]} is not installed") from error
    if result.returncode != 0:
        raise BuildError(f"{' '.join(command[-4:])}: {result.stderr[-2000:]}")


def build_wasm(folder: Path) -> Path:
    """Build carsim.wasm in the folder. Raises BuildError."""
    objects = folder / "obj"
    objects.mkdir(parents=True, exist_ok=True)
    files = [*sources(NATIVE_LIBRARIES), ROOT / "sim2d/src/tables.cpp", *files_in(["sim2d/engines"])]
    files = [file for file in files if file.name != "mujoco.cpp"]
    options = [flag for flag in host_flags() if flag != "-pthread"] + [*WASM_FLAGS, *include_options()]
    if downloaded("nlohmann_json") is None:
        # The system's, without the C library's headers beside it.
        link = folder / "include" / "nlohmann"
        link.parent.mkdir(exist_ok=True)
        if not link.exists():
            link.symlink_to("/usr/include/nlohmann")
        options.append(f"-I{link.parent}")
    made = folder / "carsim.wasm"
    run("em++", *WASM_FLAGS, *LINK_FLAGS, *compiled(EMCC, options, joined(files, objects), objects), "-o", str(made))
    return made


def main(folder: Path) -> int:
    """Build; a missing compiler is no error, because everything but pages works without. Returns the exit code."""
    if shutil.which("em++") is None:
        print("carsim.wasm is not built: Emscripten is missing. Reports cannot drive; all else works.", file=sys.stderr)
        return 0
    try:
        print(f"{build_wasm(folder)}: {(folder / 'carsim.wasm').stat().st_size} bytes")
    except BuildError as error:
        print(f"carsim_build: error: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1])))
