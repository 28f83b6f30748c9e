"""Measures what `foldcar track` makes of films whose truth is known, under conditions one by one, and how long it takes.

    .venv/bin/python bench/camera.py [CONDITION ...]

Each film shows a simulated drive over a box, about 2 m from the camera, on a course of 1.5 by 1 m. Errors of place are
to the pose at the same moment, after the start's error, which has a column of its own. A line for each condition:
errors in mm and degrees (median, 95 %), share of x, y and headings within two of their standard deviations, start in ms,
frames seen, processor seconds a second of film, remarks.
"""

import json
import math
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "test" / "host"))

from filmed import Film, Filming, Thing, boxes, car_of, floor_markers, pose_at  # noqa: E402
from foldcar.errors import FoldcarError  # noqa: E402
from foldcar.simulation.carsim import Carsim  # noqa: E402
from foldcar.simulation.heights import carsim_heights  # noqa: E402
from foldcar.simulation.runner import RunRequest  # noqa: E402
from foldcar.trials.camera.film import read_film  # noqa: E402
from foldcar.trials.camera.filming import car_marker, find_start  # noqa: E402
from foldcar.trials.camera.ground import standing  # noqa: E402
from foldcar.trials.camera.markers import rectangle  # noqa: E402
from foldcar.trials.camera.tracking import track  # noqa: E402
from study_car import car_texts  # noqa: E402

COURSE = rectangle()
START_S = 0.4
SIDE_M = 0.15
BOX: dict[str, Any] = {"kind": "box", "x_m": 0.7, "y_m": 0.09, "heading_rad": 0.2, "height_m": 0.025}
BOX |= {"length_m": SIDE_M, "width_m": SIDE_M}
SCENE: dict[str, Any] = {
    "friction": 0.7,
    "terrain": [BOX],
    "start": {"x_m": 0.1, "y_m": -0.02, "heading_rad": 0.03},
    "goal": {"kind": "line", "x_m": 1.4, "y_m": 0.0, "heading_rad": 0.0},
    "course": {"x_min_m": -0.5, "x_max_m": 2.0, "y_min_m": -1.0, "y_max_m": 1.0},
}
USUAL = Filming(
    width=1920, height=1080, k1=-0.02, exposure_s=0.008, readout_s=0.015, noise=3, light=0.2, blur_px=0.7, moments=3
)
SMALL = replace(USUAL, width=1280, height=720)
CONDITIONS = {
    "720p30": SMALL,
    "1080p30": USUAL,
    "720p30, hand before it for 0.5 s": replace(SMALL, hand=(1.2, 1.7)),
    "720p30, each fifth frame dropped": replace(SMALL, dropped=tuple(range(4, 80, 5))),
    "720p30, read out in 30 ms": replace(SMALL, readout_s=0.03),
    "720p30, exposed 1/60 s": replace(SMALL, exposure_s=0.0167, moments=6),
    "1080p30, exposed 1/60 s": replace(USUAL, exposure_s=0.0167, moments=6),
    "1080p30, dim: noise 8, light falls off": replace(USUAL, noise=8, light=0.5),
    "720p30, lens bends by 8 %": replace(SMALL, k1=-0.08),
    "720p30, a floor marker missing": SMALL,
    "720p30, a floor marker pushed 40 mm": SMALL,
    "720p30, markers laid to 3 mm": SMALL,
    "720p30, camera 0.8 m high": replace(SMALL, place_m=(0.75, -1.9, 0.8)),
    "1080p30, camera 0.8 m high": replace(USUAL, place_m=(0.75, -1.9, 0.8)),
    "720p60": replace(SMALL, fps=60.0),
    "1080p60": replace(USUAL, fps=60.0),
    "1080p30, box 20 % higher than planned": USUAL,
    "1080p30, box 20 % lower than planned": USUAL,
    "720p30, box 20 % higher than planned": SMALL,
    "2160p30": replace(USUAL, width=3840, height=2160, blur_px=1.2),
}


