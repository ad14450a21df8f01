"""Pictures from files to batches: loaded as they appear, changed at random on the way to the network.

The pictures lie where the network is: in the memory of the machine or of its accelerator (18 kB each).
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional

from lab.training.net import WIDTH

DEPTH = 1.2  # m, the picture's unit of depth
SWAP = [0, 1, 2] + [i + 1 if i % 2 else i - 1 for i in range(3, 17)]  # left and right joints exchanged
KEYS = ("middle", "person", "joints", "weight", "observed", "facing", "lengths", "up_known", "fraction", "cover",
        "group")  # fmt: skip
Batch = dict[str, Tensor]


class Store:
    """All pictures of the files `PREFIX_*.npz` of a folder, one tensor a column; `people`, `others`: which show one."""

    def __init__(self, folder: Path, prefix: str, device: str = "cpu") -> None:
        """Load what is there."""
        self.folder, self.prefix, self.device = folder, prefix, device
        self.known: set[Path] = set()
        self.columns: Batch = {}
        self.people = self.others = torch.zeros(0, dtype=torch.long)
        self.refresh()

    def refresh(self) -> None:
        """Take in files that are new."""
        new = [p for p in sorted(self.folder.glob(f"{self.prefix}_*.npz")) if p not in self.known]
        new = [p for p in new if not p.name.endswith(".part.npz")]
        if not new:
            return
        parts: dict[str, list[Tensor]] = {name: [] for name in ("depth", "mask", *KEYS)}
        for path in new:
            with np.load(path) as data:
                for name, column in parts.items():
                    column.append(torch.from_numpy(data[name]).to(self.device))
        for name, column in parts.items():
            self.columns[name] = torch.cat([self.columns[name], *column] if name in self.columns else column)
            column.clear()
        self.known |= set(new)
        shows = self.columns["person"].bool().cpu()
        self.people, self.others = shows.nonzero()[:, 0], (~shows).nonzero()[:, 0]

    def draw(self, rng: np.random.Generator, people: int, others: int) -> Batch:
        """A batch of random pictures with and without a person."""
        which = [self.people[torch.from_numpy(rng.integers(len(self.people), size=people))]]
        if len(self.others):
            which.append(self.others[torch.from_numpy(rng.integers(len(self.others), size=others))])
        return self.batch(torch.cat(which))

    def batch(self, which: Tensor) -> Batch:
        """The pictures of these numbers; `x` (B, 2, 96, 96)."""
        at = which.to(self.device)
        out = {k: self.columns[k][at] for k in KEYS}
        bits = torch.arange(7, -1, -1, device=self.device, dtype=torch.uint8)
        mask = (self.columns["mask"][at][..., None] >> bits & 1).flatten(-2)
        out["x"] = torch.stack([self.columns["depth"][at].float(), mask.float()], 1)
        return out


def augment(batch: Batch) -> Batch:
    """Mirrored, moved, turned and scaled pictures with more noise, lost pieces and strange ones."""
    n, device = len(batch["x"]), batch["x"].device
    out = dict(batch)
    normal = torch.randn(n, 5, device=device)
    size = 1 + 0.04 * normal[:, 0].clamp(-2, 2)
    closer = 0.03 * normal[:, 1]
    zoom = size * (batch["middle"][:, 2] + closer) / batch["middle"][:, 2]
    angle = normal[:, 2] * torch.where(batch["up_known"], 0.05, 0.12)
    shift = 0.05 * normal[:, 3:]
    mirrored = torch.rand(n, device=device) < 0.5
    flip = torch.where(mirrored, -1.0, 1.0)
    c, s = angle.cos(), angle.sin()
    turn = torch.stack([torch.stack([c * flip, -s], -1), torch.stack([s * flip, c], -1)], -2) * zoom[:, None, None]
    xy = torch.einsum("nij,nkj->nki", turn, batch["joints"][..., :2]) - shift[:, None]
    z = batch["joints"][..., 2] * size[:, None] - closer[:, None]
    joints = torch.cat([xy, z[..., None]], -1)
    for key, value in (("joints", joints), ("weight", batch["weight"]), ("observed", batch["observed"])):
        across = mirrored.view(-1, *[1] * (value.ndim - 1))
        out[key] = torch.where(across, value[:, SWAP], value)
    out["lengths"] = batch["lengths"] * size[:, None]
    # the inverse of a turn, a mirror and a zoom is its transpose by the square of the zoom
    back = turn.transpose(1, 2) / (zoom * zoom)[:, None, None]
    theta = torch.cat([back, (back @ (shift / (WIDTH / 2))[..., None])], -1)
    grid = functional.affine_grid(theta, [n, 2, 96, 96], align_corners=False)
    x = batch["x"].clone()
    x[:, 0] -= 1
    x = functional.grid_sample(x, grid, mode="nearest", align_corners=False)
    mask = x[:, 1]
    depth = (x[:, 0] + 1) * size[:, None, None] - (closer / DEPTH)[:, None, None]
    noise = _uniform((n, 1, 1), -0.012, 0.012, device).clamp(min=0) / DEPTH
    depth = depth + torch.randn(n, 96, 96, device=device) * noise
    depth, mask = _spoil(depth, mask)
    depth = torch.where(mask > 0.5, depth.clamp(-1, 1), 1.0)
    out["x"] = torch.stack([depth, mask], 1)
    return out


def _uniform(shape: tuple[int, ...], low: float, high: float, device: torch.device) -> Tensor:
    return torch.rand(shape, device=device) * (high - low) + low


def _spoil(depth: Tensor, mask: Tensor) -> tuple[Tensor, Tensor]:
    """Rectangles lost or added, and pixels lost."""
    n, device = len(depth), depth.device
    at = torch.arange(96, device=device).float()
    for chance, adds in ((0.3, False), (0.1, False), (0.12, True)):
        middle, half = _uniform((n, 2, 1), 15, 81, device), _uniform((n, 2, 1), 1.5, 9, device)
        near = (at - middle).abs() < half
        inside = near[:, 0, :, None] & near[:, 1, None, :] & (torch.rand(n, 1, 1, device=device) < chance)
        if adds:
            slope = 0.004 * torch.randn(n, 2, device=device)
            level = _uniform((n, 1, 1), -0.4, 0.4, device)
            plane = level + slope[:, 0, None, None] * at[:, None] + slope[:, 1, None, None] * at
            depth = torch.where(inside & (mask < 0.5), plane, depth)
            mask = torch.where(inside, 1.0, mask)
        else:
            mask = torch.where(inside, 0.0, mask)
    lost = torch.rand(n, 96, 96, device=device) < _uniform((n, 1, 1), -0.2, 0.1, device).clamp(min=0)
    return depth, torch.where(lost, 0.0, mask)
