"""`foldcar doctor` prints a line for each thing that foldcar needs: whether it is installed, and which version."""

import contextlib
import importlib.metadata
import json
import os
import platform
import shutil
import sys
import tempfile
import time
import warnings
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import typer

from foldcar.commands.options import Json, print_result
from foldcar.errors import FoldcarError
from foldcar.installation import MODULES, PACKAGE, extras_command, pio_program, source_tree
from foldcar.version import __version__

if TYPE_CHECKING:
    from packaging.requirements import Requirement

    from foldcar.simulation.carsim import Carsim

# Simulated time (s) of a run by which the simulator's speed is measured, and the number of runs.
SPEED_RUN_S, SPEED_RUNS = 5.0, 40
# A measured time is raised to this, because of the clock's noise.
MIN_COMPUTING_S = 1e-3
# Level ground without obstacles and without a goal, so large that the car does not leave it.
ENDLESS_SCENE = {
    "friction": 0.6,
    "terrain": [],
    "start": {"x_m": 0, "y_m": 0, "heading_rad": 0},
    "goal": None,
    "course": {"x_min_m": -1000, "x_max_m": 1000, "y_min_m": -1000, "y_max_m": 1000},
}
BROWSERS = ("chromium", "chromium-browser", "google-chrome")
REINSTALL = "make setup; where the package is installed by itself: pip install --force-reinstall foldcar-….whl"
# Packages of Debian and Ubuntu that Scenic's image library loads.
SYSTEM_LIBRARIES = "libgl1 libglib2.0-0 libxcb1"


@dataclass(frozen=True, slots=True)
class DoctorFinding:
    """One line of the check.

    ``state`` is ``ok``, ``missing`` (no study runs without it) or ``absent`` (only the commands in ``text`` need it).
    ``text`` says what is installed, ``advice`` what to do; "" if nothing has to be done.
    """

    name: str
    state: Literal["ok", "missing", "absent"]
    text: str
    advice: str = ""


def doctor(as_json: Json = False) -> None:
    """Check the installation and connected cars.

    Each line begins with ok, absent (only some commands need it) or missing (all studies need it). After an arrow, the
    line says how to mend the problem.

    Exit code 1 if something is missing. The check changes nothing, downloads nothing and moves no car. Cars on USB are
    asked for their parameters.

    \b
    Example: foldcar doctor
    """
    findings = []
    for finding in _findings():
        findings.append(finding)
        if not as_json:
            # Messages of other programs may have several lines.
            text = " ".join(finding.text.split())
            advice_text = f" -> {finding.advice}" if finding.advice else ""
            typer.echo(f"{finding.state:<8} {finding.name:<11} {text}{advice_text}")
    print_result(as_json, {"findings": [asdict(finding) for finding in findings]})
    if any(finding.state == "missing" for finding in findings):
        raise typer.Exit(1)


def _findings() -> Iterator[DoctorFinding]:
    """Yield the findings in the order in which they are printed."""
    checkout = source_tree()
    where = f"checkout {checkout}" if checkout is not None else str(PACKAGE)
    yield DoctorFinding(
        "foldcar", "ok", f"{__version__} in {where}; Python {platform.python_version()}, {sys.executable}"
    )
    yield _packages()
    yield _scenic()
    yield _simulator(checkout)
    yield _writable("results", ".", "change to a folder of yours, or name outputs elsewhere")
    yield _writable("temporary", None, "let TMPDIR name a folder that can be written")
    pio = pio_program() if checkout is not None else None
    yield _tool("PlatformIO", pio, "no `pio`, or no checkout: no car can be flashed", "make setup in a checkout")
    yield _serial_ports()
    yield from _reversed_servos()
    yield _simulator_with_mujoco(checkout)
    yield _tool("MAVProxy", _version("MAVProxy"), "only for driving by hand and `make test`", "pip install MAVProxy")
    yield _tool("browser", _browser(), f"none of {', '.join(BROWSERS)}: only `make test` needs one", "make test")


def _browser() -> str | None:
    """Return the path of the first of BROWSERS that is installed, or None if none is."""
    for name in BROWSERS:
        path = shutil.which(name)
        if path is not None:
            return path
    return None


