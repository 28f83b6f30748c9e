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
from typing import Any, NamedTuple, TypeVar

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

        ``binary`` is the program to use; if it is None, the program that contains ``engine`` is searched for. Raises
        CarsimError if there is no such program, or if the program that was found reports another engine.
        """
        # foldcar's own program contains several engines, and an option chooses one of them. A program that the caller
        # names has a single engine, and so no such option.
        engine_options: tuple[str, ...] = ()
        if binary is None:
            binary = find_carsim(engine)
            engine_options = ENGINES[engine].options
            expected_title = ENGINES[engine].title
        else:
            expected_title = None
        self.binary = binary
        self.command = (*program_command(binary), *engine_options)
        self._running: set[subprocess.Popen[str]] = set()
        # How often `stop` was called.
        self._stop_count = 0
        self._limits: CarsimLimits | None = None
        version = self._ask("--version", _read_version, "is not carsim (`--version` does not print its build)")
        self.build, self.firmware, self.engine = version.build, version.firmware, version.engine
        if self.engine:
            # Two engines give different results, so they must not have the same build.
            self.build = f"{version.build} {self.engine}"
        if expected_title is not None and engine_title(self.engine) != expected_title:
            raise CarsimError(f"{self.binary}: its engine is {self.engine or 'multibody'}, not {engine}")

    def stop(self) -> None:
        """Stop all running calls; they raise CarsimError."""
        self._stop_count += 1
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

        ``bodies`` and ``scenes`` map ids to JSON objects as text. All runs are simulated in one process, one after
        another. If a signal kills the process, the run that it was simulating is repeated alone, and a new process
        simulates the runs that follow. Raises CarsimError if the simulator refuses its input, if it ends with another
        error, and if `stop` is called meanwhile.
        """
        stop_count_at_start = self._stop_count
        answers: list[dict[str, Any]] = []
        while len(answers) < len(requests):
            remaining = requests[len(answers) :]
            batch = self._batch(bodies, scenes, remaining, stop_count_at_start)
            answers += batch.answers
            if batch.death:
                interrupted = requests[len(answers)]
                answers.append(self._repeat_alone(bodies, scenes, interrupted, stop_count_at_start))
        return answers

    def _repeat_alone(
        self, bodies: Mapping[str, str], scenes: Mapping[str, str], request: RunRequest, stop_count_at_start: int
    ) -> dict[str, Any]:
        """Simulate one run in a process of its own; if a signal kills this process, too, the run has failed."""
        body = {request.body: bodies[request.body]}
        scene = {request.scene: scenes[request.scene]}
        batch = self._batch(body, scene, [request], stop_count_at_start)
        if batch.death:
            return {"error": f"the simulation crashed ({batch.death})"}
        (answer,) = batch.answers
        return answer

    def answers(self, lines: Sequence[str]) -> list[dict[str, Any]]:
        """Send lines to ``carsim batch`` and return its answers. Raises CarsimError if any answer is an error."""
        process = self._output(["batch"], lines, self._stop_count)
        try:
            answers: list[dict[str, Any]] = [json.loads(line) for line in process.stdout.splitlines()]
        except ValueError as error:
            raise CarsimError(f"{self.binary}: its answer is not JSON") from error
        for answer in answers:
            if "error" in answer:
                raise CarsimError(f"{self.binary}: {answer['error']['message']}")
        if process.returncode != 0:
            raise CarsimError(f"{self.binary}: {process_ending(process.returncode, process.stderr)}")
        return answers

    def _batch(
        self,
        bodies: Mapping[str, str],
        scenes: Mapping[str, str],
        requests: Sequence[RunRequest],
        stop_count_at_start: int,
    ) -> "_Batch":
        """Simulate runs in one process.

        ``stop_count_at_start`` is how often `stop` had been called when :meth:`run` began. If `stop` is called again, the
        process is ended. Raises CarsimError as :meth:`run` does.
        """
        lines = [input_line("body", name, text) for name, text in bodies.items()]
        lines += [input_line("scene", name, text) for name, text in scenes.items()]
        lines += [run_line(str(index), request) for index, request in enumerate(requests)]
        process = self._output(["batch"], lines, stop_count_at_start)
        # A killed process may leave an incomplete last line.
        complete_lines = [line for line in process.stdout.splitlines(keepends=True) if line.endswith("\n")]
        answers = [self._read_answer(line, requests) for line in complete_lines]

        ending = process_ending(process.returncode, process.stderr)
        was_killed = process.returncode < 0
        if was_killed and len(answers) < len(requests):
            return _Batch(answers, death=ending)
        # carsim ends with the return code 2 if a simulation failed.
        expected_code = 2 if any("error" in answer for answer in answers) else 0
        # A process that is killed after its last answer has done all its work.
        has_expected_ending = was_killed or process.returncode == expected_code
        if len(answers) != len(requests) or not has_expected_ending:
            raise CarsimError(f"{self.binary}: {ending} after {len(answers)} of {len(requests)} runs")
        return _Batch(answers, death="")

    def _read_answer(self, line: str, requests: Sequence[RunRequest]) -> dict[str, Any]:
        """Return the answer to one of ``requests``, from a line of carsim's output.

        Raises CarsimError if carsim has refused the input, or if the line is not a possible result.
        """
        try:
            answer = json.loads(line)
            if "error" in answer:
                return self._failed_run(answer["error"], requests)
            is_possible = _is_possible_result(answer)
        except (ValueError, TypeError, KeyError, IndexError) as error:
            raise CarsimError(f"{self.binary}: its answer is not a result: {line[:80]}") from error
        if not is_possible:
            raise CarsimError(f"{self.binary}: its answer is an impossible result: {line[:200]}")
        return {key: value for key, value in answer.items() if key != "run"}

    def _failed_run(self, error: Mapping[str, Any], requests: Sequence[RunRequest]) -> dict[str, Any]:
        """Return the answer to a run whose simulation failed with carsim's ``error``.

        Raises InputRefusedError if no simulation failed, but carsim has refused one of the ``requests``, a body or a
        scene.
        """
        if error["kind"] == "simulation":
            return {"error": str(error["message"])}
        if len(requests) == 1:
            label = requests[0].label
        elif error["run"] is not None:
            label = requests[int(error["run"])].label
        else:
            # Several runs may use a refused body or scene, so the error has only the number of its line.
            label = f"line {error['line']}"
        raise InputRefusedError(self.binary, label, str(error["message"]))

    def _ask(self, argument: str, read: Callable[[Any], T], problem: str) -> T:
        """Run carsim with one argument and return what ``read`` makes of the JSON that it prints.

        Raises CarsimError with the text ``problem`` if ``read`` fails, because the output is not as expected.
        """
        process = self._output([argument], [], self._stop_count)
        if process.returncode != 0:
            raise CarsimError(f"{self.binary} {argument}: {process_ending(process.returncode, process.stderr)}")
        try:
            return read(json.loads(process.stdout))
        except (ValueError, TypeError, KeyError, AttributeError) as error:
            raise CarsimError(f"{self.binary}: {problem}") from error

    def _output(
        self, arguments: Sequence[str], lines: Sequence[str], stop_count_at_start: int
    ) -> subprocess.CompletedProcess[str]:
        """Run the program with these arguments and input lines until it ends, and return its output.

        ``stop_count_at_start`` is how often `stop` had been called when the caller began. If `stop` was called again
        since then, by another thread, the program is killed and this raises CarsimError. It also raises CarsimError if
        the program cannot be started.
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
        # From now on, `stop` kills the process. It may have been called just before.
        self._running.add(process)
        try:
            if self._stop_count != stop_count_at_start:
                process.kill()
            output, messages = process.communicate("".join(f"{line}\n" for line in lines))
        except BaseException:
            process.kill()
            raise
        finally:
            self._running.discard(process)
        if self._stop_count != stop_count_at_start:
            raise CarsimError(f"{self.binary}: stopped")
        return subprocess.CompletedProcess(command, process.returncode, output, messages)


class _Version(NamedTuple):
    """What `carsim --version` prints; ``engine`` is "" for the default engine, multibody, as in stores."""

    build: str
    firmware: str
    engine: str


def _read_version(output: Any) -> _Version:
    """Return the version from the JSON that `carsim --version` prints."""
    engine = str(output["engine"])
    return _Version(
        build=str(output["build"]),
        firmware=str(output["firmware"]),
        engine="" if engine == MULTIBODY else engine,
    )


class _Batch(NamedTuple):
    """The answers that a process gave before it ended.

    ``death`` says which signal killed the process while it was simulating the run after the last answer; it is "" if the
    process has answered all runs.
    """

    answers: list[dict[str, Any]]
    death: str


def _is_possible_result(answer: Mapping[str, Any]) -> bool:
    """Return whether a run may have this result: a known outcome, and finite metrics."""
    if answer["outcome"] not in results.NATIVE_OUTCOMES:
        return False
    return all(_is_possible(answer[metric.name], metric.optional) for metric in results.METRICS)


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
    """Return the pulses that the firmware sends in a trial with each of the settings, in order."""
    lines = []
    for index, setting in enumerate(settings):
        question = {"id": str(index)}
        for key in ("speed_m_s", "yaw_rate_rad_s", "time_limit_s", "parameters"):
            if key in setting:
                question[key] = setting[key]
        lines.append(json.dumps({"pulses": question}))
    return [_pulse_train(answer["changes"]) for answer in carsim.answers(lines)]


def _pulse_train(changes: Sequence[Sequence[float]]) -> PulseTrain:
    """Return the pulses from rows of a time (s) and the eight widths (µs) from then on."""
    times_s = tuple(row[0] for row in changes)
    widths_us = tuple(tuple(row[1:]) for row in changes)
    return PulseTrain(times_s, widths_us)
