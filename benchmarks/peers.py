"""The packages that `make bench` times on the workloads, and which of all are installed."""

from importlib.metadata import PackageNotFoundError, version

from adapters import Estimate, Result, filterpy_ukf, judged, python_ins, smsfusion_ins

__all__ = ["PACKAGES", "RUNS", "Estimate", "Result", "judged", "versions"]

PACKAGES = ("python-ins", "smsfusion", "filterpy")


def versions(packages=PACKAGES):
    """{package: version, or None where it is not installed}."""
    found = {}
    for name in packages:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = None
    return found


RUNS = (
    ("python-ins feedback", python_ins.feedback, "python-ins", {"A": 30.0, "B": 10.0}),
    ("python-ins feedforward", python_ins.feedforward, "python-ins", {"N": 60.0}),
    ("smsfusion AidedINS", smsfusion_ins.aided, "smsfusion", {"A": 1800.0, "B": 1800.0}),
    ("filterpy UKF", filterpy_ukf.ukf, "filterpy", {"A": 5.0, "B": 25.0}),
)
"""(name, function, package, seconds of each workload that are enough to time it)."""
