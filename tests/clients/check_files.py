"""Reads the files of a run with Python `mcap` and `rosbags`, and compares them
with each other. Exits with 1 at the first thing that is wrong."""

import csv
import json
import sys
from collections import Counter
from pathlib import Path

from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader


def read_with_mcap(path):
    """Topic counts and decoded track lists, every CRC checked."""
    counts, arrays = Counter(), []
    with path.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True, decoder_factories=[DecoderFactory()])
        assert reader.get_header().profile == "ros2"
        for _, channel, message, decoded in reader.iter_decoded_messages():
            counts[channel.topic] += 1
            if channel.topic == "/people/tracks":
                arrays.append((message.log_time, decoded))
        attachments = [a.name for a in reader.iter_attachments()]
        metadata = [m.name for m in reader.iter_metadata()]
        statistics = reader.get_summary().statistics
    assert attachments == ["config.toml"], attachments
    assert metadata == ["tagalong"], metadata
    assert statistics.message_count == sum(counts.values())
    return counts, arrays


def read_with_rosbags(path):
    """Topic counts, every message deserialised by the schema in the file."""
    counts = Counter()
    with AnyReader([path]) as reader:
        for connection, _, raw in reader.messages():
            reader.deserialize(raw, connection.msgtype)
            counts[connection.topic] += 1
    return counts


def check_arrays(arrays, metres):
    """The track lists agree with tracks-metres.csv."""
    listed = {}
    for row in metres:
        listed[int(row["stamp_ns"]), row["id"]] = row
    found = 0
    for log_time, array in arrays:
        stamp = array.header.stamp.sec * 10**9 + array.header.stamp.nanosec
        assert stamp == log_time, (stamp, log_time)
        for detection in array.detections:
            row = listed[stamp, detection.id]
            position = detection.results[0].pose.pose.position
            for value, name in [(position.x, "x"), (position.y, "y"), (position.z, "z")]:
                assert abs(value - float(row[f"{name}_robot_m"])) < 1e-3, (row, position)
            assert detection.results[0].hypothesis.class_id == "person"
            found += 1
    assert found == len(metres), f"{found} in tracks.mcap, {len(metres)} in tracks-metres.csv"
    return found


def check_boxes(path, size=20_000):
    """tracks.csv has the ten columns of the MOTChallenge."""
    rows = 0
    with path.open(newline="") as stream:
        for row in csv.reader(stream):
            assert len(row) == 10 and row[7:] == ["-1", "-1", "-1"], row
            frame, number = int(row[0]), int(row[1])
            x, y, width, height, score = map(float, row[2:7])
            assert frame >= 1 and number >= 0 and 0 <= score <= 1, row
            assert 0 <= x < size and 0 <= y < size and width > 0 and height > 0, row
            rows += 1
    return rows


def main():
    run = Path(sys.argv[1])
    counts, arrays = read_with_mcap(run / "tracks.mcap")
    print(f"mcap: ok, {sum(counts.values())} messages in {len(counts)} topics")
    again = read_with_rosbags(run / "tracks.mcap")
    assert again == counts, (again, counts)
    print(f"rosbags: ok, {sum(again.values())} messages deserialised")
    with (run / "tracks-metres.csv").open(newline="") as stream:
        metres = list(csv.DictReader(stream))
    people = check_arrays(arrays, metres)
    boxes = check_boxes(run / "tracks.csv")
    report = json.loads((run / "report.json").read_text())
    assert report["frames"]["processed"] == len(arrays), report["frames"]
    print(f"files agree: {len(arrays)} frames, {people} places, {boxes} boxes")


main()
