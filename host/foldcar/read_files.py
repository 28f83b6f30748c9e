"""Which files the code of a user reads, heard through Python's audit event `open`, and which environment variables.

Input: blocks of code. Output: the files that were read in them, with their state at that time. Installed code and the
system's files are told from the user's own. A file that a library in C opens by itself is not heard.
"""

import codecs
import hashlib
import importlib.util
import os
import site
import stat
import sys
import sysconfig
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from typing import Any

PACKAGE = Path(__file__).resolve().parent
CODE = (".scenic", ".py")
# What belongs to the system and to its user's libraries.
SYSTEM = ("/etc", "/proc", "/sys", "/usr/share")
USERS = (".cache", ".config")

# What tells a file from a changed one without reading it: its node, size and time of change.
FileState = tuple[int, int, int]


class HeardFiles:
    """The files that a thread opens: how those were that it reads (None: it was not there), and which it writes."""

    def __init__(self) -> None:
        self._thread = threading.get_ident()
        self.read: dict[Path, FileState | None] = {}
        self.written: set[Path] = set()

    def note(self, given: Any, mode: object, flags: int) -> None:
        """Take notice of an event `open` with these arguments."""
        if isinstance(given, int) or threading.get_ident() != self._thread or _is_shown():
            return
        with suppress(OSError, TypeError, ValueError):
            path = Path(os.path.normpath(Path(os.fsdecode(given)).absolute()))
            if flags & (os.O_WRONLY | os.O_RDWR) and self.read.get(path) is None:
                self.written.add(path)
            elif (state := file_state(path)) is not None or not path.exists():
                self.read.setdefault(path, state)


def _is_shown() -> bool:
    """Whether source is read to be shown, as Scenic's stacks do of every file that runs, foldcar's command too."""
    frame = sys._getframe(3)
    callers = (frame, frame.f_back)
    return any(caller is not None and caller.f_globals.get("__name__") == "linecache" for caller in callers)


# The one that hears now is the last. Python cannot take an audit hook back.
_hearing: list[HeardFiles] = []


@contextmanager
def heard_files() -> Iterator[HeardFiles]:
    """The files that this thread opens within the block."""
    _listen()
    one = HeardFiles()
    _hearing.append(one)
    try:
        yield one
    finally:
        _hearing.remove(one)


@cache
def _listen() -> None:
    def hear(event: str, arguments: tuple[Any, ...]) -> None:
        if event == "open" and _hearing and len(arguments) == 3:
            _hearing[-1].note(*arguments)

    sys.addaudithook(hear)


def file_state(path: Path) -> FileState | None:
    """None if it is no regular file."""
    with suppress(OSError):
        found = path.stat()
        if stat.S_ISREG(found.st_mode):
            return found.st_ino, found.st_size, found.st_mtime_ns
    return None


# In place of the digest of a file that a program wants to read and that is not there.
MISSING = "missing"


def digest_or_missing(path: Path) -> str | None:
    """The :func:`file_digest`; MISSING if there is nothing."""
    return file_digest(path) if path.exists() else MISSING


def file_digest(path: Path) -> str | None:
    """The :func:`content_digest` of a regular file that can be read, else None."""
    state = file_state(path)
    return None if state is None else _read_digest(path, state)


@cache
def _read_digest(path: Path, state: FileState) -> str | None:
    with suppress(OSError):
        return content_digest(path.name, path.read_bytes())
    return None


def content_digest(name: str, content: bytes) -> str:
    """The hash of a file's content; code has the same one with a byte order mark, and with each kind of line break."""
    if name.endswith(CODE):
        content = content.removeprefix(codecs.BOM_UTF8).replace(b"\r\n", b"\n")
    return hashlib.sha256(content).hexdigest()


@cache
def is_own(path: Path, folder: Path) -> bool:
    """Whether what has this absolute path is, for a program in ``folder``, neither installed nor the system's.

    A program may itself be among these, or have them in its folder.
    """
    return not any(
        one.is_relative_to(root) and not (root in base.parents and one.is_relative_to(base))
        for one, base in ((path, folder), (path.resolve(), folder.resolve()))
        for root in _roots()
    )


@cache
def _roots() -> set[Path]:
    """The folders of installed code, Scenic's and foldcar's own among them."""
    scenic = importlib.util.find_spec("scenic")
    folders = [sysconfig.get_paths()[name] for name in ("stdlib", "platstdlib", "purelib", "platlib")]
    folders += [*site.getsitepackages(), site.getusersitepackages(), str(PACKAGE), *SYSTEM]
    with suppress(RuntimeError):
        # A user without a home has none of these.
        folders += [str(Path.home() / name) for name in USERS]
    folders += [os.environ[name] for name in ("XDG_CACHE_HOME", "MPLCONFIGDIR") if name in os.environ]
    folders += (scenic.submodule_search_locations if scenic is not None else None) or []
    roots = [Path(folder) for folder in folders]
    return {*roots, *(root.resolve() for root in roots)}


# Environment variables that the code of a user may read, and the beginnings of others'.
VARIABLES = ("HOME", "LANG", "PATH", "SYSTEMROOT", "TEMP", "TMP", "TMPDIR", "USERPROFILE")
PREFIXES = ("COVERAGE", "DYLD_", "FOLDCAR_CARSIM", "LC_", "LD_", "MPL", "OPENBLAS_", "PYTHON", "XDG_")


def minimal_variables() -> dict[str, str]:
    """The environment variables for code of a user, in this process or in another."""
    return {name: value for name, value in os.environ.items() if name in VARIABLES or name.startswith(PREFIXES)}


@contextmanager
def only_minimal_variables() -> Iterator[None]:
    """Within the block other environment variables are hidden: they are part of no environment and no design."""
    kept = minimal_variables()
    hidden = {name: value for name, value in os.environ.items() if name not in kept}
    for name in hidden:
        del os.environ[name]
    try:
        yield
    finally:
        os.environ.update(hidden)
