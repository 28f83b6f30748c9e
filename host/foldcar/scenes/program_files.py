"""The files of a Scenic program: what its samples and runs follow from besides its parameters and seed.

Input: blocks of code of a program. Output: the SHA-256 of each file that was read in them, and of the Scenic and Python
files beside the program, which it may import at any time; FoldcarError if one has changed meanwhile. Files are named
relative to the program's folder, those outside by their whole path. Installed code is not among them. What Python opens
is heard (its audit event `open`); a file that a library in C opens by itself is not.
"""

import hashlib
import os
import stat
import sys
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from typing import Any

from foldcar.errors import FoldcarError
from foldcar.scenes.own_modules import OwnModules, is_own

Files = Mapping[str, str]
NEIGHBOURS = (".scenic", ".py")

# What tells a file from a changed one without reading it: its node, size and time of change.
_State = tuple[int, int, int]


class ProgramFiles:
    """The files of one program, as it is compiled, sampled and run. With ``fixed`` it may consist of these only."""

    def __init__(self, program: Path, fixed: Files | None = None) -> None:
        self._program = program
        self._folder = program.parent.absolute()
        self._fixed = fixed is not None
        self._digests = dict(fixed) if fixed is not None else self._neighbours()
        self._modules = OwnModules(self._folder)
        self._written: set[Path] = set()

    @property
    def fixed(self) -> Files | None:
        """The files, if there will be no others."""
        return self._digests if self._fixed else None

    def fix(self) -> Files:
        """The files. From now on a block must not read others."""
        self._fixed = True
        return self._digests

    def apart(self) -> "ProgramFiles":
        """The same files, for another compilation."""
        return ProgramFiles(self._program, self.fixed)

    def unchanged(self) -> bool:
        """Whether the files are as they were, and no more of them stand beside the program."""
        now = {name: _digest(self._folder / name) for name in self._digests}
        return {**now, **self._neighbours()} == self._digests

    @contextmanager
    def inside(self, anew: bool = False) -> Iterator[None]:
        """Within the block code of the program runs, with its modules; ``anew`` if that is to load them.

        Raises FoldcarError if a file that it reads is another than before.
        """
        if anew:
            self._modules.forget()
        failed: Exception | None = None
        with self._modules.loaded(), _heard() as heard:
            try:
                yield
            except Exception as error:
                failed = error
        # First: it may have failed because of a file that is being changed.
        self._take(heard)
        if failed is not None:
            raise failed

    def _take(self, heard: "_Heard") -> None:
        self._written |= heard.written
        for path, state in heard.read.items():
            if path.suffix == ".pyc" or path in self._written or not is_own(path, self._folder):
                continue
            name = self._name(path)
            known, now = self._digests.get(name), _digest(path) if _state(path) == state else None
            if now is None or now != (known or now):
                raise _changed(self._program.parent / name)
            if known is None and self._fixed:
                raise FoldcarError(
                    f"{self._program}: reads {self._program.parent / name} for the first time after sample 0, too late "
                    "to tell environments apart by it; read it at the program's head"
                )
            self._digests[name] = now

    def _name(self, path: Path) -> str:
        for one, folder in ((path, self._folder), (path.resolve(), self._folder.resolve())):
            if one.is_relative_to(folder):
                return one.relative_to(folder).as_posix()
        return str(path.resolve())

    def _neighbours(self) -> dict[str, str]:
        found = {file.name: _digest(file) for file in self._folder.glob("*") if file.suffix in NEIGHBOURS}
        return {name: digest for name, digest in found.items() if digest is not None}


def content(folder: Path, name: str, digest: str) -> bytes:
    """What is in a program's file. FoldcarError if that is no longer the digest's."""
    with suppress(OSError):
        found = (folder / name).read_bytes()
        if hashlib.sha256(found).hexdigest() == digest:
            return found
    raise _changed(folder / name)


def _changed(file: Path) -> FoldcarError:
    return FoldcarError(f"{file}: has changed while the program was in use; start again with the files as they are now")


class _Heard:
    """The files that a thread opens: how those were that it reads, and which it writes."""

    def __init__(self) -> None:
        self._thread = threading.get_ident()
        self.read: dict[Path, _State] = {}
        self.written: set[Path] = set()

    def note(self, given: Any, mode: object, flags: int) -> None:
        if isinstance(given, int) or threading.get_ident() != self._thread or _is_shown():
            return
        with suppress(OSError, TypeError, ValueError):
            path = Path(os.path.normpath(Path(os.fsdecode(given)).absolute()))
            if flags & (os.O_WRONLY | os.O_RDWR) and path not in self.read:
                self.written.add(path)
            elif (state := _state(path)) is not None:
                self.read.setdefault(path, state)


def _is_shown() -> bool:
    """Whether a line of source is read to be shown, as tracebacks do for every file that runs, foldcar's command too."""
    frame = sys._getframe(3)
    callers = (frame, frame.f_back)
    return any(one is not None and one.f_globals.get("__name__") == "linecache" for one in callers)


# The one that hears now is the last. Python cannot take an audit hook back.
_hearing: list[_Heard] = []


@contextmanager
def _heard() -> Iterator[_Heard]:
    _listen()
    one = _Heard()
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


def _state(path: Path) -> _State | None:
    """None if it is no regular file."""
    with suppress(OSError):
        found = path.stat()
        if stat.S_ISREG(found.st_mode):
            return found.st_ino, found.st_size, found.st_mtime_ns
    return None


def _digest(path: Path) -> str | None:
    """The hash of a regular file that can be read, else None."""
    state = _state(path)
    return None if state is None else _read_digest(path, state)


@cache
def _read_digest(path: Path, state: _State) -> str | None:
    with suppress(OSError):
        return hashlib.sha256(path.read_bytes()).hexdigest()
    return None
