"""`python -m foldcar.crosscheck.mujoco_worker`: foldcar.simulation.scenic_worker with MuJoCo instead of carsim.

Input and output: as there; "engine" has the fields of EngineOptions.
"""

from contextlib import nullcontext
from pathlib import Path

from foldcar.crosscheck.mujoco_car import EngineOptions
from foldcar.crosscheck.mujoco_step import SteppedMujoco
from foldcar.simulation.scenic_worker import serve


def main() -> None:
    """Serve standard input until its end."""
    serve(lambda opening: nullcontext(SteppedMujoco(Path(opening["binary"]), EngineOptions(**opening["engine"]))))


if __name__ == "__main__":
    main()
