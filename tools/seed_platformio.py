"""Lets the project's PlatformIO commands work where PlatformIO's registry cannot be reached.

Usage: seed_platformio.py [--if-unreachable | --undo]

Fills PlatformIO's core folder ($PLATFORMIO_CORE_DIR, else .pio-core in the project) with what the
environments `native` and `carsim` need, taken from PyPI and from the system's own package archive, and writes
platformio.local.ini, which platformio.ini reads where it exists. What is there already is left alone, so a
second call is quick. With --if-unreachable nothing is done where the registry answers or PlatformIO is set up
already. --undo removes platformio.local.ini, after which PlatformIO turns to its registry again.

ArduinoJson, which reads car.json on the board, is in neither archive. Where the variable SEED_LIBRARIES names a
folder that has it, in platformio.ini's version, it is taken from there; else its tests are ignored and say so.

Run it with the Python that has PlatformIO installed.
"""

import argparse
import configparser
import json
import os
import queue
import shutil
import sys
import threading
import time
from pathlib import Path

try:
    import platformio
    import requests
except ImportError:
    print("seed_platformio: error: this Python has no PlatformIO; use .venv/bin/python", file=sys.stderr)
    sys.exit(2)
from box2d_source import has_box2d, seed_box2d
from platformio_core import scons_package_folder, seed_core
from seed_files import SeedError, whole_folder, write_if_changed
from unity_source import seed_unity

ROOT = Path(__file__).resolve().parent.parent
LOCAL_INI = "platformio.local.ini"
MARK = "; Written by tools/seed_platformio.py; its --undo removes this file."
PROBE_TIMEOUT_S = 3.0


def local_ini_text(core_dir: str) -> str:
    """What platformio.ini is overridden with: the system's JSON library, the seeded Box2D, Unity and ArduinoJson."""
    return f"""{MARK}
[platformio]
core_dir = {core_dir}

[simulation]
lib_deps =

[env:native]
lib_deps =

[host]
test_framework = custom
"""


def seed(root: Path) -> None:
    """Fills the core folder, and only when that is whole writes the local file. Raises SeedError."""
    local_ini = root / LOCAL_INI
    if local_ini.is_file() and not _is_ours(local_ini):
        raise SeedError(f"{local_ini}: exists and was not written by this script; move it away first")
    core_dir = core_folder(root)
    seed_core(core_dir)
    seed_box2d(core_dir / "lib" / "box2d")
    seed_unity(core_dir / "lib" / "Unity")
    if libraries := os.environ.get("SEED_LIBRARIES"):
        seed_arduino_json(core_dir / "lib" / "ArduinoJson", Path(libraries))
    own = core_dir == root / ".pio-core"
    write_if_changed(local_ini, local_ini_text("${PROJECT_DIR}/.pio-core" if own else str(core_dir)))


def seed_arduino_json(folder: Path, libraries: Path) -> None:
    """Copies ArduinoJson from ``libraries`` unless ``folder`` has that version. Raises SeedError."""
    settings = configparser.ConfigParser(interpolation=None)
    settings.read(ROOT / "platformio.ini", encoding="utf-8")
    wanted = settings["reading"]["arduino_json"].partition("@")[2]
    source = libraries / folder.name
    version = _library_version(source)
    if version != wanted:
        reason = f"has version {version}" if version else "has no library.json with a version"
        raise SeedError(f"SEED_LIBRARIES: {source} {reason}, platformio.ini asks for {wanted}")
    if _library_version(folder) != wanted:
        with whole_folder(folder) as part:
            shutil.copytree(source, part, dirs_exist_ok=True)


def _library_version(folder: Path) -> str | None:
    try:
        version: str | None = json.loads((folder / "library.json").read_text(encoding="utf-8")).get("version")
    except (OSError, ValueError, AttributeError):
        return None
    return version


def undo(root: Path) -> bool:
    """Removes the local file, if this script wrote it; says whether it did."""
    local_ini = root / LOCAL_INI
    if not _is_ours(local_ini):
        return False
    local_ini.unlink()
    return True


def core_folder(root: Path) -> Path:
    """The core folder that is seeded."""
    return Path(os.environ.get("PLATFORMIO_CORE_DIR") or root / ".pio-core").absolute()


def is_registry_reachable() -> bool:
    """Asks PlatformIO's registry, all its hosts at once, for a package that every installation needs."""
    replies: queue.SimpleQueue[bool] = queue.SimpleQueue()

    def ask(host: str) -> None:
        url = f"https://api.{host}/v3/packages/platformio/tool/tool-scons"
        try:
            reply = requests.get(url, timeout=PROBE_TIMEOUT_S)
            replies.put(reply.ok and reply.json().get("name") == "tool-scons")
        except (requests.RequestException, ValueError):
            replies.put(False)

    # Daemon threads, because a name server that does not answer holds a look-up longer than any time-out.
    hosts = platformio.__registry_mirror_hosts__
    for host in hosts:
        threading.Thread(target=ask, args=(host,), daemon=True).start()
    deadline_s = time.monotonic() + PROBE_TIMEOUT_S
    try:
        return any(replies.get(timeout=max(0.0, deadline_s - time.monotonic())) for _ in hosts)
    except queue.Empty:
        return False


def is_set_up_online() -> bool:
    """Whether PlatformIO has fetched what the native environments need into its ordinary core folder."""
    core_dir = Path(os.environ.get("PLATFORMIO_CORE_DIR") or Path.home() / ".platformio")
    return scons_package_folder(core_dir).is_dir() and (core_dir / "platforms" / "native").is_dir()


def _is_ours(local_ini: Path) -> bool:
    return local_ini.is_file() and local_ini.read_text(encoding="utf-8").startswith(MARK)


def main() -> int:
    """Run the command line; returns the exit code."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    choice = parser.add_mutually_exclusive_group()
    choice.add_argument("--if-unreachable", action="store_true", help="only where the registry is silent")
    choice.add_argument("--undo", action="store_true", help=f"remove {LOCAL_INI}")
    arguments = parser.parse_args()
    if arguments.undo:
        print(f"{LOCAL_INI} removed" if undo(ROOT) else f"no {LOCAL_INI} of this script to remove")
        return 0
    was_there = _is_ours(ROOT / LOCAL_INI)
    # The core folder may be one that was seeded for another copy of the project.
    was_seeded = was_there or has_box2d(core_folder(ROOT) / "lib" / "box2d")
    if arguments.if_unreachable and not was_seeded and (is_set_up_online() or is_registry_reachable()):
        return 0
    try:
        seed(ROOT)
    except (SeedError, OSError) as error:
        print(f"seed_platformio: error: {error}", file=sys.stderr)
        return 2
    if not was_there:
        print(f"PlatformIO's registry is left out: seeded {core_folder(ROOT)}, wrote {LOCAL_INI}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
