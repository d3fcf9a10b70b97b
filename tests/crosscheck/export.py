#!/usr/bin/env python3
"""Read every export with its client and compare with the law.

    python3 tests/crosscheck/export.py target/debug/coaxdesign SCHEDULE

SCHEDULE is a schedule file or a directory of one. The test vectors of the law
are written by `coaxdesign export --to vectors`; each other form is loaded by the
program that it is for and must give the same tables at breakpoints, between
them and beyond both ends, and the same sticks over 30 s: to 1e-12 in double, to
1e-5 in single precision, of a number or of the full travel of 100 % for sticks.
Then a digit of each artefact is changed, and the same proof must fail.
Exits with 1 if anything differs.
"""

import copy
import csv
import functools
import json
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import time
import tomllib
import xml.etree.ElementTree

import numpy as np

HERE = pathlib.Path(__file__).resolve().parent
DOUBLE, SINGLE = 1e-12, 1e-5
# Full travel of a stick, percent: what errors of sticks are measured by.
TRAVEL = 100.0
STEP = 0.01
CFLAGS = "-std=c99 -Wall -Wextra -Werror -Wconversion -Wdouble-promotion -pedantic".split()
SANITIZERS = ["-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all"]

failures = []


def report(good, what, detail):
    print(f"{'ok  ' if good else 'FAIL'}  {what}: {detail}", flush=True)
    if not good:
        failures.append(what)


class Wrong(Exception):
    """A client refuses an artefact, or gives other answers."""


def close(what, found, wanted, tolerance, scale=None):
    """Largest difference, relative to a scale or to each number above 1."""
    found, wanted = np.asarray(found, dtype=float), np.asarray(wanted, dtype=float)
    if found.shape != wanted.shape:
        raise Wrong(f"{what}: shape {found.shape}, expected {wanted.shape}")
    size = np.maximum(np.abs(wanted), 1.0) if scale is None else scale
    error = float(np.max(np.abs(found - wanted) / size))
    if not error <= tolerance:
        raise Wrong(f"{what}: differs by {error:.1e}")
    return error


def run(*command, **options):
    done = subprocess.run(
        [str(c) for c in command], capture_output=True, text=True, check=False, **options
    )
    if done.returncode != 0:
        raise Wrong(f"{pathlib.Path(str(command[0])).name}: {(done.stderr + done.stdout)[-600:]}")
    return done.stdout


def table(text):
    return np.array([[float(x) for x in row] for row in csv.reader(text.splitlines())])


class Vectors:
    """What the law answers."""

    def __init__(self, directory):
        self.steps_text = (directory / "law_steps.csv").read_text()
        self.lookup_text = (directory / "law_lookup.csv").read_text()
        self.columns = self.steps_text.splitlines()[0].split(",")
        steps = table("\n".join(self.steps_text.splitlines()[1:]))
        self.inputs, self.sticks = steps[:, :15], steps[:, 15:]
        self.names = self.lookup_text.splitlines()[0].split(",")[1:]
        lookup = table("\n".join(self.lookup_text.splitlines()[1:]))
        self.speeds, self.values = lookup[:, 0], lookup[:, 1:]

    def law_entries(self):
        """Table, row and column of every number but the turn blend."""
        for name in self.names[:-1]:
            parts = name.split(".")
            yield parts[0], parts[1], parts[2] if len(parts) > 2 else "value"


# --- Forms with tables -------------------------------------------------------


def interpolated(vectors, breakpoints, entry, blend=None):
    """Tables read by the rule of the files, with NumPy's own interpolation."""
    columns = [
        np.interp(vectors.speeds, breakpoints, entry(*place)) for place in vectors.law_entries()
    ]
    found = np.array(columns).T
    return close("tables", found, vectors.values[:, :-1], DOUBLE)


def document_entries(document):
    tables = {t["name"]: t for t in document["tables"]}

    def entry(name, row, column):
        t = tables[name]
        i, j = t["rows"].index(row), t["columns"].index(column)
        return [m[i][j] for m in t["values"]]

    return entry


def prove_json(directory, vectors, schemas):
    import jsonschema

    document = json.loads((directory / "law.json").read_text())
    try:
        jsonschema.Draft202012Validator.check_schema(schemas["law"])
        jsonschema.validate(document, schemas["law"])
    except jsonschema.ValidationError as error:
        raise Wrong(f"jsonschema: {error.message[:200]}") from error
    return interpolated(vectors, document["speed"]["values"], document_entries(document))


