"""The pages about the papers hold what the commands print now, and true numbers beside one's own recordings."""

import re

import pytest

from tests.docs_programs import NUMBER, numbers, program


def written(papers, name):
    text = (papers.PAGES / name).read_text(encoding="utf-8")
    return [text.partition(begin)[2].partition(papers.END)[0].strip() for begin in (papers.BEGIN, papers.OWN)]


def test_every_table_is_what_the_commands_give():
    papers = program("papers")
    for name, tables in papers.made().items():
        for there, table in zip(written(papers, name), tables, strict=True):
            assert NUMBER.sub("", there) == NUMBER.sub("", table), f"run: python -m docs.papers ({name})"
            assert numbers(there) == pytest.approx(numbers(table), rel=5e-3, abs=1e-3), (
                f"run: python -m docs.papers ({name})"
            )


def test_own_recordings_give_the_true_numbers_to_the_digits_that_their_intervals_leave():
    papers, held = program("papers"), []
    for name in ("hpv41-paper.md", "hydraforce-paper.md", "efc-thesis.md"):
        for true, value, half in re.findall(
            r"\| ([−\d.]+) \| \d+ \| ([−\d.]+) ± ([\d.]+) \|", written(papers, name)[1]
        ):
            off = abs(float(true.replace("−", "-")) - float(value.replace("−", "-"))) / float(half)
            assert off < 3.0, f"{name}: {value} ± {half} for {true}"
            held.append(off <= 1.0)
    assert len(held) == 23 and sum(held) >= 20
