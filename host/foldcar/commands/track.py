"""`foldcar markers`, `lens`, `track`: markers to print, a camera's lens, where a car was in a film of its trial."""

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
    typer.Option("--course", metavar="FILE", help="Where the markers lie (course.json); default: 1500 × 1000 mm."),
]
LensFile = Annotated[
    Path | None, typer.Option("--lens", metavar="FILE", help="The camera's lens; default: fitted to the floor's markers.")
]
NewLens = Annotated[
    Path, typer.Option("-o", "--output", metavar="FILE", callback=output_file, help="JSON file to write.")
]


def markers(
    output: OutputFolder,
    course: Annotated[
        str, typer.Option(metavar="LxW", help="Length and width between the floor's markers (mm).")
    ] = "1500x1000",
    obstacles: Annotated[int, typer.Option(metavar="N", min=0, max=26, help="How many obstacles get a card.")] = 4,
    as_json: Json = False,
) -> None:
    """Print markers for a camera beside the course.

    The folder gets markers.pdf, to print at 100 %, and course.json, which says where they lie.

    \b
    Example: foldcar markers -o markers --course 1500x1000
    """
    from foldcar.outputs import atomic_file, make_output_folder
    from foldcar.trials.camera.markers import SIDE_MM, course_json, rectangle
    from foldcar.trials.camera.sheets import sheets

    found = re.fullmatch(r"([0-9]+(?:\.[0-9]+)?)x([0-9]+(?:\.[0-9]+)?)", course)
    if found is None:
        raise FoldcarError(f'--course "{course}": is not LENGTHxWIDTH in mm, as 1500x1000')
    for text in found.groups():
        if not SIDE_MM[0] <= float(text) <= SIDE_MM[1]:
            raise FoldcarError(f"--course {course}: {text} is not from {SIDE_MM[0]:g} to {SIDE_MM[1]:g} mm")
    made = rectangle(*(float(text) / 1000 for text in found.groups()))
    pdf = sheets(made, obstacles)
    make_output_folder(output)
    files = [output / SHEETS, output / COURSE]
    with atomic_file(files[0]) as binary:
        binary.write(pdf)
    if files[1].exists():
        print_note(f"{files[1]}: is there already and stays as it is")
    else:
        with atomic_file(files[1]) as binary:
            binary.write((json.dumps(course_json(made), indent=1) + "\n").encode())
    print_result(as_json, {"files": files}, *files)


def lens(
    files: Annotated[list[Path], typer.Argument(metavar="FILE...", help="A film of the board, or photos.")],
    output: NewLens,
    as_json: Json = False,
) -> None:
    """Learn a camera's lens from the printed board.

    Film it near and in the corners of the picture, turned and tilted, with the focus locked.

    \b
    Example: foldcar lens board.mp4 -o phone.json
    """
    from dataclasses import asdict

    from foldcar.trials.camera.lens import calibrate, write_lens

    check_distinct(files, [output])
    found, views = calibrate(files)
    write_lens(found, output)
    line = f"{output}: focal length {found.focal_px:.0f} pixels, fits {views} views to {found.error_px:.2f} pixels"
    print_result(as_json, {"files": [output], "views": views, "lens": asdict(found)}, line)


def track(
    store: Annotated[Path, typer.Option("--store", metavar="FILE", help="The store that holds the trial.")],
    trial: Annotated[int, typer.Option("--trial", metavar="N", min=1, help="Number of the trial.")],
    file: Annotated[
        Path | None,
        typer.Argument(
            metavar="FILM",
            help="Film of the trial, or a photo from before it (.jpg, .png); default: the film that was attached to it.",
        ),
    ] = None,
    course: CourseFile = None,
    lens: LensFile = None,
    listing: Annotated[
        Path | None, typer.Option(metavar="LISTING", help="With a photo: the listing, which knows the obstacles.")
    ] = None,
    path: Annotated[
        Path | None, typer.Option("--csv", metavar="FILE", callback=output_file, help="The path as CSV, too.")
    ] = None,
    operator: Annotated[str, typer.Option(metavar="NAME", help="Who tracks; kept with what a photo changes.")] = "",
    as_json: Json = False,
) -> None:
    """Follow a car through a film of its trial.

    The path is kept with the trial; the outcome that the film shows is proposed. From a photo, car and obstacles get
    their places.

    \b
    Example: foldcar track trial.mp4 --trial 7 --store study.db
    """
    file = file or _attached_film(store, trial)
    from foldcar.trials.camera.lens import PHOTOS, read_lens
    from foldcar.trials.camera.markers import read_course, rectangle

    check_distinct([file, store, *(one for one in (course, lens, listing) if one)], [path])
    known = read_course(course) if course else rectangle()
    camera = read_lens(lens) if lens else None
    if file.suffix.lower() in PHOTOS:
        if path is not None:
            raise FoldcarError(f"{file}: a photo has no path for --csv")
        _photo(file, store, trial, known, camera, listing, operator, as_json)
    else:
        _film(file, store, trial, known, camera, path, as_json)


def _attached_film(store: Path, number: int) -> Path:
    """The film that was attached to a trial, the last of several; FoldcarError if there is none, or if it has changed."""
    from foldcar.store.log_files import referred_file, sha256_of
    from foldcar.store.reader import Store
    from foldcar.store.trial_records import FILM

    with Store.open(store) as opened:
        opened.trial(number)
        films = [one for one in opened.media(number) if one.kind == FILM]
    if not films:
        raise FoldcarError(f"{store}: trial {number} has no film: name one, as `foldcar track FILM --trial {number}`")
    film = referred_file(store, films[-1].file)
    if len(films) > 1:
        print_note(f"trial {number} has {len(films)} films: {film} is tracked")
    digest = sha256_of(film)
    if digest != films[-1].sha256:
        why = "no such file" if digest is None else "is not the film that was attached: its SHA-256 is another"
        raise FoldcarError(f"{film}: {why}, which trial {number} of {store} names")
    return film