def prove_toml(directory, vectors, schemas):
    import jsonschema

    document = tomllib.loads((directory / "law.toml").read_text())
    try:
        jsonschema.validate(document, schemas["law"])
    except jsonschema.ValidationError as error:
        raise Wrong(f"jsonschema: {error.message[:200]}") from error
    return interpolated(vectors, document["speed"]["values"], document_entries(document))


def prove_csv(directory, vectors, schemas):
    entries = {}
    with open(directory / "law.csv", newline="", encoding="utf-8") as file:
        for line in csv.DictReader(file):
            if line["speed"]:
                key = (line["quantity"], line["row"], line["column"])
                if not line["unit"]:
                    raise Wrong(f"{key} has no unit")
                entries.setdefault(key, []).append((float(line["speed"]), float(line["value"])))
    breakpoints = [speed for speed, _ in next(iter(entries.values()))]
    return interpolated(
        vectors, breakpoints, lambda *place: [value for _, value in entries[place]]
    )


def prove_matlab(directory, vectors, schemas):
    import scipy.io

    data = scipy.io.loadmat(directory / "law.mat")
    names = lambda key: [str(cell[0][0]) if cell[0].size else "" for cell in data[key]]

    def entry(name, row, column):
        values = data[name]
        if values.ndim == 2:
            values = values[:, :, None]
        return values[names(f"{name}_rows").index(row), names(f"{name}_columns").index(column)]

    if len(names("feedback_units")) != 32:
        raise Wrong("feedback has not a unit for each entry")
    error = interpolated(vectors, data["speed"].ravel(), entry)
    octave = shutil.which("octave-cli") or shutil.which("octave")
    if octave is None:
        return error
    (directory / "speeds.csv").write_text("\n".join(repr(float(v)) for v in vectors.speeds))
    out = directory / "octave.csv"
    run(octave, "--norc", HERE / "export/octave.m", directory, directory / "speeds.csv", out)
    found = table("\n".join(line.rstrip(",") for line in out.read_text().splitlines()))
    return max(error, close("Octave", found, vectors.values[:, :-1], DOUBLE))


# Bytes that the smallest boards give to scripts, Lua's own library included.
# There, pointers are half as wide as here.
LUA_HEAP = 43_000


def prove_lua(directory, vectors, schemas):
    """In Lua 5.3 as ArduPilot has it, within the heap of its smallest boards."""
    import lupa.lua53

    lua = lupa.lua53.LuaRuntime(unpack_returned_tuples=True)
    # ArduPilot opens none of these libraries.
    lua.execute("""
        local loaded = package.loaded
        for _, name in ipairs { "os", "debug", "coroutine", "utf8", "package" } do
            loaded[name], _G[name] = nil, nil
        end
        require = nil
        collectgarbage()""")
    library = round(1024 * lua.eval('collectgarbage("count")'))
    # lupa's limit is for what comes on top.
    lua = lupa.lua53.LuaRuntime(max_memory=LUA_HEAP - library, unpack_returned_tuples=True)
    try:
        law = lua.execute((directory / "law_schedule.lua").read_text())
    except lupa.lua53.LuaError as error:
        raise Wrong(f"Lua: {error}") from error
    # ahrs as ArduPilot has it: equivalent airspeed, and the ratio of the true one.
    lua.execute("ahrs = { airspeed_estimate = function() return 40.0 end,"
                " get_EAS2TAS = function() return 1.25 end }")
    if law["true_airspeed"]() != 50.0:
        raise Wrong("Lua: another true airspeed")
    places = [law["place"](name) for name in vectors.names[:-1]]
    found = []
    for speed in vectors.speeds:
        law["look_up"](float(speed))
        found.append([law["value"](k) for k in places] + [law["turn_blend"](float(speed))])
    error = close("Lua", found, vectors.values, SINGLE)
    # What a step of a script calls leaves nothing behind.
    garbage = lua.execute("""
        local law, place = ...
        local function steps()
            for k = 1, 1000 do
                law.look_up(k * 0.05) law.value(place) law.turn_blend(k * 0.05)
            end
        end
        collectgarbage() collectgarbage("stop")
        steps() -- the stack grows to its size, once
        local before = collectgarbage("count")
        steps()
        local grown = collectgarbage("count") - before
        collectgarbage("restart")
        return grown""", law, places[0])
    if garbage > 0.0:
        raise Wrong(f"Lua: {garbage:.1f} kB of garbage")
    return error


