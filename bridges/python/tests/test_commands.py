"""The program, runs, figures and tables."""

import json
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
import tagalong


def files_of(folder):
    """Those files of a run that are the same for the same log, config and seed."""
    names = ["tracks.csv", "tracks-metres.csv", "tracks.mcap", "report.json"]
    return {name: (folder / name).read_bytes() for name in names}


def test_a_run_from_python_writes_the_bytes_of_the_program(log, run, tmp_path):
    report = tagalong.run("depth-ekf", log, tmp_path / "mine")
    assert files_of(tmp_path / "mine") == files_of(run)
    assert report == json.loads((run / "report.json").read_text())
    with pytest.raises(tagalong.ConfigError, match="or overwrite=True$"):
        tagalong.run("depth-ekf", log, tmp_path / "mine")
    with pytest.raises(tagalong.TagalongError, match="smoothed=True"):
        tagalong.read_tracks(tmp_path / "mine", smoothed=True)
    again = str(tmp_path / "mine")
    tagalong.run("depth-ekf", str(log), again, overwrite=True, seed=3, smoothed=True)
    smoothed = tagalong.read_tracks(again, smoothed=True)
    assert len(smoothed["id"]) == len(tagalong.read_tracks(tmp_path / "mine/tracks.csv")["id"]) > 20


def test_a_log_that_is_none_is_an_error(tmp_path):
    (tmp_path / "none.mcap").write_bytes(b"no log")
    with pytest.raises(tagalong.TagalongError, match="none.mcap"):
        tagalong.run("depth-ekf", tmp_path / "none.mcap", tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_a_camera_is_named_as_for_the_program(log, tmp_path):
    with pytest.raises((tagalong.TagalongError, tagalong.ConfigError), match="/no_such_camera"):
        tagalong.run("depth-ekf", log, tmp_path / "out", camera="/no_such_camera")


def test_figures_are_those_of_the_program(log, run, program):
    done = program("eval", "--truth", log, "--tracks", run, "--format", "json")
    assert done.returncode == 0, done.stderr
    assert tagalong.eval(log, run) == json.loads(done.stdout)
    assert tagalong.eval(log, run, similarity="metres")["HOTA"] > 0.1
    repaired = tagalong.eval(log, run, repairs=True)["repairs"]
    assert [row["repair"] for row in repaired][:2] == ["identities", "false-reports"]
    with pytest.raises(tagalong.ConfigError, match='similarity="metres"'):
        tagalong.eval(log, run / "tracks-metres.csv")
    with pytest.raises(ValueError, match="similarity"):
        tagalong.eval(log, run, similarity="feet")
    with pytest.raises(tagalong.TagalongError, match="nowhere"):
        tagalong.eval(log, "nowhere.csv")


def test_tracks_are_arrays(run, tmp_path):
    tracks = tagalong.read_tracks(run)
    rows = (run / "tracks-metres.csv").read_text().splitlines()
    assert {len(column) for column in tracks.values()} == {len(rows) - 1}
    assert tracks["stamp_ns"].dtype == np.int64 and tracks["seen"].dtype == bool
    assert [str(stamp) for stamp in tracks["stamp_ns"]] == [row.split(",")[0] for row in rows[1:]]
    boxes = tagalong.read_tracks(run / "tracks.csv")
    assert np.count_nonzero(~np.isnan(tracks["box_x"])) == len(boxes["x"])
    assert np.nansum(tracks["box_x"]) == pytest.approx(boxes["x"].sum())
    (tmp_path / "empty.csv").write_text("")
    assert tagalong.read_tracks(tmp_path / "empty.csv")["id"].shape == (0,)
    (tmp_path / "odd.csv").write_text("1,2,three\n")
    with pytest.raises(tagalong.TagalongError, match="odd.csv"):
        tagalong.read_tracks(tmp_path / "odd.csv")


def test_the_program_ends_with_its_exit_codes(program, tmp_path):
    assert program("--version").stdout == f"tagalong {tagalong.__version__}\n"
    assert program("list").returncode == 0
    wrong = program("run", "none.toml", "none.mcap", cwd=tmp_path)
    assert wrong.returncode in (1, 2) and "none" in wrong.stderr
    assert program("frobnicate").returncode == 2
    assert tagalong.main(["list", "--format", "json"]) == 0


def test_main_returns_the_code_of_wrong_usage_and_of_help():
    """In a notebook the interpreter must go on."""
    assert tagalong.main(["run", "--no-such-option"]) == 2
    assert tagalong.main([]) == 2
    assert tagalong.main(["--help"]) == 0
    assert tagalong.main(["--version"]) == 0


def test_eval_finds_the_log_that_the_run_names(log, run, tmp_path):
    """The truth, whose places need the pose of the camera in the log, is elsewhere."""
    tracks = tagalong.read_tracks(run)
    row = np.flatnonzero(tracks["seen"])[-1]
    number = tracks["frame"][row]
    frames = tagalong.Pipeline.from_toml("depth-ekf").frames(log)
    (frame,) = [frame for frame in frames if frame.index == number]
    place = [*(tracks[f"{axis}_robot_m"][row] for axis in "xyz"), 1.0]
    right, down, forward, _ = np.linalg.inv(frame.camera.robot_from_camera) @ place
    truth = tmp_path / "mine.csv"
    truth.write_text(f"frame,id,head_x,head_y,head_z\n{number},7,{right},{down},{forward}\n")
    found = tagalong.eval(truth, run, similarity="metres")
    assert (found["truths"], found["TP"]) == (1, 1)


INTERRUPTED = """
import signal, sys, tagalong
# A shell starts background jobs with this signal ignored.
signal.signal(signal.SIGINT, signal.default_int_handler)
try:
    print("begins", flush=True)
    while True:
        tagalong.run("depth-verified", sys.argv[1], sys.argv[2], overwrite=True)
except KeyboardInterrupt:
    print("interrupted", flush=True)
# The process goes on, and can be interrupted again.
tagalong.Pipeline.from_toml("depth-ekf")
print("goes on", flush=True)
"""


def test_ctrl_c_stops_a_run_and_python_goes_on(log, tmp_path):
    command = [sys.executable, "-c", INTERRUPTED, str(log), str(tmp_path / "out")]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert process.stdout.readline() == "begins\n"
    time.sleep(0.7)
    asked = time.monotonic()
    process.send_signal(signal.SIGINT)
    out, _ = process.communicate(timeout=30)
    assert out == "interrupted\ngoes on\n"
    assert process.returncode == 0
    assert time.monotonic() - asked < 10


def test_ctrl_c_stops_the_program(tmp_path):
    command = [sys.executable, "-m", "tagalong", "trials", "--seeds", "1000"]
    process = subprocess.Popen(
        command, cwd=tmp_path, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    time.sleep(1.5)
    assert process.poll() is None
    process.send_signal(signal.SIGINT)
    assert process.wait(timeout=10) in (130, -signal.SIGINT)
