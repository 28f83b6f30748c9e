"""The study page in a browser that lacks or refuses what it needs: each place says so, and the rest of the page works."""

import html
import re
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from browser import READY, Tab, move_slider
from swept_listing import reported

WIDTHS, SAMPLES = (95, 120), 6
STATUS = "document.querySelector('#whatif-sliders [role=status]').textContent"
VERIFIED = "document.querySelector('#verify [role=status]').textContent"
NOTE = "document.querySelector('#replay .note').textContent"
SINGLE = "document.querySelector('#whatif-single').textContent"


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory, carsim_binary: Path) -> Path:
    """The page of a swept store."""
    return reported(tmp_path_factory.mktemp("page"), WIDTHS, SAMPLES) / "report" / "index.html"


def use_every_simulation(tab: Tab) -> None:
    """Ask the page for everything that it simulates, in each of its places."""
    tab.wait(READY)
    move_slider(tab, "friction", 0.7)
    tab.ask("document.getElementById('marginals').click()")
    tab.ask("document.querySelector('#verify button').click()")
    tab.ask("study.open(1, 2)")


# What a browser lacks or refuses, and a word of what the page says.
NO_WORKERS = "window.Worker = class { constructor() { throw new DOMException('not here', 'SecurityError'); } };"
FAILING_WORKERS = """{ const Own = Worker; window.Worker = class extends Own {
  constructor() { super(URL.createObjectURL(new Blob(["throw new RangeError('out of memory')"]))); } }; }"""
REFUSED_MODULE = "WebAssembly.compile = () => Promise.reject(new WebAssembly.CompileError('refused by policy'));"
UNREADABLE_MODULE = "Worker.prototype.postMessage = function () { this.dispatchEvent(new ErrorEvent('error')); };"


@pytest.mark.parametrize(
    ("before", "words"),
    [
        ("delete window.WebAssembly;", "no WebAssembly"),
        ("delete window.DecompressionStream;", "DecompressionStream"),
        (NO_WORKERS, "starts no worker here (not here)"),
        (FAILING_WORKERS, "out of memory"),
        (REFUSED_MODULE, "refuses the simulator (refused by policy)"),
        (UNREADABLE_MODULE, "a worker failed (this browser refuses it)"),
    ],
)
def test_every_place_says_why_the_browser_cannot_simulate(page: Path, before: str, words: str) -> None:
    with Tab(page.as_uri(), before=before) as tab:
        use_every_simulation(tab)
        for place in (STATUS, SINGLE, VERIFIED, NOTE):
            text = tab.wait(f"{place}.includes('cannot') && {place}", 20)
            assert text.startswith("The page cannot simulate: ") and words in text and "simulating …" not in text
        # What needs no simulator works, and each place says it again.
        tab.ask("study.open(0, 1)")
        move_slider(tab, "friction", 0.8)
        tab.wait(f"{NOTE}.includes('cannot') && {STATUS}.includes('cannot')", 20)
        assert tab.ask("document.querySelector('#grid .told').textContent").startswith("95 mm, environment 1: ")
        assert tab.ask("document.querySelector('#verify button').textContent").startswith("simulate all")
        assert tab.ask("errors") == []


# Three workers. The second does not start; the first is lost with its second task.
ONE_OF_THREE = """
Object.defineProperty(navigator, "hardwareConcurrency", { value: 3 });
{ const Own = Worker, broken = () => URL.createObjectURL(new Blob(["throw new Error('too many')"])); let count = 0;
  window.Worker = class extends Own {
    constructor(url) { super(count === 1 ? broken() : url); this.number = count++; this.tasks = 0; }
    postMessage(message) {
      if (!message.lines || this.number !== 0 || ++this.tasks !== 2) super.postMessage(message);
      else this.dispatchEvent(new ErrorEvent("error", { message: "lost", cancelable: true }));
    } }; }
"""
# A task that kills the simulators that get it: that of the environment with number 3.
DEADLY_TASK = """
Object.defineProperty(navigator, "hardwareConcurrency", { value: 3 });
{ const post = Worker.prototype.postMessage; Worker.prototype.postMessage = function (message) {
  if (!message.lines?.some(line => line.includes(' s3"'))) post.call(this, message);
  else this.dispatchEvent(new ErrorEvent("error", { message: "unreachable" }));
}; }
"""


