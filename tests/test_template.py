"""Messages of live poses that are encoded once, and arrays of poses by the core."""

import struct

import numpy as np
import pytest

import voodoo
import voodoo._core as _core
from voodoo.errors import MeasurementError
from voodoo.export.template import STAMP_NS, template


def encoded(numbers):
    """Two messages: the second number before the first, at odd places."""
    first, second, third = (struct.pack("<d", number) for number in numbers)
    return [b"x" + second + struct.pack("<q", STAMP_NS) + first, b"yy" + third]


def test_numbers_and_stamps_are_replaced_wherever_they_are():
    made = template(encoded, 3, stamp=struct.pack("<q", STAMP_NS))
    numbers = [np.array([1.5]), np.array([[-2.0, np.inf]])]
    assert made.filled(numbers, struct.pack("<q", 77)) == [
        b"x" + struct.pack("<dqd", -2.0, 77, 1.5),
        b"yy" + struct.pack("<d", np.inf),
    ]
    table = np.arange(3.0).reshape(3, 1).T  # by columns
    assert made.filled([table], b"") == made.filled([np.arange(3.0)], b"")
    with pytest.raises(MeasurementError, match="expected 3, found 2"):
        made.filled([np.zeros(2)], b"")
    with pytest.raises(MeasurementError, match="numbers: expected some in the messages"):
        template(lambda numbers: [b"nothing"], 1)
    short = template(lambda numbers: [struct.pack(">ff", *numbers)], 2, single=True)
    assert short.filled([np.array([0.25, 3.0])], b"") == [struct.pack(">ff", 0.25, 3.0)]


def test_numbers_may_be_in_messages_twice_or_not_at_all():
    made = template(lambda numbers: [struct.pack("<dd", numbers[2], numbers[2])], 3)
    assert made.filled([np.array([1.0, 2.0, -3.5])], b"") == [struct.pack("<dd", -3.5, -3.5)]


def test_a_text_gets_whole_numbers_and_words():
    numbers = [np.array([1.4e-5, -2.6e-5]), np.array([[3e-6], [0.0], [1.234567]])]
    assert _core.people_text(b"a \0, \1\0e-5 \2 \2!\2", numbers, 2.5, []) == b"a 1, 2.5-3e-5 3 0!1234567"
    nobody = _core._estimate({"stamp": 0.0}, (), (), (), ())
    assert _core.people_text(b"\1 \1 \1", [], 1.0, [nobody]) == b"1.0 searching null"
    for text, given in ((b"\0", []), (b"\1\1", []), (b"\1", numbers), (b"", [])):
        with pytest.raises(MeasurementError, match="places for all numbers and words"):
            _core.people_text(text, given, 1.0, [])


def test_plans_and_arrays_that_do_not_fit_are_refused():
    body = voodoo.Body.human()
    poses, joints = np.tile(np.eye(4), (2, len(body.limbs), 1, 1)), np.zeros((2, 5, 3))
    own = np.array([[1, 4]])
    turns, heads = _core.skeleton(body.core, poses, joints, own)
    assert turns.shape == (2, len(body.limbs), 3, 3) and (heads[:, 1] == 0.0).all()
    for wrong in (np.array([[1, 5]]), np.array([[len(body.limbs), 0]]), np.array([[-1, 0]])):
        with pytest.raises(MeasurementError, match="plan"):
            _core.skeleton(body.core, poses, joints, wrong)
    with pytest.raises(MeasurementError, match="contiguous frames of rows of 16 numbers"):
        _core.skeleton(body.core, poses.swapaxes(2, 3), joints, own)
    with pytest.raises(MeasurementError, match="plan: expected 2 columns, found 4"):
        _core.skeleton(body.core, poses, joints, np.zeros((1, 4), dtype=np.int64))
    frame, angle, arms = np.array([[0, 1, 0, -1]]), np.array([[0, 1, 2, 1, 0, 0, 1, 0]]), np.eye(3)[None, None]
    given = body.core, poses, joints, np.zeros((2, 6, 6))
    assert _core.Layout(own, frame, angle, arms, frame).rows_of_frames(*given).shape[0] == 2
    for frames, angles in ((frame, np.array([[0, 1, 2, 2, 0, 0, 1, 0]])), (np.array([[0, 99, 0, -1]]), angle)):
        with pytest.raises(MeasurementError, match="plan"):  # no Euler angles, and no such point
            _core.Layout(own, frames, angles, arms, frame).rows_of_frames(*given)
    with pytest.raises(MeasurementError, match="plan"):
        _core.Layout(own, frame, angle, arms, frame).rows_of_frames(*given[:3], np.zeros((2, 5, 6)))
