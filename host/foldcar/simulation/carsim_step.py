"""Client of `carsim step`: one trial at a time in a simulator process, advanced by the caller (docs/carsim.md).

Input: a body, a scene and settings as JSON text, then times to advance to. Output: states and the result.
"""

import contextlib
import json
import subprocess
from collections.abc import Sequence
from typing import Any, NamedTuple

from foldcar.simulation.runner import CarsimError, process_ending


class State(NamedTuple):
    """The car at one step of a trial: time from its start, pose of the car's origin, motion, energy drawn."""

    t_s: float
    x_m: float
    y_m: float
    z_m: float
    heading_rad: float
    pitch_rad: float
    roll_rad: float
    speed_m_s: float
    yaw_rate_rad_s: float
    consumed_energy_j: float


class Advanced(NamedTuple):
    """The state after an advance, and the trial's result if it has ended."""

    state: State
    result: dict[str, Any] | None


class TrialFailedError(CarsimError):
    """The trial crashed, computed infinite numbers, or was refused by the firmware; other runs do not fail."""


class SimulatorDiedError(TrialFailedError):
    """The simulator process crashed or was killed during the trial."""


class LineProcess:
    """A process that answers lines of input with lines, for use in one thread. Raises CarsimError if it cannot start."""

    def __init__(self, command: Sequence[str], **options: Any) -> None:
        try:
            self._process = subprocess.Popen(
                command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, encoding="utf-8", errors="replace", **options
            )
        except OSError as error:
            raise CarsimError(f"{command[0]}: cannot be started: {error.strerror}") from error

    def ask(self, *lines: str) -> str:
        """Send ``lines`` and return one line of answer; "" if the process died before it was complete."""
        assert self._process.stdin is not None and self._process.stdout is not None
        with contextlib.suppress(OSError, ValueError):
            self._process.stdin.write("\n".join(lines) + "\n")
            self._process.stdin.flush()
            answer: str = self._process.stdout.readline()
            if answer.endswith("\n"):
                return answer
        return ""

    def close(self) -> int:
        """Close the pipes, wait for the process to end and return its return code."""
        for pipe in (self._process.stdin, self._process.stdout):
            assert pipe is not None
            with contextlib.suppress(OSError):
                pipe.close()
        return self._process.wait()


class SteppedCarsim:
    """A simulator process, started by ``command``, for one thread. As a context manager, it ends the process."""

    def __init__(self, command: Sequence[str]) -> None:
        self._command = command
        self.binary = command[0]
        self._process: LineProcess | None = None
        self._awaits_answer = False

    def __enter__(self) -> "SteppedCarsim":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def alive(self) -> bool:
        """Whether a process runs and has answered every question."""
        return self._process is not None and not self._awaits_answer

    def start(self, body: str, scene: str, settings: str) -> Advanced:
        """Place the car and start the trial; return its first state.

        Body, scene and settings are JSON objects as text, as in docs/carsim.md, without ids. Raises CarsimError if the
        simulator refuses them, TrialFailedError if the firmware does.
        """
        if not self.alive:
            self.close()
            self._process = LineProcess([*self._command, "step"])
        body_with_id = _with_first_keys('"id": "body"', body)
        scene_with_id = _with_first_keys('"id": "scene"', scene)
        run_with_id = _with_first_keys('"id": "run", "body": "body", "scene": "scene"', settings)
        answer = self._ask(f'{{"body": {body_with_id}}}', f'{{"scene": {scene_with_id}}}', f'{{"run": {run_with_id}}}')
        return _advanced(answer)

    def advance(self, to_s: float) -> Advanced:
        """Advance to that time of the trial, or to its end if that is earlier."""
        return _advanced(self._ask(f'{{"advance": {{"to_s": {to_s!r}}}}}'))

    def rows(self) -> list[State]:
        """Return the states at every step of the last advance, including its end."""
        return [State(*row) for row in self._ask('{"rows": {}}')["rows"]]

    def end(self, row: int) -> dict[str, Any]:
        """End the trial at that row of the last advance; return its result, with the outcome "terminated"."""
        result: dict[str, Any] = self._ask(f'{{"end": {{"row": {row}}}}}')["result"]
        return result

    def close(self) -> int:
        """End the process and return its return code; 0 if there is no process."""
        process, self._process = self._process, None
        self._awaits_answer = False
        return 0 if process is None else process.close()

    def _ask(self, *lines: str) -> dict[str, Any]:
        """Send lines to the process and return its JSON answer.

        Raises SimulatorDiedError if the process has died, TrialFailedError if the trial has failed, and CarsimError if no
        trial is running or if carsim refuses its input.
        """
        if self._process is None:
            raise CarsimError(f"{self.binary}: no trial is running")
        # If an exception interrupts the question, such as that of a time limit, this remains True.
        self._awaits_answer = True
        line = self._process.ask(*lines)
        if not line:
            return_code = self.close()
            raise SimulatorDiedError(f"the simulation crashed ({process_ending(return_code)})")
        answer: dict[str, Any] = json.loads(line)
        self._awaits_answer = False
        if "error" not in answer:
            return answer
        # A process that has refused a body or a scene also refuses all later trials. So the next trial gets a new
        # process.
        self.close()
        problem = answer["error"]
        if problem.get("kind") == "simulation":
            raise TrialFailedError(str(problem["message"]))
        raise CarsimError(f"{self.binary} refuses: {problem['message']}")


def _with_first_keys(keys: str, object_text: str) -> str:
    """Return a JSON object with further keys before its own ones. The text is not parsed, because that takes long.

    Example: _with_first_keys('"id": "body"', '{"track_m": 0.1}') is '{"id": "body", "track_m": 0.1}'
    """
    after_brace = object_text[1:]
    return f"{{{keys}, {after_brace}"


def _advanced(answer: dict[str, Any]) -> Advanced:
    return Advanced(State(*answer["state"]), answer["result"])
