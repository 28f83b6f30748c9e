"""Compiles one Scenic program and samples scenes from it. (study/environments.py adds an experiment's car and store.)

Input: a program, its parameters, a seed, optionally a condition. Output: scenes as JSON (docs/carsim.md). Sample k
depends only on (program, parameters, seed, condition, k), so that every design meets the same scenes, independent of
their number and order. Scenic draws from the global generators of Python and numpy; their states are restored.
"""

import contextlib
import hashlib
import io
import pickle
import random
import sys
from collections.abc import Callable, Iterator, Mapping
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from foldcar.errors import FoldcarError
from foldcar.scenes.contained import contained
from foldcar.scenes.object_names import Parameters, object_parameters, terrain_names, terrain_objects
from foldcar.scenes.obstacles import Obstacle
from foldcar.scenes.program import ProgramError, compile_program, is_dynamic, may_end_itself, overlap_hint
from foldcar.scenes.program_files import Files, ProgramFiles, program_lock
from foldcar.scenes.scene_json import scene_with_obstacles
from foldcar.scenes.success import SuccessRule, success_rule

if TYPE_CHECKING:
    from foldcar.scenes.native_program import Translation

# Scenic's default. A program whose samples are rejected this often has requirements that are almost never fulfilled.
MAX_ITERATIONS = 2000
SAMPLE_LIMIT_S = 40.0
# The stream of random values that the `pieces` of a program's classes draw.
PIECES = "/pieces"


class SceneSource:
    """A compiled program from which scenes are sampled. Made by :func:`open_environment`."""

    def __init__(self, program: Path, files: ProgramFiles, scenario: Any, seed: int) -> None:
        self.program = program
        self.files = files
        self.seed = seed
        self.scenario = scenario
        # Whether the program has drawn random values when it was compiled, which are the same in all samples.
        self.has_drawn_early = False
        # Compiles the program once more.
        self._open_again: Callable[[], SceneSource] | None = None
        self._first: dict[str, Any] | None = None
        self._terrain_names: list[str] | None = None

    @property
    def dynamic(self) -> bool:
        """Whether the program has parts that Scenic must evaluate during a simulation, beside carsim."""
        return bool(self.needs_scenic)

    @property
    def needs_scenic(self) -> str:
        """The part, with its line, that Scenic must evaluate beside carsim; "" if carsim evaluates everything."""
        return self._translation.needs_scenic

    @cached_property
    def _translation(self) -> "Translation":
        """The program's statements about runs, translated for carsim, or the reason why this is not possible."""
        from foldcar.scenes.native_program import Translation, native_program

        if not is_dynamic(self.scenario):
            # There are no such statements.
            return Translation(None)
        with self.files.inside():
            return native_program(self.scenario, self.program, self.success)

    @cached_property
    def success(self) -> SuccessRule:
        """The rule by which a run of the program has passed."""
        with self.files.inside():
            return success_rule(self.scenario, self.program)

    def fixed_files(self) -> Files:
        """Fix and return the program's files: those that compiling and sample 0 read. It must not read others later.

        Raises FoldcarError if the program draws another sample 0 when it is compiled once more.
        """
        if self._first is None:
            self._first = self.sample(0)
            if self._open_again is not None and self._open_again().sample(0) != self._first:
                raise other_scene_error(self.program, 0)
        return self.files.fix()

    def sample(self, k: int) -> dict[str, Any]:
        """Draw sample ``k`` (0, 1, …) as the "scene" object of docs/carsim.md without its id.

        Lengths are in metres, angles in radians, rounded to 1e-9. Raises FoldcarError if the program rejects every
        sample, fails, or takes longer than SAMPLE_LIMIT_S; if the simulator cannot represent the scene; or if sample 0
        differs from the one that fixed_files drew.
        """
        return self.sample_with_parameters(k)[0]

    def sample_with_parameters(self, k: int) -> tuple[dict[str, Any], list[Parameters]]:
        """Draw sample ``k``. Return its scene, as :meth:`sample` does, and the parameters of each terrain object."""
        scenic_scene = self.scenic_scene(k)
        scene = self.describe(scenic_scene, k)
        # Sample 0 may have been drawn before. A second time it must be the same.
        if k == 0 and self._first is not None and scene != self._first:
            raise other_scene_error(self.program, k)
        if self._terrain_names is None:
            self._terrain_names = terrain_names(self.scenario, scenic_scene)
        return scene, object_parameters(self._terrain_names, scenic_scene)

    def scenic_scene(self, k: int) -> Any:
        """Draw sample ``k`` as a Scenic Scene. Raises FoldcarError like :meth:`sample`."""
        from scenic.core.distributions import RejectionException

        if k < 0:
            raise FoldcarError(f"{self.program}: sample {k} is below the minimum 0")
        place = f"{self.program}: sample {k}"
        self._translate()
        try:
            with self._drawing(k):
                scene, _ = self.scenario.generate(maxIterations=MAX_ITERATIONS, verbosity=0)
        except RejectionException:
            raise FoldcarError(
                f"{place}: Scenic rejected all {MAX_ITERATIONS} tries, "
                f"the last because of {self._rejection_reason(k)}; relax the program's requirements"
            ) from None
        except FoldcarError:
            raise
        except Exception as error:
            raise ProgramError(place, error, self.program) from error
        # In a simulation, Scenic would check all of these requirements once more, also soft ones that this sample need
        # not fulfil. So keep only those on the course of a run.
        requirements_on_runs = []
        for requirement in scene.temporalRequirements:
            if requirement.proposition.has_temporal_operator:
                requirements_on_runs.append(requirement)
        scene.temporalRequirements = tuple(requirements_on_runs)
        return scene

    def _translate(self) -> None:
        """Translate the program before its first sample is drawn, because sampling replaces its names' values."""
        _ = self._translation

    def describe(self, scene: Any, k: int) -> dict[str, Any]:
        """Return the "scene" object of docs/carsim.md for sample ``k``'s Scene. Raises FoldcarError."""
        return self._with_obstacles(scene, k)[0]

    def sample_with_obstacles(self, k: int) -> tuple[dict[str, Any], list[Obstacle]]:
        """Return what :meth:`sample` returns, and the obstacles."""
        return self._with_obstacles(self.scenic_scene(k), k)

    def terrain_objects(self) -> list[tuple[str, int]]:
        """Return name and number of pieces of each terrain object, in sample 0's order. Raises FoldcarError."""
        scene = self.scenic_scene(0)
        with self._drawing(k=0, stream=PIECES):
            return terrain_objects(self.scenario, scene)

    @contextlib.contextmanager
    def _drawing(self, k: int, stream: str = "") -> Iterator[None]:
        """Run the program's code in the block, to draw sample ``k``. Its random values depend on ``k`` and ``stream``."""
        place = f"{self.program}: sample {k}"
        with (
            seeded(f"{self.seed}/{k}{stream}"),
            self.files.inside(),
            contained(SAMPLE_LIMIT_S, place, self.program),
        ):
            yield

    def _with_obstacles(self, scene: Any, k: int) -> tuple[dict[str, Any], list[Obstacle]]:
        """Convert sample ``k``, a Scene of Scenic, to a "scene" object of docs/carsim.md. Return it and its obstacles."""
        with self._drawing(k, stream=PIECES):
            return scene_with_obstacles(
                scene,
                self.program,
                where=f"sample {k}",
                needs_goal=not may_end_itself(self.scenario),
                native=self._translation.program,
            )

    def _rejection_reason(self, k: int) -> str:
        """Generate the scene of sample ``k`` once more, and return Scenic's reason for rejecting it.

        Scenic only prints the reason, as "… because of REASON". If it prints none, the result says "its requirements".
        """
        from scenic.core.distributions import RejectionException

        output = io.StringIO()
        with (
            seeded(f"{self.seed}/{k}"),
            self.files.inside(),
            contextlib.redirect_stdout(output),
            contextlib.suppress(RejectionException),
        ):
            self.scenario.generate(maxIterations=1, verbosity=2)
        reason = " ".join(output.getvalue().rpartition("because of")[2].split())
        return overlap_hint(reason or "its requirements")


