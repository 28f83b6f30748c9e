"""Who is at the other end: which design of the experiment, which firmware, set to what.

Input: what a car says of itself. Output: the design it is, or a FoldcarError that says what to do about it.
"""

from collections.abc import Mapping, Sequence

from foldcar.car.car_file import design_hash
from foldcar.car.design import Design
from foldcar.errors import FoldcarError
from foldcar.link.car import CarIdentity
from foldcar.link.parameters import same
from foldcar.study.experiments import Experiment
from foldcar.study.family import Family

# Of parameters that belong to the servos of one car, and are calibrated: they may differ from the design's.
CALIBRATED = ("_NEUTRAL_US", "_DEADBAND_US", "_GAIN_US", "PWM_OSC_HZ")


def design_of(identity: CarIdentity, experiment: Experiment, family: Family) -> Design:
    """The design of ``family`` (of ``experiment``, perhaps narrowed) that the car is; FoldcarError if it is none."""
    if identity.refused:
        raise FoldcarError("the car refuses its own car.json: load the design again with `foldcar flash`")
    if not identity.hash:
        raise FoldcarError("the car holds no design: load one with `foldcar flash LISTING --experiment ID --design-only`")
    for design in family:
        if design_hash(design) == identity.hash:
            return design
    several = f"one of the {len(family)} of experiment {experiment.id}"
    chosen = "the one that --set chooses" if len(family) == 1 else several
    raise FoldcarError(
        f"the car is {identity.name} ({identity.hash}), which is not {chosen}: name its own listing, or load the "
        "design that was built with `foldcar flash`"
    )


def check_build(identity: CarIdentity, simulated: str) -> None:
    """FoldcarError if the car's firmware is not the one that is simulated."""
    if identity.build != simulated:
        raise FoldcarError(
            f"the car's firmware is build {identity.build}, simulated is {simulated}: load it with "
            "`foldcar flash`, or drive all the same with --any-build"
        )


def unexpected(car: Mapping[str, float], expected: Mapping[str, float]) -> list[tuple[str, float, float]]:
    """Name, the car's value and the expected one where they differ, of parameters that both have."""
    return [
        (name, car[name], value) for name, value in expected.items() if name in car and not same(car[name], value)
    ]


def is_calibrated(name: str) -> bool:
    """Whether a parameter is one that calibration sets for each car."""
    return name.endswith(CALIBRATED)


def least_tried(samples: int, counts: Mapping[int, int]) -> int:
    """The sample of an experiment that has had the fewest trials, the first of several."""
    candidates: Sequence[int] = range(samples)
    return min(candidates, key=lambda sample: (counts.get(sample, 0), sample))
