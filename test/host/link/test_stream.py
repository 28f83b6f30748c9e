"""Streams of bytes to a car: ports that select cannot wait for."""

import pytest

from foldcar.link import stream
from foldcar.link.stream import LinkLostError
from live_car import car_at_port, greeted


def test_a_thread_reads_a_port_that_select_cannot_wait_for(monkeypatch: pytest.MonkeyPatch) -> None:
    """As on Windows, here with a pseudo-terminal."""
    monkeypatch.setattr(stream, "CAN_SELECT_FILES", False)

    with car_at_port() as car, greeted(car.port) as connected:
        identity = connected.identity()
        car.process.kill()
        with pytest.raises(LinkLostError, match="the connection is lost"):
            for _ in range(100):
                connected.connection.receive(0.1)

    assert identity.simulated
