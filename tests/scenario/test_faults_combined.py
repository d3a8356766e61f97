"""A dead link and a second misfortune, on real links: nothing that is said of an output is otherwise at the device."""

import pytest

from tests.faults_combined import LINKS, SECOND, measure


@pytest.mark.slow
@pytest.mark.parametrize("second", SECOND)
@pytest.mark.parametrize("link", LINKS)
def test_what_is_said_is_so(link, second, tmp_path):
    row = measure(link, second, tmp_path)
    print(row)
    assert row.lies == []
    if second not in ("killed, as when memory runs out", "terminal closed"):
        assert "NOT SAFE" in row.said