def prove_param(directory, vectors, schemas):
    """The parameters must give the law's gains back."""
    from pymavlink import mavparm

    p = mavparm.MAVParmDict()
    if not p.load(str(directory / "law.param")):
        raise Wrong("pymavlink cannot load it")
    at = dict(zip(vectors.names, vectors.values[np.argmin(np.abs(vectors.speeds))]))
    found, wanted = [], []
    for key, axis, stick, nu in [
        ("RLL", "roll", "lat", "phi_ddot"),
        ("PIT", "pitch", "lon", "theta_ddot"),
    ]:
        scale = abs(at[f"allocation.{stick}.{nu}"]) / 100.0
        angle, k_p, k_i = (p[f"ATC_{k}"] for k in (f"ANG_{key}_P", f"RAT_{key}_P", f"RAT_{key}_I"))
        found += [k_p / scale, (angle * k_p + k_i) / scale, angle * k_i / scale]
        wanted += [at[f"gains.{axis}.{k}"] for k in ("k_d", "k_p", "k_i")]
    scale = abs(at["allocation.ped.r_dot"]) / 100.0
    found += [p["ATC_RAT_YAW_P"] / scale, p["ATC_RAT_YAW_I"] / scale]
    found += [p["PSC_VELZ_P"], p["PSC_VELZ_I"], p["PSC_VELXY_P"]]
    wanted += [at["gains.yaw.k_p"], at["gains.yaw.k_i"]]
    wanted += [at["gains.heave.k_p"], at["gains.heave.k_i"]]
    wanted += [min(at["gains.vx.k_p"], at["gains.vy.k_p"])]
    return close("parameters", found, wanted, SINGLE)


# --- Forms that run the law --------------------------------------------------


def prove_program(program, vectors, tolerance):
    found = table(run(program, "lookup", input=vectors.lookup_text))
    error = close("tables", found, vectors.values, tolerance)
    # The law, switched on with given sticks, starts with them; not where it
    # would be at a limit by itself.
    off = table(run(program, "engage", input=vectors.steps_text))
    quiet = np.abs(off).max(axis=1) < 1.0
    if quiet.mean() < 0.8:
        raise Wrong("engaging moves the sticks")
    error = max(error, close("engage", off[quiet], 0.0 * off[quiet], 10 * tolerance, TRAVEL))
    found = table(run(program, "steps", input=vectors.steps_text))
    return max(error, close("sticks", found, vectors.sticks, tolerance, TRAVEL))


def prove_c(directory, vectors, schemas, tolerance=DOUBLE, flags=()):
    program = directory / "harness"
    run("gcc", *CFLAGS, "-O1", "-c", directory / "law_law.c", "-o", directory / "law.o", *flags)
    run(
        *("gcc", "-std=c99", "-I", directory, HERE / "export/harness.c", directory / "law.o"),
        *("-lm", "-o", program, *flags),
    )
    return prove_program(program, vectors, tolerance)


def prove_rust(directory, vectors, schemas, tolerance=DOUBLE):
    shutil.copy(HERE / "export/harness.rs", directory / "harness.rs")
    (directory / "lib.rs").write_text("#![no_std]\npub mod law_law;\n")
    edition = ["--edition", "2021", "--out-dir", directory]
    run("rustc", *edition, "--crate-type", "lib", "--emit", "metadata", directory / "lib.rs")
    run("rustc", *edition, "-O", "-D", "warnings", "-A", "dead_code", directory / "harness.rs")
    return prove_program(directory / "harness", vectors, tolerance)


def demand_of(row):
    return {
        "mode": int(row[10]),
        "horizontal": [row[11], row[12]],
        "heading_rate": row[13],
        "vertical_velocity": row[14],
    }


def measurement_of(row):
    return {
        "velocity_body": row[1:4],
        "rates": row[4:7],
        "roll": row[7],
        "pitch": row[8],
        "airspeed": row[9],
    }


