"""Transforms of ROS bags: where a sensor is at a time."""

import numpy as np
import pytest

from ros_bags import IDENTITY, INFO, TF, M, bag, depth_entry, only
from voodoo.errors import RecordingError
from voodoo.recordings import open_recording
from voodoo.recordings.left_out import LeftOut


class TestTransforms:
    @staticmethod
    def entries(*moves):
        """The sensor at x = value from each stamp on, on /tf."""
        return [("/tf", stamp, M.tf((stamp, "base_link", "cam", (x, 0, 0), IDENTITY))) for stamp, x in moves]

    def x_of(self, path, **options):
        return [m.root_from_sensor[0, 3] for m in only(open_recording(path, **options))]

    def test_one_that_changes_is_interpolated_whenever_it_arrived(self, tmp_path):
        moves = self.entries((9.9, 1.0), (10.1, 2.0), (10.3, 3.0))
        depth = [depth_entry(stamp) for stamp in (9.9, 10.0, 10.1, 10.25, 10.4)]
        np.testing.assert_allclose(self.x_of(bag(tmp_path, INFO, *depth, *moves)), [1.0, 1.5, 2.0, 2.75, 3.0])

    def test_it_turns_evenly_between_two_stamps(self, tmp_path):
        turns = [(10.0, 0.0), (10.2, 0.8)]
        tf = [
            ("/tf", stamp, M.tf((stamp, "base_link", "cam", (0, 0, 1), (0, 0, np.sin(a / 2), np.cos(a / 2)))))
            for stamp, a in turns
        ]
        (image,) = only(open_recording(bag(tmp_path, INFO, depth_entry(10.05), *tf)))
        c, s = np.cos(0.2), np.sin(0.2)
        np.testing.assert_allclose(image.root_from_sensor[:3, :3], [[c, -s, 0], [s, c, 0], [0, 0, 1]], atol=1e-9)

    def test_across_a_gap_the_latest_one_counts(self, tmp_path):
        moves = self.entries((10.0, 1.0), (12.0, 2.0))
        assert self.x_of(bag(tmp_path, INFO, depth_entry(10.4), *moves)) == [1.0]
        with pytest.raises(RecordingError, match="before it"):
            self.x_of(bag(tmp_path / "late", INFO, depth_entry(11.8), *moves))

    @pytest.mark.parametrize(
        ("frame", "far", "root"), [("odom", 0.3, "odom"), ("map", 0.3, "map"), ("odom", 0.01, "base_link")]
    )
    def test_where_the_robot_moves_the_frame_it_moves_in_is_the_root(self, tmp_path, frame, far, root):
        fixed = ("/tf_static", 9.0, M.tf((0, "base_link", "cam", (0, 0, 1), IDENTITY)))
        moves = [("/tf", 10.0 + k, M.tf((10.0 + k, frame, "base_link", (k * far, 0, 0), IDENTITY))) for k in range(2)]
        path = bag(tmp_path, INFO, fixed, depth_entry(10.0), depth_entry(10.5), depth_entry(11.0), *moves)
        recording = open_recording(path)
        assert recording.root_frame == root
        expected = [0.0, far / 2, far] if root == frame else [0.0] * 3
        np.testing.assert_allclose([m.root_from_sensor[0, 3] for m in only(recording)], expected, atol=1e-12)
        assert open_recording(path, root_frame="base_link").root_frame == "base_link"

    def test_one_that_never_changes_holds_always(self, tmp_path):
        moves = self.entries((50.0, 1.0), (51.0, 1.0))
        assert self.x_of(bag(tmp_path, INFO, depth_entry(10.0), *moves)) == [1.0]

    def test_a_damaged_one_costs_no_others_of_its_message(self, tmp_path):
        rows = [(0, "base_link", frame, (1, 0, 0), turn) for frame, turn in (("arm", (0, 0, 0, 0)), ("cam", IDENTITY))]
        path = bag(tmp_path, INFO, ("/tf_static", 9.0, M.tf(*rows)), depth_entry(10.0))
        left_out = LeftOut()
        assert self.x_of(path, left_out=left_out) == [1.0]
        assert left_out.counts == {"transforms that cannot be read": 1}
        with pytest.raises(RecordingError, match="'base_link' from 'arm': expected a finite translation and a unit"):
            open_recording(path)

    def test_standing_still_before_moving_is_not_taken_for_silence(self, tmp_path):
        moves = self.entries(*((10.0 + k / 10, 1.0) for k in range(20)), (12.0, 2.0))
        assert self.x_of(bag(tmp_path, INFO, depth_entry(11.55), *moves)) == [1.0]

    @pytest.mark.parametrize(("stamp", "words"), [(9.0, "after it"), (11.0, "before it")])
    def test_a_changing_one_may_not_be_far_away(self, tmp_path, stamp, words):
        path = bag(tmp_path, INFO, depth_entry(stamp), *self.entries((10.0, 1.0), (10.1, 2.0)))
        with pytest.raises(RecordingError, match=words + r".*tf_max_age"):
            list(open_recording(path))
        assert len(self.x_of(path, tf_max_age=2.0)) == 1

    def test_chains_are_walked_in_both_directions(self, tmp_path):
        turn = (0, 0, np.sqrt(0.5), np.sqrt(0.5))  # a quarter turn about z
        tf = M.tf((0, "mast", "base_link", (0, 0, -1), IDENTITY), (0, "mast", "cam", (1, 0, 0), turn))
        (image,) = only(open_recording(bag(tmp_path, ("/tf_static", 9.0, tf), INFO, depth_entry())))
        expected = [[0, -1, 0, 1], [1, 0, 0, 0], [0, 0, 1, 1], [0, 0, 0, 1]]
        np.testing.assert_allclose(image.root_from_sensor, expected, atol=1e-12)

    def test_a_missing_one_is_named_with_the_frames_there_are(self, tmp_path):
        tf = M.tf((0, "base_link", "arm", (0, 0, 0), IDENTITY))
        with pytest.raises(RecordingError, match=r"'base_link' from 'cam'.*arm, base_link"):
            open_recording(bag(tmp_path, ("/tf_static", 9.0, tf), INFO, depth_entry()))

    def test_an_unknown_root_frame_is_refused(self, tmp_path):
        with pytest.raises(RecordingError, match=r"'moon' from 'cam'"):
            open_recording(bag(tmp_path, TF, INFO, depth_entry()), root_frame="moon")

    @pytest.mark.parametrize("q", [(0, 0, 0, 0), (0, 0, 0, 2), (np.nan, 0, 0, 1)])
    def test_a_rotation_that_is_none_is_refused(self, tmp_path, q):
        tf = M.tf((0, "base_link", "cam", (0, 0, 0), q))
        with pytest.raises(RecordingError, match="unit quaternion"):
            open_recording(bag(tmp_path, ("/tf_static", 9.0, tf), INFO, depth_entry()))
