"""PlatformIO pre-script: finds MuJoCo's headers and library in the Python package `mujoco`, and links with it.

If PlatformIO's Python lacks the package, pip installs it there. The program looks for the library in ../mujoco from
its own folder: in a build folder that is a link to the package, beside an installed foldcar the package itself.
"""

import importlib.util
import subprocess
import sys
from pathlib import Path

from SCons.Script import Import

Import("env")
env = globals()["env"]

# The version that results were compared with.
MUJOCO = "4.0.0"


def package_folder() -> Path | None:
    """Where the package is, or None; it is not imported, which would load it."""
    spec = importlib.util.find_spec("mujoco")
    return Path(spec.origin).parent if spec is not None and spec.origin else None


folder = package_folder()
if folder is None:
    pip = [env.subst("$PYTHONEXE"), "-m", "pip", "install", "--quiet", f"mujoco=={MUJOCO}"]
    if subprocess.run(pip, check=False).returncode != 0:
        sys.exit(f"mujoco_library: the package mujoco {MUJOCO} is missing and cannot be installed")
    importlib.invalidate_caches()
    folder = package_folder()
libraries = sorted(folder.glob("libmujoco.so.*")) if folder is not None else []
if folder is None or not libraries:
    sys.exit("mujoco_library: the package mujoco has no library for this system")
link = Path(env.subst("$BUILD_DIR")).parent / "mujoco"
if not link.is_symlink() or link.resolve() != folder.resolve():
    link.parent.mkdir(parents=True, exist_ok=True)
    link.unlink(missing_ok=True)
    link.symlink_to(folder)
env.Append(
    CCFLAGS=["-isystem", str(folder / "include")],
    LIBPATH=[str(folder)],
    LIBS=[f":{libraries[-1].name}"],
    # Suites that do not call it need not load it. For SCons a dollar sign is written twice; the quotes are for the shell.
    LINKFLAGS=["-Wl,--as-needed", "'-Wl,-rpath,$$ORIGIN/../mujoco'"],
)
