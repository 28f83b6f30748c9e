"""What the operating system gives: places to write, a browser."""

import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path

from foldcar.installation.finding import Finding

BROWSERS = ("chromium", "chromium-browser", "google-chrome")


def writing() -> Iterator[Finding]:
    """The current folder, for results, and the one for temporary files."""
    yield _writable("results", Path.cwd(), "change to a folder of yours, or name outputs elsewhere")
    yield _writable("temporary", _temporary(), "let TMPDIR name a folder that can be written")


def browser() -> Finding:
    """Chromium, which opens pages in tests."""
    found = next(filter(None, map(shutil.which, BROWSERS)), None)
    if found is None:
        return Finding("browser", "absent", f"none of {', '.join(BROWSERS)}: only `make test` needs one", "make test")
    return Finding("browser", "ok", found)


def _temporary() -> Path | None:
    try:
        return Path(tempfile.gettempdir())
    except OSError:
        return None


def _writable(name: str, folder: Path | None, advice: str) -> Finding:
    if folder is None:
        return Finding(name, "missing", "no folder for temporary files can be written", advice)
    try:
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        return Finding(name, "missing", f"{folder}: cannot be written: {error.strerror}", advice)
    return Finding(name, "ok", f"{folder}: {shutil.disk_usage(folder).free / 1e9:.1f} GB free")
