"""The servos' supply in the logs of trials, and what the belief makes of it."""

import hashlib
import sqlite3
from dataclasses import replace
from pathlib import Path

import pytest

from foldcar.belief.priors import NAMES, PARAMETERS, built_priors
from foldcar.evidence.evidence import read_evidence
from foldcar.evidence.supply import MeasuredSupply, measured_supply
from foldcar.link.connection import CAR_COMPONENT, CAR_SYSTEM
from foldcar.link.dialect import load_dialect
from foldcar.link.tlog import TlogWriter
from foldcar.store.reader import Store
from foldcar.store.trial_records import Trial
from swept_listing import foldcar, reported

NO_CELL = [65535] * 9


@pytest.fixture
def trial(tmp_path: Path, carsim_binary: Path) -> Trial:
    reported(tmp_path, (95, 120), 1)
    with Store.open(tmp_path / "s.db") as store:
        return store.trial(1)


def with_log(store: Path, trial: Trial, rest_mv: int, drive_mv: int) -> Trial:
    """The trial with a log of 2 s, in which the servos' supply has these voltages at rest and while driving."""
    dialect = load_dialect()
    mav = dialect.MAVLink(None, CAR_SYSTEM, CAR_COMPONENT)
    file = store.parent / "s-logs" / f"trial-{rest_mv}-20261122T11{drive_mv}Z.tlog"
    log = TlogWriter(file)
    for k in range(-10, 21):
        boot_ms, elapsed_ms, mv = 5000 + 100 * k, max(0, 100 * k), drive_mv if k > 0 else rest_mv
        end = dialect.FOLDCAR_END_TIME_LIMIT if k == 20 else 0
        battery = mav.battery_status_encode(1, 0, 0, 32767, [mv, *NO_CELL], -1, -1, -1, -1)
        for message in (mav.foldcar_trial_encode(boot_ms, 1, elapsed_ms, 5000, 0.5, 0.0, 2, end, 0, 0, 0, 0), battery):
            log.write(message.pack(mav), 1_000_000 + 1000 * boot_ms)
    log.close()
    return replace(trial, log=f"s-logs/{file.name}", log_sha256=hashlib.sha256(file.read_bytes()).hexdigest())


def test_the_loaded_voltage_is_compared_unless_the_simulator_loads_the_supply_itself(
    tmp_path: Path, trial: Trial
) -> None:
    store = tmp_path / "s.db"
    trials = [with_log(store, trial, 5000, 4600), with_log(store, trial, 5200, 4800), trial]

    plain = measured_supply(store, trials, {"supply_v": 5.0})
    resistive = measured_supply(store, trials, {"supply_v": 5.0, "supply_resistance_ohm": 0.25})

    assert plain.ratio == pytest.approx(4.7 / 5.0) and "4.70 V while driving in 2 trials" in str(plain.note)
    assert resistive.ratio == pytest.approx(5.1 / 5.0) and "5.10 V at rest in 2 trials" in str(resistive.note)


def test_without_a_plausible_reading_nothing_is_scaled(tmp_path: Path, trial: Trial) -> None:
    store = tmp_path / "s.db"
    changed = replace(with_log(store, trial, 5000, 4900), log_sha256="0" * 64)

    assert measured_supply(store, [trial, changed], {"supply_v": 5.0}) == MeasuredSupply()
    wrong = measured_supply(store, [with_log(store, trial, 2000, 2000)], {"supply_v": 5.0})
    assert wrong.ratio is None and "check SERVO_DIVIDER" in str(wrong.note)


def test_torque_and_speed_follow_the_measured_voltage_and_are_known_better() -> None:
    assumed, measured = (built_priors("W_B_W", False, ratio) for ratio in (None, 0.8))

    for name, middle in (("servo_torque", 0.95), ("servo_speed", 1.0)):
        index = NAMES.index(name)
        assert index not in assumed and measured[index].sd < 1
        assert PARAMETERS[index].value(measured[index].mean) == pytest.approx(0.8 * middle)


def test_the_belief_has_the_voltage_from_the_logs_of_the_trials(tmp_path: Path, trial: Trial) -> None:
    store = tmp_path / "s.db"
    foldcar("sweep", tmp_path / "l.json", "--store", store, "--samples", "20", "--realities", "300")
    logged = with_log(store, trial, 5000, 4680)
    with sqlite3.connect(store) as connection:
        connection.execute("UPDATE trial SET log = ?, log_sha256 = ?", [logged.log, logged.log_sha256])

    with Store.open(store) as opened:
        (evidence,) = read_evidence(opened)

    # The design's supply has 5.2 V.
    assert evidence.belief is not None
    torque = next(unknown for unknown in evidence.belief.answers.unknowns if unknown.parameter.name == "servo_torque")
    assert torque.before.value == pytest.approx(0.9 * 0.95, rel=0.05)
    assert any("4.68 V while driving in 2 trials" in remark for remark in evidence.remarks)
