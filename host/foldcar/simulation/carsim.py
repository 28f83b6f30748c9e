"""The native simulator as a program: find it, ask its build and parameter table, run chunks of runs.

Input: bodies, scenes and settings as JSON text (docs/carsim.md). Output: one answer a run, in order: a
result, or ``{"error": message}`` for a run that failed.
"""

import json
import math
import os
import subprocess
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

from foldcar.car.firmware_parameters import TableRow
from foldcar.errors import FoldcarError
from foldcar.simulation.results import METRICS, NATIVE_OUTCOMES

BINARY_VARIABLE = "FOLDCAR_CARSIM"
BUILT_BINARY = Path(".pio", "build", "carsim", "program")


class CarsimError(FoldcarError):
    """The simulator is missing, broke down, or refused what it was given."""


@dataclass(frozen=True, slots=True)
class RunRequest:
    """One run: keys of the chunk's bodies and scenes, the settings as a JSON object, a name for errors.

    ``sample`` is the sample of the environment that the scene is.
    """

    body: str
    scene: str
    settings: str
    label: str
    sample: int


class Runner(Protocol):
    """What runs chunks: carsim's batch, or Scenic beside carsim. Called from several threads at once."""

    def run(
        self, bodies: Mapping[str, str], scenes: Mapping[str, str], requests: Sequence[RunRequest]
    ) -> list[dict[str, Any]]:
        """Answers to ``requests`` in order; ``{"error": message}`` for a run that failed. FoldcarError."""

    def stop(self) -> None:
        """End what runs at the moment; its `run` raises FoldcarError."""


def find_carsim() -> Path:
    """The simulator named by FOLDCAR_CARSIM, else the one built in the project this package belongs to."""
    named = os.environ.get(BINARY_VARIABLE)
    if named:
        if not os.access(named, os.X_OK) or not Path(named).is_file():
            raise CarsimError(f"{BINARY_VARIABLE}: {named} is no program")
        return Path(named)
    project = Path(__file__).resolve().parents[3]
    binary = project / BUILT_BINARY
    if not binary.is_file():
        raise CarsimError(f"no carsim built at {binary}: run `make setup`")
    return binary


class Carsim:
    """A simulator program. Its methods may be called from several threads at once."""

    def __init__(self, binary: Path | None = None) -> None:
        self.binary = binary if binary is not None else find_carsim()
        self._running: set[subprocess.Popen[str]] = set()
        self.build, self.firmware = self._ask_builds()

    def stop(self) -> None:
        """End every chunk that runs at the moment; its `run` raises CarsimError."""
        for process in list(self._running):
            process.kill()

    def parameter_table(self) -> dict[str, TableRow]:
        """The firmware's parameters by name."""
        try:
            rows = [
                TableRow(row["name"], row["unit"], row["minimum"], row["maximum"], row["default"])
                for row in json.loads(self._output("params"))
            ]
        except (ValueError, TypeError, KeyError) as error:
            raise CarsimError(f"{self.binary}: `carsim params` printed no parameter table") from error
        return {row.name: row for row in rows}

    def run(
        self, bodies: Mapping[str, str], scenes: Mapping[str, str], requests: Sequence[RunRequest]
    ) -> list[dict[str, Any]]:
        """Answers to ``requests`` in order. ``bodies`` and ``scenes`` map ids to JSON objects as text."""
        lines = [f'{{"body": {_with_id(name, text)}}}' for name, text in bodies.items()]
        lines += [f'{{"scene": {_with_id(name, text)}}}' for name, text in scenes.items()]
        for index, request in enumerate(requests):
            head = f'"body": {json.dumps(request.body)}, "scene": {json.dumps(request.scene)}'
            lines.append(f'{{"run": {_with_id(str(index), f"{{{head}, {request.settings[1:]}")}}}')
        answer = self._start(["batch", "--jobs", "1"], "\n".join(lines) + "\n")
        results = [self._read_line(line, requests) for line in answer.stdout.splitlines()]
        expected = 2 if any("error" in result for result in results) else 0
        if answer.returncode != expected or len(results) != len(requests):
            raise CarsimError(
                f"{self.binary}: {_ending(answer)} after {len(results)} of {len(requests)} runs"
            )
        return results

    def answers(self, lines: Sequence[str]) -> list[dict[str, Any]]:
        """The answers of ``carsim batch`` to lines of its input; CarsimError if one of them is an error."""
        answer = self._start(["batch", "--jobs", "1"], "\n".join(lines) + "\n")
        try:
            found: list[dict[str, Any]] = [json.loads(line) for line in answer.stdout.splitlines()]
        except ValueError as error:
            raise CarsimError(f"{self.binary}: answered what is no JSON") from error
        for one in found:
            if "error" in one:
                raise CarsimError(f"{self.binary}: {one['error']['message']}")
        if answer.returncode != 0:
            raise CarsimError(f"{self.binary}: {_ending(answer)}")
        return found

    def _read_line(self, line: str, requests: Sequence[RunRequest]) -> dict[str, Any]:
        try:
            answer = json.loads(line)
            if "error" in answer:
                error = answer["error"]
                if error["kind"] == "simulation":
                    return {"error": str(error["message"])}
                what = (
                    requests[int(error["run"])].label if error["run"] is not None else f"line {error['line']}"
                )
                raise CarsimError(f"{self.binary} refuses {what}: {error['message']}")
            sound = answer["outcome"] in NATIVE_OUTCOMES and all(
                math.isfinite(answer[metric.name])
                for metric in METRICS
                if answer[metric.name] is not None or not metric.optional
            )
        except (ValueError, TypeError, KeyError, IndexError) as error:
            raise CarsimError(f"{self.binary}: answered what is no result: {line[:80]}") from error
        if not sound:
            raise CarsimError(f"{self.binary}: answered an impossible result: {line[:200]}")
        result: dict[str, Any] = answer
        return result

    def _ask_builds(self) -> tuple[str, str]:
        """The id of all that results depend on, and that of the firmware in it, which a car has too."""
        try:
            told = json.loads(self._output("--version"))
            build, firmware = told["build"], told["firmware"]
        except (ValueError, TypeError, KeyError) as error:
            raise CarsimError(
                f"{self.binary}: is no carsim (`--version` does not print its build)"
            ) from error
        return str(build), str(firmware)

    def _output(self, argument: str) -> str:
        answer = self._start([argument], "")
        if answer.returncode != 0:
            raise CarsimError(f"{self.binary} {argument}: {_ending(answer)}")
        return answer.stdout

    def _start(self, arguments: Sequence[str], text: str) -> subprocess.CompletedProcess[str]:
        command = [str(self.binary), *arguments]
        try:
            # A session of its own keeps Ctrl-C from the simulator: the caller decides what is to end.
            process = subprocess.Popen(
                command,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                encoding="utf-8",
                errors="replace",
                start_new_session=True,
            )
        except OSError as error:
            raise CarsimError(f"{self.binary}: cannot be started: {error.strerror}") from error
        self._running.add(process)
        try:
            output, messages = process.communicate(text)
        finally:
            self._running.discard(process)
        return subprocess.CompletedProcess(command, process.returncode, output, messages)


def _with_id(name: str, object_text: str) -> str:
    return f'{{"id": {json.dumps(name)}, {object_text[1:]}'


def _ending(answer: subprocess.CompletedProcess[str]) -> str:
    last = (answer.stderr.strip().splitlines() or [""])[-1][:200]
    how = (
        f"killed by signal {-answer.returncode}"
        if answer.returncode < 0
        else f"exit code {answer.returncode}"
    )
    return f"{how} ({last})" if last else how
