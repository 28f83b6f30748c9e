"""The simulator's uncertain parameters with their priors, one row each.

A parameter is described by its score z, which is standard normal before any trial: ``value(z)`` turns scores into the
parameter's unit. All inference works on scores; what a value does to a run stands in reality.py.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal, NamedTuple

import numpy as np
from scipy.special import ndtr, ndtri

from foldcar.car.parts.catalogue import DEFAULT_CHOICES, split_type
from foldcar.errors import FoldcarError
from foldcar.typed import decimal_number, did_you_mean

FloatArray = np.ndarray[Any, np.dtype[np.float64]]


@dataclass(frozen=True, slots=True)
class UnknownParameter:
    """A parameter; ``nominal`` is its value in nominal simulation.

    ``prior``: ``log-normal`` with median ``middle`` and standard deviation ``sd`` of the logarithm, ``normal``, or
    ``half-normal`` (``middle`` 0). ``unit`` is that of value, middle and sd; × is a factor.
    """

    name: str
    unit: str
    prior: Literal["log-normal", "normal", "half-normal"]
    middle: float
    sd: float
    nominal: float
    meaning: str
    source: str

    def value(self, score: Any) -> Any:
        """Return the value that belongs to a score, or the values of an array of scores.

        A score is a quantile of the parameter's prior distribution, expressed as a number of standard deviations of a
        normal distribution: 0 stands for the median, and 1 for the value above which 16 % of the distribution lie.
        """
        if self.prior == "log-normal":
            return self.middle * np.exp(self.sd * score)
        if self.prior == "normal":
            return self.middle + self.sd * score
        # The prior is half-normal, the distribution of |x| if x is normal with mean 0. Half of the probability above the
        # value belongs to x, the other half to -x. The tail above is used because it is exact for large scores.
        probability_above = ndtr(-np.asarray(score, dtype=float))
        return -self.sd * ndtri(probability_above / 2)

    def score(self, value: float) -> float:
        """Return the score of a value, the inverse of :meth:`value`; infinite if the prior excludes the value."""
        if self.prior == "normal":
            return (value - self.middle) / self.sd
        if self.prior == "log-normal":
            return float(np.log(value / self.middle)) / self.sd if value > 0 else -np.inf
        return float(ndtri(2 * ndtr(value / self.sd) - 1)) if value > 0 else -np.inf


PARAMETERS = (
    UnknownParameter(
        "friction", "×", "log-normal", 1.0, 0.3, 1.0,
        "friction coefficient of tyres on the ground, relative to the environment's",
        "published coefficients of soft rims on floors are 0.35 to 1, around the environments' 0.6",
    ),
    UnknownParameter(
        "servo_torque", "×", "log-normal", 0.85, 0.3, 1.0,
        "stall torque of all servos, relative to the data sheet's at the nominal supply",
        "torque follows the supply, 4.2 to 6 V for four cells under load and charged; worn and copied servos have half",
    ),
    UnknownParameter(
        "servo_speed", "×", "log-normal", 0.95, 0.15, 1.0,
        "no-load speed of all servos, relative to the data sheet's at the nominal supply",
        "speed follows the supply as torque does, and less the make of the servo",
    ),
    UnknownParameter(
        "obstacle_height", "×", "log-normal", 1.0, 0.2, 1.0,
        "heights and depths of the ground, relative to the environment's",
        "obstacles that were not measured: the published pyramids have no sizes; measured ones would have sd 0.02",
    ),
    UnknownParameter(
        "com_height_m", "m", "normal", 0.01, 0.012, 0.0,
        "height of the centre of mass above the drawn one",
        "where the battery of a car is that was not built from the sheets is not known; on the roof it lifts it by 28 mm",
    ),
    UnknownParameter(
        "track_m", "m", "normal", 0.0, 0.004, 0.0,
        "distance between left and right tyres beyond the drawn one",
        "horns and servos differ by some 1 mm a side; a horn turned round sets its wheel 3 mm further in",
    ),
    UnknownParameter(
        "start_position_sd_m", "m", "half-normal", 0.0, 0.01, 0.0,
        "scatter of the start along and across, one sd, beyond the environment's own",
        "a car put down by hand at a mark",
    ),
    UnknownParameter(
        "start_heading_sd_rad", "rad", "half-normal", 0.0, 0.06, 0.0,
        "scatter of the heading at the start, one sd, beyond the environment's own",
        "a car of 0.2 m that is put down by eye, each end 6 mm off",
    ),
    UnknownParameter(
        "wheel_spread", "×", "log-normal", 1.0, 0.5, 0.0,
        "differences between the wheels of a car, relative to the spreads of `workshop`",
        "data sheets' tolerances as in workshop.json, right within a factor of 2 or so",
    ),
)  # fmt: skip
NAMES = tuple(parameter.name for parameter in PARAMETERS)
# The prior of cars that were built from the sheets, where the place of each part is drawn.
SHEETS_COM_HEIGHT = replace(
    PARAMETERS[NAMES.index("com_height_m")],
    middle=0.0,
    sd=0.003,
    source="built from the sheets: tolerances of the parts give 0.0004 m; cables, glue and folding are not in them",
)
# The priors of cars whose cells are named: the supply, ± 9 % in these factors, is the simulator's.
NAMED_CELLS = (
    replace(
        PARAMETERS[NAMES.index("servo_torque")],
        middle=0.95,
        sd=0.28,
        source="the design names its cells: worn and copied servos, which have down to half",
    ),
    replace(
        PARAMETERS[NAMES.index("servo_speed")], middle=1.0, sd=0.12, source="the design names its cells: the servo's make"
    ),
)
# What a ruler and a tilted board measure, with the standard deviation of the score: 2 % of a height, 1.5 mm of the centre
# of mass, 0.5 mm of the track. Other parameters are measured to a fifth of their prior's deviation.
MEASURABLE = {"obstacle_height": 0.1, "com_height_m": 0.125, "track_m": 0.125}
OTHER_PRECISION = 0.2
# Largest score of a reality that is simulated, and so of a measured value.
MAX_SCORE = 2.5
NOMINAL: Mapping[str, float] = {parameter.name: parameter.nominal for parameter in PARAMETERS}
# The scores of the nominal simulation, within those of realities that are simulated.
NOMINAL_SCORES = np.clip([parameter.score(parameter.nominal) for parameter in PARAMETERS], -MAX_SCORE, MAX_SCORE)


def values_of(scores: FloatArray) -> list[dict[str, float]]:
    """Return the parameters' values by name for each row of scores (n, parameters), rounded to six digits."""
    columns = [parameter.value(scores[:, index]) for index, parameter in enumerate(PARAMETERS)]
    values_by_name = []
    for row in np.column_stack(columns):
        rounded = [float(f"{value:.6g}") for value in row]
        values_by_name.append(dict(zip(NAMES, rounded, strict=True)))
    return values_by_name


