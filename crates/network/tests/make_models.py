"""Writes the hand-weighted networks of these tests, and the outputs of onnxruntime beside them.

Each detector finds an upright bright blob of 16 x 32 pixels in an image of 64 x 64, with the inputs
and outputs of one family. The networks for re-identification return the mean colours of eight parts
of an image of 128 x 256.

    pip install onnx onnxruntime numpy
    python make_models.py
"""

import json
from pathlib import Path

import numpy as np
import onnx
import onnxruntime
from onnx import TensorProto, helper, numpy_helper

SIDE = 64
FOLDER = Path(__file__).parent / "models"
IMAGENET = np.array([[123.675, 116.28, 103.53], [58.395, 57.12, 57.375]], np.float32)


class Graph:
    """Operators and constants of a network."""

    def __init__(self):
        self.nodes, self.constants = [], []

    def constant(self, value, kind=np.float32):
        name = f"c{len(self.constants)}"
        self.constants.append(numpy_helper.from_array(np.asarray(value, kind), name))
        return name

    def add(self, kind, *inputs, outputs=None, **attributes):
        outputs = outputs or [f"v{len(self.nodes)}"]
        name = f"{kind}{len(self.nodes)}"
        self.nodes.append(helper.make_node(kind, inputs, outputs, name, **attributes))
        return outputs[0]

    def reshape(self, value, shape, **names):
        return self.add("Reshape", value, self.constant(shape, np.int64), **names)

    def zeros(self, *shape):
        size = self.constant(shape, np.int64)
        return self.add("ConstantOfShape", size)

    def margins(self, mean, deviation):
        """Brightness of each region of 16 x 32 pixels, 0 to 1, minus 0.7, times 20: [1, 1, 4, 4]."""
        weights = np.asarray(deviation, np.float32).reshape(1, 3, 1, 1) / (3 * 255)
        bias = np.sum(np.asarray(mean, np.float32)) / (3 * 255)
        grey = self.add("Conv", "images", self.constant(weights), self.constant([bias]),
                        kernel_shape=[1, 1], strides=[1, 1])
        pool = self.add(
            "AveragePool", grey, kernel_shape=[32, 16], strides=[16, 16], pads=[0, 0, 16, 0],
            count_include_pad=1)
        return self.add("Mul", self.add("Sub", pool, self.constant(0.7)), self.constant(20))

    def scores(self, mean, deviation):
        return self.add("Sigmoid", self.margins(mean, deviation))


# Left, top, right and bottom of the region of each cell, in the order of the cells.
CORNERS = np.array([[16 * x, 16 * y, 16 * x + 16, 16 * y + 32] for y in range(4) for x in range(4)],
                   np.float32)
CENTRES = np.stack([(CORNERS[:, 0] + CORNERS[:, 2]) / 2, (CORNERS[:, 1] + CORNERS[:, 3]) / 2,
                    CORNERS[:, 2] - CORNERS[:, 0], CORNERS[:, 3] - CORNERS[:, 1]], 1)


def yolox(graph):
    scores = graph.reshape(graph.scores([0] * 3, [1] * 3), [1, 16, 1])
    # The middle of the region is half a cell to the right of its corner and a whole one below.
    boxes = np.tile(np.array([0.5, 1, 0, np.log(2), 1], np.float32), (1, 16, 1))
    rows = graph.add("Concat", graph.constant(boxes), scores, graph.zeros(1, 16, 1), axis=2)
    graph.add("Concat", graph.zeros(1, 64, 7), rows, graph.zeros(1, 4, 7), axis=1,
              outputs=["output"])
    return {"output": [1, 84, 7]}


def yolov8(graph):
    scores = graph.reshape(graph.scores([0] * 3, [255] * 3), [1, 1, 16])
    columns = graph.add("Concat", graph.constant(CENTRES.T[None]), scores, graph.zeros(1, 1, 16),
                        axis=1)
    graph.add("Concat", graph.zeros(1, 6, 64), columns, graph.zeros(1, 6, 4), axis=2,
              outputs=["output0"])
    return {"output0": [1, 6, 84]}


