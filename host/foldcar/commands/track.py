"""`foldcar markers` prints markers, `lens` calibrates a camera, `track` follows a car through a film of its trial."""

import csv
import io
import json
import math
import re
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from foldcar.commands.options import Json, OutputFolder, check_distinct, output_file, print_note, print_result
from foldcar.errors import FoldcarError

if TYPE_CHECKING:
    from foldcar.trials.camera.lens import Lens
    from foldcar.trials.camera.markers import Course

COURSE, SHEETS = "course.json", "markers.pdf"

CourseFile = Annotated[
    Path | None,
    typer.Option("--course", metavar="FILE", help="course.json with the markers' positions; default: 1500 × 1000 mm."),
]
LensFile = Annotated[
    Path | None,
    typer.Option(
        "--lens", metavar="FILE", help="Lens file of `foldcar lens`; default: fit the lens to the floor markers."
    ),
]
NewLens = Annotated[
    Path, typer.Option("-o", "--output", metavar="FILE", callback=output_file, help="JSON file to write.")
]


def markers(
    output: OutputFolder,
    course: Annotated[
        str, typer.Option(metavar="LxW", help="Length and width between the floor markers (mm).")
    ] = "1500x1000",
    obstacles: Annotated[
        int, typer.Option(metavar="N", min=0, max=26, help="Number of obstacles to print markers for.")
    ] = 4,
    as_json: Json = False,
) -> None:
    """Print markers for a camera beside the course.

    It writes markers.pdf, to be printed at 100 %, and course.json, which says where the markers lie.

    \b
    Example: foldcar markers -o markers --course 1500x1000
    """
    from foldcar.outputs import atomic_file, make_output_folder
    from foldcar.trials.camera.markers import SIDE_MM, course_json, rectangle
    from foldcar.trials.camera.sheets import sheets

    match = re.fullmatch(r"([0-9]+(?:\.[0-9]+)?)x([0-9]+(?:\.[0-9]+)?)", course)
    if match is None:
        raise FoldcarError(f'--course "{course}": is not LENGTHxWIDTH in mm, such as 1500x1000')
    for size in match.groups():
        if not SIDE_MM[0] <= float(size) <= SIDE_MM[1]:
            raise FoldcarError(f"--course {course}: {size} is not from {SIDE_MM[0]:g} to {SIDE_MM[1]:g} mm")
    length_m, width_m = (float(size) / 1000 for size in match.groups())
    layout = rectangle(length_m, width_m)
    pdf = sheets(layout, obstacles)
    make_output_folder(output)
    sheets_file, course_file = output / SHEETS, output / COURSE
    with atomic_file(sheets_file) as binary:
        binary.write(pdf)
    if course_file.exists():
        print_note(f"{course_file}: exists and was not changed")
    else:
        with atomic_file(course_file) as binary:
            binary.write((json.dumps(course_json(layout), indent=1) + "\n").encode())
    print_result(as_json, {"files": [sheets_file, course_file]}, sheets_file, course_file)


def lens(
    files: Annotated[list[Path], typer.Argument(metavar="FILE...", help="Film or photos of the board.")],
    output: NewLens,
    as_json: Json = False,
) -> None:
    """Calibrate a camera's lens with the board that `foldcar markers` prints.

    Lock the focus. Hold the camera close to the board. Turn and tilt the board, and move it through all parts of the
    picture, including the corners.

    \b
    Example: foldcar lens board.mp4 -o phone.json
    """
    from dataclasses import asdict

    from foldcar.trials.camera.lens import calibrate, write_lens

    check_distinct(files, [output])
    fitted, views = calibrate(files)
    write_lens(fitted, output)
    line = f"{output}: focal length {fitted.focal_px:.0f} pixels, fits {views} views to {fitted.error_px:.2f} pixels"
    print_result(as_json, {"files": [output], "views": views, "lens": asdict(fitted)}, line)


