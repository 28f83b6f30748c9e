"""Finds the package's surroundings: programs, the checkout, processors, Python, and the packages of its extras."""

import os
import shutil
import sys
from collections.abc import Sequence
from pathlib import Path

PACKAGE = Path(__file__).resolve().parent


def packaged_program(name: str) -> Path | None:
    """Return the program of that name inside the installed wheel; None in a checkout."""
    program = PACKAGE / name
    return program if program.is_file() else None


def source_tree() -> Path | None:
    """Return the checkout, with firmware, simulator and platformio.ini; None if the package is installed."""
    root = PACKAGE.parents[1]
    return root if (root / "platformio.ini").is_file() and PACKAGE.parent == root / "host" else None


def keep_caches_in_checkout() -> None:
    """In a checkout, make libraries keep their caches (fonts, messages) inside it."""
    root = source_tree()
    if root is not None:
        os.environ.setdefault("XDG_CACHE_HOME", str(root / ".pio" / "cache"))
        os.environ.setdefault("MPLCONFIGDIR", str(root / ".pio" / "cache" / "matplotlib"))


def pio_program() -> str | None:
    """Return the path of PlatformIO's command `pio`, beside this Python or on the PATH; None if it is not installed."""
    own_pio = Path(sys.executable).with_name("pio")
    return str(own_pio) if own_pio.is_file() else shutil.which("pio")


def usable_processors() -> int:
    """Return the number of processors: on Linux, those that the process may use; elsewhere, all."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def python_command(module: str, *arguments: str, flags: tuple[str, ...] = ()) -> list[str]:
    """Return the command that calls ``main`` of a foldcar module in a new Python, with ``arguments`` as sys.argv[1:].

    The new process uses this one's sys.path. `python -m` would look in the working directory first, which may contain a
    `json.py`.
    """
    # An empty folder is the working directory.
    path = [folder for folder in sys.path if folder]
    code = f"import sys; sys.path[:] = {path!r}; from {module} import main; main()"
    return [sys.executable, *flags, "-c", code, *arguments]


# The modules of each extra, by the names under which they are imported; pyproject.toml has the packages.
MODULES = {
    "cluster": ("cryptography", "dask", "distributed"),
    "fabricate": ("ezdxf", "fcl", "reportlab", "trimesh"),
    "link": ("pymavlink", "serial"),
    "mujoco": ("mujoco",),
    "optimize": ("optuna",),
    "parquet": ("pyarrow",),
}  # fmt: skip


def require(extra: str) -> None:
    """Raise ModuleNotFoundError if a module of the extra is missing. Commands call it before they do any work."""
    from importlib.util import find_spec

    for module in MODULES[extra]:
        if find_spec(module) is None:
            raise ModuleNotFoundError(module, name=module)


def missing_extra(error: ModuleNotFoundError) -> str | None:
    """Return a line that says what to install; None if no extra of foldcar contains the module."""
    missing = (error.name or "").partition(".")[0]
    extra = next((name for name, modules in MODULES.items() if missing in modules), None)
    return extra and f"this needs the package {missing}; install it: {extras_command([extra])}"


def extras_command(extras: Sequence[str]) -> str:
    """Return the command that installs these extras."""
    return f"pip install 'foldcar[{','.join(extras)}]'" if source_tree() is None else "make extras"
