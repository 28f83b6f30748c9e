"""What should this person do next? The advice for one experiment, in two lines, with the steps that were weighed.

Input: the evidence of an experiment and the belief about its designs. Output: a Selection. `select`, `log`, the page and
the API print it.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

from foldcar.belief.advice import AFTERNOON_TRIALS, MIN_GAIN, AdvisedStep, steps
from foldcar.belief.priors import MEASURABLE
from foldcar.evidence.belief import Belief
from foldcar.evidence.comparison import built_rate
from foldcar.evidence.costs import FILLING, MEASURE_MIN, PLACING_MIN, car_min, sheets_of, trial_min
from foldcar.evidence.design_evidence import Design
from foldcar.evidence.evidence import Evidence
from foldcar.evidence.sentences import afternoon, grounds, measurement, step_text, works
from foldcar.notebook_html import lines_html, table_html
from foldcar.statistics.rate import Rate
from foldcar.statistics.words import duration_text, percent
from foldcar.store.info import ExperimentInfo

# Steps that are shown.
SHOWN_STEPS = 5
# A measurement that is expected to gain less is not proposed.
MIN_MEASURED_GAIN = 0.001


@dataclass(frozen=True)
class PlannedStep:
    """A step that a person could do next.

    ``kind`` is *build*, *drive* or *measure*, ``text`` says it in words. ``gain`` is by how much the rate of the design
    recommended afterwards is expected to rise (0 to 1). ``trials`` trials of the car with the ``label`` take ``minutes``
    with the building; ``sheets`` of film are needed, None if the car cannot be folded. ``simulated`` is the rate of the
    design's runs, ``built`` that of a further car; both are None for a measurement.
    """

    kind: str
    text: str
    gain: float
    minutes: int
    label: str = ""
    design: Design | None = None
    parameter: str = ""
    trials: int = 0
    sheets: int | None = 0
    simulated: Rate | None = None
    built: Rate | None = None


@dataclass(frozen=True, repr=False)
class Selection:
    """The advice for one experiment; print it to read it.

    ``works`` says which car to take if a car is wanted that works, ``learn`` what to do to learn most. ``grounds`` is the
    evidence: simulation and trials. ``steps`` are the possible steps, the best first; ``environments`` are the samples to
    set up for its trials. ``enough`` is whether another afternoon is not worth it. ``leader`` is the design with the
    highest expected rate of built cars, ``gain`` what an afternoon is expected to gain (0 to 1); both are None without a
    belief. ``basis`` states the assumptions of minutes and sheets. ``picture`` draws what a notebook shows below the
    words, as HTML.
    """

    info: ExperimentInfo
    threshold: float
    works: str
    learn: str = ""
    grounds: str = ""
    steps: tuple[PlannedStep, ...] = ()
    environments: tuple[int, ...] = ()
    enough: bool = False
    leader: Design | None = None
    gain: float | None = None
    remarks: tuple[str, ...] = ()
    basis: str = ""
    picture: Callable[[], str] | None = field(default=None, compare=False)

    @property
    def sentence(self) -> str:
        """The two lines and the grounds, one after another."""
        return " ".join(text for text in (self.works, self.learn, self.grounds) if text)

    def __repr__(self) -> str:
        lines = [self.works, self.learn, self.grounds, *(f"  {step.text}" for step in self.steps)]
        return "\n".join([f"Experiment {self.info.id}:", *filter(None, lines)])

    def _repr_html_(self) -> str:
        html = lines_html([f"Experiment {self.info.id}", self.works, self.learn, self.grounds])
        rows = [(step.text, f"{100 * step.gain:.1f}", duration_text(60 * step.minutes)) for step in self.steps]
        if rows:
            html += table_html(("step", "gain, points", "time"), rows)
        if self.picture is not None:
            html += self.picture()
        return html


@dataclass(frozen=True)
class Adviser:
    """Advises on one experiment; a good design's rate reaches the ``threshold`` (0 to 1)."""

    evidence: Evidence
    belief: Belief
    threshold: float

    def selection(self) -> Selection:
        """Return the advice: which car to take, what to do to learn most, and the steps that a person can choose from.

        A *step* is to build a car and drive it, to drive a built car again, or to measure something. The *gain* of a
        step is by how much the success rate of the recommended design is expected to rise (0 to 1). If no step with
        trials gains much, the trials are enough, and no step is advised.
        """
        belief = self.belief
        possible_steps = self._possible_steps()
        drive_steps = [step for step in possible_steps if step.kind != "measure"]
        # The steps are sorted by gain an hour, so the first step need not be the one with the highest gain.
        best_drive_step = drive_steps[0] if drive_steps else None
        measure_step = self._worthwhile_measurement(possible_steps, best_drive_step)
        gain = max((step.gain for step in drive_steps), default=0.0)
        enough = belief.driven and gain < MIN_GAIN
        shown_steps = [] if enough else drive_steps[:SHOWN_STEPS]
        if measure_step is not None and not enough:
            shown_steps = [measure_step, *drive_steps][:SHOWN_STEPS]
        environments: tuple[int, ...] = ()
        if best_drive_step is not None and not enough:
            environments = self._environments(best_drive_step)
        return Selection(
            self.evidence.info,
            self.threshold,
            works=works(belief, self.evidence, self.threshold),
            learn=self._learn(best_drive_step, measure_step, gain, enough),
            grounds=grounds(self.evidence, self.threshold),
            steps=tuple(self._planned(step) for step in shown_steps),
            environments=environments,
            enough=enough,
            leader=belief.designs[belief.answers.best].design,
            gain=gain,
            remarks=self.evidence.remarks,
            basis=self._basis,
        )

    def _possible_steps(self) -> list[AdvisedStep]:
        """Return the steps that a person could do next, the greatest gain for an hour of work first."""
        belief = self.belief
        measured_names = belief.measured or {}
        # The minutes of work and the precision of each measurement, by the parameter's name.
        measurable = {}
        for name, precision in MEASURABLE.items():
            # Only obstacles can be measured before a car is built.
            if name not in measured_names and (belief.driven or name == "obstacle_height"):
                measurable[name] = MEASURE_MIN[name], precision
        return steps(belief.answers, car_min(self.evidence.info.vehicle_type), self._trial_min, measurable)

    @staticmethod
    def _worthwhile_measurement(
        possible_steps: list[AdvisedStep], best_drive_step: AdvisedStep | None
    ) -> AdvisedStep | None:
        """Return the first measurement with enough gain; None if driving gains more for an hour of work."""
        for step in possible_steps:
            if step.kind == "measure" and step.gain >= MIN_MEASURED_GAIN:
                if best_drive_step is not None and step.gain_per_hour < best_drive_step.gain_per_hour:
                    return None
                return step
        return None

    def _trial_min(self, design_index: int) -> float:
        """Return the minutes of a trial of a design; ``design_index`` counts the designs of the belief."""
        return trial_min(self.belief.designs[design_index].mean_time_s)

    def _learn(self, drive_step: AdvisedStep | None, measure_step: AdvisedStep | None, gain: float, enough: bool) -> str:
        """Return the line on what to do to learn most about which design is best.

        ``drive_step`` is the best step with trials, None if no design works. ``measure_step`` is a measurement to make
        before it, or None. An afternoon is the time for AFTERNOON_TRIALS trials, and ``gain`` (0 to 1) is what it is
        expected to add to the success rate. ``enough`` is True if the gain is so small that no more trials are advised.
        """
        question = "Want to learn most?"
        if enough:
            return f"{question} {afternoon(gain)} Stop here, or change the family."
        if drive_step is None:
            return f"{question} Change the family: in simulation and in all realities no design works."
        drive_text = step_text(self.belief, drive_step, AFTERNOON_TRIALS)
        gain_text = afternoon(gain) if self.belief.driven else "So far nothing has tested the simulation."
        if measure_step is None:
            return f"{question} {drive_text[0].upper()}{drive_text[1:]}. {gain_text}"
        quantity = measurement(measure_step.parameter)
        measure_text = f"Measure {quantity} first ({measure_step.minutes:.0f} minutes), because success depends on it"
        return f"{question} {measure_text}. Then {drive_text}. {gain_text}"

    def _planned(self, step: AdvisedStep) -> PlannedStep:
        """Return a step that a person could do next, with its text, its costs and its expected gain.

        The gain is by how much the success rate of the recommended design is expected to rise. A step is to drive a car
        of a design, or, if it has no design, to measure a parameter. ``simulated`` is the design's success rate in
        simulation. ``built`` is the expected rate of the next car that is built from it.
        """
        text = step_text(self.belief, step, AFTERNOON_TRIALS)
        minutes = max(1, round(step.minutes))
        if step.design is None:
            return PlannedStep(step.kind, text, step.gain, minutes, parameter=step.parameter)
        design = self.belief.designs[step.design]
        return PlannedStep(
            kind=step.kind,
            text=text,
            gain=step.gain,
            minutes=minutes,
            label=design.label,
            design=design.design,
            trials=AFTERNOON_TRIALS,
            sheets=sheets_of(design) if step.kind == "build" else 0,
            simulated=design.simulated() if design.runs else None,
            built=built_rate(self.belief, step.design),
        )

    def _environments(self, step: AdvisedStep) -> tuple[int, ...]:
        """Return the numbers of the environments to set up: the first ones in which the design was not driven yet."""
        assert step.design is not None
        driven_samples = {trial.sample for trial in self.belief.designs[step.design].trials}
        fresh_samples = [sample for sample in range(self.evidence.info.environments) if sample not in driven_samples]
        return tuple(fresh_samples[:AFTERNOON_TRIALS])

    @property
    def _basis(self) -> str:
        """Two sentences that say how the numbers of sheets and minutes are estimated."""
        car_minutes = car_min(self.evidence.info.vehicle_type)
        return (
            f"Sheets are an estimate: 12 x 12 inch, of which the pieces fill {percent(FILLING)}. Minutes assume "
            f"{car_minutes:.0f} min to cut and build a car (without loading the firmware), "
            f"{PLACING_MIN:g} min to place the car for a trial, and a drive that takes as long as in simulation."
        )
