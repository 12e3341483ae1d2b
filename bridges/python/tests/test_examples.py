"""The examples of docs/library.md, which read `people.mcap` in the current folder."""

import pathlib
import shutil
import subprocess
import sys

import pytest

EXAMPLES = pathlib.Path(__file__).parent.parent / "examples"


@pytest.mark.parametrize(
    "name, words",
    [("log_to_tracks", "1 at "), ("own_arrays", "1 at 2.5"), ("follow", "m/s, "), ("own_detector", "1 at 4.1 m, box (3")],
)
def test_an_example_finds_the_people(name, words, log, tmp_path):
    shutil.copy(log, tmp_path / "people.mcap")
    command = [sys.executable, str(EXAMPLES / f"{name}.py")]
    done = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path, timeout=240)
    assert done.returncode == 0, done.stderr
    assert words in done.stdout, done.stdout