def test_the_other_simulators_go_on_without_one_that_fails(page: Path) -> None:
    with Tab(page.as_uri(), before=ONE_OF_THREE) as tab:
        tab.wait(READY)
        tab.ask("document.querySelector('#verify button').click()")
        verified = tab.wait(f"/^[✓✗T]/.test({VERIFIED}) && {VERIFIED}", 60)
        # The simulator that works may have simulated all runs before the others have failed.
        tab.wait("study.drives.pool.simulators.length === 1", 20)
        errors = tab.ask("errors")

    runs = len(WIDTHS) * SAMPLES
    assert verified.startswith(f"✓ {runs} of {runs} runs reproduced") and errors == []


def test_a_task_that_fails_twice_is_given_up_and_others_are_simulated(page: Path) -> None:
    with Tab(page.as_uri(), before=DEADLY_TASK) as tab:
        tab.wait(READY)
        tab.ask("document.querySelector('#verify button').click()")
        verified = tab.wait(f"/^[✓✗T]/.test({VERIFIED}) && {VERIFIED}", 60)
        tab.ask("study.open(0, 1)")
        tab.wait("document.querySelector('.verified').textContent.startsWith('✓')")
        assert tab.ask("errors") == []

    assert verified == "The page cannot simulate: a worker failed (unreachable)."


# Where the page waits for a worker, a second passes in a tenth of a second, or as window.pace says.
FAST_CLOCK = "{ const own = setInterval; window.setInterval = (act, pause) => own(act, pause / (window.pace ?? 10)); }"
SILENT_WORKERS = FAST_CLOCK + "Worker.prototype.postMessage = () => {};"
UNREADABLE_ANSWERS = """{ const post = Worker.prototype.postMessage; Worker.prototype.postMessage = function (message) {
  if (message.lines) this.dispatchEvent(new MessageEvent("messageerror")); else post.call(this, message); }; }"""
# Three workers. The second does not answer when it starts, the first not to its second task.
SILENT_ONES = (
    FAST_CLOCK
    + """
Object.defineProperty(navigator, "hardwareConcurrency", { value: 3 });
{ const Own = Worker; let count = 0;
  window.Worker = class extends Own {
    constructor(url) { super(url); this.number = count++; this.tasks = 0; }
    postMessage(message) {
      if (this.number !== 1 && (!message.lines || this.number !== 0 || ++this.tasks !== 2)) super.postMessage(message);
    } }; }
"""
)


@pytest.mark.parametrize(
    ("before", "words"),
    [
        (SILENT_WORKERS, "a worker did not answer within 30 s"),
        (UNREADABLE_ANSWERS, "a worker's answer could not be read"),
    ],
)
def test_a_worker_without_an_answer_is_an_error_in_each_place(page: Path, before: str, words: str) -> None:
    with Tab(page.as_uri(), before=before) as tab:
        use_every_simulation(tab)
        for place in (STATUS, SINGLE, VERIFIED, NOTE):
            assert tab.wait(f"{place}.includes('cannot') && {place}", 40) == f"The page cannot simulate: {words}."
        assert tab.ask("errors") == []


