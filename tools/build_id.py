"""PlatformIO pre-script: writes build_id.h, which defines FOLDCAR_BUILD_ID, 16 hexadecimal digits.

The id is a hash of everything that can change a simulation's results (see simulation_digest.py). The header is in
.pio/build_id/<environment>, on the include path; it is rewritten only when the id changes, so that only then the files
that include it are recompiled.

The id of carsim does not contain the compiler, because every build of it must compute the golden numbers
(golden_check.py). With FOLDCAR_GOLDEN=own the compiler is in the id instead, so that the runs of a program that computes
others stay apart.
"""

import os
import sys
from pathlib import Path

from SCons.Script import Import

Import("env")
env = globals()["env"]

root = Path(env.subst("$PROJECT_DIR"))
sys.path.insert(0, str(root / "tools"))
from simulation_digest import Box2dError, simulation_digest, write_header  # noqa: E402

# MuJoCo's library calls the C library's functions.
is_exact = env.subst("$PIOENV") == "carsim" and os.environ.get("FOLDCAR_GOLDEN") != "own"
# What PlatformIO fetches for the environment, and what it has for all projects, or tools/seed_platformio.py put there.
library_folders = [Path(env.subst(folder)) for folder in ("$PROJECT_LIBDEPS_DIR/$PIOENV", "$PROJECT_CORE_DIR/lib")]
try:
    digest = simulation_digest(
        root,
        flags=env.GetProjectOption("build_flags"),
        compiler=None if is_exact else env.subst("$CXX") or "g++",
        libraries=library_folders,
    )
except Box2dError as error:
    sys.exit(f"build_id: {error}")

folder = Path(env.subst("$PROJECT_WORKSPACE_DIR/build_id/$PIOENV"))
write_header(folder / "build_id.h", "FOLDCAR_BUILD_ID", digest)
env.Append(CPPPATH=[str(folder)])
