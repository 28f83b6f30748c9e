"""Checks output files and folders, and writes them atomically.

A missing folder is created if its parent exists; a path with two missing folders is probably a mistake. A folder is
replaced only if its manifest names every file in it, so that no file of a user is lost.
"""

import contextlib
import hashlib
import json
import os
import re
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

from foldcar.errors import FoldcarError

# Names that every file system preserves; without capitals, because some file systems ignore case.
PLAIN_NAME = re.compile(r"[a-z0-9-]+(_[a-z0-9-]+)*")
HASHED_NAME = re.compile(r"(.*_)?[0-9a-f]{8}")
MAX_NAME_LENGTH = 40


@contextlib.contextmanager
def atomic_file(file: Path) -> Iterator[BinaryIO]:
    """Yield a binary file that replaces ``file`` at the end of the block, or is deleted if the block raises.

    A missing folder is created. Raises FoldcarError if ``file`` cannot be written or is a store; an existing file then
    stays unchanged.
    """
    check_output_file(file)
    check_replaceable(file)
    was_created = make_output_folder(file.parent)
    temporary = file.with_name(f".{file.name}.{os.getpid()}.part")
    try:
        with temporary.open("wb") as binary:
            yield binary
        temporary.replace(file)
    except OSError as error:
        raise FoldcarError(f"{file}: cannot be written: {error.strerror or error}") from error
    finally:
        with contextlib.suppress(OSError):
            temporary.unlink(missing_ok=True)
        if was_created and not file.exists():
            with contextlib.suppress(OSError):
                file.parent.rmdir()


@contextlib.contextmanager
def atomic_folder(folder: Path, manifest: str) -> Iterator[Path]:
    """Yield a new folder that replaces ``folder`` at the end of the block, or is deleted if the block raises.

    The block writes a file named ``manifest`` into it: a JSON object whose ``files`` are relative paths. Raises
    FoldcarError if ``folder`` cannot be written or contains files that its manifest does not name.
    """
    check_output_folder(folder)
    folder = folder.absolute()
    _check_replaceable(folder, manifest)
    new_folder = folder.with_name(f".{folder.name}.{os.getpid()}.part")
    old_folder = folder.with_name(f".{folder.name}.{os.getpid()}.old")
    try:
        new_folder.mkdir()
    except OSError as error:
        raise FoldcarError(f"{folder}: cannot be written: {error.strerror or error}") from error
    try:
        yield new_folder
        if folder.exists():
            folder.rename(old_folder)
        new_folder.rename(folder)
    except OSError as error:
        raise FoldcarError(f"{folder}: cannot be written: {error.strerror or error}") from error
    finally:
        is_only_moved_away = old_folder.exists() and not folder.exists()
        if is_only_moved_away:
            # The new folder could not take the place of the old one, so the old one gets it back.
            old_folder.rename(folder)
        for leftover in (new_folder, old_folder):
            shutil.rmtree(leftover, ignore_errors=True)


def _check_replaceable(folder: Path, manifest: str) -> None:
    """Raise FoldcarError if the folder has files that its manifest does not name."""
    if not folder.exists():
        return
    try:
        present = {str(file.relative_to(folder)) for file in folder.rglob("*") if not file.is_dir()}
        listed = set(json.loads((folder / manifest).read_text(encoding="utf-8"))["files"]) if present else set()
    except (OSError, ValueError, KeyError, TypeError):
        raise FoldcarError(f"{folder}: contains other files; choose another folder") from None
    unlisted = sorted(present - listed - {manifest})
    if unlisted:
        raise FoldcarError(f"{folder}: contains {unlisted[0]}, which its manifest does not name; choose another folder")


# The first bytes of every SQLite database (sqlite.org/fileformat.html).
SQLITE_MAGIC = b"SQLite format 3\0"


def make_output_folder(folder: Path) -> bool:
    """Create ``folder`` if it is missing; return whether it was created. Raises FoldcarError if it cannot be written."""
    check_output_folder(folder)
    if folder.is_dir():
        return False
    try:
        folder.mkdir()
    except OSError as error:
        raise FoldcarError(f"{folder}: cannot be written: {error.strerror or error}") from error
    return True


def check_output_folder(folder: Path, output: Path | None = None) -> None:
    """Raise FoldcarError if ``folder`` cannot be created, or written to.

    The message names ``output``, the file to write there, if it is given, else the folder.
    """
    named = folder if output is None else output
    if folder.is_dir():
        _check_access(folder, named)
    elif folder.exists() or folder.is_symlink():
        reason = "not a folder" if output is None else f"cannot be written: {folder} is not a folder"
        raise FoldcarError(f"{named}: {reason}")
    elif not folder.parent.is_dir():
        raise FoldcarError(f"{named}: cannot be written: the folder {folder.parent} does not exist")
    else:
        _check_access(folder.parent, named)


def check_output_file(file: Path) -> None:
    """Raise FoldcarError if ``file`` exists and is not a file, or its folder cannot be written to."""
    if file.exists() and not file.is_file():
        raise FoldcarError(f"{file}: not a regular file")
    check_output_folder(file.parent, file)


def check_replaceable(file: Path) -> None:
    """Raise FoldcarError if ``file`` is an SQLite database, because a store may be the only copy of trials."""
    if is_database(file):
        raise FoldcarError(f"{file}: is a store or another SQLite database, which is not replaced; name another file")


def is_database(file: Path) -> bool:
    """Return whether ``file`` is an SQLite database, such as a store; False if it cannot be read."""
    try:
        with file.open("rb") as opened:
            return opened.read(len(SQLITE_MAGIC)) == SQLITE_MAGIC
    except OSError:
        return False


def _check_access(folder: Path, named: Path) -> None:
    """Raise FoldcarError, which names ``named``, if the user may not write in an existing folder."""
    if not os.access(folder, os.W_OK | os.X_OK):
        raise FoldcarError(f"{named}: cannot be written: no permission to write in the folder {folder.absolute()}")


def file_name_part(name: str) -> str:
    """Return a part of a file name that every file system allows. Different names give different parts.

    If ``name`` is short and consists of plain characters, it is returned as it is. Otherwise the result has its plain
    characters and eight digits of its SHA-256.

    Example: file_name_part("ramp-1") is "ramp-1", and file_name_part("Ramp 1") is "ramp_1_" with eight digits after it.
    """
    is_plain = len(name) <= MAX_NAME_LENGTH and PLAIN_NAME.fullmatch(name) is not None
    # A plain name that ends with such digits gets digits, too. Otherwise it could be equal to the result of another name.
    if is_plain and not HASHED_NAME.fullmatch(name):
        return name
    plain_characters = re.sub("[^a-z0-9-]+", "_", name.lower())[:MAX_NAME_LENGTH].strip("_")
    digits = hashlib.sha256(name.encode("utf-8", "surrogatepass")).hexdigest()[:8]
    return f"{plain_characters}_{digits}" if plain_characters else digits
