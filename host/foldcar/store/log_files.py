"""Finds the logs of a store's trials, which are in a folder beside the store and named relative to the store's folder.

If the store is a symbolic link, its folder is that of the file to which it leads. Names in a store may come from others.
They are accepted only as foldcar writes them: a file of another name could be one that a program reads, such as
model.scenic.
"""

import hashlib
import re
from pathlib import Path

from foldcar.shown_text import shown_line
from foldcar.store.errors import StoreError
from foldcar.store.trial_records import MEDIA_ENDINGS

# As `foldcar log` names logs, in the folder of a store of any name. `foldcar merge` adds the beginning of a trial's UUID.
_LOG_NAME = re.compile(r"[^/\\]+-logs/trial-[0-9]{4,}-[0-9]{8}T[0-9]{6}Z(-[0-9a-f]{8})*\.tlog")
# How many characters of a file's name a message shows.
MAX_SHOWN_CHARACTERS = 200
# How many bytes of a file are read at once to compute its hash: little memory, few calls.
BLOCK_BYTES = 2**20


def store_folder(store: Path) -> Path:
    """Return the folder of the store's file."""
    return store.resolve().parent if store.is_symlink() else store.parent


def logs_folder(store: Path) -> Path:
    """Return the folder beside a store to which `foldcar log` writes logs."""
    stem = store.resolve().stem if store.is_symlink() else store.stem
    return store_folder(store) / f"{stem}-logs"


def log_file(store: Path, log: str) -> Path:
    """Return the file of a trial's log, which has a name such as study-logs/trial-0007-20261122T113100Z.tlog.

    Raises StoreError if the file is outside the store's folder, or is not named as foldcar names logs.
    """
    folder = store_folder(store)
    if not _is_inside(folder, log):
        raise StoreError(f'{store}: log: "{_escaped(log)}" is outside the folder {folder}')
    # If a terminal shows some of its characters in another way, the name could look like that of another log.
    has_log_form = _LOG_NAME.fullmatch(log) is not None
    if not has_log_form or log != shown_line(log):
        expected_name = "NAME-logs/trial-NUMBER-TIME.tlog"
        raise StoreError(f'{store}: log: "{_escaped(log)}" is not named as `foldcar log` names logs: {expected_name}')
    return folder / log


def _is_inside(folder: Path, log: str) -> bool:
    """Return whether a log is really in the store's folder, or in the folder of logs to which a link in it leads.

    People keep logs on another disk, so the folder of logs may be a link. Other links must not lead out of the folder.
    """
    path = Path(log)
    if not log or path.is_absolute() or ".." in path.parts:
        return False
    try:
        file = (folder / path).resolve()
        is_in_store_folder = file.is_relative_to(folder.resolve())
        is_in_logs_folder = file.parent == (folder / path).parent.resolve()
    except (OSError, ValueError, RuntimeError):
        # The system cannot resolve the path, because it is a loop of links, for example.
        return False
    return is_in_store_folder or is_in_logs_folder


def _escaped(name: str) -> str:
    """Return a file's name for a message: in ASCII, and shortened. A damaged store may have any text as the name."""
    return ascii(name)[1:-1][:MAX_SHOWN_CHARACTERS]


def intact_log(store: Path, number: int, log: str, sha256: str | None) -> Path | None:
    """Return the log of trial ``number``; None if the file is missing. Raises StoreError if it was changed.

    ``sha256`` is the hash that the log must have; None if the store does not have it.
    """
    file = log_file(store, log)
    actual_sha256 = sha256_of(file)
    if actual_sha256 is None:
        return None
    if sha256 is not None and sha256 != actual_sha256:
        raise StoreError(f"{file}: is not the log that trial {number} of {store} wrote: its SHA-256 differs")
    return file


def reference(store: Path, file: Path) -> str:
    """Return the name by which a store refers to a file.

    It is relative to the store's folder if the file is in this folder, and absolute otherwise. If the file is a symbolic
    link, the name is that of the link. A tool such as git-annex replaces photos by links to files that have other names,
    without the ending of a photo.
    """
    absolute_path = file.parent.resolve() / file.name
    folder = store_folder(store).resolve()
    if absolute_path.is_relative_to(folder):
        return absolute_path.relative_to(folder).as_posix()
    return absolute_path.as_posix()


def referred_file(store: Path, name: str) -> Path:
    """Return the photo or film to which a name made by :func:`reference` refers.

    Raises StoreError if the name does not end as that of a photo or film.
    """
    suffix = Path(name).suffix.lower()
    if not any(suffix in suffixes for suffixes in MEDIA_ENDINGS.values()):
        raise StoreError(f'{store}: file: "{_escaped(name)}" is neither a photo nor a film')
    return store_folder(store) / name


def sha256_of(file: Path) -> str | None:
    """Return the SHA-256 of a file in hexadecimal; None if it does not exist. Raises StoreError if it cannot be read."""
    if not file.is_file():
        return None
    digest = hashlib.sha256()
    try:
        with file.open("rb") as binary:
            while block := binary.read(BLOCK_BYTES):
                digest.update(block)
    except OSError as error:
        raise StoreError(f"{file}: cannot be read: {error.strerror}") from error
    return digest.hexdigest()