def best(graph, scores, boxes):
    """Scores [1, 3] and boxes [1, 3, 4] of the three best regions."""
    flat = graph.reshape(scores, [1, 16])
    values, indices = f"best{len(graph.nodes)}", f"where{len(graph.nodes)}"
    graph.add("TopK", flat, graph.constant([3], np.int64), outputs=[values, indices])
    rows = graph.add("Gather", boxes, graph.reshape(indices, [3]), axis=0)
    return values, graph.reshape(rows, [1, 3, 4])


def yolov10(graph):
    scores, boxes = best(graph, graph.scores([0] * 3, [255] * 3), graph.constant(CORNERS))
    graph.add("Concat", boxes, graph.reshape(scores, [1, 3, 1]), graph.zeros(1, 3, 1), axis=2,
              outputs=["output0"])
    return {"output0": [1, 3, 6]}


def rt_detr(graph):
    size = graph.add("Cast", "orig_target_sizes", to=TensorProto.FLOAT)
    scale = graph.reshape(graph.add("Concat", size, size, axis=1), [1, 4])
    pixels = graph.add("Mul", graph.constant(CORNERS / SIDE), scale)
    scores, boxes = best(graph, graph.scores([0] * 3, [255] * 3), pixels)
    graph.add("Identity", scores, outputs=["scores"])
    graph.add("Identity", boxes, outputs=["boxes"])
    graph.add("Identity", graph.constant([[0, 0, 0]], np.int64), outputs=["labels"])
    return {"scores": [1, 3], "boxes": [1, 3, 4], "labels": [1, 3]}


def rf_detr(graph):
    mean, deviation = IMAGENET
    logits = graph.reshape(graph.margins(mean, deviation), [1, 16, 1])
    low = graph.constant(np.full((1, 16, 1), -9))
    graph.add("Concat", low, logits, low, axis=2, outputs=["labels"])
    graph.add("Identity", graph.constant(CENTRES[None] / SIDE), outputs=["dets"])
    return {"dets": [1, 16, 4], "labels": [1, 16, 3]}


def nanodet(graph):
    mean, deviation = IMAGENET[:, ::-1]
    scores = graph.reshape(graph.scores(mean, deviation), [1, 16, 1])
    sides = np.zeros((1, 16, 4, 8), np.float32)
    for side, strides in enumerate([0, 0, 1, 2]):
        sides[:, :, side, strides] = 20
    rows = graph.add("Concat", scores, graph.zeros(1, 16, 1),
                     graph.constant(sides.reshape(1, 16, 32)), axis=2)
    graph.add("Concat", graph.zeros(1, 64, 34), rows, graph.zeros(1, 5, 34), axis=1,
              outputs=["output"])
    return {"output": [1, 85, 34]}


def nanodet_m(graph):
    """Scores and distributions for each stride; boxes are counted from the middle of a cell."""
    mean, deviation = IMAGENET[:, ::-1]
    sides = np.zeros((1, 64, 4, 8), np.float32)
    # Half a cell to the left, above and to the right, and one and a half below.
    for side, bins in enumerate([(0, 1), (0, 1), (0, 1), (1, 2)]):
        sides[:, :, side, bins] = 20
    sides = sides.reshape(1, 64, 32)
    scores = graph.reshape(graph.scores(mean, deviation), [1, 16, 1])
    graph.add("Concat", scores, graph.zeros(1, 16, 1), axis=2, outputs=["scores_16"])
    shapes = {}
    for stride, cells in ((8, 64), (16, 16), (32, 4)):
        if stride != 16:
            graph.add("Identity", graph.zeros(1, cells, 2), outputs=[f"scores_{stride}"])
        graph.add("Identity", graph.constant(sides[:, :cells]), outputs=[f"sides_{stride}"])
        shapes |= {f"scores_{stride}": [1, cells, 2], f"sides_{stride}": [1, cells, 32]}
    return shapes


