"""A session of trials with one car: check its identity, then for each trial place, arm, drive and record.

Input: a listing's experiment, options, a port. Output: trials in the store. A trial's row is stored before the car is
armed, and completed step by step. If the program is killed, at most the answer that is being typed is lost.
"""

import contextlib
import json
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
from foldcar.link.car import CarIdentity, CommandRefusedError, NoCarError
from foldcar.link.parameters import read_parameters
from foldcar.link.stream import LinkLostError, choose_port
from foldcar.link.tlog import LogError, TlogWriter
from foldcar.outputs import file_name_part, make_output_folder
from foldcar.scenes.obstacles import Obstacle
from foldcar.scenes.source import other_scene_error
from foldcar.shown_text import shown_line
from foldcar.simulation.carsim import Carsim
from foldcar.store.log_files import logs_folder, store_folder
from foldcar.store.trial_records import BUILT, SIMULATED, Ending, TrialDesign
from foldcar.store.trial_writer import CarFacts, Drive, TrialWriter, write_trials
from foldcar.store.writer import canonical_json
from foldcar.study.environments import ExperimentEnvironment
from foldcar.study.experiments import read_study
from foldcar.trials.drive_view import DriveView
from foldcar.trials.driving import CTRL_C, DRIVES_ON, DriveEnd, drive
from foldcar.trials.faults import CarFaultError, acknowledge_faults
from foldcar.trials.media import Arrivals, media_kind
from foldcar.trials.order import Arrangement, arrangement_of, moves_text, next_sample
from foldcar.trials.person import IDLE_S, PersonAnswers, print_line, print_warning
from foldcar.trials.placement import ask_deviations, draw_placement, lettered, scene_as_placed, show_placement
from foldcar.trials.plugged_car import SIMULATED_TEXT, PluggedCar, enter_sample, require_same_car, welcome
from foldcar.trials.recording import OUTCOME_KEYS, OUTCOME_QUESTION, complete_interrupted, record_outcome, store_end

MIN_FREE_BYTES = 20_000_000
NEXT, REPEAT, QUIT = "", "r", "q"
NEXT_QUESTION = "Enter: next; u: other outcome; r: the same again; n TEXT: note; m FILE: photo, film; q: end: "
KEPT_KEYS = {"k": "kept", "w": "withdrawn"}
CORRECTED_AT_ONCE, REPEATED_AT_ONCE = "said at once after the trial", "driven again at once"


@dataclass(frozen=True)
class SessionOptions:
    """The options of `foldcar log`; those that are None are asked for or chosen in the session, unless ``yes``."""

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
    button: bool
    any_build: bool
    yes: bool
    car: str | None = None
    media_folder: Path | None = None  # a phone puts photos and films of each trial here


@dataclass(frozen=True)
class CheckedCar:
    """A car that has been checked and may drive the trials."""

    identity: CarIdentity
    design: Design


@dataclass(frozen=True)
class _Driven:
    """A driven trial of the session, with its end as it was stored."""

    number: int
    sample: int
    log: Path
    stored: Ending
    end: DriveEnd


