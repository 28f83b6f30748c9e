"""Films with known truth, drawn by `filmed.py`: `foldcar track` finds path, start and outcome, and refuses the rest."""

import csv
import json
import re
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import cv2
import numpy
import pytest

from filmed import Car, Film, pose_at
from filmed_scene import COURSE, FILMING, SCENE, START_S, floor_things, photo
from foldcar.errors import FoldcarError
from foldcar.link.mcap_export import export_mcap
from foldcar.simulation.carsim import Carsim
from foldcar.simulation.runner import RunRequest
from foldcar.store.reader import Store
from foldcar.store.trial_paths import trial_path
from foldcar.store.trial_records import Ending, TrialDesign
from foldcar.store.trial_writer import CarFacts, Drive, write_trials
from foldcar.trials.camera.film import read_film
from foldcar.trials.camera.filming import propose
from foldcar.trials.camera.lens import Lens
from foldcar.trials.camera.markers import course_json
from foldcar.trials.camera.poses import CarMarker
from foldcar.trials.camera.tracking import smooth, track
from forked_foldcar import original
from study_car import car_texts


@pytest.fixture(scope="module")
def trial(tmp_path_factory: Any) -> Any:
    """A store with a trial, its film with four frames dropped, and the true pose at each time of the film."""
    folder = tmp_path_factory.mktemp("film")
    body, settings = car_texts(95, 8)
    request = RunRequest("car", "scene", json.dumps({**json.loads(settings), "path_interval_s": 0.01}), "t", 0)
    (answer,) = Carsim().run({"car": body}, {"scene": json.dumps(SCENE)}, [request])
    path = numpy.array(answer["path"])
    driven = pose_at(path, START_S)

    def truth(at_s: float) -> Any:
        # The simulation ends at the goal, the car drives on.
        beyond_s = max(0.0, at_s - START_S - path[-1, 0])
        return driven(at_s) + beyond_s * numpy.array([0.69, 0, 0, 0, 0, 0])

    with write_trials(folder / "s.db") as writer:
        drive = Drive(json.loads(body), json.loads(settings), SCENE, "fingerprint", "box.scenic", 0)
        number = writer.begin("1", TrialDesign("W_B_W", {}), drive, {}, CarFacts("b", "d", "p", "built"), "gone.tlog", "")
        writer.complete(number, Ending("stuck", "key", None, "", None))
    film = Film(replace(FILMING, dropped=(25, 26, 27, 40)), floor_things(), Car(), truth)
    film.write(folder / "trial.mp4", START_S + path[-1, 0] + 0.15)
    (folder / "course.json").write_text(json.dumps(course_json(COURSE)))
    return folder, truth, answer


def test_a_film_gives_path_start_and_outcome(trial: Any) -> None:
    folder, truth, answer = trial

    options = ["--trial", "1", "--store", "s.db", "--course", "course.json", "--csv", "p.csv", "--json"]
    done = original().run(["track", "trial.mp4", *options], folder)

    assert done.returncode == 0, done.stderr
    output = json.loads(done.stdout)
    # The rows' read-out is known to half of it.
    assert abs(output["start_s"] - START_S) < 0.02
    assert (output["outcome"], answer["outcome"]) == ("passed", "passed")
    assert abs(output["end_s"] - answer["elapsed_time_s"]) < 0.03 and abs(output["end_x_m"] - 1.0) < 0.01
    assert "stored as stuck: foldcar trials correct s.db 1 --outcome passed" in done.stderr
    with (folder / "p.csv").open(newline="") as file:
        rows = [{name: float(text) for name, text in row.items()} for row in csv.DictReader(file)]
    path = numpy.array([list(row.values())[:7] for row in rows])
    shift_s = min(numpy.arange(-0.02, 0.02, 0.001), key=lambda s: numpy.median(_off(path, truth, s)[0]))
    place_m, angles = _off(path, truth, shift_s)
    assert abs(shift_s) < 0.015
    assert numpy.median(place_m) < 0.002 and numpy.quantile(place_m, 0.95) < 0.008
    assert numpy.degrees(numpy.median(numpy.abs(angles), axis=0)).max() < 0.5
    # The film's errors are as large as it says.
    spread_m2 = numpy.median([row["var_x_m2"] + row["var_y_m2"] for row in rows])
    said_m = numpy.hypot(max(output["frame_error_m"]), numpy.sqrt(spread_m2))
    assert numpy.median(place_m) < 2 * said_m < 0.02
    # Without a log the replay is of the film.
    with Store.open(folder / "s.db") as store:
        shown, kept = trial_path(store, store.trial(1)), store.track(1)
    assert shown.rows is not None and abs(shown.rows[-1, 0] - path[-1, 0]) < 1e-3
    assert kept is not None and len(kept.rows) == len(rows) and kept.film == "trial.mp4"


