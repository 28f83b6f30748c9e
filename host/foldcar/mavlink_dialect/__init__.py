"""The MAVLink dialect as a Python module, generated once for each user and loaded from the cache folder.

The package imports pymavlink through ``load_dialect()`` only: MAVLink 2 and the dialect must be selected before
pymavlink is first imported.
"""

import importlib.util
import os
import sys
from pathlib import Path
from types import ModuleType

from foldcar.errors import FoldcarError
from foldcar.interrupts import raised
from foldcar.mavlink_dialect.generation import NAME, DialectError, digest, write_module

MODULE = f"pymavlink.dialects.v20.{NAME}"


def load_dialect() -> ModuleType:
    """The module with the classes of messages and enums; it also becomes mavutil's current dialect.

    Raises FoldcarError if it cannot be generated or loaded.
    """
    if MODULE in sys.modules:
        return sys.modules[MODULE]
    os.environ["MAVLINK20"] = "1"
    os.environ["MAVLINK_DIALECT"] = NAME
    try:
        file = _cache_folder() / f"mavlink-{digest()[:16]}" / f"{NAME}.py"
        if not file.is_file():
            with raised():
                write_module(file)
    except (DialectError, OSError) as error:
        raise FoldcarError(f"the MAVLink dialect cannot be generated: {error}") from None
    import pymavlink.dialects.v20 as dialects

    spec = importlib.util.spec_from_file_location(MODULE, file)
    if spec is None or spec.loader is None:
        raise FoldcarError(f"the MAVLink dialect cannot be loaded: {file}")
    module = importlib.util.module_from_spec(spec)
    sys.modules[MODULE] = module
    spec.loader.exec_module(module)
    setattr(dialects, NAME, module)
    return module


def _cache_folder() -> Path:
    named = os.environ.get("XDG_CACHE_HOME")
    return Path(named) / "foldcar" if named else Path.home() / ".cache" / "foldcar"