def rtmdet(graph):
    mean, deviation = IMAGENET[:, ::-1]
    scores, boxes = best(graph, graph.scores(mean, deviation), graph.constant(CORNERS))
    graph.add("Concat", boxes, graph.reshape(scores, [1, 3, 1]), axis=2, outputs=["dets"])
    graph.add("Identity", graph.constant([[0, 0, 0]], np.int64), outputs=["labels"])
    return {"dets": [1, 3, 5], "labels": [1, 3]}


def movenet(graph):
    numbers = graph.add("Cast", "images", to=TensorProto.FLOAT)
    grey = graph.add("ReduceMean", numbers, axes=[3], keepdims=1)
    bright = graph.add("Relu", graph.add("Sub", grey, graph.constant(128)))
    total = graph.add("ReduceSum", bright, keepdims=1)
    total = graph.add("Add", total, graph.constant(1e-3))
    places = (np.arange(SIDE, dtype=np.float32) + 0.5) / SIDE

    def middle(shape):
        weighted = graph.add("Mul", bright, graph.constant(places.reshape(shape)))
        return graph.add("Div", graph.add("ReduceSum", weighted, keepdims=1), total)

    # From the eyes to the ankles of a person of 32 pixels, and 16 wide.
    down = np.linspace(0.08 / 1.13 - 0.5, 0.5 - 0.05 / 1.13, 17) * 32 / SIDE
    aside = np.where(np.arange(17) % 2 == 0, -0.5, 0.5) * 16 / SIDE
    rows = graph.add("Add", middle((1, SIDE, 1, 1)), graph.constant(down.reshape(1, 1, 17, 1)))
    columns = graph.add("Add", middle((1, 1, SIDE, 1)), graph.constant(aside.reshape(1, 1, 17, 1)))
    amount = graph.add("Div", total, graph.constant(16 * 32 * 100))
    margin = graph.add("Mul", graph.add("Sub", amount, graph.constant(0.7)), graph.constant(10))
    score = graph.add("Sigmoid", margin)
    each = graph.add("Expand", score, graph.constant([1, 1, 17, 1], np.int64))
    graph.add("Concat", rows, columns, each, axis=3, outputs=["output_0"])
    return {"output_0": [1, 1, 17, 3]}


FAMILIES = {
    "yolox": yolox, "yolov8": yolov8, "yolov10": yolov10, "rt-detr": rt_detr, "rf-detr": rf_detr,
    "nanodet": nanodet, "nanodet-m": nanodet_m, "rtmdet": rtmdet, "movenet": movenet,
}


