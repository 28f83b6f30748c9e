"""The fingerprint of an environment: a hash of everything on which its samples depend.

Input: a Scenic program's name and files, its parameters and seed. Output: a SHA-256 in hexadecimal digits. It also covers
foldcar's folders of code that samples scenes (with the vocabulary) or runs Scenic beside the simulation, and Scenic's
version. A changed hash causes only new sampling: the key of a run without Scenic beside it contains the scene itself.
This file also names sampled scenes, so that `foldcar link` and `foldcar log` can check that they use the same scene.
"""

import hashlib
import json
import os
from collections.abc import Mapping, Sequence
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

from foldcar.scenes.program_files import Files

PACKAGE = Path(__file__).resolve().parents[1]
SCENE_CODE = (PACKAGE / "scenes", PACKAGE / "simulation")
VARIATION_CODE = (PACKAGE / "car" / "variation.py", PACKAGE / "car" / "workshop.json")


def environment_fingerprint(
    program: Path, files: Files, params: Mapping[str, Any], seed: int, condition: Mapping[str, Any] | None = None
) -> str:
    """Return the fingerprint of ``program`` with ``files`` and the rest of its environment (see open_environment).

    Files are named by their paths relative to the program's folder, so that a study may be moved as a whole.
    """
    folder = program.parent.resolve()
    contents = []
    for name, digest in files.items():
        relative_path = Path(os.path.relpath(folder / name, folder))
        contents.append((relative_path.as_posix(), digest))
    contents.sort()
    identity = [program.name, contents, params, seed, condition, scenic_version(), scene_code()]
    return hashlib.sha256(json.dumps(identity, sort_keys=True).encode()).hexdigest()


def spread_fingerprint(spread: Mapping[str, float], seed: int) -> str:
    """Return the fingerprint of the variations drawn from a spread with ``seed``."""
    return hashlib.sha256(json.dumps([spread, seed, variation_code()], sort_keys=True).encode()).hexdigest()


@cache
def scene_code() -> str:
    """Return the hash of foldcar's code, with the vocabulary, that samples scenes and runs Scenic beside carsim."""
    return code_digest(SCENE_CODE)


@cache
def variation_code() -> str:
    """Return the hash of the code and data that draw variations and apply them to bodies."""
    return code_digest(VARIATION_CODE)


def scenic_version() -> str:
    """Return the version of the installed Scenic."""
    return version("scenic")


def code_digest(paths: Sequence[Path]) -> str:
    """Return the hash of names and contents of files, and of all files below folders except compiled Python.

    Raises FileNotFoundError if one of ``paths`` has no files: code that has moved would go unnoticed.
    """
    digest = hashlib.sha256()
    for path in paths:
        candidates = [*path.rglob("*"), path]
        files = [file for file in candidates if "__pycache__" not in file.parts and file.is_file()]
        if not files:
            raise FileNotFoundError(f"{path}: no code to hash")
        for name, file in sorted((file.relative_to(PACKAGE).as_posix(), file) for file in files):
            content = file.read_bytes()
            # The length makes the encoding unambiguous: different lists of files give different bytes.
            digest.update(f"\n{name} {len(content)}\n".encode())
            digest.update(content)
    return digest.hexdigest()


def scene_name(scene: Mapping[str, Any], sample: int) -> str:
    """Return the name of sample ``sample`` with this scene (docs/carsim.md): 16 digits of its hash, /, the number."""
    content = {key: value for key, value in scene.items() if key != "id"}
    text = json.dumps(content, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return f"{hashlib.sha256(text.encode()).hexdigest()[:16]}/{sample}"
