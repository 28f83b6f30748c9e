"""Starts `carsim link`: the firmware on simulated hardware, with a car's link (docs/carsim.md).

Input: a body, scenes with their realities, a car.json. Output: a running process and the port on which it listens.
"""

import contextlib
import json
import shutil
import subprocess
import tempfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from foldcar.simulation.runner import CarsimError

# How long the process may take to end before it is killed.
END_S = 5.0


@dataclass(frozen=True, slots=True)
class SimulatedCar:
    """A running `carsim link`; ``port`` is a pseudo-terminal's path, or tcp:HOST:PORT."""

    port: str
    process: "subprocess.Popen[str]"


@contextlib.contextmanager
def simulated_car(
    simulator: Sequence[str],
    body: Mapping[str, Any],
    worlds: Iterable[tuple[Mapping[str, Any], Mapping[str, Any]]],
    design: Mapping[str, Any],
    speedup: float = 1.0,
    tcp_port: int | None = None,
    stdin: int | None = None,
) -> Iterator[SimulatedCar]:
    """Run `carsim link`, a simulated car with a port, until the end of the block. Raises CarsimError.

    ``simulator`` is the command that starts carsim, ``design`` the content of car.json. ``worlds`` are pairs of a scene
    with its id and the reality there (docs/carsim.md). The car begins in the first scene; a host can move it to the
    others. ``tcp_port`` None stands for a pseudo-terminal. ``stdin`` is a file descriptor with commands that inject
    faults. The process prints the port in its first line, then answers to commands.
    """
    with tempfile.TemporaryDirectory(prefix="foldcar-link-", ignore_cleanup_errors=True) as folder:
        port_options = ["--pty"] if tcp_port is None else ["--tcp", str(tcp_port)]
        command = [*simulator, "link", *port_options]
        scenes_and_realities = list(worlds)
        # By the option of carsim that names the file: the objects in the file, one a line.
        contents: dict[str, list[Mapping[str, Any]]] = {
            "body": [{"body": {"id": "car", **body}}],
            "scene": [{"scene": scene} for scene, _ in scenes_and_realities],
            "reality": [reality for _, reality in scenes_and_realities],
            "design": [design],
        }
        for name, lines in contents.items():
            file = Path(folder) / ("car.json" if name == "design" else f"{name}.jsonl")
            file.write_text("".join(f"{json.dumps(line)}\n" for line in lines), encoding="utf-8")
            command += [f"--{name}", str(file)]
        # --put-back: the car returns to the start before each trial.
        command += ["--speedup", f"{speedup:g}", "--put-back"]
        # carsim ends when nobody reads its output any more, even if the caller is killed.
        process = subprocess.Popen(command, stdin=stdin, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        try:
            port = _port(simulator[0], process)
            # carsim has read the files; a caller that is killed later leaves no folder behind.
            shutil.rmtree(folder)
            yield SimulatedCar(port, process)
        finally:
            process.terminate()
            try:
                process.wait(END_S)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()


def _port(binary: str, process: "subprocess.Popen[str]") -> str:
    """Read and return the port that carsim prints first. Raises CarsimError if it prints something else."""
    assert process.stdout is not None and process.stderr is not None
    line = process.stdout.readline()
    try:
        return str(json.loads(line)["port"])
    except (ValueError, TypeError, KeyError):
        process.terminate()
        messages = process.stderr.read().strip().splitlines()
        reason = messages[-1] if messages else "printed no port"
        raise CarsimError(f"{binary} link: {reason}") from None
