"""Checks that the planar engine (side view) is valid for a study.

It is invalid if ground, commanded path or cars differ between left and right, or if cars may hang on a high crest.
Input: bodies, scenes and settings of docs/carsim.md. Output: text that says what is invalid, "" if nothing is. carsim
gives the heights and friction under both tracks, straight ahead from the start.
"""

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from itertools import islice, product
from typing import Any

import numpy

from foldcar.simulation.carsim import Carsim
from foldcar.study.environments import ExperimentEnvironment
from foldcar.study.experiments import Experiment
from foldcar.study.planned_designs import planned_design

# How many samples and designs of an experiment are checked; the narrowest and the widest design are among them.
SAMPLES, DESIGNS = 10, 8
# Distance between the points of a track, and tolerances of differences between left and right.
SPACING_M = 0.005
HEIGHT_TOLERANCE_M, FRICTION_TOLERANCE = 0.001, 0.01
RADIUS_TOLERANCE, ECCENTRICITY_TOLERANCE_M, RELATIVE_TOLERANCE = 0.002, 2e-4, 0.02
# Numbers of wheels that are compared, with their names in messages.
COMPARED = {
    "radius_m": "radius",
    "grip": "grip",
    "mass_kg": "mass",
    "stall_torque_n_m": "stall torque",
    "no_load_speed_rad_s": "no-load speed",
    "deadband_us": "dead band",
}
# The checked path begins this far behind the start.
BEHIND_M = 0.3


def side_view_limits(carsim: Carsim, experiment: Experiment, environment: ExperimentEnvironment) -> str:
    """Return what makes the side view invalid: differences between left and right, and a crest that may hold a car.

    Returns "" if it is valid. Of the designs and samples only DESIGNS and SAMPLES are checked.
    """
    bodies, scenes = _sampled_inputs(carsim, experiment, environment)
    limits = list(_asymmetries(carsim, experiment, bodies, scenes))
    # One crest is enough.
    limits += islice(_crests(bodies, scenes), 1)
    return ", ".join(limits)


