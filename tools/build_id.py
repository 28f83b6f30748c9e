"""PlatformIO pre-script: writes build_id.h, which defines FOLDCAR_BUILD_ID, 16 hexadecimal digits.

The id is a hash of everything that can change a simulation's results (see simulation_digest.py). The header is in
.pio/build_id/<environment>, on the include path; it is rewritten only when the id changes, so that only then the files
that include it are recompiled.

The id of carsim does not contain the compiler. Therefore a program that does not compute the golden numbers of
test/determinism is removed and the build fails. FOLDCAR_GOLDEN=renew leaves it, for `make golden` after a change of the
physics. FOLDCAR_GOLDEN=own puts the compiler into the id instead, so that such a program's runs stay apart.
"""

import os
import sys
from pathlib import Path
from typing import Any

from SCons.Script import Import

Import("env")
env = globals()["env"]

root = Path(env.subst("$PROJECT_DIR"))
sys.path.insert(0, str(root / "tools"))
from determinism import answers, difference, golden_answers  # noqa: E402
from simulation_digest import Box2dError, simulation_digest, write_header  # noqa: E402

golden = os.environ.get("FOLDCAR_GOLDEN", "")
# MuJoCo's library calls the C library's functions.
is_exact = env.subst("$PIOENV") == "carsim" and golden != "own"
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


def check_golden_numbers(target: Any, source: Any, env: Any) -> int:
    """Remove a program that computes other numbers, and fail."""
    program = Path(str(target[0]))
    lines = difference(golden_answers(), answers([str(program)]))
    if lines:
        program.unlink()
        print(f"build_id: this program does not compute the golden numbers of test/determinism:\n{lines}\n"
              "After a change of the physics, run `make golden`. With an unusual compiler, set FOLDCAR_GOLDEN=own.",
              file=sys.stderr)  # fmt: skip
    return 1 if lines else 0


if is_exact and golden != "renew":
    env.AddPostAction("$BUILD_DIR/${PROGNAME}${PROGSUFFIX}", check_golden_numbers)
