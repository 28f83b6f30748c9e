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
    # Python has two classes that load modules: SourceFileLoader compiles a source, or reads the compiled code of an
    # earlier time. SourcelessFileLoader reads compiled code without a source. Their method `get_code` is replaced,
    # because a program may use these classes directly.
    usual_source_code = SourceFileLoader.get_code
    usual_sourceless_code = SourcelessFileLoader.get_code

    def compiled_from_source(loader: SourceFileLoader, fullname: str) -> CodeType | None:
        """Compile the source of a user's own module; load other modules as usual."""
        if not is_own(Path(loader.path).absolute(), folder):
            return usual_source_code(loader, fullname)
        code: CodeType = loader.source_to_code(loader.get_data(loader.path), loader.path)
        return code

    def refused_without_source(loader: SourcelessFileLoader, fullname: str) -> CodeType | None:
        """Refuse a user's own module without a source; load other modules as usual."""
        if is_own(Path(loader.path).absolute(), folder):
            raise ImportError(f"{loader.path} is compiled; put its source there", name=fullname, path=loader.path)
        return usual_sourceless_code(loader, fullname)

    setattr(SourceFileLoader, "get_code", compiled_from_source)  # noqa: B010
    setattr(SourcelessFileLoader, "get_code", refused_without_source)  # noqa: B010
    try:
        yield
    finally:
        setattr(SourceFileLoader, "get_code", usual_source_code)  # noqa: B010
        setattr(SourcelessFileLoader, "get_code", usual_sourceless_code)  # noqa: B010
