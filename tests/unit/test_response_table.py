"""Frequency responses as analysers and data sheets write them: the same complex numbers from every form."""

import numpy as np
import pytest

from hil.errors import FileError
from hil.record.read import read_any

F = np.logspace(-1, 1, 12)
S = 2j * np.pi * F
H = 2.0 / (0.01 * S**2 + 0.2 * S + 1.0) * np.exp(-0.01 * S)
GAIN, DB = np.abs(H), 20.0 * np.log10(np.abs(H))
RAD = np.unwrap(np.angle(H))
DEG = np.degrees(RAD)

FORMS = {
    "dB and degrees": ("frequency [Hz],gain [dB],phase [deg]", (F, DB, DEG)),
    "1 and rad": ("omega [rad/s],magnitude [1],phase [rad]", (2 * np.pi * F, GAIN, RAD)),
    "real and imaginary": ("f [Hz],re,im", (F, H.real, H.imag)),
    "another order and per cent": ("phase [°],gain [%],frequency [kHz]", (DEG, 100 * GAIN, F / 1e3)),
    "a lag": ("Frequency [Hz],Gain [dB],Phase lag [deg]", (F, DB, -DEG)),
    "wrapped": ("Freq(Hz),Mag(dB),Phase(deg)", (F, DB, (DEG + 180) % 360 - 180)),
    "units in a row": ("Frequency,Magnitude,Phase\nHz,dB,deg", (F, DB, DEG)),
    "units for names": ("Freq [Hz],dB,deg", (F, DB, DEG)),
    "German degrees": ("Frequenz [Hz],Betrag [dB],Phase [Grad]", (F, DB, DEG)),
    "a slash before each unit": ("f/Hz,|G|/dB,phi/°", (F, DB, DEG)),
    "as in a formula": ("omega (rad/s),|H| [1],arg(H) (rad)", (2 * np.pi * F, GAIN, RAD)),
    "falling frequency and other columns": ("#,Frequency [Hz],CH1 [V],Gain [dB],Phase [deg],coherence",
                                           (np.arange(12), F[::-1], F, DB[::-1], DEG[::-1], 0 * F)),
}  # fmt: skip


def written(path, head, columns):
    rows = "".join(",".join(f"{value:.10g}" for value in row) + "\n" for row in zip(*columns, strict=True))
    path.write_text(f"{head}\n{rows}", encoding="utf-8")
    return path


@pytest.mark.parametrize("form", FORMS)
def test_every_form_of_a_table_gives_the_same_response(tmp_path, form):
    found = read_any(written(tmp_path / "x.csv", *FORMS[form]))
    assert found.frequency_hz == pytest.approx(F, rel=1e-8)
    np.testing.assert_allclose(found.response, H, rtol=1e-7)


def test_german_degrees_are_said_and_can_be_gradians(tmp_path):
    path = written(tmp_path / "x.csv", *FORMS["German degrees"])
    assert "360 to a turn" in read_any(path).meta["assumed"][0]


def test_gains_without_phases_are_refused_in_words(tmp_path):
    path = written(tmp_path / "x.csv", "frequency [Hz],gain [dB]", (F, DB))
    with pytest.raises(FileError, match="frequencies and gains without a phase"):
        read_any(path)


@pytest.mark.parametrize("nothing", ["-inf", "nan", ""])
def test_a_line_without_a_gain_is_left_out_and_said(tmp_path, nothing):
    rows = "".join(
        f"{f},{nothing if i == 4 else db},{deg}\n" for i, (f, db, deg) in enumerate(zip(F, DB, DEG, strict=True))
    )
    (tmp_path / "x.csv").write_text(f"frequency [Hz],gain [dB],phase [deg]\n{rows}", encoding="utf-8")
    found = read_any(tmp_path / "x.csv")
    assert found.response == pytest.approx(np.delete(H, 4), rel=1e-9)
    assert any(note.startswith("1 lines without a value") for note in found.meta["assumed"])
