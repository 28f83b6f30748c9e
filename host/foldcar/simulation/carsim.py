"""The native simulator as a program: find it, ask its build and parameter table, run chunks of runs.

Input: bodies, scenes and settings as JSON text (docs/carsim.md). Output: one answer a run, in order: a
result, or ``{"error": message}`` for a run that failed. A process that dies takes only its run with it.
"""

import contextlib
import json
import math
import subprocess
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from foldcar.car.car_file import TableRow
from foldcar.simulation.carsim_limits import CarsimLimits, TrialRules
from foldcar.simulation.engines import ENGINES, MULTIBODY, engine_title, find_carsim
from foldcar.simulation.process_ending import process_ending
from foldcar.simulation.results import METRICS, NATIVE_OUTCOMES
from foldcar.simulation.runner import CarsimError, RunRequest


class _Call:
    """A call of a simulator that is under way: its process at the moment, and whether it has been stopped."""

    def __init__(self) -> None:
        self.stopped = False
        self._process: subprocess.Popen[str] | None = None

    def begin(self, process: subprocess.Popen[str]) -> None:
        """This process runs for the call from now on."""
        self._process = process
        # `stop` may have come before there was this process to end.
        if self.stopped:
            process.kill()

    def stop(self) -> None:
        """End the process, and those that the call would start after it."""
        self.stopped = True
        if self._process is not None:
            self._process.kill()


