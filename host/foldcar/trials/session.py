"""A session of trials with one car: check its identity, then for each trial place, arm, drive and record.

Input: a listing's experiment, options, a port. Output: trials in the store. A trial's row is stored before the car is
armed, and completed step by step. If the program is killed, at most the answer that is being typed is lost.
"""

import contextlib
import json
import shutil
from datetime import datetime, timezone
from functools import cached_property
from pathlib import Path
from typing import Any

from foldcar.car.body import body_json
from foldcar.errors import FoldcarError
from foldcar.link.car import CarIdentity, CommandRefusedError, NoCarError
from foldcar.link.stream import LinkLostError, choose_port
from foldcar.outputs import file_name_part, make_output_folder
from foldcar.scenes.source import other_scene_error
from foldcar.shown_text import shown_line
from foldcar.simulation.carsim import Carsim
from foldcar.store.log_files import logs_folder, store_folder
from foldcar.store.trial_records import BUILT, SIMULATED, TrialDesign
from foldcar.store.trial_writer import CarFacts, Drive, TrialWriter, write_trials
from foldcar.store.writer import canonical_json
from foldcar.study.environments import ExperimentEnvironment
from foldcar.study.experiments import read_study
from foldcar.trials.after_trial import StoredTrial
from foldcar.trials.drive_end import DriveEnd
from foldcar.trials.drive_view import DriveView
from foldcar.trials.driving import CTRL_C, DRIVES_ON
from foldcar.trials.faults import CarFaultError, acknowledge_faults
from foldcar.trials.logged_drive import drive_with_log
from foldcar.trials.media import Arrivals, media_kind
from foldcar.trials.order import Arrangement, arrangement_of, moves_text, next_sample
from foldcar.trials.person import PersonAnswers, print_line, print_warning
from foldcar.trials.placement import (
    Deviations,
    PlannedScene,
    ask_deviations,
    draw_placement,
    lettered,
    scene_as_placed,
    show_placement,
)
from foldcar.trials.plugged_car import SIMULATED_TEXT, PluggedCar, enter_sample, require_same_car, welcome
from foldcar.trials.recording import complete_interrupted, record_outcome, store_end
from foldcar.trials.session_options import CheckedCar, DrivenTrial, SessionOptions

