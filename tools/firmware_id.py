"""PlatformIO pre-script: writes firmware_id.h, which defines FOLDCAR_FIRMWARE_ID, 16 hexadecimal digits.

The id is a hash of firmware/ and the MAVLink dialect. It is the same on the board and in carsim, so that the host can
check whether a car runs the simulated firmware.
"""

import sys
from pathlib import Path

from SCons.Script import Import

Import("env")
env = globals()["env"]

root = Path(env.subst("$PROJECT_DIR"))
sys.path.insert(0, str(root / "tools"))
from simulation_digest import firmware_digest, write_header  # noqa: E402

folder = Path(env.subst("$PROJECT_WORKSPACE_DIR/firmware_id"))
write_header(folder / "firmware_id.h", "FOLDCAR_FIRMWARE_ID", firmware_digest(root))
env.Append(CPPPATH=[str(folder)])
