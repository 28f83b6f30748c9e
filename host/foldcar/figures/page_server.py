"""A page for one person: GET / is the page, a POST answers a question, another GET is what it polls.

Input: functions for these. It listens on 127.0.0.1 only, or on one other address of this machine. A page of another site,
or another name for this address, must not reach it: requests are refused whose Host or Origin is not its own, whose type
is not JSON, all that is larger than a question can be, and all but GET / without the token, which stands in the page and
is another one at each start. On another address than 127.0.0.1, which strangers reach, GET / needs it too, as its query.
"""

import hmac
import json
import os
import secrets
import sys
import threading
from collections.abc import Callable, Mapping
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

from foldcar.errors import FoldcarError

ADDRESS = "127.0.0.1"
MOST_BYTES = 16_384
# The header of questions, and what holds its value in the page.
TOKEN_HEADER, TOKEN_META = "X-Foldcar-Token", '<head>\n<meta name="foldcar-token" content="{}">'
# A client that says nothing for so long is left.
SILENCE_S = 10.0
HEADERS = {
    "Content-Security-Policy": "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; "
    "connect-src 'self'; img-src data:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cache-Control": "no-store",
}

Answer = Callable[[Any], Any]
Poll = Callable[[str], bytes]


class PageServer(ThreadingHTTPServer):
    """Serves ``page`` (HTML), the ``answers`` by path to JSON values, one at a time, and JSON that is ``polled``.

    ``polled`` maps a path to what makes its bytes from the address's query, in any thread. ``port`` 0 is a free one;
    FoldcarError if it cannot be had. ``address`` is that of the machine which it listens on.
    """

    daemon_threads = True
    # On Windows the option would let two programs have one port.
    allow_reuse_address = os.name == "posix"

    def __init__(
        self, page: str, answers: Mapping[str, Answer], polled: Mapping[str, Poll] | None = None, port: int = 0,
        address: str = ADDRESS,
    ) -> None:  # fmt: skip
        try:
            super().__init__((address, port), _Handler)
        except OSError as error:
            what = error.strerror or error
            raise FoldcarError(f"--port {port}: {what}; name another one, or 0 for a free one") from None
        self.address = address
        self.token = secrets.token_urlsafe(24)
        self.page = page.replace("<head>", TOKEN_META.format(self.token), 1).encode()
        self.port = int(self.server_address[1])
        self.answers = answers
        self.polled = polled or {}
        self._busy = threading.Lock()

    @property
    def url(self) -> str:
        """The page's address."""
        query = "" if self.address == ADDRESS else f"?{self.token}"
        return f"http://{self.address}:{self.port}/{query}"

    @property
    def hosts(self) -> tuple[str, ...]:
        """The names under which a browser may ask for it."""
        named = (f"{self.address}:{self.port}",)
        return (*named, f"localhost:{self.port}") if self.address == ADDRESS else named

    def is_token(self, given: str) -> bool:
        """Whether it is the token; wrong ones all take the same time."""
        return hmac.compare_digest(given.encode(), self.token.encode())

    def ask(self, path: str, question: Any) -> bytes:
        """The answer as JSON."""
        with self._busy:
            return json.dumps(self.answers[path](question), separators=(",", ":"), allow_nan=False).encode()

    def handle_error(self, request: Any, client_address: Any) -> None:
        """A client that went away is no error of the server's."""
        if not isinstance(sys.exc_info()[1], OSError):
            super().handle_error(request, client_address)


class _Handler(BaseHTTPRequestHandler):
    server: PageServer
    protocol_version = "HTTP/1.1"
    timeout = SILENCE_S

    def do_GET(self) -> None:
        if not self._is_own():
            return
        path, _, query = self.path.partition("?")
        if path == "/" and self.server.address != ADDRESS and not self.server.is_token(query):
            self._send(HTTPStatus.FORBIDDEN, b"not of this page\n", "text/plain")
        elif path == "/":
            self._send(HTTPStatus.OK, self.server.page, "text/html; charset=utf-8")
        elif path not in self.server.polled:
            self._send(HTTPStatus.NOT_FOUND, b"nothing is here\n", "text/plain")
        elif self._has_token():
            self._send(HTTPStatus.OK, self.server.polled[path](query), "application/json")

    def do_POST(self) -> None:
        if not self._is_own(posted=True) or not self._has_token():
            return
        length = self.headers.get("Content-Length", "")
        if self.path not in self.server.answers:
            self._send(HTTPStatus.NOT_FOUND, b"nothing is asked here\n", "text/plain")
        elif self.headers.get_content_type() != "application/json":
            self._send(HTTPStatus.UNSUPPORTED_MEDIA_TYPE, b"a question is application/json\n", "text/plain")
        elif not (length.isascii() and length.isdigit()):
            self._send(HTTPStatus.LENGTH_REQUIRED, b"a question has a Content-Length\n", "text/plain")
        elif len(length) > 9 or int(length) > MOST_BYTES:
            self._send(HTTPStatus.REQUEST_ENTITY_TOO_LARGE, f"at most {MOST_BYTES} bytes\n".encode(), "text/plain")
        else:
            self._answer(self.rfile.read(int(length)))

    def _answer(self, body: bytes) -> None:
        try:
            # As a browser reads numbers: one of 400 digits is infinite.
            question = json.loads(body, parse_int=float)
        except (ValueError, RecursionError):
            self._send(HTTPStatus.BAD_REQUEST, b"not JSON\n", "text/plain")
            return
        self._send(HTTPStatus.OK, self.server.ask(self.path, question), "application/json")

    def send_error(self, code: int, message: str | None = None, explain: str | None = None) -> None:
        """Refuse what is no request, or another method."""
        self._send(HTTPStatus(code), f"{message or HTTPStatus(code).phrase}\n".encode(), "text/plain")

    def _is_own(self, posted: bool = False) -> bool:
        """Whether the request comes from the page itself, or a person who opens it; else it is refused."""
        hosts, origins = self.headers.get_all("Host", []), self.headers.get_all("Origin", [])
        own = len(hosts) == 1 and hosts[0] in self.server.hosts
        if own and (origins or posted):
            own = origins == [f"http://{hosts[0]}"]
        if not own:
            self._send(HTTPStatus.FORBIDDEN, b"not of this page\n", "text/plain")
        return own

    def _has_token(self) -> bool:
        given = self.headers.get_all(TOKEN_HEADER, [])
        has = len(given) == 1 and self.server.is_token(given[0])
        if not has:
            self._send(HTTPStatus.FORBIDDEN, b"not of this page\n", "text/plain")
        return has

    def _send(self, status: HTTPStatus, content: bytes, kind: str) -> None:
        self.send_response(status)
        for name, value in HEADERS.items():
            self.send_header(name, value)
        self.send_header("Content-Type", kind)
        self.send_header("Content-Length", str(len(content)))
        if status != HTTPStatus.OK:
            # What is left of a refused request is not read.
            self.send_header("Connection", "close")
        self.end_headers()
        self.wfile.write(content)

    def version_string(self) -> str:
        """What answers; without the version of Python."""
        return "foldcar"

    def log_message(self, format: str, *args: Any) -> None:
        """Requests are not logged."""
