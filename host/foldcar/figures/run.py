"""Draws one run: from the side, the car at intervals and the ground under both tracks; from above, its path."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Polygon

from foldcar.errors import FoldcarError
from foldcar.figures.ground import height_map, height_scale
from foldcar.figures.output import check_format, save_figure
from foldcar.figures.profile import Line, driven_line, strip_heights_m, travelled_m
from foldcar.figures.style import ACCENT, FAILURE, INK, OUTCOME_LABELS, drawing_style
from foldcar.figures.top_view import draw_top_view, view_of
from foldcar.simulation.heights import Heights

WIDTH_IN = 10.0
FAR_COLOUR = "#e6d3a8"
NEAR_COLOUR = "#b58a45"
MARGIN_M = 0.1
CELLS = 600
VIEW_IN = 7.5
# The largest heights of the view from the side and of the view from above.
MAX_SIDE_IN, MAX_ABOVE_IN = 3.0, 4.2
LABELS_IN = 0.8
TITLE_IN = 0.3
MAX_POSES = 12
# Distance between two pictures of the car, as a factor on its largest extent from its middle.
POSE_SPACING = 2.05
# The last two pictures may be nearer to each other, by this factor.
MIN_LAST_SPACING = 0.8
# Gap between the car and its time, and below the ground.
GAP_M = 0.012


def draw_run(
    body: Mapping[str, Any],
    scene: Mapping[str, Any],
    result: Mapping[str, Any],
    path: Sequence[Sequence[float]],
    heights: Heights,
    file: Path,
) -> None:
    """Draw a run into ``file`` (.png, .svg, .pdf).

    ``body``, ``scene`` and ``result`` are the objects of docs/carsim.md (ids may be missing); ``path`` has
    rows of time, x, y, z, heading, pitch, roll and hinge angles in s, m and rad. Raises FoldcarError.
    """
    check_format(file)
    if not len(path):
        raise FoldcarError(f"{file}: the run has no path to draw")
    rows = numpy.asarray(path, dtype=float)
    with drawing_style():
        figure = Figure(layout="constrained")
        side, above = figure.subplots(2, 1)
        figure.suptitle(_title(body, scene, result), x=0.01, ha="left", fontweight="bold")
        _draw_side(side, body, scene, result, rows, heights)
        ground = height_map(heights, scene, view_of([scene], rows), CELLS)
        scale = height_scale([ground])
        draw_top_view(above, scene, ground, scale, rows)
        above.set_title("from above")
        above.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))
        if scene["terrain"]:
            figure.colorbar(scale, ax=above, label="height (mm)", shrink=0.8, aspect=20, location="left")
        _fit_height(figure, side, above)
        save_figure(figure, [file])


def poses_to_draw(distances_m: Sequence[float], spacing_m: float) -> list[int]:
    """Return the indices of the rows of a path at which the car is drawn.

    ``distances_m`` is how far the car has driven at each row. It is drawn at the first row and at the last row, and
    between them every ``spacing_m``, so that its pictures do not overlap.
    """
    drawn_rows = [0]
    for index, distance in enumerate(distances_m):
        if distance >= distances_m[drawn_rows[-1]] + spacing_m:
            drawn_rows.append(index)
    # The last row is always drawn, so rows that are too near to it are not.
    last = len(distances_m) - 1
    while len(drawn_rows) > 1 and abs(distances_m[last] - distances_m[drawn_rows[-1]]) < spacing_m * MIN_LAST_SPACING:
        drawn_rows.pop()
    return drawn_rows if last == 0 else [*drawn_rows, last]


class SegmentPose(NamedTuple):
    """How a segment is turned and moved, seen from the right, compared with the flat car whose origin is at (0, 0).

    ``turn`` (2, 2) turns points (x, z) as row vectors, and ``origin`` (2,) is added to them (m).
    """

    turn: Any
    origin: Any

    def moved(self, points: Any) -> Any:
        """Return the places of points (x, z) of the flat car, one (2,) or several (n, 2), in this pose."""
        return points @ self.turn + self.origin


def segment_places(body: Mapping[str, Any], row: Any) -> list[SegmentPose]:
    """Return the pose of each segment at a row of the path, relative to the car's origin."""
    segments, hinges = body["segments"], body["hinges"]
    # The main segment contains the car's origin, or is the nearest to it. It has the car's pose.
    gaps_m = [max(0.0, abs(segment["x_m"]) - segment["length_m"] / 2) for segment in segments]
    main = gaps_m.index(min(gaps_m))
    # A row is time, x, y, z, heading, pitch, roll, hinge angles.
    pitch_rad = float(row[5])
    hinge_angles_rad = [float(angle_rad) for angle_rad in row[7 : 7 + len(hinges)]]
    pitches_rad = {main: pitch_rad}
    poses = {main: SegmentPose(_turn(pitch_rad), numpy.zeros(2))}
    # A hinge lies between the segment with the same index and the next one behind it. Its angle is positive if the nose
    # of the front segment is up. First the segments behind the main one, then those in front of it.
    for index in range(main, len(segments) - 1):
        pitches_rad[index + 1] = pitches_rad[index] - hinge_angles_rad[index]
        poses[index + 1] = _neighbour_pose(poses[index], hinges[index], pitches_rad[index + 1])
    for index in range(main - 1, -1, -1):
        pitches_rad[index] = pitches_rad[index + 1] + hinge_angles_rad[index]
        poses[index] = _neighbour_pose(poses[index + 1], hinges[index], pitches_rad[index])
    return [poses[index] for index in range(len(segments))]


