"""What this package finds around itself: programs, the checkout, processors, Python, the packages of its extras."""

import os
import shutil
import sys
from pathlib import Path

PACKAGE = Path(__file__).resolve().parent


def packaged_program(name: str) -> Path | None:
    """The program of that name that the wheel has brought; None in a checkout."""
    program = PACKAGE / name
    return program if program.is_file() else None


def source_tree() -> Path | None:
    """The checkout, with firmware, simulator and PlatformIO's project file; None where the package is installed."""
    root = PACKAGE.parents[1]
    return root if (root / "platformio.ini").is_file() and PACKAGE.parent == root / "host" else None


def keep_caches_in_checkout() -> None:
    """Let libraries, from now on, keep their caches (fonts, messages) below the checkout, if this is one."""
    root = source_tree()
    if root is not None:
        os.environ.setdefault("XDG_CACHE_HOME", str(root / ".pio" / "cache"))
        os.environ.setdefault("MPLCONFIGDIR", str(root / ".pio" / "cache" / "matplotlib"))


def pio_program() -> str | None:
    """PlatformIO's command `pio` beside this Python, or else on the PATH."""
    beside = Path(sys.executable).with_name("pio")
    return str(beside) if beside.is_file() else shutil.which("pio")


def usable_processors() -> int:
    """On Linux those that the process was given; elsewhere all of the machine's."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def python_command(module: str, *arguments: str, flags: tuple[str, ...] = ()) -> list[str]:
    """The command of another Python, which calls ``main`` of a module of foldcar with ``arguments`` as sys.argv[1:].

    It imports what this process imports, wherever it is started: `python -m` looks in the working directory first,
    where a `json.py` may be.
    """
    path = [folder for folder in sys.path if folder]
    code = f"import sys; sys.path[:] = {path!r}; from {module} import main; main()"
    return [sys.executable, *flags, "-c", code, *arguments]


# By the names under which they are imported; pyproject.toml has the packages.
MODULES = {
    "calibrate": ("sklearn",),
    "cluster": ("cryptography", "dask", "distributed"),
    "fabricate": ("ezdxf", "fcl", "reportlab", "trimesh"),
    "camera": ("cv2", "reportlab"),
    "link": ("mcap", "pymavlink", "serial"),
    "mujoco": ("mujoco",),
    "optimize": ("optuna",),
    "parquet": ("pyarrow",),
}  # fmt: skip


def require(extra: str) -> None:
    """ModuleNotFoundError if a module of the extra is missing, before work is done for it."""
    from importlib.util import find_spec

    for module in MODULES[extra]:
        if find_spec(module) is None:
            raise ModuleNotFoundError(module, name=module)


def missing_extra(error: ModuleNotFoundError) -> str | None:
    """What to install, in a line; None if no extra of foldcar brings the module."""
    missing = (error.name or "").partition(".")[0]
    extra = next((name for name, modules in MODULES.items() if missing in modules), None)
    return extra and f"this needs the package {missing}, of an extra: pip install 'foldcar[{extra}]'"
