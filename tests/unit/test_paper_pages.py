"""The pages about the papers hold what the commands print now."""

import pytest

from tests.docs_programs import NUMBER, numbers, program


def test_every_table_is_what_the_commands_give():
    papers = program("papers")
    for name, table in papers.made().items():
        text = (papers.PAGES / name).read_text(encoding="utf-8")
        there = text.partition(papers.BEGIN)[2].partition(papers.END)[0].strip()
        assert NUMBER.sub("", there) == NUMBER.sub("", table), f"run: python docs/papers.py ({name})"
        assert numbers(there) == pytest.approx(numbers(table), rel=5e-3, abs=1e-3), (
            f"run: python docs/papers.py ({name})"
        )
