"""Writes the linear machine of `hog-upper-body` as an ONNX network of the family of YOLOv8.

    pip install onnx numpy
    python upper_bodies.py ../../configs/models/hog-upper-body-linear.toml upper-bodies.onnx

Not a good detector, but one with weights of our own that were fitted to photographs, for trying the
plugin `onnx` where no other file is at hand: histograms of gradients (N. Dalal and B. Triggs, CVPR
2005) in 15 sizes, with the normalisation of `plugins/hog-upper-body/src/hog.rs`, and one convolution
with the weights of the machine. The boxes are upper bodies: `body = "upper"`.
"""

import base64
import sys
import tomllib

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

WIDTH, HEIGHT = 640, 480
CELL, BINS, BLOCKS = 8, 9, 7
# Sides of the upper-body squares, pixels of the input; in a window they have half of its width.
SIDES = [32 * 1.15**step for step in range(15)]
WINDOW, SQUARE, ABOVE = (BLOCKS + 1) * CELL, 32.0, 0.1
# Pixels of the resized image around it, so that a person at the border has a window.
BORDER = 32


class Graph:
    """Operators and constants."""

    def __init__(self):
        self.nodes, self.constants = [], []

    def add(self, kind, *inputs, outputs=None, **attributes):
        outputs = outputs or [f"v{len(self.nodes)}"]
        self.nodes.append(helper.make_node(kind, inputs, outputs, outputs[0], **attributes))
        return outputs[0] if len(outputs) == 1 else outputs

    def constant(self, value, kind=np.float32):
        name = f"c{len(self.constants)}"
        self.constants.append(numpy_helper.from_array(np.asarray(value, kind), name))
        return name


def read_machine(path):
    """Returns the weights, by block row, block column and value, and slope and offset of the
    log-odds."""
    with open(path, "rb") as file:
        model = tomllib.load(file)
    assert model["machine"] == "linear", "the model is no linear machine"
    weights = np.frombuffer(base64.b64decode(model["numbers"]), "<f4")
    weights = weights.reshape(BLOCKS, BLOCKS, 4 * BINS)
    slope = model["slope"]
    return weights * slope, model["levels"][0] * slope + model["offset"]


def grey(graph):
    """Grey values, 0 to 255."""
    luma = np.array([0.299, 0.587, 0.114]).reshape(1, 3, 1, 1) * 255
    return graph.add("Conv", "images", graph.constant(luma), kernel_shape=[1, 1])


def votes(graph, roots):
    """Lengths of the gradients, divided between the two nearest of nine directions."""
    across = np.zeros((2, 1, 3, 3))
    across[0, 0, 1], across[1, 0, :, 1] = [-1, 0, 1], [-1, 0, 1]
    slopes = graph.add("Conv", roots, graph.constant(across), kernel_shape=[3, 3])
    x, y = (graph.add("Slice", slopes, graph.constant([at], np.int64),
                      graph.constant([at + 1], np.int64), graph.constant([1], np.int64))
            for at in (0, 1))
    square = graph.add("Add", graph.add("Mul", x, x), graph.add("Mul", y, y))
    length = graph.add("Sqrt", square)
    tangent = graph.add("Div", y, graph.add("Add", x, graph.constant(1e-6)))
    turn = graph.add("Mul", graph.add("Atan", tangent), graph.constant(1 / np.pi))
    turn = graph.add("Sub", turn, graph.add("Floor", turn))
    centres = ((np.arange(BINS) + 0.5) / BINS).reshape(1, BINS, 1, 1)
    away = graph.add("Abs", graph.add("Sub", turn, graph.constant(centres)))
    away = graph.add("Min", away, graph.add("Sub", graph.constant(1), away))
    share = graph.add("Sub", graph.constant(1), graph.add("Mul", away, graph.constant(BINS)))
    return graph.add("Mul", length, graph.add("Relu", share))


