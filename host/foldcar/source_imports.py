"""Makes Python load the user's modules from their sources: what identifies a program is what runs.

Python takes compiled code (``__pycache__``) for current if its source had the same size and second, and opens only that.
So a program's files would be hashed as they are now, while it runs as it was.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from importlib.machinery import SourceFileLoader, SourcelessFileLoader
from pathlib import Path
from types import CodeType

from foldcar.read_files import is_own


@contextmanager
def sources_only(folder: Path) -> Iterator[None]:
    """Within the block, load modules that are not installed from their sources; neither read nor write compiled code.

    ``folder`` is that of the user's program. A module of which there is only compiled code raises ImportError. This holds
    however a module is loaded, also through importlib.
    """
    from_cache, from_compiled = SourceFileLoader.get_code, SourcelessFileLoader.get_code

    def source_code(loader: SourceFileLoader, fullname: str) -> CodeType | None:
        if not is_own(Path(loader.path).absolute(), folder):
            return from_cache(loader, fullname)
        code: CodeType = loader.source_to_code(loader.get_data(loader.path), loader.path)
        return code

    def no_code(loader: SourcelessFileLoader, fullname: str) -> CodeType | None:
        if is_own(Path(loader.path).absolute(), folder):
            raise ImportError(f"{loader.path} is compiled; put its source there", name=fullname, path=loader.path)
        return from_compiled(loader, fullname)

    # The loaders are Python's own classes, because a program may use them directly.
    setattr(SourceFileLoader, "get_code", source_code)  # noqa: B010
    setattr(SourcelessFileLoader, "get_code", no_code)  # noqa: B010
    try:
        yield
    finally:
        setattr(SourceFileLoader, "get_code", from_cache)  # noqa: B010
        setattr(SourcelessFileLoader, "get_code", from_compiled)  # noqa: B010
