"""Title and notes of the listing on top of the page: Markdown becomes elements, and HTML stays as it is written."""

import json
from pathlib import Path
from typing import Any

import pytest

from browser import Tab
from foldcar.report import write
from study_car import listing_of
from swept_listing import STEP_PYRAMIDS, foldcar

TITLE = "Wheels <b>for</b> the yard"
NOTES = """Which wheels cross *both* kerbs? **Wide *and* high** ones, says `a*b*c` of snake_case_names, 2 * 3 * 4.
A second line, <img src=x onerror="document.title='run'"> & <script>document.title = 'run'</script>

## Where
1. on the [floor *measured*](https://example.org/floor?a=1&b=2)
2. not [here](javascript:alert(1)) nor [there](data:text/html,x)
- one
  goes on
- _two_

```
x = *y* <i>
```"""
EXPECTED = """<p>Which wheels cross <em>both</em> kerbs? <strong>Wide <em>and</em> high</strong> ones, says \
<code>a*b*c</code> of snake_case_names, 2 * 3 * 4.
A second line, &lt;img src=x onerror="document.title='run'"&gt; &amp; \
&lt;script&gt;document.title = 'run'&lt;/script&gt;</p>\
<details><summary>more about the study</summary><h3>Where</h3>\
<ol><li>on the <a href="https://example.org/floor?a=1&amp;b=2" rel="noreferrer" target="_blank">\
floor <em>measured</em></a></li>\
<li>not [here](javascript:alert(1)) nor [there](data:text/html,x)</li></ol>\
<ul><li>one goes on</li><li><em>two</em></li></ul>\
<pre><code>x = *y* &lt;i&gt;</code></pre></details>"""


def shown(folder: Path, texts: dict[str, str]) -> Any:
    """What the page of a study with these texts has on top."""
    listing = listing_of(STEP_PYRAMIDS, {"width": [80, 95]}, timeout=10, environments=1)
    (folder / "l.json").write_text(json.dumps(listing | texts))
    foldcar("sweep", folder / "l.json", "--store", folder / "s.db", "--realities", "0")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(write, "_save_figures", lambda *_: None)
        foldcar("report", folder / "s.db", "-o", folder / "report")
    with Tab((folder / "report" / "index.html").as_uri()) as tab:
        tab.wait("document.body?.dataset.state === 'ready'")
        found = tab.ask("""(() => {
          const [title, notes, headline] = ["title", "notes", "headline"].map(id => document.getElementById(id));
          const top = element => element.getBoundingClientRect().top;
          return { title: title.textContent, notes: notes.innerHTML, tops: [title, notes, headline].map(top),
            display: getComputedStyle(notes).display, tab: document.title };
        })()""")
        assert tab.ask("errors") == []
    return found


def test_title_and_notes_stand_on_top_as_elements_and_run_nothing(tmp_path: Path, carsim_binary: Path) -> None:
    found = shown(tmp_path, {"title": TITLE, "notes": NOTES})

    assert found["title"] == TITLE and found["tab"] == f"foldcar report: {TITLE}"
    assert found["notes"] == EXPECTED
    assert found["tops"] == sorted(found["tops"]) and found["tops"][-1] < 400


def test_a_study_without_notes_has_no_room_for_them(tmp_path: Path, carsim_binary: Path) -> None:
    assert shown(tmp_path, {"title": "T"})["display"] == "none"
