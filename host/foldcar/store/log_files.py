"""Where the logs of a store's trials are: in its folder or below, named relative to it.

The folder is that of the file itself, also if a symbolic link in another folder leads to it.
"""

import hashlib
from pathlib import Path

from foldcar.store.errors import StoreError


def store_folder(store: Path) -> Path:
    """The folder that the store's file is in."""
    return store.resolve().parent if store.is_symlink() else store.parent


def logs_folder(store: Path) -> Path:
    """The folder beside a store that `foldcar log` writes logs to."""
    stem = store.resolve().stem if store.is_symlink() else store.stem
    return store_folder(store) / f"{stem}-logs"


def log_file(store: Path, log: str) -> Path:
    """The file of a log that a trial in ``store`` names; StoreError if the name leads out of the store's folder.

    Symbolic links count: what they lead to must be in the folder too.
    """
    path, folder = Path(log), store_folder(store)
    try:
        inside = bool(log) and not path.is_absolute() and ".." not in path.parts
        inside = inside and (folder / path).resolve().is_relative_to(folder.resolve())
    except (OSError, ValueError, RuntimeError):
        inside = False
    if not inside:
        raise StoreError(f'{store}: log: "{ascii(log)[1:-1][:200]}" leads out of the folder {folder}')
    return folder / path


def intact_log(store: Path, number: int, log: str, sha256: str | None) -> Path | None:
    """The log of trial ``number``; None if the file is gone. StoreError if it is not what the trial wrote."""
    file = log_file(store, log)
    digest = sha256_of(file)
    if digest is not None and sha256 not in (None, digest):
        raise StoreError(f"{file}: is not the log that trial {number} of {store} wrote: its SHA-256 is another")
    return None if digest is None else file


def reference(store: Path, file: Path) -> str:
    """How a store names a file that it only refers to: relative to its folder if it is in there, else from the root."""
    whole, folder = file.resolve(), store_folder(store).resolve()
    return (whole.relative_to(folder) if whole.is_relative_to(folder) else whole).as_posix()


def referred_file(store: Path, name: str) -> Path:
    """The file of a :func:`reference`."""
    return store_folder(store) / name


def sha256_of(file: Path) -> str | None:
    """SHA-256 of a file in hexadecimal; None if there is none. StoreError if it cannot be read."""
    if not file.is_file():
        return None
    digest = hashlib.sha256()
    try:
        with file.open("rb") as binary:
            while block := binary.read(1 << 20):
                digest.update(block)
    except OSError as error:
        raise StoreError(f"{file}: cannot be read: {error.strerror}") from error
    return digest.hexdigest()
