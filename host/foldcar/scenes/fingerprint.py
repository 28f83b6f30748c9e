"""What tells one environment from another without running it: a hash of all that its samples depend on.

Input: a Scenic program, its parameters and seed. Output: a hexadecimal SHA-256. Programs can import what
stands beside them, so every Scenic and Python file of the program's folder counts, as do foldcar's folders of code
that sample scenes (with the vocabulary) and that run a program beside the simulation, and Scenic's version. Too much
in the hash only costs sampling anew: the key of a run without Scenic beside it has the scene itself.
"""

import hashlib
import json
from collections.abc import Mapping, Sequence
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

PACKAGE = Path(__file__).resolve().parents[1]
SCENE_FOLDERS = (PACKAGE / "scenes", PACKAGE / "simulation")
VARIATION_FOLDER = PACKAGE / "car" / "variation"
SOURCES = (".scenic", ".py")


def environment_fingerprint(
    program: Path, params: Mapping[str, Any], seed: int, condition: Mapping[str, Any] | None = None
) -> str:
    """The hash for ``program`` with ``params``, ``seed`` and what is frozen of it."""
    beside = {file.name: file for file in program.parent.glob("*") if file.suffix in SOURCES}
    head = [program.name, params, seed, condition, scenic_version(), scene_code()]
    digest = hashlib.sha256(json.dumps(head, sort_keys=True).encode())
    _add(digest, beside)
    return digest.hexdigest()


def spread_fingerprint(spread: Mapping[str, float], seed: int) -> str:
    """The hash of what a spread's variations depend on."""
    return hashlib.sha256(json.dumps([spread, seed, variation_code()], sort_keys=True).encode()).hexdigest()


@cache
def scene_code() -> str:
    """The hash of foldcar's own code, vocabulary included, that samples scenes and runs Scenic beside carsim."""
    return _folders_digest(SCENE_FOLDERS)


@cache
def variation_code() -> str:
    """The hash of the code and data that draw variations and apply them to bodies."""
    return _folders_digest([VARIATION_FOLDER])


def scenic_version() -> str:
    """Version of the installed Scenic."""
    return version("scenic")


def _folders_digest(folders: Sequence[Path]) -> str:
    """A hash of every file below the folders but compiled Python."""
    digest = hashlib.sha256()
    for folder in folders:
        files = (file for file in folder.rglob("*") if file.is_file() and "__pycache__" not in file.parts)
        _add(digest, {file.relative_to(PACKAGE).as_posix(): file for file in files})
    return digest.hexdigest()


def _add(digest: "hashlib._Hash", files: Mapping[str, Path]) -> None:
    for name in sorted(files):
        content = files[name].read_bytes()
        # The length first, so that no two different lists of files run together to the same bytes.
        digest.update(f"\n{name} {len(content)}\n".encode())
        digest.update(content)