class Session:
    """A session; :meth:`run` drives its trials. Inputs are read and checked before port and store are opened.

    ``driven`` are the numbers of the trials.
    """

    def __init__(self, options: SessionOptions) -> None:
        self._options = options
        (self._experiment,) = read_study(options.listing, options.experiment).experiments
        self._family = self._experiment.family.narrowed(options.settings)
        # Remarks on chosen values that the sweep's family does not have.
        self.unlisted_values = self._experiment.family.outside(options.settings)
        self._carsim = Carsim()
        self._environment = ExperimentEnvironment(self._experiment)
        self._answers = PersonAnswers(self._idle)
        self._questions = None if options.yes else self._answers
        self._plugged = PluggedCar()
        # The samples whose placement was drawn, each with the hash of the car.
        self._drawn: set[tuple[int, str]] = set()
        # Scene and obstacles by sample.
        self._scenes: dict[int, tuple[dict[str, Any], dict[str, Obstacle]]] = {}
        # Where the obstacles stand since the last trial; None if this is unknown.
        self._arrangement: Arrangement | None = None
        # The sample to drive again; None if the next one is driven.
        self._again: int | None = None
        self._arrivals = Arrivals(options.media_folder)
        self.driven: list[int] = []
        # How many trials repeat an earlier one; these are driven in addition to the requested number.
        self._repeated = 0
        # How many trials were aborted: by a fault, a lost link, another error, or before the start.
        self.aborted = 0

    def run(self, named_port: str | None) -> None:
        """Drive trials until their number is reached, or until the person ends the session.

        ``named_port`` is the port of the car; None means the only port with a board. Raises FoldcarError.
        """
        options = self._options
        self._plugged.connect(choose_port(named_port))
        try:
            checked_car = self._welcome()
            with write_trials(options.store) as writer:
                complete_interrupted(writer)
                while options.trials is None or len(self.driven) < options.trials + self._repeated:
                    try:
                        trial = self._trial(writer, checked_car)
                    except (LinkLostError, NoCarError) as error:
                        # The car was lost before the trial began.
                        checked_car = self._after_error(error, checked_car)
                        continue
                    if trial is None:
                        break
                    if trial.end.ending == CTRL_C:
                        raise KeyboardInterrupt
                    self._take_media(writer)
                    if trial.end.error is not None:
                        checked_car = self._after_error(trial.end.error, checked_car)
                    # If nobody may be asked and no number of trials is given, the session is one trial.
                    if options.trials is None and options.yes:
                        break
                    if not self._ask_what_next(writer, trial):
                        break
                self._take_media(writer, wait=True)
            self._plugged.offer_to_erase_logs(options.store, self._questions)
        finally:
            self._plugged.close()

    def _welcome(self) -> CheckedCar:
        """Check the car; return it with its design. Raises FoldcarError if it cannot drive the trials."""
        identity, design = welcome(
            self._plugged.connected,
            self._experiment,
            self._family,
            self._carsim,
            self._questions,
            self._options.any_build,
        )
        if identity.simulated:
            sample = self._options.sample or 0
            scene, _ = self._scene(sample)
            enter_sample(self._plugged.connected, scene, sample, self._experiment)
        return CheckedCar(identity, design)

    def _ask_what_next(self, writer: TrialWriter, trial: "_Driven") -> bool:
        """Ask what to do after a trial, and do it, until the answer is to go on or to end the session.

        Return whether the session goes on. A changed outcome is stored as a correction, so that the first one is kept.
        """
        options, answers, number, ending = self._options, self._questions, trial.number, trial.stored
        self._again = None
        # Nobody is asked if the options give outcome and note of all trials.
        if answers is None or None not in (options.outcome, options.note):
            return True
        while True:
            key, _, argument = answers.line(NEXT_QUESTION).partition(" ")
            argument = argument.strip()
            try:
                if key in (NEXT, QUIT) and not argument:
                    return key == NEXT
                if key == REPEAT and not argument:
                    question = f"Trial {number} is (k)ept or (w)ithdrawn [kept]: "
                    if answers.choice(question, KEPT_KEYS, "kept") == "withdrawn":
                        writer.withdraw([number], withdrawn=True, reason=REPEATED_AT_ONCE, operator=options.operator)
                    self._again = trial.sample
                    self._repeated += 1
                    return True
                # The key "u" changes the outcome, "n" adds to the note, and "m" attaches a file.
                if key == "u" and not argument:
                    outcome = answers.choice(f"{OUTCOME_QUESTION} [{ending.outcome}]: ", OUTCOME_KEYS, ending.outcome)
                    if outcome != ending.outcome:
                        writer.correct(number, {"outcome": outcome}, CORRECTED_AT_ONCE, options.operator)
                        ending = replace(ending, outcome=outcome)
                    print_line(f"Trial {number}: {outcome}")
                elif key == "n" and argument:
                    ending = replace(ending, note=f"{ending.note}; {argument}" if ending.note else argument)
                    writer.complete(number, ending)
                    print_line(f"Trial {number}: {ending.note}")
                elif key == "m" and argument:
                    self._attach(writer, number, Path(argument).expanduser())
                else:
                    print_line("  type Enter, u, r, q, n and a note, or m and a file")
            except FoldcarError as error:
                print_warning(error)

    def _attach(self, writer: TrialWriter, number: int, file: Path) -> None:
        """Add a photo or film to trial ``number`` as soon as the file has stopped growing."""
        kind = media_kind(file)
        while self._arrivals.is_growing(file):
            self._idle()
            time.sleep(IDLE_S)
        record = writer.put_media(number, kind, file)
        print_line(f"Trial {number}: {record.kind} {shown_line(str(file))}")

    def _take_media(self, writer: TrialWriter, wait: bool = False) -> None:
        """Attach new files of the folder to their trials; if ``wait``, wait for files that grow, until Ctrl-C."""
        while wait and (growing := self._arrivals.growing()):
            print_line(f"waiting until {', '.join(shown_line(file.name) for file in growing)} stops growing")
            while self._arrivals.growing() == growing:
                self._idle()
                time.sleep(IDLE_S)
        for number, file in self._arrivals.take():
            try:
                if number not in self.driven:
                    raise FoldcarError(f"{file}: belongs to no trial: trial {number} was not driven")
                self._attach(writer, number, file)
            except FoldcarError as error:
                # A missing file must not end the session.
                print_warning(error)

    def _trial(self, writer: TrialWriter, checked_car: CheckedCar) -> "_Driven | None":
        """Place, drive and store one trial; return it, or None if the person ends the session before the start."""
        options, experiment, identity, design = self._options, self._experiment, checked_car.identity, checked_car.design
        trial_design, fingerprint = TrialDesign(design.type, design.columns), self._environment.fingerprint
        sample = options.sample if options.sample is not None else self._again
        if sample is None:
            kind = SIMULATED if identity.simulated else BUILT
            counts = writer.trial_counts(experiment.id, trial_design, fingerprint, kind)
            sample = next_sample(
                experiment.environments,
                counts,
                current=self._arrangement,
                arrangement_in_sample=lambda k: arrangement_of(*self._scene(k), {}),
            )
        mark = f" ({SIMULATED_TEXT})" if identity.simulated else ""
        number = writer.next_number()
        print_line(f"\nTrial {number}: sample {sample} of experiment {experiment.id}{mark}")
        self._take_media(writer)
        self._arrivals.begin(number)
        scene, obstacles = self._scene(sample)
        if writer.swept_scene(fingerprint, sample) not in (None, json.loads(canonical_json(scene))):
            raise other_scene_error(experiment.program, sample)
        acknowledge_faults(self._plugged.connected, self._questions)
        if identity.simulated:
            enter_sample(self._plugged.connected, scene, sample, experiment)
        show_placement(scene, obstacles)
        if self._arrangement is not None:
            moves = moves_text(self._arrangement, arrangement_of(scene, obstacles, {}))
            print_line(f"after trial {self.driven[-1]}: {moves}; the car goes back to its place")
        if not options.yes:
            self._draw(sample, checked_car)
        deviations = ask_deviations(self._questions, obstacles, options.deviations)
        if not options.yes and self._answers.line("Enter starts the countdown, q ends: ").lower() == "q":
            return None
        body = body_json(design)
        settings = experiment.settings(design, body, self._carsim.parameter_table())
        # The car may be exchanged between two trials without a lost link.
        require_same_car(self._plugged.connected, identity)
        acknowledge_faults(self._plugged.connected, self._questions)
        log = self._log_file(number)
        car_kind = {True: SIMULATED, False: BUILT, None: None}[identity.simulated]
        if identity.simulated and deviations:
            print_line("the simulated car drives in the planned scene: the deviations are stored, but not simulated")
        placed_scene = scene_as_placed(scene, obstacles, deviations)
        if deviations and not self._environment.dynamic:
            writer.put_planned_scene(fingerprint, sample, *self._environment.sample_with_parameters(sample))
        trial_number = writer.begin(
            experiment.id,
            trial_design,
            Drive(
                body,
                settings,
                scene=placed_scene,
                environment_fingerprint=fingerprint,
                scenic_program=experiment.program_name,
                sample=sample,
                dynamic=self._environment.dynamic,
            ),
            deviations,
            CarFacts(identity.build, identity.hash, self._plugged.connected.port, car_kind, options.car),
            str(log.relative_to(store_folder(options.store))),
            options.operator,
        )
        self.driven.append(trial_number)
        self._arrangement = arrangement_of(scene, obstacles, deviations)
        view = DriveView(options.countdown_s, settings["time_limit_s"], self._answers.waitable)
        end, faults = self._drive(settings, trial_number, log, identity, view)
        if end.ending == DRIVES_ON:
            view.wait_for_terminal()
            longest_s = options.countdown_s + settings["time_limit_s"]
            end = self._plugged.collect(trial_number, log, longest_s, self._questions, identity)
        digest = store_end(writer, trial_number, end, log)
        view.wait_for_terminal()
        if end.error is None:
            for fault in faults:
                print_line(f"After the end the car had a fault, which is acknowledged: {fault}")
        stored = record_outcome(
            writer, trial_number, end, log, digest, options.outcome, options.note, self._questions, mark
        )
        self.aborted += end.outcome == stored.outcome == "aborted"
        return _Driven(trial_number, sample, log, stored, end)

    def _drive(
        self, settings: dict[str, Any], number: int, log: Path, identity: CarIdentity, view: DriveView
    ) -> tuple[DriveEnd, list[str]]:
        """Drive one trial and write its log. Return how it ended, and the faults that the car had afterwards.

        These faults are acknowledged, so that the car can drive the next trial.
        """
        car, options, limit_s = self._plugged.connected, self._options, settings["time_limit_s"]
        begins = "From the car's button on, it counts" if options.button else "Countdown"
        print_line(f"{begins} {options.countdown_s} s, then {limit_s:g} s at most. Ctrl-C stops.")
        faults: list[str] = []
        try:
            with contextlib.closing(TlogWriter(log)) as writer:
                car.connection.catch_up()
                car.connection.log = writer
                # The answers to these requests put the car's identity and settings into the log.
                require_same_car(car, identity)
                for message in ("AUTOPILOT_VERSION", "SYS_STATUS"):
                    car.request(message)
                read_parameters(car)
                with self._answers.keys() as pressed, view.watching(car, pressed):
                    end = drive(car, settings, number, options.countdown_s, view, options.untethered, options.button)
                    can_ask_car = end.ending != DRIVES_ON and not isinstance(end.error, (LinkLostError, LogError))
                    if can_ask_car:
                        # A fault after the end belongs to this trial, but does not change its outcome.
                        with contextlib.suppress(FoldcarError):
                            faults = acknowledge_faults(car)
                if view.passed and end.outcome is None:
                    end = replace(end, outcome="passed")
                return end, faults
        except FoldcarError as error:
            ending = "link lost before the start" if isinstance(error, LinkLostError) else "not begun"
            return DriveEnd(ending, "aborted", None, error), faults
        finally:
            car.connection.log = None

    def _after_error(self, error: FoldcarError, checked_car: CheckedCar) -> CheckedCar:
        """Print the error that aborted a trial, and return the car for the next trial.

        After a fault of the car the session goes on. After a command that the car has refused it goes on, too, if there
        is a person who has read the error. If the link is lost, the person plugs the car in again, and the car is
        checked again. In all other cases, or if the person ends the session, this raises ``error``.
        """
        has_person = not self._options.yes and self._answers.is_terminal
        if isinstance(error, CarFaultError) or (has_person and isinstance(error, CommandRefusedError)):
            print_warning(error)
            return checked_car
        if not has_person or not isinstance(error, (LinkLostError, NoCarError)):
            raise error
        print_warning(error)
        while True:
            typed_port = self._answers.line("Plug the car in and press Enter, or type its port; q ends: ")
            if typed_port.lower() == "q":
                raise error
            try:
                self._plugged.connect_again(typed_port)
                return self._welcome()
            except FoldcarError as new_error:
                print_warning(new_error)

    def _scene(self, sample: int) -> tuple[dict[str, Any], dict[str, Obstacle]]:
        """Return a sample's scene and its lettered obstacles."""
        if sample not in self._scenes:
            scene, obstacles = self._environment.sample_with_obstacles(sample)
            self._scenes[sample] = scene, lettered(obstacles)
        return self._scenes[sample]

    def _draw(self, sample: int, checked_car: CheckedCar) -> None:
        """Draw where car and obstacles stand, once for each sample and car, and print the picture's path."""
        picture = self._logs / f"place-{file_name_part(self._experiment.id)}-{sample}.png"
        if (sample, checked_car.identity.hash) not in self._drawn:
            title = f"Sample {sample}: where to put car and obstacles"
            draw_placement(*self._scene(sample), checked_car.design, self._carsim, picture, title)
            self._drawn.add((sample, checked_car.identity.hash))
        print_line(f"picture: {picture}")

    @cached_property
    def _logs(self) -> Path:
        """The folder of the logs and pictures, beside the store."""
        return logs_folder(self._options.store)

    def _log_file(self, number: int) -> Path:
        """Return the path of a new log of trial ``number``. Raises FoldcarError if the disk is nearly full."""
        make_output_folder(self._logs)
        disk = shutil.disk_usage(self._logs)
        if disk.free < MIN_FREE_BYTES:
            raise FoldcarError(f"{self._logs}: only {disk.free / 1e6:.0f} MB are free for the log; free some space first")
        now = datetime.now(timezone.utc).strftime("%Y%m%dT%H%M%SZ")
        return self._logs / f"trial-{number:04d}-{now}.tlog"

    def _idle(self) -> None:
        """Keep the link alive while the person types; a lost link is reported by the next command."""
        if self._plugged.car is not None:
            with contextlib.suppress(LinkLostError):
                self._plugged.car.connection.receive(0.0)
