"""Networks with the interfaces of YOLOX and RTMPose as ONNX files, which find colored dots instead of people."""

from itertools import product

import numpy as np

GRAY = 128
CODES = [code if any(code) else (70, 0, 70) for code in product((0, 128, 255), repeat=3) if code != (GRAY,) * 3]
"""Colors of 26 keypoints; black is around the image."""
PERSON = (255, 64, 128)
"""Color of a mark in the middle of a person."""
MEAN, STD = np.array([123.675, 116.28, 103.53]), np.array([58.395, 57.12, 57.375])
"""Of rtmlib's RTMPose."""
BOX = (6.0, 8.0)
"""Size of a person in cells of STRIDE pixels."""
STRIDE = 32


def dot(image, place, color, radius):
    """Paint a dot whose middle has the color and whose rim is gray."""
    rows, columns = np.indices(image.shape[:2])
    near = np.clip(1.0 - np.hypot(columns - place[0], rows - place[1]) / radius, 0.0, 1.0)[..., None]
    image[:] = np.where(near > 0.0, GRAY + near * (np.array(color) - GRAY), image).round()


def _likeness(colors, sharp):
    """Nodes: the likeness (1, K, H, W) of every pixel of "image" to colors (K, 3)."""
    from onnx import helper, numpy_helper

    values = {
        "codes": np.asarray(colors, dtype=np.float32)[None, :, :, None, None],
        "one": np.array([1]),
        "two": np.array([2]),
        "sharp": np.array(-sharp, dtype=np.float32),
    }
    nodes = [
        helper.make_node("Unsqueeze", ["image", "one"], ["wide"]),
        helper.make_node("Sub", ["wide", "codes"], ["away"]),
        helper.make_node("Mul", ["away", "away"], ["squared"]),
        helper.make_node("ReduceSum", ["squared", "two"], ["far"], keepdims=0),
        helper.make_node("Mul", ["far", "sharp"], ["scaled"]),
        helper.make_node("Exp", ["scaled"], ["like"]),
    ]
    return nodes, [numpy_helper.from_array(value, name) for name, value in values.items()]


def _save(path, size, made, added, outputs):
    import onnx
    from onnx import TensorProto, helper, numpy_helper

    nodes, values = made
    graph = helper.make_graph(
        nodes + added["nodes"],
        "dots",
        [helper.make_tensor_value_info("image", TensorProto.FLOAT, [1, 3, *size])],
        [helper.make_tensor_value_info(name, TensorProto.FLOAT, shape) for name, shape in outputs.items()],
        values + [numpy_helper.from_array(value, name) for name, value in added["values"].items()],
    )
    onnx.save(helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8), path)


def write_pose(path, *, size=(384, 288)):
    """RTMPose: "simcc_x" (1, 26, 2 W) and "simcc_y" (1, 26, 2 H) of a crop of H x W pixels."""
    from onnx import helper

    height, width = size
    nodes = [
        helper.make_node("ReduceMax", ["like"], ["columns"], axes=[2], keepdims=0),
        helper.make_node("ReduceMax", ["like"], ["rows"], axes=[3], keepdims=0),
        helper.make_node("Resize", ["columns", "", "scales"], ["simcc_x"], mode="nearest"),
        helper.make_node("Resize", ["rows", "", "scales"], ["simcc_y"], mode="nearest"),
    ]
    added = {"nodes": nodes, "values": {"scales": np.array([1.0, 1.0, 2.0], dtype=np.float32)}}
    outputs = {"simcc_x": [1, 26, 2 * width], "simcc_y": [1, 26, 2 * height]}
    _save(path, size, _likeness((np.array(CODES) - MEAN) / STD, 2.0), added, outputs)


def write_persons(path, *, size=(320, 416), chosen=True):
    """YOLOX: "dets" (1, N, 5) of boxes and scores; `chosen=False`: (1, N, 85) of all cells of three strides, before that."""
    from onnx import helper

    rows, columns = size[0] // STRIDE, size[1] // STRIDE
    count = rows * columns
    pool = helper.make_node("MaxPool", ["like"], ["cells"], kernel_shape=[STRIDE] * 2, strides=[STRIDE] * 2)
    flat = helper.make_node("Reshape", ["cells", "shape"], ["score"])
    values = {"shape": np.array([1, count, 1])}
    if chosen:
        middles = (np.stack(np.meshgrid(np.arange(columns), np.arange(rows)), axis=-1).reshape(-1, 2) + 0.5) * STRIDE
        half = STRIDE * np.array(BOX) / 2.0
        values["boxes"] = np.hstack([middles - half, middles + half])[None].astype(np.float32)
        last, shape = [helper.make_node("Concat", ["boxes", "score"], ["dets"], axis=2)], [1, count, 5]
    else:
        others = count * 16 + count * 4  # of strides 8 and 16
        values["finer"] = np.zeros((1, others, 85), dtype=np.float32)
        values["place"] = np.tile(np.float32([0.5, 0.5, *np.log(BOX)]), (1, count, 1))
        values["classes"] = np.tile(np.eye(1, 80, dtype=np.float32), (1, count, 1))
        last = [
            helper.make_node("Concat", ["place", "score", "classes"], ["coarse"], axis=2),
            helper.make_node("Concat", ["finer", "coarse"], ["dets"], axis=1),
        ]
        shape = [1, others + count, 85]
    _save(path, size, _likeness([PERSON], 1e-3), {"nodes": [pool, flat, *last], "values": values}, {"dets": shape})
