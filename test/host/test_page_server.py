"""The server of pages for one person: it listens on loopback alone and refuses what is not its page."""

import http.client
import threading
from collections.abc import Iterator

import pytest

from foldcar.figures.page_server import MOST_BYTES, PageServer


@pytest.fixture(scope="module")
def server() -> Iterator[PageServer]:
    page = "<!doctype html><html><head><title>a page</title></head></html>"
    with PageServer(page, {"/car": lambda question: {"asked": question}}) as served:
        thread = threading.Thread(target=served.serve_forever, kwargs={"poll_interval": 0.02})
        thread.start()
        yield served
        served.shutdown()
        thread.join()


def asked(server: PageServer, method: str, path: str, body: str = "", **headers: str | None) -> tuple[int, str]:
    """Status and content; ``headers`` replace those of the page itself, None leaves one out."""
    own = f"127.0.0.1:{server.port}"
    sent: dict[str, str | None] = {"Host": own, "Content-Length": str(len(body)), "X-Foldcar-Token": server.token}
    if method == "POST":
        sent |= {"Origin": f"http://{own}", "Content-Type": "application/json"}
    sent |= {name.replace("_", "-"): value for name, value in headers.items()}
    connection = http.client.HTTPConnection("127.0.0.1", server.port, timeout=20)
    connection.putrequest(method, path, skip_host=True, skip_accept_encoding=True)
    for name, value in sent.items():
        if value is not None:
            connection.putheader(name, value)
    connection.endheaders(body.encode())
    answer = connection.getresponse()
    content = answer.read().decode()
    connection.close()
    return answer.status, content


def test_server_listens_on_loopback_alone(server: PageServer) -> None:
    assert server.server_address[0] == "127.0.0.1"
    status, page = asked(server, "GET", "/")
    assert status == 200 and page.startswith("<!doctype html>")
    assert asked(server, "POST", "/car", '{"width": 95}') == (200, '{"asked":{"width":95.0}}')


@pytest.mark.parametrize(
    ("status", "method", "path", "body", "headers"),
    [
        (403, "GET", "/", "", {"Host": "evil.example"}),
        (403, "GET", "/", "", {"Host": None}),
        (403, "GET", "/", "", {"Origin": "http://evil.example"}),
        (403, "POST", "/car", "{}", {"Origin": None}),
        (403, "POST", "/car", "{}", {"Origin": "null"}),
        (403, "POST", "/car", "{}", {"Origin": "https://evil.example"}),
        (403, "POST", "/car", "{}", {"X_Foldcar_Token": None}),
        (403, "POST", "/car", "{}", {"X_Foldcar_Token": "\xe9"}),
        (415, "POST", "/car", "{}", {"Content_Type": "text/plain"}),
        (411, "POST", "/car", "", {"Content_Length": None}),
        (411, "POST", "/car", "{}", {"Content_Length": "-1"}),
        (413, "POST", "/car", "", {"Content_Length": str(MOST_BYTES + 1)}),
        (413, "POST", "/car", "", {"Content_Length": "9" * 30}),
        (400, "POST", "/car", "{", {}),
        (400, "POST", "/car", "[" * 5000, {}),
        (404, "GET", "/etc/passwd", "", {}),
        (404, "POST", "/", "{}", {}),
        (501, "OPTIONS", "/car", "", {}),
        (501, "PUT", "/car", "{}", {}),
    ],
)
def test_server_refuses_what_is_not_its_page(
    server: PageServer, status: int, method: str, path: str, body: str, headers: dict[str, str | None]
) -> None:
    assert asked(server, method, path, body, **headers)[0] == status
