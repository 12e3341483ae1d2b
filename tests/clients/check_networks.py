"""Compares outputs of onnxruntime with those of the plugins.

    python check_networks.py plan NETWORK.onnx SAMPLE.json
    python check_networks.py image IMAGE.ppm
    python check_networks.py vectors NETWORK.onnx CONVENTION IMAGE.ppm VECTORS.json

`plan` takes the inputs and our outputs that `tagalong model --export --sample` writes. `image`
writes a picture. `vectors` takes our vectors of the BOXES of that picture
(`crates/network/examples/vectors.rs`) and prepares the input of the network on its own.
"""

import json
import sys

import numpy as np
import onnx
import onnxruntime

TOLERANCE = 1e-4

# Left and top of people in the picture, of the size of the input, so that no resizing takes part.
BOXES = [(0, 0), (37, 21), (192, 44)]
WIDTH, HEIGHT = 128, 256

# Conventions of networks for re-identification: order of the colours, mean and deviation.
CONVENTIONS = {
    "osnet": ([0, 1, 2], np.array([123.675, 116.28, 103.53]), np.array([58.395, 57.12, 57.375])),
    "omz": ([2, 1, 0], np.zeros(3), np.ones(3)),
}


def arrays(tensors):
    return {
        name: np.array(tensor["values"], np.float32).reshape(tensor["shape"])
        for name, tensor in tensors.items()
    }


def compare(name, ours, theirs):
    assert ours.shape == theirs.shape, f"{name}: {ours.shape} and {theirs.shape}"
    off = np.max(np.abs(ours - theirs) / np.maximum(1, np.abs(ours)))
    print(f"{name} {list(ours.shape)}: off by {off:.1e} at most")
    assert off <= TOLERANCE, f"{name} differs"


def plan(network, sample):
    onnx.checker.check_model(onnx.load(network), full_check=True)
    with open(sample) as file:
        sample = json.load(file)
    expected = arrays(sample["outputs"])
    session = onnxruntime.InferenceSession(network)
    found = session.run(list(expected), arrays(sample["inputs"]))
    for (name, ours), theirs in zip(expected.items(), found):
        compare(name, ours, theirs)


def image(path):
    """Coloured noise: a wrong order of the colours, a shift or another scale shows in each vector."""
    random = np.random.default_rng(3)
    pixels = random.integers(0, 256, (300, 320, 3), np.uint8)
    pixels[:, :160, 0] //= 3
    pixels[150:, :, 2] //= 2
    with open(path, "wb") as file:
        file.write(b"P6\n320 300\n255\n" + pixels.tobytes())


def vectors(network, convention, picture, found):
    with open(picture, "rb") as file:
        pixels = np.frombuffer(file.read()[-320 * 300 * 3:], np.uint8).reshape(300, 320, 3)
    with open(found) as file:
        found = json.load(file)
    assert found["convention"] == convention, found["convention"]
    assert len(found["vectors"]) == len(BOXES)
    order, mean, deviation = CONVENTIONS[convention]
    session = onnxruntime.InferenceSession(network)
    for (x, y), ours in zip(BOXES, found["vectors"]):
        person = pixels[y:y + HEIGHT, x:x + WIDTH].astype(np.float64)
        person = ((person - mean) / deviation)[:, :, order]
        feed = np.ascontiguousarray(person.transpose(2, 0, 1)[None], np.float32)
        (theirs,) = session.run(None, {session.get_inputs()[0].name: feed})
        compare(f"{convention} at {x},{y}", np.array(ours, np.float32), theirs.ravel())


if __name__ == "__main__":
    {"plan": plan, "image": image, "vectors": vectors}[sys.argv[1]](*sys.argv[2:])
