"""Photographs of real markers, some half hidden: AprilTag's own detector tells where they are."""

import sys
from pathlib import Path

import cv2
import numpy
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[3] / "tools"))

from seed_files import SeedError
from tag_photos import tag_photos

from foldcar.trials.camera.detection import Detector


def test_markers_in_photographs_are_read_and_lie_where_another_detector_has_them(tmp_path: Path) -> None:
    try:
        photos = tag_photos(tmp_path)
    except SeedError as error:
        pytest.skip(f"{error}")
    sides_px, read_px, errors_px, ids = [], [], [], []

    for file, tags in photos:
        grey = cv2.imread(str(file), cv2.IMREAD_GRAYSCALE)
        found_tags = Detector().find_all(grey)
        ids += [number for number, _ in found_tags]
        for tag in tags:
            # AprilTag counts from the first pixel's corner, not from its middle.
            true = numpy.array(tag) - 0.5
            sides_px.append(numpy.linalg.norm(true - numpy.roll(true, 1, axis=0), axis=1).min())
            near = [c for _, c in found_tags if numpy.linalg.norm(c.mean(axis=0) - true.mean(axis=0)) < 3]
            if near:
                # Which corner is the first is each detector's own.
                away = numpy.linalg.norm(near[0][:, None] - true[None], axis=2)
                assert sorted(away.argmin(axis=1)) == [0, 1, 2, 3]
                read_px.append(sides_px[-1])
                errors_px.append(away.min(axis=1).max())

    # The largest that is not read has its edge in a gripper.
    least_px = 13
    large, read = (sum(side >= least_px for side in sides) for sides in (sides_px, read_px))
    assert (len(sides_px), set(ids)) == (47, {0}) and len(read_px) >= 41 and read >= large - 1
    # The published corners are those of lines that were not refined, good to half a pixel.
    assert numpy.median(errors_px) < 0.6 and numpy.quantile(errors_px, 0.9) < 1.2
