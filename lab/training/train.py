"""Trains the network: `python -m lab.training.train --data DIR --state DIR`; writes a state to go on from, and figures.

On an accelerator (`--device cuda`) one process trains, and all pictures lie in its memory. On processors several processes
with a thread each share a batch and average their gradients: on a busy machine that is much faster than threads that wait
for each other in every layer.
"""

from __future__ import annotations

import argparse
import copy
import json
import math
import os
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
import torch.distributed as dist
import torch.multiprocessing
from torch import Tensor
from torch.nn import functional

from lab.training.export import read, restored
from lab.training.loader import Batch, Store, augment
from lab.training.net import Net, Output

ARMS = [5, 6, 7, 8, 9, 10]  # elbows, wrists, hands: lost most easily, and matter most
BETA = 0.02  # m; below it the loss is quadratic
EMA = 0.999


@dataclass(frozen=True)
class Plan:
    """How long and how fast: steps or (if > 0) minutes; the learning rate falls as a cosine over them."""

    steps: int = 10_300
    minutes: float = 0.0
    batch: int = 64  # pictures of a step, of all processes together
    processes: int = 1
    rate: float = 1.8e-3
    warm: int = 300
    save_s: float = 240.0

    @property
    def fraction(self) -> tuple[int, int]:
        """Pictures with and without a person in the batch of one process."""
        each = self.batch // self.processes
        return each - each // 5, each // 5


def loss_of(out: Output, batch: Batch) -> tuple[Tensor, dict[str, Tensor]]:
    """The loss of a batch, and its parts for the log."""
    person = batch["person"].float()
    people = person > 0.5
    weight = batch["weight"].clone()
    weight[:, ARMS] *= 1.5
    weight = weight / weight.sum().clamp(min=1)
    target = batch["joints"]
    joints = (weight[..., None] * functional.smooth_l1_loss(out.joints, target, beta=BETA, reduction="none")).sum() / 3
    anchors = functional.smooth_l1_loss(out.anchors, target[..., :2], beta=BETA, reduction="none")
    anchors = (weight[..., None] * anchors).sum() / 2
    observed = functional.binary_cross_entropy_with_logits(out.visible[people], batch["observed"][people].float())
    sure = person * (batch["facing"].abs() / 0.3).clamp(max=1)
    facing = functional.binary_cross_entropy_with_logits(out.facing, (batch["facing"] > 0).float(), reduction="none")
    facing = (facing * sure).sum() / sure.sum().clamp(min=1)
    who = functional.binary_cross_entropy_with_logits(out.person, person)
    error = (out.joints.detach() - target).abs().mean(-1)
    use = (batch["weight"] > 0).float()
    scale = out.scale.clamp(-6, 1)
    spread = ((scale + error / scale.exp()) * use).sum() / use.sum().clamp(min=1)
    off = (out.length - batch["lengths"].log()).abs()
    narrow = out.length_scale.clamp(-6, 1)
    sizes = off[people].mean()
    size_spread = (narrow + off.detach() / narrow.exp())[people].mean()
    total = joints + 0.2 * anchors + 0.02 * observed + 0.03 * (facing + who)
    total = total + 0.01 * spread + 0.1 * sizes + 0.005 * size_spread
    with torch.no_grad():
        e = (out.joints - target).norm(dim=-1)
        whole = batch["weight"] > 0.9
        parts = {"loss": total, "cm": 100 * e[whole].mean(), "facing": facing}
        parts |= {"person": who, "size": sizes, "spread": spread}
    return total, {k: v.detach() for k, v in parts.items()}


