"""A session of trials with one car: check its identity, then for each trial place, arm, drive and record.

Input: a listing's experiment, options, a port. Output: trials in the store. The row of a trial is in the store before
the car is armed and is completed step by step, so that a killed program loses at most the answer being typed.
"""

import shutil
import time
from dataclasses import replace
from datetime import datetime, timezone
from pathlib import Path
from typing import Any

import typer

from foldcar.car.body import body_json
from foldcar.car.car_file import design_name
from foldcar.car.design import Design
from foldcar.commands.log_options import LogOptions
from foldcar.commands.log_outcome import log_hash, record_outcome
from foldcar.commands.log_placement import Placement, ask_deviations
from foldcar.commands.log_view import LogView
from foldcar.commands.log_welcome import SIMULATED_TEXT, welcome
from foldcar.commands.options import design_settings
from foldcar.commands.typed_answers import INPUT, TypedAnswers
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
from foldcar.store.kept_work import kept_trial, take_in_trial
from foldcar.store.log_files import log_file
from foldcar.store.trial_records import BUILT, INTERRUPTED, SIMULATED, Ending, TrialDesign
from foldcar.store.trial_writer import CarFacts, Drive, TrialWriter, write_trials
from foldcar.study.environments import Environment
from foldcar.study.experiments import read_study
from foldcar.trials.driving import CTRL_C, DRIVES_ON, DriveEnd, collect, drive
from foldcar.trials.identity import least_tried, simulated_sample
from foldcar.trials.placement import lettered, placed

LEAST_FREE_BYTES = 20_000_000
# With --yes, how long to wait for an untethered car after its time limit.
COMES_BACK_S = 60.0


