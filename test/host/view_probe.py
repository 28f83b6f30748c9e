"""Reads the view page in a browser: a script that is put at the end of the page writes what it finds into the page."""

import json
import re
from pathlib import Path
from typing import Any

from browser import browse


def probed(page: str, folder: Path, fragment: str, script: str) -> Any:
    """What the JavaScript function body ``script`` returns of ``view`` (view.js) once the page is ready."""
    file = folder / "probed.html"
    probe = f"document.body.dataset.probe = JSON.stringify((function (view) {{ {script} }})(window.view));"
    file.write_text(page.replace("</body>", f"<script>{probe}</script></body>"), encoding="utf-8")
    shown = browse(file, fragment, "--dump-dom")
    assert 'data-state="ready"' in shown
    (found,) = re.findall(r'data-probe="([^"]*)"', shown)
    return json.loads(found.replace("&quot;", '"').replace("&amp;", "&"))
