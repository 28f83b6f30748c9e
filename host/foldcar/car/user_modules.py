"""A user's own modules: the Python file that ``--components FILE`` names.

Input: a file that defines subclasses of ``foldcar.car.components.module.Module``. Output: type strings may name them.
An error in it is a message of one line that names file and line number.
"""

import importlib.util
import inspect
import sys
import traceback
from pathlib import Path

from foldcar.car.components.module import Module
from foldcar.car.modules import register
from foldcar.errors import FoldcarError

_loaded: dict[Path, list[str]] = {}


def load_components(file: Path) -> list[str]:
    """Register the modules that the file defines and return their letters; FoldcarError if it fails or has none."""
    path = file.resolve()
    if path in _loaded:
        return _loaded[path]
    spec = importlib.util.spec_from_file_location(f"foldcar_components_{path.stem}", path)
    if spec is None or spec.loader is None or not path.is_file():
        raise FoldcarError(f"--components {file}: is no Python file")
    module = importlib.util.module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except SyntaxError as error:
        raise FoldcarError(f"{file}:{error.lineno}: {error.msg}") from error
    except Exception as error:
        raise FoldcarError(f"{file}:{_line_in(path, error)}: {type(error).__name__}: {error}") from error
    kinds = [
        kind for kind in vars(module).values()
        if inspect.isclass(kind) and issubclass(kind, Module) and kind.__module__ == module.__name__
    ]  # fmt: skip
    if not kinds:
        raise FoldcarError(f"{file}:1: defines no subclass of foldcar.car.components.module.Module")
    sys.modules[module.__name__] = module
    for kind in kinds:
        line = inspect.getsourcelines(kind)[1]
        for attribute in ("letter", "title"):
            if not isinstance(getattr(kind, attribute, None), str):
                raise FoldcarError(f'{file}:{line}: {kind.__name__} has no text "{attribute}"')
        try:
            register(kind)
        except FoldcarError as error:
            raise FoldcarError(f"{file}:{line}: {error}") from error
    _loaded[path] = [kind.letter for kind in kinds]
    return _loaded[path]


def loaded_files() -> list[Path]:
    """The files that were loaded."""
    return list(_loaded)


def place_of(error: BaseException) -> str | None:
    """File and line of the user's component that raised the exception, or None if none did."""
    for frame in reversed(traceback.extract_tb(error.__traceback__)):
        if Path(frame.filename) in _loaded:
            return f"{frame.filename}:{frame.lineno}"
    return None


def _line_in(path: Path, error: Exception) -> int:
    lines = [frame.lineno for frame in traceback.extract_tb(error.__traceback__) if Path(frame.filename) == path]
    return lines[-1] if lines and lines[-1] else 1
