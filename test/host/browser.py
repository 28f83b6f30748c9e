"""Chromium without a window, which opens a page as a person's browser does.

`make test` installs it. Ubuntu has it as a snap only, which may not read temporary files: there Google Chrome is taken,
and where that is missing too the tests of pages are left out.
"""

import json
import os
import re
import select
import shutil
import signal
import subprocess
import tempfile
import time
from base64 import b64decode
from functools import cache
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import pytest

# A software renderer draws, the same on every machine; no network, no first-run pages; root may run it.
FLAGS = [
    "--headless",
    "--no-sandbox",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--disable-dev-shm-usage",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--no-first-run",
    "--window-size=1100,900",
]
HANGS_S = 600
# Is true as soon as a report is drawn and can be used.
READY = "document.body?.dataset.state === 'ready'"
# What goes wrong on a page is in ``errors``.
ERRORS = """window.errors = [];
addEventListener("error", event => errors.push("error: " + event.message));
addEventListener("unhandledrejection", event => errors.push("rejected: " + event.reason));
addEventListener("securitypolicyviolation", ({ violatedDirective, blockedURI }) => {
  errors.push(`refused: ${violatedDirective} ${blockedURI}`);
});"""


def _environment(profile: str) -> dict[str, str]:
    """Lets the browser keep what is not in its profile (crash reports, sockets, fonts) there too."""
    return {**os.environ, **dict.fromkeys(("XDG_CONFIG_HOME", "XDG_CACHE_HOME", "TMPDIR"), profile)}


def browser() -> str:
    """The browser's command. Without one the test fails, on Ubuntu it is left out."""
    for name in ("chromium", "google-chrome"):
        result = shutil.which(name)
        if result is not None and not result.startswith("/snap/"):
            return result
    if "\nID=ubuntu\n" in Path("/etc/os-release").read_text(encoding="utf-8"):
        pytest.skip("Ubuntu has no package of Chromium, and there is no Google Chrome")
    pytest.fail("there is no Chromium: tools/install_system_packages.sh tests")


class Browser:
    """A running browser, which is asked by the DevTools protocol, over pipes: no port, no library."""

    def __init__(self) -> None:
        self._number, self._left = 0, b""
        self._profile = tempfile.TemporaryDirectory(prefix="foldcar-browser-", ignore_cleanup_errors=True)
        (its_in, self._to), (self._from, its_out) = os.pipe(), os.pipe()
        words = [browser(), *FLAGS, "--remote-debugging-pipe", f"--user-data-dir={self._profile.name}", "about:blank"]
        # The browser reads commands from descriptor 3 and answers on 4.
        shell = ["bash", "-c", f'exec "$@" 3<&{its_in} 4>&{its_out}', "browser", *words]
        self._process = subprocess.Popen(
            shell, pass_fds=(its_in, its_out), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
            env=_environment(self._profile.name), start_new_session=True,
        )  # fmt: skip
        for end in (its_in, its_out):
            os.close(end)

    def close(self) -> None:
        """End the browser with all its processes and remove its profile."""
        os.killpg(self._process.pid, signal.SIGKILL)
        self._process.wait()
        for end in (self._to, self._from):
            os.close(end)
        self._profile.cleanup()

    def send(self, method: str, session: str = "", **parameters: Any) -> dict[str, Any]:
        """The result of a method of the protocol, for a page's session or for the browser."""
        self._number += 1
        command = {"id": self._number, "method": method, "params": parameters}
        os.write(self._to, json.dumps(command | ({"sessionId": session} if session else {})).encode() + b"\0")
        while True:
            while b"\0" not in self._left:
                assert select.select([self._from], [], [], HANGS_S)[0], f"{method}: the browser does not answer"
                more = os.read(self._from, 1 << 20)
                assert more, "the browser has ended"
                self._left += more
            message, _, self._left = self._left.partition(b"\0")
            answer = json.loads(message)
            if answer.get("id") == self._number:
                assert "error" not in answer, answer
                result: dict[str, Any] = answer["result"]
                return result


# Starting it takes longer than most pages; `conftest.py` closes it after the last test.
running_browser = cache(Browser)


def close_browser() -> None:
    """Close the browser of this process, if there is one."""
    if running_browser.cache_info().currsize:
        running_browser().close()
        running_browser.cache_clear()


