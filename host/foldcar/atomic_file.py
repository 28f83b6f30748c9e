"""Writes files atomically: to a temporary file in the same folder, which then replaces the file."""

import contextlib
import os
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

from foldcar.errors import FoldcarError
from foldcar.interrupts import held


@contextlib.contextmanager
def atomic_file(file: Path) -> Iterator[BinaryIO]:
    """A binary file that replaces ``file`` at the end of the block, or is deleted if the block raises.

    FoldcarError, naming the file, if it cannot be written; an existing file is unchanged then.
    """
    if file.exists() and not file.is_file():
        raise FoldcarError(f"{file}: not a regular file")
    temporary = file.with_name(f".{file.name}.{os.getpid()}.part")
    try:
        with held(temporary.unlink):
            with temporary.open("wb") as binary:
                yield binary
            temporary.replace(file)
    except OSError as error:
        raise FoldcarError(f"{file}: cannot be written: {error.strerror or error}") from error
    finally:
        with contextlib.suppress(OSError):
            temporary.unlink(missing_ok=True)