@torch.no_grad()
def check(net: Net, store: Store, most: int = 1000) -> dict[str, float]:
    """Figures of the held-out pictures: mean and median error of seen joints (cm), sides, facing, person, sizes."""
    net.eval()
    which = torch.cat([store.people, store.others])
    which = which[:: max(1, len(which) // most)]
    rows: dict[str, list[Tensor]] = {k: [] for k in ("error", "facing", "person", "size")}
    for i in range(0, len(which), 100):
        b = store.batch(which[i : i + 100])
        out = net(b["x"].contiguous(memory_format=torch.channels_last))
        people = b["person"]
        rows["error"].append((out.joints - b["joints"]).norm(dim=-1)[b["weight"] > 0.9])
        sure = people & (b["facing"].abs() > 0.3)
        rows["facing"].append(((out.facing > 0) == (b["facing"] > 0))[sure].float())
        rows["person"].append(((out.person > 0) == people).float())
        rows["size"].append((out.length - b["lengths"].log()).abs()[people])
    net.train()
    all_ = {k: torch.cat(v) for k, v in rows.items()}
    error = all_["error"]
    return {
        "cm": float(100 * error.mean()), "median_cm": float(100 * error.median()),
        "within_10_cm": float((error < 0.1).float().mean()), "facing": float(all_["facing"].mean()),
        "person": float(all_["person"].mean()), "size_percent": float(100 * all_["size"].mean()),
    }  # fmt: skip


@dataclass
class Training:
    """The state of a training: the network, its mean over steps, and the optimizer."""

    net: Net
    mean: Net
    optimizer: torch.optim.Optimizer
    step: int = 0
    views: int = 0

    @classmethod
    def new(
        cls, seed: int, rate: float, *, small: bool = False, device: str = "cpu", weights: Path | None = None
    ) -> Training:
        """A network that knows nothing, or that begins with a file's weights, whose folded norms stay as they are."""
        torch.manual_seed(seed)
        net = (Net(small) if weights is None else restored(read(weights))).to(device, memory_format=torch.channels_last)
        plain = [p for p in net.parameters() if p.ndim <= 1]
        groups = [{"params": [p for p in net.parameters() if p.ndim > 1], "weight_decay": 0.02}]
        optimizer = torch.optim.AdamW([*groups, {"params": plain, "weight_decay": 0.0}], lr=rate)
        return cls(net, copy.deepcopy(net).requires_grad_(False), optimizer)

    def save(self, path: Path) -> None:
        """Everything that is needed to go on."""
        part = path.with_suffix(".part")
        keep = {"net": self.net.state_dict(), "mean": self.mean.state_dict(), "optimizer": self.optimizer.state_dict()}
        torch.save({**keep, "step": self.step, "views": self.views}, part)
        part.rename(path)

    def load(self, path: Path) -> None:
        """Go on from a state."""
        kept = torch.load(path, weights_only=True, map_location="cpu")
        for name in ("net", "mean", "optimizer"):
            getattr(self, name).load_state_dict(kept[name])
        self.step, self.views = kept["step"], kept["views"]

    def update(self, batch: Batch, rate: float, done: float = 0.0) -> tuple[dict[str, Tensor], float]:
        """One step; parts of the loss, and `done` of the first process."""
        for group in self.optimizer.param_groups:
            group["lr"] = rate
        x = batch["x"].contiguous(memory_format=torch.channels_last)
        with torch.autocast(x.device.type, torch.bfloat16):
            out = self.net(x)
        loss, parts = loss_of(out, batch)
        self.optimizer.zero_grad(set_to_none=True)
        loss.backward()
        shared = 1
        if dist.is_initialized():
            shared, done = self._share(done)
        torch.nn.utils.clip_grad_norm_(self.net.parameters(), 1.0)
        self.optimizer.step()
        self.step, self.views = self.step + 1, self.views + len(x) * shared
        keep = min(EMA, (1 + self.step) / (10 + self.step))
        with torch.no_grad():
            torch._foreach_lerp_(list(self.mean.parameters()), list(self.net.parameters()), 1 - keep)
            for a, b in zip(self.mean.buffers(), self.net.buffers(), strict=True):
                a.copy_(b if not a.is_floating_point() else a.lerp(b, 1 - keep))
        return parts, done

    def _share(self, done: float) -> tuple[int, float]:
        """Average the gradients over the processes; how many there are, and `done` of the first."""
        grads = [p.grad for p in self.net.parameters() if p.grad is not None]
        flat = torch.cat([*(g.flatten() for g in grads), torch.tensor([done if dist.get_rank() == 0 else 0.0])])
        dist.all_reduce(flat)
        count, at = dist.get_world_size(), 0
        for g in grads:
            g.copy_((flat[at : at + g.numel()] / count).view_as(g))
            at += g.numel()
        return count, float(flat[-1])


def run(training: Training, data: Store, held: Store | None, plan: Plan, state: Path, seed: int, rank: int = 0) -> None:
    """Train by a plan; states and figures go to the folder `state`."""
    rng = np.random.default_rng([seed, training.step, rank])
    torch.manual_seed(int(rng.integers(2**31)))
    start = saved = checked = time.monotonic()
    first, log, done = training.step, [], 0.0
    while done < 1:
        rate = plan.rate * (0.5 + 0.5 * math.cos(math.pi * done)) + 1e-6
        rate *= min(1.0, (training.step - first + 1) / plan.warm)
        batch = augment(data.draw(rng, *plan.fraction))
        now = time.monotonic()
        reached = (now - start) / (60 * plan.minutes) if plan.minutes else (training.step + 1 - first) / plan.steps
        parts, done = training.update(batch, rate, reached)
        done = done if plan.processes > 1 else reached
        log.append(parts)
        if len(log) == 100:
            if rank == 0:
                mean = {k: round(float(sum(p[k] for p in log)) / len(log), 4) for k in log[0]}
                speed = 100 * plan.batch / (time.monotonic() - checked)
                print(f"step {training.step} {100 * done:.1f} % rate {rate:.1e} {speed:.0f} views/s {mean}", flush=True)
            log, checked = [], time.monotonic()
        if now - saved > plan.save_s:
            saved = now
            if rank == 0:
                _keep(training, held, state, done)
            data.refresh()
    if rank == 0:
        _keep(training, held, state, 1.0)


def _keep(training: Training, held: Store | None, state: Path, done: float) -> None:
    training.save(state / "state.pt")
    figures = {"step": training.step, "views": training.views, "done": round(done, 4)}
    if held is not None:
        figures |= {k: round(v, 4) for k, v in check(training.mean, held).items()}
    with (state / "figures.jsonl").open("a") as f:
        f.write(json.dumps(figures) + "\n")
    print("held out", figures, flush=True)


def work(rank: int, place: Path, state: Path, plan: Plan, seed: int, device: str, weights: Path | None = None) -> None:
    """One process of a training."""
    torch.set_num_threads(1)
    torch.backends.cudnn.benchmark = True  # pictures and batches are of one size
    os.nice(5)
    if plan.processes > 1:
        meet = f"file://{state.resolve()}/meeting"
        dist.init_process_group("gloo", init_method=meet, rank=rank, world_size=plan.processes)
    training = Training.new(seed, plan.rate, device=device, weights=weights)
    if (state / "state.pt").exists():
        training.load(state / "state.pt")
    held = Store(place, "held", device) if rank == 0 else None
    run(training, Store(place, "train", device), held, plan, state, seed, rank)


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--data", type=Path, required=True)
    parser.add_argument("--state", type=Path, required=True, help="folder; a training that lies there goes on")
    parser.add_argument("--steps", type=int, default=Plan.steps)
    parser.add_argument("--weights", type=Path, help="begin with these, at a smaller rate; also when going on")
    parser.add_argument("--minutes", type=float, default=0.0, help="instead of steps")
    parser.add_argument("--batch", type=int, default=Plan.batch, help="pictures of a step")
    parser.add_argument("--rate", type=float, default=Plan.rate)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--device", default="cpu", help="cpu, or cuda for an accelerator")
    parser.add_argument("--processes", type=int, help="one on an accelerator, else one a core")
    a = parser.parse_args()
    a.state.mkdir(parents=True, exist_ok=True)
    (a.state / "meeting").unlink(missing_ok=True)
    processes = a.processes or (os.cpu_count() or 1 if a.device == "cpu" else 1)
    plan = Plan(a.steps, a.minutes, a.batch, processes, a.rate)
    torch.multiprocessing.spawn(work, (a.data, a.state, plan, a.seed, a.device, a.weights), nprocs=processes)


if __name__ == "__main__":
    main()
