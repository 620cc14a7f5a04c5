"""Every case of the tests with damaged files, by name."""

from pathlib import Path

from mutated_cases import CASES as LOGS
from mutated_own import OWN
from mutations import Case
from structured_mutators import misnamed, tiny


def of_all(change):
    """A case of the main files of all logs."""

    def case(tmp_path: Path) -> Case:
        files = {}
        for name, make in LOGS.items():
            folder = tmp_path / name
            folder.mkdir()
            made = make(folder)
            files[f"{name}{Path(made.bent[0]).suffix}"] = made.files[made.bent[0]]
        return Case(change.__name__, files, (), tuple(files), change=change, refused=True)

    return case


CASES = {**LOGS, **OWN, "misnamed": of_all(misnamed), "tiny": of_all(tiny)}
