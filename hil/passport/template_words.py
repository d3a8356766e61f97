"""What the template of the certificate says by itself, in the language of the page."""

from __future__ import annotations

from hil.language.words import _, marked

_WORDS = {
    "certificate": marked("Valve passport · certificate"), "serial": marked("Serial"),
    "simulated": marked("this says nothing of a real valve"),
    "page": marked("page {n} of {all}"),
    "limits": marked("Limits"), "quantity": marked("Quantity"), "value": marked("Value ± U (k = 2)"),
    "unit": marked("Unit"), "limit": marked("Limit"), "within": marked("Passes within"), "verdict": marked("Verdict"),
    "no_limits": marked("No limit was given, so nothing was judged; the values are in the annex."),
    "more_limits": marked("{n} more, all met, are in the annex."),
    "u": marked("U: expanded uncertainty, k = 2. Guard band U on either side: a value passes for certain within the "
                "limits drawn in by U (ISO 14253-1)."),
    "instruments": marked("Instruments"), "instrument": marked("Instrument or channel"),
    "reference": marked("Serial or reference"), "calibrated": marked("Calibrated"), "due": marked("Due"),
    "uncertainty": marked("Uncertainty"), "deviations": marked("Deviations"), "none": marked("None."),
    "more_deviations": marked("{n} more are in the annex."), "model": marked("Model and what these data excluded"),
    "signature": marked("Signature"), "signed_by": marked("Signed by"),
    "fingerprint": marked("SHA-256 of the certificate:"), "check": marked("Check it with"),
    "lay_out": marked("lay out what it holds with"),
    "inside": marked("The recordings, their evaluation and a Digital Calibration Certificate are inside this file."),
    "annex": marked("Annex"), "further_limits": marked("Further limits"), "further_values": marked("Further values"),
    "all_deviations": marked("All deviations"), "notes": marked("Notes"),
    "of_unit": marked("The model of this unit"), "parameter": marked("Parameter"), "meaning": marked("Meaning"),
    "excluded": marked("What these data excluded"),
    "largest": marked("The largest size of each effect with which these data agree (95 %)."),
    "effect": marked("Effect"), "stage": marked("Stage"), "at_most": marked("At most"),
    "power": marked("What these limits would have caught"),
    "power_how": marked("The unit's own model was driven and evaluated as in the run, with one fault at a time. At "
                        "this size at least 95 % of simulated repeats fail. The two most harmless of each limit."),
    "fault": marked("Fault"), "size": marked("Least size that fails"), "failed": marked("Repeats that failed"),
    "files": marked("Files inside"), "name": marked("Name"), "bytes": marked("Bytes"),
    "checksums": marked("Checksums are whole in passport.json."),
}  # fmt: skip


def template_words() -> dict[str, str]:
    """What the template says by itself."""
    return {name: _(text) for name, text in _WORDS.items()}
