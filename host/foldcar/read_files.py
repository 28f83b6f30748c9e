"""Records which files a user's code reads and which folders it lists, and limits environment variables.

Input: blocks of code. Output: the files that were read in them, with their state at that time, and the folders that were
listed: Python reports both in audit events. The user's files are distinguished from installed code and system files.
Files that a C library opens directly are not recorded.
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
from types import FrameType
from typing import Any

PACKAGE = Path(__file__).resolve().parent
CODE = (".scenic", ".py")
# Folders of the system, and of libraries in the user's home.
SYSTEM = ("/etc", "/proc", "/sys", "/usr/share")
USERS = (".cache", ".config")

# Inode, size and modification time: they differ if a file was changed, without reading it.
FileState = tuple[int, int, int]


class RecordedFiles:
    """The files that code has ``read``, with their states (None: the file did not exist), and has ``written``.

    ``listed`` are the folders whose names it has read. The code runs in the thread that makes this object, and in threads
    that start later.
    """

    def __init__(self) -> None:
        self._other_threads = sys._current_frames().keys() - {threading.get_ident()}
        self.listed: set[Path] = set()
        self.read: dict[Path, FileState | None] = {}
        self.written: set[Path] = set()

    def record(self, path_or_descriptor: Any, mode: object, flags: int) -> None:
        """Record that the program opens a file. The arguments are those of Python's audit event `open`.

        Files that another thread opens, or that are opened for a stack trace, are not recorded.
        """
        is_descriptor = isinstance(path_or_descriptor, int)
        if is_descriptor:
            # The file is open already. It was recorded when it was opened by its path.
            return
        if self._is_other_thread() or _is_for_stack_trace():
            return
        with suppress(OSError, TypeError, ValueError):
            path = _normal_path(path_or_descriptor)
            # A file that is opened for both, as by "r+", may be read unless its content is dropped.
            is_for_writing = bool(flags & os.O_WRONLY) or bool(flags & os.O_RDWR and flags & os.O_TRUNC)
            # A file that was read before it is written stays an input.
            was_read_before = self.read.get(path) is not None
            if is_for_writing and not was_read_before:
                self.written.add(path)
                return
            state = file_state(path)
            is_folder_or_device = state is None and path.exists()
            if not is_folder_or_device:
                # A missing file is recorded, too, with the state None.
                self.read.setdefault(path, state)

    def record_database(self, name: object) -> None:
        """Record an audit event `sqlite3.connect`: SQLite opens the file itself."""
        if not self._is_other_thread() and isinstance(name, str | bytes | os.PathLike):
            with suppress(OSError, ValueError):
                path = _normal_path(name)
                if (state := file_state(path)) is not None:
                    self.read.setdefault(path, state)

    def record_listing(self, path: object) -> None:
        """Record an audit event `os.listdir` or `os.scandir`, unless Python looks for a module."""
        # The caller of the listing, above this function and the audit hook.
        is_import = sys._getframe(2).f_globals.get("__name__") == "importlib._bootstrap_external"
        if not is_import and not self._is_other_thread() and isinstance(path, str | bytes | os.PathLike):
            with suppress(OSError, ValueError):
                self.listed.add(_normal_path(path))

    def _is_other_thread(self) -> bool:
        return threading.get_ident() in self._other_threads


def _normal_path(path: Any) -> Path:
    return Path(os.path.normpath(Path(os.fsdecode(path)).absolute()))


def _is_for_stack_trace() -> bool:
    """Return whether Python opens a file to show its source in a stack trace.

    Scenic makes such traces of every running file, even foldcar's own. Python's module linecache reads the sources.
    """
    # The stack begins with this function, `record`, the audit hook, and the function that opens the file. linecache opens
    # files itself or by tokenize.open, so it is that function or the one that called it.
    opener = sys._getframe(3)
    caller_of_opener = opener.f_back
    return _is_linecache(opener) or (caller_of_opener is not None and _is_linecache(caller_of_opener))


def _is_linecache(frame: FrameType) -> bool:
    """Return whether a frame executes a function of Python's module linecache."""
    return bool(frame.f_globals.get("__name__") == "linecache")


# The last recorder is active. It is a list, because Python cannot remove an audit hook.
_recorders: list[RecordedFiles] = []


@contextmanager
def recorded_files() -> Iterator[RecordedFiles]:
    """Record the files that code of this thread, and of threads that it starts, opens within the block."""
    _add_audit_hook()
    files = RecordedFiles()
    _recorders.append(files)
    try:
        yield files
    finally:
        _recorders.remove(files)


@cache
def _add_audit_hook() -> None:
    """Pass audit events to the active recorder from now on; done once, because of the cache."""

    def hook(event: str, arguments: tuple[Any, ...]) -> None:
        if not _recorders:
            return
        if event == "open" and len(arguments) == 3:
            _recorders[-1].record(*arguments)
        elif event == "sqlite3.connect":
            _recorders[-1].record_database(arguments[0])
        elif event in ("os.listdir", "os.scandir"):
            _recorders[-1].record_listing(arguments[0])

    sys.addaudithook(hook)


