"""The three valves of the thesis through the acceptance test: the good one is accepted, the returned one is not."""

import pytest
from efc_bench import failed, outcome, published, value

# The population is drawn once, for all of them.
pytestmark = [pytest.mark.xdist_group("efc population"), pytest.mark.usefixtures("unprinted")]
SHORT = {"sweep_s": 10.0, "levels": ("medium",), "frequencies": (1.0, 3.0, 5.0, 8.0)}


@pytest.mark.parametrize(
    ("name", "condition", "missed"),
    [
        ("good", {"good"}, set()),
        ("prototype", {"malfunctioned"}, {"probability_good", "bandwidth_over_good"}),
        ("return", {"malfunctioned", "severely malfunctioned"},
         {"probability_good", "usual_among_good", "rise_over_good", "bandwidth_over_good"}),
    ],
)  # fmt: skip
def test_a_set_of_the_thesis(tmp_path, name, condition, missed):
    made = outcome(tmp_path, "efc_acceptance", published(name), **SHORT)
    found = made.findings
    assert (found.verdict, made.exit_status) == (("pass", 0) if name == "good" else ("fail", 1))
    assert failed(found) == missed
    (told,) = (note for note in found.notes if note.startswith("Condition: "))
    assert told.removeprefix("Condition: ").partition(" (")[0] in condition
    rise, bandwidth = value(found, "rise_over_good"), value(found, "bandwidth_over_good")
    assert rise is not None and bandwidth is not None
    # as the text and its figures have it: the returned valve decays first, then the prototype, then the good one
    order = {"good": (0.9, 1.1, 0.9, 1.1), "prototype": (1.1, 1.3, 0.75, 0.9), "return": (1.35, 1.5, 0.55, 0.75)}
    low, high, least, most = order[name]
    assert low < rise < high and least < bandwidth < most
