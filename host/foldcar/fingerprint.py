"""What tells one environment from another without running it: a hash of all that its samples depend on.

Input: a Scenic program, its parameters and seed. Output: a hexadecimal SHA-256. Programs can import what
stands beside them, so every Scenic and Python file of the program's folder counts, as do the vocabulary,
foldcar's own reading of it, and Scenic's version. Too much in the hash only costs sampling anew: runs go
by the scene itself.
"""

import hashlib
import json
from collections.abc import Iterator, Mapping
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

# The last ones decide what programs that run beside the simulation see of it.
SCENE_CODE = (
    "scenes.py",
    "scene_json.py",
    "scene_checks.py",
    "scene_terrain.py",
    "scene_reading.py",
    "scenic_program.py",
    "program_globals.py",
    "conditioning.py",
    "scenic_simulator.py",
    "scenic_ego.py",
    "recorded_values.py",
    "scenic_worker.py",
    "carsim_step.py",
)
VARIATION_CODE = ("variation.py", "parts_data/workshop.json")
SOURCES = ("*.scenic", "*.py")


def environment_fingerprint(
    program: Path, params: Mapping[str, Any], seed: int, condition: Mapping[str, Any] | None = None
) -> str:
    """The hash for ``program`` with ``params``, ``seed`` and what is frozen of it."""
    digest = hashlib.sha256()
    head = [program.name, params, seed, condition, scenic_version()]
    digest.update(json.dumps(head, sort_keys=True).encode())
    for file in _sources(program.parent):
        text = file.read_bytes()
        digest.update(f"\n{file.name} {len(text)}\n".encode())
        digest.update(text)
    return digest.hexdigest()


def spread_fingerprint(spread: Mapping[str, float], seed: int) -> str:
    """The hash of what a spread's variations depend on."""
    return hashlib.sha256(json.dumps([spread, seed, variation_code()], sort_keys=True).encode()).hexdigest()


@cache
def variation_code() -> str:
    """The hash of the code and data that draw variations and apply them to bodies."""
    package = Path(__file__).parent
    return hashlib.sha256(b"\n".join((package / name).read_bytes() for name in VARIATION_CODE)).hexdigest()


def scenic_version() -> str:
    """Version of the installed Scenic."""
    return version("scenic")


def _sources(folder: Path) -> Iterator[Path]:
    package = Path(__file__).resolve().parent
    vocabulary = package.parents[1] / "scenarios"
    yield from (package / name for name in SCENE_CODE)
    for pattern in SOURCES:
        yield from sorted(folder.glob(pattern))
        if folder.resolve() != vocabulary:
            yield from sorted(vocabulary.glob(pattern))
