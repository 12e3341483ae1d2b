"""Writes a network with the shape of YOLOv8n and random weights, to measure its time.

    pip install onnx numpy
    python random_yolov8n.py 320 random-320.onnx

Layers and channels are those of YOLOv8n (backbone, feature pyramid, three heads, 80 classes), but for
the decoding of the boxes, of which one layer is left. It finds nothing: its scores are near zero.
"""

import sys

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper


class Network:
    """Operators and random weights."""

    def __init__(self):
        self.nodes, self.weights, self.random = [], [], np.random.default_rng(1)

    def add(self, kind, *inputs, outputs=1, **attributes):
        names = [f"v{len(self.nodes)}_{k}" for k in range(outputs)]
        self.nodes.append(helper.make_node(kind, inputs, names, names[0], **attributes))
        return names[0] if outputs == 1 else names

    def constant(self, value):
        name = f"c{len(self.weights)}"
        self.weights.append(numpy_helper.from_array(value, name))
        return name

    def plain(self, x, of, to, size=1, stride=1, bias=0.0):
        scale = np.sqrt(2 / (of * size * size))
        weight = self.random.standard_normal((to, of, size, size), np.float32) * np.float32(scale)
        kernel = [self.constant(weight), self.constant(np.full(to, bias, np.float32))]
        return self.add("Conv", x, *kernel, kernel_shape=[size] * 2, strides=[stride] * 2,
                        pads=[size // 2] * 4)

    def conv(self, x, of, to, size=1, stride=1):
        y = self.plain(x, of, to, size, stride)
        return self.add("Mul", y, self.add("Sigmoid", y))

    def c2f(self, x, of, to, count, shortcut):
        half = to // 2
        parts = self.add("Split", self.conv(x, of, to), outputs=2, axis=1)
        for _ in range(count):
            y = self.conv(self.conv(parts[-1], half, half, 3), half, half, 3)
            parts = parts + [self.add("Add", parts[-1], y) if shortcut else y]
        return self.conv(self.add("Concat", *parts, axis=1), half * (2 + count), to)

    def pooled(self, x, channels):
        parts = [self.conv(x, channels, channels // 2)]
        for _ in range(3):
            parts.append(self.add("MaxPool", parts[-1], kernel_shape=[5, 5], strides=[1, 1],
                                  pads=[2] * 4))
        return self.conv(self.add("Concat", *parts, axis=1), 2 * channels, channels)

    def doubled(self, x):
        scales = self.constant(np.array([1, 1, 2, 2], np.float32))
        return self.add("Resize", x, "", scales, mode="nearest", nearest_mode="floor",
                        coordinate_transformation_mode="asymmetric")

    def head(self, x, channels, cells):
        box = self.conv(self.conv(x, channels, 64, 3), 64, 64, 3)
        scores = self.conv(self.conv(x, channels, 80, 3), 80, 80, 3)
        parts = [self.plain(self.plain(box, 64, 64), 64, 4),
                 self.add("Sigmoid", self.plain(scores, 80, 80, bias=-9.0))]
        shape = self.constant(np.array([1, 84, cells], np.int64))
        return self.add("Reshape", self.add("Concat", *parts, axis=1), shape)


def build(side):
    net = Network()
    x = net.conv("images", 3, 16, 3, 2)
    x = net.c2f(net.conv(x, 16, 32, 3, 2), 32, 32, 1, True)
    p3 = net.c2f(net.conv(x, 32, 64, 3, 2), 64, 64, 2, True)
    p4 = net.c2f(net.conv(p3, 64, 128, 3, 2), 128, 128, 2, True)
    x = net.c2f(net.conv(p4, 128, 256, 3, 2), 256, 256, 1, True)
    p5 = net.pooled(x, 256)
    n4 = net.c2f(net.add("Concat", net.doubled(p5), p4, axis=1), 384, 128, 1, False)
    n3 = net.c2f(net.add("Concat", net.doubled(n4), p3, axis=1), 192, 64, 1, False)
    down = net.conv(n3, 64, 64, 3, 2)
    n4 = net.c2f(net.add("Concat", down, n4, axis=1), 192, 128, 1, False)
    down = net.conv(n4, 128, 128, 3, 2)
    n5 = net.c2f(net.add("Concat", down, p5, axis=1), 384, 256, 1, False)
    heads = [net.head(x, channels, (side // stride) ** 2)
             for x, channels, stride in [(n3, 64, 8), (n4, 128, 16), (n5, 256, 32)]]
    net.nodes.append(helper.make_node("Concat", heads, ["output0"], "output0", axis=2))
    return net


def main(side, path):
    side, net = int(side), build(int(side))
    cells = sum((side // stride) ** 2 for stride in (8, 16, 32))
    inputs = [helper.make_tensor_value_info("images", TensorProto.FLOAT, [1, 3, side, side])]
    outputs = [helper.make_tensor_value_info("output0", TensorProto.FLOAT, [1, 84, cells])]
    graph = helper.make_graph(net.nodes, "random", inputs, outputs, net.weights)
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=9)
    onnx.checker.check_model(model)
    onnx.save(model, path)
    print(f"{sum(np.prod(weight.dims) for weight in net.weights)} numbers in {path}")


if __name__ == "__main__":
    main(*sys.argv[1:])