def prove_python(directory, vectors, schemas):
    run(sys.executable, "-m", "mypy", "--strict", "--no-error-summary", "--cache-dir",
        directory / "mypy", directory / "law_law.py")
    reader = {"__name__": "law_law"}
    exec(compile((directory / "law_law.py").read_text(), "law_law.py", "exec"), reader)
    try:
        law = reader["Law"].load(directory / "law.json")
    except (ValueError, KeyError) as error:
        raise Wrong(f"reader: {error}") from error
    found = []
    for speed in vectors.speeds:
        values = law.at(speed)
        line = [x for t in law.document["tables"] if t["needed_by_law"]
                for row in values[t["name"]] for x in row]
        found.append(line + [law.turn_blend(speed)])
    error = close("tables", found, vectors.values, DOUBLE)
    many = law.at(vectors.speeds.reshape(1, -1))
    found = [many[t["name"]][0].reshape(len(vectors.speeds), -1)
             for t in law.document["tables"] if t["needed_by_law"]]
    close("tables at once", np.hstack(found), vectors.values[:, :-1], DOUBLE)
    controller = reader["Controller"](law, STEP)
    rows = vectors.inputs.tolist()
    prove_refusals(controller, rows[0])
    found = [controller.step(measurement_of(row), demand_of(row)) for row in rows]
    error = max(error, close("sticks", found, vectors.sticks, DOUBLE, TRAVEL))
    speeds = [2.0, 13.0, 24.0, 27.0, 33.0, 44.0]
    linear = max(state_space_error(reader, law, v) for v in speeds)
    if not linear <= 1e-5:
        raise Wrong(f"state space: differs from the law's small deviations by {linear:.1e}")
    return error


def prove_refusals(controller, row):
    """What is no number is refused, and leaves the law as it was."""
    before = (dict(controller.memory), {k: list(v) for k, v in controller.lines.items()})
    for change in ({"roll": float("nan")}, {"airspeed": float("inf")}):
        try:
            controller.step(measurement_of(row) | change, demand_of(row))
        except ValueError:
            pass
        else:
            raise Wrong(f"reader: takes {change}")
    try:
        controller.step(measurement_of(row), demand_of(row) | {"mode": 7})
    except ValueError:
        pass
    else:
        raise Wrong("reader: takes an unknown mode")
    if (controller.memory, controller.lines) != before:
        raise Wrong("reader: a refused input changes the law")


def state_space_error(reader, law, speed):
    """Difference between the StateSpace and the law with all its terms for small
    deviations, over 2 s of inputs, relative to the answer; under attitude and
    under velocity demands."""
    import control

    # The tables stand still, far from every limit. Halfway between two level
    # trims the interpolated velocity climbs a little: the law would move the
    # collective from there, and the pedals' power with it. This law's trim is
    # level, and exactly at its speed.
    values = law.at(speed)
    (_, (v,), _), ((roll,), (pitch,)) = values["trim_velocity"], values["trim_attitude"]
    w = (speed * np.sin(pitch) - v * np.sin(roll)) / np.cos(roll)
    values["trim_velocity"][:] = [[speed * np.cos(pitch)], [v], [w]]
    document = copy.deepcopy(law.document)
    document["speed"]["values"] = [speed]
    for t in document["tables"]:
        t["values"] = [values[t["name"]]]
    for c in document["constants"]:
        if c["name"].startswith("stick_"):
            c["value"] = -1e9 if c["name"].endswith("_min") else 1e9
    law = reader["Law"](document)
    trim = [r[0] for r in values["trim_velocity"]]
    attitude = [r[0] for r in values["trim_attitude"]]
    count, size = 200, 1e-6
    time = np.arange(count) * STEP

    def measured(x):
        (u, v, w), roll, pitch = (np.add(trim, x[:3]), attitude[0] + x[6], attitude[1] + x[7])
        lifted = v * np.sin(roll) + w * np.cos(roll)
        forward = u * np.cos(pitch) + lifted * np.sin(pitch)
        ground = [forward, v * np.cos(roll) - w * np.sin(roll)]
        down = lifted * np.cos(pitch) - u * np.sin(pitch)
        m = {"velocity_body": [u, v, w], "rates": list(x[3:6]), "roll": roll, "pitch": pitch,
             "airspeed": forward}
        return m, ground, down

    worst = 0.0
    for mode in (reader["ATTITUDE"], reader["VELOCITY"]):
        model = law.state_space(speed, STEP, velocity_mode=mode == reader["VELOCITY"])
        if model.input_labels[:2] != ["u", "v"] or model.dt != STEP:
            raise Wrong("state space: names or step are wrong")
        inputs = np.array([size * np.sin((1.0 + 0.37 * k) * time + k) for k in range(12)])
        inputs[:, 0] = 0.0  # starts at the trim
        _, wanted = control.forced_response(model, time, inputs)
        controller = reader["Controller"](law, STEP)
        _, ground, down = measured(np.zeros(8))
        rest = ground if mode == reader["VELOCITY"] else attitude
        found = []
        for x in inputs.T:
            m, _, _ = measured(x)
            demand = {"mode": mode, "horizontal": [rest[0] + x[8], rest[1] + x[9]],
                      "heading_rate": x[10], "vertical_velocity": down + x[11]}
            found.append(controller.step(m, demand))
        found = (np.array(found) - found[0]).T
        # Without the inputs the law itself still drifts where the trim between
        # two level ones climbs a little.
        controller = reader["Controller"](law, STEP)
        m, _, down = measured(np.zeros(8))
        demand = {"mode": mode, "horizontal": rest, "heading_rate": 0.0, "vertical_velocity": down}
        still = np.array([controller.step(m, demand) for _ in time])
        found -= (still - still[0]).T
        worst = max(worst, float(np.max(np.abs(found - wanted)) / np.max(np.abs(wanted))))
    return worst


