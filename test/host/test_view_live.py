"""`foldcar view --live` and `--run`: the loopback server, what it refuses, the car that it computes anew."""

import http.client
import json
import re
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from browser import browse
from foldcar.car.design import Design, compose
from foldcar.car.folded_car import folded_car
from foldcar.fabrication.assembly.live_car import LiveCar
from foldcar.fabrication.assembly.view_data import view_data
from foldcar.figures.page_server import MOST_BYTES, PageServer
from page_check import page_findings

Command = Callable[..., "subprocess.CompletedProcess[str]"]
PROJECT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def server() -> Iterator[PageServer]:
    """A car of 95 mm that is served."""
    car = LiveCar(compose("W_B_W", {"width": 95.0}), ["foldcar", "pattern", "cars.json"], ["width"])
    with PageServer(car.page(), {"/car": car.answer, "/draft": car.draft}) as served:
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
    assert page_findings(page) == []


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


def test_answer_is_the_car_of_those_values(server: PageServer) -> None:
    status, content = asked(server, "POST", "/car", '{"width": 101, "B.length": 90, "tyre": "none"}')

    answer = json.loads(content)
    design = compose("W_B_W+tyre=none", {"width": 101.0, "B.length": 90.0})
    assert status == 200
    assert answer["car"] == json.loads(json.dumps(view_data(folded_car(design))))
    draft = json.loads(asked(server, "POST", "/draft", '{"width": 101, "B.length": 90, "tyre": "none"}')[1])
    assert draft["car"]["pieces"] == answer["car"]["pieces"] and draft["car"]["steps"] == answer["car"]["steps"]
    assert answer["title"] == draft["title"] == design.title
    assert answer["command"] == "foldcar pattern cars.json --set width=101 --set B.length=90 --set tyre=none -o car"


@pytest.mark.parametrize(
    ("question", "parameter", "word"),
    [
        ({"width": 20}, "width", "minimum"),
        ({"width": "wide"}, "width", "number"),
        ({"width": 1e400}, "width", "maximum"),
        ({"width": int("9" * 400)}, "width", "maximum"),
        ({"width": True}, "width", "number"),
        ({"colour": 1}, None, "colour"),
        ({"tyre": "steel"}, "tyre", "rubber_band"),
        ([1], None, "object"),
    ],
)
def test_what_cannot_be_built_is_answered_by_one_line(
    server: PageServer, question: Any, parameter: str | None, word: str
) -> None:
    status, content = asked(server, "POST", "/car", json.dumps(question))

    answer = json.loads(content)
    assert status == 200 and answer["parameter"] == parameter
    assert word in answer["error"] and "\n" not in answer["error"]


def test_page_keeps_the_last_car_beside_the_error_of_a_slider(server: PageServer) -> None:
    refused, made = (browse(server.url, chosen, "--dump-dom") for chosen in ("radius=20", "width=110"))

    (error,) = re.findall(r'id="live-radius-error"[^>]*>([^<]*)<', refused)
    assert "20 is below the minimum" in error
    assert "radius=60</h1>" in refused and "The last car that can be built stays." in refused
    assert "width=110 " in made.partition("</h1>")[0] and 'id="live-radius-error" role="status"></p>' in made


def test_a_draft_and_its_checked_car_share_a_run() -> None:
    asked_for: list[Design] = []

    def run(design: Design) -> dict[str, Any]:
        asked_for.append(design)
        return {"width": design.values["width"]}

    car = LiveCar(compose("W_B_W", {}), ["foldcar"], (), run)
    found = [make({"width": width})["run"] for width in (101, 102) for make in (car.draft, car.answer)]

    assert found == [{"width": 101}] * 2 + [{"width": 102}] * 2
    assert [design.values["width"] for design in asked_for] == [101, 102]


def test_live_ends_with_one_line_and_130() -> None:
    design = PROJECT / "patterns" / "hinged.json"
    command = [sys.executable, "-c", "from foldcar.cli import main; main()", "view", str(design), "--live", "--json"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        try:
            url = json.loads("".join(iter(process.stdout.readline, "}\n")) + "}")["url"]
            process.send_signal(signal.SIGINT)
            _, said = process.communicate(timeout=60)
        finally:
            process.kill()
    assert re.fullmatch(r"http://127\.0\.0\.1:\d+/", url)
    assert process.returncode == 130
    assert said == f"foldcar: {url} is closed\n"


def test_run_on_the_page_ends_at_the_goal(
    tmp_path: Path, foldcar: Command, free_course: Path
) -> None:
    done = foldcar("view", free_course, "--set", "width=95", "--run", "1/0", "-o", tmp_path / "car.html")

    assert done.returncode == 0, done.stderr
    page = (tmp_path / "car.html").read_text(encoding="utf-8")
    run = json.loads(page.partition("window.foldcar = ")[2].partition(";</script>")[0])["run"]
    first, last = run["rows"][0], run["rows"][-1]
    assert f"passed after {last[0]:.2f} s" in run["told"]
    goal = run["ground"]["scene"]["goal"]
    assert last[1] == pytest.approx(goal["x_m"], abs=0.025)
    # At the start the wheels carry the car at their radius, tyre included.
    assert first[3] == pytest.approx(0.06, abs=0.001)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--run", "1/x", "-o", "x.html"], "--run 1/x"),
        (["--run", "7/0", "-o", "x.html"], "7"),
        (["--run", "1/0", "--vehicle", "2", "-o", "x.html"], "vehicle 1"),
        ([], "-o FILE"),
        (["--live", "-o", "x.html"], "--live"),
    ],
)
def test_view_refuses_runs_and_outputs_that_there_are_not(
    foldcar: Command, write_listing: Callable[[Any], Path], listing_data: dict[str, Any], words: list[str], said: str
) -> None:
    done = foldcar("view", write_listing(listing_data), "--set", "width=95", *words)

    assert done.returncode == 2 and said in done.stderr and len(done.stderr.splitlines()) == 1
