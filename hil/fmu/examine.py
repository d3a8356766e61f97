"""An FMU and this program's own simulation of its model, on a multisine."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from hil.fmu.variables import Variables, variable_name
from hil.physics.simulate import Drive, simulate, sub_steps
from hil.record.recording import Array

ALLOWED = 1e-9  # of full scale
_SAMPLES = 2000
INTERVALS = 10  # internal steps to a sample
_TONES = (1, 3, 7, 13, 29, 61)


def excitation(variables: Variables) -> Array:
    """A multisine on every input, within its full scale, shape (inputs, n)."""
    time = np.arange(_SAMPLES) / _SAMPLES
    wave = sum(np.sin(2.0 * math.pi * tone * time + tone**2) for tone in _TONES) / len(_TONES)
    return np.array([signal.full_scale * (0.4 + 0.5 * wave) for signal in variables.inputs])


def simulated(variables: Variables, inputs: Array) -> Array:
    """What this program simulates, shape (outputs, n)."""
    model, interval_s = variables.model, INTERVALS * variables.step_s
    drive = Drive(inputs, math.nan, interval_s, read_at=1.0)
    factor = INTERVALS / sub_steps(variables.plant, interval_s)
    return simulate(variables.plant, model.values, drive, model.active_effects, factor=factor)


def played(path: Path, variables: Variables, inputs: Array) -> Array:
    """What the FMU makes of the inputs, sample by sample, shape (outputs, n)."""
    from fmpy import extract, read_model_description
    from fmpy.simulation import instantiate_fmu

    folder = extract(str(path))
    described = read_model_description(folder)
    by_name = {variable.name: variable.valueReference for variable in described.modelVariables}
    ins = [by_name[variable_name(signal)] for signal in variables.inputs]
    outs = [by_name[variable_name(signal)] for signal in variables.outputs]
    fmu = instantiate_fmu(folder, described, fmi_type="CoSimulation")
    third = described.fmiVersion.startswith("3")
    read, write = (fmu.getFloat64, fmu.setFloat64) if third else (fmu.getReal, fmu.setReal)
    interval_s = INTERVALS * variables.step_s
    if not third:
        fmu.setupExperiment(startTime=0.0)
    write(ins, inputs[:, 0].tolist())
    fmu.enterInitializationMode()
    fmu.exitInitializationMode()
    found = np.empty((len(outs), inputs.shape[1]))
    for i in range(inputs.shape[1]):
        write(ins, inputs[:, i].tolist())
        fmu.doStep(currentCommunicationPoint=i * interval_s, communicationStepSize=interval_s)
        found[:, i] = read(outs)
    fmu.terminate()
    fmu.freeInstance()
    return found
