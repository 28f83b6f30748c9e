"""Environments in Python: a Scenic program with its parameters and seed, and its samples.

In a Python session, a program is compiled once (almost a second), and each sample is drawn once (about 50 ms).
"""

import json
import tempfile
import weakref
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy

from foldcar.api.arguments import checked_int, checked_params, checked_path
from foldcar.errors import FoldcarError
from foldcar.notebook_html import image_html, lines_html
from foldcar.scenes.fixed_hash import open_fixed_environment
from foldcar.scenes.program_files import program_lock
from foldcar.simulation.carsim import Carsim
from foldcar.simulation.runner import Runner
from foldcar.simulation.scenic_runner import ScenicRunner
from foldcar.store.writer import canonical_json
from foldcar.study.limits import MAX_ENVIRONMENTS, MAX_SEED


@dataclass(frozen=True, repr=False)
class Scene:
    """Sample number ``sample`` of ``environment``; ``json`` is the scene object of docs/carsim.md as a string."""

    environment: "Environment"
    sample: int
    json: str

    def __repr__(self) -> str:
        return f"{self.environment!r}.scene({self.sample})"

    def _repr_html_(self) -> str:
        """Show the scene from above, and the ground under the wheels."""
        from foldcar.figures.scenes import draw_environment
        from foldcar.simulation.heights import carsim_heights

        environment = self.environment
        scene = {**json.loads(self.json), "id": f"{environment.seed}/{self.sample}"}
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "scene.png"
            draw_environment([scene], file, carsim_heights(simulator()), environment.program.name)
            return lines_html([repr(self), environment.success]) + image_html(file.read_bytes())


class Environment:
    """A Scenic program with a seed; ``params`` (SI units) replace its own. Create it with :func:`environment`."""

    def __init__(self, program: Path, params: Mapping[str, Any], seed: int) -> None:
        self.program = program
        # Read-only, because the program was compiled with them.
        self.params = MappingProxyType(dict(params))
        self.seed = seed
        self._scenes: dict[int, Scene] = {}
        self._source = open_fixed_environment(program, params, seed)

    def __reduce__(self) -> tuple[Any, ...]:
        """Say how another process gets it: compiled programs cannot be sent there."""
        return _environment_with, (self.program, self.seed, dict(self.params))

    def __repr__(self) -> str:
        return f"environment({str(self.program)!r}, seed={self.seed}, params={dict(self.params)})"

    def scene(self, k: int) -> Scene:
        """Return sample ``k`` (0, 1, …), the same as in a sweep. Raises FoldcarError if the Scenic program has an error.

        >>> foldcar.environment("scenarios/step_pyramids.scenic").scene(3).sample
        3
        """
        number = checked_int("scene", k, 0, MAX_ENVIRONMENTS - 1)
        if number not in self._scenes:
            self._scenes[number] = Scene(self, number, canonical_json(self._source.sample(number)))
        return self._scenes[number]

    @property
    def success(self) -> str:
        """A sentence that says when a run has passed, or why that is undefined."""
        return self._source.success.text

    @property
    def success_defined(self) -> bool:
        """Whether the program defines when a run has passed."""
        return self._source.success.defined

    @cached_property
    def runner(self) -> Runner:
        """What simulates runs in this environment: carsim or, if the program is dynamic, Scenic beside carsim.

        A dynamic program has parts that only Scenic can evaluate during a run.
        """
        if not self._source.dynamic:
            return simulator()
        files, command = self._source.fixed_files(), simulator().command
        runner = ScenicRunner(self.program, self.params, self.seed, condition=None, files=files, command=command)
        # Its processes end with this environment, or with Python.
        weakref.finalize(self, runner.close)
        return runner

    def end_waiting_processes(self) -> None:
        """End what waits for runs of a dynamic program; its next run starts new processes."""
        if isinstance(runner := self.__dict__.get("runner"), ScenicRunner):
            runner.close_idle()

    @property
    def is_current(self) -> bool:
        """Whether the program's files are unchanged since it was compiled."""
        return self._source.files.unchanged()


# The environments that a program still uses, by program, parameters and seed.
_environments: "weakref.WeakValueDictionary[str, Environment]" = weakref.WeakValueDictionary()
# Those that were asked for last. Their processes wait for more runs; each takes about 150 MB.
_latest: deque[Environment] = deque(maxlen=4)


def environment(program: str | Path, *, seed: int = 0, params: Mapping[str, Any] | None = None) -> Environment:
    """Return the environment of a Scenic program. Equal program, parameters and seed give the same object.

    Raises FoldcarError if the file does not exist, the program has an error, or an argument is invalid.

    >>> steps = foldcar.environment("scenarios/step_pyramids.scenic", seed=42, params={"friction": 0.5})
    >>> steps.success_defined
    True
    """
    number = checked_int("seed", seed, 0, MAX_SEED)
    checked_params(params)
    # Absolute, because the working directory may change later.
    file = checked_path("program", program, "a Scenic program").resolve()
    if not file.is_file():
        raise FoldcarError(f"{program}: no such Scenic program")
    try:
        values: dict[str, Any] = json.loads(json.dumps(dict(params or {}), default=_plain))
        key = json.dumps([str(file), values, number], sort_keys=True)
    except (TypeError, ValueError) as error:
        raise FoldcarError(f"params: {error}; write numbers, strings, booleans or lists") from None
    # Threads that ask at the same time get the same object.
    with program_lock:
        result = _environments.get(key)
        if result is None or not result.is_current:
            result = Environment(file, values, number)
            _environments[key] = result
        _keep_processes_of_latest(result)
        return result


def _keep_processes_of_latest(asked_for: Environment) -> None:
    """Record that an environment was used now, and end the processes of the one that was not used for longest.

    Only a few environments may have waiting processes, because each process needs much memory. ``asked_for`` is the
    environment that is used now.
    """
    if asked_for in _latest:
        _latest.remove(asked_for)
    elif len(_latest) == _latest.maxlen:
        # The list is full. Appending to it, below, removes its first environment.
        _latest[0].end_waiting_processes()
    _latest.append(asked_for)


def _environment_with(program: Path, seed: int, params: Mapping[str, Any]) -> Environment:
    return environment(program, seed=seed, params=params)


def _plain(value: object) -> Any:
    """Return a number or an array of numpy as Python's own. Raises TypeError for anything else that JSON cannot hold."""
    if isinstance(value, numpy.generic | numpy.ndarray):
        return value.tolist()
    raise TypeError(f"Object of type {type(value).__name__} is not JSON serializable")


@cache
def simulator() -> Carsim:
    """Return the simulator of this process."""
    return Carsim()
