"""What `foldcar doctor` looks at: Python's packages, programs, a car."""

import importlib.metadata
import platform
import shutil
import sys
import tempfile
import warnings
from collections.abc import Iterator
from pathlib import Path

from packaging.requirements import Requirement

from foldcar import __version__
from foldcar.commands.doctor_programs import (
    Finding,
    platformio,
    read_project,
    serial_ports,
    simulator,
    simulator_with_mujoco,
    toolchain,
)
from foldcar.installation import MODULES, source_tree


def findings() -> Iterator[Finding]:
    """Look for everything. Nothing is changed, fetched or driven; each step takes at most a few seconds."""
    checkout = source_tree()
    yield foldcar_itself(checkout)
    yield packages()
    yield scenic()
    project = read_project(checkout) if checkout is not None else None
    yield simulator(checkout, project)
    yield from writing()
    yield platformio(checkout, project)
    if project is not None:
        yield toolchain(project)
    yield serial_ports()
    yield simulator_with_mujoco(checkout, project)
    yield mavproxy()
    yield browser()


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


LEAST_PYTHON = (3, 10)
AGAIN = "make setup; where the package is installed by itself: pip install --force-reinstall foldcar-….whl"

# Of Debian and Ubuntu; Scenic's image library loads them.
SYSTEM_LIBRARIES = "libgl1 libglib2.0-0 libxcb1"


def foldcar_itself(checkout: Path | None) -> Finding:
    """The version that runs, and by which Python."""
    where = f"checkout {checkout}" if checkout is not None else str(Path(__file__).resolve().parents[1])
    text = f"{__version__} in {where}; Python {platform.python_version()}, {sys.executable}"
    if sys.version_info < LEAST_PYTHON:
        return Finding("foldcar", "missing", text, f"use Python {'.'.join(map(str, LEAST_PYTHON))} or newer")
    return Finding("foldcar", "ok", text)


def packages() -> Finding:
    """The declared packages against the installed ones; extras that are not there."""
    try:
        declared = [Requirement(text) for text in importlib.metadata.requires("foldcar") or []]
    except importlib.metadata.PackageNotFoundError:
        return Finding("packages", "missing", "foldcar itself is not installed as a package", AGAIN)
    needed = [one for one in declared if one.marker is None or one.marker.evaluate({"extra": ""})]
    wrong = [text for one in needed if (text := _mismatch(one))]
    if wrong:
        return Finding("packages", "missing", "; ".join(wrong), AGAIN)
    absent = [extra for extra in MODULES if any(map(_mismatch, _of_extra(declared, extra)))]
    if absent:
        text = f"{len(needed)} as declared, without the extras {', '.join(absent)}: some commands need them"
        return Finding("packages", "absent", text, f"pip install 'foldcar[{','.join(absent)}]'")
    return Finding("packages", "ok", f"{len(needed)} as declared, and all extras")


def scenic() -> Finding:
    """Scenic, with the system's libraries that it loads."""
    try:
        with warnings.catch_warnings():
            # Scenic warns that somebody else formats tracebacks.
            warnings.simplefilter("ignore")
            import scenic
    except Exception as error:  # whatever a broken library raises
        text = f"cannot be imported: {type(error).__name__}: {error}"
        return Finding("Scenic", "missing", text, f"{AGAIN}; also apt-get install {SYSTEM_LIBRARIES}")
    return Finding("Scenic", "ok", str(importlib.metadata.version(scenic.__name__)))


def mavproxy() -> Finding:
    """A ground station for the car."""
    return _optional("MAVProxy", "MAVProxy", "driving by hand and `make test`", "pip install MAVProxy")


def _of_extra(declared: list[Requirement], extra: str) -> list[Requirement]:
    marked = [one for one in declared if one.marker is not None and not one.marker.evaluate({"extra": ""})]
    return [one for one in marked if one.marker is not None and one.marker.evaluate({"extra": extra})]


def _optional(name: str, package: str, use: str, advice: str) -> Finding:
    version = _version(package)
    if version is None:
        return Finding(name, "absent", f"not installed: only {use} needs it", advice)
    return Finding(name, "ok", version)


def _version(package: str) -> str | None:
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return None


def _mismatch(declared: Requirement) -> str:
    version = _version(declared.name)
    if version is None:
        return f"{declared} is missing"
    if not declared.specifier.contains(version, prereleases=True):
        return f"{declared.name} is {version}, declared is {declared.specifier}"
    return ""
