"""What a board of NI says about itself: which inputs it has in a wiring, and which sample rates."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, Literal

from hil.daq.channel import InputChannel
from hil.errors import SettingError

InputWiring = Literal["diff", "pseudo_diff", "rse", "nrse"]
_BANK = 16  # inputs that share a multiplexer: the pair of input n of a bank is n + 8


def input_numbers(count: int, wiring: InputWiring) -> list[int]:
    """The inputs of a board that has so many one by one; in pairs the first of each pair, which names it."""
    bank = min(_BANK, count)
    return [n for n in range(count) if wiring != "diff" or n % bank < bank // 2]


def configuration(wiring: InputWiring) -> Any:
    """A wiring as nidaqmx names it."""
    from nidaqmx.constants import TerminalConfiguration as Has

    return {"rse": Has.RSE, "nrse": Has.NRSE, "diff": Has.DIFF, "pseudo_diff": Has.PSEUDO_DIFF}[wiring]


def check_inputs(device: str, wiring: InputWiring, inputs: Mapping[str, InputChannel]) -> None:
    """Ask the board whether it has every input in use in this wiring.

    Raises:
        SettingError: one it has not; names those that it has.
    """
    if not inputs:
        return
    from nidaqmx.system import Device

    wanted = configuration(wiring)
    having = [channel.name.split("/")[-1] for channel in Device(device).ai_physical_chans
              if wanted in channel.ai_term_cfgs]  # fmt: skip
    for name, channel in inputs.items():
        if channel.terminal not in having:
            raise SettingError(
                f"'{name}': {device} has no {channel.terminal} with wiring = \"{wiring}\"; it has: "
                f"{_spans(having) or 'none'}"
            )


def _spans(names: Iterable[str]) -> str:
    """`ai0 … ai7, ai16 … ai23`."""
    spans: list[list[int]] = []
    for number in sorted(int(name.removeprefix("ai")) for name in names):
        if spans and number == spans[-1][-1] + 1:
            spans[-1] = [spans[-1][0], number]
        else:
            spans.append([number])
    return ", ".join(" … ".join(f"ai{n}" for n in span) for span in spans)
