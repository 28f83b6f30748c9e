"""A session of trials with one car: check its identity, then for each trial place, arm, drive and record.

Input: a listing's experiment, options, a port. Output: trials in the store. The row of a trial is in the store before
the car is armed and is completed step by step, so that a killed program loses at most the answer being typed.
"""

import contextlib
import shutil
import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from datetime import datetime, timezone
from functools import cached_property
from pathlib import Path
from typing import Any

from foldcar.camera.markers import Course
from foldcar.car.body import body_json
from foldcar.car.design import Design
from foldcar.errors import FoldcarError
from foldcar.interrupts import at_once
from foldcar.link.car import Car, CarIdentity, greet
from foldcar.link.parameters import read_parameters
from foldcar.link.ports import SERIAL_PATHS, choose_port
from foldcar.link.stream import LinkLostError
from foldcar.link.tlog import TlogWriter
from foldcar.outputs import make_output_folder
from foldcar.scenes.obstacles import Obstacle
from foldcar.simulation.carsim import Carsim
from foldcar.store.errors import StoreError
from foldcar.store.kept_work import keep_trial, kept_trial, take_in_trial
from foldcar.store.log_files import log_file, logs_folder, sha256_of
from foldcar.store.trial_records import BUILT, INTERRUPTED, SIMULATED, Ending, TrialDesign, not_entered
from foldcar.store.trial_writer import CarFacts, Drive, TrialWriter, write_trials
from foldcar.study.environments import Environment
from foldcar.study.experiments import read_study
from foldcar.trials.driving import CTRL_C, DRIVES_ON, DriveEnd, collect, drive
from foldcar.trials.identity import SIMULATED_TEXT, least_tried, simulated_sample, welcome
from foldcar.trials.person import INPUT, Answers, DriveView, say, warn
from foldcar.trials.placement import ask_deviations, draw_placement, instructions, lettered, placed, show_placement
from foldcar.trials.running import RunningTrial

LEAST_FREE_BYTES = 20_000_000
# With `yes`, how long to wait for an untethered car after its time limit.
COMES_BACK_S = 60.0
OUTCOME_KEYS = {
    "p": "passed",
    "t": "tipped",
    "s": "stuck",
    "o": "off_course",
    "i": "timeout",
    "n": "not_passed",
    "a": "aborted",
}
OUTCOME_QUESTION = "Outcome: (p)assed, (t)ipped, (s)tuck, (o)ff course, t(i)me limit, (a)borted"


@dataclass(frozen=True)
class SessionOptions:
    """What `foldcar log` is told; what is None is asked for or determined during the session, unless ``yes``."""

    listing: Path
    experiment: str
    store: Path
    settings: Mapping[str, float | str]
    sample: int | None
    trials: int | None
    parameters: Path | None
    deviations: list[str] | None
    outcome: str | None
    note: str | None
    operator: str
    countdown_s: int
    untethered: bool
    any_build: bool
    yes: bool
    course: Course | None = None
    car: str | None = None


@dataclass(frozen=True)
class KnownCar:
    """A car that may drive the trials; ``sample`` is that of a simulated one's scene."""

    identity: CarIdentity
    design: Design
    sample: int | None