def parameter_named(
    name: str, value: float, place: str, largest_score: float, with_nominal: bool, others: Iterable[str] = ()
) -> UnknownParameter:
    """Return the unknown parameter ``name``, after checking that it can have this ``value``.

    The value must not be farther from the prior's median than ``largest_score`` standard deviations. The nominal value
    may lie outside this range. If ``with_nominal`` is True, the range is extended to include it. Raises FoldcarError,
    which begins with ``place``, if the name is unknown or the value is outside the limits. ``others`` are further names
    that the error lists as valid.
    """
    if name not in NAMES:
        valid_names = [*NAMES, *others]
        suggestion = did_you_mean(name, valid_names)
        raise FoldcarError(f'{place}: unknown parameter "{name}"{suggestion}; known: {", ".join(valid_names)}')
    parameter = PARAMETERS[NAMES.index(name)]
    # A half-normal parameter is a standard deviation, which may be 0.
    low = 0.0 if parameter.prior == "half-normal" else float(parameter.value(-largest_score))
    high = float(parameter.value(largest_score))
    if with_nominal:
        low, high = min(low, parameter.nominal), max(high, parameter.nominal)
    if not low <= value <= high:
        raise FoldcarError(f"{place}: {value:g} is outside {low:.3g} to {high:.3g} ({parameter.unit})")
    return parameter


