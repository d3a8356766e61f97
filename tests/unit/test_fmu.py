"""Models as C and FMUs: every page has a translation, and what comes out is this program's own simulation."""

import ctypes
import inspect
import math
import shutil
import subprocess
import zipfile
from dataclasses import replace

import numpy as np
import pytest

from hil.catalog import entries
from hil.errors import FileError, InputError, UnknownNameError
from hil.fmu.build import PLATFORMS, own_platform, write_c, write_fmu
from hil.fmu.c_types import UntranslatableError
from hil.fmu.examine import ALLOWED, excitation, simulated
from hil.fmu.source import source_of
from hil.fmu.symbolic import Symbol, symbolic, written
from hil.fmu.translate import Unit
from hil.fmu.validation import MODEL, TRAJECTORIES, validate
from hil.fmu.variables import variable_name, variables_of
from hil.physics.compose import effect, kernel
from hil.physics.model import ModelEffect, Value, save_model, typical_model
from hil.physics.plant import Plant

pytestmark = pytest.mark.xdist_group("fmu")  # on one worker: sources are compiled once

PLANTS = sorted(entry.name for entry in entries("plants"))
VALVE = "brevini-hpv41"


@pytest.mark.parametrize("name", PLANTS)
def test_every_plant_and_effect_has_a_translation(name):
    variables = variables_of(typical_model(name), list(kernel(name).indices))
    source = source_of(variables)
    assert "static void kernel(" in source.text
    assert len(variables.effects_at) == len(kernel(name).sites)
    assert source.is_tunable == (
        name not in ("curve-and-response", "efc-measured", "hpv41-measured", "transfer-function")
    )


@pytest.fixture(scope="module")
def everything(tmp_path_factory):
    """The valve with every effect that fits it, all off."""
    variables = variables_of(typical_model(VALVE), list(kernel(VALVE).indices))
    path = tmp_path_factory.mktemp("fmu") / "valve.fmu"
    built = write_fmu(variables, path, "2")
    assert built.platforms == (own_platform(),)
    return path, variables


@pytest.mark.parametrize("version", ["2", "3"])
def test_fmu_is_valid_and_equals_the_simulation(tmp_path, version):
    from fmpy.validation import validate_fmu

    variables = variables_of(typical_model(VALVE))
    path = tmp_path / "valve.fmu"
    write_fmu(variables, path, version)
    assert validate_fmu(str(path)) == []
    assert validate(path).faults == ()


class Running:
    """An FMU in FMPy, before its start."""

    def __init__(self, path):
        from fmpy import extract, read_model_description
        from fmpy.simulation import instantiate_fmu

        self.folder = extract(str(path))
        described = read_model_description(self.folder)
        self.at = {variable.name: variable.valueReference for variable in described.modelVariables}
        self.described = described
        self.fmu = instantiate_fmu(self.folder, described, fmi_type="CoSimulation")
        self.fmu.setupExperiment(startTime=0.0)

    def again(self):
        """A second instance of the same binary."""
        from fmpy.fmi2 import FMU2Slave

        other = FMU2Slave(
            guid=self.described.guid, unzipDirectory=self.folder, instanceName="other",
            modelIdentifier=self.described.coSimulation.modelIdentifier,
        )  # fmt: skip
        other.instantiate()
        other.setupExperiment(startTime=0.0)
        return other

    def play(self, variables, inputs, begin=True):
        return drive(self.fmu, self.at, variables, inputs, begin)


def drive(fmu, at, variables, inputs, begin=True, start=0):
    ins = [at[variable_name(signal)] for signal in variables.inputs]
    outs = [at[variable_name(signal)] for signal in variables.outputs]
    interval_s = 10 * variables.step_s
    if begin:
        fmu.setReal(ins, inputs[:, 0].tolist())
        fmu.enterInitializationMode()
        fmu.exitInitializationMode()
    found = np.empty((len(outs), inputs.shape[1]))
    for i in range(inputs.shape[1]):
        fmu.setReal(ins, inputs[:, i].tolist())
        fmu.doStep((start + i) * interval_s, interval_s)
        found[:, i] = fmu.getReal(outs)
    return found


def test_each_effect_equals_the_simulation_when_switched_on(everything):
    path, variables = everything
    running = Running(path)
    inputs = excitation(variables)[:, :400]
    scales = np.array([[signal.full_scale] for signal in variables.outputs])
    silent = simulated(variables, inputs)
    moved = 0
    for site in variables.kernel.sites:
        typical = {p.name: Value(p.typical, p.unit) for p in site.effect.parameters_at(site.hook)}
        one = ModelEffect(site.effect.name, site.hook.name, typical)
        expected = simulated(_with(variables, one), inputs)
        running.fmu.reset()
        running.fmu.setupExperiment(startTime=0.0)
        place = f"effect.{site.effect.name}.{site.hook.name}"
        running.fmu.setReal([running.at[f"{place}.{name}"] for name in typical], [v.value for v in typical.values()])
        running.fmu.setBoolean([running.at[f"{place}.on"]], [True])
        found = running.play(variables, inputs)
        assert np.max(np.abs(found - expected) / scales) <= ALLOWED, place
        moved += bool(np.max(np.abs(expected - silent) / scales) > 1e-6)
    assert moved > len(variables.kernel.sites) / 2  # a comparison of nothing with nothing proves nothing