AIRCRAFT = """<?xml version="1.0"?>
<fdm_config name="bench" version="2.0">
  <fileheader><author>test bench</author></fileheader>
  <metrics><wingarea unit="M2">1</wingarea><wingspan unit="M">1</wingspan>
    <chord unit="M">1</chord>
    <location name="AERORP" unit="M"><x>0</x><y>0</y><z>0</z></location>
    <location name="EYEPOINT" unit="M"><x>0</x><y>0</y><z>0</z></location>
    <location name="VRP" unit="M"><x>0</x><y>0</y><z>0</z></location></metrics>
  <mass_balance><ixx unit="KG*M2">1000</ixx><iyy unit="KG*M2">1000</iyy>
    <izz unit="KG*M2">1000</izz><emptywt unit="KG">450</emptywt>
    <location name="CG" unit="M"><x>0</x><y>0</y><z>0</z></location></mass_balance>
  <ground_reactions/><propulsion/><aerodynamics/>
  <system file="law_law"/>
</fdm_config>
"""

JSBSIM_INPUTS = [
    "u-m_sec", "v-m_sec", "w-m_sec", "p-rad_sec", "q-rad_sec", "r-rad_sec", "phi-rad",
    "theta-rad", "airspeed-m_sec", "velocity-mode", "command-1", "command-2",
    "heading-rate-rad_sec", "v-z-m_sec",
]


def prove_jsbsim(directory, vectors, schemas):
    import jsbsim

    try:
        error = fly_jsbsim(jsbsim, directory, vectors)
        # What JSBSim says while it loads the aircraft, which it writes past Python.
        code = ("import jsbsim; fdm = jsbsim.FGFDMExec('.', None); fdm.set_dt(0.01); "
                "assert fdm.load_model('bench')")
        said = subprocess.run([sys.executable, "-c", code], cwd=directory, capture_output=True,
                              text=True, check=False)
        if said.returncode != 0 or "already defined" in said.stderr + said.stdout:
            raise Wrong(f"JSBSim: {(said.stderr + said.stdout)[-600:]}")
        return error
    except jsbsim.BaseError as error:
        raise Wrong(f"JSBSim: {error}") from error


def linked(fdm):
    """Inside an aircraft the law measures by itself, in the same frame."""
    fdm["ic/u-fps"], fdm["ic/v-fps"], fdm["ic/w-fps"] = 100.0, 10.0, 5.0
    fdm["ic/phi-rad"], fdm["ic/theta-rad"] = 0.2, 0.1
    fdm["ic/vw-mag-fps"], fdm["ic/vw-dir-deg"] = 20.0, 70.0
    fdm.run_ic()
    fdm["fcs/throttle-cmd-norm"] = 0.0
    before = [fdm[f"velocities/{k}-fps"] * 0.3048 for k in "uvw"]
    before += [fdm[f"velocities/{k}-rad_sec"] for k in "pqr"]
    phi, theta = fdm["attitude/phi-rad"], fdm["attitude/theta-rad"]
    u, v, w = (fdm[f"velocities/{k}-aero-fps"] * 0.3048 for k in "uvw")
    forward = u * np.cos(theta) + (v * np.sin(phi) + w * np.cos(phi)) * np.sin(theta)
    if not abs(forward - before[0]) > 1.0:
        raise Wrong("the test's wind does not show")
    found = [fdm[f"law/in/{n}"] for n in JSBSIM_INPUTS[:9]]
    close("link", found, before + [phi, theta, forward], 1e-6)


