"""Builds carsim with other compilers and levels of optimisation and compares what they compute, bit by bit.

Usage: determinism.py [--renew] [--numerics] [COMPILER LEVEL]...

Each build must answer test/determinism/golden_input.jsonl with the bytes of golden_output.jsonl, multibody's answers and
then the side view's; exit code 1 if one does not. Without arguments the builds are those of g++ and clang++, as far as
installed, at -O0 to -O3. --numerics compiles anew only what computes trials and takes the rest from the build of
PlatformIO, which must be there. --renew first writes golden_output.jsonl with that build: after a change of the physics,
never to silence a difference.
"""

import argparse
import difflib
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
CARSIM = ROOT / ".pio/build/carsim/program"
INPUT = ROOT / "test/determinism/golden_input.jsonl"
OUTPUT = ROOT / "test/determinism/golden_output.jsonl"
# As in platformio.ini.
FLAGS = ("-std=gnu++17", "-ffp-contract=off", "-pthread", "-DB2_USER_SETTINGS")
NUMERICS = (
    *("firmware/lib/application", "firmware/lib/attitude", "firmware/lib/control", "firmware/lib/elementary"),
    *("firmware/lib/parameters", "firmware/lib/supervisor", "sim2d/lib/engine", "sim2d/lib/model", "sim2d/lib/multibody"),
    *("sim2d/lib/side_view", "sim2d/lib/sim_hal", "sim2d/lib/terrain", "sim2d/lib/trial"),
)


class BuildError(Exception):
    """A compiler is missing or failed."""


def answers(carsim: Path, **variables: str) -> str:
    """What that carsim answers to the golden input in multibody and in the side view, with environment variables."""
    return "".join(
        subprocess.run(
            [carsim, *engine, "batch"],
            input=INPUT.read_text("utf-8"),
            env={**os.environ, **variables},
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        for engine in ((), ("--side-view",))
    )


def difference(expected: str, got: str) -> str:
    """The first lines that differ, "" if none does."""
    lines = difflib.unified_diff(expected.splitlines(), got.splitlines(), "golden", "this build", lineterm="", n=0)
    return "\n".join(line[:300] for line, _ in zip(lines, range(6), strict=False))


def build(compiler: str, level: str, folder: Path, numerics: bool) -> Path:
    """Carsim built into the folder with, say, "clang++", "O1". Raises BuildError."""
    program = folder / "carsim"
    sources = _sources(NUMERICS) if numerics else _all_sources()
    options = [*FLAGS, f"-{level}", *_include_options()]

    def compile_one(numbered: tuple[int, Path]) -> Path:
        number, source = numbered
        result = folder / f"{number}.o"
        _run(compiler, *options, "-c", str(source), "-o", str(result))
        return result

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        objects = [str(file) for file in pool.map(compile_one, enumerate(sources))]
    if numerics:
        objects += [str(file) for file in sorted((CARSIM.parent / "sim2d").rglob("*.o"))]
        archives = sorted(str(file) for file in CARSIM.parent.glob("lib*/lib*.a"))
        objects += ["-Wl,--start-group", *archives, "-Wl,--end-group"]
    _run(compiler, "-pthread", *objects, "-o", str(program))
    return program


def installed_compilers() -> list[str]:
    """g++ and the newest clang++."""
    clang = [name for name in ("clang++", *(f"clang++-{k}" for k in range(22, 13, -1))) if shutil.which(name)]
    return ["g++", *clang[:1]]


def _sources(folders: Iterable[str]) -> list[Path]:
    return [file for folder in folders for file in sorted((ROOT / folder).glob("*.cpp"))]


def _all_sources() -> list[Path]:
    folders = [folder for base in ("firmware/lib", "sim2d/lib") for folder in sorted((ROOT / base).iterdir())]
    skipped = ("feather_hal", "design_json", "mujoco_car")
    files = _sources(str(folder.relative_to(ROOT)) for folder in folders if folder.name not in skipped)
    files += [*_sources(["sim2d/src"]), ROOT / "sim2d/engines/carsim.cpp"]
    box2d = _downloaded("box2d")
    if box2d is None:
        raise BuildError("Box2D is not there yet: make setup fetches it")
    return files + sorted((box2d / "src").rglob("*.cpp"))


def _include_options() -> list[str]:
    folders = [*sorted((ROOT / "firmware/lib").iterdir()), *sorted((ROOT / "sim2d/lib").iterdir()), ROOT / "sim2d/src"]
    folders += [ROOT / ".pio/mavlink", ROOT / ".pio/build_id/carsim", ROOT / ".pio/firmware_id"]
    for library in ("box2d", "nlohmann_json"):
        source = _downloaded(library)
        folders += [source / "include", source / "src"] if source else []
    return [f"-I{folder}" for folder in folders if folder.is_dir() and folder.name not in ("feather_hal", "mujoco_car")]


def _downloaded(library: str) -> Path | None:
    core = Path(os.environ.get("PLATFORMIO_CORE_DIR") or ROOT / ".pio-core")
    folders = (ROOT / ".pio/libdeps/carsim" / library, core / "lib" / library)
    return next((folder for folder in folders if folder.is_dir()), None)


def _run(*command: str) -> None:
    try:
        result = subprocess.run(command, capture_output=True, text=True, check=False)
    except FileNotFoundError as error:
        raise BuildError(f"{command[0]} is not installed") from error
    if result.returncode != 0:
        raise BuildError(f"{' '.join(command[-4:])}: {result.stderr[-2000:]}")


def main() -> int:
    """Run the command line; returns the exit code."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--renew", action="store_true", help="write golden_output.jsonl first")
    parser.add_argument("--numerics", action="store_true", help="compile only what computes trials")
    parser.add_argument("builds", nargs="*", metavar="COMPILER LEVEL", help="as in g++ O3")
    arguments = parser.parse_args()
    if len(arguments.builds) % 2 != 0:
        parser.error("builds are pairs of a compiler and a level, as in: g++ O3 clang++ O0")
    builds = list(zip(arguments.builds[::2], arguments.builds[1::2], strict=True))
    try:
        if arguments.renew:
            OUTPUT.write_text(answers(CARSIM), encoding="utf-8")
        expected = OUTPUT.read_text(encoding="utf-8")
        differing = 0
        builds = builds or [(c, f"O{k}") for c in installed_compilers() for k in range(4)]
        for compiler, level in builds:
            with tempfile.TemporaryDirectory() as folder:
                differences = difference(expected, answers(build(compiler, level, Path(folder), arguments.numerics)))
            print(f"{compiler} -{level}: {'the golden bytes' if not differences else 'DIFFERS'}", flush=True)
            if differences:
                print(differences)
                differing += 1
    except (BuildError, OSError, subprocess.CalledProcessError) as error:
        print(f"determinism: error: {error}", file=sys.stderr)
        return 2
    print(f"{len(builds) - differing} of {len(builds)} builds compute the golden bytes")
    return 1 if differing else 0


if __name__ == "__main__":
    sys.exit(main())