def _with(variables, one):
    model = type(variables.model)(
        variables.model.plant, variables.model.parameters, (one,), variables.model.input, variables.model.output
    )
    return variables_of(model, (), variables.step_s)


def test_state_is_saved_restored_and_reset(everything):
    path, variables = everything
    running, inputs = Running(path), excitation(variables)[:, :200]
    whole = running.play(variables, inputs)
    running.fmu.reset()
    running.fmu.setupExperiment(startTime=0.0)
    first = running.play(variables, inputs[:, :100])
    kept = running.fmu.getFMUState()
    as_bytes = running.fmu.serializeFMUState(kept)
    drive(running.fmu, running.at, variables, -inputs[:, 100:], begin=False, start=100)
    running.fmu.setFMUState(running.fmu.deserializeFMUState(as_bytes))
    second = drive(running.fmu, running.at, variables, inputs[:, 100:], begin=False, start=100)
    assert np.array_equal(np.hstack((first, second)), whole)


def test_instances_do_not_disturb_each_other(everything):
    path, variables = everything
    running, inputs = Running(path), excitation(variables)[:, :60]
    alone = running.play(variables, inputs)
    running.fmu.reset()
    running.fmu.setupExperiment(startTime=0.0)
    other, begun, found = running.again(), True, []
    for i in range(inputs.shape[1]):
        found.append(drive(running.fmu, running.at, variables, inputs[:, i : i + 1], begun, i))
        drive(other, running.at, variables, -inputs[:, i : i + 1], begun, i)
        begun = False
    assert np.array_equal(np.hstack(found), alone)


@pytest.mark.parametrize("value", [-1.0, math.nan, math.inf])
def test_value_out_of_bounds_is_refused(everything, value):
    from fmpy.fmi1 import FMICallException

    running = Running(everything[0])
    with pytest.raises(FMICallException):
        running.fmu.setReal([running.at["plant.full_flow"]], [value])
    assert running.fmu.getReal([running.at["plant.full_flow"]]) == [70.0]


def test_parameter_set_while_running_takes_effect(everything):
    path, variables = everything
    running, inputs = Running(path), np.full((1, 50), 80.0)
    running.play(variables, np.repeat(inputs, 10, axis=1))
    before = running.fmu.getReal([running.at["flow"]])[0]
    running.fmu.setReal([running.at["plant.full_flow"]], [35.0])
    after = drive(running.fmu, running.at, variables, inputs, begin=False, start=500)[0, -1]
    assert after == pytest.approx(before / 2.0, rel=1e-3)


def test_fmu_has_its_sources_and_they_compile_alone(everything, tmp_path):
    with zipfile.ZipFile(everything[0]) as archive:
        archive.extractall(tmp_path)
    assert {"fmi.c", "core.c", "model.h", "refusals.h"} <= {path.name for path in (tmp_path / "sources").iterdir()}
    compiler = shutil.which("cc")
    assert compiler
    subprocess.run(
        [compiler, "-std=c99", "-w", "-c", "-O0", "fmi.c", "-o", "fmi.o"], cwd=tmp_path / "sources", check=True
    )


def test_plain_c_steps_as_the_simulation_does(tmp_path):
    variables = variables_of(typical_model(VALVE))
    write_c(variables, tmp_path / "valve.c")
    with (tmp_path / "valve.c").open("a", encoding="utf-8") as file:
        file.write("int play(const double *u, int n, double *y) { static Model m; model_start(&m); m.u[0] = u[0];\n")
        file.write(
            "int bad = 0; for (int i = 0; i < n; i++) { m.u[0] = u[i]; bad += model_step(&m, (i + 1) * 10 * STEP_S);"
            " y[i] = m.y[0]; } return bad + 10 * model_set(&m, 0, P_START[0]) + 100 * !model_set(&m, NP, 1.0); }\n"
        )
    compiler = shutil.which("cc")
    command = [
        compiler,
        "-std=c99",
        "-w",
        "-shared",
        "-fPIC",
        "-O1",
        "-ffp-contract=off",
        "valve.c",
        "-o",
        "valve.so",
        "-lm",
    ]
    subprocess.run(command, cwd=tmp_path, check=True)
    inputs = excitation(variables)[:, :300].copy()
    found = np.empty(300)
    as_pointer = ctypes.POINTER(ctypes.c_double)
    play = ctypes.CDLL(str(tmp_path / "valve.so")).play
    assert play(inputs.ctypes.data_as(as_pointer), 300, found.ctypes.data_as(as_pointer)) == 0
    np.testing.assert_allclose(found, simulated(variables, inputs)[0], rtol=0, atol=70.0 * ALLOWED)