def fly_jsbsim(jsbsim, directory, vectors):
    place = directory / "aircraft/bench"
    (place / "Systems").mkdir(parents=True, exist_ok=True)
    (place / "bench.xml").write_text(AIRCRAFT)
    shutil.copy(directory / "law_law.xml", place / "Systems")
    # No output but errors.
    jsbsim.FGJSBBase().debug_lvl = 0
    fdm = jsbsim.FGFDMExec(str(directory), None)
    fdm.set_debug_level(0)
    fdm.set_dt(STEP)
    if not fdm.load_model("bench"):
        raise Wrong("JSBSim does not load it")
    # High above the ground, so that the bench stays clear of it.
    fdm["ic/h-sl-ft"] = 30000.0
    fdm["law/in/reset"] = 1.0
    linked(fdm)
    fdm["law/in/linked"] = 0.0
    fdm.run_ic()

    properties = {}
    for name, (t, row, column) in zip(vectors.names, vectors.law_entries()):
        path = f"law/at/{t}/{row}" + ("" if column == "value" else f"/{column}")
        properties[name] = path
    catalog = {line.split(" ")[0] for line in fdm.query_property_catalog("law/at").splitlines()}
    columns = [k for k, name in enumerate(vectors.names[:-1]) if properties[name] in catalog]
    # Numbers that depend on speed are tables; the rest stand in the formulas.
    varying = np.flatnonzero(np.ptp(vectors.values[:, :-1], axis=0) > DOUBLE)
    if not set(varying) <= set(columns):
        raise Wrong("not every number that depends on speed is a table")
    found = []
    for speed in vectors.speeds:
        fdm["law/in/airspeed-m_sec"] = float(speed)
        fdm.run()
        line = [fdm[properties[vectors.names[k]]] for k in columns]
        found.append(line + [fdm["law/turn/blend"]])
    error = close("tables", found, vectors.values[:, columns + [-1]], DOUBLE)

    found = []
    for row in vectors.inputs:
        for name, x in zip(JSBSIM_INPUTS, row[1:]):
            fdm[f"law/in/{name}"] = float(x)
        fdm["law/in/reset"] = 0.0 if found else 1.0
        fdm.run()
        found.append([fdm[f"law/sticks/{s}"] for s in ("lat", "lon", "col", "ped")])
    return max(error, close("sticks", found, vectors.sticks, DOUBLE, TRAVEL))


def prove_initialisation(unit, reference, real, columns, vectors, outputs):
    """The first outputs follow from the inputs, the sticks to start from among
    them, and move nothing of the law."""
    row = vectors.inputs[0]
    unit.setReal([reference[n] for n in real], [float(row[k]) for k in columns])
    unit.setInteger([reference["mode"]], [int(row[10])])
    close("first outputs", unit.getReal(outputs), vectors.sticks[0], DOUBLE, TRAVEL)
    given = [reference[f"{s}_0"] for s in ("lat", "lon", "col", "ped")]
    sticks = list(vectors.sticks[0] + [1.0, -2.0, 3.0, -1.0])
    unit.setReal([reference["engage"], *given], [1.0, *sticks])
    close("engaged", unit.getReal(outputs), sticks, 1e-9, TRAVEL)
    unit.setReal([reference["engage"]], [0.0])
    unit.exitInitializationMode()
    close("settled", unit.getReal(outputs), vectors.sticks[0], DOUBLE, TRAVEL)


def prove_fmu(directory, vectors, schemas):
    import fmpy
    import fmpy.fmi2
    import fmpy.validation

    path = directory / "law.fmu"
    problems = fmpy.validation.validate_fmu(str(path))
    if problems:
        raise Wrong(f"FMPy: {problems}")
    names = ["u", "v", "w", "p", "q", "r", "phi", "theta", "airspeed", "mode", "command_1",
             "command_2", "heading_rate", "v_z_command"]
    description = fmpy.read_model_description(str(path))
    reference = {v.name: v.valueReference for v in description.modelVariables}
    folder = fmpy.extract(str(path), str(directory / "unpacked"))
    real = [n for n in names if n != "mode"]
    columns = [1 + names.index(n) for n in real]
    unit = fmpy.fmi2.FMU2Slave(
        guid=description.guid,
        unzipDirectory=folder,
        modelIdentifier=description.coSimulation.modelIdentifier,
        instanceName="law",
    )
    unit.instantiate()
    unit.setupExperiment(startTime=0.0)
    unit.enterInitializationMode()
    outputs = [reference[s] for s in ("lat", "lon", "col", "ped")]
    prove_initialisation(unit, reference, real, columns, vectors, outputs)
    found = []
    for row in vectors.inputs:
        unit.setReal([reference[n] for n in real], [float(row[k]) for k in columns])
        unit.setInteger([reference["mode"]], [int(row[10])])
        unit.doStep(currentCommunicationPoint=float(row[0]), communicationStepSize=STEP)
        found.append(unit.getReal(outputs))
    unit.terminate()
    unit.freeInstance()
    error = close("sticks", found, vectors.sticks, DOUBLE, TRAVEL)
    # FMPy's own simulation loop, on a stretch of constant inputs.
    start = {n: float(vectors.inputs[0][k]) for n, k in zip(real, columns)}
    result = fmpy.simulate_fmu(
        str(path), start_values=start, stop_time=STEP, step_size=STEP, output_interval=STEP,
        output=["lat", "lon", "col", "ped"],
    )
    last = [result[s][-1] for s in ("lat", "lon", "col", "ped")]
    return max(error, close("simulate_fmu", last, vectors.sticks[0], DOUBLE, TRAVEL))