def open_environment(
    program: Path,
    params: Mapping[str, Any],
    seed: int,
    condition: Mapping[str, Any] | None = None,
    files: Files | None = None,
) -> SceneSource:
    """Compile a Scenic program and return the source of its scenes.

    ``params`` replace the program's own parameters. ``files`` are the files that the program must consist of, as
    fixed_files returns them; None allows any files.

    ``condition`` freezes parts of the environment at their values in one of its samples. It has the keys "sample" (its
    number), "objects" and "params" (names). Without "objects" and "params", everything is frozen.

    Raises FoldcarError of one line if the file is missing or does not compile, or if a parameter or a name is unknown or
    of the wrong type.
    """
    with seeded(f"{seed}/compile"):
        program_files = ProgramFiles(program, files)
        states_before = _generator_states()
        scenario = compile_program(program, params, program_files)
        # A random value that is drawn when the program is compiled is the same in all samples. Users are warned of it.
        has_drawn = _generator_states() != states_before
    source = SceneSource(program, program_files, scenario, seed)
    source.has_drawn_early = has_drawn
    if files is None:
        # The program is new. An earlier sweep has checked a program whose files are known.
        source._open_again = partial(open_environment, program, params, seed, condition)
    if condition is not None:
        from foldcar.scenes.conditioning import condition as freeze

        scene = source.scenic_scene(condition["sample"])
        try:
            freeze(scenario, scene, condition.get("objects"), condition.get("params"))
        except FoldcarError as error:
            raise FoldcarError(f"{program}: {error}") from None
    return source


def other_scene_error(program: Path, k: int) -> FoldcarError:
    """Return the error for a sample ``k`` that differs from the first draw."""
    return FoldcarError(
        f"{program}: sample {k} is another scene now than when it was first drawn: the program depends on more than its "
        "parameters, its seed and the files that it reads: on a random generator of its own, on the order of a set, or "
        "on the time"
    )


def _generator_states() -> tuple[Any, ...]:
    """Return the states of the global random generators of Python and numpy, for comparison."""
    import numpy

    numpy_state = numpy.random.get_state(legacy=False)
    return random.getstate(), pickle.dumps(numpy_state)


@contextlib.contextmanager
def seeded(text: str) -> Iterator[None]:
    """Within the block, seed the global random generators from ``text`` and redirect stdout to stderr."""
    import numpy

    digest = hashlib.sha256(text.encode()).digest()
    with program_lock:
        python_state, numpy_state = random.getstate(), numpy.random.get_state()
        random.seed(digest)
        numpy.random.seed(numpy.frombuffer(digest, dtype="<u4"))
        try:
            # What a program prints must not mix with results on stdout.
            with contextlib.redirect_stdout(sys.stderr):
                yield
        finally:
            random.setstate(python_state)
            numpy.random.set_state(numpy_state)