def _tool(name: str, path: str | None, if_absent: str, advice: str) -> DoctorFinding:
    """Return the finding on an optional tool.

    ``path`` is the tool's path or version, or None if it is not installed. If it is not, the finding has the text
    ``if_absent`` and the ``advice``.
    """
    if path is None:
        return DoctorFinding(name, "absent", if_absent, advice)
    return DoctorFinding(name, "ok", path)


def _packages() -> DoctorFinding:
    """Compare installed packages with those that foldcar declares, and find extras that are not installed."""
    from packaging.requirements import Requirement

    try:
        declared = [Requirement(text) for text in importlib.metadata.requires("foldcar") or []]
    except importlib.metadata.PackageNotFoundError:
        return DoctorFinding("packages", "missing", "foldcar itself is not installed as a package", REINSTALL)
    # An extra is a set of optional packages; "" stands for no extra. A package of no extra is always needed.
    required = [package for package in declared if _is_needed(package, extra="")]
    mismatches = [text for text in map(_mismatch, required) if text]
    if mismatches:
        return DoctorFinding("packages", "missing", "; ".join(mismatches), REINSTALL)
    absent_extras = []
    for extra in MODULES:
        if any(_is_needed(package, extra) and _mismatch(package) for package in declared):
            absent_extras.append(extra)
    if absent_extras:
        text = f"as declared, without the extras {', '.join(absent_extras)}: some commands need them"
        return DoctorFinding("packages", "absent", text, extras_command(absent_extras))
    return DoctorFinding("packages", "ok", "as declared, and all extras")


def _is_needed(package: "Requirement", extra: str) -> bool:
    """Return whether a declared package is needed on this system by an installation with this ``extra``."""
    return package.marker is None or package.marker.evaluate({"extra": extra})


def _mismatch(declared: "Requirement") -> str:
    """Return how the installed package differs from the declared one: missing or another version; "" if it fits."""
    version = _version(declared.name)
    if version is None:
        return f"{declared} is missing"
    if not declared.specifier.contains(version, prereleases=True):
        return f"{declared.name} is {version}, declared is {declared.specifier}"
    return ""


def _version(package: str) -> str | None:
    """Return the version of an installed package, None if it is not installed."""
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return None


def _scenic() -> DoctorFinding:
    """Check that Scenic can be imported, with the system libraries that it loads."""
    try:
        with warnings.catch_warnings():
            # Scenic warns if another library formats tracebacks.
            warnings.simplefilter("ignore")
            import scenic
    except Exception as error:  # a broken library may raise anything
        text = f"cannot be imported: {type(error).__name__}: {error}"
        return DoctorFinding("Scenic", "missing", text, f"{REINSTALL}; also apt-get install {SYSTEM_LIBRARIES}")
    return DoctorFinding("Scenic", "ok", str(importlib.metadata.version(scenic.__name__)))


def _simulator(checkout: Path | None) -> DoctorFinding:
    """Check that carsim simulates, and measure how fast."""
    from foldcar.simulation.carsim import Carsim
    from foldcar.simulation.engines import BINARY_VARIABLE, is_wasm

    try:
        carsim = Carsim()
        speedup = _speedup(carsim)
    except FoldcarError as error:
        advice = "make setup" if checkout is not None else "pip install --force-reinstall foldcar-….whl"
        if os.environ.get(BINARY_VARIABLE):
            advice = f"let {BINARY_VARIABLE} name a carsim, or leave it out"
        return DoctorFinding("carsim", "missing", str(error), advice)
    how = "WebAssembly with Node" if is_wasm(carsim.binary) else "native"
    text = f"{how}, {speedup:.0f} times real time, build {carsim.build}, firmware {carsim.firmware}, {carsim.binary}"
    return DoctorFinding("carsim", "ok", text)


def _speedup(carsim: "Carsim") -> float:
    """Return the ratio of simulated time to computing time of one simulator, for a car on level ground."""
    # Both calls start carsim once, so the difference is the time of SPEED_RUNS runs.
    single_s = _duration_s(carsim, runs=1)
    computing_s = _duration_s(carsim, runs=1 + SPEED_RUNS) - single_s
    return SPEED_RUNS * SPEED_RUN_S / max(MIN_COMPUTING_S, computing_s)