class ScorePrior(NamedTuple):
    """A normal prior of a parameter's score in place of the standard normal one.

    ``source`` is where it comes from.
    """

    mean: float
    sd: float
    source: str


def measured_value(text: str, place: str) -> tuple[str, float]:
    """Parse the text NAME=VALUE and return name and value.

    Raises FoldcarError, which starts with ``place``, if the text has another form, the name is unknown, or the value is
    outside the parameter's limits.

    NAME is a parameter of the simulator whose true value is uncertain, and VALUE is what a person has measured.
    """
    name, _, number = (part.strip() for part in text.partition("="))
    try:
        value = decimal_number(number)
    except ValueError:
        raise FoldcarError(f"{place} {text}: is not NAME=VALUE with a number") from None
    # This raises FoldcarError if the name is unknown, or if the value is too far from the median of the prior.
    parameter_named(name, value, f"{place} {name}".strip(), largest_score=MAX_SCORE, with_nominal=False)
    return name, value


def measured_priors(measured: Mapping[str, float], place: str) -> dict[int, ScorePrior]:
    """Return the priors of parameters that were measured, by the parameter's index.

    The priors are normal distributions of scores. A score is a value as a number of standard deviations from the median
    of the usual prior. The new prior is centred at the measured value, and has the precision of such a measurement.
    Raises FoldcarError, which begins with ``place``, if a name is unknown or a value is outside its limits.
    """
    priors = {}
    for name, value in measured.items():
        parameter = parameter_named(name, value, f"{place} {name}", MAX_SCORE, with_nominal=False)
        # A half-normal parameter cannot be below 0, so its score is minus infinity if it was measured as 0.
        score = max(-MAX_SCORE, parameter.score(value))
        precision = MEASURABLE.get(name, OTHER_PRECISION)
        priors[NAMES.index(name)] = ScorePrior(score, precision, "measured")
    return priors


def built_priors(vehicle_type: str, from_sheets: bool, supply_ratio: float | None = None) -> dict[int, ScorePrior]:
    """Return narrower priors of some unknown parameters, for cars that were really built, by the parameter's index.

    Three things narrow a prior. If ``vehicle_type`` names the cells of the battery, their voltage is known. If the car
    was built ``from_sheets``, its parts lie where they are drawn, so its centre of mass is known. If the battery's
    voltage was measured, ``supply_ratio`` is the measured voltage divided by that of the design. The torque and the speed
    of the servos are proportional to it.

    Example: ``built_priors("W_B_W+cells=nimh", from_sheets=True)``
    """
    _, part_choices = split_type(vehicle_type)
    narrowed_parameters: list[UnknownParameter] = []
    if supply_ratio is not None:
        source = f"the measured supply, {supply_ratio:.2f} of the design's, and the servos' make and wear"
        for parameter in NAMED_CELLS:
            narrowed_parameters.append(replace(parameter, middle=parameter.middle * supply_ratio, source=source))
    elif part_choices.cells != DEFAULT_CHOICES.cells:
        narrowed_parameters += NAMED_CELLS
    if from_sheets:
        narrowed_parameters.append(SHEETS_COM_HEIGHT)
    priors = {}
    for narrowed in narrowed_parameters:
        index = NAMES.index(narrowed.name)
        usual = PARAMETERS[index]
        # A score is a number of standard deviations of the usual prior.
        priors[index] = ScorePrior(mean=usual.score(narrowed.middle), sd=narrowed.sd / usual.sd, source=narrowed.source)
    return priors
