"""Files of every format, damaged at random: each ends in a recording or in one line, soon and in
little memory."""

import mutations
import pytest
from mutated_cases import CASES
from mutations import Job

MANY, DEEP = 500, 10_000


@pytest.mark.parametrize("name", CASES)
def test_damaged_files_end_in_a_recording_or_in_one_line(name, tmp_path):
    check(name, tmp_path, range(MANY))


@pytest.mark.deep
@pytest.mark.parametrize("name", CASES)
def test_many_damaged_files_end_in_a_recording_or_in_one_line(name, tmp_path):
    check(name, tmp_path, range(MANY, MANY + DEEP))


def check(name, tmp_path, seeds):
    case = CASES[name](tmp_path)
    found = mutations.run(Job(case, seeds, tmp_path))
    assert not found, f"{len(found)} of {len(seeds)}:\n" + "\n".join(map(str, found[:20]))
