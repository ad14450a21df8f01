"""Pictures from files to batches: loaded as they appear, changed at random on the way to the network."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional

from training.net import WIDTH

DEPTH = 1.2  # m, the picture's unit of depth
SWAP = [0, 1, 2] + [i + 1 if i % 2 else i - 1 for i in range(3, 17)]  # left and right joints exchanged
KEYS = ("middle", "person", "joints", "weight", "seen", "facing", "lengths", "up_known", "share", "cover")
Batch = dict[str, Tensor]


class Store:
    """All pictures of the files `PREFIX_*.npz` of a folder."""

    def __init__(self, folder: Path, prefix: str) -> None:
        """Load what is there."""
        self.folder, self.prefix = folder, prefix
        self.known: set[Path] = set()
        self.files: list[dict[str, np.ndarray]] = []
        self.people: list[tuple[int, int]] = []
        self.others: list[tuple[int, int]] = []
        self.refresh()

    def refresh(self) -> None:
        """Take in files that are new."""
        for path in sorted(self.folder.glob(f"{self.prefix}_*.npz")):
            if path in self.known or path.name.endswith(".part.npz"):
                continue
            with np.load(path) as data:
                columns = {name: data[name] for name in ("depth", "mask", *KEYS)}
            self.known.add(path)
            number = len(self.files)
            self.files.append(columns)
            for i, person in enumerate(columns["person"]):
                (self.people if person else self.others).append((number, i))

    def draw(self, rng: np.random.Generator, people: int, others: int) -> Batch:
        """A batch of random pictures with and without a person."""
        a = [self.people[i] for i in rng.integers(len(self.people), size=people)]
        b = [self.others[i] for i in rng.integers(len(self.others), size=others)] if self.others else []
        return self.batch(a + b)

    def batch(self, which: list[tuple[int, int]]) -> Batch:
        """These pictures (file, number) as tensors; `x` (B, 2, 96, 96)."""
        depth = np.stack([self.files[f]["depth"][i] for f, i in which]).astype(np.float32)
        mask = np.unpackbits(np.stack([self.files[f]["mask"][i] for f, i in which]), axis=-1).astype(np.float32)
        out = {k: torch.from_numpy(np.stack([self.files[f][k][i] for f, i in which])) for k in KEYS}
        out["x"] = torch.from_numpy(np.stack([depth, mask], 1))
        return out


def _uniform(shape: int | tuple[int, ...], low: float, high: float) -> Tensor:
    return torch.rand(shape) * (high - low) + low


def augment(batch: Batch) -> Batch:
    """Mirrored, moved, turned and scaled pictures with more noise, lost pieces and strange ones."""
    n = len(batch["x"])
    out = dict(batch)
    size = 1 + 0.04 * torch.randn(n).clamp(-2, 2)
    closer = 0.03 * torch.randn(n)
    zoom = size * (batch["middle"][:, 2] + closer) / batch["middle"][:, 2]
    angle = torch.randn(n) * torch.where(batch["up_known"], 0.05, 0.12)
    shift = 0.05 * torch.randn(n, 2)
    flip = torch.where(torch.rand(n) < 0.5, -1.0, 1.0)
    c, s = angle.cos(), angle.sin()
    turn = torch.stack([torch.stack([c * flip, -s], -1), torch.stack([s * flip, c], -1)], -2) * zoom[:, None, None]
    joints = batch["joints"].clone()
    xy = torch.einsum("nij,nkj->nki", turn, joints[..., :2]) - shift[:, None]
    z = joints[..., 2] * size[:, None] - closer[:, None]
    joints = torch.cat([xy, z[..., None]], -1)
    mirrored = flip < 0
    for key, value in (("joints", joints), ("weight", batch["weight"]), ("seen", batch["seen"])):
        value = value.clone()
        value[mirrored] = value[mirrored][:, SWAP]
        out[key] = value
    out["lengths"] = batch["lengths"] * size[:, None]
    back = torch.linalg.inv(turn)
    theta = torch.cat([back, (back @ (shift / (WIDTH / 2))[..., None])], -1)
    grid = functional.affine_grid(theta, [n, 2, 96, 96], align_corners=False)
    x = batch["x"].clone()
    x[:, 0] -= 1
    x = functional.grid_sample(x, grid, mode="nearest", align_corners=False)
    mask = x[:, 1]
    depth = (x[:, 0] + 1) * size[:, None, None] - (closer / DEPTH)[:, None, None]
    depth = depth + torch.randn(n, 96, 96) * (_uniform(n, -0.012, 0.012).clamp(min=0) / DEPTH)[:, None, None]
    depth, mask = _spoil(depth, mask)
    depth = torch.where(mask > 0.5, depth.clamp(-1, 1), 1.0)
    out["x"] = torch.stack([depth, mask], 1)
    return out


def _spoil(depth: Tensor, mask: Tensor) -> tuple[Tensor, Tensor]:
    """Rectangles lost or added, and pixels lost."""
    n = len(depth)
    at = torch.arange(96).float()
    for chance, adds in ((0.3, False), (0.1, False), (0.12, True)):
        middle, half = _uniform((n, 2), 15, 81), _uniform((n, 2), 1.5, 9)
        inside = ((at - middle[:, :1]).abs() < half[:, :1])[:, :, None] & ((at - middle[:, 1:]).abs() < half[:, 1:])[
            :, None
        ]
        inside &= (torch.rand(n) < chance)[:, None, None]
        if adds:
            slope = 0.004 * torch.randn(n, 2)
            plane = (
                _uniform(n, -0.4, 0.4)[:, None, None]
                + slope[:, 0, None, None] * at[:, None]
                + slope[:, 1, None, None] * at
            )
            depth = torch.where(inside & (mask < 0.5), plane, depth)
            mask = torch.where(inside, 1.0, mask)
        else:
            mask = torch.where(inside, 0.0, mask)
    lost = torch.rand(n, 96, 96) < (_uniform(n, -0.2, 0.1).clamp(min=0))[:, None, None]
    return depth, torch.where(lost, 0.0, mask)