MIN_FREE_BYTES = 20_000_000
# What a person types after a trial. A note and a file follow after their key.
NEXT, OTHER_OUTCOME, REPEAT, NOTE, FILE, QUIT = "", "u", "r", "n", "m", "q"
NEXT_QUESTION = "Enter: next; u: other outcome; r: the same again; n TEXT: note; m FILE: photo, film; q: end: "


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
        # The samples of which a picture for placing the obstacles is drawn, each with the hash of the car in it.
        self._drawn: set[tuple[int, str]] = set()
        # The scenes with the obstacles where they should be placed, by sample.
        self._scenes: dict[int, PlannedScene] = {}
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
        self._plugged.connect(choose_port(named_port))
        try:
            checked_car = self._welcome()
            with write_trials(self._options.store) as writer:
                complete_interrupted(writer)
                self._drive_trials(writer, checked_car)
                self._arrivals.wait_for_growing(self._idle)
                self._attach_new_files(writer)
            self._plugged.offer_to_erase_logs(self._options.store, self._questions)
        finally:
            self._plugged.close()

    def _drive_trials(self, writer: TrialWriter, checked_car: CheckedCar) -> None:
        """Drive trials until their number is reached, or until the person ends the session."""
        goes_on = True
        while goes_on and not self._has_driven_all:
            try:
                trial = self._trial(writer, checked_car)
            except (LinkLostError, NoCarError) as error:
                # The car was lost before the trial began.
                checked_car = self._after_error(error, checked_car)
                continue
            if trial is None:
                # The person has ended the session before the trial started.
                return
            if trial.end.ending == CTRL_C:
                raise KeyboardInterrupt
            self._attach_new_files(writer)
            if trial.end.error is not None:
                checked_car = self._after_error(trial.end.error, checked_car)
            goes_on = self._ask_what_next(writer, trial)

    @property
    def _has_driven_all(self) -> bool:
        """Whether the requested trials were driven. If nobody may be asked, a missing number of trials means one."""
        requested = self._options.trials
        if requested is None:
            return self._options.yes and len(self.driven) > 0
        return len(self.driven) >= requested + self._repeated

    def _welcome(self) -> CheckedCar:
        """Check the plugged car, and return it with its design.

        If the car is simulated, it is also moved to the start of the first sample that it drives. A sample is a scene
        that the experiment's program has drawn at random. Raises FoldcarError if the car cannot drive the trials.
        """
        identity, design = welcome(
            self._plugged.connected,
            self._experiment,
            self._family,
            self._carsim,
            self._questions,
            self._options.any_build,
        )
        if identity.simulated:
            first_sample = self._options.sample or 0
            scene = self._scene(first_sample).scene
            enter_sample(self._plugged.connected, scene, first_sample, self._experiment)
        return CheckedCar(identity, design)

    def _ask_what_next(self, writer: TrialWriter, trial: DrivenTrial) -> bool:
        """Ask what to do after a trial, and do it, until the answer is to go on or to end the session.

        Return whether the session goes on. Nobody is asked if the options give the outcome and the note of all trials.
        """
        options, answers = self._options, self._questions
        self._again = None
        is_all_given = options.outcome is not None and options.note is not None
        if answers is None or is_all_given:
            return True
        stored_trial = StoredTrial(writer, trial.number, trial.stored, options.operator, answers)
        while True:
            key, _, text = answers.line(NEXT_QUESTION).partition(" ")
            text = text.strip()
            try:
                if key == NEXT and not text:
                    return True
                if key == QUIT and not text:
                    return False
                if key == REPEAT and not text:
                    stored_trial.ask_whether_kept()
                    self._again = trial.sample
                    self._repeated += 1
                    return True
                if key == OTHER_OUTCOME and not text:
                    stored_trial.ask_outcome()
                elif key == NOTE and text:
                    stored_trial.add_note(text)
                elif key == FILE and text:
                    self._attach(writer, trial.number, Path(text).expanduser())
                else:
                    print_line("  type Enter, u, r, q, n and a note, or m and a file")
            except FoldcarError as error:
                print_warning(error)

    def _attach(self, writer: TrialWriter, number: int, file: Path) -> None:
        """Add a photo or film to trial ``number`` as soon as the file has stopped growing."""
        kind = media_kind(file)
        self._arrivals.wait_until_complete(file, self._idle)
        record = writer.put_media(number, kind, file)
        print_line(f"Trial {number}: {record.kind} {shown_line(str(file))}")

    def _attach_new_files(self, writer: TrialWriter) -> None:
        """Attach the new complete files of the media folder to their trials; files that still grow are left for later."""
        for number, file in self._arrivals.take():
            try:
                if number not in self.driven:
                    raise FoldcarError(f"{file}: belongs to no trial: trial {number} was not driven")
                self._attach(writer, number, file)
            except FoldcarError as error:
                # A missing file must not end the session.
                print_warning(error)

    def _trial(self, writer: TrialWriter, checked_car: CheckedCar) -> DrivenTrial | None:
        """Place, drive and store one trial; return it, or None if the person ends the session before the start."""
        options, experiment, identity = self._options, self._experiment, checked_car.identity
        sample = self._next_sample(writer, checked_car)
        mark = f" ({SIMULATED_TEXT})" if identity.simulated else ""
        number = writer.next_number()
        print_line(f"\nTrial {number}: sample {sample} of experiment {experiment.id}{mark}")
        self._attach_new_files(writer)
        self._arrivals.begin(number)
        scene, obstacles = self._scene(sample)
        swept_scene = writer.swept_scene(self._environment.fingerprint, sample)
        if swept_scene is not None and swept_scene != json.loads(canonical_json(scene)):
            raise other_scene_error(experiment.program, sample)
        acknowledge_faults(self._plugged.connected, self._questions)
        if identity.simulated:
            enter_sample(self._plugged.connected, scene, sample, experiment)
        self._show_placement(sample, checked_car)
        deviations = ask_deviations(self._questions, obstacles, options.deviations)
        if not options.yes and self._answers.line("Enter starts the countdown, q ends: ").lower() == "q":
            return None
        body = body_json(checked_car.design)
        settings = experiment.settings(checked_car.design, body, self._carsim.parameter_table())
        # The car may be exchanged between two trials without a lost link.
        require_same_car(self._plugged.connected, identity)
        acknowledge_faults(self._plugged.connected, self._questions)
        log = self._log_file(number)
        if identity.simulated and deviations:
            print_line("the simulated car drives in the planned scene: the deviations are stored, but not simulated")
        inputs = Drive(
            body,
            settings,
            scene=scene_as_placed(scene, obstacles, deviations),
            environment_fingerprint=self._environment.fingerprint,
            scenic_program=experiment.program_name,
            sample=sample,
            dynamic=self._environment.dynamic,
        )
        trial_number = self._store_beginning(writer, checked_car, inputs, deviations, log)
        self.driven.append(trial_number)
        self._arrangement = arrangement_of(scene, obstacles, deviations)
        view = DriveView(options.countdown_s, settings["time_limit_s"], self._answers.waitable)
        end = self._drive(identity, settings, trial_number, log, view)
        digest = store_end(writer, trial_number, end, log)
        view.wait_for_terminal()
        if end.error is None:
            for fault in end.later_faults:
                print_line(f"After the end the car had a fault, which is acknowledged: {fault}")
        stored = record_outcome(
            writer, trial_number, end, log, digest, options.outcome, options.note, self._questions, mark
        )
        if end.outcome == "aborted" and stored.outcome == "aborted":
            self.aborted += 1
        return DrivenTrial(trial_number, sample, log, stored, end)

    def _next_sample(self, writer: TrialWriter, checked_car: CheckedCar) -> int:
        """Return the number of the sample, one of the experiment's scenes, that the next trial is driven in.

        It is the sample of the option ``--sample`` or, without this option, the sample of a trial that must be repeated.
        Otherwise it is chosen by the numbers of trials that the design already has in each sample, and so that few
        obstacles have to be moved.
        """
        if self._options.sample is not None:
            return self._options.sample
        if self._again is not None:
            return self._again
        kind = SIMULATED if checked_car.identity.simulated else BUILT
        design = TrialDesign(checked_car.design.type, checked_car.design.columns)
        return next_sample(
            self._experiment.environments,
            writer.trial_counts(self._experiment.id, design, self._environment.fingerprint, kind),
            current=self._arrangement,
            arrangement_in_sample=self._planned_arrangement,
        )

    def _show_placement(self, sample: int, checked_car: CheckedCar) -> None:
        """Print and draw where the person is to put car and obstacles, and print how to move the obstacles there."""
        scene, obstacles = self._scene(sample)
        show_placement(scene, obstacles)
        if self._arrangement is not None:
            moves = moves_text(self._arrangement, self._planned_arrangement(sample))
            print_line(f"after trial {self.driven[-1]}: {moves}; the car goes back to its place")
        if not self._options.yes:
            self._draw(sample, checked_car)

    def _store_beginning(
        self, writer: TrialWriter, checked_car: CheckedCar, inputs: Drive, deviations: Deviations, log: Path
    ) -> int:
        """Store a trial before the car is armed, and return its number.

        ``deviations`` are the obstacles that stand elsewhere than planned. If there are any, the planned scene is
        stored too: with it, foldcar can recognise the trial's environment even if the program changes later. This is
        not done for a dynamic program, which runs beside the simulation.
        """
        design, identity, options = checked_car.design, checked_car.identity, self._options
        if deviations and not self._environment.dynamic:
            planned_scene, objects = self._environment.sample_with_parameters(inputs.sample)
            writer.put_planned_scene(inputs.environment_fingerprint, inputs.sample, planned_scene, objects)
        # The car may not report whether it is simulated.
        kind = {True: SIMULATED, False: BUILT, None: None}[identity.simulated]
        return writer.begin(
            self._experiment.id,
            TrialDesign(design.type, design.columns),
            inputs,
            deviations,
            CarFacts(identity.build, identity.hash, self._plugged.connected.port, kind, options.car),
            str(log.relative_to(store_folder(options.store))),
            options.operator,
        )

    def _drive(self, identity: CarIdentity, settings: dict[str, Any], trial: int, log: Path, view: DriveView) -> DriveEnd:
        """Drive a trial and return how it ended. If the car drives without its cable, wait until it is back."""
        car, options = self._plugged.connected, self._options
        end = drive_with_log(car, self._answers, identity, settings, trial, log, view, options)
        if end.ending != DRIVES_ON:
            return end
        view.wait_for_terminal()
        longest_s = options.countdown_s + settings["time_limit_s"]
        return self._plugged.collect(trial, log, longest_s, self._questions, identity)

    def _after_error(self, error: FoldcarError, checked_car: CheckedCar) -> CheckedCar:
        """Print the error that aborted a trial, and return the car for the next trial.

        After a fault of the car the session goes on. If there is a person, it also goes on after a command that the car
        has refused and, when the person has plugged the car in again, after a lost link. In all other cases, this raises
        ``error``.
        """
        has_person = not self._options.yes and self._answers.is_terminal
        is_refused_before_person = has_person and isinstance(error, CommandRefusedError)
        if isinstance(error, CarFaultError) or is_refused_before_person:
            print_warning(error)
            return checked_car
        is_car_lost = isinstance(error, (LinkLostError, NoCarError))
        if has_person and is_car_lost:
            print_warning(error)
            return self._car_plugged_in_again(error)
        raise error

    def _car_plugged_in_again(self, error: FoldcarError) -> CheckedCar:
        """Let the person plug the lost car in, check it and return it. Raises ``error`` if the person gives up."""
        while True:
            typed_port = self._answers.line("Plug the car in and press Enter, or type its port; q ends: ")
            if typed_port.lower() == "q":
                raise error
            try:
                self._plugged.connect_again(typed_port)
                return self._welcome()
            except FoldcarError as new_error:
                print_warning(new_error)

    def _scene(self, sample: int) -> PlannedScene:
        """Return a sample's scene with its lettered obstacles."""
        if sample not in self._scenes:
            scene, obstacles = self._environment.sample_with_obstacles(sample)
            self._scenes[sample] = PlannedScene(scene, lettered(obstacles))
        return self._scenes[sample]

    def _planned_arrangement(self, sample: int) -> Arrangement:
        """Return where the obstacles of a sample are to stand."""
        planned = self._scene(sample)
        return arrangement_of(planned.scene, planned.obstacles, deviations={})

    def _draw(self, sample: int, checked_car: CheckedCar) -> None:
        """Draw where car and obstacles stand, once for each sample and car, and print the picture's path."""
        picture = self._logs / f"place-{file_name_part(self._experiment.id)}-{sample}.png"
        sample_and_car = (sample, checked_car.identity.hash)
        if sample_and_car not in self._drawn:
            planned = self._scene(sample)
            draw_placement(
                planned.scene,
                planned.obstacles,
                checked_car.design,
                self._carsim,
                picture,
                title=f"Sample {sample}: where to put car and obstacles",
            )
            self._drawn.add(sample_and_car)
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