class Session:
    """A session; :meth:`run` drives it. All other inputs are read and checked before port and store are opened."""

    def __init__(self, options: SessionOptions) -> None:
        self._options = options
        (self._experiment,) = read_study(options.listing, options.experiment).experiments
        self._family = self._experiment.family.narrowed(options.settings)
        self._carsim = Carsim()
        self._environment = Environment(self._experiment)
        self._answers = Answers(self._idle)
        self._asked = None if options.yes else self._answers
        self._car: Car | None = None
        self._port = ""
        self._running = RunningTrial(options.store)
        self._drawn: set[tuple[str, str]] = set()
        self._scenes: dict[int, tuple[dict[str, Any], dict[str, Obstacle]]] = {}

    def run(self, named_port: str | None) -> int:
        """Drive trials up to the requested number or until the person ends, and return their number. FoldcarError."""
        options = self._options
        self._connect(choose_port(named_port))
        try:
            known = self._welcome()
            with write_trials(options.store) as writer:
                self._complete_interrupted(writer)
                driven = 0
                while options.trials is None or driven < options.trials:
                    end = self._trial(writer, known)
                    if end is None:
                        break
                    driven += 1
                    if end.ending == CTRL_C:
                        raise KeyboardInterrupt
                    if end.error is not None:
                        known = self._after_error(end.error)
                    if options.trials is None and options.yes:
                        break
                return driven
        finally:
            self._running.close()
            self._disconnect()

    def _connect(self, port: str) -> None:
        self._car, self._port = greet(port), port

    def _disconnect(self) -> None:
        """Close the connection, which nothing must use any more."""
        car, self._car = self._car, None
        if car is not None:
            car.connection.close()

    @property
    def _connected(self) -> Car:
        assert self._car is not None
        return self._car

    def _welcome(self) -> KnownCar:
        """The car, its design, and a simulated car's sample; FoldcarError if it cannot drive the trials."""
        options, experiment = self._options, self._experiment
        identity, design = welcome(
            self._connected, experiment, self._family, self._carsim, self._asked, options.parameters, options.any_build
        )
        sample = None
        if identity.scene is not None:
            sample = simulated_sample(identity.scene, options.sample, lambda k: self._scene(k)[0], experiment)
        return KnownCar(identity, design, sample)

    def _trial(self, writer: TrialWriter, known: KnownCar) -> DriveEnd | None:
        """Drive one trial; None if the person ends the session."""
        options, experiment, identity, design = self._options, self._experiment, known.identity, known.design
        trial_design, fingerprint = TrialDesign(design.type, design.columns), self._environment.fingerprint
        sample = options.sample if known.sample is None else known.sample
        if sample is None:
            counts = writer.trial_counts(experiment.id, trial_design, fingerprint)
            sample = least_tried(experiment.environments, counts)
        mark = f" ({SIMULATED_TEXT})" if identity.simulated else ""
        number = writer.next_number()
        say(f"\nTrial {number}: sample {sample} of experiment {experiment.id}{mark}")
        scene, things = self._scene(sample)
        rows = list(instructions(scene, things))
        self._running.begin(number, sample, identity.name or design.type, experiment.timeout_s, rows)
        # matplotlib would swallow a signal.
        with at_once():
            show_placement(scene, things)
            if not options.yes:
                self._draw(sample, known)
        deviations = ask_deviations(self._asked, things, options.deviations)
        if not options.yes and self._answers.line("Enter starts the countdown, q ends: ").lower() == "q":
            return None
        body = body_json(design)
        settings = experiment.settings(design, body, self._carsim.parameter_table())
        self._running.show(self._car, placed=True)
        log = self._log_file(number)
        car = None if identity.simulated is None else SIMULATED if identity.simulated else BUILT
        if identity.simulated and deviations:
            say("the simulated car meets its scene as planned: the deviations are kept, but not simulated")
        begun = writer.begin(
            experiment.id,
            trial_design,
            Drive(body, settings, placed(scene, things, deviations), fingerprint, experiment.program_name, sample),
            deviations,
            CarFacts(identity.build, identity.hash, self._connected.port, car, options.car),
            str(log.relative_to(options.store.parent)),
            options.operator,
        )
        end = self._drive(settings, begun, log)
        if end.ending == DRIVES_ON:
            end = self._collect(begun, log, settings["time_limit_s"])
        self._running.show(self._car, ended=end.ending)
        record_outcome(writer, begun, end, log, options.outcome, options.note, self._asked, mark)
        return end

    def _drive(self, settings: dict[str, Any], number: int, log: Path) -> DriveEnd:
        car, options, limit_s = self._connected, self._options, settings["time_limit_s"]
        say(f"Countdown {options.countdown_s} s, then {limit_s:g} s at most. Ctrl-C stops.")
        try:
            with contextlib.closing(TlogWriter(log)) as writer:
                car.connection.catch_up()
                car.connection.log = writer
                # The log then contains the car's identity and settings.
                for message in ("FOLDCAR_DESIGN", "AUTOPILOT_VERSION", "SYS_STATUS"):
                    car.request(message)
                read_parameters(car)
                other_input = INPUT if self._answers.is_terminal else None
                with self._answers.keys() as pressed, DriveView(limit_s, pressed, other_input, self._running) as view:
                    end = drive(car, settings, number, options.countdown_s, view, options.untethered)
                return replace(end, outcome="passed") if view.passed and end.outcome is None else end
        except FoldcarError as error:
            ending = "link lost before the start" if isinstance(error, LinkLostError) else "not begun"
            return DriveEnd(ending, "aborted", None, error)
        finally:
            car.connection.log = None

    def _collect(self, number: int, log: Path, time_limit_s: float) -> DriveEnd:
        """Wait until an untethered car is connected again, and fetch its log."""
        end_s = time.monotonic() + time_limit_s + COMES_BACK_S
        question = "The car drives on. When it has stopped, plug it in and press Enter, or type its port; q gives up: "
        while True:
            typed = "" if self._options.yes else self._answers.line(question)
            if typed.lower() == "q":
                return DriveEnd("did not come back", "aborted", None)
            try:
                self._greet_again(typed)
                if self._connected.state() == self._connected.dialect.FOLDCAR_STATE_RUNNING:
                    raise LinkLostError("the car still drives")
                return collect(self._connected, number, log)
            except FoldcarError as error:
                if not self._options.yes:
                    warn(error)
                elif time.monotonic() > end_s:
                    return DriveEnd("did not come back", "aborted", None, error)
            time.sleep(1.0)

    def _after_error(self, error: FoldcarError) -> KnownCar:
        """After a lost link, wait for a car; raise every other error, and with ``yes`` all errors."""
        if self._options.yes or not self._answers.is_terminal or not isinstance(error, LinkLostError):
            raise error
        warn(error)
        while True:
            typed = self._answers.line("Plug the car in and press Enter, or type its port; q ends: ")
            if typed.lower() == "q":
                raise error
            try:
                self._greet_again(typed)
                return self._welcome()
            except FoldcarError as again:
                warn(again)

    def _greet_again(self, typed: str) -> None:
        """Connect to the car at the typed port, its last one or a new one: a port's name may change after unplugging."""
        port = typed or self._port
        if not typed and port.startswith(SERIAL_PATHS) and not Path(port).exists():
            port = choose_port(None)
        self._disconnect()
        self._connect(port)

    def _scene(self, sample: int) -> tuple[dict[str, Any], dict[str, Obstacle]]:
        """A sample's scene and its lettered obstacles."""
        if sample not in self._scenes:
            scene, obstacles = self._environment.sample_with_obstacles(sample)
            self._scenes[sample] = scene, lettered(obstacles)
        return self._scenes[sample]

    def _draw(self, sample: int, known: KnownCar) -> None:
        """Draw where things stand, once for each sample and car, and say where the picture is."""
        picture = self._logs / f"place-{self._experiment.id}-{sample}.png"
        title = f"Sample {sample}: where to put car and obstacles"
        if known.identity.simulated:
            title = f"Sample {sample}: car and obstacles of the simulated trial"
        if (title, known.identity.hash) not in self._drawn:
            scene = self._scene(sample)
            draw_placement(*scene, known.design, self._carsim, picture, title, self._options.course)
            self._drawn.add((title, known.identity.hash))
        self._running.show(self._car, picture=picture.name)
        say(f"picture: {picture}")

    @cached_property
    def _logs(self) -> Path:
        return logs_folder(self._options.store)

    def _log_file(self, number: int) -> Path:
        make_output_folder(self._logs)
        free = shutil.disk_usage(self._logs).free
        if free < LEAST_FREE_BYTES:
            raise FoldcarError(f"{self._logs}: only {free / 1e6:.0f} MB are free for the log; make room first")
        now = datetime.now(timezone.utc).strftime("%Y%m%dT%H%M%SZ")
        return self._logs / f"trial-{number:04d}-{now}.tlog"

    def _complete_interrupted(self, writer: TrialWriter) -> None:
        for number, log in writer.unfinished():
            kept = kept_trial(self._options.store, number)
            if kept.is_file():
                say(f"{take_in_trial(writer, kept)}: taken in from {kept}")
                continue
            digest = sha256_of(log_file(self._options.store, log))
            writer.complete(number, Ending("aborted", INTERRUPTED, None, "", digest))
            say(f"Trial {number} was interrupted: it counts as aborted; its log is kept")

    def _idle(self) -> None:
        """Keep the link alive while the person types; a lost link is reported by the next command."""
        if self._car is not None:
            with contextlib.suppress(LinkLostError):
                self._car.connection.receive(0.0)
            self._running.show(self._car)


