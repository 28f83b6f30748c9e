"""The folder that an output goes to: made if it is missing, one level deep.

A path with two missing folders is more often a mistake than a wish, so the folder's own folder must exist.
"""

import os
from pathlib import Path

from foldcar.errors import FoldcarError

# What every SQLite database begins with (sqlite.org/fileformat.html).
SQLITE_MAGIC = b"SQLite format 3\0"


def make_output_folder(folder: Path) -> bool:
    """Make ``folder`` if it is missing, and tell whether it was; FoldcarError as for `check_output_folder`."""
    check_output_folder(folder)
    if folder.is_dir():
        return False
    try:
        folder.mkdir()
    except OSError as error:
        raise FoldcarError(f"{folder}: cannot be written: {error.strerror or error}") from error
    return True


def check_output_folder(folder: Path, output: Path | None = None) -> None:
    """FoldcarError if ``folder`` is none, cannot be made, or cannot be written in; it names ``output``, or the folder."""
    shown = folder if output is None else output
    if folder.is_dir():
        _check_access(folder, shown)
    elif folder.exists() or folder.is_symlink():
        reason = "not a folder" if output is None else f"cannot be written: {folder} is not a folder"
        raise FoldcarError(f"{shown}: {reason}")
    elif not folder.parent.is_dir():
        raise FoldcarError(f"{shown}: cannot be written: there is no folder {folder.parent} to make {folder.name} in")
    else:
        _check_access(folder.parent, shown)


def check_output_file(file: Path) -> None:
    """FoldcarError if ``file`` cannot be a file: its place is taken, or its folder as for `check_output_folder`."""
    if file.exists() and not file.is_file():
        raise FoldcarError(f"{file}: not a regular file")
    check_output_folder(file.parent, file)


def check_replaceable(file: Path) -> None:
    """FoldcarError if ``file`` is an SQLite database: most likely a store, and so the only place of what was measured."""
    try:
        with file.open("rb") as opened:
            start = opened.read(len(SQLITE_MAGIC))
    except OSError:
        return
    if start == SQLITE_MAGIC:
        raise FoldcarError(f"{file}: is a store or another SQLite database, which is not replaced; name another file")


def _check_access(folder: Path, shown: Path) -> None:
    if not os.access(folder, os.W_OK | os.X_OK):
        raise FoldcarError(f"{shown}: cannot be written: no permission to write in the folder {folder.absolute()}")
