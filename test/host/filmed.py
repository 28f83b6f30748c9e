"""Films of simulated trials whose truth is known, for tests, bench/camera.py and docs/synthetic_study.py.

The camera is one of its own, written without foldcar's.

Each pixel's ray, with lens distortion, is followed to the planes of floor, markers and car; several rays a pixel, several
moments an exposure, rows one after the other (rolling shutter), then light, vignette and noise. The floor is drawn
once, what moves in each frame.
"""

import struct
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any

import cv2
import numpy

Array = Any
QUIET = 1.6


@dataclass(frozen=True)
class Filming:
    """A camera at ``place_m`` that looks at ``aim_m``, and what troubles its pictures."""

    width: int = 1280
    height: int = 720
    fps: float = 30.0
    focal: float = 0.8
    k1: float = 0.0
    k2: float = 0.0
    place_m: tuple[float, float, float] = (0.7, -1.7, 1.5)
    aim_m: tuple[float, float, float] = (0.75, 0.05, 0.0)
    exposure_s: float = 0.004
    readout_s: float = 0.0
    noise: float = 2.0
    light: float = 0.0
    blur_px: float = 0.5
    hand: tuple[float, float] | None = None
    dropped: tuple[int, ...] = ()
    moments: int = 4
    codec: str = "mp4v"
    seed: int = 1


@dataclass(frozen=True)
class Thing:
    """A rectangle in space: its middle's frame (rotation, place), half sides, and its texture (rows from the top)."""

    turn: Array
    place: Array
    half: tuple[float, float]
    texture: Array


def marker_texture(number: int, pixels: int = 40) -> Array:
    """A marker with a white border of 20 %, as printed."""
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
    picture = cv2.aruco.generateImageMarker(dictionary, number, 8 * pixels)
    border = round(0.2 * 8 * pixels)
    return cv2.copyMakeBorder(picture, border, border, border, border, cv2.BORDER_CONSTANT, value=255)


def marker(number: int, size_m: float, place: Array, turn: Array) -> Thing:
    half = 0.7 * size_m
    # Ink and paper are not black and white.
    texture = (35 + marker_texture(number).astype(float) * (200 / 255)).astype(numpy.float32)
    return Thing(turn, numpy.asarray(place, float), (half, half), texture)


def rotation(heading: float, pitch: float = 0.0, roll: float = 0.0) -> Array:
    """About z, then nose up, then left side up."""
    (ch, sh), (cp, sp), (cr, sr) = ((numpy.cos(a), numpy.sin(a)) for a in (heading, -pitch, roll))
    z = numpy.array([[ch, -sh, 0], [sh, ch, 0], [0, 0, 1]])
    y = numpy.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    x = numpy.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    return z @ y @ x


@dataclass
class Car:
    """A box with wheels and a marker above its lid, in its own frame (m): origin at axle height."""

    marker_size: float = 0.05
    marker_z: float = 0.065
    marker_x: float = 0.0
    half: tuple[float, float, float] = (0.1, 0.0475, 0.025)
    wheels: tuple[tuple[float, float], ...] = ((0.07, 0.06), (-0.07, 0.06), (0.07, -0.06), (-0.07, -0.06))
    radius: float = 0.06
    number: int = 10
    plain: Array = field(default_factory=lambda: numpy.full((8, 8), 150, numpy.float32))

    def things(self, pose: Array) -> list[Thing]:
        """Faces in an order in which later ones hide earlier ones, for a camera above."""
        x, y, z, heading, pitch, roll = pose
        turn, place = rotation(heading, pitch, roll), numpy.array([x, y, z])
        things = []
        a, b, c = self.half
        sideways = rotation(0) @ numpy.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]])
        for wx, wy in self.wheels:
            wheel = numpy.full((64, 64), numpy.nan, numpy.float32)
            cv2.circle(wheel, (31, 31), 31, 60.0, -1)
            things.append(Thing(turn @ sideways, place + turn @ (wx, wy, 0), (self.radius, self.radius), wheel))
        for side in (-1, 1):
            things.append(Thing(turn @ sideways, place + turn @ (0, side * b, 0), (a, c), 0.6 * self.plain))
        things.append(Thing(turn, place + turn @ (0, 0, c), (a, b), self.plain))
        # By distance from the ground: the marker is above all.
        size = self.marker_size
        things.append(
            marker(self.number, size, place + turn @ (self.marker_x, 0, self.marker_z), turn @ rotation(-numpy.pi / 2))
        )
        return things


