"""Finds the logs of a store's trials, which are in the store's folder or below and named relative to it.

If the store is a symbolic link, the folder is that of the file to which it leads.
"""

import hashlib
from pathlib import Path

from foldcar.store.errors import StoreError


def store_folder(store: Path) -> Path:
    """Return the folder of the store's file."""
    return store.resolve().parent if store.is_symlink() else store.parent


def logs_folder(store: Path) -> Path:
    """Return the folder beside a store to which `foldcar log` writes logs."""
    stem = store.resolve().stem if store.is_symlink() else store.stem
    return store_folder(store) / f"{stem}-logs"


def log_file(store: Path, log: str) -> Path:
    """Return the file of a trial's log. Raises StoreError if it is outside the store's folder.

    Symbolic links are resolved: their targets must be in the folder, too.
    """
    path, folder = Path(log), store_folder(store)
    try:
        inside = bool(log) and not path.is_absolute() and ".." not in path.parts
        inside = inside and (folder / path).resolve().is_relative_to(folder.resolve())
    except (OSError, ValueError, RuntimeError):
        inside = False
    if not inside:
        # A damaged store may have any text as the name: it is escaped and shortened.
        raise StoreError(f'{store}: log: "{ascii(log)[1:-1][:200]}" is outside the folder {folder}')
    return folder / path


def intact_log(store: Path, number: int, log: str, sha256: str | None) -> Path | None:
    """Return the log of trial ``number``; None if the file is missing. Raises StoreError if it was changed."""
    file = log_file(store, log)
    digest = sha256_of(file)
    if digest is not None and sha256 not in (None, digest):
        raise StoreError(f"{file}: is not the log that trial {number} of {store} wrote: its SHA-256 differs")
    return None if digest is None else file


def reference(store: Path, file: Path) -> str:
    """Return the name by which a store refers to a file: relative to its folder if it is inside, else absolute."""
    resolved, folder = file.resolve(), store_folder(store).resolve()
    return (resolved.relative_to(folder) if resolved.is_relative_to(folder) else resolved).as_posix()


def referred_file(store: Path, name: str) -> Path:
    """Return the file to which a name made by :func:`reference` refers."""
    return store_folder(store) / name


def sha256_of(file: Path) -> str | None:
    """Return the SHA-256 of a file in hexadecimal; None if it does not exist. Raises StoreError if it cannot be read."""
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
