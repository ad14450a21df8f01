"""Measures weights on held-out pictures: `python -m lab.training.evaluate WEIGHTS --data DIR [--yardstick OTHER.onnx]`."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from lab.training.anybody import GROUPS
from lab.training.bodies import BONES, JOINTS
from lab.training.crops import lifted
from lab.training.export import read, restored
from lab.training.loader import SWAP, Store

Array = NDArray[np.float64]
THRESHOLDS = (-2.0, -1.0, 0.0, 1.0, 2.0, 3.0, 4.0)  # log odds of a person
LINKS = {
    "upper_arm": ("shoulder", "elbow"),
    "forearm": ("elbow", "wrist"),
    "thigh": ("hip", "knee"),
    "shank": ("knee", "ankle"),
}


def answers(weights: Path, store: Store, which: Tensor) -> dict[str, Array]:
    """All outputs of the network for these pictures."""
    net = restored(read(weights))
    rows: list[Any] = []
    with torch.no_grad():
        for i in range(0, len(which), 64):
            rows.append(net(store.batch(which[i : i + 64])["x"]))
    return {name: torch.cat([getattr(r, name) for r in rows]).numpy().astype(float) for name in rows[0]._fields}


def yardstick(path: Path, store: Store, which: Tensor) -> dict[str, Array]:
    """The same of an ONNX network with outputs p (joints) and vis (17 logits, facing, person)."""
    import onnxruntime

    session = onnxruntime.InferenceSession(str(path))
    parts = [
        session.run(["p", "vis"], {"x": store.batch(which[i : i + 64])["x"].numpy()}) for i in range(0, len(which), 64)
    ]
    joints, overall = (np.concatenate([p[k] for p in parts]).astype(float) for k in (0, 1))
    return {"joints": joints, "visible": overall[:, :17], "facing": overall[:, 17], "person": overall[:, 18]}


def truth(store: Store, which: Tensor) -> dict[str, Array]:
    """The truths of these pictures."""
    keys = ("middle", "person", "joints", "weight", "facing", "lengths", "observed", "group")
    return {k: store.columns[k][which].numpy().astype(float) for k in keys}


def _bones(points: Array) -> dict[str, Array]:
    """Lengths of limbs, the mean of both sides, m; points (N, 17, 3)."""
    at = {n: points[:, i] for i, n in enumerate(JOINTS)}
    gap = lambda a, b: np.linalg.norm(at[a] - at[b], axis=-1)  # noqa: E731
    return {k: 0.5 * (gap(f"l_{a}", f"l_{b}") + gap(f"r_{a}", f"r_{b}")) for k, (a, b) in LINKS.items()}


def measure(reported: dict[str, Array], true: dict[str, Array]) -> dict[str, Any]:
    """Errors of joints (cm), exchanges, sizes, calibration, and how persons are told from other things."""
    people = true["person"] > 0.5
    weight = true["weight"][people]
    use, hidden = weight > 0.9, (weight > 0) & (weight < 0.5)  # 0: the truth is beyond what a picture holds
    want, got = (lifted(x[people], true["middle"][people]) for x in (true["joints"], reported["joints"]))
    error = np.linalg.norm(got - want, axis=-1)
    whole = use.all(1)
    swapped = np.linalg.norm(got[:, SWAP] - want, axis=-1)[:, 3:]
    paired = np.where(use[:, 3:], error[:, 3:], 0).sum(1) > np.where(use[:, 3:], swapped, 0).sum(1) + 0.02
    sure = np.abs(true["facing"][people]) > 0.3
    wrong = (reported["facing"][people] > 0) != (true["facing"][people] > 0)
    out: dict[str, Any] = {
        "people": int(people.sum()), "others": int((~people).sum()), "whole": int(whole.sum()),
        "mean_cm": 100 * error[use].mean(), "median_cm": 100 * np.median(error[use]),
        "within_10_cm": (error[use] < 0.1).mean(), "whole_mean_cm": 100 * error[whole].mean(),
        "whole_median_cm": 100 * np.median(error[whole]),
        "by_joint_cm": {n: 100 * error[:, i][use[:, i]].mean() for i, n in enumerate(JOINTS)},
        "hidden_cm": 100 * error[hidden].mean(),
        "sides_exchanged": paired.mean(), "sides_exchanged_whole": paired[whole].mean(),
        "facing_wrong": wrong[sure].mean(), "facing_wrong_whole": wrong[sure & whole].mean(),
    }  # fmt: skip
    bones = {k: (_bones(got)[k] - v)[whole] for k, v in _bones(want).items()}
    out["bones_from_joints_cm"] = {k: [100 * v.mean(), 100 * np.abs(v).mean()] for k, v in bones.items()}
    if "length" in reported:
        off = np.exp(reported["length"][people]) - true["lengths"][people]
        names = (*BONES, "stature")
        out["lengths_cm"] = {
            n: [100 * off[whole, i].mean(), 100 * np.abs(off[whole, i]).mean()] for i, n in enumerate(names)
        }
        out["lengths_cm_partial"] = {n: 100 * np.abs(off[~whole, i]).mean() for i, n in enumerate(names)}
        log_off = np.abs(reported["length"][people] - np.log(true["lengths"][people]))
        out["length_within_scale"] = _within(log_off, np.exp(reported["length_scale"][people]))
        each = np.abs(reported["joints"][people] - true["joints"][people]).mean(-1)
        out["joint_within_scale"] = _within(each[use], np.exp(reported["scale"][people])[use])
        out["hidden_within_scale"] = _within(each[hidden], np.exp(reported["scale"][people])[hidden])
    score = reported["person"]
    out["person"] = {f"{t:+.0f}": [(score[people] > t).mean(), (score[people][whole] > t).mean(), (score[~people] > t).mean()]
                     for t in THRESHOLDS}  # fmt: skip
    return out


def by_group(reported: dict[str, Array], true: dict[str, Array]) -> dict[str, dict[str, float]]:
    """Of each group: people found at log odds of 0 and 2, joints (cm), sides, stature (cm, %), what is taken for one."""
    out = {}
    for k in np.unique(true["group"]).astype(int):
        of = true["group"] == k
        mine = measure({n: v[of] for n, v in reported.items()}, {n: v[of] for n, v in true.items()})
        people = of & (true["person"] > 0.5)
        stature = true["lengths"][people, -1]
        off = np.abs(np.exp(reported["length"][people, -1]) - stature)
        out[GROUPS[k]] = {
            "people": mine["people"], "others": mine["others"], "found": mine["person"]["+0"][0],
            "found_2": mine["person"]["+2"][0], "mean_cm": mine["mean_cm"], "median_cm": mine["median_cm"],
            "hidden_cm": mine["hidden_cm"], "sides_exchanged": mine["sides_exchanged"],
            "facing_wrong": mine["facing_wrong"], "stature_cm": 100 * off.mean(),
            "stature_percent": 100 * (off / stature).mean(), "false": mine["person"]["+0"][2],
            "false_2": mine["person"]["+2"][2],
        }  # fmt: skip
    return out


def _within(error: Array, scale: Array) -> dict[str, float]:
    """Shares of errors within 1, 2 and 3 scales (of a Laplace distribution: 0.63, 0.86, 0.95), and their mean by the scale."""
    return {str(k): (error < k * scale).mean() for k in (1, 2, 3)} | {"mean": (error / scale).mean()}


def _rounded(value: Any) -> Any:  # noqa: ANN401
    if isinstance(value, dict):
        return {k: _rounded(v) for k, v in value.items()}
    return [_rounded(v) for v in value] if isinstance(value, list) else round(float(value), 4)


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("weights", type=Path)
    parser.add_argument("--data", type=Path, required=True, help="folder with held-out pictures")
    parser.add_argument("--yardstick", type=Path, help="another network, ONNX, for comparison")
    parser.add_argument("--out", type=Path, help="write the figures there, too (JSON)")
    a = parser.parse_args()
    store = Store(a.data, "held")
    which = torch.cat([store.people, store.others])
    true = truth(store, which)
    reported = answers(a.weights, store, which)
    figures = {"weights": _rounded(measure(reported, true)), "groups": _rounded(by_group(reported, true))}
    if a.yardstick:
        figures["yardstick"] = _rounded(measure(yardstick(a.yardstick, store, which), true))
    text = json.dumps(figures, indent=1)
    print(text)
    if a.out:
        a.out.write_text(text + "\n")


if __name__ == "__main__":
    main()
