"""The files and modules of a Scenic program, on which its samples and runs depend besides its parameters and seed.

Input: blocks of code of a program. Output: the SHA-256 of each file that was read in them, or that was missing in the
program's folder, and of the Scenic and Python files beside the program, which it may import at any time. FoldcarError if
a file has changed meanwhile. Files are named relative to the program's folder, those outside by their full path.
Installed code is not among them. Files that Python opens are noticed (its audit event `open`); files that a library in
C or another program opens are not. A folder below the program's that it lists is among the files, with its names.

Within the blocks only those environment variables exist that the system and Python need; others are not part of an
environment. sys.modules and sys.path are as if the program were alone in a new Python: two programs may each have a
`helper.py`, and a program that is compiled again gets its modules as they are now, from their sources.
"""

import importlib
import os
import sys
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from importlib.machinery import SourceFileLoader
from pathlib import Path
from types import ModuleType

from foldcar.errors import FoldcarError
from foldcar.read_files import (
    CODE,
    RecordedFiles,
    content_digest,
    digest_or_missing,
    file_digest,
    file_state,
    is_own,
    only_minimal_variables,
    recorded_files,
)
from foldcar.source_imports import sources_only

Files = Mapping[str, str]

# Held while a program's code runs: Scenic, sys.modules and the global random generators are shared by all threads.
program_lock = threading.RLock()
if hasattr(os, "register_at_fork"):
    # A process that is forked while another thread compiles would have half of its changes, and the lock for ever.
    os.register_at_fork(
        before=program_lock.acquire, after_in_parent=program_lock.release, after_in_child=program_lock.release
    )

# Held while a program's code runs: Scenic, sys.modules and the global random generators are shared by all threads.
program_lock = threading.RLock()
if hasattr(os, "register_at_fork"):
    # A process that is forked while another thread compiles would have half of its changes, and the lock for ever.
    os.register_at_fork(
        before=program_lock.acquire, after_in_parent=program_lock.release, after_in_child=program_lock.release
    )

# Names in sys.modules that are known to be installed modules, not a program's.
_installed: set[str] = set()


class ProgramFiles:
    """The files of one program, as it is compiled, sampled and run. With ``fixed`` it may read only these."""

    def __init__(self, program: Path, fixed: Files | None = None) -> None:
        self._program = program
        self._folder = program.parent.absolute()
        self._fixed = fixed is not None
        self._digests: dict[str, str] = dict(fixed) if fixed is not None else self._neighbours()
        self._modules = _Modules(self._folder)
        self._written: set[Path] = set()

    def fix(self) -> Files:
        """Return the files. From now on a block must not read others."""
        self._fixed = True
        return self._digests

    def adopt(self, files: Files) -> None:
        """Add files that another process has read with the program. Raises FoldcarError if it read another version."""
        for name, digest in files.items():
            if self._digests.setdefault(name, digest) != digest:
                raise _changed(self._program.parent / name)

    def require_unchanged(self) -> None:
        """Raise FoldcarError if a file that the program has read, or one beside it, has changed since."""
        for name, digest in self._digests.items():
            if digest_or_missing(self._folder / name) != digest:
                raise _changed(self._program.parent / name)

    def unchanged(self) -> bool:
        """Return whether the files are unchanged, and no new ones are beside the program."""
        current_digests = {name: digest_or_missing(self._folder / name) for name in self._digests}
        current_digests.update(self._neighbours())
        return current_digests == self._digests

    @contextmanager
    def inside(self, anew: bool = False) -> Iterator[None]:
        """Run the block as code of the program: with its modules, and recording the files that it reads.

        If ``anew`` is True, the modules are loaded again. Raises FoldcarError if a file that is read has changed.
        """
        if anew:
            self._modules.forget()
        error_of_block: Exception | None = None
        with program_lock, only_minimal_variables(), self._modules.loaded(), recorded_files() as opened:
            try:
                yield
            except Exception as error:
                error_of_block = error
        # First check the files: a file that is being changed may have caused the error of the block.
        self._record_digests(opened)
        if error_of_block is not None:
            raise error_of_block

    def _record_digests(self, opened: RecordedFiles) -> None:
        """Record the digests of the files that the program has read, and of the folders that it has listed.

        ``opened`` are the files and folders. Files that the program wrote itself and installed files are not recorded.
        Raises FoldcarError if a file has changed, or is read for the first time after sample 0.
        """
        self._written |= opened.written
        for path, state in opened.read.items():
            if path in self._written or not is_own(path, self._folder):
                continue
            is_missing = state is None
            # A missing file need not be recorded after sample 0, or outside the folder: if it appears and is read later,
            # that is noticed then.
            if is_missing and (self._fixed or not path.is_relative_to(self._folder)):
                continue
            # The digest is None if the file has changed since the program read it.
            current = digest_or_missing(path) if file_state(path) == state else None
            self._record(path, current, verb="reads", remedy="read it at the program's head")
        # The program's own folder may hold the store and the report, and Python lists it to find packages.
        for path in sorted(opened.listed):
            if self._folder in path.parents or self._folder.resolve() in path.resolve().parents:
                digest = digest_or_missing(path)
                self._record(path, digest, verb="lists the folder", remedy="list it at the program's head")

    def _record(self, path: Path, current: str | None, verb: str, remedy: str) -> None:
        """Record the digest of a file that the program has read, or of a folder that it has listed.

        ``current`` is the digest, or None if the file has changed since it was read. ``verb`` and ``remedy`` are parts of
        error messages: what the program does with the file, and what it should do. Raises FoldcarError if the file has
        changed since its digest was recorded first, or if it is new after sample 0.
        """
        name = self._name(path)
        recorded_digest = self._digests.get(name)
        if current is None or (recorded_digest and current != recorded_digest):
            raise _changed(self._program.parent / name)
        if recorded_digest is None and self._fixed:
            raise FoldcarError(
                f"{self._program}: {verb} {self._program.parent / name} for the first time after sample 0, too late "
                f"to tell environments apart by it; {remedy}"
            )
        self._digests[name] = current

    def _name(self, path: Path) -> str:
        """Return a file's path relative to the program's folder, or its full path if it is outside."""
        for candidate, folder in ((path, self._folder), (path.resolve(), self._folder.resolve())):
            if candidate.is_relative_to(folder):
                return candidate.relative_to(folder).as_posix()
        return str(path.resolve())

    def _neighbours(self) -> dict[str, str]:
        """Return the digests of the Scenic and Python files and packages beside the program, by name."""
        files = [file for file in self._folder.glob("*") if file.suffix in CODE]
        # If there is a package, Python imports it in place of a module of its name.
        files += self._folder.glob("*/__init__.py")
        digests = {file.relative_to(self._folder).as_posix(): file_digest(file) for file in files}
        return {name: digest for name, digest in digests.items() if digest is not None}


