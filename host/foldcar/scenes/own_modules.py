"""The Python modules of a Scenic program: its neighbours and whatever else it imports that is not installed.

Input: blocks of code of a program. Output: within them, sys.modules and sys.path as if the program were alone in a new
Python. Two programs may each have a `helper.py`; a program that is compiled again gets its modules as they are now. They
are compiled from their source: Python takes compiled code for current if its source had the same size and second.
"""

import importlib
import importlib.util
import site
import sys
import sysconfig
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import cache
from importlib.machinery import ModuleSpec, PathFinder, SourceFileLoader
from pathlib import Path
from types import CodeType, ModuleType
from typing import Any

PACKAGE = Path(__file__).resolve().parents[1]
# What belongs to the system and to its user's libraries.
SYSTEM = ("/etc", "/proc", "/sys", "/usr/share")
USERS = (".cache", ".config")

# Names in sys.modules that are known to be no program's modules.
_installed: set[str] = set()


class OwnModules:
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
    folders += (scenic.submodule_search_locations if scenic is not None else None) or []
    roots = [Path(folder) for folder in folders]
    return {*roots, *(root.resolve() for root in roots)}


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