def test_a_dead_time_is_bounded_by_the_memory_that_holds_it():
    model = typical_model("transfer-function")
    late = replace(
        model, parameters=model.parameters | {"dead_time": replace(model.parameters["dead_time"], value=9.0)}
    )
    highs = [
        next(v.high for v in variables_of(one, (), 0.001).parameters if v.name == "plant.dead_time")
        for one in (model, late)
    ]
    assert highs == [10.0, 18.0]


def test_what_cannot_be_built_is_said(tmp_path):
    variables = variables_of(typical_model(VALVE))
    with pytest.raises(InputError, match=f"there are: {', '.join(PLATFORMS)}"):
        write_fmu(variables, tmp_path / "a.fmu", "3", ["amiga"])
    with pytest.raises(InputError, match="FMI 3 has"):
        write_fmu(variables, tmp_path / "a.fmu", "2", ["linux-arm64"])
    with pytest.raises(UnknownNameError, match="friction@force"):
        variables_of(typical_model(VALVE), [("friction", "forse")])
    assert write_fmu(variables, tmp_path / "a.fmu", "3", []).platforms == ()


def test_page_that_has_no_translation_names_the_line():
    def page(value):
        return [value for _ in range(3)]

    with pytest.raises(UntranslatableError, match=r"page_0: ListComp .* \[value for _ in range\(3\)\]"):
        Unit().function(page, ("f",))


def test_both_sides_of_every_branch_are_written():
    def coefficients(p, step_s):
        if p["a"] > 1.0:
            return {"gain": p["a"] / step_s}
        return {"gain": -p["b"] if p["b"] < 0.0 else math.sqrt(p["b"])}

    function = symbolic(Unit(), coefficients)
    lines = written(lambda: function({"a": Symbol("p[0]"), "b": Symbol("p[1]")}, 0.5), lambda _: [("gain", "g")])
    text = "\n".join(lines)
    assert text.count("g = ") == 3
    assert "if (p[0] > 1.0) {" in text
    assert "if (p[1] < 0.0) {" in text
    assert "sqrt(p[1])" in text


def test_command_writes_an_fmu_and_says_how_near_it_is(tmp_path, refused, prints):
    save_model(typical_model("linear-axis"), tmp_path / "axis.json")
    command = ["export", tmp_path / "axis.json", "--to", "fmu", "--out", tmp_path / "axis.fmu"]
    assert "`hil simulate`" in prints(*command, "--effect", "friction@force")
    assert "fmi 4: there are 2 and 3" in refused(*command, "--fmi", "4")


def test_kernel_of_some_effects_is_the_whole_one_with_the_others_left_out():
    whole = kernel(VALVE)
    some = whole.with_sites({("friction", "force")})
    assert isinstance(some.plant, Plant)
    assert [site.effect for site in some.sites] == [effect("friction")]
    assert some.arguments == (whole.arguments[whole.indices["friction", "force"]],)
    texts = [inspect.getsource(one.run.py_func) for one in (whole, some)]
    assert "on1 = on[1]" in texts[0] and "on1 = on[1]" not in texts[1]  # its arrays are shorter


def test_an_fmu_reproduces_its_own_trajectories(tmp_path, command_line, prints):
    fits = {"baseline.csv": 98.7}
    model = replace(typical_model(VALVE), origin={"fit_percent": fits, "paths": ["/home/me/baseline.csv"]})
    model = replace(model, parameters={**model.parameters, "pilot_rate": Value(7.0, "rad/s", 0.2)})
    write_fmu(variables_of(model), tmp_path / "valve.fmu", "3")
    found = validate(tmp_path / "valve.fmu")
    assert found.faults == () and found.difference <= ALLOWED and found.samples == 2000
    assert found.fit_percent == fits and found.model.parameters["pilot_rate"].std == 0.2
    with zipfile.ZipFile(tmp_path / "valve.fmu") as archive:
        assert "/home/me" not in archive.read(MODEL).decode()
        rest = {name: archive.read(name) for name in archive.namelist() if name != TRAJECTORIES}
        lines = archive.read(TRAJECTORIES).decode().splitlines()
    assert lines[0].startswith("time [s],command [%],flow [l/min]")
    lines[900] = ",".join([*lines[900].split(",")[:-1], "99.0"])
    for name, trajectories in (("changed.fmu", "\n".join(lines)), ("none.fmu", "")):
        with zipfile.ZipFile(tmp_path / name, "w") as archive:
            for inside, content in {**rest, **({TRAJECTORIES: trajectories} if trajectories else {})}.items():
                archive.writestr(inside, content)
    assert validate(tmp_path / "changed.fmu").faults[0].startswith("the FMU differs from the trajectories by ")
    with pytest.raises(FileError, match="carries no trajectories of its own"):
        validate(tmp_path / "none.fmu")
    with pytest.raises(FileError, match=r"nothing\.fmu: no such file$"):
        validate(tmp_path / "nothing.fmu")
    prints("verify", str(tmp_path / "valve.fmu"))
    assert command_line("verify", str(tmp_path / "changed.fmu"), "--json").status == 1
