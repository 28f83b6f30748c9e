"""PlatformIO pre-script: generates the MAVLink headers in .pio/mavlink and adds it to the include path.

They are generated again only if the dialect, pymavlink or the generator changes. If PlatformIO's Python lacks the
required version of pymavlink, pip installs it there.
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
    """Whether this Python has the required version of pymavlink."""
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
# Not as system headers, which some boards' compilers treat as C.
env.Append(CPPPATH=[str(folder)])
