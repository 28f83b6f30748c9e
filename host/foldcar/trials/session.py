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

from foldcar.car.body import body_json
from foldcar.car.design import Design
from foldcar.errors import FoldcarError
from foldcar.link.car import CarIdentity
from foldcar.link.parameters import read_parameters
from foldcar.link.stream import LinkLostError, choose_port
from foldcar.link.tlog import TlogWriter
from foldcar.outputs import file_name_part, make_output_folder
from foldcar.scenes.obstacles import Obstacle
from foldcar.simulation.carsim import Carsim
from foldcar.store.log_files import logs_folder, store_folder
from foldcar.store.trial_records import BUILT, SIMULATED, Ending, TrialDesign
from foldcar.store.trial_writer import CarFacts, Drive, TrialWriter, write_trials
from foldcar.study.environments import Environment
from foldcar.study.experiments import read_study
from foldcar.trials.camera.markers import Course
from foldcar.trials.drive_view import DriveView
from foldcar.trials.driving import CTRL_C, DRIVES_ON, DriveEnd, drive
from foldcar.trials.media import Arrivals, media_kind
from foldcar.trials.order import Standing, moves_text, next_sample, standing
from foldcar.trials.person import IDLE_S, INPUT, Answers, say, warn
from foldcar.trials.placement import ask_deviations, draw_placement, lettered, placed, show_placement
from foldcar.trials.plugged_car import SIMULATED_TEXT, PluggedCar, enter_sample, require_same_car, welcome
from foldcar.trials.recording import OUTCOME_KEYS, OUTCOME_QUESTION, complete_interrupted, record_outcome

MIN_FREE_BYTES = 20_000_000
NEXT, AGAIN, QUIT = "", "r", "q"
NEXT_QUESTION = "Enter: next; u: other outcome; r: the same again; n TEXT: note; m FILE: photo, film; q: end: "
KEPT_KEYS = {"k": "kept", "w": "withdrawn"}
AT_ONCE, DRIVEN_AGAIN = "said at once after the trial", "driven again at once"


@dataclass(frozen=True)
class SessionOptions:
    """What `foldcar log` is told; what is None is asked for or determined during the session, unless ``yes``.

    Photos and films of each trial appear in ``media_folder``.
    """

    listing: Path
    experiment: str
    store: Path
    settings: Mapping[str, float | str]
    sample: int | None
    trials: int | None
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
    media_folder: Path | None = None


@dataclass(frozen=True)
class KnownCar:
    """A car that may drive the trials."""

    identity: CarIdentity
    design: Design


@dataclass(frozen=True)
class _Driven:
    """A trial of the session: what was stored of its end."""

    number: int
    sample: int
    log: Path
    stored: Ending
    end: DriveEnd