class Carsim:
    """A simulator program. Its methods may be called from several threads at once.

    ``engine`` is name and version of what moves the cars, "" in multibody; ``build`` contains it. ``command`` starts
    the program: its file, and words that choose the engine.
    """

    def __init__(self, binary: Path | None = None, engine: str = MULTIBODY) -> None:
        self.binary = binary if binary is not None else find_carsim(engine)
        self.command = (str(self.binary), *(ENGINES[engine].options if binary is None else ()))
        self._calls: set[_Call] = set()
        self._limits: CarsimLimits | None = None
        self.build, self.firmware, self.engine = self._ask_builds()
        if binary is None and engine_title(self.engine) != ENGINES[engine].title:
            raise CarsimError(f"{self.binary}: its engine is {self.engine or 'multibody'}, not {engine}")

    def stop(self) -> None:
        """End every call that is under way; it raises CarsimError."""
        for call in list(self._calls):
            call.stop()

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

    def limits(self) -> CarsimLimits:
        """The limits of what it takes, and the rules by which its trials run (`carsim limits`)."""
        if self._limits is None:
            try:
                told = json.loads(self._output("limits"))
                numbers = {path: (float(low), float(high)) for path, (low, high) in told["input"].items()}
                self._limits = CarsimLimits(numbers, TrialRules(**told["trial"]))
            except (ValueError, TypeError, KeyError, AttributeError) as error:
                raise CarsimError(f"{self.binary}: `carsim limits` printed no limits") from error
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
        with self._call() as call:
            while len(answers) < len(requests):
                found, death = self._batch(call, bodies, scenes, requests[len(answers) :])
                answers += found
                if death:
                    one = requests[len(answers)]
                    body, scene = {one.body: bodies[one.body]}, {one.scene: scenes[one.scene]}
                    again, death = self._batch(call, body, scene, [one])
                    answers += again or [{"error": f"the simulation crashed ({death})"}]
        return answers

    def answers(self, lines: Sequence[str]) -> list[dict[str, Any]]:
        """The answers of ``carsim batch`` to lines of its input; CarsimError if one of them is an error."""
        with self._call() as call:
            answer = self._start(call, ["batch"], "\n".join(lines) + "\n")
        try:
            found: list[dict[str, Any]] = [json.loads(line) for line in answer.stdout.splitlines()]
        except ValueError as error:
            raise CarsimError(f"{self.binary}: answered what is no JSON") from error
        for one in found:
            if "error" in one:
                raise CarsimError(f"{self.binary}: {one['error']['message']}")
        if answer.returncode != 0:
            raise CarsimError(f"{self.binary}: {process_ending(answer.returncode, answer.stderr)}")
        return found

    def _batch(
        self,
        call: _Call,
        bodies: Mapping[str, str],
        scenes: Mapping[str, str],
        requests: Sequence[RunRequest],
    ) -> tuple[list[dict[str, Any]], str]:
        """The answers of one process, and how it was killed by a signal, if that came before the last answer.

        The next run is then the one that it was at. CarsimError as for `run`.
        """
        lines = [input_line("body", name, text) for name, text in bodies.items()]
        lines += [input_line("scene", name, text) for name, text in scenes.items()]
        lines += [run_line(str(index), request) for index, request in enumerate(requests)]
        answer = self._start(call, ["batch"], "\n".join(lines) + "\n")
        killed = answer.returncode < 0
        # A line without its end was being written.
        whole = [line for line in answer.stdout.splitlines(keepends=True) if line.endswith("\n")]
        results = [self.read_answer(line, requests) for line in whole]
        if killed and len(results) < len(requests):
            return results, process_ending(answer.returncode, answer.stderr)
        expected = 2 if any("error" in result for result in results) else 0
        if len(results) != len(requests) or not (killed or answer.returncode == expected):
            ending = process_ending(answer.returncode, answer.stderr)
            raise CarsimError(f"{self.binary}: {ending} after {len(results)} of {len(requests)} runs")
        return results, ""

    def read_answer(self, line: str, requests: Sequence[RunRequest]) -> dict[str, Any]:
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
            sound = answer["outcome"] in NATIVE_OUTCOMES and all(
                math.isfinite(answer[metric.name])
                for metric in METRICS
                if answer[metric.name] is not None or not metric.optional
            )
        except (ValueError, TypeError, KeyError, IndexError) as error:
            raise CarsimError(f"{self.binary}: answered what is no result: {line[:80]}") from error
        if not sound:
            raise CarsimError(f"{self.binary}: answered an impossible result: {line[:200]}")
        return {key: value for key, value in answer.items() if key != "run"}

    def _ask_builds(self) -> tuple[str, str, str]:
        """The id of all that results depend on, that of the firmware in it, which a car has too, and the engine."""
        try:
            told = json.loads(self._output("--version"))
            build, firmware, engine = str(told["build"]), str(told["firmware"]), str(told["engine"])
        except (ValueError, TypeError, KeyError) as error:
            raise CarsimError(
                f"{self.binary}: is no carsim (`--version` does not print its build)"
            ) from error
        if engine == "multibody":
            return build, firmware, ""
        return f"{build} {engine}", firmware, engine

    def _output(self, argument: str) -> str:
        with self._call() as call:
            answer = self._start(call, [argument], "")
        if answer.returncode != 0:
            raise CarsimError(f"{self.binary} {argument}: {process_ending(answer.returncode, answer.stderr)}")
        return answer.stdout

    @contextlib.contextmanager
    def _call(self) -> Iterator[_Call]:
        call = _Call()
        self._calls.add(call)
        try:
            yield call
        except BaseException:
            call.stop()
            raise
        finally:
            self._calls.discard(call)

    def _start(
        self, call: _Call, arguments: Sequence[str], text: str
    ) -> subprocess.CompletedProcess[str]:
        """Run the program on that input to its end. CarsimError if it cannot be started or the call is stopped."""
        command = [*self.command, *arguments]
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
        call.begin(process)
        output, messages = process.communicate(text)
        if call.stopped:
            raise CarsimError(f"{self.binary}: stopped")
        return subprocess.CompletedProcess(command, process.returncode, output, messages)


def input_line(kind: str, name: str, object_text: str) -> str:
    """A line of `carsim batch`'s input: a ``body`` or ``scene`` from its JSON text, with its id."""
    rest = object_text.lstrip()[1:]
    return f'{{"{kind}": {{"id": {json.dumps(name)}{"" if rest.lstrip() == "}" else ", "}{rest}}}'


def run_line(name: str, request: RunRequest) -> str:
    """The line that asks for the run, by its id."""
    head = f'"body": {json.dumps(request.body)}, "scene": {json.dumps(request.scene)}'
    return input_line("run", name, f"{{{head}, {request.settings[1:]}")