def scene(name: str) -> dict[str, Any]:
    """The scene as it really is."""
    factor = 1.2 if "higher" in name else 0.8 if "lower" in name else 1.0
    return {**SCENE, "terrain": [{**BOX, "height_m": BOX["height_m"] * factor}]}


def floor(name: str, filming: Filming) -> list[Thing]:
    """The floor's markers as they really lie, and the box."""
    chance = numpy.random.default_rng(3)
    moved: dict[int, Any] = {}
    if "laid" in name:
        moved = {tag.id: chance.normal(0, 0.003, 2) for tag in COURSE.floor}
    elif "pushed" in name:
        moved = {1: (0.04, 0.0)}
    there = replace(COURSE, floor=tuple(tag for tag in COURSE.floor if tag.id != 2)) if "missing" in name else COURSE
    return [*floor_markers(there, moved), *boxes(scene(name)["terrain"], filming.place_m)]


def main() -> None:
    """Print the table."""
    carsim = Carsim()
    body_text, settings = car_texts(95, 8)
    body = json.loads(body_text)
    request = RunRequest("car", "scene", json.dumps({**json.loads(settings), "path_interval_s": 0.01}), "t", 0)
    ground = standing(SCENE, carsim_heights(carsim), body)
    car = car_marker(body, COURSE)

    names = ("film", "place (mm)", "heading (°)", "pitch, roll (°)", "in 2 sd", "start (ms)", "seen", "s per s", "said")
    print(f"|{'|'.join(names)}|\n|{'---|' * len(names)}")
    for name in sys.argv[1:] or CONDITIONS:
        filming = CONDITIONS[name]
        (answer,) = carsim.run({"car": body_text}, {"scene": json.dumps(scene(name))}, [request])
        path = numpy.array(answer["path"])
        truth = pose_at(path, START_S)
        with tempfile.TemporaryDirectory() as folder:
            film = Path(folder) / "film.mp4"
            Film(filming, floor(name, filming), car_of(body, COURSE), truth).write(film, START_S + path[-1, 0])
            begun_s = time.process_time()
            try:
                filmed = track(
                    read_film(film), "film", COURSE, None, lambda scale: replace(car, size_m=car.size_m * scale), ground
                )
            except FoldcarError as error:
                print(f"|{name}||||||||{error}|", flush=True)
                continue
            spent_s = time.process_time() - begun_s
        start = find_start(filmed.times_s, filmed.poses, path[:, :3], "film")

        def off(shift_s: float, filmed: Any = filmed, truth: Any = truth) -> Any:
            result = filmed.poses - numpy.array([truth(time_s + shift_s) for time_s in filmed.times_s])
            result[:, 3:] = numpy.remainder(result[:, 3:] + math.pi, math.tau) - math.pi
            return result

        # A frame's time is that of its first row.
        shift_s = min(numpy.arange(-0.03, 0.03, 0.001), key=lambda s: numpy.median(numpy.hypot(*off(s)[:, :2].T)))
        errors = numpy.abs(off(shift_s))
        place_mm, angles = 1000 * numpy.hypot(errors[:, 0], errors[:, 1]), numpy.degrees(errors[:, 3:])
        tilts = angles[:, 1:].ravel()
        spreads = numpy.diagonal(filmed.covariances, axis1=1, axis2=2)[:, [0, 1, 3]] + filmed.frame_error**2
        within = f"{100 * (errors[:, [0, 1, 3]] < 2 * numpy.sqrt(spreads)).mean():.0f} %"
        cells = [
            name, _both(place_mm), _both(angles[:, 0]), _both(tilts), within, f"{1000 * (start.film_s - START_S):+.0f}",
            f"{100 * filmed.seen:.0f} %", f"{spent_s / filmed.film_s:.2f}", "; ".join(filmed.remarks),
        ]  # fmt: skip
        print("|" + "|".join(cells) + "|", flush=True)


def _both(values: Any) -> str:
    return f"{numpy.median(values):.1f}, {numpy.quantile(values, 0.95):.1f}"


if __name__ == "__main__":
    main()
