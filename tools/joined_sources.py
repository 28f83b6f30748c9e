"""PlatformIO pre-script: compiles the sources of each folder together, which takes half the time of one after the other.

The engines are compiled one by one, because each program has its own.
"""

import sys
from pathlib import Path
from typing import Any

from SCons.Script import Import

Import("env")
env = globals()["env"]

sys.path.insert(0, str(Path(env.subst("$PROJECT_DIR")) / "tools"))
from carsim_build import joined_source  # noqa: E402

seen: set[Path] = set()


def join(env: Any, node: Any) -> Any:
    """Return the object of the whole folder for its first source, and nothing for the others."""
    folder = Path(node.srcnode().get_abspath()).parent
    if folder in seen:
        return None
    seen.add(folder)
    return env.Object(str(Path(node.get_path()).parent / "joined.o"), str(joined_source(folder)))


for pattern in ("*firmware/lib/*", "*sim2d/lib/*", "*sim2d/src/*", "*/box2d/src/*", "*test/test_*"):
    env.AddBuildMiddleware(join, pattern)
# A test is named by its place in the project.
env.Append(CCFLAGS=[f"-fmacro-prefix-map={env.subst('$PROJECT_DIR')}/="])
