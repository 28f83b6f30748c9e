"""Writes files atomically: to a temporary file in the same folder, which then replaces the file."""

import contextlib
import os
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

from foldcar.errors import FoldcarError
from foldcar.interrupts import held
from foldcar.output_folder import check_output_file, check_replaceable, make_output_folder


@contextlib.contextmanager
def atomic_file(file: Path) -> Iterator[BinaryIO]:
    """A binary file that replaces ``file`` at the end of the block, or is deleted if the block raises.

    Its folder is made if it is missing. FoldcarError, naming the file, if it cannot be written, or is a store; an
    existing file is unchanged then.
    """
    check_output_file(file)
    check_replaceable(file)
    made = make_output_folder(file.parent)
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
        if made and not file.exists():
            with contextlib.suppress(OSError):
                file.parent.rmdir()
