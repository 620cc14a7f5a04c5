"""Sensors and filters from outside the library: from a file, a call of `register`, an installed
package. Everything runs in a folder of its own and in processes of its own, as a user's would."""

import importlib
import os
import subprocess
import sys
from pathlib import Path

import pytest

from strapdown.checks import DataError

SENSOR = """
from strapdown.core.loop.contract import OBSERVE, MeasurementModel, kernel


@kernel(OBSERVE)
def observe(belief, y, parameters, innovation, H):
    innovation[0] = y[0] - belief.v_n[2]
    H[0, 5] = 1.0
    return 1


VERTICAL_SPEED = MeasurementModel("vertical-speed", observe, ("speed",))
"""
FILTER = """
from strapdown.filters.ins.closed_loop import CLOSED_LOOP

CAREFUL = CLOSED_LOOP._replace(name="careful")
"""
FUSED = '''
from dataclasses import replace

import numpy as np
import strapdown as sd


def recording():
    """Ten seconds with a vertical speed that nothing else would tell."""
    made = sd.simulate("demo", 10.0, seed=1)
    t, v = made.reference.t[::25], made.reference.v_n[::25, 2:]
    vario = sd.Source("vertical-speed", t, v, np.full(v.shape, 0.01), name="vario")
    return replace(made, sources=(*made.sources, vario))
'''


@pytest.fixture
def run(tmp_path):
    """Function of the words of a Python command line -> (exit code, standard output, standard
    error), run in a folder outside the checkout; `files` of {name: text} are written there."""

    def run(*words, **variables):
        result = subprocess.run(
            [sys.executable, "-W", "error::DeprecationWarning", *map(str, words)],
            cwd=tmp_path,
            env=os.environ | variables,
            capture_output=True,
            text=True,
        )
        return result.returncode, result.stdout, result.stderr

    def write(**files):
        for name, text in files.items():
            (tmp_path / f"{name}.py").write_text(text)

    run.write, run.folder = write, tmp_path
    return run


