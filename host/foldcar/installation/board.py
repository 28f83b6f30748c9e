"""What loading firmware onto a car needs: PlatformIO, the board's toolchain, a serial port that may be opened."""

import os
import threading
import urllib.error
import urllib.request
from pathlib import Path

from foldcar.installation.finding import Finding
from foldcar.installation.platformio_project import PlatformioProject, pio_program
from foldcar.link.ports import usb_ports

BOARD_PLATFORM = "espressif32"
TOOLCHAIN = "toolchain-xtensa-esp32"
REACH_S = 3.0


def platformio(checkout: Path | None, project: PlatformioProject | None) -> Finding:
    """PlatformIO, which builds carsim and loads firmware."""
    program = pio_program()
    if program is None:
        return Finding("PlatformIO", "absent", "no `pio`: carsim cannot be built, nor a car flashed", "make setup")
    if checkout is None:
        return Finding("PlatformIO", "absent", "the firmware's sources are not here", "use a checkout of the project")
    if project is None:
        return Finding("PlatformIO", "absent", f"{program} cannot read {checkout / 'platformio.ini'}", "make setup")
    return Finding("PlatformIO", "ok", program)


def toolchain(project: PlatformioProject) -> Finding:
    """The board's compiler, which PlatformIO fetches; where it is not there, whether it could be."""
    parts = (Path("platforms") / BOARD_PLATFORM, Path("packages") / TOOLCHAIN)
    missing = [part for part in parts if not (project.core / part).is_dir()]
    if not missing:
        return Finding("toolchain", "ok", f"{TOOLCHAIN} in {project.core}")
    text = f"no {missing[0]} in {project.core}: only `foldcar flash` needs it"
    if any(_reaches(host) for host in _registry_hosts()):
        return Finding("toolchain", "absent", text, "the first `pio run` fetches it")
    advice = "PlatformIO's registry cannot be reached: flash from a machine that reaches it"
    return Finding("toolchain", "absent", text, advice)


def serial_ports() -> Finding:
    """Cars on USB, and whether this user may open them."""
    ports = usb_ports()
    if not ports:
        return Finding("car on USB", "absent", "no USB serial port", "plug a car in, or let `foldcar link` pose as one")
    closed = [port.path for port in ports if not os.access(port.path, os.R_OK | os.W_OK)]
    shown = ", ".join(f"{port.path} ({port.description})" for port in ports)
    if closed:
        return Finding(
            "car on USB", "absent", f"{shown}: no permission for {', '.join(closed)}",
            "sudo usermod -aG dialout $USER, then log in again",
        )  # fmt: skip
    if not any(port.is_feather for port in ports):
        return Finding("car on USB", "absent", f"{shown}: none is a Feather's bridge", "name the car's port with --port")
    return Finding("car on USB", "ok", shown)


def _registry_hosts() -> list[str]:
    """The first host of PlatformIO's registry, if PlatformIO is in this environment."""
    try:
        import platformio
    except ImportError:
        return []
    return [f"api.{host}" for host in platformio.__registry_mirror_hosts__[:1]]


def _reaches(host: str) -> bool:
    """Whether the host answers, also through a proxy, within REACH_S."""
    reached = threading.Event()

    def ask() -> None:
        try:
            urllib.request.urlopen(f"https://{host}/", timeout=REACH_S).close()
            reached.set()
        except urllib.error.HTTPError:
            reached.set()
        except OSError:
            pass

    # A name server that does not answer holds a look-up longer than any time-out.
    thread = threading.Thread(target=ask, daemon=True)
    thread.start()
    thread.join(REACH_S)
    return reached.is_set()