def pixel_rows(graph, scores, objectness=False):
    """Rows of a grid with middles and sizes in pixels, as networks write them: [1, 84, ...]."""
    grids = []
    for stride in (8, 16, 32):
        places = (np.arange(SIDE // stride, dtype=np.float32) + 0.5) * stride
        x, y = [grid.ravel() for grid in np.meshgrid(places, places)]
        grids.append(np.stack([x, y, np.full_like(x, stride), np.full_like(x, stride)], 1))
    # The blob is that of the second grid.
    grids[1] = CENTRES
    boxes = graph.constant(np.concatenate(grids)[None])
    person = graph.add("Concat", graph.zeros(1, 64, 1), graph.reshape(scores, [1, 16, 1]),
                       graph.zeros(1, 4, 1), axis=1)
    parts = [boxes, graph.constant(np.ones((1, 84, 1)))] if objectness else [boxes]
    return parts + [person]


def yolox_decoded(graph):
    """YOLOX with `decode_in_inference`, and the 80 classes of COCO."""
    rows = pixel_rows(graph, graph.scores([0] * 3, [1] * 3), objectness=True)
    graph.add("Concat", *rows, graph.zeros(1, 84, 79), axis=2, outputs=["output"])
    return {"output": [1, 84, 85]}


def yolov8_rows(graph):
    rows = pixel_rows(graph, graph.scores([0] * 3, [255] * 3))
    graph.add("Concat", *rows, axis=2, outputs=["output0"])
    return {"output0": [1, 84, 5]}


def nanodet_m_concat(graph):
    """NanoDet before Plus with its outputs side by side, and 80 classes."""
    nanodet_m(graph)
    rows = []
    for stride, cells in ((8, 64), (16, 16), (32, 4)):
        rows.append(graph.add("Concat", f"scores_{stride}", graph.zeros(1, cells, 78),
                              f"sides_{stride}", axis=2))
    graph.add("Concat", *rows, axis=1, outputs=["output"])
    return {"output": [1, 84, 112]}


def yolov8_fractions(graph):
    boxes, person = pixel_rows(graph, graph.scores([0] * 3, [255] * 3))
    fractions = graph.add("Div", boxes, graph.constant(SIDE))
    graph.add("Concat", fractions, person, axis=2, outputs=["output0"])
    return {"output0": [1, 84, 5]}


def final(graph, columns, boxes=3, batch=True, unit=1):
    """The three best regions as a list of boxes with these columns, and rows of zeros."""
    corners = graph.constant(np.asarray(CORNERS, np.float32) / unit)
    scores, corners = best(graph, graph.scores([0] * 3, [255] * 3), corners)
    parts = {"box": corners, "score": graph.reshape(scores, [1, 3, 1]),
             "label": graph.zeros(1, 3, 1), "image": graph.zeros(1, 3, 1)}
    rows = graph.add("Concat", *[parts[column] for column in columns], axis=2)
    width = len(columns) + 3
    if boxes > 3:
        rows = graph.add("Concat", rows, graph.zeros(1, boxes - 3, width), axis=1)
    shape = [1, boxes, width] if batch else [boxes, width]
    graph.reshape(rows, shape, outputs=["output0"])
    return {"output0": shape}


# Files as tools write them: the family, the network, and what differs in its input.
LAYOUTS = {
    "yolox-decoded": ("yolox", yolox_decoded, {}),
    "yolov8-rows": ("yolov8", yolov8_rows, {}),
    "yolov8-fractions": ("yolov8", yolov8_fractions, {}),
    "yolov8-last": ("yolov8", yolov8, {"last": True}),
    "yolov8-open": ("yolov8", yolov8, {"open": True}),
    "yolov8-half": ("yolov8", yolov8, {"half": True}),
    "nanodet-m-concat": ("nanodet-m", nanodet_m_concat, {}),
    "score-last": ("yolov10", lambda graph: final(graph, ["box", "label", "score"]), {}),
    "fractions": ("yolov10", lambda graph: final(graph, ["box", "score", "label"], unit=SIDE), {}),
    "deepstream": ("yolov10", lambda graph: final(graph, ["box", "score", "label"], 84), {}),
    "no-batch": ("yolov10", lambda graph: final(graph, ["box", "score", "label"], batch=False), {}),
    "yolov7": ("yolov10", lambda graph: final(graph, ["image", "box", "label", "score"],
                                              batch=False), {}),
}


def scene(width=SIDE, height=SIDE):
    """The image of the tests, in red, green and blue: also `scene` in the tests."""
    y, x, c = np.meshgrid(np.arange(height), np.arange(width), np.arange(3), indexing="ij")
    blob = (x >= 32) & (x < 48) & (y >= 16) & (y < 48)
    return np.where(blob, 230 + 10 * c, (x + 2 * y + 7 * c) % 40).astype(np.float32)


def prepared(family):
    image, (mean, deviation) = scene(), IMAGENET
    if family == "movenet":
        return image[None].astype(np.int32)
    if family in ("yolov8", "yolov10", "rt-detr"):
        image = image / 255
    elif family == "rf-detr":
        image = (image - mean) / deviation
    elif family in ("nanodet", "nanodet-m", "rtmdet"):
        image = ((image - mean) / deviation)[:, :, ::-1]
    elif family == "yolox":
        image = image[:, :, ::-1]
    return np.ascontiguousarray(image.transpose(2, 0, 1)[None], np.float32)


def write(family, build):
    graph = Graph()
    shapes = build(graph)
    kinds = {"labels": TensorProto.INT64} if family in ("rt-detr", "rtmdet") else {}
    outputs = [helper.make_tensor_value_info(name, kinds.get(name, TensorProto.FLOAT), shape)
               for name, shape in shapes.items()]
    last = family == "movenet"
    shape = [1, SIDE, SIDE, 3] if last else [1, 3, SIDE, SIDE]
    kind = TensorProto.INT32 if last else TensorProto.FLOAT
    inputs = [helper.make_tensor_value_info("images", kind, shape)]
    feeds = {"images": prepared(family)}
    if family == "rt-detr":
        inputs += [helper.make_tensor_value_info("orig_target_sizes", TensorProto.INT64, [1, 2])]
        feeds["orig_target_sizes"] = np.array([[SIDE, SIDE]], np.int64)
    save(family, graph, inputs, outputs, feeds)


def write_layout(name, family, build, last=False, open=False, half=False):
    """Writes a network of a family in the layout of a tool."""
    graph = Graph()
    image = prepared(family)
    shape = [1, 3, "height", "width"] if open else [1, 3, SIDE, SIDE]
    if last:
        # The image comes with the channels of a pixel side by side.
        shape, image = [1, SIDE, SIDE, 3], np.ascontiguousarray(image.transpose(0, 2, 3, 1))
        graph.add("Transpose", "pixels", perm=[0, 3, 1, 2], outputs=["images"])
    shapes = build(graph)
    name_of_input = "pixels" if last else "images"
    kind = TensorProto.FLOAT16 if half else TensorProto.FLOAT
    if half:
        image = image.astype(np.float16)
        graph.constants = [halved(constant) for constant in graph.constants]
        for node in graph.nodes:
            if node.op_type == "ConstantOfShape":
                zero = helper.make_tensor("zero", TensorProto.FLOAT16, [1], [0])
                node.attribute.append(helper.make_attribute("value", zero))
    inputs = [helper.make_tensor_value_info(name_of_input, kind, shape)]
    outputs = [helper.make_tensor_value_info(output, kind, size) for output, size in shapes.items()]
    save(name, graph, inputs, outputs, {name_of_input: image})


def halved(constant):
    values = numpy_helper.to_array(constant)
    if values.dtype != np.float32:
        return constant
    return numpy_helper.from_array(values.astype(np.float16), constant.name)


def write_own_size():
    """Writes MoveNet with its joints scaled by way of its own size, as tf2onnx writes it: a
    constant is divided by a tensor with one number, whose dimension has to stay."""
    graph = Graph()
    size = graph.add("Cast", graph.add("Shape", "images"), to=TensorProto.FLOAT)
    height = graph.add("Slice", size, graph.constant([1], np.int64), graph.constant([2], np.int64))
    inverse = graph.add("Div", graph.constant(4), height)
    scale = graph.add("Unsqueeze", inverse, graph.constant([1], np.int64))
    movenet(graph)
    graph.nodes[-1].output[0] = "joints"
    rows = graph.add("Div", scale, scale)
    graph.add("Mul", "joints", graph.reshape(rows, [1, 1, 1, 1]), outputs=["output_0"])
    inputs = [helper.make_tensor_value_info("images", TensorProto.INT32, [1, SIDE, SIDE, 3])]
    outputs = [helper.make_tensor_value_info("output_0", TensorProto.FLOAT, [1, 1, 17, 3])]
    save("own-size", graph, inputs, outputs, {"images": prepared("movenet")})


def write_yellow():
    """Writes a network of the family of YOLOv8 that finds yellow, in RGB from 0 to 255: as if it
    were exported with its normalisation left out and another fit."""
    graph = Graph()
    weights = np.array([1, 1, -1], np.float32).reshape(1, 3, 1, 1) / (2 * 255)
    yellow = graph.add("Conv", "images", graph.constant(weights), kernel_shape=[1, 1])
    pool = graph.add("AveragePool", yellow, kernel_shape=[32, 16], strides=[16, 16],
                     pads=[0, 0, 16, 0], count_include_pad=1)
    margin = graph.add("Mul", graph.add("Sub", pool, graph.constant(0.7)), graph.constant(40))
    scores = graph.reshape(graph.add("Sigmoid", margin), [1, 1, 16])
    columns = graph.add("Concat", graph.constant(CENTRES.T[None]), scores, axis=1)
    graph.add("Concat", graph.zeros(1, 5, 64), columns, graph.zeros(1, 5, 4), axis=2,
              outputs=["output0"])
    inputs = [helper.make_tensor_value_info("images", TensorProto.FLOAT, [1, 3, SIDE, SIDE])]
    outputs = [helper.make_tensor_value_info("output0", TensorProto.FLOAT, [1, 5, 84])]
    save("yellow", graph, inputs, outputs)


def save(name, graph, inputs, outputs, feeds=None):
    """Writes a network, and its outputs for an input if there is one."""
    body = helper.make_graph(graph.nodes, name, inputs, outputs, graph.constants)
    model = helper.make_model(body, opset_imports=[helper.make_opsetid("", 17)], ir_version=9)
    onnx.checker.check_model(model)
    (FOLDER / f"{name}.onnx").write_bytes(model.SerializeToString())
    if feeds is None:
        return
    session = onnxruntime.InferenceSession(model.SerializeToString())
    names = [output.name for output in outputs]
    numbers = {output: {"shape": list(result.shape),
                        "values": [float(f"{value:.7g}") for value in result.ravel()]}
               for output, result in zip(names, session.run(names, feeds))}
    (FOLDER / f"{name}.json").write_text(json.dumps(numbers) + "\n")


def colours_of_parts(graph, mean):
    """Mean colours of four rows of two parts: [1, 24]."""
    pool = graph.add("AveragePool", "images", kernel_shape=[64, 64], strides=[64, 64])
    return graph.reshape(graph.add("Sub", pool, graph.constant(mean)), [1, 24])


def osnet(graph):
    graph.add("Identity", colours_of_parts(graph, 0), outputs=["output"])
    return [1, 24], (lambda image: (image - IMAGENET[0]) / IMAGENET[1])


def omz(graph):
    pads = graph.constant([0, 0, 0, 232], np.int64)
    graph.add("Pad", colours_of_parts(graph, 128), pads, outputs=["output"])
    return [1, 256], (lambda image: image[:, :, ::-1])


def write_embedding(name, build):
    """Writes a network for re-identification and its vector of an image."""
    graph = Graph()
    shape, prepare = build(graph)
    image = prepare(scene(128, 256))
    feed = np.ascontiguousarray(image.transpose(2, 0, 1)[None], np.float32)
    inputs = [helper.make_tensor_value_info("images", TensorProto.FLOAT, [1, 3, 256, 128])]
    outputs = [helper.make_tensor_value_info("output", TensorProto.FLOAT, shape)]
    save(name, graph, inputs, outputs, {"images": feed})


if __name__ == "__main__":
    for family, build in FAMILIES.items():
        write(family, build)
    for name, (family, build, input_of) in LAYOUTS.items():
        write_layout(name, family, build, **input_of)
    write_own_size()
    write_embedding("osnet", osnet)
    write_embedding("omz", omz)
    write_yellow()
