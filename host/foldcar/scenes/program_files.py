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
        # Whether the program may read no further files, because its fingerprint has been computed from the known ones.
        self._is_complete = fixed is not None
        self._digests: dict[str, str] = dict(fixed) if fixed is not None else self._neighbours()
        self._modules = _Modules(self._folder)
        self._written: set[Path] = set()

    def fix(self) -> Files:
        """Return the files. From now on a block must not read others."""
        self._is_complete = True
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
            if state is None and not self._must_record_missing(path):
                continue
            # The digest is None if the file has changed since the program read it.
            digest = digest_or_missing(path) if file_state(path) == state else None
            self._record(path, digest, action="reads", remedy="read it at the program's head")
        for path in sorted(opened.listed):
            # Only folders inside the program's folder count. The folder itself may hold the store and the report, and
            # Python lists it to find packages.
            if self._folder in path.parents or self._folder.resolve() in path.resolve().parents:
                digest = digest_or_missing(path)
                self._record(path, digest, action="lists the folder", remedy="list it at the program's head")

    def _must_record_missing(self, path: Path) -> bool:
        """Return whether it must be recorded that the program has looked for a file that does not exist.

        This is so for a file inside the program's folder, until sample 0 is drawn. If another missing file appears later
        and the program reads it, reading it is an error.
        """
        return not self._is_complete and path.is_relative_to(self._folder)

    def _record(self, path: Path, digest: str | None, action: str, remedy: str) -> None:
        """Record the digest of a file that the program has read, or of a folder that it has listed.

        ``digest`` is None if the file has changed since it was read. Raises FoldcarError if the file has changed since
        its digest was recorded first, or if it was not read before sample 0 was drawn. The message says what the program
        does with the file, ``action``, and what it should do instead, ``remedy``.
        """
        name = self._name(path)
        earlier_digest = self._digests.get(name)
        if digest is None or (earlier_digest is not None and digest != earlier_digest):
            raise _changed(self._program.parent / name)
        if earlier_digest is None and self._is_complete:
            raise FoldcarError(
                f"{self._program}: {action} {self._program.parent / name} for the first time after sample 0, too late "
                f"to tell environments apart by it; {remedy}"
            )
        self._digests[name] = digest

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
        path_outside = list(sys.path)
        # Modules of other programs that have the same names.
        modules_outside = _pop_own_modules(self._folder)
        if self._path is None:
            # The empty entry means the working directory. It is left out, so that a program finds the same modules
            # wherever it is started.
            self._path = [str(self._folder), *filter(None, path_outside)]
        sys.path[:] = self._path
        sys.modules.update(self._modules)
        try:
            with sources_only(self._folder):
                yield
        finally:
            # Keep what the block has changed for the next block.
            self._path = list(sys.path)
            self._modules = _pop_own_modules(self._folder)
            sys.path[:] = path_outside
            sys.modules.update(modules_outside)


def _pop_own_modules(folder: Path) -> dict[str, ModuleType]:
    """Remove the program's own modules from sys.modules, so that they are loaded anew. Return them by name.

    Names of all other modules are added to ``_installed``, so that later calls need not look at them again.
    """
    own_names = []
    for name in sys.modules.keys() - _installed:
        if name != "__main__" and _is_own_module(sys.modules[name], folder):
            own_names.append(name)
        else:
            _installed.add(name)
    if not own_names:
        return {}
    # A package may have compiled modules, which cannot be loaded twice. Then all of the package stays in sys.modules.
    installed_packages = {name.partition(".")[0] for name in _installed}
    popped = {}
    for name in own_names:
        package = name.partition(".")[0]
        if package not in installed_packages:
            popped[name] = sys.modules.pop(name)
    return popped


def _is_own_module(module: object, folder: Path) -> bool:
    """Return whether a module is the user's own: it was loaded from a source file in a folder of the user.

    A folder without ``__init__.py`` is also a module, a namespace package. It is the user's own if it is not installed.
    """
    if not isinstance(module, ModuleType):
        return False
    attributes = vars(module)
    spec, file = attributes.get("__spec__"), attributes.get("__file__")
    if isinstance(file, str):
        is_from_source = spec is not None and isinstance(spec.loader, SourceFileLoader)
        return is_from_source and is_own(Path(file).absolute(), folder)
    # A namespace package has no file, but one or more folders.
    package_folders = attributes.get("__path__", ())
    return any(is_own(Path(package_folder).absolute(), folder) for package_folder in package_folders)