def cells(graph, votes):
    """Histograms of the cells, to which pixels vote by their distance."""
    ramp = (np.arange(CELL) + 0.5) / CELL
    ramp = np.concatenate([ramp, ramp[::-1]])
    kernel = np.tile(np.outer(ramp, ramp), (BINS, 1, 1, 1))
    return graph.add("Conv", votes, graph.constant(kernel), kernel_shape=[2 * CELL] * 2,
                     strides=[CELL] * 2, pads=[CELL // 2] * 4, group=BINS)


def divided(graph, blocks, least):
    """Blocks, divided by their lengths."""
    square = graph.add("Mul", blocks, blocks)
    sums = graph.add("ReduceSum", square, graph.constant([1], np.int64), keepdims=1)
    length = graph.add("Add", graph.add("Sqrt", sums), graph.constant(least))
    return graph.add("Div", blocks, length)


def blocks(graph, cells, rows, columns):
    """Blocks of two by two cells: normalised, clipped, normalised again."""
    def part(y, x):
        ends = [y + rows - 1, x + columns - 1]
        return graph.add("Slice", cells, graph.constant([y, x], np.int64),
                         graph.constant(ends, np.int64), graph.constant([2, 3], np.int64))

    four = [part(y, x) for y in (0, 1) for x in (0, 1)]
    block = graph.add("Concat", *four, axis=1)
    block = divided(graph, block, 0.1 * 4 * BINS / np.sqrt(255))
    return divided(graph, graph.add("Min", block, graph.constant(0.2)), 1e-3)


def one_size(graph, image, size, side, machine):
    """Log-odds of all windows of one size, and their upper-body squares."""
    # As many pixels as make whole cells, with one around them for the gradients.
    scale = SQUARE / side
    width, height = (int(length * scale) for length in (WIDTH, HEIGHT))
    if (width, height) != size:
        sizes = graph.constant([1, 1, height, width], np.int64)
        image = graph.add("Resize", image, "", "", sizes, mode="linear",
                          coordinate_transformation_mode="half_pixel")
    pads = graph.constant([0, 0, BORDER, BORDER] * 2, np.int64)
    roots = graph.add("Sqrt", graph.add("Relu", graph.add("Pad", image, pads, mode="edge")))
    rows, columns = ((length + 2 * BORDER - 2) // CELL for length in (height, width))
    weights, bias = machine
    kernel = weights.transpose(2, 0, 1)[None]
    log_odds = graph.add(
        "Conv", blocks(graph, cells(graph, votes(graph, roots)), rows, columns),
        graph.constant(kernel), graph.constant([bias]), kernel_shape=[BLOCKS] * 2)
    down, across = rows - BLOCKS, columns - BLOCKS
    y, x = np.mgrid[:down, :across]
    left = 1 + CELL * x - BORDER + (WINDOW - SQUARE) / 2
    top = 1 + CELL * y - BORDER + ABOVE * WINDOW
    boxes = np.stack([left + SQUARE / 2, top + SQUARE / 2,
                      np.full(x.shape, SQUARE), np.full(x.shape, SQUARE)])
    boxes = boxes * (WIDTH / width)
    flat = graph.add("Reshape", log_odds, graph.constant([1, 1, -1], np.int64))
    return flat, boxes.reshape(4, -1)


def main(model, path):
    graph, machine = Graph(), read_machine(model)
    image, size = grey(graph), (WIDTH, HEIGHT)
    all_odds, all_boxes = [], []
    for side in SIDES:
        # Halved where that is enough: a resized image of a quarter would skip pixels.
        while size[0] >= 2 * WIDTH * SQUARE / side:
            image = graph.add("AveragePool", image, kernel_shape=[2, 2], strides=[2, 2])
            size = (size[0] // 2, size[1] // 2)
        odds, boxes = one_size(graph, image, size, side, machine)
        all_odds.append(odds)
        all_boxes.append(boxes)
    boxes = np.concatenate(all_boxes, axis=1)[None]
    # The family has as many boxes as cells of its three strides: the most likely ones.
    kept = sum((WIDTH // stride) * (HEIGHT // stride) for stride in (8, 16, 32))
    best, at = graph.add("TopK", graph.add("Concat", *all_odds, axis=2),
                         graph.constant([kept], np.int64), outputs=["best", "at"], axis=2)
    at = graph.add("Reshape", at, graph.constant([-1], np.int64))
    boxes = graph.add("Gather", graph.constant(boxes), at, axis=2)
    graph.add("Concat", boxes, graph.add("Sigmoid", best), axis=1, outputs=["output0"])
    inputs = [helper.make_tensor_value_info("images", TensorProto.FLOAT, [1, 3, HEIGHT, WIDTH])]
    outputs = [helper.make_tensor_value_info("output0", TensorProto.FLOAT, [1, 5, kept])]
    body = helper.make_graph(graph.nodes, "upper-bodies", inputs, outputs, graph.constants)
    file = helper.make_model(body, opset_imports=[helper.make_opsetid("", 17)], ir_version=9)
    onnx.checker.check_model(file, full_check=True)
    onnx.save(file, path)


if __name__ == "__main__":
    main(*sys.argv[1:])