class LogSession:
    """A session; :meth:`run` drives it. All other inputs are read and checked before port and store are opened."""

    def __init__(self, listing: Path, experiment: str, options: LogOptions) -> None:
        self.options = options
        (self._experiment,) = read_study(listing, experiment).experiments
        self._family = self._experiment.family.narrowed(design_settings(options.settings))
        self._carsim = Carsim()
        self._environment = Environment(self._experiment)
        self._answers = TypedAnswers(self._idle)
        self._car: Car | None = None
        self._port = ""
        self._placements: dict[tuple[int, str, bool], Placement] = {}
        self._scenes: dict[int, tuple[dict[str, Any], dict[str, Obstacle]]] = {}

    def run(self, named_port: str | None) -> int:
        """Drive trials up to the requested number or until the person ends, and return their number. FoldcarError."""
        options = self.options
        self._connect(choose_port(named_port))
        try:
            identity, design, said = self._welcome()
            with write_trials(options.store) as writer:
                self._complete_interrupted(writer)
                driven = 0
                while options.trials is None or driven < options.trials:
                    end = self._trial(writer, identity, design, said)
                    if end is None:
                        break
                    driven += 1
                    if end.ending == CTRL_C:
                        raise KeyboardInterrupt
                    if end.error is not None:
                        identity, design, said = self._after_error(end.error)
                    if options.trials is None and options.yes:
                        break
                return driven
        finally:
            self._disconnect()

    def _connect(self, port: str) -> None:
        self._car = greet(port)
        self._port = port

    def _disconnect(self) -> None:
        """Close the connection, which nothing must use any more."""
        car, self._car = self._car, None
        if car is not None:
            car.connection.close()

    def _welcome(self) -> tuple[CarIdentity, Design, int | None]:
        """The car's identity, its design, and a simulated car's sample; FoldcarError if it cannot drive the trials."""
        assert self._car is not None
        identity, design = welcome(
            self._car, self._experiment, self._family, self._carsim, self.options, self._answers
        )
        said = None
        if identity.scene is not None:
            said = simulated_sample(
                identity.scene, self.options.sample, lambda k: self._scene(k)[0], self._experiment
            )
        return identity, design, said

    def _trial(
        self, writer: TrialWriter, identity: CarIdentity, design: Design, said: int | None
    ) -> DriveEnd | None:
        """Drive one trial, in the sample ``said`` by a simulated car; None if the person ends the session."""
        options = self.options
        trial_design = TrialDesign(design.type, design.columns)
        fingerprint = self._environment.fingerprint
        counts = writer.trial_counts(self._experiment.id, trial_design, fingerprint)
        sample = options.sample if said is None else said
        if sample is None:
            sample = least_tried(self._experiment.environments, counts)
        number = writer.next_number()
        placement = self._placement(sample, design, identity)
        mark = f" ({SIMULATED_TEXT})" if identity.simulated else ""
        typer.echo(f"\nTrial {number}: sample {sample} of experiment {self._experiment.id}{mark}")
        # With --yes no picture is drawn.
        with at_once():
            placement.show(with_picture=not options.yes)
        deviations = ask_deviations(self._answers, placement.things, options.deviations, options.yes)
        if not options.yes and self._answers.line("Enter starts the countdown, q ends: ").lower() == "q":
            return None
        body = body_json(design)
        settings = self._experiment.settings(design, body, self._carsim.parameter_table())
        log = self._log_file(number)
        assert self._car is not None
        car = None if identity.simulated is None else SIMULATED if identity.simulated else BUILT
        facts = CarFacts(identity.build, identity.hash, self._car.port, car)
        scene = placed(placement.scene, placement.things, deviations)
        if identity.simulated and deviations:
            typer.echo("the simulated car meets its scene as planned: the deviations are kept, but not simulated")
        begun = writer.begin(
            self._experiment.id, trial_design,
            Drive(body, settings, scene, fingerprint, self._experiment.program_name, sample), deviations, facts,
            str(log.relative_to(options.store.parent)), options.operator,
        )  # fmt: skip
        end = self._drive(settings, begun, log)
        if end.ending == DRIVES_ON:
            end = self._collect(begun, log, settings["time_limit_s"])
        record_outcome(writer, begun, end, log, options, self._answers, mark)
        return end

    def _drive(self, settings: dict[str, Any], number: int, log: Path) -> DriveEnd:
        car = self._car
        assert car is not None
        typer.echo(f"Countdown {self.options.countdown_s} s, then {settings['time_limit_s']:g} s at most. Ctrl-C stops.")
        writer = None
        try:
            writer = TlogWriter(log)
            car.connection.catch_up()
            car.connection.log = writer
            # The log then contains the car's identity and settings.
            for message in ("FOLDCAR_DESIGN", "AUTOPILOT_VERSION", "SYS_STATUS"):
                car.request(message)
            read_parameters(car)
            other_input = INPUT if self._answers.is_terminal else None
            with self._answers.keys() as pressed, LogView(settings["time_limit_s"], pressed, other_input) as view:
                end = drive(car, settings, number, self.options.countdown_s, view, self.options.untethered)
            return replace(end, outcome="passed") if view.passed and end.outcome is None else end
        except FoldcarError as error:
            ending = "link lost before the start" if isinstance(error, LinkLostError) else "not begun"
            return DriveEnd(ending, "aborted", None, error)
        finally:
            car.connection.log = None
            if writer is not None:
                writer.close()

    def _collect(self, number: int, log: Path, time_limit_s: float) -> DriveEnd:
        """Wait until an untethered car is connected again, and fetch its log."""
        end_s = time.monotonic() + time_limit_s + COMES_BACK_S
        question = "The car drives on. When it has stopped, plug it in and press Enter, or type its port; q gives up: "
        while True:
            typed = "" if self.options.yes else self._answers.line(question)
            if typed.lower() == "q":
                return DriveEnd("did not come back", "aborted", None)
            try:
                self._greet_again(typed)
                assert self._car is not None
                if self._car.state() == self._car.dialect.FOLDCAR_STATE_RUNNING:
                    raise LinkLostError("the car still drives")
                return collect(self._car, number, log)
            except FoldcarError as error:
                gone = error
            if self.options.yes and time.monotonic() > end_s:
                return DriveEnd("did not come back", "aborted", None, gone)
            if not self.options.yes:
                typer.echo(f"{gone}", err=True)
            time.sleep(1.0)

    def _after_error(self, error: FoldcarError) -> tuple[CarIdentity, Design, int | None]:
        """After a lost link, wait for a car; raise every other error, and with --yes all errors."""
        options = self.options
        if options.yes or not self._answers.is_terminal or not isinstance(error, LinkLostError):
            raise error
        typer.echo(f"{error}", err=True)
        while True:
            typed = self._answers.line("Plug the car in and press Enter, or type its port; q ends: ")
            if typed.lower() == "q":
                raise error
            try:
                self._greet_again(typed)
                return self._welcome()
            except FoldcarError as again:
                typer.echo(f"{again}", err=True)

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

    def _placement(self, sample: int, design: Design, identity: CarIdentity) -> Placement:
        simulated = bool(identity.simulated)
        key = (sample, design_name(design), simulated)
        if key not in self._placements:
            picture = self._logs() / f"place-{self._experiment.id}-{sample}.png"
            scene, things = self._scene(sample)
            self._placements[key] = Placement(scene, things, sample, simulated, design, picture, self._carsim)
        return self._placements[key]

    def _logs(self) -> Path:
        store = self.options.store
        return store.with_name(f"{store.stem}-logs")

    def _log_file(self, number: int) -> Path:
        folder = self._logs()
        make_output_folder(folder)
        free = shutil.disk_usage(folder).free
        if free < LEAST_FREE_BYTES:
            raise FoldcarError(f"{folder}: only {free / 1e6:.0f} MB are free for the log; make room first")
        now = datetime.now(timezone.utc).strftime("%Y%m%dT%H%M%SZ")
        return folder / f"trial-{number:04d}-{now}.tlog"

    def _complete_interrupted(self, writer: TrialWriter) -> None:
        for number, log in writer.unfinished():
            kept = kept_trial(self.options.store, number)
            if kept.is_file():
                typer.echo(f"{take_in_trial(writer, kept)}: taken in from {kept}")
                continue
            file = log_file(self.options.store, log)
            writer.complete(number, Ending("aborted", INTERRUPTED, None, "", log_hash(file)))
            typer.echo(f"Trial {number} was interrupted: it counts as aborted; its log is kept")

    def _idle(self) -> None:
        """Keep the link alive while the person types; a lost link is reported by the next command."""
        if self._car is not None:
            try:
                self._car.connection.receive(0.0)
            except LinkLostError:
                return