def file_state(path: Path) -> FileState | None:
    """Return a regular file's state; None if ``path`` is not a regular file."""
    with suppress(OSError):
        status = path.stat()
        if stat.S_ISREG(status.st_mode):
            return status.st_ino, status.st_size, status.st_mtime_ns
    return None


# Used instead of a digest for a missing file that a program tried to read.
MISSING = "missing"


def digest_or_missing(path: Path) -> str | None:
    """Return the :func:`file_digest`, or MISSING if the path does not exist."""
    return file_digest(path) if path.exists() else MISSING


def file_digest(path: Path) -> str | None:
    """Return the :func:`content_digest` of a readable regular file, or the digest of a folder's names, else None."""
    state = file_state(path)
    if state is not None:
        return _read_digest(path, state)
    with suppress(OSError):
        return hashlib.sha256("\n".join(sorted(file.name for file in listed_files(path))).encode()).hexdigest()
    return None


def listed_files(folder: Path) -> list[Path]:
    """Return what a folder contains but compiled code and hidden files, which come and go. Raises OSError."""
    return [file for file in folder.iterdir() if file.name != "__pycache__" and not file.name.startswith(".")]


@cache
def _read_digest(path: Path, state: FileState) -> str | None:
    """Return the digest of a file; ``state`` is only a key of the cache, so that a changed file is read again."""
    with suppress(OSError):
        return content_digest(path.name, path.read_bytes())
    return None


def content_digest(name: str, content: bytes) -> str:
    """Return the SHA-256 of a file's content; in code, byte order mark and kind of line breaks do not matter."""
    if name.endswith(CODE):
        content = content.removeprefix(codecs.BOM_UTF8).replace(b"\r\n", b"\n")
    return hashlib.sha256(content).hexdigest()


@cache
def is_own(path: Path, folder: Path) -> bool:
    """Return whether an absolute path is the user's own file, neither installed code nor a system file.

    ``folder`` is the folder of the user's program. If that is itself inside a folder of installed code or of the system,
    the files below it still are the user's own.
    """
    # Neither the path itself nor that to which its symbolic links lead may be foreign.
    return not _is_foreign(path, folder) and not _is_foreign(path.resolve(), folder.resolve())


def _is_foreign(path: Path, own_folder: Path) -> bool:
    """Return whether a path is inside a folder of installed code or of the system, and not in the user's own folder."""
    for root in _installed_roots():
        own_folder_is_inside = root in own_folder.parents
        if own_folder_is_inside and path.is_relative_to(own_folder):
            continue
        if path.is_relative_to(root):
            return True
    return False


@cache
def _installed_roots() -> set[Path]:
    """Return the folders of installed code, including Scenic's and foldcar's, of caches, and of the system."""
    folders = [str(PACKAGE), *SYSTEM]
    # Python's own modules, and installed packages.
    python_paths = sysconfig.get_paths()
    folders += [python_paths[name] for name in ("stdlib", "platstdlib", "purelib", "platlib")]
    folders += [*site.getsitepackages(), site.getusersitepackages()]
    # Scenic may be installed from a checkout, outside the folders of installed packages.
    scenic = importlib.util.find_spec("scenic")
    if scenic is not None and scenic.submodule_search_locations is not None:
        folders += scenic.submodule_search_locations
    # Caches and settings of libraries.
    with suppress(RuntimeError):
        # Path.home() raises if the user has no home.
        folders += [str(Path.home() / name) for name in USERS]
    if sys.pycache_prefix is not None:
        folders.append(sys.pycache_prefix)
    for variable in ("XDG_CACHE_HOME", "MPLCONFIGDIR"):
        if variable in os.environ:
            folders.append(os.environ[variable])
    roots = [Path(folder) for folder in folders]
    # With symbolic links, and with these resolved.
    return {*roots, *(root.resolve() for root in roots)}


# Environment variables that a user's code may read, and prefixes of further ones.
VARIABLES = ("HOME", "LANG", "PATH", "SYSTEMROOT", "TEMP", "TMP", "TMPDIR", "USERPROFILE")
PREFIXES = ("COVERAGE", "DYLD_", "FOLDCAR_CARSIM", "LC_", "LD_", "MPL", "OPENBLAS_", "PYTHON", "XDG_")


def minimal_variables() -> dict[str, str]:
    """Return the environment variables that a user's code may read, in this process or in another."""
    return {name: value for name, value in os.environ.items() if name in VARIABLES or name.startswith(PREFIXES)}


@contextmanager
def only_minimal_variables() -> Iterator[None]:
    """Within the block, hide all environment variables but :func:`minimal_variables`.

    Designs and sampled environments must not depend on the others.
    """
    kept = minimal_variables()
    hidden = {name: value for name, value in os.environ.items() if name not in kept}
    for name in hidden:
        del os.environ[name]
    try:
        yield
    finally:
        os.environ.update(hidden)
