"""Builds carsim with other compilers and levels of optimisation and compares what they compute, bit by bit.

Usage: determinism.py [--renew] [--numerics] [COMPILER LEVEL]...

Each build must answer test/determinism/golden_input.jsonl with the bytes of golden_output.jsonl, multibody's answers and
then the side view's; exit code 1 if one does not. Without arguments the builds are those of g++ and clang++, as far as
installed, at -O0 to -O3, and carsim.wasm. --numerics compiles only what computes trials and takes the rest from the build
of PlatformIO. --renew first writes golden_output.jsonl with that build: after a change of the physics, never to hide a
difference.
"""

import argparse
import difflib
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))

from carsim_build import (
    CARSIM_ENGINES,
    ROOT,
    BuildError,
    compiled,
    host_flags,
    include_options,
    joined_source,
    library_folders,
    run,
)

CARSIM = ROOT / ".pio/build/carsim/program"
INPUT = ROOT / "test/determinism/golden_input.jsonl"
OUTPUT = ROOT / "test/determinism/golden_output.jsonl"
NUMERICS = (
    *("firmware/lib/application", "firmware/lib/attitude", "firmware/lib/control", "firmware/lib/elementary"),
    *("firmware/lib/parameters", "firmware/lib/supervisor", "sim2d/lib/engine", "sim2d/lib/model", "sim2d/lib/multibody"),
    *("sim2d/lib/side_view", "sim2d/lib/sim_hal", "sim2d/lib/terrain", "sim2d/lib/trial"),
)
WASM = ROOT / ".pio/wasm/carsim.wasm"


def golden_answers() -> str:
    """Return the golden answers."""
    return OUTPUT.read_text(encoding="utf-8")


def answers(command: Sequence[str], **variables: str) -> str:
    """Return a carsim's answers to the golden input in multibody and in the side view, with environment variables."""
    return "".join(
        subprocess.run(
            [*command, *engine, "batch"],
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


def build(compiler: str, level: str, folder: Path, numerics: bool) -> list[str]:
    """Build carsim into the folder with, say, "clang++", "O1". Returns its command. Raises BuildError."""
    program = folder / "carsim"
    folders = [ROOT / name for name in NUMERICS] if numerics else [*library_folders(), ROOT / "sim2d/src"]
    files = [*map(joined_source, folders), *([] if numerics else [CARSIM_ENGINES])]
    objects = compiled([compiler, *host_flags(), f"-{level}", *include_options()], files, folder)
    if numerics:
        objects += [str(file) for file in sorted((CARSIM.parent / "sim2d").rglob("*.o"))]
        archives = sorted(str(file) for file in CARSIM.parent.glob("lib*/lib*.a"))
        objects += ["-Wl,--start-group", *archives, "-Wl,--end-group"]
    run(compiler, "-pthread", *objects, "-o", str(program))
    return [str(program)]


def wasm_command() -> list[str]:
    """Return the command of carsim.wasm under Node."""
    from foldcar.simulation.engines import program_command

    return list(program_command(WASM))


def installed_compilers() -> list[str]:
    """g++ and the newest clang++."""
    clang = [name for name in ("clang++", *(f"clang++-{k}" for k in range(22, 13, -1))) if shutil.which(name)]
    return ["g++", *clang[:1]]


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
            OUTPUT.write_text(answers([str(CARSIM)]), encoding="utf-8")
        expected = golden_answers()
        differing = 0
        all_builds = [(c, f"O{k}") for c in installed_compilers() for k in range(4)]
        builds = builds or [*all_builds, *([("carsim.wasm", "O3")] if WASM.is_file() else [])]
        for compiler, level in builds:
            with tempfile.TemporaryDirectory() as folder:
                is_wasm = compiler == WASM.name
                command = wasm_command() if is_wasm else build(compiler, level, Path(folder), arguments.numerics)
                lines = difference(expected, answers(command))
            print(f"{compiler} -{level}: {'DIFFERS' if lines else 'the golden bytes'}", flush=True)
            if lines:
                print(lines)
                differing += 1
    except (BuildError, OSError, subprocess.CalledProcessError) as error:
        print(f"determinism: error: {error}", file=sys.stderr)
        return 2
    print(f"{len(builds) - differing} of {len(builds)} builds compute the golden bytes")
    return 1 if differing else 0


if __name__ == "__main__":
    sys.exit(main())
