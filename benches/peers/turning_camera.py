"""Makes a log in which the camera turns from one in which it stands still, with its boxes.

Usage: python turning_camera.py ../shared/data OUT.mcap [--still]

Needs `pip install mcap zstandard pillow numpy`. Each image of TUD-Stadtmitte becomes what a camera
of 480 x 400 pixels in its place would have seen: every 6 to 14 frames it turns to another direction
within 3 frames, and it rolls a little. Its focal length is the width of the image, as the reader
assumes for a log without calibration. OUT.boxes.csv is the truth and OUT.det.txt the detections of
the SORT paper, both turned alike. With `--still` the camera keeps its direction, to compare.
"""

import argparse
import io
import math
import struct
from pathlib import Path

import numpy
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer
from PIL import Image

WIDTH, HEIGHT = 480, 400
FOCAL = float(WIDTH)
FRAMES = 179
# Largest turns that keep the image within that of the log, rad.
PAN, TILT = 75 / FOCAL, 35 / FOCAL
TURNING_FRAMES = 3
ROLL_STEP = 0.002


def rotation(pan, tilt, roll):
    (sa, ca), (sb, cb), (sc, cc) = ((math.sin(v), math.cos(v)) for v in (pan, tilt, roll))
    about_y = numpy.array([[ca, 0, sa], [0, 1, 0], [-sa, 0, ca]])
    about_x = numpy.array([[1, 0, 0], [0, cb, sb], [0, -sb, cb]])
    about_z = numpy.array([[cc, -sc, 0], [sc, cc, 0], [0, 0, 1]])
    return about_y @ about_x @ about_z


def matrix(width, height):
    """Intrinsic matrix of a camera that looks through the middle of its image."""
    return numpy.array([[FOCAL, 0, (width - 1) / 2], [0, FOCAL, (height - 1) / 2], [0, 0, 1]])


def path(still):
    """Returns the homography from the pixels of the turning camera to those of the log, by frame."""
    random = numpy.random.default_rng(2)
    turns, here = [], numpy.zeros(2)
    while len(turns) < FRAMES:
        there = random.uniform(-1, 1, 2) * [PAN, TILT]
        hold = int(random.integers(6, 15))
        turns += [here + (there - here) * (k + 1) / TURNING_FRAMES for k in range(TURNING_FRAMES)]
        turns += [there] * hold
        here = there
    rolls = numpy.cumsum(random.normal(0, ROLL_STEP, FRAMES))
    rolls -= numpy.linspace(0, rolls[-1], FRAMES)
    if still:
        turns, rolls = [numpy.zeros(2)] * FRAMES, numpy.zeros(FRAMES)
    log, own = matrix(640, 480), numpy.linalg.inv(matrix(WIDTH, HEIGHT))
    all_turns = (log @ rotation(*turn, roll) @ own for turn, roll in zip(turns, rolls))
    return [homography / homography[2, 2] for homography in all_turns]


def turned_image(jpeg, homography):
    image = Image.open(io.BytesIO(jpeg))
    numbers = tuple(homography.ravel()[:8])
    image = image.transform((WIDTH, HEIGHT), Image.PERSPECTIVE, numbers, Image.BICUBIC)
    out = io.BytesIO()
    image.save(out, "JPEG", quality=92)
    return out.getvalue()


def turn_log(source, target, homographies):
    with open(source, "rb") as file, open(target, "wb") as out:
        writer, channels, frame = Writer(out, compression=CompressionType.ZSTD), {}, 0
        writer.start(profile="ros2")
        for schema, channel, message in make_reader(file).iter_messages():
            if channel.id not in channels:
                known = writer.register_schema(schema.name, schema.encoding, schema.data)
                channels[channel.id] = writer.register_channel(
                    channel.topic, channel.message_encoding, known, channel.metadata)
            # A sensor_msgs/CompressedImage: header and format, the length, the file.
            start = message.data.find(b"\xff\xd8")
            jpeg = turned_image(message.data[start:], homographies[frame])
            data = message.data[:start - 4] + struct.pack("<I", len(jpeg)) + jpeg
            writer.add_message(channels[channel.id], message.log_time, data,
                               message.publish_time, message.sequence)
            frame += 1
        writer.finish()


def turn_boxes(source, target, homographies):
    """Moves boxes, which stay upright; those whose middle leaves the image are left out."""
    lines = []
    for line in source.read_text().splitlines():
        values = line.split(",")
        frame = int(float(values[0])) - 1
        if not 0 <= frame < FRAMES:
            continue
        inverse = numpy.linalg.inv(homographies[frame])

        def seen(x, y):
            point = inverse @ [x, y, 1.0]
            return point[:2] / point[2]

        left, top, width, height = (float(value) for value in values[2:6])
        middle = seen(left + width / 2, top + height / 2)
        ends = seen(left + width / 2, top) - seen(left + width / 2, top + height)
        grown = numpy.hypot(*ends) / height
        size = numpy.array([width, height]) * grown
        if (middle > 0).all() and (middle < [WIDTH, HEIGHT]).all():
            values[2:6] = [f"{value:.2f}" for value in (*(middle - size / 2), *size)]
            lines.append(",".join(values))
    target.write_text("\n".join(lines) + "\n")


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("data", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("--still", action="store_true")
    given = parser.parse_args()
    homographies = path(given.still)
    name = "TUD-Stadtmitte"
    turn_log(given.data / "logs" / f"{name}.mcap", given.out, homographies)
    turn_boxes(given.data / "logs" / f"{name}.boxes.csv", given.out.with_suffix(".boxes.csv"),
               homographies)
    turn_boxes(given.data / "mot" / "sort-detections" / name / "det.txt",
               given.out.with_suffix(".det.txt"), homographies)


if __name__ == "__main__":
    main()
