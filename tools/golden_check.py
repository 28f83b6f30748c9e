"""PlatformIO post-script: removes a carsim that does not compute the golden numbers of test/determinism; the build fails.

FOLDCAR_GOLDEN=renew leaves it, for `make golden` after a change of the physics, and FOLDCAR_GOLDEN=own for a compiler
whose runs are to stay apart (build_id.py).
"""

import os
import sys
from pathlib import Path
from typing import Any

from SCons.Script import Import

Import("env")
env = globals()["env"]

sys.path.insert(0, str(Path(env.subst("$PROJECT_DIR")) / "tools"))
from determinism import answers, difference, golden_answers  # noqa: E402


def check_golden_numbers(target: Any, source: Any, env: Any) -> int:
    """Remove a program that computes other numbers, and fail."""
    program = Path(str(target[0]))
    lines = difference(golden_answers(), answers([str(program)]))
    if lines:
        program.unlink()
        print(f"golden_check: this program does not compute the golden numbers of test/determinism:\n{lines}\n"
              "After a change of the physics, run `make golden`. With an unusual compiler, set FOLDCAR_GOLDEN=own.",
              file=sys.stderr)  # fmt: skip
    return 1 if lines else 0


# In a script that runs before the program's node has its builder, SCons would drop the action where the file exists.
if env.subst("$PIOENV") == "carsim" and os.environ.get("FOLDCAR_GOLDEN") not in ("own", "renew"):
    env.AddPostAction(env["PIOMAINPROG"], check_golden_numbers)
