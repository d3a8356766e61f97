"""Frequency responses of recordings of one's own: what `hil run frequency_response` reads, from sines as found."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from hil.errors import FileError
from hil.identification.frequency.bandwidth import Bandwidth, bandwidth
from hil.identification.frequency.frequency_response import FrequencyResponse
from hil.identification.frequency.linear_evidence import doubts
from hil.identification.frequency.order_choice import fit_together
from hil.identification.frequency.sine_segments import frequency_responses, left_out_note, sines_in
from hil.identification.frequency.table_fit import as_table
from hil.identification.frequency.transfer_function import TransferFunctionFit
from hil.identification.preparation.clipped import clipped_note
from hil.language.note import Note
from hil.physics.formula import formula
from hil.record.invalid_samples import measured_rows
from hil.record.plain import plain
from hil.record.recording import Recording
from hil.record.table.response_table import ResponseTable, write_response_table
from hil.session.analyses import channels_of
from hil.signals.interval import rounded, width

_RAW = Note("sensor, filter and hold of the command are in it: nothing of the measuring chain was taken out")


@dataclass(frozen=True, slots=True)
class SineAnalysis:
    """The frequency responses that recordings hold, one for each amplitude and bias.

    Attributes:
        responses: lines with covariance and harmonics. `bandwidths`: of each.
        fits: a transfer function of each, all of one structure; None where too few lines lie above the noise.
        input, output: names of the channels.
        notes: what the reader should know.
    """

    responses: tuple[FrequencyResponse, ...]
    bandwidths: tuple[Bandwidth, ...]
    fits: tuple[TransferFunctionFit | None, ...]
    input: str
    output: str
    notes: tuple[Note, ...] = ()

    @property
    def tables(self) -> tuple[ResponseTable, ...]:
        """The responses as `hil identify` takes them."""
        return tuple(as_table(one, self.input, self.output) for one in self.responses)

    def as_text(self) -> str:
        """Magnitude, phase and distortion of every line, for a terminal."""
        each = zip(self.responses, self.bandwidths, self.fits, strict=True)
        return "\n".join([*(row for one in each for row in _rows(*one)), *(f"  note: {n}" for n in self.notes)])

    def as_dict(self) -> dict[str, Any]:
        """As JSON values."""
        each = zip(self.responses, self.bandwidths, self.fits, strict=True)
        return plain({
            "schema": "hil.sines/1", "input": self.input, "output": self.output,
            "responses": [_entry(*one) for one in each], "notes": list(self.notes),
        })  # fmt: skip

    def files(self, out: Path) -> list[Path]:
        """The table of each response: `out`, or where there are several, each with its bias and amplitude behind."""
        if len(self.responses) == 1:
            return [out]
        stems = [re.sub(r"[^0-9A-Za-z.+-]+", "_", one.label).strip("_") for one in self.responses]
        return [out.with_name(f"{out.stem}_{stem}{out.suffix}") for stem in stems]

    def write(self, out: Path) -> list[Path]:
        """Write the tables as CSV.

        Raises:
            FileError: a response of one line is no table. StorageError: one cannot be written.
        """
        if short := next((one for one in self.responses if len(one) < 2), None):
            raise FileError(f"{out}: {short.label} has one frequency; a table of a frequency response needs two")
        for table, path in zip(self.tables, self.files(out), strict=True):
            write_response_table(table, path)
        return self.files(out)


def sine_analysis(recordings: Sequence[Recording], input_name: str = "", output_name: str = "") -> SineAnalysis:
    """The frequency responses of the sines that recordings hold together: one file for all, or one for each frequency.

    Raises:
        FileError: nobody says which channels they are. InputError: no sine in one of them.
    """
    names = channels_of(recordings[0], input_name, output_name)
    rows = [measured_rows(one, names) for one in recordings]
    sines = [sines_in(one, names[0]) for one in rows]
    found = frequency_responses(rows, *names, sines)
    notes = [note for one, own in zip(rows, sines, strict=True) for note in left_out_note(one, names[0], own)]
    notes += [note for one in rows for note in clipped_note(one.name, names[1], one.values(names[1]))]
    return SineAnalysis(found, tuple(map(bandwidth, found)), fit_together(found), *names, (*notes, _RAW))


def _rows(one: FrequencyResponse, corners: Bandwidth, fit: TransferFunctionFit | None) -> list[str]:
    """A head, a line for each frequency, where the response falls off, and its transfer function."""
    over = f"{one.output_unit}/{one.input_unit}"
    rows = [f"{one.label}: {len(one)} frequencies", f"  {'Hz':>10} {over:>24} {'°':>20} {'distortion %':>14}"]
    for frequency, gain, gain_std, phase, phase_std, thd in _lines(one):
        rows.append(
            f"  {frequency:10.5g} {rounded(gain, gain_std):>12} {width(gain_std):11} "
            f"{rounded(phase, phase_std):>10} {width(phase_std):9} {_percent(thd):>14}"
        )
    rows.append(f"  {corners.amplitude}; {corners.phase}")
    if fit is not None:
        rows += [f"  {formula(fit.model)}, fit {fit.fit_percent:.2f} %", *(f"  note: {one}" for one in doubts(fit))]
    return rows


def _percent(share: float) -> str:
    """A share in %; a dash where the fundamental is too little known to compare anything with."""
    return f"{100.0 * share:.3g}" if math.isfinite(share) else "–"


def _lines(one: FrequencyResponse) -> list[tuple[float, ...]]:
    columns = (
        one.frequency_hz, abs(one.response), one.gain_std, one.phase_deg, one.phase_std_deg,
        one.distortion_beyond_noise[0],
    )  # fmt: skip
    return list(zip(*(column.tolist() for column in columns), strict=True))


def _entry(one: FrequencyResponse, corners: Bandwidth, fit: TransferFunctionFit | None) -> dict[str, Any]:
    names = ("frequency_hz", "gain", "gain_std", "phase_deg", "phase_std_deg", "thd")
    lines = [list(column) for column in zip(*_lines(one), strict=True)]
    return {
        "label": one.label, "amplitude": one.amplitude, "bias": one.bias, "gain_unit": one.gain_unit,
        **dict(zip(names, lines, strict=True)), "bandwidth_3db_hz": corners.amplitude.frequency_hz,
        "bandwidth_90deg_hz": corners.phase.frequency_hz,
        "transfer_function": fit and {**asdict(fit.model), "fit_percent": fit.fit_percent},
    }  # fmt: skip
