"""What a car's log tells of a drive, beside the truth that a simulated car's log has as well."""

import json
import math
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy
import pytest

from foldcar.link.connection import CAR_COMPONENT, CAR_SYSTEM
from foldcar.link.dialect import load_dialect
from foldcar.link.log_features import LogFeatures, log_features
from foldcar.link.tlog import TlogWriter, read_tlog, trial_start_s
from forked_foldcar import original
from live_car import LOG
from study_car import listing_of

PROGRAM = """
model model
ego = new Robot at (0, 0), facing -90 deg
bump = new Bump at (0.4, 0.07), facing -80 deg
goal = new Goal at (0.9, 0), facing -90 deg
"""


def test_tilts_heading_and_time_of_a_drive_over_a_box_are_those_of_its_truth(tmp_path: Path, foldcar: Any) -> None:
    (tmp_path / "bump.scenic").write_text(PROGRAM)
    listing = listing_of("bump.scenic", {"width": [95]}, seed=1, timeout=5, environments=1)
    (tmp_path / "l.json").write_text(json.dumps(listing))
    linked = original().start(["link", "l.json", "--experiment", "1", "--sample", "0"], tmp_path)
    try:
        port = linked.stdout.readline().strip()
        done = foldcar(*LOG, "--port", port, "--yes", "--trials", "1", "--countdown", "1")
    finally:
        linked.terminate()
        linked.communicate()
    assert done.returncode == 0, done.stderr
    (file,) = tmp_path.glob("s-logs/*.tlog")

    features = log_features(file)
    shown = foldcar("trials", "replay", "s.db", "1")

    messages = [message for _, message in read_tlog(file)]
    start_s = trial_start_s(messages)
    assert start_s is not None and features.elapsed_time_s is not None
    true = [m for m in messages if m.get_type() == "FOLDCAR_TRUTH"]
    true = [m for m in true if 0 <= m.time_usec / 1e6 - start_s <= features.elapsed_time_s]
    ended_s = next(m.outcome_time for m in messages if m.get_type() == "FOLDCAR_TRUTH" and m.outcome)
    # The host stops the car when it has seen the end.
    assert -0.002 < features.elapsed_time_s - ended_s < 0.3
    assert features.tilt_error_rad is not None and features.heading_error_rad is not None
    roll, pitch = (max(abs(getattr(m, name)) for m in true) for name in ("roll", "pitch"))
    assert pitch > 0.08
    assert abs(features.max_roll_rad) == pytest.approx(roll, abs=3 * features.tilt_error_rad)
    assert abs(features.max_pitch_rad) == pytest.approx(pitch, abs=3 * features.tilt_error_rad)
    turned = numpy.unwrap([m.heading for m in true])
    assert features.heading_change_rad == pytest.approx(turned[-1] - turned[0], abs=3 * features.heading_error_rad)
    assert f"pitch {math.degrees(features.max_pitch_rad):+.1f}°" in shown.stdout


def written(file: Path, imu: bool, mv: tuple[int, ...], end: int) -> Path:
    """A log of a car that speeds up at 0.3 g for 0.5 s, which its filter takes for a pitch, and drives on."""
    dialect = load_dialect()
    mav = dialect.MAVLink(None, CAR_SYSTEM, CAR_COMPONENT)
    log = TlogWriter(file)
    for k in range(-10, 21):
        elapsed_ms, boot_ms = max(0, 100 * k), 5000 + 100 * k
        moving = 0 < k <= 5
        over = math.atan(0.3) * (1 - math.exp(-max(0, min(k, 5)) / 5)) * math.exp(-max(0, k - 5) / 5)
        sent = [mav.foldcar_trial_encode(boot_ms, 1, elapsed_ms, 5000, 0.5, 0.0, 2, end if k == 20 else 0, 0, 0, 0, 0)]
        sent += [mav.sys_status_encode(0, 0, 0, 0, mv[min(max(k, 0), len(mv) - 1)], -1, -1, 0, 0, 0, 0, 0, 0)]
        if imu:
            sent += [mav.attitude_encode(boot_ms, 0.0, over, 0.0, 0.0, 0.0, 0.0)]
            sent += [mav.scaled_imu_encode(boot_ms, 300 if moving else 0, 0, -1000, 0, 0, 0, 0, 0, 0)]
        for message in sent:
            log.write(message.pack(mav), 1_000_000 + 1000 * boot_ms)
    log.close()
    return file


def test_the_pull_of_an_acceleration_is_taken_off_the_pitch(tmp_path: Path) -> None:
    features = log_features(written(tmp_path / "a.tlog", True, (4000, 3700, 3800), 1))

    # Uncorrected it would be 0.18.
    assert features.max_pitch_rad is not None and abs(features.max_pitch_rad) < 0.05
    assert (features.elapsed_time_s, features.battery_sag_v, features.shocks_s) == (2.0, 0.3, ())


def test_what_a_log_does_not_tell_is_none(tmp_path: Path) -> None:
    without = log_features(written(tmp_path / "a.tlog", False, (65535,), 0))
    (tmp_path / "empty.tlog").write_bytes(b"")

    assert without == log_features(tmp_path / "empty.tlog") == LogFeatures()


def test_the_script_of_the_documentation_prints_the_voltages_of_a_log(tmp_path: Path) -> None:
    log = Path(__file__).parents[1] / "data" / "trial.tlog"
    page = (Path(__file__).parents[3] / "docs" / "trials.md").read_text(encoding="utf-8")
    (script,) = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    (name,) = re.findall(r'"(study-logs/\S+\.tlog)"', script)
    (tmp_path / name).parent.mkdir()
    shutil.copyfile(log, tmp_path / name)

    done = subprocess.run([sys.executable, "-c", script], cwd=tmp_path, capture_output=True, text=True, check=True)

    printed = [tuple(map(float, line.split())) for line in done.stdout.splitlines()]
    stored = [(time_us / 1e6, m.voltage_battery / 1000) for time_us, m in read_tlog(log) if m.get_type() == "SYS_STATUS"]
    assert len(printed) == 2 and numpy.array(printed) == pytest.approx(numpy.array(stored), rel=0, abs=1e-5)
