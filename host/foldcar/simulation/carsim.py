"""Calls the simulator program carsim: asks for its build, parameters and limits, and runs chunks of runs.

Input: bodies, scenes and settings as JSON text (docs/carsim.md). Output: an answer to each run, in order: a result, or
``{"error": message}`` for a failed run. If a process dies, only its current run fails.
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
from foldcar.simulation.engines import ENGINES, MULTIBODY, engine_title, find_carsim, program_command
from foldcar.simulation.runner import CarsimError, InputRefusedError, RunRequest, process_ending

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
    """Limits of carsim's input: ``numbers`` are (minimum, maximum) by path, such as ``body.wheels.servo.neutral_us``.

    ``trial`` are the rules of its trials.
    """

    numbers: Mapping[str, tuple[float, float]]
    trial: TrialRules


class Carsim:
    """A simulator program. Its methods may be called from several threads at once.

    ``build`` identifies everything that results depend on, and ``firmware`` the firmware, as a built car reports it.
    ``engine`` is the engine's name and version, "" for multibody; ``build`` contains it. ``command`` starts the program:
    its file, and the options that choose the engine.
    """

    def __init__(self, binary: Path | None = None, engine: str = MULTIBODY) -> None:
        """Find the program carsim and ask it for its build, its firmware and its engine.

        ``binary`` is the program to use; None searches for the one with this ``engine``. Raises CarsimError if there is
        none, or if it has another engine.
        """
        self.binary = binary if binary is not None else find_carsim(engine)
        # A program that the caller has named has one engine. Only foldcar's own carsim chooses its engine by an option.
        engine_options = ENGINES[engine].options if binary is None else ()
        self.command = (*program_command(self.binary), *engine_options)
        self._running: set[subprocess.Popen[str]] = set()
        # How often `stop` was called.
        self._stops = 0
        self._limits: CarsimLimits | None = None
        self.build, self.firmware, reported_engine = self._ask(
            "--version",
            lambda output: (str(output["build"]), str(output["firmware"]), str(output["engine"])),
            "is not carsim (`--version` does not print its build)",
        )
        # In stores the default engine, multibody, is the empty string.
        self.engine = "" if reported_engine == MULTIBODY else reported_engine
        if self.engine:
            # Results of another engine must not count as those of this build.
            self.build += f" {self.engine}"
        if binary is None and engine_title(self.engine) != ENGINES[engine].title:
            raise CarsimError(f"{self.binary}: its engine is {self.engine or 'multibody'}, not {engine}")

    def stop(self) -> None:
        """Stop all running calls; they raise CarsimError."""
        self._stops += 1
        for process in list(self._running):
            process.kill()

    def parameter_table(self) -> dict[str, TableRow]:
        """Return the firmware's parameters by name."""

        def read(output: Any) -> dict[str, TableRow]:
            keys = ("name", "unit", "minimum", "maximum", "default")
            return {row["name"]: TableRow(*(row[key] for key in keys)) for row in output}

        return self._ask("params", read, "`carsim params` printed no parameter table")

    def limits(self) -> CarsimLimits:
        """Return the limits of carsim's input and the rules of its trials; `carsim limits` is run once."""

        def read(output: Any) -> CarsimLimits:
            numbers = {path: (float(low), float(high)) for path, (low, high) in output["input"].items()}
            return CarsimLimits(numbers, TrialRules(**output["trial"]))

        if self._limits is None:
            self._limits = self._ask("limits", read, "`carsim limits` printed no limits")
        return self._limits

    def run(
        self, bodies: Mapping[str, str], scenes: Mapping[str, str], requests: Sequence[RunRequest]
    ) -> list[dict[str, Any]]:
        """Simulate the requested runs and return their answers, in order.

        ``bodies`` and ``scenes`` map ids to JSON objects as text. If a signal kills the process, its current run is
        repeated alone in a new process. If that is killed, too, the run has failed. Raises CarsimError if the simulator
        refuses its input or ends with another error, and after `stop`.
        """
        answers: list[dict[str, Any]] = []
        # If this number changes, `stop` was called in another thread, and the batch ends.
        stops = self._stops
        while len(answers) < len(requests):
            batch_answers, death = self._batch(bodies, scenes, requests[len(answers) :], stops)
            answers += batch_answers
            if death:
                interrupted = requests[len(answers)]
                body = {interrupted.body: bodies[interrupted.body]}
                scene = {interrupted.scene: scenes[interrupted.scene]}
                repeated_answers, second_death = self._batch(body, scene, [interrupted], stops)
                if second_death:
                    repeated_answers = [{"error": f"the simulation crashed ({second_death})"}]
                answers += repeated_answers
        return answers

    def answers(self, lines: Sequence[str]) -> list[dict[str, Any]]:
        """Send lines to ``carsim batch`` and return its answers. Raises CarsimError if any answer is an error."""
        process = self._output(["batch"], lines, self._stops)
        try:
            answers: list[dict[str, Any]] = [json.loads(line) for line in process.stdout.splitlines()]
        except ValueError as error:
            raise CarsimError(f"{self.binary}: its answer is not JSON") from error
        for answer_line in answers:
            if "error" in answer_line:
                raise CarsimError(f"{self.binary}: {answer_line['error']['message']}")
        if process.returncode != 0:
            raise CarsimError(f"{self.binary}: {process_ending(process.returncode, process.stderr)}")
        return answers

    def _batch(
        self, bodies: Mapping[str, str], scenes: Mapping[str, str], requests: Sequence[RunRequest], stops: int
    ) -> tuple[list[dict[str, Any]], str]:
        """Run a batch in one process. Return its answers, and how a signal killed the process, or "" if none did.

        If it was killed, it was simulating the run after the last answer. ``stops`` is how often `stop` had been called
        when :meth:`run` began; if it is called again meanwhile, the process is ended. Raises CarsimError as `run` does.
        """
        lines = [input_line("body", name, text) for name, text in bodies.items()]
        lines += [input_line("scene", name, text) for name, text in scenes.items()]
        lines += [run_line(str(index), request) for index, request in enumerate(requests)]
        process = self._output(["batch"], lines, stops)
        is_killed = process.returncode < 0
        # A killed process may leave an incomplete last line.
        complete_lines = [line for line in process.stdout.splitlines(keepends=True) if line.endswith("\n")]
        results = [self._read_answer(line, requests) for line in complete_lines]
        if is_killed and len(results) < len(requests):
            return results, process_ending(process.returncode, process.stderr)
        # carsim ends with 2 if a simulation failed.
        expected_code = 2 if any("error" in result for result in results) else 0
        if len(results) != len(requests) or not (is_killed or process.returncode == expected_code):
            ending = process_ending(process.returncode, process.stderr)
            raise CarsimError(f"{self.binary}: {ending} after {len(results)} of {len(requests)} runs")
        return results, ""

    def _read_answer(self, line: str, requests: Sequence[RunRequest]) -> dict[str, Any]:
        """Return the answer to one of ``requests``, from a line of carsim's output.

        Raises CarsimError if carsim has refused the input, or if the line is not a possible result.
        """
        try:
            answer = json.loads(line)
            if "error" in answer:
                error = answer["error"]
                if error["kind"] == "simulation":
                    return {"error": str(error["message"])}
                # An error about a run has the run's index. An error about a body or a scene has only the number of its
                # line, because several runs may use it. If there is a single run, any error is about this run.
                index = 0 if len(requests) == 1 else error["run"]
                label = requests[int(index)].label if index is not None else f"line {error['line']}"
                raise InputRefusedError(self.binary, label, str(error["message"]))
            # An answer with an impossible outcome may lack the metrics.
            is_possible = answer["outcome"] in results.NATIVE_OUTCOMES
            is_possible = is_possible and all(_is_possible(answer[m.name], m.optional) for m in results.METRICS)
        except (ValueError, TypeError, KeyError, IndexError) as error:
            raise CarsimError(f"{self.binary}: its answer is not a result: {line[:80]}") from error
        if not is_possible:
            raise CarsimError(f"{self.binary}: its answer is an impossible result: {line[:200]}")
        return {key: value for key, value in answer.items() if key != "run"}

    def _ask(self, argument: str, read: Callable[[Any], T], missing_text: str) -> T:
        """Run carsim with one argument and convert its JSON by ``read``. Raises CarsimError, with ``missing_text``."""
        process = self._output([argument], [], self._stops)
        if process.returncode != 0:
            raise CarsimError(f"{self.binary} {argument}: {process_ending(process.returncode, process.stderr)}")
        try:
            return read(json.loads(process.stdout))
        except (ValueError, TypeError, KeyError, AttributeError) as error:
            raise CarsimError(f"{self.binary}: {missing_text}") from error

    def _output(self, arguments: Sequence[str], lines: Sequence[str], stops: int) -> subprocess.CompletedProcess[str]:
        """Run the program with these arguments and input lines until it ends.

        ``stops`` is the number of calls of `stop` when the caller began. Raises CarsimError if the program cannot be
        started, or if `stop` was called since.
        """
        command = [*self.command, *arguments]
        try:
            # In a session of its own, Ctrl-C does not reach the simulator; the caller decides what to stop.
            process = subprocess.Popen(
                command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                encoding="utf-8", errors="replace", start_new_session=True,
            )  # fmt: skip
        except OSError as error:
            raise CarsimError(f"{self.binary}: cannot be started: {error.strerror}") from error
        self._running.add(process)
        try:
            # `stop` may have been called before this process existed.
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


