"""PlatformIO pre-script: makes the MAVLink headers in .pio/mavlink, which is put on the include path.

They are made again only when the dialect, pymavlink or the generator changes. Where PlatformIO's Python has no
pymavlink of the right version, pip installs it there.
"""

import subprocess
import sys
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from SCons.Script import Import

Import("env")
env = globals()["env"]

sys.path.insert(0, str(Path(env.subst("$PROJECT_DIR")) / "host" / "foldcar" / "mavlink_dialect"))
from generation import PYMAVLINK, DialectError, write_headers  # noqa: E402


def has_pymavlink() -> bool:
    """Whether this Python has the version that the dialect is cut from."""
    try:
        return bool(version("pymavlink") == PYMAVLINK)
    except PackageNotFoundError:
        return False


if not has_pymavlink():
    pip = [env.subst("$PYTHONEXE"), "-m", "pip", "install", "--quiet", f"pymavlink=={PYMAVLINK}"]
    if subprocess.run(pip, check=False).returncode != 0:
        sys.exit(f"mavlink_headers: pymavlink {PYMAVLINK} is missing and cannot be installed")

folder = Path(env.subst("$PROJECT_WORKSPACE_DIR/mavlink"))
try:
    write_headers(folder)
except (DialectError, OSError) as error:
    sys.exit(f"mavlink_headers: {error}")
# Not as system headers, which some compilers for boards take for C.
env.Append(CPPPATH=[str(folder)])
