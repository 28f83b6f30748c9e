"""PlatformIO pre-script: generates the MAVLink headers in .pio/mavlink and adds it to the include path.

They are generated again only if the dialect, pymavlink or the generator changes. If PlatformIO's Python lacks the
required version of pymavlink, pip installs it there.
"""

import subprocess
import sys
from importlib.metadata import PackageNotFoundError, version
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

from SCons.Script import Import

Import("env")
env = globals()["env"]

# By itself: this Python has none of what the package imports.
spec = spec_from_file_location("dialect", Path(env.subst("$PROJECT_DIR")) / "host" / "foldcar" / "link" / "dialect.py")
assert spec is not None and spec.loader is not None
dialect = module_from_spec(spec)
spec.loader.exec_module(dialect)


def has_pymavlink() -> bool:
    """Whether this Python has the required version of pymavlink."""
    try:
        return bool(version("pymavlink") == dialect.PYMAVLINK)
    except PackageNotFoundError:
        return False


if not has_pymavlink():
    pip = [env.subst("$PYTHONEXE"), "-m", "pip", "install", "--quiet", f"pymavlink=={dialect.PYMAVLINK}"]
    if subprocess.run(pip, check=False).returncode != 0:
        sys.exit(f"mavlink_headers: pymavlink {dialect.PYMAVLINK} is missing and cannot be installed")

folder = Path(env.subst("$PROJECT_WORKSPACE_DIR/mavlink"))
try:
    dialect.write_headers(folder)
except (dialect.DialectError, OSError) as error:
    sys.exit(f"mavlink_headers: {error}")
# Not as system headers, which some boards' compilers treat as C.
env.Append(CPPPATH=[str(folder)])
