"""Joint angles and orientations of a track move a model of OpenSim to the track's poses."""

import numpy as np
import opensim as osim
import pytest

import voodoo
from test_doors import FRAMES, RIGHT_OF, heads_of, track_of
from test_exports import with_gaps
from voodoo.export.conventions import names_of
from voodoo.export.files import save
from voodoo.export.skeleton import bones


def test_mot_and_sto_move_a_model_of_opensim(tmp_path):
    body = voodoo.Body.human()
    track = track_of(body)
    for name in ("pose.mot", "pose.sto"):
        save(with_gaps(track), tmp_path / name, body=body, root_frame="odom")
    osim.Logger.setLevelString("off")
    model, frames, parts = osim.Model(), {}, bones(body)

    def vector(values):
        return osim.Vec3(*(float(value) for value in values))

    for bone in parts:
        names = names_of(bone.name)
        own = osim.Body(names.opensim, 1.0, osim.Vec3(0), osim.Inertia(1, 1, 1))
        model.addBody(own)
        above, place = model.getGround(), np.zeros(3)
        if bone.parent is not None:
            above, place = frames[parts[bone.parent].name], RIGHT_OF @ (bone.head - parts[bone.parent].head)
        motion = osim.SpatialTransform()
        axes = list(names.angles) + [f"pelvis_t{word}" for word in "zxy" if bone.parent is None]
        for number in range(6):
            axis, along = motion.updTransformAxis(number), [(0, 0, 1), (1, 0, 0), (0, 1, 0)][number % 3]
            if number < len(axes):
                name = axes[number]
                sign = -1 if name.startswith("-") else 1
                sign *= -1 if bone.name.startswith("l_") and number in (1, 2) else 1
                axis.setCoordinateNames(osim.ArrayStr(name.removeprefix("-"), 1))
                axis.set_function(osim.LinearFunction(float(sign), 0.0))
            else:
                axis.set_function(osim.Constant(0.0))
            axis.setAxis(vector(along))
        where = (vector(place), osim.Vec3(0), own, osim.Vec3(0), osim.Vec3(0))
        model.addJoint(osim.CustomJoint(f"{names.opensim}_joint", above, *where, motion))
        frames[bone.name] = own
    state = model.initSystem()
    motion, turns = (
        osim.TimeSeriesTable(str(tmp_path / "pose.mot")),
        osim.TimeSeriesTableQuaternion(str(tmp_path / "pose.sto")),
    )
    assert motion.getNumRows() == turns.getNumRows() == FRAMES  # none for frames without a pose
    times = with_gaps(track).stamps[with_gaps(track).found] - with_gaps(track).stamps[0]
    np.testing.assert_allclose(motion.getIndependentColumn(), times, atol=1e-6)
    expected = heads_of(track, body)
    for frame in (0, 7):
        row = motion.getRowAtIndex(frame).to_numpy()
        for name, value in zip(motion.getColumnLabels(), row, strict=True):
            coordinate = model.getCoordinateSet().get(name)
            coordinate.setValue(state, float(value if "_t" in name[-3:-1] else np.radians(value)), False)
        model.realizePosition(state)
        labels = list(turns.getColumnLabels())
        for limb, own in frames.items():
            place = RIGHT_OF.T @ own.getPositionInGround(state).to_numpy()
            assert np.abs(place - expected[limb][frame]).max() < 1e-3, limb
            turn = own.getTransformInGround(state).R().convertRotationToQuaternion()
            read = turns.getRowAtIndex(frame).getElt(0, labels.index(f"{names_of(limb).opensim}_imu"))
            assert abs(sum(turn.get(i) * read.get(i) for i in range(4))) == pytest.approx(1.0, abs=1e-6), limb
