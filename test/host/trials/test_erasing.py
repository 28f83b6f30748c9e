"""Logs in a car: compared with a store, and erased only if it has all of them."""

import time
from pathlib import Path
from typing import Any

from foldcar.link.car_logs import list_logs
from foldcar.link.simulated_car import SimulatedCar
from live_car import LOG, car_at_port, greeted, inject, moving
from typist import Typist


def drive_untethered(folder: Path, car: SimulatedCar) -> None:
    """Drive a trial whose cable is pulled, and store it with its log."""
    words = (*LOG, "--port", car.port, "--countdown", "0", "--outcome", "timeout", "--yes", "--untethered")
    with Typist(folder, *words) as person:
        person.watches_until(lambda: moving(folder))
        inject(car, inject="unplug", for_s=4)
        assert person.ends() == 0, person.output
        assert "Compare the car's logs" not in person.output


def log_numbers(car: SimulatedCar) -> list[int]:
    with greeted(car.port) as connected:
        return [log.id for log in list_logs(connected)]


def test_logs_that_the_store_has_are_erased(tmp_path: Path, free_course: Path, foldcar: Any) -> None:
    words = ("trials", "erase-logs", "s.db", "--yes", "--port")
    with car_at_port(goal_x_m=None, tcp=True) as car:
        drive_untethered(tmp_path, car)

        erased = foldcar(*words, car.port)

        assert (erased.returncode, erased.stderr) == (0, "") and log_numbers(car) == []
        assert "comparing 1 of the car's logs with s.db\n" in erased.stdout
        assert erased.stdout.endswith(" trial 1\nerased\n")
        assert foldcar(*words, car.port).stdout == "the car has no logs\n"


def test_if_one_log_is_not_in_the_store_all_stay(tmp_path: Path, free_course: Path, foldcar: Any) -> None:
    with car_at_port(goal_x_m=None, tcp=True) as car:
        drive_untethered(tmp_path, car)
        with greeted(car.port) as other:
            other.arm()
            # Its number is that of a stored trial, its packets are not.
            other.start_trial(0.1, 0.0, 0.4, 1, untethered=True)
            time.sleep(1.5)

        refused = foldcar("trials", "erase-logs", "s.db", "--yes", "--port", car.port)

        assert refused.returncode == 2 and log_numbers(car) == [1, 2]
        assert "kB  trial 1\n" in refused.stdout and "kB  not in s.db\n" in refused.stdout
        assert "nothing is erased: s.db does not have log 2 of the car" in refused.stderr


def test_whoever_is_asked_may_keep_them(tmp_path: Path, free_course: Path) -> None:
    with car_at_port(goal_x_m=None, tcp=True) as car:
        drive_untethered(tmp_path, car)
        with Typist(tmp_path, "trials", "erase-logs", "s.db", "--port", car.port) as person:
            person.answers(("Erase them in the car?", ""))
            assert person.ends() == 0, person.output
        assert log_numbers(car) == [1]


def test_a_log_that_was_changed_or_is_missing_does_not_count_as_stored(
    tmp_path: Path, free_course: Path, foldcar: Any
) -> None:
    with car_at_port(goal_x_m=None, tcp=True) as car:
        drive_untethered(tmp_path, car)
        (log,) = (tmp_path / "s-logs").glob("*.tlog")
        content = log.read_bytes()
        log.write_bytes(content[: len(content) // 2])
        changed = foldcar("trials", "erase-logs", "s.db", "--port", car.port, "--yes")
        log.unlink()
        missing = foldcar("trials", "erase-logs", "s.db", "--port", car.port, "--yes")

        assert (changed.returncode, missing.returncode) == (2, 2)
        assert "its SHA-256 differs" in changed.stderr and "does not have log 1 of the car" in missing.stderr
        assert log_numbers(car) == [1]


def test_a_session_offers_to_erase_the_logs_that_it_has_stored(tmp_path: Path, free_course: Path) -> None:
    with car_at_port(goal_x_m=None, tcp=True) as car:
        with Typist(tmp_path, *LOG, "--port", car.port, "--countdown", "1", "--untethered") as person:
            person.answers(("deviation: ", ""), ("Enter starts", ""))
            person.watches_until(lambda: moving(tmp_path))
            inject(car, inject="unplug", for_s=4)
            person.sees("The car drives on.")
            # The cable is out for 4 s of the car's time, which may pass more slowly than ours.
            while "Outcome:" not in person.sees_one_of("Outcome:", "q gives up: "):
                time.sleep(1)
                person.types("\n")
            # There is no default, because the car may have crossed the goal and driven on.
            person.answers(("", ""), ("type one of", "p"), ("Enter: next", "q"), ("erase them if all", "y"))
            person.sees("erased")
            assert person.ends() == 0, person.output
        assert log_numbers(car) == []
