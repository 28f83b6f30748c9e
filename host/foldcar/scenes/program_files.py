"""The files and modules of a Scenic program: what its samples and runs follow from besides its parameters and seed.

Input: blocks of code of a program. Output: the SHA-256 of each file that was read in them (of one in its folder also that
it is not there), and of the Scenic and Python
files beside the program, which it may import at any time; FoldcarError if one has changed meanwhile. Files are named
relative to the program's folder, those outside by their whole path. Installed code is not among them. What Python opens
is heard (its audit event `open`); a file that a library in C, another thread or another program opens is not.

Within the blocks environment variables are those that the system and Python need: others are no part of an environment.
There sys.modules and sys.path are as if the program were alone in a new Python: two programs may each have a
`helper.py`, and one that is compiled again gets its modules as they are now. They are compiled from their source: Python
takes compiled code for current if its source had the same size and second.
"""

import importlib
import importlib.util
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from importlib.machinery import ModuleSpec, PathFinder, SourceFileLoader
from pathlib import Path
from types import CodeType, ModuleType
from typing import Any

from foldcar.errors import FoldcarError
from foldcar.read_files import (
    CODE,
    HeardFiles,
    content_digest,
    digest_or_missing,
    file_digest,
    file_state,
    heard_files,
    is_own,
    only_minimal_variables,
)

Files = Mapping[str, str]

# Names in sys.modules that are known to be no program's modules.
_installed: set[str] = set()


class ProgramFiles:
    """The files of one program, as it is compiled, sampled and run. With ``fixed`` it may consist of these only."""

    def __init__(self, program: Path, fixed: Files | None = None) -> None:
        self._program = program
        self._folder = program.parent.absolute()
        self._fixed = fixed is not None
        self._digests = dict(fixed) if fixed is not None else self._neighbours()
        self._modules = _Modules(self._folder)
        self._written: set[Path] = set()

    def fix(self) -> Files:
        """The files. From now on a block must not read others."""
        self._fixed = True
        return self._digests

    def unchanged(self) -> bool:
        """Whether the files are as they were, and no more of them stand beside the program."""
        now = {name: digest_or_missing(self._folder / name) for name in self._digests}
        return {**now, **self._neighbours()} == self._digests

    @contextmanager
    def inside(self, anew: bool = False) -> Iterator[None]:
        """Within the block code of the program runs, with its modules; ``anew`` if that is to load them.

        Raises FoldcarError if a file that it reads is another than before.
        """
        if anew:
            self._modules.forget()
        failed: Exception | None = None
        with only_minimal_variables(), self._modules.loaded(), heard_files() as heard:
            try:
                yield
            except Exception as error:
                failed = error
        # First: it may have failed because of a file that is being changed.
        self._take(heard)
        if failed is not None:
            raise failed

    def _take(self, heard: HeardFiles) -> None:
        self._written |= heard.written
        for path, state in heard.read.items():
            if path.suffix == ".pyc" or path in self._written or not is_own(path, self._folder):
                continue
            if state is None and (self._fixed or not path.is_relative_to(self._folder)):
                # Should it appear, reading it is noticed as late, or as of another file outside.
                continue
            name = self._name(path)
            known, now = self._digests.get(name), digest_or_missing(path) if file_state(path) == state else None
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
        # A package comes before a module of its name.
        files = [*(file for file in self._folder.glob("*") if file.suffix in CODE), *self._folder.glob("*/__init__.py")]
        found = {file.relative_to(self._folder).as_posix(): file_digest(file) for file in files}
        return {name: digest for name, digest in found.items() if digest is not None}


def content(folder: Path, name: str, digest: str) -> bytes:
    """What is in a program's file. FoldcarError if that is no longer the digest's."""
    with suppress(OSError):
        result = (folder / name).read_bytes()
        if content_digest(name, result) == digest:
            return result
    raise _changed(folder / name)


def _changed(file: Path) -> FoldcarError:
    return FoldcarError(f"{file}: has changed while the program was in use; start again with the files as they are now")


class _Modules:
    """The modules of one compiled program, which is in ``folder``."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self.forget()

    def forget(self) -> None:
        """What the program imports is loaded anew."""
        self._modules: dict[str, ModuleType] = {}
        self._path: list[str] | None = None
        importlib.invalidate_caches()

    @contextmanager
    def loaded(self) -> Iterator[None]:
        """Within the block the program's modules are loaded, and no others that are not installed."""
        others, path = _taken(self._folder), list(sys.path)
        sys.modules.update(self._modules)
        # Without the working directory: a program finds the same wherever it is started.
        sys.path[:] = self._path or [str(self._folder), *filter(None, path)]
        finder: Any = _Finder(self._folder)
        sys.meta_path.insert(sys.meta_path.index(PathFinder) if PathFinder in sys.meta_path else 0, finder)
        try:
            yield
        finally:
            sys.meta_path.remove(finder)
            self._path, sys.path[:] = list(sys.path), path
            self._modules = _taken(self._folder)
            sys.modules.update(others)


def _taken(folder: Path) -> dict[str, ModuleType]:
    """The modules that are not installed, taken out of sys.modules."""
    names = sys.modules.keys() - _installed
    own = {name for name in names if _is_own_module(sys.modules[name], folder)} - {"__main__"}
    _installed.update(names - own)
    if own:
        # Compiled code cannot be loaded twice: a library under development stays as a whole.
        stay = {name.partition(".")[0] for name in _installed}
        own = {name for name in own if name.partition(".")[0] not in stay}
    return {name: sys.modules.pop(name) for name in own}


def _is_own_module(module: object, folder: Path) -> bool:
    told = vars(module) if isinstance(module, ModuleType) else {}
    spec, file = told.get("__spec__"), told.get("__file__")
    if isinstance(file, str):
        return spec is not None and isinstance(spec.loader, SourceFileLoader) and is_own(Path(file).absolute(), folder)
    # A folder that is no package.
    return any(is_own(Path(one).absolute(), folder) for one in told.get("__path__", ()))


class _Finder:
    """Python's own finder, for modules that are not installed without their compiled code."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def find_spec(self, name: str, path: Any = None, target: ModuleType | None = None) -> ModuleSpec | None:
        spec = PathFinder.find_spec(name, path, target)
        if spec is not None and type(spec.loader) is SourceFileLoader:
            file = spec.loader.path
            if is_own(Path(file).absolute(), self._folder):
                spec.loader, spec.cached = _FromSource(name, file), None
        return spec


class _FromSource(SourceFileLoader):
    def get_code(self, fullname: str) -> CodeType:
        code: CodeType = self.source_to_code(self.get_data(self.path), self.path)
        return code