def car_of(body: Mapping[str, Any], course: Any) -> Car:
    """The box, the wheels and the marker of a body of one segment."""
    (box,) = body["segments"]
    wheels = [(wheel["x_m"], (0.5 if wheel["side"] == "left" else -0.5) * body["track_m"]) for wheel in body["wheels"]]
    return Car(
        marker_size=course.car_size_m,
        marker_z=box["center_z_m"] + box["height_m"] / 2 + course.car_height_m,
        marker_x=course.car_x_m,
        half=(box["length_m"] / 2, box["width_m"] / 2, box["height_m"] / 2),
        wheels=tuple(sorted(wheels, key=lambda at: -at[1])),
        radius=body["wheels"][0]["radius_m"],
    )


def floor_markers(course: Any, moved: Mapping[int, tuple[float, float]] | None = None) -> list[Thing]:
    """The floor's markers, those of ``moved`` so far (m) from their places."""
    markers = []
    for thing in course.floor:
        x, y = (moved or {}).get(thing.id, (0.0, 0.0))
        markers.append(
            marker(thing.id, course.floor_size_m, (thing.x_m + x, thing.y_m + y, 0.0), rotation(thing.turn_rad))
        )
    return markers


def boxes(terrain: Sequence[Mapping[str, Any]], seen_from_m: tuple[float, float, float]) -> list[Thing]:
    """Sides and tops of a scene's boxes, lower ones first, as they stand on each other; near sides hide far ones."""
    boxes = []
    by_height = sorted(terrain, key=lambda thing: thing["height_m"])
    for place_in_order, box in enumerate(by_height):
        assert box["kind"] == "box", box["kind"]
        turn = rotation(box["heading_rad"])
        below = [lower["height_m"] for lower in by_height[:place_in_order] if _covers(lower, box["x_m"], box["y_m"])]
        low, high = max(below, default=0.0), box["height_m"]
        half = (box["length_m"] / 2, box["width_m"] / 2)
        middle, up = numpy.array([box["x_m"], box["y_m"], 0.0]), numpy.array([0.0, 0.0, 1.0])
        sides = []
        for axis, sign in ((0, 1), (0, -1), (1, 1), (1, -1)):
            along, out = turn[:, 1 - axis], sign * turn[:, axis]
            place = middle + half[axis] * out + (low + high) / 2 * up
            grey = numpy.full((2, 2), 60 + 15 * axis, numpy.float32)
            sides.append(Thing(numpy.column_stack([along, up, out]), place, (half[1 - axis], (high - low) / 2), grey))
        boxes += sorted(sides, key=lambda side: -numpy.linalg.norm(side.place - numpy.array(seen_from_m)))
        boxes.append(Thing(turn, middle + high * up, half, numpy.full((4, 4), 90, numpy.float32)))
    return boxes


def _covers(box: Mapping[str, Any], x_m: float, y_m: float) -> bool:
    along, across, _ = rotation(box["heading_rad"]).T @ (x_m - box["x_m"], y_m - box["y_m"], 0.0)
    return abs(along) < box["length_m"] / 2 and abs(across) < box["width_m"] / 2


def pose_at(path: Any, start_s: float) -> Callable[[float], Any]:
    """The pose at a time of a film in which ``path`` (rows of time, x, y, z, heading, pitch, roll) begins at ``start_s``.

    Before and after it the car stands.
    """
    path = numpy.array(path, float)
    path[:, 4:7] = numpy.unwrap(path[:, 4:7], axis=0)
    return lambda at_s: numpy.array([numpy.interp(at_s - start_s, path[:, 0], column) for column in path[:, 1:7].T])


