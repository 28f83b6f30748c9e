"""Writes folders atomically: to a temporary folder beside it, which then replaces the folder.

A folder is replaced only if its manifest names every file in it, so that no file of a user is lost.
"""

import contextlib
import json
import os
import shutil
from collections.abc import Iterator
from pathlib import Path

from foldcar.errors import FoldcarError
from foldcar.interrupts import delayed, held
from foldcar.output_folder import check_output_folder


@contextlib.contextmanager
def atomic_folder(folder: Path, manifest: str) -> Iterator[Path]:
    """A new folder that replaces ``folder`` at the end of the block, or is deleted if the block raises.

    The block writes a file named ``manifest`` into it, a JSON object whose ``files`` are relative paths. FoldcarError,
    naming the folder, if it cannot be written or contains other files.
    """
    check_output_folder(folder)
    folder = folder.absolute()
    _check_replaceable(folder, manifest)
    temporary = folder.with_name(f".{folder.name}.{os.getpid()}.part")
    old = folder.with_name(f".{folder.name}.{os.getpid()}.old")
    try:
        temporary.mkdir()
    except OSError as error:
        raise FoldcarError(f"{folder}: cannot be written: {error.strerror or error}") from error
    try:
        with held(lambda: shutil.rmtree(temporary)):
            yield temporary
            with delayed():
                if folder.exists():
                    folder.rename(old)
                temporary.rename(folder)
    except OSError as error:
        if old.exists() and not folder.exists():
            old.rename(folder)
        raise FoldcarError(f"{folder}: cannot be written: {error.strerror or error}") from error
    finally:
        for leftover in (temporary, old):
            shutil.rmtree(leftover, ignore_errors=True)


def _check_replaceable(folder: Path, manifest: str) -> None:
    if not folder.exists():
        return
    try:
        held = {str(file.relative_to(folder)) for file in folder.rglob("*") if not file.is_dir()}
        listed = set(json.loads((folder / manifest).read_text(encoding="utf-8"))["files"]) if held else set()
    except (OSError, ValueError, KeyError, TypeError):
        raise FoldcarError(f"{folder}: contains other files; choose another folder") from None
    foreign = sorted(held - listed - {manifest})
    if foreign:
        raise FoldcarError(f"{folder}: contains {foreign[0]}, which its manifest does not name; choose another folder")
