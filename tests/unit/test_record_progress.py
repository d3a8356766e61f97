"""How far a run is stands in its folder while it lasts, whoever started it."""

import os

import pytest

from hil.record.run_folder.process_liveness import is_alive
from hil.record.run_folder.progress import PROGRESS_FILE, kept_progress, progress_of


def test_what_is_told_is_kept_while_the_run_lasts(tmp_path):
    heard = []
    with kept_progress(tmp_path, lambda share, text: heard.append((share, text))) as tell:
        tell(0.25, "2 Hz, +50 ± 5 %; 3 min left")
        tell(0.26, "not written so soon")
        told = progress_of(tmp_path)
        tell(1.0, "outputs safe; evaluating")
        last = progress_of(tmp_path)
    assert told is not None and last is not None
    assert (told.share, told.text, told.pid) == (0.25, "2 Hz, +50 ± 5 %; 3 min left", os.getpid())
    assert last.text == "outputs safe; evaluating"
    assert len(heard) == 3
    assert progress_of(tmp_path) is None


def test_a_long_text_stays_within_a_page(tmp_path):
    with kept_progress(tmp_path, lambda _share, _text: None) as tell:
        tell(0.5, "µ" * 9000)
        assert (tmp_path / PROGRESS_FILE).stat().st_size == 4096
        assert progress_of(tmp_path) is not None


def test_a_folder_that_is_not_there_hinders_no_run(tmp_path):
    with kept_progress(tmp_path / "none", lambda _share, _text: None) as tell:
        tell(0.5, "on")
    assert not (tmp_path / "none").exists()


@pytest.mark.parametrize("text", ["", "{", '{"share": "much"}', "[]"])
def test_a_file_that_says_nothing_is_none(tmp_path, text):
    (tmp_path / PROGRESS_FILE).write_text(text, encoding="utf-8")
    assert progress_of(tmp_path) is None


def test_a_number_that_is_none_of_a_process_is_of_none_that_lives():
    assert is_alive(os.getpid())
    assert not any(is_alive(number) for number in (0, -1, 10**30))
