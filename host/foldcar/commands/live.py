"""The page that is served while a store is written: of `report --live`, and beside a sweep, in a process of its own."""

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

if TYPE_CHECKING:
    from foldcar.report.live import LiveStudy, PageServer

# The same at each start, so that an open page goes on when a sweep is resumed.
PORT = 8377
LivePort = Annotated[
    int | None,
    typer.Option(
        "--port", metavar="N", min=0, max=65535, help=f"Port of --live on 127.0.0.1; default {PORT}, 0: a free one."
    ),
]
# So long a sweep waits for a port that the page of the one before may still have, and for its page's end (s).
PATIENCE_S, END_S = 10.0, 20.0
# Simulators go first.
NICENESS = 10


def serve(study: "LiveStudy", title: str, port: int, beside_sweep: bool, as_json: bool) -> None:
    """Serve the page of ``study`` until a signal, or, ``beside_sweep``, until standard input ends."""
    from foldcar.figures.page import web_page
    from foldcar.interrupts import message_on_signal

    ended = threading.Event()
    data = {"title": title, "notes": "", "experiments": [], "live": True}
    page = web_page("foldcar.report", "study", data=data, blobs={})
    with (
        _server(page, study, port, PATIENCE_S if beside_sweep else 0.0) as server,
        message_on_signal(lambda: f"foldcar: {server.url} is closed"),
    ):
        print_result(as_json, {"url": server.url}, f"{server.url} (until Ctrl-C)")
        sys.stdout.flush()
        if hasattr(os, "nice"):
            os.nice(NICENESS)
        threading.Thread(target=server.serve_forever, daemon=True).start()
        if beside_sweep:
            threading.Thread(target=_wait_for_end, args=(ended,), daemon=True).start()
        study.follow(ended.is_set)
        server.shutdown()


def _server(page: str, study: "LiveStudy", port: int, patience_s: float) -> "PageServer":
    from foldcar.report.live import PageServer

    until = time.monotonic() + patience_s
    while True:
        try:
            return PageServer(page, study.poll, port)
        except FoldcarError:
            if time.monotonic() >= until:
                raise
        time.sleep(0.1)


def _wait_for_end(ended: threading.Event) -> None:
    """Standard input ends when the sweep does, however it ends."""
    while os.read(0, 1024):
        pass
    ended.set()


@contextmanager
def served_beside(store: Path, port: int) -> Iterator[None]:
    """Within ``with``, another process serves the store's page; after it, until an open page has the last of it.

    Exit code 2 if it cannot serve, which it has said itself then.
    """
    words = ("report", "--live", "--beside-sweep", "--port", str(port), "--", str(store))
    # In a session of its own: Ctrl-C is the sweep's.
    with subprocess.Popen(
        python_command("foldcar.cli", *words), stdin=subprocess.PIPE, stdout=subprocess.PIPE, start_new_session=True
    ) as process:
        assert process.stdin is not None and process.stdout is not None
        url = process.stdout.readline().decode().partition(" ")[0].strip()
        if not url:
            raise typer.Exit(2)
        print_note(f"live page: {url}")
        try:
            yield
        finally:
            process.stdin.close()
            try:
                process.wait(END_S)
            except subprocess.TimeoutExpired:
                process.kill()