def track(
    store: Annotated[Path, typer.Option("--store", metavar="FILE", help="Store with the trial.")],
    trial: Annotated[int, typer.Option("--trial", metavar="N", min=1, help="Number of the trial.")],
    file: Annotated[
        Path | None,
        typer.Argument(
            metavar="FILM",
            help="Film of the trial, or a photo taken before it (.jpg, .png); default: the film attached to the trial.",
        ),
    ] = None,
    course: CourseFile = None,
    lens: LensFile = None,
    listing: Annotated[
        Path | None, typer.Option(metavar="LISTING", help="Listing of the trial's experiment; needed with a photo.")
    ] = None,
    path: Annotated[
        Path | None, typer.Option("--csv", metavar="FILE", callback=output_file, help="CSV file to write the path to.")
    ] = None,
    operator: Annotated[
        str, typer.Option(metavar="NAME", help="Your name; stored with positions that are measured in a photo.")
    ] = "",
    as_json: Json = False,
) -> None:
    """Follow a car through a film of its trial.

    The path is stored with the trial. If the film shows another outcome than the stored one, a correction is proposed.
    From a photo, the positions of car and obstacles are measured and stored.

    \b
    Example: foldcar track trial.mp4 --trial 7 --store study.db
    """
    file = file or _attached_film(store, trial)
    from foldcar.trials.camera.lens import PHOTOS, read_lens
    from foldcar.trials.camera.markers import read_course, rectangle

    check_distinct([file, store, *(option for option in (course, lens, listing) if option)], [path])
    layout = read_course(course) if course else rectangle()
    camera = read_lens(lens) if lens else None
    if file.suffix.lower() in PHOTOS:
        if path is not None:
            raise FoldcarError(f"{file}: a photo has no path for --csv")
        _photo(file, store, trial, layout, camera, listing, operator, as_json)
    else:
        _film(file, store, trial, layout, camera, path, as_json)


def _attached_film(store: Path, number: int) -> Path:
    """Return the film that was last attached to a trial. Raises FoldcarError if it is missing or has changed."""
    from foldcar.store.log_files import referred_file, sha256_of
    from foldcar.store.reader import Store
    from foldcar.store.trial_records import FILM

    with Store.open(store) as reader:
        reader.trial(number)
        films = [media for media in reader.media(number) if media.kind == FILM]
    if not films:
        raise FoldcarError(f"{store}: trial {number} has no film; name one: `foldcar track FILM --trial {number}`")
    film = referred_file(store, films[-1].file)
    if len(films) > 1:
        print_note(f"trial {number} has {len(films)} films; the last one is tracked: {film}")
    digest = sha256_of(film)
    if digest != films[-1].sha256:
        reason = "is missing" if digest is None else "has changed since it was attached: its SHA-256 differs"
        raise FoldcarError(f"{film}: the film of trial {number} of {store} {reason}")
    return film


def _film(
    film: Path, store: Path, number: int, course: "Course", lens: "Lens | None", path: Path | None, as_json: bool
) -> None:
    """Track the car in a trial's film, store its path (also as CSV in ``path``), and print what the film shows."""
    from foldcar.simulation.carsim import Carsim
    from foldcar.store.reader import Store
    from foldcar.store.trial_writer import write_trials
    from foldcar.trials.camera.filming import track_trial

    with Store.open(store) as reader:
        trial = reader.trial(number)
        tracked, remarks = track_trial(reader, number, film, course, lens, Carsim())
    with write_trials(store) as writer:
        writer.put_track(tracked)
    if path is not None:
        _write_csv(path, tracked.rows)
    facts = tracked.facts
    error_mm, error_deg = 1000 * max(facts["frame_error_m"]), math.degrees(facts["heading_error_rad"])
    seen_text = f"{len(tracked.rows)} poses, the car is seen in {100 * facts['seen']:.0f} % of the frames"
    end_text = f"{1000 * facts['end_x_m']:.0f}, {1000 * facts['end_y_m']:.0f} mm"
    lines = [
        f"trial {number}: {seen_text}",
        f"standard error of the frame: {error_mm:.1f} mm, {error_deg:.1f}°",
        f"start at {tracked.start_s:.2f} s of the film, ±{1000 * facts['start_error_s']:.0f} ms",
        f"the film shows: {tracked.outcome or 'no outcome'} after {facts['end_s']:.2f} s at {end_text}: {facts['why']}",
    ]
    for remark in remarks:
        print_note(f"{film}: {remark}")
    if tracked.outcome is not None and tracked.outcome != trial.outcome:
        print_note(
            f"trial {number} is stored as {trial.outcome}: foldcar trials correct {store} {number} --outcome "
            f'{tracked.outcome} --reason "seen on the film"'
        )
    result = {
        "trial": number, "start_s": tracked.start_s, "outcome": tracked.outcome, **facts, "poses": len(tracked.rows),
        "files": [path] if path else [],
    }  # fmt: skip
    print_result(as_json, result, *lines, *([path] if path else []))


