"""Writes the shipped weights: `python -m lab.training.export --state DIR --out person.weights [--check detector_check.bin]`.

The format is described in lab/training/README.md: lines of names and shapes, then the numbers.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn

from lab.training.loader import Store
from lab.training.net import Block, Net, Output, Residual

WEIGHTS_LINE, CHECK_LINE = "voodoo person 1", "voodoo person check 1"
KINDS = {WEIGHTS_LINE: "<f2", CHECK_LINE: "<f4"}  # of the numbers
Named = list[tuple[str, NDArray[np.float32]]]


def _conv(name: str, conv: nn.Conv2d, norm: nn.BatchNorm2d | None) -> Named:
    """A convolution with its norm folded in: weight (out, ky, kx, in) and bias (out)."""
    weight = conv.weight.detach().double()
    bias = torch.zeros(len(weight)).double() if conv.bias is None else conv.bias.detach().double()
    if norm is not None:
        assert norm.running_var is not None and norm.running_mean is not None
        gain = norm.weight.detach().double() / (norm.running_var.double() + norm.eps).sqrt()
        weight = weight * gain[:, None, None, None]
        bias = norm.bias.detach().double() + (bias - norm.running_mean.double()) * gain
    rows = weight.permute(0, 2, 3, 1).contiguous()
    return [(name + ".weight", rows.float().numpy()), (name + ".bias", bias.float().numpy())]


def _residual(name: str, block: Residual) -> Named:
    conv, norm = block.b[0], block.b[1]
    assert isinstance(conv, nn.Conv2d) and isinstance(norm, nn.BatchNorm2d)
    return [*_conv(name + ".a", block.a.conv, block.a.norm), *_conv(name + ".b", conv, norm)]


def tensors(net: Net) -> Named:
    """All tensors in the order in which they are used."""
    out: Named = []
    for name in ("s2", "s3", "s4", "s5"):
        stage = getattr(net, name)
        out += _conv(name + ".conv", stage.conv.conv, stage.conv.norm)
        for i, block in enumerate(stage.res):
            out += _residual(f"{name}.res{i}", block)
    for name in ("top5", "top4"):
        block: Block = getattr(net, name)
        out += _conv(name, block.conv, block.norm)
    out += _residual("mid", net.mid)
    out += _conv("head", net.head, None)
    for name in ("hidden", "visible", "facing", "person", "scale", "length", "length_scale"):
        linear: nn.Linear = getattr(net, name)
        out += [(f"{name}.{k}", getattr(linear, k).detach().float().numpy()) for k in ("weight", "bias")]
    return out


def write(path: Path, named: Named, first: str = WEIGHTS_LINE) -> None:
    """The first line, a line for each tensor, an empty line, then the numbers; the file appears when it is whole."""
    kind = KINDS[first]
    lines = [first, *(" ".join([name, *map(str, t.shape)]) for name, t in named), "", ""]
    part = path.with_name(path.name + ".part")
    part.write_bytes("\n".join(lines).encode() + b"".join(t.astype(kind).tobytes() for _, t in named))
    part.rename(path)


def read(path: Path) -> dict[str, NDArray[np.float32]]:
    """The tensors of a file, as float32."""
    head, _, raw = path.read_bytes().partition(b"\n\n")
    first, *lines = head.decode().split("\n")
    kind, at, out = np.dtype(KINDS[first]), 0, {}
    for line in lines:
        name, *shape = line.split(" ")
        edges = [int(n) for n in shape]
        count = int(np.prod(edges))
        out[name] = np.frombuffer(raw, kind, count, at).astype(np.float32).reshape(edges)
        at += count * kind.itemsize
    return out


def restored(values: dict[str, NDArray[np.float32]]) -> Net:
    """A network that computes with the weights of a file: its norms do nothing."""
    net = Net(small=len(values["s2.conv.bias"]) != 32)

    def fill(name: str, conv: nn.Conv2d, norm: nn.BatchNorm2d | None) -> None:
        conv.weight.data.copy_(torch.from_numpy(values[name + ".weight"]).permute(0, 3, 1, 2))
        bias = torch.from_numpy(values[name + ".bias"])
        if norm is None:
            assert conv.bias is not None
            conv.bias.data.copy_(bias)
            return
        norm.eps = 1e-30  # beside the variance 1 and the mean 0 that a new norm holds; some versions refuse 0
        norm.bias.data.copy_(bias)

    def block(name: str, r: Residual) -> None:
        fill(name + ".a", r.a.conv, r.a.norm)
        fill(name + ".b", r.b[0], r.b[1])  # type: ignore[arg-type]

    for name in ("s2", "s3", "s4", "s5"):
        stage = getattr(net, name)
        fill(name + ".conv", stage.conv.conv, stage.conv.norm)
        for i, r in enumerate(stage.res):
            block(f"{name}.res{i}", r)
    for name in ("top5", "top4"):
        fill(name, getattr(net, name).conv, getattr(net, name).norm)
    block("mid", net.mid)
    fill("head", net.head, None)
    for name in ("hidden", "visible", "facing", "person", "scale", "length", "length_scale"):
        for k in ("weight", "bias"):
            getattr(getattr(net, name), k).data.copy_(torch.from_numpy(values[f"{name}.{k}"]))
    return net.eval()


@torch.no_grad()
def check_vectors(net: Net, store: Store) -> Named:
    """A person and something else, `pictures` (2, 96, 96, 2), and every output of the network for them."""
    x = store.batch(torch.stack([store.people[7], store.others[5]]))["x"]
    out: Output = net(x)
    return [
        ("pictures", x.permute(0, 2, 3, 1).numpy()),
        *((name, getattr(out, name).numpy()) for name in Output._fields),
    ]


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--state", type=Path, required=True)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--begun", type=Path, help="weights that the training began with, for --part")
    parser.add_argument("--part", type=float, default=1.0, help="of the way from them to the trained ones (default 1)")
    parser.add_argument("--odds", type=float, default=0.0, help="added to a person's log odds, to calibrate them")
    parser.add_argument("--check", type=Path, help="also write check vectors")
    parser.add_argument("--data", type=Path, help="held-out pictures, for --check")
    a = parser.parse_args()
    from lab.training.train import Training  # which begins with weights that are read here

    training = Training.new(0, 1e-3)
    training.load(a.state / "state.pt")
    named = tensors(training.mean.eval())
    if a.begun:
        begun = read(a.begun)
        named = [(name, begun[name] + a.part * (value - begun[name])) for name, value in named]
    write(a.out, [(name, value + a.odds if name == "person.bias" else value) for name, value in named])
    if a.check:
        if a.data is None:
            parser.error("--check needs --data: held-out pictures")
        write(a.check, check_vectors(restored(read(a.out)), Store(a.data, "held")), CHECK_LINE)
    print(f"{a.out}: {a.out.stat().st_size / 1e6:.2f} MB")


if __name__ == "__main__":
    main()