def content(folder: Path, name: str, digest: str) -> bytes:
    """Return the content of a program's file. Raises FoldcarError if it no longer has this digest."""
    with suppress(OSError):
        result = (folder / name).read_bytes()
        if content_digest(name, result) == digest:
            return result
    raise _changed(folder / name)


def _changed(file: Path) -> FoldcarError:
    """Return the error that a file has changed while its program was in use."""
    return FoldcarError(f"{file}: has changed while the program was in use; start again with the files as they are now")


class _Modules:
    """The modules of one compiled program, which is in ``folder``."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self.forget()

    def forget(self) -> None:
        """Forget the program's modules, so that they are loaded again."""
        self._modules: dict[str, ModuleType] = {}
        self._path: list[str] | None = None
        importlib.invalidate_caches()

    @contextmanager
    def loaded(self) -> Iterator[None]:
        """Run the block with sys.modules and sys.path as they would be if this program alone ran in a new Python."""
        other_modules, outer_path = _pop_own_modules(self._folder), list(sys.path)
        sys.modules.update(self._modules)
        # The empty entry means the working directory. It is left out, so that a program finds the same modules wherever
        # it is started.
        sys.path[:] = self._path or [str(self._folder), *filter(None, outer_path)]
        try:
            with sources_only(self._folder):
                yield
        finally:
            self._path, sys.path[:] = list(sys.path), outer_path
            self._modules = _pop_own_modules(self._folder)
            sys.modules.update(other_modules)


def _pop_own_modules(folder: Path) -> dict[str, ModuleType]:
    """Remove the program's own modules from sys.modules, so that they are loaded anew. Return them by name."""
    # Modules that earlier calls have not seen.
    names = sys.modules.keys() - _installed
    own_names = {name for name in names if _is_own_module(sys.modules[name], folder)} - {"__main__"}
    _installed.update(names - own_names)
    if own_names:
        # A compiled module cannot be loaded twice, so it counts as installed. If a package has an installed module, all
        # of the package stays in sys.modules.
        installed_packages = {name.partition(".")[0] for name in _installed}
        own_names = {name for name in own_names if name.partition(".")[0] not in installed_packages}
    return {name: sys.modules.pop(name) for name in own_names}


def _is_own_module(module: object, folder: Path) -> bool:
    """Whether a module is the program's: loaded from a source file, or a package folder, that is not installed."""
    attributes = vars(module) if isinstance(module, ModuleType) else {}
    spec, file = attributes.get("__spec__"), attributes.get("__file__")
    if isinstance(file, str):
        return spec is not None and isinstance(spec.loader, SourceFileLoader) and is_own(Path(file).absolute(), folder)
    # A namespace package: a folder without __init__.py, which has paths but no file.
    return any(is_own(Path(folder_name).absolute(), folder) for folder_name in attributes.get("__path__", ()))
