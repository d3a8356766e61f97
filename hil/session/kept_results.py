"""The results of a run as they lie in its folder; what evaluates a run is imported where they do not."""

from __future__ import annotations

from pathlib import Path

from hil.findings.results import Results, read_results
from hil.record.measurement import RESULTS_FILE
from hil.record.run_folder.header import HEADER_FILE, read_header
from hil.record.run_folder.seal import check_seal
from hil.record.simulated import is_simulated


def results_of_run(folder: Path) -> Results:
    """What was found when the run was evaluated; an evaluation now, where nothing was kept.

    Raises:
        FileError: not a run folder, or its results cannot be read or were changed since.
        InputError: it was never evaluated, and cannot be now.
    """
    kept = folder / RESULTS_FILE
    if kept.is_file():
        check_seal(folder, RESULTS_FILE)
        found = read_results(kept)
        return found if found.simulated is not None else _with_origin(found, folder)
    from hil.findings.collect import results_of
    from hil.record.folder import read
    from hil.session.results import evaluated_anew

    recording = read(folder)
    return results_of(recording, evaluated_anew(recording, folder))


def _with_origin(found: Results, folder: Path) -> Results:
    """Results of a version that did not say whether they are of a real valve, with what the header of the run says."""
    if not (folder / HEADER_FILE).is_file():
        return found
    return found.model_copy(update={"simulated": is_simulated(read_header(folder).meta)})
