"""Calls side by side: order, how many wait, and what ends those that run."""

import threading
import time

import pytest

from foldcar.simulation.runner import side_by_side


def test_results_come_in_order_and_a_bounded_number_waits() -> None:
    made: list[int] = []

    def calls():  # type: ignore[no-untyped-def]
        for number in range(20):
            made.append(number)
            yield lambda number=number: (time.sleep(0.002 * (number % 3)), number)[1]

    answers = []
    for number in side_by_side(calls(), 2, lambda: None):
        answers.append(number)
        assert len(made) <= number + 4
    assert answers == list(range(20))


def test_a_call_that_fails_stops_the_others_and_is_told() -> None:
    stopped = threading.Event()

    def fail() -> None:
        raise ValueError("broke down")

    with pytest.raises(ValueError, match="broke down"):
        list(side_by_side([fail, lambda: stopped.wait(5), lambda: stopped.wait(5)], 2, stopped.set))
    assert stopped.is_set()
