"""Starts `carsim link`: the firmware on simulated hardware that poses as a car (docs/carsim.md).

Input: a body, a scene, a car.json. Output: a running process and the port it listens at.
"""

import contextlib
import json
import subprocess
import tempfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from foldcar.simulation.runner import CarsimError

END_S = 5.0


@dataclass(frozen=True, slots=True)
class SimulatedCar:
    """``port`` is a pseudo-terminal's path, or tcp:HOST:PORT."""

    port: str
    process: "subprocess.Popen[str]"


@contextlib.contextmanager
def simulated_car(
    binary: Path,
    body: Mapping[str, Any],
    scene: Mapping[str, Any],
    design: Mapping[str, Any],
    speedup: float = 1.0,
    tcp_port: int | None = None,
    stdin: int | None = None,
) -> Iterator[SimulatedCar]:
    """A simulated car that ends with the block. ``stdin`` is where its faults on command come from.

    What it prints after the port is left to be read from the process.
    """
    with tempfile.TemporaryDirectory(prefix="foldcar-link-") as folder:
        command = [str(binary), "link", *(["--tcp", str(tcp_port)] if tcp_port is not None else ["--pty"])]
        contents = {
            "body": {"body": {"id": "car", **body}},
            "scene": {"scene": {"id": "scene", **scene}},
            "design": design,
        }
        for name, content in contents.items():
            file = Path(folder) / ("car.json" if name == "design" else f"{name}.json")
            file.write_text(json.dumps(content), encoding="utf-8")
            command += [f"--{name}", str(file)]
        # The next trial begins at the start again, as if someone had carried the car there.
        command += ["--speedup", f"{speedup:g}", "--put-back"]
        # It belongs to the caller's terminal, and ends with it whatever becomes of the caller.
        process = subprocess.Popen(command, stdin=stdin, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        try:
            yield SimulatedCar(_port(binary, process), process)
        finally:
            process.terminate()
            try:
                process.wait(END_S)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()


def _port(binary: Path, process: "subprocess.Popen[str]") -> str:
    assert process.stdout is not None and process.stderr is not None
    line = process.stdout.readline()
    try:
        return str(json.loads(line)["port"])
    except (ValueError, TypeError, KeyError):
        process.terminate()
        said = process.stderr.read().strip().splitlines()
        raise CarsimError(f"{binary} link: {said[-1] if said else 'printed no port'}") from None