def _off(path: Any, truth: Any, shift_s: float) -> tuple[Any, Any]:
    off = numpy.array([row[1:] - truth(row[0] + START_S + shift_s) for row in path])
    off[:, 3:] = numpy.remainder(off[:, 3:] + numpy.pi, 2 * numpy.pi) - numpy.pi
    return numpy.linalg.norm(off[:, :2], axis=1), off[:, 3:]


def test_places_by_a_photo_are_a_correction_of_the_trial(trial: Any, tmp_path: Path) -> None:
    (tmp_path / "s.db").write_bytes((trial[0] / "s.db").read_bytes())
    scene = {**SCENE, "start": {"x_m": 0.11, "y_m": 0.0, "heading_rad": 0.0}}

    with write_trials(tmp_path / "s.db") as writer:
        made = [writer.put_deviations(1, {"car": (0.01, 0.02, -0.03)}, scene, "by photo.jpg", "Ada") for _ in range(2)]

    with Store.open(tmp_path / "s.db") as store:
        result, drive = store.trial(1), store.trial_drive(1)
        (correction,) = store.corrections(1)
    assert [len(batch) for batch in made] == [1, 0]
    assert result.deviations == {"car": (0.01, 0.02, -0.03)} and drive is not None and json.loads(drive[2]) == scene
    assert (correction.field, correction.before, correction.reason) == ("deviations", "{}", "by photo.jpg")


def played_at(trial: Any, fps: float) -> str:
    """The name of a copy of the trial's film, of 30 frames a second, that is played at another rate."""
    frames = list(read_film(trial[0] / "trial.mp4"))
    height, width = frames[0][1].shape
    name = f"{fps:g}.mp4"
    writer = cv2.VideoWriter(str(trial[0] / name), cv2.VideoWriter_fourcc(*"mp4v"), fps, (width, height), False)
    for _, grey in frames:
        writer.write(grey)
    writer.release()
    return name


def test_a_film_at_another_speed_is_refused_or_remarked_on(trial: Any) -> None:
    options = ["--trial", "1", "--store", "s.db", "--course", "course.json"]
    slow = original().run(["track", played_at(trial, 15.0), *options], trial[0])
    of_24 = original().run(["track", played_at(trial, 24.0), *options], trial[0])

    assert slow.returncode == 2
    assert re.search(r"15\.mp4: the car sets off (1\.[89]|2|2\.[012]) times as slow as in simulation", slow.stderr)
    assert of_24.returncode == 0
    assert re.search(r"24\.mp4: the car sets off 1\.[23] times as slow as in simulation: if the film was", of_24.stderr)


@pytest.mark.parametrize(
    ("scene", "elapsed_s", "message"),
    [
        ({"start": {**SCENE["start"], "x_m": 0.0}}, None, "is a film of another trial: the car began 100 mm"),
        ({}, 0.5, "ended after 0.50 s: it is a film of another trial"),
    ],
)
def test_a_film_of_another_trial_is_refused(
    trial: Any, tmp_path: Path, scene: Any, elapsed_s: float | None, message: str
) -> None:
    body, settings = (json.loads(text) for text in car_texts(95, 8))
    with write_trials(tmp_path / "s.db") as writer:
        drive = Drive(body, settings, {**SCENE, **scene}, "fingerprint", "box.scenic", 0)
        number = writer.begin("1", TrialDesign("W_B_W", {}), drive, {}, CarFacts("b", "d", "p", "built"), "gone.tlog", "")
        writer.complete(number, Ending("stuck", "key", elapsed_s, "", None))

    options = ["--trial", "1", "--store", str(tmp_path / "s.db"), "--course", "course.json"]
    done = original().run(["track", "trial.mp4", *options], trial[0])

    assert done.returncode == 2 and message in done.stderr
    with Store.open(tmp_path / "s.db") as opened:
        assert opened.track(1) is None


def test_endings_follow_the_simulators_rules() -> None:
    times_s = numpy.arange(0, 12, 0.05)
    still = numpy.zeros((len(times_s), 6))
    driving = still.copy()
    driving[:, 0] = 0.2 * times_s
    aside, tipped = driving.copy(), driving.copy()
    aside[:, 1] = times_s
    tipped[20:, 5] = 1.4

    def outcome(poses: Any, until: int = len(times_s), limit_s: float = 11.0, film_s: float = 12.0) -> Any:
        return propose(times_s[:until], poses[:until], SCENE, limit_s, False, film_s)

    passed = outcome(driving)
    assert (passed.outcome, round(passed.time_s, 2), round(passed.x_m, 3)) == ("passed", 5.0, 1.0)
    assert (outcome(still).outcome, outcome(still).time_s) == ("stuck", 4.0)
    assert (outcome(aside).outcome, outcome(tipped).outcome) == ("off_course", "tipped")
    assert outcome(driving, limit_s=3.0).outcome == "timeout"
    assert outcome(driving, until=20).why == "its marker is not seen any more"
    assert outcome(driving, until=20, film_s=1.0).why == "the film ends before the drive"