class Tab:
    """A page in a running browser, in real time; it shares nothing with other tabs.

    ``with Tab(url) as tab``: ``tab.ask("document.title")``. The script ``before`` runs before those of the page and
    of its frames. It may take away what some browsers lack.
    """

    def __init__(self, address: str, width: int = 1280, height: int = 900, before: str = "") -> None:
        self._address, self._size, self._before = address, (width, height), before
        self._browser = running_browser()

    def __enter__(self) -> "Tab":
        self._context = self._browser.send("Target.createBrowserContext")["browserContextId"]
        target = self._browser.send("Target.createTarget", url="about:blank", browserContextId=self._context)
        attached = self._browser.send("Target.attachToTarget", targetId=target["targetId"], flatten=True)
        self._session = attached["sessionId"]
        width, height = self._size
        metrics = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
        self.send("Emulation.setDeviceMetricsOverride", **metrics)
        self.send("Page.enable")
        self.send("Page.addScriptToEvaluateOnNewDocument", source=f"{ERRORS}\n{self._before}")
        self.send("Page.navigate", url=self._address)
        return self

    def __exit__(self, *_: object) -> None:
        self._browser.send("Target.disposeBrowserContext", browserContextId=self._context)

    def send(self, method: str, **parameters: Any) -> dict[str, Any]:
        """The result of a method of the protocol."""
        return self._browser.send(method, self._session, **parameters)

    def ask(self, script: str) -> Any:
        """The value of a JavaScript expression on the page."""
        answer = self.send("Runtime.evaluate", expression=script, returnByValue=True, awaitPromise=True)
        assert "exceptionDetails" not in answer, answer
        return answer["result"].get("value")

    def wait(self, script: str, seconds: float = 60) -> Any:
        """The expression's value once it is true; fails after so many seconds."""
        until = time.monotonic() + seconds
        while not (result := self.ask(script)):
            assert time.monotonic() < until, (
                f"{script} is {result!r}; {self.ask('document.body.innerText.slice(0, 600)')}"
            )
            time.sleep(0.1)
        return result

    def save_to(self, folder: Path) -> None:
        """Let the page save files into that folder, without asking."""
        place = {"browserContextId": self._context, "downloadPath": str(folder)}
        self._browser.send("Browser.setDownloadBehavior", behavior="allow", **place)

    def picture(self, file: Path) -> None:
        """Write what is in sight as PNG."""
        file.write_bytes(b64decode(self.send("Page.captureScreenshot", format="png")["data"]))


def move_slider(tab: Tab, label: str, value: float) -> None:
    """Set the slider of a report whose label begins with these words, as a hand does."""
    tab.ask(f"""(() => {{
      const slider = document.querySelector('input[aria-label^="{label}"]');
      slider.value = {value};
      slider.dispatchEvent(new Event('input'));
    }})()""")


class _Reader(HTMLParser):
    def __init__(self) -> None:
        super().__init__()
        self.findings: list[str] = []
        self.ids: list[str] = []
        self.mains = 0

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.mains += tag == "main"
        names = [name for name, _ in attrs]
        if len(set(names)) < len(names):
            self.findings.append(f"{tag}: an attribute stands twice")
        for name, value in attrs:
            # HTML has no namespaces but for these two, inside SVG.
            if ":" in name and name not in ("xmlns:xlink", "xlink:href"):
                self.findings.append(f"{tag}: attribute {name}")
            if name == "id":
                self.ids.append(str(value))


def page_findings(text: str) -> list[str]:
    """What is wrong with a page, without its scripts; the W3C's validator and axe find no more today."""
    reader = _Reader()
    reader.feed(text)
    twice = sorted({name for name in reader.ids if reader.ids.count(name) > 1})
    findings = reader.findings + [f"id {name} stands twice" for name in twice]
    return findings if reader.mains == 1 else [*findings, f"{reader.mains} main parts"]


def study_of(folder: Path) -> dict[str, Any]:
    """The data (page_data.py) of the report's page in that folder."""
    page = (folder / "index.html").read_text(encoding="utf-8")
    match = re.search(r'<script type="application/json" id="study">(.*?)</script>', page)
    assert match is not None
    study: dict[str, Any] = json.loads(match[1])
    return study


def probed(page: str, folder: Path, fragment: str, script: str, before: str = "") -> Any:
    """What the JavaScript function body ``script`` returns of ``view`` (view.js) once the page is ready."""
    file = folder / "probed.html"
    file.write_text(page, encoding="utf-8")
    with Tab(f"{file.as_uri()}#{fragment}", before=before) as tab:
        tab.wait("document.body?.dataset.state === 'ready'")
        assert tab.ask("errors") == []
        return tab.ask(f"(function (view) {{ {script} }})(window.view)")
