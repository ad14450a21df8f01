"""UTD-MHAD sequences: made-up ones always, real ones where they are."""

import numpy as np
import pytest
import scipy.io

from voodoo.errors import RecordingError
from voodoo.recordings import open_recording


@pytest.fixture
def sequence(tmp_path):
    """Three frames; the right hand (row 11 of the skeleton) is on the mirrored image's right."""
    for folder in ("Depth", "Skeleton"):
        (tmp_path / folder).mkdir()
    depth = np.zeros((240, 320, 3), np.uint16)
    skeleton = np.zeros((20, 3, 3))
    for k in range(3):
        depth[100, 250, k] = 2000 + k
        skeleton[:, :, k] = [0.1, 0.2, 2.5]
        skeleton[11, :, k] = [0.6, 0.13, 2.0]
    skeleton[7, :, 2] = 0.0
    path = tmp_path / "Depth" / "a3_s1_t2_depth.mat"
    scipy.io.savemat(path, {"d_depth": depth}, do_compression=True)
    scipy.io.savemat(tmp_path / "Skeleton" / "a3_s1_t2_skeleton.mat", {"d_skel": skeleton}, do_compression=True)
    return path


def test_the_mirror_is_undone_in_image_and_skeleton(sequence):
    recording = open_recording(sequence)
    assert recording.name == "a3_s1_t2" and len(recording) == 3
    frames = list(recording)
    image = frames[1].measurements[0]
    assert image.image[100, 319 - 250] == 2001 and np.count_nonzero(image.image) == 1
    assert image.image.flags.c_contiguous and image.meters_per_unit == 0.001
    hand = recording.reference.positions[1, recording.reference.names.index("r_hand")]
    np.testing.assert_allclose(hand, [-0.6, -0.13, 2.0])
    u, v = image.camera.project([hand])[0]
    assert u < 160 and v < 120
    assert [frame.stamp for frame in frames] == pytest.approx([0, 1 / 30, 2 / 30])


def test_the_reference_is_no_truth_and_misses_what_was_not_tracked(sequence):
    recording = open_recording(sequence)
    reference = recording.reference
    assert not reference.exact and reference.positions.shape == (3, 19, 3)
    assert np.isnan(reference.positions[2, reference.names.index("l_hand")]).all()
    assert np.isfinite(reference.positions[:2]).all()
    assert "spine" not in reference.names and set(recording.start["joints"]) == set(reference.names) - {
        "l_toe",
        "r_toe",
    }
    assert "leads" in str(recording.info())


def test_without_a_skeleton_there_is_no_reference(sequence):
    next((sequence.parent.parent / "Skeleton").iterdir()).unlink()
    recording = open_recording(sequence)
    assert recording.reference is None and recording.start is None and len(list(recording)) == 3


@pytest.mark.parametrize("fraction", np.linspace(0.0, 0.99, 15).round(2))
@pytest.mark.parametrize("which", ["Depth", "Skeleton"])
def test_a_cut_file_is_refused(sequence, which, fraction):
    path = next((sequence.parent.parent / which).iterdir())
    data = path.read_bytes()
    path.write_bytes(data[: int(fraction * len(data))])
    with pytest.raises(RecordingError, match=path.name):
        open_recording(sequence)


@pytest.mark.parametrize("seed", range(40))
def test_a_changed_byte_is_refused_or_changes_nothing(sequence, seed):
    before = [frame.measurements[0].image.tobytes() for frame in open_recording(sequence)]
    data = bytearray(sequence.read_bytes())
    rng = np.random.default_rng(seed)
    data[int(rng.integers(len(data)))] ^= int(rng.integers(1, 256))
    sequence.write_bytes(data)
    try:
        after = [frame.measurements[0].image.tobytes() for frame in open_recording(sequence)]
    except RecordingError as error:
        assert sequence.name in str(error)
    else:
        assert after == before


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ({"depth": np.zeros((240, 320, 2), np.uint16)}, "variable d_depth, found depth"),
        ({"d_depth": np.zeros((240, 320, 2))}, "uint16.*found float64"),
        ({"d_depth": np.zeros((120, 320, 2), np.uint16)}, r"\(240, 320, N\)"),
    ],
)
def test_depth_of_another_form_is_refused(sequence, content, words):
    scipy.io.savemat(sequence, content)
    with pytest.raises(RecordingError, match=words):
        open_recording(sequence)


@pytest.mark.parametrize(
    ("skeleton", "words"),
    [
        (np.ones((20, 3, 2)), r"\(20, 3, 3\)"),
        (np.ones((25, 3, 3)), r"\(20, 3, 3\)"),
        (np.full((20, 3, 3), np.nan), "meters"),
        (np.full((20, 3, 3), 2000.0), "meters"),
    ],
)
def test_a_skeleton_of_another_form_is_refused(sequence, skeleton, words):
    scipy.io.savemat(sequence.parent.parent / "Skeleton" / "a3_s1_t2_skeleton.mat", {"d_skel": skeleton})
    with pytest.raises(RecordingError, match=words):
        open_recording(sequence)


@pytest.mark.parametrize("name", ["a1_s1_t1", "a2_s1_t1", "a9_s3_t2", "a13_s4_t1", "a22_s2_t3", "a27_s4_t4"])
def test_real_sequences_have_people_where_the_skeleton_reports(voodoo_data, name):
    """At the lag the data set has (skeleton two frames ahead), joints lie on the silhouette and just behind it."""
    recording = open_recording(voodoo_data / "utd-mhad" / "Depth" / f"{name}_depth.mat")
    frames = list(recording)
    assert len(frames) == len(recording) == len(recording.reference.stamps) and 40 < len(frames) < 130
    inner = [recording.reference.names.index(n) for n in ("head_center", "vc7", "l_hip", "r_hip", "l_knee", "r_knee")]
    behind, hits = [], 0
    for k in range(2, len(frames), 5):
        depth = frames[k].measurements[0]
        joints = recording.reference.positions[k - 2, inner]
        for (u, v), z in zip(np.round(depth.camera.project(joints)).astype(int), joints[:, 2], strict=True):
            value = depth.image[v, u] * depth.meters_per_unit
            hits += value > 0
            if value > 0:
                behind.append(z - value)
    total = len(inner) * len(range(2, len(frames), 5))
    assert hits > 0.9 * total
    assert np.mean(np.abs(behind) < 0.25) > 0.9


def test_the_right_arm_of_a_real_person_moves_on_the_images_left(voodoo_data):
    """Action 2 is a swipe with the right arm by somebody who faces the camera."""
    recording = open_recording(voodoo_data / "utd-mhad" / "Depth" / "a2_s1_t1_depth.mat")
    images = np.stack([frame.measurements[0].image for frame in recording])
    trunk = np.median(np.nonzero(images[0])[1])
    columns = np.nonzero((images > 0).any(axis=(0, 1)))[0]
    assert trunk - columns[0] > 60 > 40 > columns[-1] - trunk
    names, positions = recording.reference.names, recording.reference.positions
    path = {side: np.ptp(positions[:, names.index(f"{side}_wrist")], axis=0).max() for side in "lr"}
    assert path["r"] > 0.5 > 0.2 > path["l"]
