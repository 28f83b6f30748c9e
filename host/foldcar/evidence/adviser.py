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
        head = ("step", "gain, points", "time")
        rows = [(step.text, f"{100 * step.gain:.1f}", duration_text(60 * step.minutes)) for step in self.steps]
        lines = lines_html([f"Experiment {self.info.id}", self.works, self.learn, self.grounds])
        return lines + (table_html(head, rows) if rows else "") + (self.picture() if self.picture else "")


@dataclass(frozen=True)
class Adviser:
    """Advises on one experiment; a good design's rate reaches the ``threshold`` (0 to 1)."""

    evidence: Evidence
    belief: Belief
    threshold: float

    def selection(self) -> Selection:
        """Return the advice."""
        belief = self.belief
        weighed = self._steps()
        of_trials = [step for step in weighed if step.kind != "measure"]
        first = of_trials[0] if of_trials else None
        measured = next((step for step in weighed if step.kind == "measure" and step.gain >= MIN_MEASURED_GAIN), None)
        if measured is not None and first is not None and measured.gain_per_hour < first.gain_per_hour:
            measured = None
        gain = max((step.gain for step in of_trials), default=0.0)
        enough = belief.driven and gain < MIN_GAIN
        ordered = [step for step in (measured, *of_trials) if step is not None]
        return Selection(
            self.evidence.info,
            self.threshold,
            works=works(belief, self.evidence, self.threshold),
            learn=self._learn(first, measured, gain, enough),
            grounds=grounds(self.evidence, self.threshold),
            steps=() if enough else tuple(map(self._planned, ordered[:SHOWN_STEPS])),
            environments=() if enough or first is None else self._environments(first),
            enough=enough,
            leader=belief.designs[belief.answers.best].design,
            gain=gain,
            remarks=self.evidence.remarks,
            basis=self._basis,
        )

    def _steps(self) -> list[AdvisedStep]:
        """Return the possible steps, the greatest gain for an hour first."""
        belief, info = self.belief, self.evidence.info
        known = belief.measured or {}
        measurable = {
            name: (MEASURE_MIN[name], precision)
            for name, precision in MEASURABLE.items()
            # Only obstacles can be measured before a car is built.
            if name not in known and (belief.driven or name == "obstacle_height")
        }
        return steps(belief.answers, car_min(info.vehicle_type), self._trial_min, measurable)

    def _trial_min(self, row: int) -> float:
        return trial_min(self.belief.designs[row].mean_time_s)

    def _learn(self, first: AdvisedStep | None, measured: AdvisedStep | None, gain: float, enough: bool) -> str:
        """Return the line on what to do to learn most."""
        if enough:
            return f"Want to learn most? {afternoon(gain)} Stop here, or change the family."
        if first is None:
            return "Want to learn most? Change the family: in simulation and in all realities no design works."
        then = step_text(self.belief, first, AFTERNOON_TRIALS)
        gained = afternoon(gain) if self.belief.driven else "So far nothing has tested the simulation."
        if measured is None:
            return f"Want to learn most? {then[0].upper()}{then[1:]}. {gained}".strip()
        what, minutes = measurement(measured.parameter), f"{measured.minutes:.0f} minutes"
        first_text = f"Measure {what} first ({minutes}), because success depends on it"
        return f"Want to learn most? {first_text}. Then {then}. {gained}".strip()

    def _planned(self, step: AdvisedStep) -> PlannedStep:
        """Return a step with its words, rates and costs."""
        belief = self.belief
        text = step_text(belief, step, AFTERNOON_TRIALS)
        minutes = max(1, round(step.minutes))
        if step.design is None:
            return PlannedStep(step.kind, text, step.gain, minutes, parameter=step.parameter)
        design = belief.designs[step.design]
        return PlannedStep(
            step.kind, text, step.gain, minutes, design.label, design.design, trials=AFTERNOON_TRIALS,
            sheets=sheets_of(design) if step.kind == "build" else 0,
            simulated=design.simulated() if design.runs else None, built=built_rate(belief, step.design),
        )  # fmt: skip

    def _environments(self, step: AdvisedStep) -> tuple[int, ...]:
        """Return the samples to set up: the first ones in which the design was not driven yet."""
        assert step.design is not None
        driven = {trial.sample for trial in self.belief.designs[step.design].trials}
        fresh = (sample for sample in range(self.evidence.info.environments) if sample not in driven)
        return tuple(sample for sample, _ in zip(fresh, range(AFTERNOON_TRIALS), strict=False))

    @property
    def _basis(self) -> str:
        """The assumptions behind sheets and minutes, as a sentence."""
        return (
            f"Sheets are an estimate: 12 x 12 inch, of which the pieces fill {percent(FILLING)}. Minutes assume "
            f"{car_min(self.evidence.info.vehicle_type):.0f} min to cut and build a car (without loading the firmware), "
            f"{PLACING_MIN:g} min to place a trial, and the time that simulation drives."
        )
