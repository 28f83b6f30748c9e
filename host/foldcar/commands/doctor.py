"""`foldcar doctor`: what is installed, what can be reached, which build; a line each."""

import importlib.metadata
import os
import platform
import shutil
import sys
import tempfile
import warnings
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import typer

from foldcar.commands.options import Json, print_result
from foldcar.errors import FoldcarError
from foldcar.installation import MODULES, PACKAGE, pio_program, source_tree
from foldcar.version import __version__

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
    for finding in _findings():
        found.append(finding)
        if not as_json:
            todo = f" -> {finding.advice}" if finding.advice else ""
            typer.echo(f"{finding.state:<8} {finding.name:<11} {' '.join(finding.text.split())}{todo}")
    print_result(as_json, {"findings": [asdict(one) for one in found]})
    if any(one.state == "missing" for one in found):
        raise typer.Exit(1)


def _findings() -> Iterator[Finding]:
    """Look for everything."""
    checkout = source_tree()
    where = f"checkout {checkout}" if checkout is not None else str(PACKAGE)
    yield Finding("foldcar", "ok", f"{__version__} in {where}; Python {platform.python_version()}, {sys.executable}")
    yield _packages()
    yield _scenic()
    yield _simulator(checkout)
    yield _writable("results", ".", "change to a folder of yours, or name outputs elsewhere")
    yield _writable("temporary", None, "let TMPDIR name a folder that can be written")
    pio = pio_program() if checkout is not None else None
    yield _tool("PlatformIO", pio, "no `pio`, or no checkout: no car can be flashed", "make setup in a checkout")
    yield _serial_ports()
    yield _simulator_with_mujoco(checkout)
    yield _tool("MAVProxy", _version("MAVProxy"), "only for driving by hand and `make test`", "pip install MAVProxy")
    browser = next(filter(None, map(shutil.which, BROWSERS)), None)
    yield _tool("browser", browser, f"none of {', '.join(BROWSERS)}: only `make test` needs one", "make test")


def _tool(name: str, found: str | None, without: str, advice: str) -> Finding:
    return Finding(name, "absent", without, advice) if found is None else Finding(name, "ok", found)


def _packages() -> Finding:
    """The declared packages against the installed ones; extras that are not there."""
    from packaging.requirements import Requirement

    try:
        declared = [Requirement(text) for text in importlib.metadata.requires("foldcar") or []]
    except importlib.metadata.PackageNotFoundError:
        return Finding("packages", "missing", "foldcar itself is not installed as a package", AGAIN)
    core = [one for one in declared if one.marker is None or one.marker.evaluate({"extra": ""})]
    wrong = [text for one in core if (text := _mismatch(one))]
    if wrong:
        return Finding("packages", "missing", "; ".join(wrong), AGAIN)
    added = [one for one in declared if one not in core and one.marker is not None]
    absent = [
        extra for extra in MODULES
        if any(one.marker.evaluate({"extra": extra}) and _mismatch(one) for one in added if one.marker)
    ]  # fmt: skip
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


def _simulator(checkout: Path | None) -> Finding:
    from foldcar.simulation.carsim import Carsim
    from foldcar.simulation.engines import BINARY_VARIABLE

    try:
        carsim = Carsim()
    except FoldcarError as error:
        advice = "make setup" if checkout is not None else "pip install --force-reinstall foldcar-….whl"
        if os.environ.get(BINARY_VARIABLE):
            advice = f"let {BINARY_VARIABLE} name a carsim, or leave it out"
        return Finding("carsim", "missing", str(error), advice)
    return Finding("carsim", "ok", f"build {carsim.build}, firmware {carsim.firmware}, {carsim.binary}")


def _simulator_with_mujoco(checkout: Path | None) -> Finding:
    from foldcar.simulation.carsim import Carsim
    from foldcar.simulation.engines import MUJOCO

    try:
        carsim = Carsim(engine=MUJOCO)
    except FoldcarError as error:
        advice = "make mujoco" if checkout else "pip install 'foldcar[mujoco]', which needs Python 3.11 or newer"
        return Finding("MuJoCo", "absent", f"{error}; only --engine mujoco needs it", advice)
    return Finding("MuJoCo", "ok", f"build {carsim.build}, firmware {carsim.firmware}, {carsim.binary}")


def _writable(name: str, folder: str | None, advice: str) -> Finding:
    """A folder for results, or for temporary files."""
    try:
        chosen = Path(folder or tempfile.gettempdir()).absolute()
        with tempfile.TemporaryFile(dir=chosen):
            pass
    except OSError as error:
        where = f"{Path(folder).absolute()}: cannot be written" if folder else "no folder can be written"
        return Finding(name, "missing", f"{where}: {error.strerror}", advice)
    return Finding(name, "ok", f"{chosen}: {shutil.disk_usage(chosen).free / 1e9:.1f} GB free")


def _serial_ports() -> Finding:
    """Cars on USB, and whether this user may open them."""
    from foldcar.link.stream import usb_ports

    ports = usb_ports()
    if not ports:
        return Finding("car on USB", "absent", "no USB serial port", "plug a car in, or let `foldcar link` pose as one")
    shown = ", ".join(f"{port.path} ({port.description})" for port in ports)
    closed = [port.path for port in ports if not os.access(port.path, os.R_OK | os.W_OK)]
    if closed:
        shown += f": no permission for {', '.join(closed)}"
        return Finding("car on USB", "absent", shown, "sudo usermod -aG dialout $USER, then log in again")
    return Finding("car on USB", "ok", shown)