def _neighbour_pose(pose: SegmentPose, hinge: Mapping[str, float], neighbour_pitch_rad: float) -> SegmentPose:
    """Return the pose of a segment with this pitch, which a ``hinge`` joins to a segment with ``pose``.

    The hinge belongs to both segments, so both poses put it at the same place.
    """
    hinge_point = numpy.array([hinge["x_m"], hinge["z_m"]])
    turn = _turn(neighbour_pitch_rad)
    return SegmentPose(turn, origin=pose.moved(hinge_point) - hinge_point @ turn)


def _turn(pitch: float) -> Any:
    """Return the matrix (2, 2) that turns row vectors (x, z) by a pitch (rad), nose up."""
    return numpy.array([[numpy.cos(pitch), numpy.sin(pitch)], [-numpy.sin(pitch), numpy.cos(pitch)]])


def _fit_height(figure: Figure, side: Axes, above: Axes) -> None:
    """Set the height of the figure so that both views fit. They are to scale and as wide as the figure.

    A view that would be higher than its maximum is cut to it.
    """
    heights_in = []
    for axes, max_height_in in ((side, MAX_SIDE_IN), (above, MAX_ABOVE_IN)):
        left, right = axes.get_xlim()
        bottom, top = axes.get_ylim()
        height_in = VIEW_IN * (top - bottom) / (right - left)
        heights_in.append(min(height_in, max_height_in) + LABELS_IN)
    figure.set_size_inches(WIDTH_IN, sum(heights_in) + TITLE_IN)
    grid = above.get_gridspec()
    assert grid is not None
    grid.set_height_ratios(heights_in)


def _draw_side(
    axes: Axes, body: Mapping[str, Any], scene: Mapping[str, Any], result: Mapping[str, Any], rows: Any, heights: Heights
) -> None:
    """Draw the car at several times over the ground under its wheels, seen from the right side."""
    reach = _reach_m(body)
    line = driven_line(rows, margin_m=reach + MARGIN_M)
    lowest, highest = _draw_ground(axes, body, scene, line, heights)
    travelled = travelled_m(rows)
    # A little more than the length of the car, so that its pictures do not overlap.
    spacing_m = max(POSE_SPACING * reach, (line.distance_m[-1] - line.distance_m[0]) / MAX_POSES)
    drawn_rows = poses_to_draw(list(travelled), spacing_m)
    for index in drawn_rows:
        is_last = index == drawn_rows[-1]
        colour = FAILURE if is_last and result["outcome"] != "passed" else ACCENT
        top = _draw_car(axes, body, travelled[index], rows[index], colour)
        axes.annotate(f"{rows[index, 0]:.2f} s", (travelled[index], top + GAP_M), ha="center", fontsize=8, color=INK)
    axes.set_aspect("equal")
    axes.grid(False)
    axes.set_xlim(line.distance_m[0], line.distance_m[-1])
    # Above the highest place there is room for the car and its time.
    axes.set_ylim(lowest - GAP_M, max(rows[:, 3].max(), highest) + reach * 1.1)
    axes.set_xlabel("distance driven (m)")
    axes.set_ylabel("height (m)")
    axes.set_title("from the right side")
    axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2)


