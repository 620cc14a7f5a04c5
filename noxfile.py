"""The test suite on every Python and numba that the library is for: `make versions`.

`nox -l` lists the sessions, `nox -s "suite-3.12(numba='newest')" -- -m short` runs one, with what
follows `--` given to pytest. A Python that is not installed is listed as skipped at the end.
"""

import re

import nox

nox.options.error_on_missing_interpreters = False
nox.options.download_python = "never"
nox.options.reuse_venv = "yes"

PYTHONS = ("3.11", "3.12", "3.13", "3.14")
OLDEST_NUMBA = {"3.14": "numba==0.63.*"}
"""Of Pythons that are younger than the lower bound in pyproject.toml."""


def lower_bounds() -> dict[str, str]:
    """{package: the oldest version that pyproject.toml allows, as pip wants it}."""
    told = nox.project.load_toml("pyproject.toml")
    extras = told["project"]["optional-dependencies"]
    listed = told["tool"]["strapdown"]["dependencies"] + [
        each for extra in ("compile", "logs", "analysis") for each in extras[extra]
    ]
    bounds = (re.match(r"([\w-]+)>=([\d.]+)", each) for each in listed)
    return {found[1]: f"{found[1]}=={found[2]}" for found in bounds if found}


@nox.session(python=PYTHONS)
@nox.parametrize("numba", ["oldest", "newest"])
def suite(session: nox.Session, numba: str) -> None:
    """The suite without its deep tests."""
    oldest = OLDEST_NUMBA.get(str(session.python), lower_bounds()["numba"])
    pinned = [oldest] if numba == "oldest" else []
    session.install("-e", ".[test]", "-e", "reproductions", *pinned)
    session.run("python", "-c", "import numba, sys; print(sys.version, 'numba', numba.__version__)")
    wanted = session.posargs or ("-n", "2", "--dist", "worksteal", "-m", "not deep")
    session.run("python", "-m", "pytest", *wanted)


@nox.session(python=PYTHONS[0])
def bounds(session: nox.Session) -> None:
    """The demo with the oldest version of every package that pyproject.toml allows."""
    session.install("-e", ".", *lower_bounds().values())
    page = f"{session.create_tmp()}/report.html"
    session.run("strapdown", "demo", "--out", page)
