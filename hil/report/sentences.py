"""Notes and deviations of a run as a page says them: in the language that is spoken.

Procedures say them in English, and so they are kept. What nobody has translated, a stranger's procedure
says, stays as it is.
"""

from __future__ import annotations

from hil.language.figures import localised
from hil.language.reworded import reworded
from hil.language.words import ENGLISH, _, marked, spoken
from hil.report.name import capital
from hil.report.number import label_text, with_minus

_DEVIATIONS = (
    marked("Not stated: {listed}."),
    marked("The fluid was at {was} °C; {asked} °C is customary."),
    marked("{quantity} was not measured and not stated; {range} is declared."),
    marked("{quantity} was {range_found}; {range} is declared."),
    marked("{quantity} is stated as {range_found}; {range} is declared."),
    marked("The oil is stated as {oil}, its viscosity class as ISO VG {grade}; one of them is wrong."),
    marked("Channel '{name}': its calibration was due on {date_due}; the day of this test is {date}."),
    marked("Instrument '{name}': its calibration was due on {date_due}; the day of this test is {date}."),
    marked(
        "Instrument '{name}' (serial {serial}): its calibration was due on {date_due}; the day of this test is {date}."
    ),
    marked("Hot resistance read {time} s after switching off; 1 s is allowed."),
    marked("{pressure} psi before the valve; {asked} psi is specified."),
    marked("{pressure} psi behind the valve; {asked} psi is specified."),
    marked("Measured before the response was steady: {places} and {n} more."),
    marked("Measured before the response was steady: {places}."),
    marked("reference at {used} Hz, the rule asks for {asked} Hz or less."),
    marked(
        "reference at {used} Hz is {share} % of the −90° frequency; the rule asks for {asked} % or less, {allowed} Hz."
    ),
    marked(
        "The measuring chain changes the response by more than 1 % from {from_hz} Hz on ({amplitude} %, {phase}° at "
        "{worst_hz} Hz); correct for it or use a faster sensor."
    ),
)  # fmt: skip
_LISTED = (
    marked("the fluid"), marked("the viscosity class of the fluid"), marked("the temperature of the fluid"),
    marked("the supply pressure"),
)  # fmt: skip
_NOTES = (
    marked("The measuring chain changes the response by less than 1 % at every frequency."),
    marked(
        "The measuring chain (sensor lag {lag} ms, response read {late} ms after the command changes, command held "
        "{hold} ms) has been taken out of the responses; at {worst_hz} Hz it is {amplitude} % and {phase}°."
    ),
    marked(
        "The loop is {width} wide, at half speed {half} (each ± {u}): a lag of {lag} ms makes the difference and has "
        "been taken out of the curve. Friction that falls with speed would be taken for lag; as much as is usual is "
        "granted to both."
    ),
    marked(
        "The loop is {width} wide, at half speed {half} (each ± {u}): a lag of {lag} ms makes the difference and has "
        "been taken out of the curve."
    ),
    marked("Read by hand from {instrument}."),
    marked("Lap class: overlapped."),
    marked("Lap class: underlapped."),
    marked("Lap class: zero lap within its uncertainty."),
    marked("Lap class: none. The curve bends near null, so the straight lines do not show the edges."),
    marked("The response is steepest at {command}, {share} % of full command: a good bias for dynamic tests."),
    marked(
        "The response at one and the same end of the sweep changes by {change} from visit to visit: reading or valve "
        "drifts, and what drifts looks like hysteresis and lag. Neither can be told, nor where a dead band ends."
    ),
    marked(
        "The response at one and the same level changes by {change} from visit to visit: reading or valve drifts. Half "
        "of that is granted to every level."
    ),
    marked(
        "settling is longer than a lag of this rise settles; a lag of {lag} s and a dead time of {dead} s have both "
        "times."
    ),
    marked("noise alone reaches 2 % of the change; the dead time cannot be told."),
    marked("a tone of {tone} Hz goes on before and after it and was taken out."),
    marked(
        "the response still moves by {change} over the end of the step, from which its final value is read; hold it "
        "longer."
    ),
    marked(
        "distortion above {limit} % at {n} of {all} frequencies ({thd} % at {worst_hz} Hz); there the valve is not "
        "linear at this amplitude."
    ),
    marked(
        "a tone of {tone} Hz goes on beneath every sine. What it adds to harmonics of {lines} Hz cannot be told from "
        "distortion; drive other frequencies to tell it."
    ),
    marked("no linear model with {n} poles: {reasons}."),
    marked("{n} poles are not borne out ({reasons}); {fewer} are."),
    marked(
        "a dead time has {share} % of the evidence and a zero in the right half plane the rest: these lines do not "
        "tell which it is, and how long a dead time; lines at higher frequency, or a step, tell"
    ),
    marked(
        "{quantity} dominates on {share} % of the lines; odd distortion {odd} % and even distortion {even} % of the "
        "output (median)."
    ),
    marked(
        "The response drifts by up to {creep} beneath the sines. That is taken out of amplitude and phase; how far it "
        "has moved the mean since the recording began cannot be told, and is granted to it."
    ),
    marked(
        "One sine tells two numbers, a gain and one time; for an order, dead time or resonance run multisine_response "
        "or step_response."
    ),
    marked(
        "retracts {ratio} times as fast as it extends. By its areas it would be {areas} with the same flow both ways, "
        "and {edges} with equal edges at constant pressure and no load."
    ),
    marked(
        "The loop was closed: what is left of the drift is what the controller lets pass. Leakage past spool and "
        "piston shows as an offset in its place."
    ),
    marked("The loop was open: the drift is that of cylinder, load and valve at neutral."),
    marked("{form}, gain {gain}, time {time} ms, fit {fit} % of the same data."),
    marked(
        "χ² is {misfit} per degree of freedom: a linear model of this form misses the lines by more than their noise; "
        "intervals are widened accordingly"
    ),
    marked("{n} of {all} steps move the pressure too little."),
    marked(
        "The pressure before the steps changes by {drift} from step to step: reading or valve drifts. As much is "
        "granted to every steady pressure."
    ),
    marked("Coil temperature as set: {was} °C."),
    marked("Coil temperature measured at its housing; ± 0.5 K are granted to the copper."),
    marked("Coil temperature taken to be the fluid's, {was} °C."),
    marked("Coil temperature not known; 72 °F ± 18 °F assumed. State it with coil_temperature."),
)
_REASONS = (
    marked("it fits no better than a constant, where {least} % are asked for"),
    marked("its fit is {fit} %, where {least} % are asked for"),
    marked("a pole lies beyond {times} times the highest line, {line} Hz"),
    marked("a pole lies below a tenth of the lowest line, {line} Hz"),
    marked("no line comes near its gain at rest"), marked("the nearest has a gain of {gain}"),
    marked("the interval of {coefficients} is wider than the value"),
)  # fmt: skip
_MODELS = (
    marked("first order: time constant {constant} ms, dead time {dead} ms"), marked("first order, from the rise"),
    marked("first order, from settling"), marked("second order"), marked("third order, fitted to the response"),
)  # fmt: skip
_WORDS = (marked("at"), marked("noise"), marked("even nonlinearity"), marked("odd nonlinearity"))
_SENTENCES = (*_DEVIATIONS, *_NOTES, *_MODELS)


def sentence(text: str) -> str:
    """A note or a deviation as a page says it: `0 → 80 %: noise alone …`, the sentence after the place it is about."""
    if spoken() == ENGLISH:
        return with_minus(text)
    place, colon, rest = text.partition(": ")
    if colon and (translated := sentence(rest)) != with_minus(rest):
        return f"{label_text(place)}: {translated}"
    return with_minus(reworded(text, _SENTENCES, _put))


def _put(place: str, text: str) -> str:
    """What stands in a place of a sentence: dates and names as they are, quantities and lists in their own words."""
    if place in ("name", "serial", "date", "date_due"):
        return text
    if place == "quantity":
        return capital(_(text[:1].lower() + text[1:]))
    if place == "reasons":
        return "; ".join(reworded(reason, _REASONS) for reason in text.split("; "))
    if place == "listed":
        return ", ".join(map(_, text.split(", ")))
    if place == "places":
        return localised(text.replace(" at ", f" {_('at')} "))
    return localised(text.replace(" to ", " … ") if place.startswith("range") else text)
