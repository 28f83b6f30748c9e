"""Users' own modules of cars, defined in a Python file that ``--components`` names.

Input: a file. Output: its classes, added to MODULES, and a hash of all files that they consist of. Modules see the same
environment variables as Scenic programs. An error in the file is a message of one line that names file and line.
"""

import contextlib
import hashlib
import importlib.util
import inspect
import json
import os
import sys
import traceback
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

from foldcar.car.components.component import ComponentError, Parameter
from foldcar.car.components.composite import Composite
from foldcar.car.components.electronics import ElectronicsModule
from foldcar.car.components.hinge_module import HingeModule
from foldcar.car.components.module import Module
from foldcar.car.design_parameters import MODULES, USER_FILES, parameters
from foldcar.errors import FoldcarError
from foldcar.read_files import RecordedFiles, file_digest, is_own, only_minimal_variables, recorded_files
from foldcar.source_imports import sources_only

# All files that users' modules consist of.
_module_files: set[Path] = set()


def load_components(file: Path) -> list[str]:
    """Register the modules of a car that the file defines, and return their letters.

    Also remember which files the modules were made from. The contents of these files identify cars with such modules.
    Raises FoldcarError if the file fails or defines no module.
    """
    path = file.resolve()
    if path in USER_FILES:
        return USER_FILES[path]
    module, recorded = _executed(file, path)
    for outside in _outside_files(module, recorded, path.parent):
        raise FoldcarError(
            f"--components {file}: reads {outside}, which is outside its folder; put that file beside it, so that both "
            "identify its cars together"
        )
    kinds = _module_classes(module)
    if not kinds:
        raise FoldcarError(f"{file}:1: defines no subclass of Module or Composite of foldcar.car.components")
    sys.modules[module.__name__] = module
    for kind in kinds:
        for reason in _rejections(kind):
            raise FoldcarError(f"{file}:{_first_line(kind)}: {kind.__name__}{reason}")
        MODULES[kind.letter] = kind
        parameters.cache_clear()
        _check_defaults(file, kind)
    USER_FILES[path] = [kind.letter for kind in kinds]
    _module_files.update(_identifying_files(path, recorded))
    return USER_FILES[path]


def _executed(file: Path, path: Path) -> tuple[ModuleType, RecordedFiles]:
    """Execute a Python file, and return its module and the files that it has read. Raises FoldcarError if it fails.

    ``file`` is the path as the user typed it, which messages name, and ``path`` is the same path made absolute.
    """
    spec = importlib.util.spec_from_file_location(f"foldcar_components_{path.stem}", path)
    if spec is None or spec.loader is None or not path.is_file():
        raise FoldcarError(f"--components {file}: is not a Python file")
    module = importlib.util.module_from_spec(spec)
    try:
        # The result must not depend on the user's environment variables or on compiled code that is out of date.
        with only_minimal_variables(), sources_only(path.parent), recorded_files() as recorded:
            spec.loader.exec_module(module)
    except SyntaxError as error:
        raise FoldcarError(f"{file}:{error.lineno}: {error.msg}") from error
    except (Exception, SystemExit) as error:
        line = _last_line(error, path) or 1
        raise FoldcarError(f"{file}:{line}: {type(error).__name__}: {error}") from error
    return module, recorded


def _module_classes(module: ModuleType) -> list[Any]:
    """Return the classes of car modules that a Python module defines itself, not those that it has imported."""
    classes = []
    for value in vars(module).values():
        if inspect.isclass(value) and value.__module__ == module.__name__ and issubclass(value, Module | Composite):
            classes.append(value)
    return classes


def _identifying_files(path: Path, recorded: RecordedFiles) -> set[Path]:
    """Return the files and folders on which the modules in the file ``path`` depend, so that their change is noticed.

    ``recorded`` has the files that were read, and the folders that were listed, while the file was executed. Only files
    that can belong to the user's modules are returned, not those of Python's library, for example.
    """
    folder = path.parent
    files = {path}
    for file, state in recorded.read.items():
        is_missing = state is None
        # A file that is missing in the user's folder may be created later.
        if not is_missing or file.is_relative_to(folder):
            files.add(file)
    # A file that was imported before is not opened again.
    for module in list(sys.modules.values()):
        module_file = getattr(module, "__file__", None)
        if module_file and Path(module_file).is_relative_to(folder):
            files.add(Path(module_file))
    files.update(listed for listed in recorded.listed if folder in listed.parents)
    own_files = {file for file in files if _identifies_module(file, folder)}
    return own_files.union(folder.glob("*.py"))


