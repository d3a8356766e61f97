"""Carry out the notebooks in docs/notebooks and keep what they print and draw in them.

    python docs/notebooks.py

No kernel is started: a cell is Python, its last expression is shown as Jupyter would show it. A test carries them out
too and compares what they print with what is kept.
"""

from __future__ import annotations

import ast
import base64
import contextlib
import io
import tempfile
from pathlib import Path
from typing import Any

import nbformat
from matplotlib.figure import Figure
from nbformat import NotebookNode
from nbformat.v4 import new_output

FOLDER = Path(__file__).parent / "notebooks"
DPI = 60


def done(path: Path) -> NotebookNode:
    """A notebook with its cells carried out, in an empty folder."""
    notebook = nbformat.read(path, as_version=4)
    names: dict[str, Any] = {"__name__": "__main__"}
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        for number, cell in enumerate((cell for cell in notebook.cells if cell.cell_type == "code"), 1):
            cell.execution_count = number
            cell.outputs = _outputs(cell.source, names, f"{path.name}, cell {number}", number)
    return notebook


def _outputs(source: str, names: dict[str, Any], where: str, number: int) -> list[NotebookNode]:
    tree = ast.parse(source, where)
    last = tree.body.pop() if tree.body and isinstance(tree.body[-1], ast.Expr) else None
    said, value = io.StringIO(), None
    with contextlib.redirect_stdout(said):
        exec(compile(tree, where, "exec"), names)
        if isinstance(last, ast.Expr):
            value = eval(compile(ast.Expression(last.value), where, "eval"), names)
    made = [new_output("stream", name="stdout", text=said.getvalue())] if said.getvalue() else []
    return made if value is None else [*made, _shown(value, number)]


def _shown(value: Any, number: int) -> NotebookNode:
    """A value as Jupyter shows it: its picture, its table, or its text."""
    data: dict[str, Any] = {"text/plain": repr(value)}
    if isinstance(value, Figure):
        picture = io.BytesIO()
        value.savefig(picture, format="png", dpi=DPI, metadata={"Software": None})
        data = {"text/plain": "<figure>", "image/png": base64.b64encode(picture.getvalue()).decode()}
    elif hasattr(value, "_repr_html_"):
        data["text/html"] = value._repr_html_()
        data["text/plain"] = value.to_string() if hasattr(value, "to_string") else type(value).__name__
    return new_output("execute_result", data, execution_count=number)


def texts(notebook: NotebookNode) -> list[str]:
    """What each cell printed and showed as text."""
    every = [output for cell in notebook.cells if cell.cell_type == "code" for output in cell.outputs]
    return [output.text if output.output_type == "stream" else output.data["text/plain"] for output in every]


def main() -> None:
    """Carry out every notebook and write it."""
    for path in sorted(FOLDER.glob("*.ipynb")):
        nbformat.write(done(path), path)
        print(f"{path}: written")


if __name__ == "__main__":
    main()
