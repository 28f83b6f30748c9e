"""Hosts on one machine that talk over a slow and lossy network: namespaces, and between them a switch in Python.

Each host is a network namespace with a TAP device, whose other end is the switch's: it delivers every frame late, or not
at all. A kernel needs no queueing discipline for that (netem is not everywhere). Needs root.
"""

import contextlib
import fcntl
import heapq
import os
import random
import select
import struct
import subprocess
import threading
import time
from collections.abc import Sequence
from pathlib import Path

SUBNET = "10.77.0"
TUN = "/dev/net/tun"
TUNSETIFF, IFF_TAP, IFF_NO_PI = 0x400454CA, 0x0002, 0x1000
FRAME_BYTES = 2048


class LossyNetwork:
    """``count`` hosts, 1 and up: host n has the address SUBNET.n. Frames come ``delay_s`` late, a ``loss`` of them never.

    OSError or CalledProcessError if that is not permitted. To be closed.
    """

    def __init__(self, count: int, delay_s: float, loss: float) -> None:
        self._delay_s, self._loss = delay_s, loss
        self._tag = f"fc{os.getpid()}"
        self._devices: dict[int, int] = {}
        self._off: set[int] = set()
        self._closed = threading.Event()
        self._random = random.Random(1)
        self._switch = threading.Thread(target=self._deliver, daemon=True)
        self.frames = self.lost = 0
        try:
            for number in range(1, count + 1):
                self._make(number)
        except BaseException:
            self.close()
            raise
        self._switch.start()

    def command(self, number: int, *words: str | Path) -> list[str | Path]:
        """The command that runs ``words`` on host ``number``."""
        return ["ip", "netns", "exec", f"{self._tag}-{number}", *words]

    def cut(self, number: int, off: bool) -> None:
        """Cut host ``number`` off: its frames vanish and nobody is told. Or connect it again."""
        (self._off.add if off else self._off.discard)(number)

    def close(self) -> None:
        """Remove it all."""
        self._closed.set()
        if self._switch.is_alive():
            self._switch.join()
        for number, device in self._devices.items():
            os.close(device)
            subprocess.run(["ip", "netns", "del", f"{self._tag}-{number}"], check=False)
        self._devices.clear()

    def _make(self, number: int) -> None:
        name, tap = f"{self._tag}-{number}", f"{self._tag}t{number}"[-15:]
        device = os.open(TUN, os.O_RDWR | os.O_NONBLOCK)
        try:
            fcntl.ioctl(device, TUNSETIFF, struct.pack("16sH", tap.encode(), IFF_TAP | IFF_NO_PI))
            _ip("netns", "add", name)
        except BaseException:
            os.close(device)
            raise
        self._devices[number] = device
        _ip("link", "set", tap, "netns", name)
        # The address says the host's number.
        _ip("-n", name, "link", "set", tap, "address", f"02:00:00:00:00:{number:02x}")
        _ip("-n", name, "addr", "add", f"{SUBNET}.{number}/24", "dev", tap)
        for one in ("lo", tap):
            _ip("-n", name, "link", "set", one, "up")

    def _deliver(self) -> None:
        numbers = {device: number for number, device in self._devices.items()}
        due: list[tuple[float, int, int, bytes]] = []
        while not self._closed.is_set():
            wait_s = max(0.0, min(0.05, due[0][0] - time.monotonic())) if due else 0.05
            for device in select.select(list(numbers), [], [], wait_s)[0]:
                with contextlib.suppress(BlockingIOError):
                    frame = os.read(device, FRAME_BYTES)
                    for number in self._receivers(frame, numbers[device]):
                        self.frames += 1
                        heapq.heappush(due, (time.monotonic() + self._delay_s, self.frames, number, frame))
            while due and due[0][0] <= time.monotonic():
                _, _, number, frame = heapq.heappop(due)
                with contextlib.suppress(OSError):
                    os.write(self._devices[number], frame)

    def _receivers(self, frame: bytes, sender: int) -> Sequence[int]:
        if sender in self._off:
            return []
        if self._random.random() < self._loss:
            self.lost += 1
            return []
        # The lowest bit of the first byte: to all.
        wanted = self._devices if frame[0] & 1 else [frame[5]]
        return [number for number in wanted if number in self._devices and number not in {sender, *self._off}]


def _ip(*words: str) -> None:
    subprocess.run(["ip", *words], check=True, capture_output=True, text=True)