def installed(folder: Path, name: str, **modules: str) -> str:
    """A package as pip leaves it in `folder`, whose modules are plugins; the path to import
    from."""
    about = folder / "site" / f"{name}-1.0.dist-info"
    about.mkdir(parents=True)
    (about / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
    lines = "".join(f"{module} = {module}\n" for module in modules)
    (about / "entry_points.txt").write_text(f"[strapdown.plugins]\n{lines}")
    for module, text in modules.items():
        (folder / "site" / f"{module}.py").write_text(text)
    return os.pathsep.join([str(folder / "site"), os.environ.get("PYTHONPATH", "")])


def test_a_registered_sensor_and_filter_work_in_batch_stream_smoother_and_comparison(run):
    run.write(
        sensor=SENSOR,
        mine=FILTER,
        fused=FUSED,
        main="""
import numpy as np
import strapdown as sd
from fused import recording
from mine import CAREFUL
from sensor import VERTICAL_SPEED

sd.register(VERTICAL_SPEED, CAREFUL)
sd.register(VERTICAL_SPEED)  # as when a cell of a notebook runs again
r = recording()
s = sd.fuse(r, "careful")
assert s.counts()["vario"] == (36, 0), s.counts()
assert s.trajectory.std[-1, 5] < 0.006 < sd.fuse(sd.simulate("demo", 10.0, seed=1)).trajectory.std[-1, 5]
assert sd.smooth(r, "careful").counts()["vario"] == (36, 0)
grade = r.meta["grade"]
stream = sd.Stream("careful", start=sd.align(r, sd.imu(grade)), imu=grade, sources=r.sources)
events = [sd.Sample(*row) for row in zip(*map(np.ndarray.tolist, r.imu))]
events += [
    sd.Measurement(float(t), i, tuple(map(float, y)), tuple(map(float, std_)))
    for i, a in enumerate(r.sources)
    for t, y, std_ in zip(a.t, a.y, a.std)
]
for event in sorted(events, key=lambda e: (e.t, isinstance(e, sd.Sample))):
    stream.step(event)
assert np.allclose(stream.finish().v_n, s.trajectory.v_n[-1], rtol=0, atol=1e-12)
sd.write_recording(r, "r.nc")
assert sd.read("r.nc").sources[-1].kind == "vertical-speed"
sd.report(s, r.reference).save("report.html")
""",
    )
    assert run("main.py") == (0, "", "")
    assert "vario" in (run.folder / "report.html").read_text()
    code, out, err = run("-m", "strapdown", "fuse", "r.nc", "--filter", "careful")
    assert code == 2 and "kind 'vertical-speed'" in err and "Traceback" not in err
    words = ("-m", "strapdown", "--plugin", "sensor.py", "--plugin", "mine.py")
    code, out, err = run(*words, "fuse", "r.nc", "--filter", "careful", "--imu", "tactical")
    assert code == 0 and "vario: 36 fixes accepted" in out, err
    variables = {"STRAPDOWN_PLUGINS": os.pathsep.join(["sensor.py", "mine"])}
    code, out, err = run("-m", "strapdown", "plugins", PYTHONPATH=_path(run.folder), **variables)
    assert code == 0 and "MeasurementModel vertical-speed" in out and "Filter careful" in out, err


def _path(folder):
    return os.pathsep.join([str(folder), os.environ.get("PYTHONPATH", "")])


def test_an_installed_package_is_found_by_its_entry_point(run):
    path = installed(run.folder, "variometers", sensor_of_package=SENSOR, filter_of_package=FILTER)
    run.write(
        fused=FUSED,
        main="""
import sys
import strapdown as sd
from strapdown import aiding, filters
from fused import recording

r = sd.simulate("demo", 2.0)
sd.fuse(r)
assert "sensor_of_package" not in sys.modules  # nobody has asked for it
assert sd.fuse(recording(), "careful").counts()["vario"] == (36, 0)
assert aiding.names()[-1] == "vertical-speed" and "careful" in filters.names()
""",
    )
    assert run("main.py", PYTHONPATH=path) == (0, "", "")


def test_an_entry_point_may_name_a_single_value(run):
    """That value comes, and nothing else of its module."""
    both = SENSOR + "\nOTHER = VERTICAL_SPEED._replace(name='other-speed')\n"
    path = installed(run.folder, "variometers", pair=both)
    entry = run.folder / "site" / "variometers-1.0.dist-info" / "entry_points.txt"
    entry.write_text("[strapdown.plugins]\nvario = pair:VERTICAL_SPEED\n")
    run.write(
        main="""
from strapdown import aiding

assert "vertical-speed" in aiding.names() and "other-speed" not in aiding.names()
"""
    )
    assert run("main.py", PYTHONPATH=path) == (0, "", "")


def test_a_kernel_that_raises_is_named_in_batch_and_stream(run):
    run.write(
        sensor=SENSOR.replace(
            "    return 1",
            "    if y[0] > 900.0:\n        raise ValueError('too fast')\n    return 1",
        ),
        main="""
from dataclasses import replace

import numpy as np
import pytest
import strapdown as sd
from sensor import VERTICAL_SPEED

sd.register(VERTICAL_SPEED)
r = sd.simulate("demo", 4.0, seed=1)
vario = sd.Source("vertical-speed", np.array([2.0]), np.array([[999.0]]), np.array([[0.1]]))
start, said = sd.align(r, sd.imu("tactical")), "^plugin sensor.py: a kernel fails while it runs .ValueError: too fast.$"
with pytest.raises(sd.DataError, match=said):
    sd.fuse(replace(r, sources=(*r.sources, vario)), start=start)
stream = sd.Stream("closed-loop", start=start, imu="tactical", sources=[vario])
stream.step(sd.Measurement(2.0, 0, (999.0,), (0.1,)))
with pytest.raises(sd.DataError, match=said):
    for row in zip(*map(np.ndarray.tolist, r.imu)):
        stream.step(sd.Sample(*row))
""",
    )
    assert run("main.py") == (0, "", "")


def test_a_recording_toml_names_a_kind_from_outside(run):
    run.write(
        sensor=SENSOR,
        fused=FUSED,
        main="""
import numpy as np
import strapdown as sd
r = sd.simulate("demo", 10.0, seed=1)
imu = np.c_[r.imu.t, r.imu.dtheta / r.imu.dt[:, None], r.imu.dv / r.imu.dt[:, None]]
np.savetxt("imu.csv", imu, delimiter=",", header="t,wx,wy,wz,fx,fy,fz", comments="", fmt="%.12g")
truth = r.reference
fix = np.c_[truth.t, np.degrees(truth.lla[:, :2]), truth.lla[:, 2]][::100]
np.savetxt("fix.csv", fix, delimiter=",", header="t,lat,lon,h", comments="", fmt="%.12g")
vario = np.c_[truth.t, truth.v_n[:, 2] * 100][::25]
np.savetxt("vario.csv", vario, delimiter=",", header="t,w", comments="", fmt="%.12g")
""",
    )
    (run.folder / "recording.toml").write_text("""
[imu]
file = "imu.csv"
time = { column = "t", unit = "s" }
gyro = { columns = ["wx", "wy", "wz"], unit = "rad/s" }
accel = { columns = ["fx", "fy", "fz"], unit = "m/s^2" }
grade = "tactical"
[[source]]
kind = "position"
file = "fix.csv"
time = { column = "t", unit = "s" }
columns = ["lat", "lon", "h"]
unit = ["deg", "deg", "m"]
std = 1.0
[[source]]
kind = "vertical-speed"
file = "vario.csv"
time = { column = "t", unit = "s" }
columns = ["w"]
unit = "cm/s"
std = 10.0
""")
    assert run("main.py")[0] == 0
    code, out, err = run("-m", "strapdown", "--plugin", "sensor.py", "fuse", "recording.toml")
    assert code == 0 and "vertical-speed: 32 fixes accepted" in out, out + err
    code, out, err = run("-m", "strapdown", "--plugin", "sensor.py", "inspect", "recording.toml")
    assert code == 0 and "vertical-speed" in out, err


BAD = {
    "cannot be imported": ("import no_such_module", "cannot be imported .ModuleNotFoundError"),
    "ends the process": ("raise SystemExit(3)", "cannot be imported .SystemExit: 3"),
    "has no kernel": (
        SENSOR.replace("@kernel(OBSERVE)", ""),
        "MeasurementModel 'vertical-speed': observe is not a kernel",
    ),
    "has another signature": (
        SENSOR.replace("(OBSERVE)", "(PREDICT)").replace(
            "import OBSERVE", "import OBSERVE, PREDICT"
        ),
        "MeasurementModel 'vertical-speed': observe is a kernel with another signature",
    ),
    "has other arguments": (
        SENSOR.replace("belief, y, parameters", "belief, y"),
        "observe has the arguments belief, y, innovation, H; it must have 5",
    ),
    "has four quantities": (
        SENSOR.replace('("speed",)', '("speed",) * 4'),
        "it has 4 quantities; it must have 1 to 3",
    ),
    "has a quantity that nobody knows": (
        SENSOR.replace('("speed",)', '("sped",)'),
        "'sped' .did you mean 'speed'",
    ),
    "has a name that is taken": (
        SENSOR.replace('"vertical-speed"', '"velocity"'),
        "the library already has a MeasurementModel of the name 'velocity'; choose another",
    ),
    "has no name": (SENSOR.replace('"vertical-speed"', '""'), "a MeasurementModel has the name ''"),
    "has a name that no label takes": (
        SENSOR.replace('"vertical-speed"', '"vertical speed"'),
        "the name 'vertical speed'; it must be text without spaces",
    ),
    "has a filter whose name is taken": (
        FILTER.replace('"careful"', '"mekf"'),
        "the library already has a Filter of the name 'mekf'",
    ),
}


@pytest.mark.parametrize("case", BAD)
def test_what_cannot_be_used_is_told_in_one_line_and_all_else_works(run, case):
    import re

    text, said = BAD[case]
    run.write(bad=text, sensor=SENSOR.replace("vertical-speed", "vertical-speed-2"))
    files = os.pathsep.join(["bad.py", "sensor.py"])
    variables = {"STRAPDOWN_PLUGINS": files, "COLUMNS": "250"}
    code, out, err = run("-m", "strapdown", "plugins", **variables)
    assert code == 0 and "MeasurementModel vertical-speed-2" in out
    assert re.fullmatch(f"strapdown: plugin bad.py: .*{said}.*\n", err), err
    register = f"{text}\nimport strapdown as sd\n" + (
        "sd.register(CAREFUL)" if "CAREFUL" in text else "sd.register(VERTICAL_SPEED)"
    )
    if "imported" not in said:
        run.write(main=register)
        code, _, err = run("main.py")
        assert code == 1 and re.search(f"DataError: .*{said}", err.splitlines()[-1]), err


def test_a_kernel_that_does_not_compile_is_named_in_one_line(run):
    run.write(
        sensor=SENSOR.replace("belief.v_n[2]", "belief.speed_downwards"),
        fused=FUSED,
        main='import strapdown as sd\nfrom fused import recording\nsd.write_recording(recording(), "r.nc")',
    )
    variables = {"STRAPDOWN_PLUGINS": "sensor.py", "NUMBA_DISABLE_JIT": "0"}
    assert run("main.py", **variables)[0] == 0
    code, out, err = run("-m", "strapdown", "fuse", "r.nc", "--imu", "tactical", **variables)
    lines = err.splitlines()
    assert code == 2 and len([line for line in lines if "compiling" not in line]) == 1, err
    for part in ("plugin sensor.py", "vertical-speed", "observe", "sensor.py, line", "speed_downw"):
        assert part in lines[-1]


def test_two_packages_with_sensors_do_not_collide_and_one_name_has_one_owner(run):
    path = installed(
        run.folder,
        "both",
        first=SENSOR,
        second=SENSOR.replace("vertical-speed", "vertical-speed-2"),
        third=SENSOR,
    )
    run.write(
        main="""
import warnings
warnings.simplefilter("ignore")
from strapdown import aiding
from strapdown.plugins import plugins
own = len(aiding.own_names())
assert [aiding.number(n) for n in ("vertical-speed", "vertical-speed-2")] == [own, own + 1]
assert aiding.REGISTRY.brought_by("vertical-speed").name == "first"
(third,) = [p for p in plugins() if p.name == "third"]
assert "plugin first already has a MeasurementModel of the name 'vertical-speed'" in third.complaints[0]
""",
    )
    assert run("main.py", PYTHONPATH=path) == (0, "", "")


STUDY = """
import sys
import strapdown as sd
from sensor import VERTICAL_SPEED
from mine import CAREFUL
from strapdown.sensor_models.any_sensor import Simulated

if __name__ == "__main__":
    sd.register(VERTICAL_SPEED, CAREFUL)
    flight = sd.scenario("demo").replace(
        name="flight", duration=10.0, sensors=(Simulated("vertical-speed", 0.05, 4.0),)
    )
    study = sd.Study((flight,), ("closed-loop", "careful"), runs=4, seed=3)
    alone = study.run(out="alone")
    assert [name for name, _ in alone.manifest["plugins"]] == ["mine.py", "sensor.py"]
    study.run(out="apart", workers=2)
    for name in ("summary.csv", "runs.csv"):
        assert open(f"alone/{name}").read() == open(f"apart/{name}").read()
"""


def test_workers_of_a_study_import_what_it_needs(run):
    run.write(sensor=SENSOR, mine=FILTER, main=STUDY)
    assert run("main.py") == (0, "", "")
    # with another sensor the same folder is another campaign
    run.write(sensor=SENSOR.replace("belief.v_n[2]", "belief.v_n[2] * 1"))
    code, _, err = run("main.py")
    assert code == 1 and "DataError: alone: " in err.splitlines()[-1], err


def test_a_plugins_values_belong_to_a_campaign(tmp_path, monkeypatch):
    """Of its kernels, wherever they come from; a value that nothing identifies is refused."""
    from strapdown.experiments.monte_carlo.campaign import _digest
    from strapdown.plugins import Plugin

    monkeypatch.syspath_prepend(tmp_path)
    value = "import os\nK = {}\n"
    of_environment = value.format("float(os.environ['K'])")

    def digest(code, K):
        (tmp_path / "valued.py").write_text(
            code + SENSOR.replace("belief.v_n[2]", "belief.v_n[2] * K")
        )
        monkeypatch.setenv("K", K)
        monkeypatch.delitem(sys.modules, "valued", raising=False)
        importlib.invalidate_caches()
        importlib.import_module("valued")
        return _digest(Plugin("valued.py", str(tmp_path / "valued.py"), "valued", whole=True))

    one, again, three = (digest(of_environment, K) for K in ("1", "1", "3"))
    assert one == again != three
    with pytest.raises(DataError, match="^plugin valued.py: K in observe is an object, so it"):
        digest(value.format("object()"), "1")


@pytest.mark.short
def test_a_plugin_that_a_worker_lacks_is_named():
    from strapdown.checks import DataError
    from strapdown.plugins import PluginWarning, require

    with pytest.warns(PluginWarning), pytest.raises(DataError) as error:
        require([("vario.py", "/no/such/folder/vario.py")])
    said = str(error.value)
    assert "plugin vario.py on a worker" in said and "there is no file" in said and "\n" not in said


def test_what_has_no_file_is_refused_before_workers_start(run):
    run.write(sensor=SENSOR)
    session = """
import strapdown as sd
from strapdown.filters.ins.closed_loop import CLOSED_LOOP

sd.register(CLOSED_LOOP._replace(name="typed"))
sd.Study(("demo",), ("typed",), runs=1).run(workers=2)
"""
    code, _, err = run("-c", session)
    assert code == 1 and "write the plugin into a file" in err.splitlines()[-1], err


def test_two_packages_may_call_their_entry_points_alike(run):
    path = installed(run.folder, "one", one_sensors=SENSOR)
    two = SENSOR.replace("vertical-speed", "vertical-speed-2")
    path = os.pathsep.join([installed(run.folder, "two", two_sensors=two), path])
    for name in ("one", "two"):
        entry = run.folder / "site" / f"{name}-1.0.dist-info" / "entry_points.txt"
        entry.write_text(f"[strapdown.plugins]\nsensors = {name}_sensors\n")
    code, out, err = run("-m", "strapdown", "plugins", PYTHONPATH=path)
    assert code == 0 and err == "" and "vertical-speed-2" in out and out.count("sensors") >= 2


def test_an_edited_sensor_that_is_registered_again_runs_its_new_code(run):
    main = """
import importlib, pathlib, sys, time
import numpy as np
import strapdown as sd
import sensor
from strapdown.sensor_models.any_sensor import Simulated

def measured():
    made = sd.simulate("demo", 5.0, seed=1, sensors=(Simulated("vertical-speed", 1e-6),))
    return made.sources[-1].y.sum()

sd.register(sensor.VERTICAL_SPEED)
first = measured()
file = pathlib.Path("sensor.py")
file.write_text(file.read_text().replace("belief.v_n[2]", "(belief.v_n[2] + 10.0)"))
importlib.reload(sensor)
sd.register(sensor.VERTICAL_SPEED)
assert abs(measured() - first - 50.0) < 1e-3, (first, measured())
file.write_text(file.read_text().replace("10.0", "20.0"))  # and saved again before it is compiled
importlib.reload(sensor)
time.sleep(0.1)
file.write_text(file.read_text().replace("20.0", "30.0"))
sd.register(sensor.VERTICAL_SPEED)
assert abs(measured() - first - 100.0) < 1e-3
"""
    run.write(sensor=SENSOR, main=main)
    assert run("main.py") == (0, "", "")
    run.write(
        main="import strapdown as sd, sensor\n" + main.partition("file =")[0] + "print(first)"
    )
    moved = float(run("main.py")[1])
    run.write(sensor=SENSOR)
    assert moved - float(run("main.py")[1]) == pytest.approx(150.0, abs=1e-3)


@pytest.mark.short
def test_numbers_of_kinds_stay_and_filters_are_found_by_name_or_not_sent(monkeypatch):
    import copy
    import pickle

    from strapdown import aiding, filters, plugins
    from strapdown.checks import DataError

    monkeypatch.setattr(plugins, "_plugins", {})
    monkeypatch.setattr(aiding, "_given", {})
    velocity = aiding.find("velocity")
    for name in ("one", "two"):
        aiding.REGISTRY.add(velocity._replace(name=name), f"module_{name}")
    numbers = [aiding.number("two"), aiding.number("one")]
    aiding.REGISTRY.add(velocity._replace(name="three"), "module_one")
    assert [aiding.number("two"), aiding.number("one")] == numbers
    assert aiding.number("three") == numbers[1] + 1 == len(aiding.own_names()) + 2

    own = filters.find("closed-loop")
    other = own._replace(reference="mine")
    assert pickle.loads(pickle.dumps(own)) is own and copy.deepcopy(other) is other
    with pytest.raises(DataError, match="known in this process alone"):
        pickle.dumps(other)


@pytest.mark.short
@pytest.mark.parametrize(
    "changes, said",
    [
        (dict(name="turn rate", units={"rad/s": 1.0, "rpm": 0.1}), "give dimension='angular"),
        (dict(units={"V": 1.0, "m/s": 2.0}), "the unit 'm/s' exists already"),
        (dict(units={"u": 1.0, "m/s": 2.0}, dimension="speed"), "give one of the two"),
        (dict(units={"mV": 1e-3}), "must begin with the SI unit"),
        (dict(dimension="sped"), "did you mean 'speed'"),
        (dict(units={"V": 1.0}, innovation="lenght"), "did you mean 'length'"),
        (dict(units=("V", "mV")), "is not valid"),
        (dict(units={"V": 1.0}, most=0.0), "most is 0.0; it must be a number above 0"),
        (
            dict(name="speed", units={"V": 1.0}),
            "the library already has a Quantity of the name 'speed'",
        ),
    ],
)
def test_quantities_that_cannot_be(monkeypatch, changes, said):
    from strapdown import plugins
    from strapdown.checks import DataError
    from strapdown.units.conversion import UNITS, factor
    from strapdown.units.quantities import REGISTRY, Quantity

    monkeypatch.setattr(plugins, "_plugins", {})
    before = {name: dict(units) for name, units in UNITS.items()}
    with pytest.raises(DataError, match=said):
        REGISTRY.add(Quantity(**{"name": "voltage", **changes}), __name__)
    assert UNITS == before and factor("deg/s", "angular rate") < 0.02
