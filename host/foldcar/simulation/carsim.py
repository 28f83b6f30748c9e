"""The native simulator as a program: find it, ask its build and parameter table, run chunks of runs.

Input: bodies, scenes and settings as JSON text (docs/carsim.md). Output: one answer a run, in order: a
result, or ``{"error": message}`` for a run that failed. A process that dies takes only its run with it.
"""

import json
import math
import subprocess
from bisect import bisect_right
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from foldcar.car.body import TableRow
from foldcar.simulation import results
from foldcar.simulation.engines import ENGINES, MULTIBODY, engine_title, find_carsim
from foldcar.simulation.runner import KEPT_INTERVAL_S, CarsimError, RunRequest, process_ending

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class TrialRules:
    """A trial's times (s), and when it ends.

    The car settles for ``settling_s`` before the trial begins, the physics takes steps of ``step_s``, the firmware
    ticks every ``firmware_tick_s``. A car has tipped when the upward part of its up axis is below ``tipped_up``, and is
    stuck when within ``stuck_time_s`` it has neither moved ``stuck_distance_m`` nor turned ``stuck_turn_rad``.
    """

    settling_s: float
    step_s: float
    firmware_tick_s: float
    tipped_up: float
    stuck_distance_m: float
    stuck_turn_rad: float
    stuck_time_s: float


@dataclass(frozen=True, slots=True)
class CarsimLimits:
    """``numbers`` are the least and the largest value by path, as in ``body.wheels.servo.neutral_us``."""

    numbers: Mapping[str, tuple[float, float]]
    trial: TrialRules


class Carsim:
    """A simulator program. Its methods may be called from several threads at once.

    ``engine`` is name and version of what moves the cars, "" in multibody; ``build`` contains it. ``command`` starts
    the program: its file, and words that choose the engine.
    """

    def __init__(self, binary: Path | None = None, engine: str = MULTIBODY) -> None:
        self.binary = binary if binary is not None else find_carsim(engine)
        self.command = (str(self.binary), *(ENGINES[engine].options if binary is None else ()))
        self._running: set[subprocess.Popen[str]] = set()
        self._stops = 0
        self._limits: CarsimLimits | None = None
        # The id of all that results depend on, and that of the firmware in it, which a car has too.
        self.build, self.firmware, self.engine = self._told(
            "--version",
            lambda told: (str(told["build"]), str(told["firmware"]), str(told["engine"])),
            "is no carsim (`--version` does not print its build)",
        )
        self.engine = "" if self.engine == MULTIBODY else self.engine
        if self.engine:
            self.build += f" {self.engine}"
        if binary is None and engine_title(self.engine) != ENGINES[engine].title:
            raise CarsimError(f"{self.binary}: its engine is {self.engine or 'multibody'}, not {engine}")

    def stop(self) -> None:
        """End every call that is under way; it raises CarsimError."""
        self._stops += 1
        for process in list(self._running):
            process.kill()

    def parameter_table(self) -> dict[str, TableRow]:
        """The firmware's parameters by name."""

        def read(told: Any) -> dict[str, TableRow]:
            keys = ("name", "unit", "minimum", "maximum", "default")
            return {row["name"]: TableRow(*(row[key] for key in keys)) for row in told}

        return self._told("params", read, "`carsim params` printed no parameter table")

    def limits(self) -> CarsimLimits:
        """The limits of what it takes, and the rules by which its trials run (`carsim limits`)."""

        def read(told: Any) -> CarsimLimits:
            numbers = {path: (float(low), float(high)) for path, (low, high) in told["input"].items()}
            return CarsimLimits(numbers, TrialRules(**told["trial"]))

        self._limits = self._limits or self._told("limits", read, "`carsim limits` printed no limits")
        return self._limits

    def run(
        self, bodies: Mapping[str, str], scenes: Mapping[str, str], requests: Sequence[RunRequest]
    ) -> list[dict[str, Any]]:
        """Answers to ``requests`` in order. ``bodies`` and ``scenes`` map ids to JSON objects as text.

        When a process is killed by a signal, the run that it was at is simulated again, alone in a new process; if
        that one is killed too, the run has failed. CarsimError if the simulator refuses its input or breaks down
        otherwise, and after `stop`.
        """
        answers: list[dict[str, Any]] = []
        stops = self._stops
        while len(answers) < len(requests):
            found, death = self._batch(bodies, scenes, requests[len(answers) :], stops)
            answers += found
            if death:
                one = requests[len(answers)]
                body, scene = {one.body: bodies[one.body]}, {one.scene: scenes[one.scene]}
                again, death = self._batch(body, scene, [one], stops)
                answers += again or [{"error": f"the simulation crashed ({death})"}]
        return answers

    def answers(self, lines: Sequence[str]) -> list[dict[str, Any]]:
        """The answers of ``carsim batch`` to lines of its input; CarsimError if one of them is an error."""
        answer = self._output(["batch"], lines, self._stops)
        try:
            answers: list[dict[str, Any]] = [json.loads(line) for line in answer.stdout.splitlines()]
        except ValueError as error:
            raise CarsimError(f"{self.binary}: answered what is no JSON") from error
        for one in answers:
            if "error" in one:
                raise CarsimError(f"{self.binary}: {one['error']['message']}")
        if answer.returncode != 0:
            raise CarsimError(f"{self.binary}: {process_ending(answer.returncode, answer.stderr)}")
        return answers

    def _batch(
        self, bodies: Mapping[str, str], scenes: Mapping[str, str], requests: Sequence[RunRequest], stops: int
    ) -> tuple[list[dict[str, Any]], str]:
        """The answers of one process, and how it was killed by a signal, if that came before the last answer.

        The next run is then the one that it was at. CarsimError as for `run`.
        """
        lines = [input_line("body", name, text) for name, text in bodies.items()]
        lines += [input_line("scene", name, text) for name, text in scenes.items()]
        lines += [run_line(str(index), request) for index, request in enumerate(requests)]
        answer = self._output(["batch"], lines, stops)
        killed = answer.returncode < 0
        # A line without its end was being written.
        whole = [line for line in answer.stdout.splitlines(keepends=True) if line.endswith("\n")]
        results = [self._read_answer(line, requests) for line in whole]
        if killed and len(results) < len(requests):
            return results, process_ending(answer.returncode, answer.stderr)
        expected = 2 if any("error" in result for result in results) else 0
        if len(results) != len(requests) or not (killed or answer.returncode == expected):
            ending = process_ending(answer.returncode, answer.stderr)
            raise CarsimError(f"{self.binary}: {ending} after {len(results)} of {len(requests)} runs")
        return results, ""

    def _read_answer(self, line: str, requests: Sequence[RunRequest]) -> dict[str, Any]:
        """The answer to one of ``requests``, whose index is its id; CarsimError if the simulator refuses its input."""
        try:
            answer = json.loads(line)
            if "error" in answer:
                error = answer["error"]
                if error["kind"] == "simulation":
                    return {"error": str(error["message"])}
                # Of one run alone, cars and scenes are its own.
                index = 0 if len(requests) == 1 else error["run"]
                what = requests[int(index)].label if index is not None else f"line {error['line']}"
                raise CarsimError(f"{self.binary} refuses {what}: {error['message']}")
            sound = answer["outcome"] in results.NATIVE_OUTCOMES and all(
                math.isfinite(answer[metric.name])
                for metric in results.METRICS
                if answer[metric.name] is not None or not metric.optional
            )
        except (ValueError, TypeError, KeyError, IndexError) as error:
            raise CarsimError(f"{self.binary}: answered what is no result: {line[:80]}") from error
        if not sound:
            raise CarsimError(f"{self.binary}: answered an impossible result: {line[:200]}")
        return {key: value for key, value in answer.items() if key != "run"}

    def _told(self, argument: str, read: Callable[[Any], T], lacking: str) -> T:
        answer = self._output([argument], [], self._stops)
        if answer.returncode != 0:
            raise CarsimError(f"{self.binary} {argument}: {process_ending(answer.returncode, answer.stderr)}")
        try:
            return read(json.loads(answer.stdout))
        except (ValueError, TypeError, KeyError, AttributeError) as error:
            raise CarsimError(f"{self.binary}: {lacking}") from error

    def _output(self, arguments: Sequence[str], lines: Sequence[str], stops: int) -> subprocess.CompletedProcess[str]:
        """Run the program on that input to its end. CarsimError if it cannot be started or after more than ``stops``."""
        command = [*self.command, *arguments]
        try:
            # A session of its own keeps Ctrl-C from the simulator: the caller decides what is to end.
            process = subprocess.Popen(
                command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                encoding="utf-8", errors="replace", start_new_session=True,
            )  # fmt: skip
        except OSError as error:
            raise CarsimError(f"{self.binary}: cannot be started: {error.strerror}") from error
        self._running.add(process)
        try:
            # `stop` may have come before there was this process to end.
            if self._stops != stops:
                process.kill()
            output, messages = process.communicate("".join(f"{line}\n" for line in lines))
        except BaseException:
            process.kill()
            raise
        finally:
            self._running.discard(process)
        if self._stops != stops:
            raise CarsimError(f"{self.binary}: stopped")
        return subprocess.CompletedProcess(command, process.returncode, output, messages)