def _is_possible(number: float | None, is_optional: bool) -> bool:
    """Return whether a result may contain this number; only optional numbers may be missing (None)."""
    if number is None:
        return is_optional
    return math.isfinite(number)


def input_line(kind: str, name: str, object_text: str) -> str:
    """Return a line of `carsim batch`'s input: a JSON object of that ``kind``, with the id ``name``.

    Example: input_line("body", "w95", '{"track_m": 0.1}') is '{"body": {"id": "w95", "track_m": 0.1}}'

    The id is inserted into the text, because parsing a body takes longer than simulating some runs.
    """
    after_brace = object_text.lstrip()[1:]
    separator = "" if after_brace.lstrip() == "}" else ", "
    return f'{{"{kind}": {{"id": {json.dumps(name)}{separator}{after_brace}}}'


def run_line(name: str, request: RunRequest) -> str:
    """Return the line of `carsim batch`'s input that requests a run, with the id ``name``."""
    head = f'"body": {json.dumps(request.body)}, "scene": {json.dumps(request.scene)}'
    return input_line("run", name, f"{{{head}, {request.keys[1:]}")


@dataclass(frozen=True)
class PulseTrain:
    """Servo pulses of a trial: times (s) at which they change, and the eight widths (µs, 0: no pulses) from then on.

    The last time is the end of the trial.
    """

    times_s: tuple[float, ...]
    widths_us: tuple[tuple[float, ...], ...]

    @property
    def end_s(self) -> float:
        """The time at which the firmware ends the trial (s)."""
        return self.times_s[-1]

    def at(self, t_s: float) -> tuple[float, ...]:
        """Return the eight widths (µs) at a time."""
        return self.widths_us[max(0, bisect_right(self.times_s, t_s) - 1)]


def ask_pulses(carsim: Carsim, settings: Sequence[Mapping[str, Any]]) -> list[PulseTrain]:
    """Return the pulses that the firmware sends with each of the settings, in order."""
    lines = []
    for index, setting in enumerate(settings):
        question = {"id": str(index)}
        for key in ("speed_m_s", "yaw_rate_rad_s", "time_limit_s", "parameters"):
            if key in setting:
                question[key] = setting[key]
        lines.append(json.dumps({"pulses": question}))
    trains = []
    for answer in carsim.answers(lines):
        times_s = tuple(time_s for time_s, *_ in answer["changes"])
        widths_us = tuple(tuple(widths) for _, *widths in answer["changes"])
        trains.append(PulseTrain(times_s, widths_us))
    return trains
