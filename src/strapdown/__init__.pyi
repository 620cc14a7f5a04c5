"""The public names, each with the module that it comes from; `__init__.py` imports them on first use, type checkers and editors read them here."""

from . import flight as flight
from .alignment.initial import align as align
from .alignment.static_attitude import static_attitude as static_attitude
from .calibration.fitting import Calibration as Calibration, calibrate as calibrate
from .calibration.installation.calibrate import calibrate_installation as calibrate_installation
from .calibration.installation.findings import Installation as Installation
from .checks import DataError as DataError
from .cli.live.program import Live as Live
from .core.loop.contract import (
    FilterState as FilterState,
    Imu as Imu,
    InitialState as InitialState,
    Noise as Noise,
)
from .data.recording import Recording as Recording, SimulatedRecording as SimulatedRecording
from .data.solution import Solution as Solution, Source as Source, Trajectory as Trajectory
from .data.vehicle import Vehicle as Vehicle
from .data.verdict import Reason as Reason, Verdict as Verdict
from .engine.batch import fuse as fuse
from .engine.live_stream import LiveStream as LiveStream
from .engine.smoothing import smooth as smooth
from .engine.stream import Measurement as Measurement, Sample as Sample, Stream as Stream
from .evaluation.metrics import errors as errors, outages as outages, rms as rms
from .experiments.monte_carlo.campaign import Campaign as Campaign
from .experiments.monte_carlo.study import Study as Study
from .experiments.outages.compare import compare as compare
from .experiments.outages.result import Comparison as Comparison
from .fileio.limits import reading_limits as reading_limits
from .installation.diagnose import diagnose as diagnose
from .installation.findings import Diagnosis as Diagnosis
from .installation.follow import Followed as Followed, follow as follow
from .installation.states import EstimatedInstallation as EstimatedInstallation
from .io import read as read, write_recording as write_recording
from .io.example_recordings import example as example, examples as examples
from .io.noise_file import with_noise as with_noise
from .io.solution import read_solution as read_solution, write_solution as write_solution
from .io.vehicle_kits import vehicle_kit as vehicle_kit, vehicle_kits as vehicle_kits
from .pages.page import report as report
from .registration import register as register
from .sensor_models.geomagnetism import geomagnetic_field as geomagnetic_field
from .sensor_models.imu import ImuSpec as ImuSpec, imu as imu, imus as imus
from .sensor_models.receiver import receiver as receiver, receivers as receivers
from .sim.scenario import Scenario as Scenario, scenario as scenario, scenarios as scenarios
from .sim.synthesis import simulate as simulate
from .tuning.findings import Tuning as Tuning
from .tuning.tune import tune as tune

__version__: str