def test_the_other_simulators_go_on_without_one_that_falls_silent(page: Path) -> None:
    with Tab(page.as_uri(), before=SILENT_ONES) as tab:
        tab.wait(READY)
        tab.ask("study.drives.ready()")
        tab.wait("study.drives.pool.clock === null", 40)
        assert tab.ask("study.drives.pool.simulators.length") == 2
        # The silent task: the time limit of its runs, 120 s, and 30 s.
        tab.ask("window.pace = 30")
        tab.ask("document.querySelector('#verify button').click()")
        verified = tab.wait(f"/^[✓✗T]/.test({VERIFIED}) && {VERIFIED}", 60)
        tab.wait("study.drives.pool.clock === null", 40)
        assert tab.ask("study.drives.pool.simulators.length") == 1
        assert tab.ask("study.drives.pool.failure.message") == "a worker did not answer within 150 s"
        assert tab.ask("errors") == []

    runs = len(WIDTHS) * SAMPLES
    assert verified.startswith(f"✓ {runs} of {runs} runs reproduced")


def test_a_worker_that_says_it_is_busy_is_waited_for(page: Path) -> None:
    busy = f"""{FAST_CLOCK}
      Object.defineProperty(navigator, "hardwareConcurrency", {{ value: 1 }});
      {{ const post = Worker.prototype.postMessage; Worker.prototype.postMessage = function (message) {{
        if (!message.lines) return post.call(this, message);
        for (let k = 1; k < 6; k++) setTimeout(() => this.onmessage({{ data: {{ busy: true }} }}), 500 * k);
        setTimeout(() => post.call(this, message), 3000);
      }}; }}"""
    with Tab(page.as_uri(), before=busy) as tab:
        tab.wait(READY)
        tab.ask("study.drives.ready()")
        tab.wait("study.drives.pool.clock === null", 20)
        # The limit is passed after 1.5 s.
        tab.ask("window.pace = 100; window.begun = performance.now(); study.open(1, 2)")
        tab.wait(f"document.querySelector('.verified').textContent || {NOTE}.includes('cannot')", 20)
        verdict = tab.ask("document.querySelector('.verified').textContent")
        assert verdict.startswith("✓") and tab.ask("performance.now() - begun") > 3000 and tab.ask("errors") == []


DRAWN = """(async () => {
  const charts = [...document.querySelectorAll(".chart")];
  for (const chart of charts) {
    chart.scrollIntoView();
    window.dispatchEvent(new Event("scroll"));
    await new Promise(go => setTimeout(go, 50));
  }
  return charts.map(chart => chart.querySelector("svg, canvas")?.tagName ?? chart.textContent);
})()"""


@pytest.mark.parametrize(
    ("get_context", "drawn"),
    [
        ("() => null", "svg"),
        (
            "() => { throw new Error('blocked'); }",
            "This browser cannot draw this chart (blocked). Its numbers are in the table below.",
        ),
    ],
)
def test_a_page_without_a_canvas_has_its_tables_and_texts(page: Path, get_context: str, drawn: str) -> None:
    with Tab(page.as_uri(), before=f"HTMLCanvasElement.prototype.getContext = {get_context};") as tab:
        tab.wait(READY)
        tab.ask("study.open(1, 2)")
        tab.wait("document.querySelector('.verified').textContent.startsWith('✓')", 20)
        replay = tab.ask("document.querySelector('#replay').innerText")
        charts = tab.ask(DRAWN)
        tab.ask("for (const details of document.querySelectorAll('details')) details.open = true")
        tables = tab.wait("document.querySelectorAll('.behind table').length")
        tab.ask("study.hover(0); study.brush('width_mm', [[90, 100]]); dispatchEvent(new Event('beforeprint'))")
        assert tab.ask("errors") == []

    assert set(charts) == {drawn} and len(charts) >= 4 and tables >= 4
    assert "Without WebGL a browser draws no car." in replay
    assert "Without a canvas a browser draws no roll and pitch." in replay


REFUSED_ADDRESS = "history.replaceState = () => { throw new DOMException('too many', 'SecurityError'); };"


def drag_friction(seconds: float) -> str:
    """Moves the slider a hundred times a second over its whole range."""
    return f"""(async () => {{
      const slider = document.querySelector('input[aria-label^="friction"]'), begun = performance.now();
      for (let share = 0; share < 1;) {{
        share = Math.min(1, (performance.now() - begun) / {1000 * seconds});
        slider.value = Number(slider.min) + share * (slider.max - slider.min);
        slider.dispatchEvent(new Event("input"));
        await new Promise(go => setTimeout(go, 10));
      }}
      return [Number(slider.value), performance.now() - begun];
    }})()"""