def _reach_m(body: Mapping[str, Any]) -> float:
    """Return how far a car extends from its middle, forwards or backwards (m)."""
    wheel_reaches = [abs(wheel["x_m"]) + wheel["radius_m"] for wheel in body["wheels"]]
    segment_reaches = [abs(segment["x_m"]) + segment["length_m"] / 2 for segment in body["segments"]]
    return float(max(wheel_reaches + segment_reaches))


def _draw_ground(
    axes: Axes, body: Mapping[str, Any], scene: Mapping[str, Any], line: Line, heights: Heights
) -> tuple[float, float]:
    """Draw the ground under the left and the right wheels along a line, and return its minimum and maximum height (m).

    The minimum is at most 0 and the maximum at least 0, so that the picture always shows the level of flat ground.
    """
    lowest, highest = 0.0, 0.0
    # The left side is farther away, so it is drawn first, in a paler colour and with a dashed line.
    sides = (("left", 0.5, FAR_COLOUR, "--", 1), ("right", -0.5, NEAR_COLOUR, "-", 2))
    for side, side_factor, colour, line_style, zorder in sides:
        tyre_m = max(wheel["width_m"] for wheel in body["wheels"] if wheel["side"] == side)
        strip = strip_heights_m(heights, scene, line, side_factor * body["track_m"], tyre_m)
        lowest = min(lowest, float(numpy.min(strip)))
        highest = max(highest, float(numpy.max(strip)))
        label = f"ground under the {side} wheels"
        axes.fill_between(line.distance_m, strip, -1.0, color=colour, linewidth=0, zorder=zorder, label=label)
        axes.plot(line.distance_m, strip, color="#6b4a17", linewidth=0.8, linestyle=line_style, zorder=3)
    return lowest, highest


def _draw_car(axes: Axes, body: Mapping[str, Any], distance_m: float, row: Any, colour: str) -> float:
    """Draw the car at a row of the path, and return the height (m) of its highest point."""
    # A row is time, x, y, z, heading, pitch, roll, hinge angles.
    _, _, _, z, _, _, roll, *_ = map(float, row)
    poses = segment_places(body, row)
    top = z
    # Left wheels are drawn first, because they are behind.
    for wheel in sorted(body["wheels"], key=lambda wheel: str(wheel["side"])):
        is_near = wheel["side"] == "right"
        # Roll lifts the left wheels and lowers the right ones.
        lift = body["track_m"] / 2 * numpy.sin(roll)
        if is_near:
            lift = -lift
        axle = numpy.array([wheel["x_m"], 0.0])
        x, height = poses[wheel["segment"]].moved(axle) + numpy.array([distance_m, z + lift])
        top = max(top, height + wheel["radius_m"])
        look: dict[str, Any] = {"facecolor": "none", "linewidth": 0.8, "linestyle": ":", "zorder": 4}
        if is_near:
            look = {"facecolor": "#ffffff66", "linewidth": 1.3, "linestyle": "-", "zorder": 6}
        axes.add_patch(Circle((x, height), wheel["radius_m"], edgecolor=colour, **look))
    for segment, pose in zip(body["segments"], poses, strict=True):
        half_size = [segment["length_m"] / 2, segment["height_m"] / 2]
        corners = numpy.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * half_size
        centre = numpy.array([segment["x_m"], segment["center_z_m"]])
        outline = pose.moved(corners + centre) + numpy.array([distance_m, z])
        axes.add_patch(Polygon(outline, facecolor=colour, alpha=0.35, edgecolor="none", zorder=5))
        axes.add_patch(Polygon(outline, fill=False, edgecolor=colour, linewidth=1.0, zorder=7))
        top = max(top, outline[:, 1].max())
    return float(top)


def _title(body: Mapping[str, Any], scene: Mapping[str, Any], result: Mapping[str, Any]) -> str:
    """Return outcome and time of a run, with the ids of car and scene if they have any."""
    outcome = OUTCOME_LABELS.get(result["outcome"], result["outcome"])
    parts = [f"{outcome} after {result['elapsed_time_s']:.2f} s"]
    if "id" in body:
        parts.append(f"car {body['id']}")
    else:
        parts.append(f"track {body['track_m'] * 1e3:.0f} mm")
    if "id" in scene:
        parts.append(f"scene {scene['id']}")
    return ", ".join(parts)