def test_the_smooth_path_leaves_wrong_readings_out() -> None:
    chance = numpy.random.default_rng(2)
    times_s = numpy.sort(chance.uniform(0, 3, 90))
    true = numpy.column_stack([0.5 * times_s, 0.1 * numpy.sin(2 * times_s), *[0 * times_s] * 4])
    noise = numpy.array([0.002, 0.002, 0.002, 0.01, 0.01, 0.01])
    poses = true + noise * chance.standard_normal(true.shape)
    poses[40, :2] += 0.1
    spread = numpy.repeat(numpy.diag(noise**2)[None], len(poses), axis=0)

    path, spreads, used = smooth(times_s, poses, spread)

    assert numpy.flatnonzero(~used).tolist() == [40]
    off = path[used] - true[used]
    assert numpy.sqrt(numpy.mean(off[:, 0] ** 2)) < 0.0018
    scores = off / numpy.sqrt(numpy.array([numpy.diag(covariance) for covariance in spreads[used]]))
    assert 0.6 < numpy.sqrt(numpy.mean(scores**2)) < 1.2


def test_a_film_is_in_the_mcap_of_its_trial(tmp_path: Path) -> None:
    from mcap.reader import make_reader

    log = Path(__file__).parents[1] / "data" / "trial.tlog"
    rows = [[0.05 * k, 0.01 * k, *[0.0] * 14] for k in range(20)]

    export_mcap(log, tmp_path / "t.mcap", {}, filmed=rows)

    with (tmp_path / "t.mcap").open("rb") as file:
        poses = [(m.log_time, json.loads(m.data)) for _, c, m in make_reader(file).iter_messages(topics=["/camera/pose"])]
    assert [content["x_m"] for _, content in poses] == [row[1] for row in rows]
    assert abs((poses[-1][0] - poses[0][0]) / 1e9 - 0.95) < 1e-6


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("gone.mp4",), "gone.mp4: no such file"),
        (("text.mp4",), "text.mp4: cannot be read as a film (MP4, MOV, MKV, AVI)"),
        (("text.heic",), "text.heic: HEIC photos are not supported: save it as JPEG, or set the camera to JPEG"),
        (("text.jpg", "--listing", "l.json"), "text.jpg: cannot be read as a picture (JPEG, PNG)"),
        (("text.jpg",), "text.jpg: a photo needs --listing LISTING, whose program says where the obstacles are"),
        (("gone.mp4", "--course", "c.json"), "c.json: floor: two markers have the id 0"),
        (("gone.mp4", "--course", "text.mp4"), "text.mp4: Invalid JSON: expected ident at line 1 column 2"),
        (
            ("gone.mp4", "--lens", "lens.json"),
            "lens.json: focal_px: Input should be greater than or equal to 100, not -5",
        ),
    ],
)
def test_what_cannot_be_used_is_told_in_a_line(
    trial: Any, tmp_path: Path, foldcar: Any, words: Any, message: str
) -> None:
    for name in ("text.mp4", "text.jpg", "text.heic"):
        (tmp_path / name).write_bytes(b"no film or photo")
    course = course_json(COURSE)
    course["floor"][1]["id"] = 0
    (tmp_path / "c.json").write_text(json.dumps(course))
    lens = Lens(1280, 720, -5, (640, 360))
    (tmp_path / "lens.json").write_text(json.dumps(asdict(lens)))
    (tmp_path / "s.db").write_bytes((trial[0] / "s.db").read_bytes())

    answer = foldcar("track", *words, "--trial", "1", "--store", "s.db")

    assert (answer.returncode, answer.stdout, answer.stderr) == (2, "", f"foldcar: error: {message}\n")


def test_a_camera_that_moves_is_refused(tmp_path: Path) -> None:
    pictures = [(0.0, photo(COURSE)), (0.5, photo(COURSE, place_m=(0.52, -1.3, 1.2)))]
    # Each is shown long enough to be looked at.
    frames = [(at_s + k / 30, grey) for at_s, grey in pictures for k in range(15)]

    with pytest.raises(FoldcarError, match=r"^film: the camera moved, .*: use a tripod$"):
        track(frames, "film", COURSE, None, lambda scale: CarMarker(0.05, 0.0, 0.06), None)  # type: ignore[arg-type]
