"""A tracker in a forked process, and in two threads at once."""

import os
import signal
import threading

import pytest

import voodoo
from voodoo.errors import BodyError, VoodooError
from voodoo.recordings import open_recording, sample_path


@pytest.fixture(scope="module")
def frames():
    """The first frames of the bundled recording."""
    found = []
    for recorded in open_recording(sample_path(), use=("depth",)):
        (item,) = recorded.measurements
        frame = voodoo.Frame(stamp=recorded.stamp)
        frame.add_depth(
            item.image,
            camera=item.camera,
            meters_per_unit=item.meters_per_unit,
            world_from_sensor=item.root_from_sensor,
        )
        found.append(frame)
        if len(found) == 12:
            return found


def tracker_of(kind, threads):
    config = voodoo.Config(threads=threads)
    body = voodoo.Body.human(model="measured")
    return voodoo.Tracker(body, config=config) if kind == "one" else voodoo.People(body, config=config)


def bits(estimate):
    found = [estimate] if isinstance(estimate, voodoo.Estimate) else [person.estimate for person in estimate]
    return [one.joint_positions.tobytes() for one in found]


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork here")
@pytest.mark.filterwarnings("ignore:.*fork:DeprecationWarning")
@pytest.mark.parametrize("kind", ["one", "several"])
def test_a_forked_process_goes_on_with_the_same_bits(frames, kind):
    alone, forked = tracker_of(kind, 1), tracker_of(kind, 2)
    for frame in frames[:8]:
        alone.step(frame)
        forked.step(frame)
    expected = [bits(alone.step(frame)) for frame in frames[8:]]
    assert kind == "several" or alone.estimate.status == "tracking"
    reader, writer = os.pipe()
    child = os.fork()
    if not child:
        signal.alarm(30)
        same = [bits(forked.step(frame)) for frame in frames[8:]] == expected
        os.write(writer, b"same" if same else b"other")
        del forked
        os._exit(0)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0
    assert os.read(reader, 10) == b"same" and expected[-1]
    assert [bits(forked.step(frame)) for frame in frames[8:]] == expected


@pytest.mark.parametrize("kind", ["one", "several"])
def test_a_second_thread_on_a_tracker_gets_a_clear_error(frames, kind):
    tracker = tracker_of(kind, 1)
    errors, end = [], threading.Event()

    def look():
        while not end.is_set():
            try:
                _ = tracker.body if kind == "one" else tracker.step(voodoo.Frame(stamp=0.0))
            except Exception as error:
                errors.append(error)

    other = threading.Thread(target=look)
    other.start()
    for frame in frames:
        try:
            tracker.step(frame)
        except VoodooError as error:
            errors.append(error)
    end.set()
    other.join()
    found = [error for error in errors if "expected one thread at a time" in str(error)]
    assert found and all(isinstance(error, VoodooError) for error in errors)


def test_bodies_have_a_greatest_number_of_limbs():
    root, limb, *_ = voodoo.Body.human(model="papers").to_toml().split("[[limbs]]")[1:]
    name = limb.split('name = "', 1)[1].split('"', 1)[0]
    tables = [limb.replace(f'name = "{name}"', f'name = "x{number}"', 1) for number in range(1000)]
    with pytest.raises(BodyError, match="expected at most 1,000 limbs and 10,000 sites, found 1001 and 0"):
        voodoo.Body.from_toml("[[limbs]]".join(['name = "thing"\n', root, *tables]))