def _sampled_inputs(
    carsim: Carsim, experiment: Experiment, environment: ExperimentEnvironment
) -> tuple[list[Mapping[str, Any]], list[Mapping[str, Any]]]:
    """Return the bodies of some designs, narrowest track first, and the scenes of the first SAMPLES samples.

    The designs are about DESIGNS designs at equal steps of the experiment's family.
    """
    table = carsim.parameter_table()
    every_nth = max(1, len(experiment.family) // DESIGNS)
    bodies: list[Mapping[str, Any]] = []
    for design in islice(experiment.family, 0, None, every_nth):
        bodies.append(planned_design(experiment, design, table).body)
    bodies.sort(key=lambda body: float(body["track_m"]))
    samples = range(min(SAMPLES, experiment.environments))
    return bodies, [environment.sample(sample) for sample in samples]


def _asymmetries(
    carsim: Carsim, experiment: Experiment, bodies: Sequence[Mapping[str, Any]], scenes: Sequence[Mapping[str, Any]]
) -> Iterator[str]:
    """Yield a text for each thing that differs between left and right: the ground, the commanded turn, the cars.

    ``bodies`` are sorted by track width; the ground is compared under the narrowest and the widest.
    """
    symmetric_samples = _symmetric_ground(carsim, [bodies[0], bodies[-1]], scenes)
    if not all(symmetric_samples):
        yield f"ground (not the same under both tracks in sample {symmetric_samples.index(False)})"
    turn_rad_s = experiment.yaw_rate_rad_s
    if turn_rad_s:
        yield f"heading (a turn of {turn_rad_s:g} rad/s is commanded)"
    if experiment.variation:
        yield "the cars' sides (built cars vary wheel by wheel)"
        return
    for body in bodies:
        difference = one_sided(body)
        if difference:
            yield f"the cars' sides ({difference})"
            return


def _crests(bodies: Sequence[Mapping[str, Any]], scenes: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    """Yield a text for each ramp or hill that is higher than the smallest ground clearance of the ``bodies``.

    On these a car may come to rest on its belly, and in three dimensions roll off sideways.
    """
    clearances_m = []
    for body in bodies:
        for wheel, segment in product(body["wheels"], body["segments"]):
            # ``center_z_m`` is the height above the axles, and the axles are one radius above the ground.
            underside_m = segment["center_z_m"] - 0.5 * segment["height_m"]
            clearances_m.append(wheel["radius_m"] + underside_m)
    for sample, scene in enumerate(scenes):
        for piece in scene["terrain"]:
            if piece["kind"] in ("ramp", "hill") and piece["height_m"] > min(clearances_m):
                height_mm = 1000 * piece["height_m"]
                yield f"rolling off a crest ({piece['kind']} of {height_mm:.0f} mm in sample {sample})"


def one_sided(body: Mapping[str, Any]) -> str:
    """Return the property in which left and right side of a body differ; "" if they are equal."""
    max_com_y_m = RELATIVE_TOLERANCE * body["track_m"]
    if any(abs(segment["com_y_m"]) > max_com_y_m for segment in body["segments"]):
        return "the centre of mass"
    # The two wheels, left and right, at each place along the car.
    pairs: dict[tuple[int, float], list[Mapping[str, Any]]] = {}
    for wheel in body["wheels"]:
        pairs.setdefault((wheel["segment"], wheel["x_m"]), []).append(wheel)
    for left, right in pairs.values():
        difference = _wheel_difference(left, right)
        if difference:
            return difference
    return ""


def _wheel_difference(left: Mapping[str, Any], right: Mapping[str, Any]) -> str:
    """Return the property in which two wheels of a body, or their servos, differ; "" if they are equal."""
    # An axle that is not in the middle of its wheel lifts the car once a turn, and not both sides at the same time.
    if max(left["eccentricity_m"], right["eccentricity_m"]) > ECCENTRICITY_TOLERANCE_M:
        return "wheels out of true"
    # A wheel without a servo has none of the servo's properties.
    left_properties = {**left.get("servo", {}), **left}
    right_properties = {**right.get("servo", {}), **right}
    for name, property_text in COMPARED.items():
        left_value = left_properties.get(name, 0.0)
        right_value = right_properties.get(name, 0.0)
        relative_tolerance = RADIUS_TOLERANCE if name == "radius_m" else RELATIVE_TOLERANCE
        larger_value = max(abs(left_value), abs(right_value))
        if abs(left_value - right_value) > relative_tolerance * larger_value:
            return property_text
    return ""


def _symmetric_ground(
    carsim: Carsim, bodies: Sequence[Mapping[str, Any]], scenes: Sequence[Mapping[str, Any]]
) -> list[bool]:
    """Return for each scene whether heights and friction are equal under the left and right tracks of all bodies."""
    lines = []
    for index, scene in enumerate(scenes):
        x_m, y_m = _track_points(bodies, scene)
        lines.append(json.dumps({"scene": {**scene, "id": "s"}}))
        lines.append(json.dumps({"heights": {"id": str(index), "scene": "s", "x_m": x_m, "y_m": y_m}}))
    are_symmetric = []
    for answer in carsim.answers(lines):
        # The first half of the points is under the left tracks, the second half under the right ones.
        left_m, right_m = numpy.reshape(answer["z_m"], (2, -1))
        left_friction, right_friction = numpy.reshape(answer["friction"], (2, -1))
        same_height = numpy.abs(left_m - right_m).max() <= HEIGHT_TOLERANCE_M
        same_friction = numpy.abs(left_friction - right_friction).max() <= FRICTION_TOLERANCE
        are_symmetric.append(bool(same_height and same_friction))
    return are_symmetric


def _course_end_m(scene: Mapping[str, Any]) -> float:
    """Return how far ahead of the start the farthest corner of the course lies, measured along the start's heading."""
    start, course = scene["start"], scene["course"]
    cos, sin = math.cos(start["heading_rad"]), math.sin(start["heading_rad"])
    distances_m = []
    for x_m, y_m in product((course["x_min_m"], course["x_max_m"]), (course["y_min_m"], course["y_max_m"])):
        distances_m.append((x_m - start["x_m"]) * cos + (y_m - start["y_m"]) * sin)
    return float(max(distances_m))


def _tyre_offsets_m(bodies: Sequence[Mapping[str, Any]]) -> list[float]:
    """Return the distances (m) of all left tyres' inner edges, middles and outer edges from the car's middle, sorted."""
    offsets_m: set[float] = set()
    for body in bodies:
        middle_m = 0.5 * body["track_m"]
        for wheel in body["wheels"]:
            half_width_m = 0.5 * wheel["width_m"]
            offsets_m.update((middle_m - half_width_m, middle_m, middle_m + half_width_m))
    return sorted(offsets_m)


def _track_points(bodies: Sequence[Mapping[str, Any]], scene: Mapping[str, Any]) -> tuple[list[float], list[float]]:
    """Return x and y (m) of the points of the ground under the tyres of cars that drive straight on.

    The points are on lines from a little behind the start to the end of the course, SPACING_M apart. Each body's tyres
    have lines under their inner edges, middles and outer edges. The points under the left tyres come first.
    """
    start = scene["start"]
    cos, sin = math.cos(start["heading_rad"]), math.sin(start["heading_rad"])
    # Rear wheels stand behind the start.
    end_m = max(_course_end_m(scene), BEHIND_M)
    ahead_m = numpy.arange(-BEHIND_M, end_m, SPACING_M)
    left_offsets_m = _tyre_offsets_m(bodies)
    right_offsets_m = [-offset_m for offset_m in left_offsets_m]
    # All points, by their distances ahead of the start and to the left of the car's middle.
    ahead_m, left_m = numpy.meshgrid(ahead_m, numpy.array(left_offsets_m + right_offsets_m))
    # Turn them by the start's heading, and move them to the start.
    x_m = start["x_m"] + ahead_m * cos - left_m * sin
    y_m = start["y_m"] + ahead_m * sin + left_m * cos
    return x_m.ravel().tolist(), y_m.ravel().tolist()
