"""What of a study the side view cannot know: where ground, way or cars differ from side to side, and high crests.

Input: bodies, scenes and settings of docs/carsim.md. Output: words for what differs, "" if nothing does. The heights and
friction under both tracks are carsim's own, along the way straight ahead from the start.
"""

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from itertools import islice
from typing import Any

import numpy

from foldcar.simulation.carsim import Carsim
from foldcar.study.environments import Environment
from foldcar.study.experiments import Experiment
from foldcar.study.planned_designs import planned_design

# Of an experiment so many samples and so many designs, the narrowest and the widest among them, are looked at.
SAMPLES, DESIGNS = 10, 8
# Between points of a track along the way. Smaller differences than these count as none.
SPACING_M = 0.005
HEIGHT_M, FRICTION = 0.001, 0.01
RADIUS_SHARE, ECCENTRICITY_M, SHARE = 0.002, 2e-4, 0.02
# The way is looked at from behind the start.
BEHIND_M = 0.3


def beyond_side_view(carsim: Carsim, experiment: Experiment, environment: Environment) -> str:
    """What differs from side to side, and crests on which bellies may hang, of which cars free themselves by rolling."""
    bodies, scenes = _looked_at(carsim, experiment, environment)
    return ", ".join([*_unlike(carsim, experiment, bodies, scenes), *islice(_crests(bodies, scenes), 1)])


def _looked_at(
    carsim: Carsim, experiment: Experiment, environment: Environment
) -> tuple[list[Mapping[str, Any]], list[Mapping[str, Any]]]:
    """Bodies of some designs, the narrowest first, and the first scenes."""
    table = carsim.parameter_table()
    every = max(1, len(experiment.family) // DESIGNS)
    planned = [planned_design(experiment, one, table) for one in islice(experiment.family, 0, None, every)]
    bodies = sorted((one.body for one in planned), key=lambda body: float(body["track_m"]))
    return bodies, [environment.sample(k) for k in range(min(SAMPLES, experiment.environments))]


def _unlike(
    carsim: Carsim, experiment: Experiment, bodies: Sequence[Mapping[str, Any]], scenes: Sequence[Mapping[str, Any]]
) -> Iterator[str]:
    unlike = [k for k, alike in enumerate(_alike(carsim, [bodies[0], bodies[-1]], scenes)) if not alike]
    if unlike:
        yield f"ground (not the same under both tracks in sample {unlike[0]})"
    turn_rad_s = experiment.yaw_rate_rad_s
    if turn_rad_s:
        yield f"heading (a turn of {turn_rad_s:g} rad/s is asked for)"
    if experiment.variation:
        yield "the cars' sides (nearby cars vary wheel by wheel)"
    else:
        yield from (f"the cars' sides ({what})" for what in islice(filter(None, map(one_sided, bodies)), 1))


def _crests(bodies: Sequence[Mapping[str, Any]], scenes: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    """Slopes that are higher than the lowest belly is above the floor."""
    clear_m = min(
        wheel["radius_m"] + segment["center_z_m"] - 0.5 * segment["height_m"]
        for body in bodies
        for wheel in body["wheels"]
        for segment in body["segments"]
    )
    for k, scene in enumerate(scenes):
        for piece in scene["terrain"]:
            if piece["kind"] in ("ramp", "hill") and piece["height_m"] > clear_m:
                yield f"rolling off a crest ({piece['kind']} of {1000 * piece['height_m']:.0f} mm in sample {k})"


def one_sided(body: Mapping[str, Any]) -> str:
    """What a body has on one side only, "" if its sides are alike."""
    if any(abs(segment["com_y_m"]) > SHARE * body["track_m"] for segment in body["segments"]):
        return "the centre of mass"
    pairs: dict[tuple[int, float], list[Mapping[str, Any]]] = {}
    for wheel in body["wheels"]:
        pairs.setdefault((wheel["segment"], wheel["x_m"]), []).append(wheel)
    for left, right in pairs.values():
        if max(left["eccentricity_m"], right["eccentricity_m"]) > ECCENTRICITY_M:
            return "wheels out of true"
        numbers = [{**wheel.get("servo", {}), **wheel} for wheel in (left, right)]
        for name in ("radius_m", "grip", "mass_kg", "stall_torque_n_m", "no_load_speed_rad_s", "deadband_us"):
            one, other = numbers[0].get(name, 0.0), numbers[1].get(name, 0.0)
            if abs(one - other) > (RADIUS_SHARE if name == "radius_m" else SHARE) * max(abs(one), abs(other)):
                return name.partition("_")[0]
    return ""


def _alike(carsim: Carsim, bodies: Sequence[Mapping[str, Any]], scenes: Sequence[Mapping[str, Any]]) -> list[bool]:
    """Of each scene, whether the tracks of all bodies meet the same heights and friction left and right."""
    lines = []
    for index, scene in enumerate(scenes):
        x_m, y_m = _track_points(bodies, scene)
        lines.append(json.dumps({"scene": {**scene, "id": "s"}}))
        lines.append(json.dumps({"heights": {"id": str(index), "scene": "s", "x_m": x_m, "y_m": y_m}}))
    result = []
    for answer in carsim.answers(lines):
        heights, friction = (numpy.reshape(answer[name], (2, -1)) for name in ("z_m", "friction"))
        apart = [numpy.abs(left - right).max() for left, right in (heights, friction)]
        result.append(bool(apart[0] <= HEIGHT_M and apart[1] <= FRICTION))
    return result


def _track_points(bodies: Sequence[Mapping[str, Any]], scene: Mapping[str, Any]) -> tuple[list[float], list[float]]:
    """Points under inner edge, middle and outer edge of the tyres, the left ones first, as far as the course reaches."""
    start, course = scene["start"], scene["course"]
    corners = [(x, y) for x in (course["x_min_m"], course["x_max_m"]) for y in (course["y_min_m"], course["y_max_m"])]
    c, s = math.cos(start["heading_rad"]), math.sin(start["heading_rad"])
    far_m = max((x - start["x_m"]) * c + (y - start["y_m"]) * s for x, y in corners)
    along_m = numpy.arange(-BEHIND_M, max(far_m, BEHIND_M), SPACING_M)
    edges = {
        0.5 * (body["track_m"] + edge * wheel["width_m"])
        for body in bodies
        for wheel in body["wheels"]
        for edge in (-1, 0, 1)
    }
    across_m = numpy.array([side * edge for side in (1, -1) for edge in sorted(edges)])
    ahead, left = numpy.meshgrid(along_m, across_m)
    x_m, y_m = start["x_m"] + ahead * c - left * s, start["y_m"] + ahead * s + left * c
    return x_m.ravel().tolist(), y_m.ravel().tolist()
