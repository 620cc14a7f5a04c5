"""Studies on Dask: workers that die, runs that kill them, schedulers that are not there."""

import os
import signal

import pytest
from test_study import FLIGHT, study, tables

import strapdown as sd
from strapdown.core.compile.jit import COMPILED
from strapdown.sensor_models.imu import ImuSpec, imu as imu_spec
from strapdown.sensor_models.streams import RandomStream

pytestmark = pytest.mark.skipif(
    not COMPILED, reason="worker processes without the compiler are too slow"
)


class Deadly(ImuSpec):
    """An IMU that kills its process in run 3."""

    def corrupt(self, imu, seed):
        if seed == RandomStream.of(0).child(FLIGHT.name).numbered_child(3).child("imu"):
            os.kill(os.getpid(), signal.SIGKILL)
        return ImuSpec.corrupt(self, imu, seed)


class Clumsy(ImuSpec):
    """An IMU that kills its process once."""

    def corrupt(self, imu, seed):
        if not os.path.exists(self.source):
            open(self.source, "w").close()
            os.kill(os.getpid(), signal.SIGKILL)
        return ImuSpec.corrupt(self, imu, seed)


def spec(kind, source=""):
    g = imu_spec("paper1-tactical")
    return kind(g.name, g.gyro, g.accel, source)


@pytest.fixture(autouse=True)
def classes_travel_by_value():
    """Workers cannot import this file."""
    import sys

    import cloudpickle

    cloudpickle.register_pickle_by_value(sys.modules[__name__])
    yield
    cloudpickle.unregister_pickle_by_value(sys.modules[__name__])


@pytest.mark.deep
def test_a_run_that_kills_its_worker_is_quarantined_and_the_others_stay(tmp_path):
    said = []
    found = study(imus=spec(Deadly), runs=6).run(tmp_path / "deadly", workers=1, notify=said.append)
    whole = study(runs=6).run()
    assert (
        list(found.runs.end[found.runs["filter"] == "open-loop"])
        == ["survived"] * 3 + ["quarantined"] + ["survived"] * 2
    )
    assert any("run 3 kills its worker; it is quarantined (seed 0, run 3)" in line for line in said)
    others = found.runs.run != 3
    assert (
        found.runs[others].rmse_position_m.tolist() == whole.runs[others].rmse_position_m.tolist()
    )
    assert found.summary.quarantined.tolist() == [1, 1]


@pytest.mark.deep
def test_workers_that_do_not_come_back_are_replaced(monkeypatch):
    from strapdown.experiments.monte_carlo import distributed

    monkeypatch.setattr(distributed, "CLUSTER_PATIENCE", 0.5)
    with distributed._client(1, None) as client:
        client.cluster.scale(0)
        assert client.submit(abs, -3).result(timeout=60) == 3


@pytest.mark.deep
def test_a_worker_killed_from_outside_costs_nothing(tmp_path):
    mark = tmp_path / "mark"
    found = study(imus=spec(Clumsy, str(mark)), runs=6).run(tmp_path / "clumsy", workers=1)
    assert mark.exists() and tables(found.folder) == tables(
        study(runs=6).run(tmp_path / "whole").folder
    )


def test_a_scheduler_of_ones_own_and_one_that_is_not_there(tmp_path, monkeypatch):
    from dask.distributed import LocalCluster

    with LocalCluster(
        n_workers=1, threads_per_worker=1, processes=False, dashboard_address=":0"
    ) as cluster:
        found = study(runs=6).run(tmp_path / "cluster", scheduler=cluster.scheduler_address)
    assert tables(found.folder) == tables(study(runs=6).run(tmp_path / "whole").folder)
    monkeypatch.setattr("strapdown.experiments.monte_carlo.distributed.CLUSTER_PATIENCE", 1)
    with pytest.raises(sd.DataError, match="scheduler tcp://127.0.0.1:9: no answer"):
        study(runs=6).run(tmp_path / "none", scheduler="tcp://127.0.0.1:9")
    with pytest.raises(sd.DataError, match="beside 2 workers here; give one of the two"):
        study(runs=6).run(tmp_path / "none", workers=2, scheduler="tcp://127.0.0.1:9")
    with pytest.raises(sd.DataError, match="give tcp://HOST:PORT"):
        study(runs=6).run(tmp_path / "none", scheduler="")
    with pytest.raises(sd.DataError, match="workers is -1"):
        study(scenarios=FLIGHT, runs=6).run(tmp_path / "none", workers=-1)
