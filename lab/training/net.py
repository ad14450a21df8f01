"""The network: a small pyramid, places of the joints from anchors (A2J), and what is said of the whole picture.

Input (B, 2, 96, 96): depth about the candidate's middle by 1.2 m (+1 outside), and its mask. Anchors: 12 x 12, 2.6 m wide.
"""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor, nn
from torch.nn import functional

JOINTS = 17
LENGTHS = 9
WIDTH = 2.6  # m, of the picture
ANCHORS = 12  # along an edge


class Block(nn.Module):
    """Convolution, batch norm, ReLU."""

    def __init__(self, inputs: int, outputs: int, size: int, stride: int = 1, pad: int = 0) -> None:
        """Channels in and out, edge of the kernel."""
        super().__init__()
        self.conv = nn.Conv2d(inputs, outputs, size, stride, pad, bias=False)
        self.norm = nn.BatchNorm2d(outputs)

    def forward(self, x: Tensor) -> Tensor:
        """The block of `x`."""
        return functional.relu(self.norm(self.conv(x)))


class Residual(nn.Module):
    """Two 3 x 3 convolutions, added to the input, ReLU."""

    def __init__(self, channels: int) -> None:
        """As many channels in as out."""
        super().__init__()
        self.a = Block(channels, channels, 3, 1, 1)
        self.b = nn.Sequential(nn.Conv2d(channels, channels, 3, 1, 1, bias=False), nn.BatchNorm2d(channels))

    def forward(self, x: Tensor) -> Tensor:
        """The block of `x`."""
        return functional.relu(x + self.b(self.a(x)))


class Stage(nn.Module):
    """A convolution that halves (or quarters) the picture, then residuals."""

    def __init__(self, inputs: int, outputs: int, residuals: int, size: int = 3, stride: int = 2) -> None:
        """Channels in and out, number of residuals."""
        super().__init__()
        self.conv = Block(inputs, outputs, size, stride, 1)
        self.res = nn.ModuleList([Residual(outputs) for _ in range(residuals)])

    def forward(self, x: Tensor) -> Tensor:
        """The stage of `x`."""
        x = self.conv(x)
        for r in self.res:
            x = r(x)
        return x


class Output(NamedTuple):
    """joints (B, 17, 3) m; anchors (B, 17, 2) m; logits; logarithms of Laplace scales (m) and of lengths (m)."""

    joints: Tensor
    anchors: Tensor
    visible: Tensor
    facing: Tensor
    person: Tensor
    scale: Tensor
    length: Tensor
    length_scale: Tensor


class Net(nn.Module):
    """The network of the detector; `small` makes the toy of the tests."""

    def __init__(self, small: bool = False) -> None:
        """Random weights, but for sensible sizes of people and errors."""
        super().__init__()
        w = (8, 16, 24, 32) if small else (32, 96, 160, 192)
        self.widths = w
        self.s2 = Stage(2, w[0], 1, 6, 4)
        self.s3 = Stage(w[0], w[1], 2)
        self.s4 = Stage(w[1], w[2], 1)
        self.s5 = Stage(w[2], w[3], 1)
        self.top5 = Block(w[3], w[2], 1)
        self.top4 = Block(w[2], w[1], 1)
        self.mid = Residual(w[1])
        self.head = nn.Conv2d(w[1], 4 * JOINTS, 1)
        self.hidden = nn.Linear(w[3], 128)
        self.visible = nn.Linear(128, JOINTS)
        self.facing = nn.Linear(128, 1)
        self.person = nn.Linear(128, 1)
        self.scale = nn.Linear(128, JOINTS)
        self.length = nn.Linear(128, LENGTHS)
        self.length_scale = nn.Linear(128, LENGTHS)
        at = (torch.arange(ANCHORS).float() + 0.5) * (WIDTH / ANCHORS) - WIDTH / 2
        self.register_buffer("at_x", at.repeat(ANCHORS), persistent=False)
        self.register_buffer("at_y", at.repeat_interleave(ANCHORS), persistent=False)
        nn.init.constant_(self.scale.bias, -2.5)
        nn.init.constant_(self.length_scale.bias, -2.5)
        with torch.no_grad():
            typical = torch.tensor([0.27, 0.25, 0.42, 0.41, 0.36, 0.21, 0.58, 0.16, 1.7])
            self.length.bias.copy_(typical.log())

    def forward(self, x: Tensor) -> Output:
        """Everything that is said of pictures (B, 2, 96, 96)."""
        c3 = self.s3(self.s2(x))
        c4 = self.s4(c3)
        c5 = self.s5(c4)
        f = c4 + functional.interpolate(self.top5(c5), scale_factor=2.0)
        f = c3 + functional.interpolate(self.top4(f), scale_factor=2.0)
        maps = self.head(self.mid(f)).float().flatten(2).unflatten(1, (JOINTS, 4))
        weight = maps[:, :, 0].softmax(-1)
        ax, ay = (weight * self.at_x).sum(-1), (weight * self.at_y).sum(-1)
        offset = (weight[:, :, None] * maps[:, :, 1:]).sum(-1)
        joints = torch.stack([ax + offset[..., 0], ay + offset[..., 1], offset[..., 2]], -1)
        h = functional.relu(self.hidden(c5.float().mean((2, 3))))
        return Output(
            joints, torch.stack([ax, ay], -1), self.visible(h).float(), self.facing(h).float()[:, 0],
            self.person(h).float()[:, 0], self.scale(h).float(), self.length(h).float(), self.length_scale(h).float(),
        )  # fmt: skip
