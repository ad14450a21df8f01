"""Fits the body model Anny (parameters of age, height, weight... instead of limbs) to joints that voodoo tracked.

    pip install anny
    python lab/experiments/anny_fit.py ../shared/data/rendered/dev_02_arms_cmu... [--frames 16] [--steps 500]

The rendered people are of the same meshes (MakeHuman's), so the parameters that made them are known. Joints of some frames are
fitted by one body and a pose each: once those of the tracker (depth only), once the true ones. Prints the mean distance of
thirteen joints after the fit, the stature, and the parameters beside the true ones.
"""

import argparse
import json
from pathlib import Path

import anny
import numpy as np
import roma
import torch

from voodoo.export.track import Track
from voodoo.pipeline.run import track
from voodoo.pipeline.start import start_tracker, stature
from voodoo.recordings import open_recording

BONES = {"hip": "upperleg01", "knee": "lowerleg01", "ankle": "foot", "shoulder": "upperarm01", "elbow": "lowerarm01"}
BONES |= {"wrist": "wrist"}
SITES = {f"{side}_{joint}": f"{bone}.{side.upper()}" for joint, bone in BONES.items() for side in "lr"} | {
    "vc7": "neck01"
}
"""Joints of voodoo, and the bones of Anny that begin there."""
TURNING = ["root", "spine05", "spine03", "spine01"]
TURNING += [
    f"{bone}.{side}" for bone in ("upperleg01", "lowerleg01", "clavicle", "upperarm01", "lowerarm01") for side in "LR"
]
STIFF, USUAL = 2e-5, 2e-5
"""Weights of the squared turns [rad] and of parameters' squared distances from MIDDLE, beside squared meters."""
MIDDLE = {"age": 2.0 / 3.0}
"""A young adult; other parameters: 0.5."""


def fit(model: anny.Anny, joints: np.ndarray, steps: int) -> tuple[np.ndarray, float, dict[str, float]]:
    """Distances (F, J) [m], stature [m] and parameters of the body that fits joints (F, J, 3) best."""
    target, count = torch.tensor(joints), len(joints)
    bones = [model.bone_labels.index(bone) for bone in SITES.values()]
    turning = [model.bone_labels.index(bone) for bone in TURNING]
    middle = torch.tensor([MIDDLE.get(label, 0.5) for label in model.phenotype_labels], dtype=torch.float64)
    shape = torch.logit(middle).requires_grad_()
    turns = torch.zeros(count, len(turning), 3, dtype=torch.float64, requires_grad=True)

    def body() -> dict[str, torch.Tensor]:
        values = dict(zip(model.phenotype_labels, torch.sigmoid(shape)[:, None], strict=True))
        return model.get_rest_model(model.get_phenotype_blendshape_coefficients(**values))

    rest = body()["rest_bone_heads"][0, bones].detach()
    roots, shifts = zip(*(roma.rigid_points_registration(rest, one) for one in target), strict=True)
    root = roma.rotmat_to_rotvec(torch.stack(roots)).requires_grad_()
    shift = torch.stack(shifts).requires_grad_()

    def heads() -> torch.Tensor:
        local = torch.eye(4, dtype=torch.float64).repeat(count, model.bone_count, 1, 1)
        local[:, turning, :3, :3] = roma.rotvec_to_rotmat(turns)
        _, poses = model.get_bone_transforms(local, body()["rest_bone_poses"])
        return (roma.rotvec_to_rotmat(root)[:, None] @ poses[:, bones, :3, 3:])[..., 0] + shift[:, None]

    optimizer = torch.optim.Adam([shape, turns, root, shift], lr=0.03)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimizer, steps)
    for _ in range(steps):
        optimizer.zero_grad()
        apart = ((heads() - target) ** 2).sum(-1).mean()
        (apart + STIFF * (turns**2).sum(-1).mean() + USUAL * ((torch.sigmoid(shape) - middle) ** 2).sum()).backward()
        optimizer.step()
        schedule.step()
    with torch.no_grad():
        up = body()["rest_vertices"][0, :, 2]
        away = (heads() - target).norm(dim=-1).numpy()
        return (
            away,
            float(up.max() - up.min()),
            dict(zip(model.phenotype_labels, torch.sigmoid(shape).tolist(), strict=True)),
        )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recordings", type=Path, nargs="+")
    parser.add_argument("--frames", type=int, default=16)
    parser.add_argument("--steps", type=int, default=500)
    arguments = parser.parse_args()
    torch.set_num_threads(1)
    model = anny.Anny().to(dtype=torch.float64)
    for path in arguments.recordings:
        made = json.loads((path / "meta.json").read_text())["body_parameters"]
        recording = open_recording(path / "bag", use=("depth",))
        tracker = start_tracker(recording, use=("depth",))
        found = Track.of([step.estimate for step in track(recording, tracker)])
        rows = np.flatnonzero(found.found)[:: max(1, int(found.found.sum()) // arguments.frames)]
        reference = open_recording(path).reference
        true_rows = [int(np.argmin(np.abs(reference.stamps - stamp))) for stamp in found.stamps[rows]]
        truth = reference.positions[np.ix_(true_rows, [reference.names.index(site) for site in SITES])]
        estimate = found.joints[np.ix_(rows, [found.joint_names.index(site) for site in SITES])]
        off = 1e3 * np.linalg.norm(estimate - truth, axis=2).mean()
        print(f"{path.name}: {made}; tracked joints {off:.1f} mm off, stature {stature(tracker.body)} m")
        for name, joints in (("tracked", estimate), ("true", truth)):
            away, height, values = fit(model, joints, arguments.steps)
            body = ", ".join(f"{label} {value:.2f}" for label, value in values.items())
            print(f"  {name} joints: {1e3 * away.mean():.1f} mm apart, stature {height:.3f} m; {body}", flush=True)


if __name__ == "__main__":
    main()
