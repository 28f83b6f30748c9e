"""Compiles the simulator and the firmware outside PlatformIO: for WebAssembly, fuzzers, benchmarks and other compilers.

Usage: carsim_build.py wasm FOLDER                               builds FOLDER/carsim.wasm with Emscripten (`make setup`)
       carsim_build.py programs FOLDER COMPILER FLAGS MAIN.cpp…  builds FOLDER/MAIN of each main file, with those flags
       carsim_build.py check COMMAND                             runs COMMAND (clang-tidy, say) on each source of carsim

The flags are those of platformio.ini's section [host] and the folders those that PlatformIO compiles (joined_sources.py);
carsim must have been built with it, which fetches libraries and writes the generated headers. The WebAssembly module has
no JavaScript of its own: host/foldcar/simulation/web/carsim.js loads it.
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
NATIVE_LIBRARY = "linked_car"
CARSIM_ENGINES = ROOT / "sim2d/engines/carsim.cpp"
# ccache, where it is installed, compiles once what is compiled again.
CCACHE = ["ccache"] if shutil.which("ccache") else []
# Vector instructions of every browser since Safari 16.4 (2023) and of Node; they take nine tenths of the time.
WASM_FLAGS = ("-O3", "-msimd128", "-fwasm-exceptions")
LINK_FLAGS = ("--no-entry", "-sSTANDALONE_WASM", "-sALLOW_MEMORY_GROWTH", "-sEXPORTED_FUNCTIONS=_malloc,_free")


class BuildError(Exception):
    """A compiler is missing or failed."""


def host_flags() -> list[str]:
    """Return the compiler's flags of platformio.ini's section [host], without level of optimisation and folders."""
    ini = configparser.ConfigParser(interpolation=None)
    ini.read(ROOT / "platformio.ini", encoding="utf-8")
    return [flag for flag in shlex.split(ini["host"]["build_flags"]) if not flag.startswith(("-O", "-I", "-W"))]


def library_folders() -> list[Path]:
    """Return the folders of the libraries that carsim is made of: firmware, simulator, Box2D. Raises BuildError."""
    box2d = downloaded("box2d")
    if box2d is None:
        raise BuildError("Box2D is missing: make setup fetches it")
    folders = [folder for base in ("firmware/lib", "sim2d/lib") for folder in sorted((ROOT / base).iterdir())]
    folders = [folder for folder in folders if folder.name not in OTHER_LIBRARIES]
    return [folder for folder in (*folders, *sorted((box2d / "src").iterdir())) if any(folder.glob("*.cpp"))]


def include_options() -> list[str]:
    """Return the options that name all folders with headers."""
    folders = [*sorted((ROOT / "firmware/lib").iterdir()), *sorted((ROOT / "sim2d/lib").iterdir()), ROOT / "sim2d/src"]
    folders += [ROOT / ".pio/mavlink", ROOT / ".pio/build_id/carsim", ROOT / ".pio/firmware_id"]
    options = [f"-I{folder}" for folder in folders if folder.is_dir() and folder.name not in OTHER_LIBRARIES]
    for library in (downloaded("box2d"), downloaded("nlohmann_json")):
        if library is not None:
            options += ["-isystem", str(library / "include"), "-isystem", str(library / "src")]
    return options


def downloaded(library: str) -> Path | None:
    """Return the folder of a library that PlatformIO has fetched; None if there is none."""
    core = Path(os.environ.get("PLATFORMIO_CORE_DIR") or ROOT / ".pio-core")
    folders = (ROOT / ".pio/libdeps/carsim" / library, core / "lib" / library)
    return next((folder for folder in folders if folder.is_dir()), None)


def joined_source(folder: Path) -> Path:
    """Return a source that includes those of the folder, because most time goes into the headers that they share.

    It is the same file for all builds, so that ccache knows it again, and written only if its content changes.
    """
    joined = ROOT / ".pio/joined" / f"{folder.parent.name}_{folder.name}.cpp"
    text = "".join(f'#include "{file}"\n' for file in sorted(folder.glob("*.cpp")))
    if not joined.is_file() or joined.read_text(encoding="utf-8") != text:
        joined.parent.mkdir(parents=True, exist_ok=True)
        # Whole at every moment: another build may read it.
        new = joined.with_suffix(f".{os.getpid()}")
        new.write_text(text, encoding="utf-8")
        new.replace(joined)
    return joined


def compiled(command: Sequence[str], files: Iterable[Path], folder: Path) -> list[str]:
    """Compile files, several at once, into the folder by a compiler's command with its options.

    Returns the object files. Raises BuildError.
    """
    folder.mkdir(parents=True, exist_ok=True)

    def compile_one(source: Path) -> str:
        result = str(folder / f"{source.parent.name}_{source.stem}.o")
        run(*command, "-c", str(source), "-o", result)
        return result

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        return list(pool.map(compile_one, files))


def run(*command: str) -> None:
    """Run a compiler. Raises BuildError with its message."""
    try:
        # What Debian's Emscripten needs of its own libraries is built already; its folder may not be writable.
        environment = {**os.environ, "EM_FROZEN_CACHE": "1"}
        result = subprocess.run(command, capture_output=True, text=True, check=False, env=environment)
    except FileNotFoundError as error:
        raise BuildError(f"{command[0]} is not installed") from error
    if result.returncode != 0:
        raise BuildError(f"{' '.join(command[-4:])}: {result.stdout[-2000:]}{result.stderr[-2000:]}")


def build_wasm(folder: Path) -> Path:
    """Build carsim.wasm in the folder. Raises BuildError."""
    folders = [library for library in library_folders() if library.name != NATIVE_LIBRARY]
    files = [*map(joined_source, folders), ROOT / "sim2d/src/tables.cpp", CARSIM_ENGINES, ROOT / "sim2d/engines/wasm.cpp"]
    options = [flag for flag in host_flags() if flag != "-pthread"] + [*WASM_FLAGS, *include_options()]
    if downloaded("nlohmann_json") is None:
        # The system's, without the C library's headers beside it.
        link = folder / "include" / "nlohmann"
        link.parent.mkdir(parents=True, exist_ok=True)
        if not link.exists():
            link.symlink_to("/usr/include/nlohmann")
        options.append(f"-I{link.parent}")
    made = folder / "carsim.wasm"
    objects = compiled([*CCACHE, "em++", *options], files, folder / "obj")
    run("em++", *WASM_FLAGS, *LINK_FLAGS, *objects, "-o", str(made))
    return made


def build_programs(folder: Path, compiler: str, flags: str, mains: Sequence[Path]) -> None:
    """Build a program of each main file with the whole simulator; -fsanitize=fuzzer is for linking. Raises BuildError."""
    words = shlex.split(flags)
    command = [*CCACHE, compiler, *host_flags(), *include_options(), *(w for w in words if w != "-fsanitize=fuzzer")]
    libraries = compiled(command, [*map(joined_source, library_folders()), CARSIM_ENGINES], folder / "obj")
    for main in mains:
        (own,) = compiled(command, [main], folder / "obj")
        run(compiler, "-pthread", *words, own, *libraries, "-o", str(folder / main.stem))


def check_sources(command: str) -> int:
    """Run a command, with the compiler's options behind "--", on each source of ours; return the largest exit code."""
    folders = [folder for folder in library_folders() if "box2d" not in folder.parts] + [ROOT / "sim2d/src"]
    files = [file for folder in folders for file in sorted(folder.glob("*.cpp"))]

    def check(file: Path) -> int:
        options = [*host_flags(), *include_options()]
        return subprocess.run([*shlex.split(command), str(file), "--", *options], check=False).returncode

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        return max(pool.map(check, [*files, CARSIM_ENGINES]))


def main(words: Sequence[str]) -> int:
    """Run the command line; returns the exit code. Without Emscripten it is 0, because everything but pages works."""
    try:
        if words[0] == "check":
            return check_sources(words[1])
        if words[0] == "programs":
            build_programs(Path(words[1]).absolute(), words[2], words[3], [Path(word).absolute() for word in words[4:]])
        elif shutil.which("em++") is not None:
            made = build_wasm(Path(words[1]).absolute())
            print(f"{made}: {made.stat().st_size} bytes")
        else:
            print(
                "carsim.wasm is not built: Emscripten is missing. Reports cannot drive; all else works.", file=sys.stderr
            )
    except BuildError as error:
        print(f"carsim_build: error: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