# --- Back again --------------------------------------------------------------


def prove_import(program, directory, vectors):
    """MAT files that other programs wrote, compressed, must come back as the
    same law."""
    import scipy.io

    data = scipy.io.loadmat(directory / "law.mat")
    data = {k: v for k, v in data.items() if not k.startswith("__")}
    scipy.io.savemat(directory / "scipy.mat", data, do_compression=True)
    files = ["scipy.mat"]
    octave = shutil.which("octave-cli") or shutil.which("octave")
    if octave is not None:
        files.append("octave.mat")
        code = "s = load('law.mat'); save('-v7', 'octave.mat', '-struct', 's');"
        run(octave, "--norc", "--eval", code, cwd=directory)
    for file in files:
        design = directory / f"{file}_imported"
        run(program, "import", directory / file, "-o", design)
        out = directory / f"{file}_vectors"
        run(program, "export", design, "--to", "vectors", "--name", "law", "--unverified",
            "--step", f"{STEP} s", "-o", out)
        if (out / "law_steps.csv").read_text() != vectors.steps_text:
            raise Wrong(f"{file}: another law came back")
    return files


# --- All of them -------------------------------------------------------------


def corrupt_text(file, decimals):
    """Changes one number of an artefact that matters."""

    def change(directory):
        path = directory / file
        text = path.read_text()
        wrong = None
        for decimal in decimals:
            if decimal in text:
                digit = decimal.find(".") + 3
                other = "7" if decimal[digit] != "7" else "3"
                wrong = decimal[:digit] + other + decimal[digit + 1 :]
                text = text.replace(decimal, wrong, 1)
                break
        if wrong is None:
            raise RuntimeError(f"nothing to corrupt in {file}")
        path.write_text(text)

    return change


def corrupt_lua(value):
    def change(directory):
        path = directory / "law_schedule.lua"
        text = path.read_text()
        packed = lambda x: "".join(f"\\x{b:02x}" for b in np.float32(x).tobytes())
        assert packed(value) in text
        path.write_text(text.replace(packed(value), packed(value * 1.001)))

    return change


def corrupt_mat(value):
    def change(directory):
        path = directory / "law.mat"
        data = path.read_bytes()
        old = np.float64(value).tobytes()
        assert old in data
        path.write_bytes(data.replace(old, np.float64(value * 1.001).tobytes(), 1))

    return change


def corrupt_fmu(value):
    def change(directory):
        path = directory / "law.fmu"
        data = path.read_bytes()
        # The shared object, behind the last local header of the archive.
        at = data.index(b"binaries/")
        old = np.float64(value).tobytes()
        assert old in data[at:]
        wrong = data[:at] + data[at:].replace(old, np.float64(value * 1.001).tobytes())
        path.write_bytes(refreshed(wrong))

    return change


def refreshed(data):
    """The archive with its check sums made right, so that only its contents
    are wrong."""
    import io
    import struct
    import zipfile
    import zlib

    data = bytearray(data)
    with zipfile.ZipFile(io.BytesIO(bytes(data))) as archive:
        infos = archive.infolist()
    for info in infos:
        name = info.filename.encode()
        head = info.header_offset
        extra = struct.unpack_from("<H", data, head + 28)[0]
        start = head + 30 + len(name) + extra
        crc = struct.pack("<I", zlib.crc32(bytes(data[start : start + info.file_size])))
        data[head + 14 : head + 18] = crc
        central = data.rindex(name) - 46
        assert data[central : central + 4] == b"PK\x01\x02"
        data[central + 16 : central + 20] = crc
    return bytes(data)


def main(program, schedule):
    scratch = pathlib.Path(tempfile.mkdtemp(prefix="export-"))
    try:
        check(program, schedule, scratch)
    finally:
        shutil.rmtree(scratch)
    print(f"{len(failures)} failures" if failures else "all exports agree with the law")
    return 1 if failures else 0


