"""The notebooks of the papers, carried out: they print what is kept in them."""

import nbformat
import pytest

from tests.docs_programs import DOCS, NUMBER, numbers, program

NAMES = sorted(path.name for path in (DOCS / "notebooks").glob("*.ipynb"))


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_a_notebook_prints_what_is_kept_in_it(name):
    notebooks = program("notebooks")
    kept = notebooks.texts(nbformat.read(DOCS / "notebooks" / name, as_version=4))
    again = notebooks.texts(notebooks.done(DOCS / "notebooks" / name))
    assert len(kept) == len(again) > 5
    for old, new in zip(kept, again, strict=True):
        assert NUMBER.sub("", old).split() == NUMBER.sub("", new).split(), f"run: python docs/notebooks.py ({name})"
        assert numbers(old) == pytest.approx(numbers(new), rel=0.02, abs=1e-3), (
            f"run: python docs/notebooks.py ({name})"
        )


def test_there_is_a_notebook_for_each_paper_carried_out_in_order():
    assert len(NAMES) == 3
    for name in NAMES:
        cells = [c for c in nbformat.read(DOCS / "notebooks" / name, as_version=4).cells if c.cell_type == "code"]
        assert [cell.execution_count for cell in cells] == list(range(1, len(cells) + 1)), name
        assert any("image/png" in output.get("data", {}) for cell in cells for output in cell.outputs), name
