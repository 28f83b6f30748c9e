"""`foldcar flash`: loads firmware and design onto a car with PlatformIO."""

import json
import os
import signal
import subprocess
from pathlib import Path
from typing import Annotated

import typer

from foldcar.commands.options import (
    Components,
    ExperimentId,
    Listing,
    Settings,
    check_distinct,
    design_settings,
    output_file,
    print_note,
)
from foldcar.errors import FoldcarError
from foldcar.installation import pio_program, source_tree
from foldcar.system import end_group

CAR_FILE = "car.json"


def flash(
    listing: Listing,
    experiment: ExperimentId,
    settings: Settings = None,
    port: Annotated[str | None, typer.Option(metavar="PORT", help="Serial port; default: detected.")] = None,
    design_only: Annotated[bool, typer.Option("--design-only", help="Load the design only, not the firmware.")] = False,
    file: Annotated[
        Path | None,
        typer.Option(metavar="FILE", callback=output_file, help="Write the design's car.json to FILE; load nothing."),
    ] = None,
    components: Components = None,
) -> None:
    """Load firmware and design onto the board on USB.

    The design is loaded as car.json, which the firmware reads when it starts. Logs and parameters in the car stay.

    \b
    Example: foldcar flash scenarios/width_study.json --experiment 1 --set width=95
    """
    # Check before the slow imports: without firmware or a board there is nothing to do.
    if file is None:
        _project()
    board = _board(port) if file is None else ""
    from foldcar.car.body import car_json
    from foldcar.outputs import atomic_file
    from foldcar.study.experiments import read_study

    (listed_experiment,) = read_study(listing, experiment).experiments
    chosen = design_settings(settings)
    content = car_json(listed_experiment.family.narrowed(chosen).single())
    for text in listed_experiment.family.outside(chosen):
        print_note(text)
    car_text = json.dumps(content, indent=2) + "\n"
    if file is not None:
        check_distinct([listing], [file])
        with atomic_file(file) as binary:
            binary.write(car_text.encode())
        typer.echo(f"{file}: {content['name']} ({content['hash']})")
        return
    project = _project()
    folder = project / ".pio" / "design"
    folder.mkdir(parents=True, exist_ok=True)
    with atomic_file(folder / CAR_FILE) as binary:
        binary.write(car_text.encode())
    if not design_only:
        _pio(project, "upload", board, folder)
    _pio(project, "uploadfs", board, folder)
    extent = " (design only)" if design_only else ""
    typer.echo(f"loaded {content['name']} ({content['hash']}){extent}")


def _board(port: str | None) -> str:
    """Return the board's serial port. Raises FoldcarError if there is no board, or ``port`` is not a board's."""
    from foldcar.link.stream import SERIAL_PATHS, choose_port

    if port is not None and not port.startswith((*SERIAL_PATHS, "COM")):
        raise FoldcarError(f"--port {port}: not the serial port of a board; `foldcar link` starts a simulated car")
    if port is not None and port.startswith("/dev/") and not Path(port).exists():
        raise FoldcarError(f"--port {port}: no such port; is the board plugged in?")
    return choose_port(port)


def _project() -> Path:
    """Return the checkout, which has the firmware's sources. Raises FoldcarError if there is no checkout."""
    project = source_tree()
    if project is None:
        raise FoldcarError("flash: the firmware's sources are missing; use a checkout of the project")
    return project


def _pio(project: Path, target: str, port: str, data_folder: Path) -> None:
    """Run PlatformIO's ``target`` for the board at ``port``. Raises FoldcarError if it fails."""
    program = pio_program()
    if program is None:
        raise FoldcarError("flash: PlatformIO's `pio` is missing; run `make setup`")
    command = [program, "run", "-d", str(project), "-e", "featheresp32", "-t", target, "--upload-port", port]
    # PlatformIO empties the build folder when a setting changes; the default one may contain a running sweep's carsim.
    folders = {"PLATFORMIO_DATA_DIR": str(data_folder), "PLATFORMIO_BUILD_DIR": str(project / ".pio" / "flash")}
    environment = {**os.environ, **folders}
    # PlatformIO starts other programs. In a session of its own they can all be ended together.
    process = subprocess.Popen(command, env=environment, start_new_session=True)
    try:
        code = process.wait()
    except KeyboardInterrupt:
        end_group(process, signal.SIGTERM)
        raise
    if code != 0:
        loaded = "the firmware" if target == "upload" else "the design"
        raise FoldcarError(f"flash: {loaded} was not loaded: see PlatformIO's message above")