def _identifies_module(file: Path, folder: Path) -> bool:
    """Return whether the content of a file that was read is part of a user's module in ``folder``."""
    return is_own(file.absolute(), folder)


def _outside_files(module: ModuleType, recorded: RecordedFiles, folder: Path) -> Iterator[Path]:
    """Yield the user's own files outside ``folder`` on which a module depends.

    The module has read them while it was loaded, or it has imported names from them.
    """
    for file, state in recorded.read.items():
        # A file without a state was looked for, but does not exist.
        exists = state is not None
        if exists and _is_outside(file, folder):
            yield file
    # The file of a module that was imported earlier is not read again. So the names that the user's module has imported
    # are followed to the modules that define them.
    for value in vars(module).values():
        defining_module = value.__name__ if isinstance(value, ModuleType) else getattr(value, "__module__", None)
        if defining_module == module.__name__:
            continue
        file_name = getattr(sys.modules.get(str(defining_module)), "__file__", None)
        if file_name is not None and _is_outside(Path(file_name), folder):
            yield Path(file_name)


def _is_outside(file: Path, folder: Path) -> bool:
    """Return whether a file is outside the folder of a user's module, and is no installed code or system file."""
    is_inside = file.is_relative_to(folder) or file.resolve().is_relative_to(folder)
    return not is_inside and _identifies_module(file, folder)


def _check_defaults(file: Path, kind: type[Module] | type[Composite]) -> None:
    """Make a user's module with its default values. Raise FoldcarError, and forget the module, if that fails.

    It also fails if the modules of a composite do not form a chain, or if other modules have modules in them. The message
    names the line of ``file`` that raised the error, or else the line at which the class begins.
    """
    try:
        instance = kind(path=kind.letter)
        if isinstance(instance, Composite):
            instance.check()
        elif any(isinstance(child, Module | HingeModule) for child in instance.children.values()):
            raise ComponentError(instance.path, "has modules in it: derive it from Composite and connect them")
    # A user's code may raise anything, and may call sys.exit.
    except (Exception, SystemExit) as error:
        del MODULES[kind.letter]
        parameters.cache_clear()
        line = _last_line(error, file.resolve()) or _first_line(kind)
        text = str(error) if isinstance(error, FoldcarError) else f"{type(error).__name__}: {error}"
        raise FoldcarError(f"{file}:{line}: {text}") from error


def _last_line(error: BaseException, file: Path) -> int | None:
    """Return the line of a file at which it raised the exception, or called what raised it; None if it did not."""
    lines = [frame.lineno for frame in traceback.extract_tb(error.__traceback__) if Path(frame.filename) == file]
    return lines[-1] if lines else None


def _first_line(kind: type) -> int:
    """Return the line at which the definition of a class begins."""
    return inspect.getsourcelines(kind)[1]


def _rejections(kind: type[Module] | type[Composite]) -> Iterator[str]:
    """Yield the reasons for which a user's class of modules is rejected, each as the end of a message."""
    for attribute in ("letter", "title"):
        if not isinstance(getattr(kind, attribute, None), str):
            yield f' has no string "{attribute}"'
    # In spite of its name, the attribute may be a word. It is the name of the module in type strings, such as W_B_W.
    name = kind.letter
    if not name.isalnum() or name == "common" or name[-1].isdigit():
        yield f': letter "{name}" must consist of letters and digits and end in a letter'
    if name in MODULES:
        yield f': letter "{name}" is already used by {MODULES[name].__name__}'
    if issubclass(kind, ElectronicsModule):
        yield ": derives from the class that carries the electronics; derive it from Module"
    for parameter in kind.parameters:
        if _contradicts_car(parameter, kind):
            yield f': its parameter "{parameter.name}" must be declared like that of the whole car'


