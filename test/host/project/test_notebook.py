"""The example notebook runs without an error, its assertions hold, and the repository keeps no outputs of it."""

from pathlib import Path

import nbformat
import pytest
from nbclient import NotebookClient

NOTEBOOK = Path(__file__).resolve().parents[3] / "examples" / "study.ipynb"
HANGS_S = 300


def test_the_notebook_runs(carsim_binary: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("IPYTHONDIR", "JUPYTER_DATA_DIR", "JUPYTER_RUNTIME_DIR"):
        monkeypatch.setenv(name, str(tmp_path))
    notebook = nbformat.read(NOTEBOOK, as_version=4)
    cells = [cell for cell in notebook.cells if cell.cell_type == "code"]
    assert all(not cell.outputs and cell.execution_count is None for cell in cells)

    # An error in a cell is raised here.
    NotebookClient(notebook, timeout=HANGS_S, resources={"metadata": {"path": str(NOTEBOOK.parent)}}).execute()

    kinds = {output.output_type for cell in cells for output in cell.outputs}
    pictures = [output for cell in cells for output in cell.outputs if "image/png" in output.get("data", {})]
    assert kinds <= {"stream", "display_data", "execute_result"}
    assert len(pictures) == 2