def _photo(
    photo: Path, store: Path, number: int, course: "Course", lens: "Lens | None", listing: Path | None, operator: str,
    as_json: bool,
) -> None:  # fmt: skip
    """Measure the poses of car and obstacles in a photo, store them as the trial's deviations, and print them."""
    from foldcar.commands.tables import correction_text
    from foldcar.simulation.carsim import Carsim
    from foldcar.simulation.heights import carsim_heights
    from foldcar.store.reader import Store
    from foldcar.store.trial_writer import write_trials
    from foldcar.store.writer import canonical_json
    from foldcar.study.environments import Environment
    from foldcar.study.experiments import read_study
    from foldcar.trials.camera.film import read_photo
    from foldcar.trials.camera.filming import car_marker
    from foldcar.trials.camera.ground import standing
    from foldcar.trials.camera.photo import measure_placement
    from foldcar.trials.placement import lettered, scene_as_placed

    if listing is None:
        raise FoldcarError(f"{photo}: a photo needs --listing LISTING, whose program says where the obstacles are")
    grey = read_photo(photo)
    with Store.open(store) as reader:
        trial, drive = reader.trial(number), reader.trial_drive(number)
    if trial.sample is None or drive is None:
        raise FoldcarError(f"{store}: trial {number} was imported without a scene, so there are no planned positions")
    (experiment,) = read_study(listing, trial.experiment).experiments
    scene, obstacles = Environment(experiment).sample_with_obstacles(trial.sample)
    obstacles_by_letter = lettered(obstacles)
    if canonical_json(scene_as_placed(scene, obstacles_by_letter, trial.deviations)) != drive.scene:
        raise FoldcarError(
            f"{listing}: sample {trial.sample} of {experiment.program} differs from the scene of trial {number}: "
            "the program, its parameters, its seed or foldcar have changed; use the listing and program of the trial"
        )
    body: dict[str, Any] = json.loads(drive.body)
    ground = standing(scene, carsim_heights(Carsim()), body)
    seen = measure_placement(grey, str(photo), course, lens, scene, obstacles_by_letter, car_marker(body, course), ground)
    for remark in seen.remarks:
        print_note(f"{photo}: {remark}")
    for name in seen.missing:
        print_note(f"{photo}: the marker of {name} is not visible; its stored position stays unchanged")
    deviations = dict(trial.deviations)
    for name, (x, y, turn) in seen.deviations.items():
        deviations[name] = (round(x, 5), round(y, 5), round(turn, 5))
    if not seen.deviations:
        raise FoldcarError(f"{photo}: shows no marker of the car or of an obstacle")
    errors = [
        f"{name} ±{1000 * max(x, y):.1f} mm ±{math.degrees(turn):.1f}°" for name, (x, y, turn) in seen.errors.items()
    ]
    with write_trials(store) as writer:
        corrections = writer.put_deviations(
            number,
            deviations,
            scene_as_placed(scene, obstacles_by_letter, deviations),
            f"by {photo.name}: {', '.join(errors)}",
            operator,
        )
    lines = []
    for name, (x, y, turn) in seen.deviations.items():
        error_mm, error_deg = 1000 * max(seen.errors[name][:2]), math.degrees(seen.errors[name][2])
        place = f"{1000 * x:+6.1f} {1000 * y:+6.1f} mm {math.degrees(turn):+5.1f}°"
        lines.append(f"{name:<4} {place}  ±{error_mm:.1f} mm ±{error_deg:.1f}°")
    result = {
        "trial": number, "deviations": seen.deviations, "errors": seen.errors, "missing": seen.missing,
        "corrections": len(corrections),
    }  # fmt: skip
    print_result(as_json, result, *lines, *map(correction_text, corrections))


def _write_csv(file: Path, rows: Any) -> None:
    """Write the rows of a filmed path as CSV."""
    from foldcar.link.mcap_export import FILMED
    from foldcar.outputs import atomic_file

    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows([FILMED, *rows])
    with atomic_file(file) as binary:
        binary.write(text.getvalue().encode())