class Session:
    """A session; :meth:`run` drives it. All other inputs are read and checked before port and store are opened.

    ``driven`` are the trials' numbers.
    """

    def __init__(self, options: SessionOptions) -> None:
        self._options = options
        (self._experiment,) = read_study(options.listing, options.experiment).experiments
        self._family = self._experiment.family.narrowed(options.settings)
        self._carsim = Carsim()
        self._environment = Environment(self._experiment)
        self._answers = Answers(self._idle)
        self._asked = None if options.yes else self._answers
        self._plugged = PluggedCar()
        self._drawn: set[tuple[int, str]] = set()
        self._scenes: dict[int, tuple[dict[str, Any], dict[str, Obstacle]]] = {}
        # Where obstacles stand since the last trial, and the sample that is to be driven again.
        self._standing: Standing | None = None
        self._again: int | None = None
        self._repeated = 0
        self._arrivals = Arrivals(options.media_folder)
        self.driven: list[int] = []

    def run(self, named_port: str | None) -> None:
        """Drive trials up to the requested number or until the person ends. FoldcarError."""
        options = self._options
        self._plugged.connect(choose_port(named_port))
        try:
            known = self._welcome()
            with write_trials(options.store) as writer:
                complete_interrupted(writer)
                while options.trials is None or len(self.driven) < options.trials + self._repeated:
                    trial = self._trial(writer, known)
                    if trial is None:
                        break
                    if trial.end.ending == CTRL_C:
                        raise KeyboardInterrupt
                    self._take_media(writer)
                    if trial.end.error is not None:
                        known = self._after_error(trial.end.error)
                    if options.trials is None and options.yes:
                        break
                    if not self._goes_on(writer, trial):
                        break
                self._take_media(writer, wait=True)
        finally:
            self._plugged.close()

    def _welcome(self) -> KnownCar:
        """The car and its design; FoldcarError if it cannot drive the trials."""
        identity, design = welcome(
            self._plugged.connected, self._experiment, self._family, self._carsim, self._asked, self._options.any_build
        )
        if identity.simulated:
            sample = self._options.sample or 0
            enter_sample(self._plugged.connected, self._scene(sample)[0], sample, self._experiment)
        return KnownCar(identity, design)

    def _goes_on(self, writer: TrialWriter, trial: "_Driven") -> bool:
        """Ask what to do after a trial, and do it; whether the session goes on.

        Another outcome is a correction, so that the first one stays known.
        """
        options, asked, number, stored = self._options, self._asked, trial.number, trial.stored
        self._again = None
        if asked is None or None not in (options.outcome, options.note):
            return True
        while True:
            what, _, words = asked.line(NEXT_QUESTION).partition(" ")
            words = words.strip()
            try:
                if what in (NEXT, QUIT) and not words:
                    return what == NEXT
                if what == AGAIN and not words:
                    question = f"Trial {number} is (k)ept or (w)ithdrawn [kept]: "
                    if asked.choice(question, KEPT_KEYS, "kept") == "withdrawn":
                        writer.withdraw([number], True, DRIVEN_AGAIN, options.operator)
                    self._again = trial.sample
                    self._repeated += 1
                    return True
                if what == "u" and not words:
                    outcome = asked.choice(f"{OUTCOME_QUESTION} [{stored.outcome}]: ", OUTCOME_KEYS, stored.outcome)
                    if outcome != stored.outcome:
                        writer.correct(number, {"outcome": outcome}, AT_ONCE, options.operator)
                        stored = replace(stored, outcome=outcome)
                    say(f"Trial {number}: {outcome}")
                elif what == "n" and words:
                    stored = replace(stored, note=f"{stored.note}; {words}" if stored.note else words)
                    writer.complete(number, stored)
                    say(f"Trial {number}: {stored.note}")
                elif what == "m" and words:
                    self._attach(writer, number, Path(words).expanduser())
                else:
                    say("  type Enter, u, r, q, n and a note, or m and a file")
            except FoldcarError as error:
                warn(error)

    def _attach(self, writer: TrialWriter, number: int, file: Path) -> None:
        kind = media_kind(file)
        while self._arrivals.is_growing(file):
            self._idle()
            time.sleep(IDLE_S)
        made = writer.put_media(number, kind, file)
        say(f"Trial {number}: {made.kind} {file}")

    def _take_media(self, writer: TrialWriter, wait: bool = False) -> None:
        """Attach what has come to the folder; ``wait`` for what still grows. Ctrl-C ends the waiting."""
        while wait and (growing := self._arrivals.growing()):
            say(f"waiting for {', '.join(file.name for file in growing)}, until it grows no more")
            while self._arrivals.growing() == growing:
                self._idle()
                time.sleep(IDLE_S)
        for number, file in self._arrivals.take():
            try:
                if number not in self.driven:
                    raise FoldcarError(f"{file}: belongs to no trial: trial {number} was not driven")
                self._attach(writer, number, file)
            except FoldcarError as error:
                # The session matters more than a file that has gone.
                warn(error)

    def _trial(self, writer: TrialWriter, known: KnownCar) -> "_Driven | None":
        """Drive one trial; None if the person ends the session."""
        options, experiment, identity, design = self._options, self._experiment, known.identity, known.design
        trial_design, fingerprint = TrialDesign(design.type, design.columns), self._environment.fingerprint
        sample = options.sample if options.sample is not None else self._again
        if sample is None:
            kind = SIMULATED if identity.simulated else BUILT
            counts = writer.trial_counts(experiment.id, trial_design, fingerprint, kind)
            sample = next_sample(experiment.environments, counts, self._standing, lambda k: standing(*self._scene(k), {}))
        mark = f" ({SIMULATED_TEXT})" if identity.simulated else ""
        number = writer.next_number()
        say(f"\nTrial {number}: sample {sample} of experiment {experiment.id}{mark}")
        self._take_media(writer)
        self._arrivals.begin(number)
        scene, things = self._scene(sample)
        if identity.simulated:
            enter_sample(self._plugged.connected, scene, sample, experiment)
        moves = "" if self._standing is None else moves_text(self._standing, standing(scene, things, {}))
        show_placement(scene, things)
        if moves:
            say(f"after trial {self.driven[-1]}: {moves}; the car goes back to its place")
        if not options.yes:
            self._draw(sample, known)
        deviations = ask_deviations(self._asked, things, options.deviations)
        if not options.yes and self._answers.line("Enter starts the countdown, q ends: ").lower() == "q":
            return None
        body = body_json(design)
        settings = experiment.settings(design, body, self._carsim.parameter_table())
        # Cars may be exchanged between two trials, without a lost link.
        require_same_car(self._plugged.connected, identity)
        log = self._log_file(number)
        car = None if identity.simulated is None else SIMULATED if identity.simulated else BUILT
        if identity.simulated and deviations:
            say("the simulated car meets its scene as planned: the deviations are kept, but not simulated")
        begun = writer.begin(
            experiment.id,
            trial_design,
            Drive(body, settings, placed(scene, things, deviations), fingerprint, experiment.program_name, sample),
            deviations,
            CarFacts(identity.build, identity.hash, self._plugged.connected.port, car, options.car),
            str(log.relative_to(store_folder(options.store))),
            options.operator,
        )
        self.driven.append(begun)
        self._standing = standing(scene, things, deviations)
        end = self._drive(settings, begun, log, identity)
        if end.ending == DRIVES_ON:
            end = self._plugged.collect(begun, log, settings["time_limit_s"], self._asked, identity)
        stored = record_outcome(writer, begun, end, log, options.outcome, options.note, self._asked, mark)
        return _Driven(begun, sample, log, stored, end)

    def _drive(self, settings: dict[str, Any], number: int, log: Path, identity: CarIdentity) -> DriveEnd:
        car, options, limit_s = self._plugged.connected, self._options, settings["time_limit_s"]
        say(f"Countdown {options.countdown_s} s, then {limit_s:g} s at most. Ctrl-C stops.")
        try:
            with contextlib.closing(TlogWriter(log)) as writer:
                car.connection.catch_up()
                car.connection.log = writer
                # The log then contains the car's identity and settings.
                require_same_car(car, identity)
                for message in ("AUTOPILOT_VERSION", "SYS_STATUS"):
                    car.request(message)
                read_parameters(car)
                other_input = INPUT if self._answers.is_terminal else None
                view = DriveView(options.countdown_s, limit_s, other_input)
                with self._answers.keys() as pressed, view.watching(pressed):
                    end = drive(car, settings, number, options.countdown_s, view, options.untethered)
                return replace(end, outcome="passed") if view.passed and end.outcome is None else end
        except FoldcarError as error:
            ending = "link lost before the start" if isinstance(error, LinkLostError) else "not begun"
            return DriveEnd(ending, "aborted", None, error)
        finally:
            car.connection.log = None

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
                self._plugged.connect_again(typed)
                return self._welcome()
            except FoldcarError as again:
                warn(again)

    def _scene(self, sample: int) -> tuple[dict[str, Any], dict[str, Obstacle]]:
        """A sample's scene and its lettered obstacles."""
        if sample not in self._scenes:
            scene, obstacles = self._environment.sample_with_obstacles(sample)
            self._scenes[sample] = scene, lettered(obstacles)
        return self._scenes[sample]

    def _draw(self, sample: int, known: KnownCar) -> None:
        """Draw where things stand, once for each sample and car, and say where the picture is."""
        picture = self._logs / f"place-{file_name_part(self._experiment.id)}-{sample}.png"
        if (sample, known.identity.hash) not in self._drawn:
            title = f"Sample {sample}: where to put car and obstacles"
            draw_placement(*self._scene(sample), known.design, self._carsim, picture, title, self._options.course)
            self._drawn.add((sample, known.identity.hash))
        say(f"picture: {picture}")

    @cached_property
    def _logs(self) -> Path:
        return logs_folder(self._options.store)

    def _log_file(self, number: int) -> Path:
        make_output_folder(self._logs)
        free = shutil.disk_usage(self._logs).free
        if free < MIN_FREE_BYTES:
            raise FoldcarError(f"{self._logs}: only {free / 1e6:.0f} MB are free for the log; make room first")
        now = datetime.now(timezone.utc).strftime("%Y%m%dT%H%M%SZ")
        return self._logs / f"trial-{number:04d}-{now}.tlog"

    def _idle(self) -> None:
        """Keep the link alive while the person types; a lost link is reported by the next command."""
        if self._plugged.car is not None:
            with contextlib.suppress(LinkLostError):
                self._plugged.car.connection.receive(0.0)
