"""Writes files whole or not at all: to a temporary neighbour first, which then takes the file's place."""

import contextlib
import os
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

from foldcar.errors import FoldcarError


@contextlib.contextmanager
def atomic_file(file: Path) -> Iterator[BinaryIO]:
    """A binary file that becomes ``file`` when the block ends well and vanishes when it does not.

    FoldcarError, naming the file, if it cannot be written; an existing file then stays as it was.
    """
    if file.exists() and not file.is_file():
        raise FoldcarError(f"{file}: is no regular file")
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
