"""What the last message of a car's own log says of an untethered drive."""

from foldcar.link.dialect import load_dialect
from foldcar.trials.driving import drive_end


def test_a_log_that_breaks_off_or_lacks_bytes_is_told() -> None:
    dialect = load_dialect()

    def end(how: str, log_lost: int, lost_bytes: int) -> tuple[str, str | None]:
        message = dialect.MAVLink_foldcar_trial_message(
            20_000, 7, 3_000, 3_000, 0.2, 0.0, dialect.FOLDCAR_STATE_FINISHED, getattr(dialect, f"FOLDCAR_END_{how}"),
            dialect.FOLDCAR_FAULT_NONE, 1, log_lost, dialect.FOLDCAR_LOG_OPEN,
        )  # fmt: skip
        told = drive_end(dialect, message, lost_bytes)
        assert told.elapsed_time_s == 3.0
        return told.ending, told.outcome

    assert end("TIME_LIMIT", 0, 0) == ("time limit, untethered", "timeout")
    assert end("TIME_LIMIT", 12, 40) == ("time limit, untethered, 40 bytes of its log lost", "timeout")
    assert end("STOPPED", 12, 0) == ("stopped, untethered, 12 bytes of its log lost", None)
    assert end("NONE", 0, 0) == ("its log breaks off, untethered", "aborted")
