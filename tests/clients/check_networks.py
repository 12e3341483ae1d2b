"""Compares the outputs of onnxruntime for an exported network with those of the plugin.

    python check_networks.py NETWORK.onnx SAMPLE.json
"""

import json
import sys

import numpy as np
import onnx
import onnxruntime

TOLERANCE = 1e-4


def arrays(tensors):
    return {
        name: np.array(tensor["values"], np.float32).reshape(tensor["shape"])
        for name, tensor in tensors.items()
    }


def main(network, sample):
    onnx.checker.check_model(onnx.load(network), full_check=True)
    with open(sample) as file:
        sample = json.load(file)
    expected = arrays(sample["outputs"])
    session = onnxruntime.InferenceSession(network)
    found = session.run(list(expected), arrays(sample["inputs"]))
    for (name, ours), theirs in zip(expected.items(), found):
        assert ours.shape == theirs.shape, f"{name}: {ours.shape} and {theirs.shape}"
        off = np.max(np.abs(ours - theirs) / np.maximum(1, np.abs(ours)))
        print(f"{name} {list(ours.shape)}: off by {off:.1e} at most")
        assert off <= TOLERANCE, f"{name} differs"


if __name__ == "__main__":
    main(*sys.argv[1:])