def record_outcome(
    writer: TrialWriter, number: int, end: DriveEnd, log: Path, outcome: str | None, note: str | None,
    answers: Answers | None, mark: str = "",
) -> None:  # fmt: skip
    """Complete the row of trial ``number`` and say so, with the ``mark`` of a simulated car.

    ``outcome`` and ``note`` are asked for where they are None, unless ``answers`` is None. FoldcarError if the outcome
    is unknown and may not be asked for.
    """
    digest = sha256_of(log)
    ending = end.ending if end.outcome else not_entered(end.ending)
    try:
        _complete(writer, number, log, Ending(end.outcome or "aborted", ending, end.elapsed_time_s, "", digest))
    except StoreError as error:
        # The person is asked nevertheless, and the answers are kept too.
        warn(error)
    drove = f" after {end.elapsed_time_s:.2f} s" if end.elapsed_time_s is not None else ""
    say(f"Ended{drove}: {end.ending}")
    outcome = "aborted" if end.error is not None else outcome
    if outcome is None and answers is not None:
        suggested = f" [{end.outcome}]" if end.outcome else ""
        outcome = answers.choice(f"{OUTCOME_QUESTION}{suggested}: ", OUTCOME_KEYS, end.outcome)
    outcome = outcome or end.outcome
    if outcome is None:
        raise FoldcarError(f"trial {number}: {end.ending}: its outcome does not follow; use --outcome with --yes")
    if note is None and answers is not None and end.error is None:
        note = answers.line("Note (Enter for none): ")
    _complete(writer, number, log, Ending(outcome, end.ending, end.elapsed_time_s, note or "", digest))
    say(f"Trial {number}: {outcome}{mark}; log: {log if digest else 'none'}")
    if digest is None and end.error is None:
        raise FoldcarError(f"{log}: is gone: it was deleted or moved; trial {number} is stored without its log")


def _complete(writer: TrialWriter, number: int, log: Path, ending: Ending) -> None:
    """Store the end of a trial. If that fails, keep it in a file beside the store, which the StoreError names."""
    try:
        writer.complete(number, ending)
    except (StoreError, KeyboardInterrupt) as error:
        # Ctrl-C may have ended the wait for another program, or come after the end was stored.
        if isinstance(error, KeyboardInterrupt) and writer.has_ended(number, ending):
            raise
        kept = keep_trial(writer.path, number, str(log.relative_to(writer.path.parent)), ending)
        if isinstance(error, KeyboardInterrupt):
            warn(kept)
            raise
        raise StoreError(f"{error}; {kept}") from error
    kept_trial(writer.path, number).unlink(missing_ok=True)