def test_a_refused_address_stops_no_control(page: Path) -> None:
    with Tab(page.as_uri(), before=REFUSED_ADDRESS) as tab:
        tab.wait(READY)
        value, _ = tab.ask(drag_friction(1.5))
        tab.wait("document.getElementById('whatif').dataset.done")
        assert tab.ask("study.state.reality.friction") == pytest.approx(value)
        assert tab.ask(STATUS).startswith(f"{SAMPLES} of {SAMPLES} environments")
        tab.ask("document.querySelector('#endings [data-outcome]').click(); study.open(1, 2)")
        tab.wait("document.getElementById('replay').dataset.readyMs")
        assert tab.ask("errors") == []


COUNT_WRITES = """window.writes = [];
{ const own = history.replaceState;
  history.replaceState = function (...all) { writes.push(performance.now()); own.apply(this, all); }; }"""


def test_dragging_writes_the_address_twice_a_second_and_in_the_end(page: Path) -> None:
    with Tab(page.as_uri(), before=COUNT_WRITES) as tab:
        tab.wait(READY)
        tab.ask("new Promise(go => setTimeout(go, 1000))")
        tab.ask("writes.length = 0")
        value, lasted_ms = tab.ask(drag_friction(3))
        tab.ask("new Promise(go => setTimeout(go, 1000))")
        writes, address = tab.ask("writes"), tab.ask("location.hash")

    assert 4 <= len(writes) <= 2 * lasted_ms / 1000 + 2
    assert all(later - earlier >= 499 for earlier, later in pairwise(writes))
    assert float(re.findall(r"r\.friction=([\d.]+)", address)[0]) == pytest.approx(value)


IN_FRAME = """(async () => {
  const inner = document.querySelector("iframe").contentWindow, page = inner.document;
  const until = async ready => { while (!ready()) await new Promise(go => setTimeout(go, 50)); };
  await until(() => page.body?.dataset.state === "ready");
  const slider = page.querySelector('input[aria-label^="friction"]');
  for (const value of [0.5, 0.6, 0.7]) { slider.value = value; slider.dispatchEvent(new inner.Event("input")); }
  await until(() => page.getElementById("whatif").dataset.done);
  inner.study.open(1, 2);
  await until(() => page.querySelector(".verified").textContent);
  page.querySelector("nav a[href='#trials']").click();
  const text = css => page.querySelector(css).textContent;
  const { top } = page.querySelector("#trials").getBoundingClientRect();
  return { address: inner.location.href, verdict: text(".verified"), told: text("#grid .told"),
    shown: top < inner.innerHeight, copy: page.getElementById("copy").hidden,
    errors: inner.errors, outer: location.href };
})()"""


@pytest.mark.parametrize("sandbox", ["", 'sandbox="allow-scripts allow-same-origin allow-modals allow-popups"'])
def test_a_frame_without_an_address_has_the_whole_page(page: Path, tmp_path: Path, sandbox: str) -> None:
    """As Streamlit and notebooks embed a page: its text is the attribute srcdoc."""
    frame = f'<iframe width="1200" height="800" {sandbox} srcdoc="{html.escape(page.read_text())}"></iframe>'
    (tmp_path / "outer.html").write_text(f"<!doctype html>{frame}")
    with Tab((tmp_path / "outer.html").as_uri()) as tab:
        tab.wait("document.readyState === 'complete'")
        inner: dict[str, Any] = tab.ask(IN_FRAME)

    assert inner["address"] == "about:srcdoc" and inner["errors"] == [] and inner["copy"] and inner["shown"]
    assert inner["verdict"].startswith("✓") and inner["told"].startswith("120 mm, environment 2: ")
    assert inner["outer"].endswith("/outer.html")