def _film(
    film: Path, store: Path, number: int, course: "Course", lens: "Lens | None", path: Path | None, as_json: bool
) -> None:
    from foldcar.simulation.carsim import Carsim
    from foldcar.store.reader import Store
    from foldcar.store.trial_writer import write_trials
    from foldcar.trials.camera.filming import track_trial

    with Store.open(store) as opened:
        trial = opened.trial(number)
        found, remarks = track_trial(opened, number, film, course, lens, Carsim())
    with write_trials(store) as writer:
        writer.put_track(found)
    if path is not None:
        _write_csv(path, found.rows)
    facts = found.facts
    error_mm, error_deg = 1000 * max(facts["frame_error_m"]), math.degrees(facts["heading_error_rad"])
    seen = f"{len(found.rows)} poses, the car is seen in {100 * facts['seen']:.0f} % of the frames"
    end = f"{1000 * facts['end_x_m']:.0f}, {1000 * facts['end_y_m']:.0f} mm"
    lines = [
        f"trial {number}: {seen}",
        f"place known to {error_mm:.1f} mm, heading to {error_deg:.1f}°, on the whole",
        f"start at {found.start_s:.2f} s of the film, known to {1000 * facts['start_error_s']:.0f} ms",
        f"the film shows: {found.outcome or 'no outcome'} after {facts['end_s']:.2f} s at {end}: {facts['why']}",
    ]
    for remark in remarks:
        print_note(f"{film}: {remark}")
    if found.outcome is not None and found.outcome != trial.outcome:
        print_note(
            f"trial {number} is stored as {trial.outcome}: foldcar trials correct {store} {number} --outcome "
            f'{found.outcome} --reason "seen on the film"'
        )
    result = {
        "trial": number, "start_s": found.start_s, "outcome": found.outcome, **facts, "poses": len(found.rows),
        "files": [path] if path else [],
    }  # fmt: skip
    print_result(as_json, result, *lines, *([path] if path else []))


def _photo(
    photo: Path, store: Path, number: int, course: "Course", lens: "Lens | None", listing: Path | None, operator: str,
    as_json: bool,
) -> None:  # fmt: skip
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
    from foldcar.trials.camera.photo import find_placed
    from foldcar.trials.placement import lettered, placed

    if listing is None:
        raise FoldcarError(f"{photo}: with a photo --listing names the listing, whose program knows the obstacles")
    grey = read_photo(photo)
    with Store.open(store) as opened:
        trial, drive = opened.trial(number), opened.trial_drive(number)
    if trial.sample is None or drive is None:
        raise FoldcarError(f"{store}: trial {number} was imported without a scene: nothing was planned")
    (experiment,) = read_study(listing, trial.experiment).experiments
    scene, obstacles = Environment(experiment).sample_with_obstacles(trial.sample)
    things = lettered(obstacles)
    if canonical_json(placed(scene, things, trial.deviations)) != drive[2]:
        raise FoldcarError(
            f"{listing}: sample {trial.sample} of {experiment.program} is another scene than trial {number} drove in: "
            "the program, its parameters, its seed or foldcar have changed; name listing and program as they were"
        )
    body: dict[str, Any] = json.loads(drive[0])
    ground = standing(scene, carsim_heights(Carsim()), body)
    found = find_placed(grey, str(photo), course, lens, scene, things, car_marker(body, course), ground)
    for remark in found.remarks:
        print_note(f"{photo}: {remark}")
    for name in found.missing:
        print_note(f"{photo}: the marker of {name} is not seen: it stays as the trial has it")
    deviations = dict(trial.deviations)
    for name, (x, y, turn) in found.deviations.items():
        deviations[name] = (round(x, 5), round(y, 5), round(turn, 5))
    if not found.deviations:
        raise FoldcarError(f"{photo}: shows the marker of neither car nor obstacles")
    errors = [
        f"{name} ±{1000 * max(x, y):.1f} mm ±{math.degrees(turn):.1f}°" for name, (x, y, turn) in found.errors.items()
    ]
    with write_trials(store) as writer:
        made = writer.place(
            number, deviations, placed(scene, things, deviations), f"by {photo.name}: {', '.join(errors)}", operator
        )
    lines = []
    for name, (x, y, turn) in found.deviations.items():
        error_mm, error_deg = 1000 * max(found.errors[name][:2]), math.degrees(found.errors[name][2])
        place = f"{1000 * x:+6.1f} {1000 * y:+6.1f} mm {math.degrees(turn):+5.1f}°"
        lines.append(f"{name:<4} {place}  ±{error_mm:.1f} mm ±{error_deg:.1f}°")
    result = {
        "trial": number, "deviations": found.deviations, "errors": found.errors, "missing": found.missing,
        "corrections": len(made),
    }  # fmt: skip
    print_result(as_json, result, *lines, *map(correction_text, made))


def _write_csv(file: Path, rows: Any) -> None:
    from foldcar.link.mcap_export import FILMED
    from foldcar.outputs import atomic_file

    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows([FILMED, *rows])
    with atomic_file(file) as binary:
        binary.write(text.getvalue().encode())
