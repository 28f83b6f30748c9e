"""The page that is served while a store is written: of `report --live`, and beside a sweep, in a process of its own."""

import os
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from foldcar.commands.options import note, tell
from foldcar.errors import FoldcarError
from foldcar.installation import python_command

if TYPE_CHECKING:
    from foldcar.figures.page_server import PageServer
    from foldcar.report.live import LiveStudy

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
SWEEP, LOG, LAN = "sweep", "log", "lan"
# Simulators go first.
NICENESS = 10


def serve(study: "LiveStudy", title: str, port: int, beside: str | None, as_json: bool) -> None:
    """Serve the page of ``study`` until a signal, or until standard input ends, as ``beside`` another command.

    ``beside`` is what :func:`served_beside` is told.
    """
    from foldcar.figures.page import web_page
    from foldcar.figures.page_server import ADDRESS
    from foldcar.interrupts import said

    ended, address = threading.Event(), lan_address() if beside == LAN else ADDRESS
    page = web_page("foldcar.report", "study", data={"title": title, "experiments": []}, blobs={})
    with (
        _server(page, study, port, PATIENCE_S if beside else 0.0, address) as server,
        said(lambda: f"foldcar: {server.url} is closed"),
    ):
        tell(as_json, {"url": server.url}, f"{server.url} (until Ctrl-C)")
        sys.stdout.flush()
        # A tap may be one to stop.
        if hasattr(os, "nice") and beside not in (LOG, LAN):
            os.nice(NICENESS)
        threading.Thread(target=server.serve_forever, daemon=True).start()
        if beside:
            threading.Thread(target=_wait_for_end, args=(ended,), daemon=True).start()
        study.follow(ended.is_set)
        server.shutdown()


def lan_address() -> str:
    """The machine's address in its network; FoldcarError if it is in none."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as asked:
        try:
            # Sends nothing: the system only chooses the interface, to an address that belongs to nobody (RFC 5737).
            asked.connect(("203.0.113.1", 9))
        except OSError as error:
            raise FoldcarError(f"--lan: this machine is in no network: {error.strerror or error}") from None
        return str(asked.getsockname()[0])


def _server(page: str, study: "LiveStudy", port: int, patience_s: float, address: str) -> "PageServer":
    from foldcar.figures.page_server import PageServer

    until = time.monotonic() + patience_s
    while True:
        try:
            return PageServer(page, {"/tap": study.tap}, {"/study.json": study.poll}, port, address)
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
def served_beside(store: Path, port: int, what: str) -> Iterator[int]:
    """Within ``with``, another process serves the store's page; after it, until an open page has the last of it.

    ``what`` is SWEEP, LOG, or LAN: a LOG's page on the machine's network. Gives the descriptor of what is tapped on a
    LOG's. Exit code 2 if it cannot serve, which it has said itself then.
    """
    words = ("report", "--live", "--beside", what, "--port", str(port), "--", str(store))
    # In a session of its own: Ctrl-C is the sweep's. Unbuffered: behind the first line come taps.
    with subprocess.Popen(
        python_command("foldcar.cli", *words), 0, stdin=subprocess.PIPE, stdout=subprocess.PIPE, start_new_session=True
    ) as process:
        assert process.stdin is not None and process.stdout is not None
        url = process.stdout.readline().decode().partition(" ")[0].strip()
        if not url:
            raise typer.Exit(2)
        note(f"live page: {url}")
        if what == LAN and sys.stderr.isatty():
            import segno

            segno.make(url).terminal(sys.stderr, compact=True)
        try:
            yield process.stdout.fileno()
        finally:
            process.stdin.close()
            try:
                process.wait(END_S)
            except subprocess.TimeoutExpired:
                process.kill()