def check(program, schedule, scratch):
    def export(folder, form, *more):
        out = scratch / folder
        run(program, "export", schedule, "--to", form, "--name", "law", "--unverified",
            "--step", f"{STEP} s", "-o", out, *more)
        return out

    vectors = Vectors(export("vectors", "vectors"))
    schemas = {kind: json.loads(run(program, "schema", kind)) for kind in ("law", "schedule")}
    import jsonschema

    path = pathlib.Path(schedule)
    native = json.loads((path / "schedule.json" if path.is_dir() else path).read_text())
    try:
        jsonschema.Draft202012Validator.check_schema(schemas["schedule"])
        jsonschema.validate(native, schemas["schedule"])
        report(True, "schedule.json", "its JSON Schema holds")
    except jsonschema.ValidationError as error:
        report(False, "schedule.json", error.message[:300])

    # Numbers that matter, as every form writes them: of B_d^-1 at an inner
    # breakpoint, from the schedule itself.
    inner = native["points"][len(native["points"]) // 2]["matrices"]["decoupling"]
    value = inner[0][0]
    single = str(np.float32(value))
    decimals = [repr(value), single]
    sanitized = functools.partial(prove_c, flags=SANITIZERS)
    single_c = functools.partial(prove_c, tolerance=SINGLE)
    single_rust = functools.partial(prove_rust, tolerance=SINGLE)
    gain = re.compile(r"^ATC_RAT_RLL_P (\S+)$", re.M)
    proofs = [
        ("json", [], prove_json, corrupt_text("law.json", decimals)),
        ("csv", [], prove_csv, corrupt_text("law.csv", decimals)),
        ("toml", [], prove_toml, corrupt_text("law.toml", decimals)),
        ("c", [], prove_c, corrupt_text("law_law.c", decimals)),
        ("c", ["sanitizers"], sanitized, corrupt_text("law_law.c", decimals)),
        ("c", ["--precision", "float"], single_c, corrupt_text("law_law.c", decimals)),
        ("rust", [], prove_rust, corrupt_text("law_law.rs", decimals)),
        ("rust", ["--precision", "float"], single_rust, corrupt_text("law_law.rs", decimals)),
        ("matlab", [], prove_matlab, corrupt_mat(value)),
        ("python", [], prove_python, corrupt_text("law.json", decimals)),
        ("jsbsim", [], prove_jsbsim, corrupt_text("law_law.xml", decimals)),
        ("ardupilot", ["lua"], prove_lua, corrupt_lua(value)),
        ("ardupilot", ["parameters"], prove_param, None),
        ("fmu", ["--cc", "gcc"], prove_fmu, corrupt_fmu(value)),
    ]
    for form, more, prove, corrupt in proofs:
        name = " ".join([form, *[m.lstrip("-") for m in more]])
        folder = name.replace(" ", "_")
        options = more if more and more[0].startswith("--") else []
        began = time.monotonic()
        try:
            directory = export(folder, form, *options)
            if corrupt is None:
                found = gain.search((directory / "law.param").read_text()).group(1)
                corrupt = corrupt_text("law.param", [found])
            spoilt = scratch / (folder + "_spoilt")
            shutil.copytree(directory, spoilt)
            error = prove(directory, vectors, schemas)
            report(True, name, f"differs by {error:.1e} ({time.monotonic() - began:.1f} s)")
        except Wrong as wrong:
            report(False, name, wrong)
            continue
        corrupt(spoilt)
        try:
            prove(spoilt, vectors, schemas)
            report(False, name, "the corrupted artefact passes")
        except Wrong as wrong:
            report(True, name, f"corrupted: {str(wrong).splitlines()[0][:90]}")
    try:
        files = prove_import(program, export("back", "matlab"), vectors)
        report(True, "import", f"{' and '.join(files)} give the same law")
    except Wrong as wrong:
        report(False, "import", wrong)
    # The sources of the unit compile with a client's own tool chain, too.
    for form in ("fmu",):
        directory = export("fmu_sources", form)
        with __import__("zipfile").ZipFile(directory / "law.fmu") as archive:
            archive.extractall(directory / "unpacked")
            text = archive.read("modelDescription.xml").decode()
        xml.etree.ElementTree.fromstring(text)
        try:
            folder = directory / "unpacked/sources"
            run("gcc", *CFLAGS, "-fPIC", "-shared", folder / "law_fmu.c", folder / "law_law.c",
                "-lm", "-o", directory / "law.so")
            report(True, "fmu sources", "compile without warnings")
        except Wrong as wrong:
            report(False, "fmu sources", wrong)


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    sys.exit(main(sys.argv[1], sys.argv[2]))
