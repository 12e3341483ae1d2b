"""A simulated log, and the results of the program on it."""

import subprocess
import sys

import pytest


@pytest.fixture(scope="session")
def program():
    """Runs the installed program and returns the finished process."""

    def called(*arguments, **options):
        command = [sys.executable, "-m", "tagalong", *map(str, arguments)]
        return subprocess.run(command, capture_output=True, text=True, timeout=240, **options)

    return called


@pytest.fixture(scope="session")
def folder(tmp_path_factory, program):
    """The folder where the program was started without a log: it has a simulated one, and a run."""
    folder = tmp_path_factory.mktemp("sample")
    done = program("run", "-o", "run", cwd=folder)
    assert done.returncode == 0, done.stderr
    return folder


@pytest.fixture(scope="session")
def log(folder):
    """The simulated log."""
    return folder / "runs" / "sample.mcap"


@pytest.fixture(scope="session")
def run(folder):
    """The results of the program on it, with the config `depth-ekf`."""
    return folder / "run"