class Camera:
    def __init__(self, filming: Filming) -> None:
        self.f = filming
        self.focal = filming.focal * max(filming.width, filming.height)
        self.middle = ((filming.width - 1) / 2 + 4.0, (filming.height - 1) / 2 - 3.0)
        self.place = numpy.array(filming.place_m)
        ahead = numpy.array(filming.aim_m) - self.place
        ahead /= numpy.linalg.norm(ahead)
        right = numpy.cross(ahead, (0, 0, 1.0))
        right /= numpy.linalg.norm(right)
        self.turn = numpy.array([right, numpy.cross(ahead, right), ahead])

    def rays(self, u: Array, v: Array) -> Array:
        """Of pixels, the directions in the world: distortion is undone by fixed point steps."""
        x0, y0 = (u - self.middle[0]) / self.focal, (v - self.middle[1]) / self.focal
        x, y = x0, y0
        for _ in range(6 if self.f.k1 or self.f.k2 else 0):
            r2 = x * x + y * y
            by = 1 + r2 * (self.f.k1 + r2 * self.f.k2)
            x, y = x0 / by, y0 / by
        return numpy.stack([x, y, numpy.ones_like(x)], axis=-1) @ self.turn.astype(numpy.float32)

    def pixels(self, points: Array) -> Array:
        p = (points - self.place) @ self.turn.T
        x, y = p[:, 0] / p[:, 2], p[:, 1] / p[:, 2]
        r2 = x * x + y * y
        by = 1 + r2 * (self.f.k1 + r2 * self.f.k2)
        return numpy.column_stack([x * by * self.focal + self.middle[0], y * by * self.focal + self.middle[1]])

    def box(self, things: list[Thing], margin: int = 6) -> tuple[int, int, int, int]:
        corners = numpy.concatenate([
            thing.place + numpy.array([(i * thing.half[0], j * thing.half[1], 0) for i in (-1, 1) for j in (-1, 1)]) @
            thing.turn.T for thing in things
        ])  # fmt: skip
        at = self.pixels(corners)
        x0, y0 = numpy.floor(at.min(axis=0)).astype(int) - margin
        x1, y1 = numpy.ceil(at.max(axis=0)).astype(int) + margin
        return max(0, x0), max(0, y0), min(self.f.width, x1), min(self.f.height, y1)

    def fine_rays(self, box: tuple[int, int, int, int], side: int) -> Array:
        """Directions of side × side rays in each pixel of the box: (side², rows, columns, 3)."""
        x0, y0, x1, y1 = box
        u, v = numpy.meshgrid(numpy.arange(x0, x1, dtype=numpy.float32), numpy.arange(y0, y1, dtype=numpy.float32))
        off = (numpy.arange(side) + 0.5) / side - 0.5
        return numpy.stack([self.rays(u + du, v + dv) for du in off for dv in off]).astype(numpy.float32)

    def paint(self, under: Array, things: list[Thing], box: tuple[int, int, int, int], rays: Array) -> Array:
        """The box of a picture, whose pixels are ``under``, with things drawn over it, later ones over earlier ones."""
        values = numpy.repeat(under[None], len(rays), axis=0)
        for thing in things:
            x0, y0, x1, y1 = self.box([thing], 2)
            part = (
                slice(None),
                slice(max(0, y0 - box[1]), max(0, y1 - box[1])),
                slice(max(0, x0 - box[0]), max(0, x1 - box[0])),
            )
            if values[part].size:
                self._put(values[part], thing, rays[part])
        return values.mean(axis=0)

    def _put(self, values: Array, thing: Thing, rays: Array) -> None:
        # The camera and the rays along the thing's axes.
        x, y, z = (float(value) for value in (self.place - thing.place) @ thing.turn)
        right, up, out = (rays @ axis for axis in thing.turn.T.astype(numpy.float32))
        t = -z / numpy.where(numpy.abs(out) < 1e-9, numpy.float32(1e-9), out)
        a, b = x + t * right, y + t * up
        rows, columns = thing.texture.shape
        inside = (numpy.abs(a) < thing.half[0]) & (numpy.abs(b) < thing.half[1]) & (t > 0)
        if not inside.any():
            return
        u = ((a[inside] / thing.half[0] + 1) / 2 * columns).astype(int).clip(0, columns - 1)
        v = ((1 - b[inside] / thing.half[1]) / 2 * rows).astype(int).clip(0, rows - 1)
        colours = thing.texture[v, u]
        seen = values[inside]
        values[inside] = numpy.where(numpy.isnan(colours), seen, colours)