def input_line(kind: str, name: str, object_text: str) -> str:
    """A line of `carsim batch`'s input: a ``body`` or ``scene`` from its JSON text, with its id."""
    rest = object_text.lstrip()[1:]
    return f'{{"{kind}": {{"id": {json.dumps(name)}{"" if rest.lstrip() == "}" else ", "}{rest}}}'


def run_line(name: str, request: RunRequest) -> str:
    """The line that asks for the run, by its id."""
    head = f'"body": {json.dumps(request.body)}, "scene": {json.dumps(request.scene)}'
    if request.compact_path:
        head += f', "path_interval_s": {KEPT_INTERVAL_S}, "path_form": "compact"'
    return input_line("run", name, f"{{{head}, {request.settings[1:]}")


@dataclass(frozen=True)
class PulseTrain:
    """Times (s) of the trial and the eight widths (µs, 0: none) from each on; the last is the firmware's end of it."""

    times_s: tuple[float, ...]
    widths_us: tuple[tuple[float, ...], ...]

    @property
    def end_s(self) -> float:
        """When the firmware ends the trial."""
        return self.times_s[-1]

    def at(self, t_s: float) -> tuple[float, ...]:
        """The widths at a time."""
        return self.widths_us[max(0, bisect_right(self.times_s, t_s) - 1)]


def ask_pulses(carsim: Carsim, settings: Sequence[Mapping[str, Any]]) -> list[PulseTrain]:
    """The trains of several settings (keys of docs/carsim.md's ``pulses``), in order."""
    keys = ("speed_m_s", "yaw_rate_rad_s", "time_limit_s", "parameters")
    asked = [{key: setting[key] for key in keys if key in setting} for setting in settings]
    lines = [json.dumps({"pulses": {"id": str(index), **one}}) for index, one in enumerate(asked)]
    trains = []
    for answer in carsim.answers(lines):
        rows = answer["changes"]
        trains.append(PulseTrain(tuple(row[0] for row in rows), tuple(tuple(row[1:]) for row in rows)))
    return trains
