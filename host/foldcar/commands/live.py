"""Serves a live page while a store is written: by `report --live`, or beside a sweep in another process."""

import os
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from foldcar.commands.options import print_note, print_result
from foldcar.errors import FoldcarError
from foldcar.installation import python_command
from foldcar.system import lower_priority

if TYPE_CHECKING:
    from foldcar.report.live import LiveStudy, PageServer

# Always the same port, so that an open page continues when a sweep is resumed.
PORT = 8377
LivePort = Annotated[
    int | None,
    typer.Option(
        "--port", metavar="N", min=0, max=65535, help=f"Port of --live on 127.0.0.1; default: {PORT}; 0: any free port."
    ),
]
# How long a sweep waits for the port, which an earlier page may still use, and for its page to end.
PORT_TIMEOUT_S, END_TIMEOUT_S = 10.0, 20.0
# Priority of the process of the page, so that simulators get processor time first.
NICENESS = 10


def serve(study: "LiveStudy", title: str, port: int, beside_sweep: bool, as_json: bool) -> None:
    """Serve the page of ``study`` until a signal or, if ``beside_sweep``, until standard input ends."""
    from foldcar.figures.page import web_page
    from foldcar.interrupts import message_on_signal

    sweep_ended = threading.Event()
    page_data = {"title": title, "notes": "", "experiments": [], "live": True}
    page = web_page("foldcar.report", "study", data=page_data, blobs={})
    with (
        _server(page, study, port, PORT_TIMEOUT_S if beside_sweep else 0.0) as server,
        message_on_signal(lambda: f"foldcar: {server.url} is closed"),
    ):
        print_result(as_json, {"url": server.url}, f"{server.url} (until Ctrl-C)")
        sys.stdout.flush()
        lower_priority(NICENESS)
        threading.Thread(target=server.serve_forever, daemon=True).start()
        if beside_sweep:
            threading.Thread(target=_wait_for_end, args=(sweep_ended,), daemon=True).start()
        study.follow(sweep_ended.is_set)
        server.shutdown()


def _server(page: str, study: "LiveStudy", port: int, timeout_s: float) -> "PageServer":
    """Return the page's server; wait up to ``timeout_s`` for the port to become free. Raises FoldcarError."""
    from foldcar.report.live import PageServer

    deadline_s = time.monotonic() + timeout_s
    while True:
        try:
            return PageServer(page, study.poll, port)
        except FoldcarError:
            if time.monotonic() >= deadline_s:
                raise
        time.sleep(0.1)


def _wait_for_end(ended: threading.Event) -> None:
    """Set ``ended`` when standard input ends: the sweep's process holds it open until it ends or is killed."""
    while os.read(0, 1024):
        pass
    ended.set()


@contextmanager
def served_beside(store: Path, port: int) -> Iterator[None]:
    """Serve the store's page in another process during the block, and until an open page has all data.

    Exits with code 2 if the page cannot be served; the other process has printed why.
    """
    arguments = ("report", "--live", "--beside-sweep", "--port", str(port), "--", str(store))
    # In a session of its own, so that Ctrl-C stops the sweep only.
    with subprocess.Popen(
        python_command("foldcar.cli", *arguments), stdin=subprocess.PIPE, stdout=subprocess.PIPE, start_new_session=True
    ) as process:
        assert process.stdin is not None and process.stdout is not None
        url = process.stdout.readline().decode().partition(" ")[0].strip()
        if not url:
            raise typer.Exit(2)
        print_note(f"live page: {url}")
        try:
            yield
        finally:
            # The end of its input tells the other process that the sweep has ended.
            process.stdin.close()
            try:
                process.wait(END_TIMEOUT_S)
            except subprocess.TimeoutExpired:
                process.kill()
