"""Code that takes too long is interrupted even if it catches exceptions; timers of the caller keep running."""

import contextlib
import math
import signal
import time
from collections.abc import Callable

import pytest

from foldcar.errors import FoldcarError
from foldcar.scenes.contained import time_limit


def loop_that_catches(end_s: float = math.inf) -> None:
    while time.perf_counter() < end_s:
        try:
            sum(range(100))
        except Exception:
            continue


def sleeps() -> None:
    while True:
        time.sleep(0.03)


def converts_the_interruption() -> None:
    """As some libraries do."""
    try:
        loop_that_catches()
    except BaseException as error:
        raise ValueError("argument 1") from error


def suppresses_the_interruption() -> None:
    with contextlib.suppress(BaseException):
        loop_that_catches()


@pytest.mark.parametrize("block", [loop_that_catches, sleeps, converts_the_interruption, suppresses_the_interruption])
def test_whatever_a_block_does_it_is_interrupted_in_time(block: Callable[[], None]) -> None:
    start_s = time.perf_counter()
    message = r"^the block takes longer than the limit of 0.2 s of wall time$"
    with pytest.raises(FoldcarError, match=message), time_limit(0.2, "the block"):
        block()
    assert 0.2 <= time.perf_counter() - start_s < 50


def test_what_ends_in_time_is_left_alone_and_the_timer_is_gone() -> None:
    handler = signal.getsignal(signal.SIGALRM)
    with time_limit(0.2, "nothing"):
        value = 3
    assert value == 3
    assert signal.getsignal(signal.SIGALRM) == handler
    assert signal.getitimer(signal.ITIMER_REAL) == (0.0, 0.0)


def test_an_outer_limit_holds_after_an_inner_one() -> None:
    start_s = time.perf_counter()
    with pytest.raises(FoldcarError, match="outer takes longer"), time_limit(0.3, "outer"):
        with time_limit(5, "inner"):
            pass
        loop_that_catches(start_s + 10)