def _duration_s(carsim: "Carsim", runs: int) -> float:
    """Return how long carsim takes for so many equal runs on level ground, including its start (s)."""
    from foldcar.car.body import body_json, firmware_parameters, full_speed_m_s
    from foldcar.car.design import compose
    from foldcar.simulation.runner import RunRequest

    # The car with two axles, of default size.
    design = compose("W_B_W", {})
    body = body_json(design)
    settings = {
        "speed_m_s": full_speed_m_s(design),
        "time_limit_s": SPEED_RUN_S,
        "parameters": firmware_parameters(design, body),
    }
    bodies, scenes = {"body": json.dumps(body)}, {"scene": json.dumps(ENDLESS_SCENE)}
    request = RunRequest(body="body", scene="scene", settings=json.dumps(settings), label="speed", sample=0)
    started_s = time.perf_counter()
    carsim.run(bodies, scenes, [request] * runs)
    return time.perf_counter() - started_s


def _reversed_servos() -> Iterator[DoctorFinding]:
    """Yield a finding for each car on USB with reversed servos.

    The car's design says in which direction each servo turns its wheel. The user can reverse it in the car's parameters.

    Ports without a car, and cars that another program uses, are left out.
    """
    from foldcar.link.car import greeted
    from foldcar.link.parameters import read_parameters
    from foldcar.link.stream import usb_ports

    for port in usb_ports():
        if not port.is_feather:
            continue
        with contextlib.suppress(FoldcarError):
            with greeted(port.path) as car:
                values, design = read_parameters(car), car.identity().name
            reversed_names = [name for name, value in values.items() if name.endswith("_REVERSED") and value]
            if reversed_names:
                text = f"{design or port.path}: {', '.join(reversed_names)} 1: turns the other way than its design says"
                yield DoctorFinding("servos", "ok", text, "if that is wrong: foldcar calibrate-servos")


def _simulator_with_mujoco(checkout: Path | None) -> DoctorFinding:
    """Check that carsim with MuJoCo starts."""
    from foldcar.simulation.carsim import Carsim
    from foldcar.simulation.engines import MUJOCO

    try:
        carsim = Carsim(engine=MUJOCO)
    except FoldcarError as error:
        advice = "make mujoco" if checkout else "pip install 'foldcar[mujoco]', which needs Python 3.11 or newer"
        return DoctorFinding("MuJoCo", "absent", f"{error}; only --engine mujoco needs it", advice)
    return DoctorFinding("MuJoCo", "ok", f"build {carsim.build}, firmware {carsim.firmware}, {carsim.binary}")


def _writable(name: str, folder: str | None, advice: str) -> DoctorFinding:
    """Check that ``folder`` can be written; None stands for the system's folder for temporary files."""
    try:
        # gettempdir raises OSError if it finds no folder that can be written.
        checked_folder = Path(folder or tempfile.gettempdir()).absolute()
        with tempfile.TemporaryFile(dir=checked_folder):
            pass
    except OSError as error:
        problem = f"{Path(folder).absolute()}: cannot be written" if folder else "no folder can be written"
        return DoctorFinding(name, "missing", f"{problem}: {error.strerror}", advice)
    free_gb = shutil.disk_usage(checked_folder).free / 1e9
    return DoctorFinding(name, "ok", f"{checked_folder}: {free_gb:.1f} GB free")


def _serial_ports() -> DoctorFinding:
    """Find cars on USB and check that this user may open their ports."""
    from foldcar.link.stream import usb_ports

    ports = usb_ports()
    if not ports:
        return DoctorFinding(
            "car on USB", "absent", "no USB serial port", "plug a car in, or let `foldcar link` pose as one"
        )
    shown = ", ".join(f"{port.path} ({port.description})" for port in ports)
    closed = [port.path for port in ports if not os.access(port.path, os.R_OK | os.W_OK)]
    if closed:
        shown += f": no permission for {', '.join(closed)}"
        return DoctorFinding("car on USB", "absent", shown, "sudo usermod -aG dialout $USER, then log in again")
    return DoctorFinding("car on USB", "ok", shown)
