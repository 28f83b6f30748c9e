"""Checks a connected car's identity: its design, its firmware build, its parameters, a simulated car's scene.

Input: the identity and the parameters that a car reports. Output: the design of the experiment, differing parameters,
the sample of a simulated car, or a FoldcarError with a remedy.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from foldcar.car.body import design_hash
from foldcar.car.design import Design
from foldcar.errors import FoldcarError
from foldcar.link.car import CarIdentity
from foldcar.link.parameters import equal_float32
from foldcar.scenes.fingerprint import sample_in, scene_name
from foldcar.study.experiments import Experiment
from foldcar.study.family import Family

# Endings of the names of parameters which may differ from the design's because they depend on servos and board.
CALIBRATED = ("_NEUTRAL_US", "_DEADBAND_US", "_GAIN_US", "PWM_OSC_HZ", "OE_WIRED")


def design_of(identity: CarIdentity, experiment: Experiment, family: Family) -> Design:
    """The design of ``family`` (the experiment's, or part of it) that has the car's hash; FoldcarError if none has."""
    if identity.refused:
        raise FoldcarError("the car refuses its own car.json: load the design again with `foldcar flash`")
    if not identity.hash:
        raise FoldcarError("the car has no design: load one with `foldcar flash LISTING --experiment ID --design-only`")
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
    """FoldcarError if the car's firmware is not of the build that is simulated."""
    if identity.build != simulated:
        raise FoldcarError(
            f"the car's firmware is build {identity.build}, the simulated one is {simulated}: load that with "
            "`foldcar flash`, or drive anyway with --any-build"
        )


def simulated_sample(
    said: str, asked: int | None, scene_of: Callable[[int], Mapping[str, Any]], experiment: Experiment
) -> int:
    """The sample that a simulated car drives in, whose scene has the id ``said``.

    FoldcarError if that is not the sample ``asked`` for, or if its scene is not the one that ``scene_of`` gives.
    """
    sample = sample_in(said)
    if sample is None:
        raise FoldcarError(
            f'the simulated car drives in the scene "{said}", which is no sample of experiment {experiment.id}: '
            "simulate the car with `foldcar link`"
        )
    if asked is not None and asked != sample:
        raise FoldcarError(
            f"--sample {asked}: the simulated car drives in sample {sample}: leave the option out, or start "
            f"`foldcar link` with --sample {asked}"
        )
    if scene_name(scene_of(sample), sample) != said:
        raise FoldcarError(
            f"the simulated car's scene is not sample {sample} of experiment {experiment.id}: start `foldcar link` "
            f"with this experiment of {experiment.place.partition(': ')[0]} as it is now"
        )
    return sample


def parameter_deviations(car: Mapping[str, float], expected: Mapping[str, float]) -> list[tuple[str, float, float]]:
    """Name, the car's and the expected value of each parameter that differs; those that one side lacks are left out."""
    return [
        (name, car[name], value)
        for name, value in expected.items()
        if name in car and not equal_float32(car[name], value)
    ]


def is_calibrated(name: str) -> bool:
    """Whether calibration sets this parameter for each car."""
    return name.endswith(CALIBRATED)


def least_tried(samples: int, counts: Mapping[int, int]) -> int:
    """The sample (0 to ``samples`` - 1) with the fewest trials, the first of several; ``counts`` is by sample."""
    candidates: Sequence[int] = range(samples)
    return min(candidates, key=lambda sample: (counts.get(sample, 0), sample))
