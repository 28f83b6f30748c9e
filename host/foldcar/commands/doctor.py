"""`foldcar doctor`: what is installed, what can be reached, which build; a line each."""

import importlib.metadata
import platform
import shutil
import sys
import tempfile
import warnings
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import typer

from foldcar import __version__
from foldcar.commands.options import Json, tell
from foldcar.installation import MODULES, PACKAGE, source_tree

if TYPE_CHECKING:
    from packaging.requirements import Requirement

BROWSERS = ("chromium", "chromium-browser", "google-chrome")
AGAIN = "make setup; where the package is installed by itself: pip install --force-reinstall foldcar-….whl"
# Of Debian and Ubuntu; Scenic's image library loads them.
SYSTEM_LIBRARIES = "libgl1 libglib2.0-0 libxcb1"


@dataclass(frozen=True, slots=True)
class Finding:
    """``state``: ``ok``; ``missing``, without which studies do not run; ``absent``, which only ``text`` needs.

    ``text`` says what was found, ``advice`` what to do about it; "" where nothing is to do.
    """

    name: str
    state: Literal["ok", "missing", "absent"]
    text: str
    advice: str = ""


def doctor(as_json: Json = False) -> None:
    """Show what is installed and what can be reached.

    A line each: ok; absent, which only some commands need; missing, which all studies need. What to do stands after an
    arrow. Exit code 1 if something is missing. Nothing is changed, fetched or driven.

    \b
    Example: foldcar doctor
    """
    found = []
    for one in _findings():
        found.append(one)
        if not as_json:
            todo = f" -> {one.advice}" if one.advice else ""
            typer.echo(f"{one.state:<8} {one.name:<11} {' '.join(one.text.split())}{todo}")
    tell(as_json, {"findings": [asdict(one) for one in found]})
    if any(one.state == "missing" for one in found):
        raise typer.Exit(1)


def _findings() -> Iterator[Finding]:
    """Look for everything; each step takes at most a few seconds."""
    from foldcar.commands import doctor_programs as programs

    checkout = source_tree()
    yield _foldcar(checkout)
    yield _packages()
    yield _scenic()
    project = programs.read_project(checkout) if checkout is not None else None
    yield programs.simulator(checkout, project)
    yield _writable("results", Path.cwd, "change to a folder of yours, or name outputs elsewhere")
    yield _writable("temporary", tempfile.gettempdir, "let TMPDIR name a folder that can be written")
    yield programs.platformio(checkout, project)
    if project is not None:
        yield programs.toolchain(project)
    yield programs.serial_ports()
    yield programs.simulator_with_mujoco(checkout, project)
    yield _mavproxy()
    yield _browser()


def _foldcar(checkout: Path | None) -> Finding:
    """The version that runs, and by which Python."""
    where = f"checkout {checkout}" if checkout is not None else str(PACKAGE)
    return Finding("foldcar", "ok", f"{__version__} in {where}; Python {platform.python_version()}, {sys.executable}")


def _packages() -> Finding:
    """The declared packages against the installed ones; extras that are not there."""
    from packaging.requirements import Requirement

    try:
        declared = [Requirement(text) for text in importlib.metadata.requires("foldcar") or []]
    except importlib.metadata.PackageNotFoundError:
        return Finding("packages", "missing", "foldcar itself is not installed as a package", AGAIN)

    def wrong(extra: str) -> list[str]:
        """What is wrong with the packages that the extra adds; "" is the core."""
        core = [one for one in declared if one.marker is None or one.marker.evaluate({"extra": ""})]
        added = [one for one in declared if one not in core and one.marker and one.marker.evaluate({"extra": extra})]
        return [text for one in (added if extra else core) if (text := _mismatch(one))]

    if wrong(""):
        return Finding("packages", "missing", "; ".join(wrong("")), AGAIN)
    absent = [extra for extra in MODULES if wrong(extra)]
    if absent:
        text = f"as declared, without the extras {', '.join(absent)}: some commands need them"
        return Finding("packages", "absent", text, f"pip install 'foldcar[{','.join(absent)}]'")
    return Finding("packages", "ok", "as declared, and all extras")


def _mismatch(declared: "Requirement") -> str:
    version = _version(declared.name)
    if version is None:
        return f"{declared} is missing"
    if not declared.specifier.contains(version, prereleases=True):
        return f"{declared.name} is {version}, declared is {declared.specifier}"
    return ""


def _version(package: str) -> str | None:
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return None


def _scenic() -> Finding:
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


def _writable(name: str, find: Callable[[], Path | str], advice: str) -> Finding:
    """A folder for results, or for temporary files."""
    folder: Path | None = None
    try:
        folder = Path(find())
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        what = f"{folder}: cannot be written" if folder else "no folder can be written"
        return Finding(name, "missing", f"{what}: {error.strerror}", advice)
    return Finding(name, "ok", f"{folder}: {shutil.disk_usage(folder).free / 1e9:.1f} GB free")


def _mavproxy() -> Finding:
    """A ground station for the car."""
    version = _version("MAVProxy")
    if version is None:
        text = "not installed: only driving by hand and `make test` needs it"
        return Finding("MAVProxy", "absent", text, "pip install MAVProxy")
    return Finding("MAVProxy", "ok", version)


def _browser() -> Finding:
    """Chromium, which opens pages in tests."""
    found = next(filter(None, map(shutil.which, BROWSERS)), None)
    if found is None:
        return Finding("browser", "absent", f"none of {', '.join(BROWSERS)}: only `make test` needs one", "make test")
    return Finding("browser", "ok", found)
