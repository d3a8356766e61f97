"""Errors of NI-DAQmx as those of `hil.errors`, each in one line with its whole cause."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager

from hil.errors import DeviceLostError, HardwareError, LinkError, OutputUnderflowError, OverrunError

NO_SUCH_CHANNEL = -200170
_KINDS: Mapping[int, type[HardwareError]] = {
    -200284: LinkError, -200474: LinkError, -200560: LinkError,  # nothing in time
    -200279: OverrunError, -200361: OverrunError,  # overwritten in the buffer, in the FIFO
    -200018: OutputUnderflowError, -200290: OutputUnderflowError, -200621: OutputUnderflowError,
    -200045: DeviceLostError, -200324: DeviceLostError, -200220: DeviceLostError,  # removed, absent, no such name
    -201003: DeviceLostError, -88705: DeviceLostError, -88302: DeviceLostError,  # not to be accessed, not there, gone
    -50405: DeviceLostError, -50808: DeviceLostError,  # no transfer, or a failed one, on PCI or USB
}  # fmt: skip
_MEANS: Mapping[int, str] = {
    -50103: "another task or program holds it, such as a test panel of NI MAX or LabVIEW; close that"
}
_REPEATED = ("Task Name:", "Status Code:")


@contextmanager
def device_errors(device: str) -> Iterator[None]:
    """Errors of NI-DAQmx inside become those of this program; `device` is as NI MAX names it.

    Raises:
        DeviceLostError: the device is gone, or NI-DAQmx is not installed.
        HardwareError: what else NI-DAQmx says.
    """
    from nidaqmx.errors import DaqError, DaqNotFoundError

    try:
        yield
    except DaqNotFoundError as error:
        raise DeviceLostError("NI-DAQmx is not installed on this computer") from error
    except DaqError as error:
        kind = _KINDS.get(error.error_code, LinkError)
        means = f": {text}" if (text := _MEANS.get(error.error_code)) else ""
        raise kind(f"{device}: {_cause(str(error))} ({error.error_code}){means}") from error


def _cause(text: str) -> str:
    """What NI says over several lines, in one; without the task, which is ours, and the code, which is said anyway."""
    lines = (line.strip() for line in text.splitlines())
    return " ".join(" ".join(line for line in lines if not line.startswith(_REPEATED)).split())