class Film:
    """A film's frames: ``floor`` are things that lie still, ``path`` gives the car's pose at a time."""

    def __init__(self, filming: Filming, floor: list[Thing], car: Car | None, path: Any) -> None:
        self.f, self.floor, self.car, self.path = filming, floor, car, path
        self.random = numpy.random.default_rng(filming.seed)
        self.camera = Camera(filming)
        self.still = self._still()
        size = (filming.height + 64, filming.width + 64)
        self.grain = filming.noise * self.random.standard_normal(size, dtype=numpy.float32)
        u, v = numpy.meshgrid(numpy.linspace(-1, 1, filming.width), numpy.linspace(-1, 1, filming.height))
        self.light = (1 + filming.light * (0.7 * u + 0.3 * v) - 0.5 * abs(filming.light) * (u * u + v * v)).astype(
            numpy.float32
        )

    def _still(self) -> Array:
        # A floor of wood in boards, with grain.
        f, rough = self.f, numpy.random.default_rng(7)
        grain = cv2.GaussianBlur(rough.normal(0, 1, (600, 900)).astype(numpy.float32), (0, 0), 2)
        boards = 130 + 60 * grain + numpy.repeat(rough.normal(0, 12, 60), 15)[None, :900]
        ground = Thing(numpy.eye(3), numpy.array([0.75, 0, 0.0]), (4.5, 3.0), boards.astype(numpy.float32))
        canvas = numpy.full((f.height, f.width), 140, numpy.float32)
        whole = (0, 0, f.width, f.height)
        canvas = self.camera.paint(canvas, [ground], whole, self.camera.fine_rays(whole, 1))
        for thing in self.floor:
            x0, y0, x1, y1 = box = self.camera.box([thing])
            if x1 > x0 and y1 > y0:
                canvas[y0:y1, x0:x1] = self.camera.paint(
                    canvas[y0:y1, x0:x1], [thing], box, self.camera.fine_rays(box, 4)
                )
        return canvas

    def frame(self, at_s: float) -> Array:
        f = self.f
        picture = self.still.copy()
        if self.car is not None and self.path is not None:
            moments = f.moments if f.exposure_s or f.readout_s else 1
            # Rows are exposed in bands: those of the car's box share its middle row's time.
            here = self.camera.box(self.car.things(self.path(at_s)))
            row_s = f.readout_s * (here[1] + here[3]) / 2 / f.height
            times = at_s + row_s + f.exposure_s * ((numpy.arange(moments) + 0.5) / moments)
            boxes = [self.camera.box(self.car.things(self.path(t))) for t in times]
            x0, y0 = (min(b[k] for b in boxes) for k in (0, 1))
            x1, y1 = (max(b[k] for b in boxes) for k in (2, 3))
            if x1 > x0 and y1 > y0:
                box = (x0, y0, x1, y1)
                rays, under = self.camera.fine_rays(box, 3), picture[y0:y1, x0:x1].copy()
                shown = [self.camera.paint(under, self.car.things(self.path(t)), box, rays) for t in times]
                picture[y0:y1, x0:x1] = numpy.mean(shown, axis=0)
        if f.hand is not None and f.hand[0] <= at_s < f.hand[1]:
            middle = (f.width // 2, f.height // 2)
            cv2.ellipse(picture, middle, (f.width // 2, f.height // 5), 20, 0, 360, 170.0, -1)
        picture *= self.light
        if f.blur_px:
            picture = cv2.GaussianBlur(picture, (0, 0), f.blur_px)
        # One pattern of noise, elsewhere in each frame.
        dx, dy = self.random.integers(0, 64, 2)
        picture += self.grain[dy : dy + f.height, dx : dx + f.width]
        return picture.clip(0, 255).astype(numpy.uint8)

    def write(self, file: Path, seconds: float) -> list[float]:
        """Write the film; gives its frames' times. ``dropped`` frames are missing, the others keep theirs."""
        f = self.f
        writer = cv2.VideoWriter(str(file), cv2.VideoWriter_fourcc(*f.codec), f.fps, (f.width, f.height))
        assert writer.isOpened()
        numbers = [n for n in range(round(seconds * f.fps)) if n not in f.dropped]
        for n in numbers:
            writer.write(cv2.cvtColor(self.frame(n / f.fps), cv2.COLOR_GRAY2BGR))
        writer.release()
        if f.dropped:
            stretch(file, [b - a for a, b in pairwise(numbers)])
        return [n / f.fps for n in numbers]


def stretch(file: Path, steps: list[int]) -> None:
    """Give the frames of an MP4 other durations, in frames: rewrites its table `stts`, at the end of the file."""
    data = bytearray(file.read_bytes())
    at = data.index(b"stts") - 4
    size, count, delta = (struct.unpack_from(">I", data, at + k)[0] for k in (0, 16, 20))
    entries = b"".join(struct.pack(">II", 1, step * delta) for step in [*steps, 1])
    assert count == len(steps) + 1 and data.index(b"mdat") < at
    new = struct.pack(">I4sII", 16 + len(entries), b"stts", 0, len(steps) + 1) + entries
    grown = len(new) - size
    for name in (b"moov", b"trak", b"mdia", b"minf", b"stbl"):
        place = data.rindex(name, 0, at) - 4
        struct.pack_into(">I", data, place, struct.unpack_from(">I", data, place)[0] + grown)
    data[at : at + size] = new
    file.write_bytes(bytes(data))
