"""The parts of a PlatformIO core folder that native builds need: SCons, platform `native`, state file."""

import json
import re
import shutil
import time
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path
from typing import Any

import platformio
from platformio.dependencies import get_core_dependencies
from seed_files import SeedError, whole_folder, write_if_changed

NATIVE_VERSION = "1.2.1"

PLATFORM_PY = '''"""The platform `native`, seeded: programs for this machine, built with its own compiler."""

from platformio import http
from platformio.exception import UserSideException
from platformio.public import PlatformBase


def refuse_network(raise_exception=False):
    if raise_exception:
        raise UserSideException(
            "PlatformIO asks for something its registry has. This project was set up without the registry "
            "(platformio.local.ini); tools/seed_platformio.py --undo turns to it again."
        )
    return False


# Otherwise a request that cannot be answered is repeated for a minute.
http.ensure_internet_on = refuse_network


class NativePlatform(PlatformBase):
    pass
'''

BUILDER_PY = '''"""Builds a program with the system's GCC."""

from SCons.Script import AlwaysBuild, Default, DefaultEnvironment

env = DefaultEnvironment()
env.Replace(CC="gcc", CXX="g++", LINK="$CXX", AR="ar", RANLIB="ranlib")

program = env.BuildProgram()
AlwaysBuild(env.Alias("exec", program, env.VerboseAction("$PROG_PATH $PROGRAM_ARGS", "Running $PROG_PATH")))
Default([program])
'''

SCONS_PY = """import SCons.Script

SCons.Script.main()
"""


def seed_core(core_dir: Path) -> None:
    """Fill ``core_dir`` with the missing parts. Raises SeedError."""
    _seed_scons(scons_package_folder(core_dir))
    _seed_native(core_dir / "platforms" / "native")
    _seed_state(core_dir / "appstate.json")


def scons_package_folder(core_dir: Path) -> Path:
    """The folder of PlatformIO's SCons package."""
    return core_dir / "packages" / "tool-scons"


def scons_version(requirement: str) -> tuple[str, str]:
    """SCons' version and PlatformIO's number for it, from PlatformIO's requirement: ~4.41101.0 is 4.11.1. SeedError."""
    match = re.fullmatch(r"[~^]?((\d+)\.(\d+)(\d\d)(\d\d)\.\d+)", requirement)
    if not match:
        raise SeedError(f"PlatformIO {platformio.__version__} asks for an unknown SCons, {requirement}")
    named, _, major, minor, patch = match.groups()
    return f"{int(major)}.{int(minor)}.{int(patch)}", named


def _seed_scons(folder: Path) -> None:
    version, named = scons_version(get_core_dependencies()["tool-scons"])
    metadata = _metadata("tool", "tool-scons", named)
    if _has(folder, metadata):
        return
    # Copied, because the Python that builds a wheel from an archive of the sources is there for that time only.
    try:
        installed = distribution("scons")
    except PackageNotFoundError:
        installed = None
    if installed is None or installed.version != version:
        raise SeedError(f"PlatformIO {platformio.__version__} builds with SCons {version}: install that with pip")
    with whole_folder(folder) as part:
        for file in installed.files or []:
            if file.parts[0] == "SCons" and file.suffix != ".pyc":
                (part / file).parent.mkdir(parents=True, exist_ok=True)
                shutil.copyfile(file.locate(), part / file)
        _write_json(part / "package.json", {"name": "tool-scons", "version": named, "description": "SCons"})
        write_if_changed(part / "scons.py", SCONS_PY)
        _write_json(part / ".piopm", metadata)


def _seed_native(folder: Path) -> None:
    manifest = {"name": "native", "title": "Native", "version": NATIVE_VERSION, "packages": {}}
    _write_json(folder / "platform.json", manifest)
    write_if_changed(folder / "platform.py", PLATFORM_PY)
    write_if_changed(folder / "builder" / "main.py", BUILDER_PY)
    _write_json(folder / ".piopm", _metadata("platform", "native", NATIVE_VERSION))


def _seed_state(file: Path) -> None:
    """Disable PlatformIO's check for new versions of itself."""
    try:
        state = json.loads(file.read_text(encoding="utf-8"))
    except (FileNotFoundError, ValueError):
        state = {}
    settings = {**state.get("settings", {}), "enable_telemetry": False, "check_prune_system_threshold": 0}
    settings["check_platformio_interval"] = 36500  # days
    wanted: dict[str, Any] = {"last_version": platformio.__version__, "settings": settings}
    if any(state.get(key) != value for key, value in wanted.items()) or "last_check" not in state:
        now_s = int(time.time())
        wanted["last_check"] = {"platformio_upgrade": now_s, "prune_system": now_s}
        _write_json(file, {**state, **wanted})


def _metadata(kind: str, name: str, version: str) -> dict[str, Any]:
    spec = {"owner": "platformio", "id": None, "name": name, "requirements": None, "uri": None}
    return {"type": kind, "name": name, "version": version, "spec": spec}


def _has(folder: Path, metadata: dict[str, Any]) -> bool:
    try:
        output: object = json.loads((folder / ".piopm").read_text(encoding="utf-8"))
    except (FileNotFoundError, ValueError):
        return False
    return output == metadata


def _write_json(file: Path, content: dict[str, Any]) -> None:
    write_if_changed(file, json.dumps(content, indent=2) + "\n")
