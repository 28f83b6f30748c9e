"""Code that takes too long is interrupted even if it catches exceptions; timers of the caller keep running."""

import signal
import threading
import time

import pytest

from foldcar.errors import FoldcarError
from foldcar.scenes.time_limit import WALL_FACTOR, time_limit


def loop_that_catches(end_s: float) -> None:
    while time.perf_counter() < end_s:
        try:
            sum(range(100))
        except Exception:
            continue


def test_a_loop_that_catches_exceptions_is_interrupted_in_time() -> None:
    # Of all threads of the tests' process. The kernel counts by whom its ticks find running, which is inexact.
    start_s, processor_s = time.perf_counter(), time.process_time()
    message = r"^the loop takes longer than the limit of 0.2 s$"
    with pytest.raises(FoldcarError, match=message), time_limit(0.2, "the loop"):
        loop_that_catches(start_s + 100)
    assert time.perf_counter() - start_s < 50
    assert time.process_time() - processor_s >= 0.1


def test_an_error_that_a_library_makes_of_the_interruption_is_the_limit_too() -> None:
    def wrap() -> None:
        try:
            loop_that_catches(time.perf_counter() + 10)
        except BaseException as error:
            raise ValueError("argument 1") from error

    with pytest.raises(FoldcarError, match=r"^wrapping takes longer"), time_limit(0.2, "wrapping"):
        wrap()


def test_what_ends_in_time_is_left_alone_and_the_timer_is_gone() -> None:
    handlers = [signal.getsignal(number) for number in (signal.SIGALRM, signal.SIGPROF)]
    with time_limit(0.2, "nothing"):
        value = 3
    assert value == 3
    assert [signal.getsignal(number) for number in (signal.SIGALRM, signal.SIGPROF)] == handlers
    assert signal.getitimer(signal.ITIMER_REAL) == signal.getitimer(signal.ITIMER_PROF) == (0.0, 0.0)


def test_what_waits_is_interrupted_later_than_what_computes() -> None:
    start_s = time.perf_counter()

    with pytest.raises(FoldcarError, match=r"^waiting takes longer"), time_limit(0.02, "waiting"):
        time.sleep(10)

    assert 0.02 * WALL_FACTOR <= time.perf_counter() - start_s < 8


def test_a_busy_machine_does_not_shorten_the_limit() -> None:
    with time_limit(0.2, "sleeping"):
        # As code whose processor is lent to others: wall time passes, processor time does not.
        time.sleep(0.5)


def test_an_outer_limit_holds_after_an_inner_one() -> None:
    start_s = time.perf_counter()
    with pytest.raises(FoldcarError, match="outer takes longer"), time_limit(0.3, "outer"):
        with time_limit(5, "inner"):
            pass
        loop_that_catches(start_s + 10)


def test_other_threads_run_without_a_limit() -> None:
    done = []

    def work() -> None:
        with time_limit(0.05, "work"):
            time.sleep(0.2)
        done.append(True)

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert done == [True]