def _contradicts_car(parameter: Parameter, kind: type[Module] | type[Composite]) -> bool:
    """Return whether a parameter of a user's class is wrongly declared, because the car has one of the same name.

    The name of a parameter of the whole car, such as "width", stands for that parameter. So a shared parameter, and a
    uniform one, which has the same value in all modules, must be declared like that of the car. A composite computes the
    values of its modules itself, so it may declare a uniform parameter in another way.
    """
    parameter_of_car = parameters().get(parameter.name)
    if parameter_of_car is None or parameter_of_car.declared == parameter:
        return False
    is_uniform_in_module = parameter_of_car.declared.uniform and issubclass(kind, Module)
    return parameter.shared or is_uniform_in_module


def components_digest() -> str:
    """Return a hash of the names and contents of all files that users' modules consist of.

    These are the files that were read while the modules were loaded, and the Python files beside them. Names are taken
    relative to the modules' folders, so that the hash is the same for a copy of the folders.
    """
    digest = hashlib.sha256()
    folders = {path.parent for path in USER_FILES}
    for file in sorted(_module_files):
        relative_names = sorted(os.path.relpath(file, folder) for folder in folders)
        digest.update(json.dumps([relative_names, file_digest(file)]).encode())
    return digest.hexdigest()


@contextlib.contextmanager
def forbid_new_files() -> Iterator[None]:
    """Raise FoldcarError if users' modules read a file within the block that they did not read when they were loaded.

    Designs are told apart by a digest of the files that were read when the modules were loaded, so the digest would not
    change with such a file.
    """
    if not USER_FILES:
        yield
        return
    first_module = next(iter(USER_FILES))
    with only_minimal_variables(), sources_only(first_module.parent), recorded_files() as recorded:
        yield
    for file in _new_files(recorded):
        raise FoldcarError(
            f"{first_module}: reads {file} while a car is folded; foldcar tells designs apart by the files that a "
            "module reads when it is loaded, so read it at the module's head"
        )


def _new_files(recorded: RecordedFiles) -> Iterator[Path]:
    """Yield the recorded files, and listed folders, of users' modules that the modules did not read when loaded."""
    folders = [file.parent for file in USER_FILES]
    read_files = [file for file, state in recorded.read.items() if state is not None]
    listed_folders = [listed for listed in recorded.listed if any(folder in listed.parents for folder in folders)]
    for file in (*read_files, *listed_folders):
        # Files of Python, of installed packages and of foldcar itself may be read at any time. They are not files of a
        # module, and the digest does not contain them.
        is_file_of_modules = all(_identifies_module(file, folder) for folder in folders)
        if is_file_of_modules and file not in _module_files:
            yield file


@contextlib.contextmanager
def component_errors(refusal: Callable[[str | None, str], FoldcarError]) -> Iterator[None]:
    """Within the block, replace exceptions of components by the exception that ``refusal(key, message)`` returns.

    A component is a part of a car, which a user may have programmed. ``refusal`` is often a class of exceptions.
    ``key`` is the key of the wrong parameter, or None. If a user's component raised the exception, the message has its
    file and line. Other exceptions of foldcar's own code are not converted.
    """
    try:
        yield
    except ComponentError as error:
        # The text of an error without a key names the component.
        message = str(error) if error.key is None else error.message
        place = _place_of(error)
        raise refusal(error.key, f"{message} [{place}]" if place else message) from error
    except FoldcarError:
        raise
    except (Exception, SystemExit) as error:
        place = _place_of(error)
        if place is None:
            raise
        raise refusal(None, f"{place}: {type(error).__name__}: {error}") from error


def _place_of(error: BaseException) -> str | None:
    """Return "FILE:LINE" of the user's component that raised the exception, or None if foldcar's own code did."""
    for frame in reversed(traceback.extract_tb(error.__traceback__)):
        if Path(frame.filename) in USER_FILES:
            return f"{frame.filename}:{frame.lineno}"
    return None
