"""Live sources: latest wins, stamps decide, faults are named, and nothing old is published. Time is set by hand."""

import math
import threading
import time
from functools import partial
from unittest.mock import Mock

import numpy as np
import pytest

import voodoo
from live_rig import ByHand, Rig, arrival_of, wall
from voodoo.errors import RecordingError, VoodooError
from voodoo.live import FAULTS, Faults, SourceEnded, SourceGone
from voodoo.live.assembly import Assembler, HostTime, Stamps
from voodoo.live.latencies import Latencies
from voodoo.live.mailbox import Inbox, Mailbox
from voodoo.live.stream import Live
from voodoo.measurements import ColorImage, LaserScan


def scan(stamp):
    ranges = np.full(5, 2.0, dtype=np.float32)
    return LaserScan("laser", stamp, ranges, -0.2, 0.1, 0.1, 10.0, np.eye(4))


def color(stamp, decode=None):
    camera = wall(0.0).camera
    picture = np.zeros((24, 32, 3), dtype=np.uint8)
    return ColorImage("color", stamp, decode or (lambda: picture), camera, np.eye(4))


# Queues


def test_the_latest_wins_in_a_mailbox():
    box = Mailbox()
    for number in range(5):
        box.put(number)
    assert (box.dropped, box.take(0.0), box.take(0.0)) == (4, 4, None)
    box.put(5)
    box.close()
    box.put(6)
    assert not box.closed
    assert box.take() == 5
    assert box.closed


def test_a_mailbox_wakes_who_waits():
    box, got = Mailbox(), []
    thread = threading.Thread(target=lambda: got.append(box.take(5.0)))
    thread.start()
    box.put("item")
    thread.join(5.0)
    assert got == ["item"]


def test_an_inbox_keeps_the_newest_image_and_the_newest_four_of_others():
    inbox = Inbox()
    for number in range(9):
        inbox.put((arrival_of(scan(number), drives=False), 0.0))
        inbox.put((arrival_of(wall(float(number))), 0.0))
    items = [(arrival.sensor, arrival.stamp) for arrival, _ in inbox.take_all(0.0)]
    assert items == [("laser", 5), ("laser", 6), ("laser", 7), ("laser", 8), ("depth", 8)]
    assert inbox.dropped == 8


def test_percentiles_are_right_to_a_percent_whatever_the_count():
    values = np.random.default_rng(1).lognormal(-4.0, 1.0, 20_000)
    latencies = Latencies()
    for value in values:
        latencies.add(value)
    for fraction in (1, 50, 99, 100):
        assert latencies.percentile(fraction) == pytest.approx(
            np.percentile(values, fraction, method="higher"), rel=0.011
        )
    assert latencies.count == 20_000
    assert latencies.largest == values.max()
    assert math.isnan(Latencies().percentile(50))
    latencies.add(-1.0)  # a clock that is set does not end a program


# Stamps


def judged(stamps, *, every=1 / 30, start=100.0):
    judge = Stamps()
    return [judge.judge(stamp, start + number * every) for number, stamp in enumerate(stamps)]


def test_rising_stamps_are_used():
    assert all(v.usable and not v.fault and not v.breaks for v in judged([1.0, 1.03, 1.07]))


def test_repeated_and_late_stamps_are_left_out_and_nothing_else():
    verdicts = judged([1.0, 1.0, 1.03, 1.01, 1.07, 1.10])
    assert [v.fault for v in verdicts] == ["", "repeated stamp", "", "late", "", ""]
    assert [v.usable for v in verdicts] == [True, False, True, False, True, True]
    assert not any(v.breaks for v in verdicts)


@pytest.mark.parametrize(("to", "word"), [(-50.0, "time jumped back"), (50.0, "time jumped ahead")])
def test_time_that_jumps_goes_on_from_the_second_stamp(to, word):
    verdicts = judged([100.0, 100.03, 100.0 + to, 100.03 + to, 100.07 + to])
    assert [v.usable for v in verdicts] == [True, True, False, True, True]
    assert (verdicts[3].fault, verdicts[3].breaks, verdicts[4].fault) == (word, True, "")


def test_one_wild_stamp_is_no_jump():
    verdicts = judged([100.0, 100.03, 9000.0, 100.07, 0.5, 100.10])
    assert [v.usable for v in verdicts] == [True, True, False, True, False, True]
    assert not any(v.breaks for v in verdicts)


def test_a_gap_in_which_time_went_by_breaks_but_is_no_jump():
    judge = Stamps()
    judge.judge(1.0, 100.0)
    verdict = judge.judge(6.0, 105.0)
    assert verdict.usable
    assert verdict.breaks
    assert not verdict.fault


def test_stamps_of_another_clock_are_as_late_as_the_fastest():
    host = HostTime()
    assert host.of(5.000, 1000.02) == 1000.02
    assert host.of(5.100, 1000.11) == pytest.approx(1000.11)
    assert host.of(5.200, 1000.25) == pytest.approx(1000.21)
    assert not host.by_host
    assert host.of(1000.3, 1000.35) == 1000.3
    assert host.by_host


# Frames


def assembled(faults=None, **options):
    return Assembler(Faults() if faults is None else faults, **options)


def test_a_frame_holds_what_came_since_the_one_before():
    assembler = assembled()
    for item in (scan(0.96), scan(0.98), wall(1.0)):
        assembler.feed(arrival_of(item, drives=item.sensor == "depth"), 100.0)
    frame = assembler.poll(100.0)
    assert [item.sensor for item in frame.measurements] == ["laser", "laser", "depth"]
    assert (frame.stamp, frame.number, frame.breaks) == (1.0, 0, False)
    assembler.feed(arrival_of(wall(1.03)), 100.03)
    assert [item.sensor for item in assembler.poll(100.03).measurements] == ["depth"]


def test_a_frame_waits_for_the_picture_that_is_due_and_not_for_one_that_is_not():
    assembler = assembled()
    for number in range(3):
        at = number / 30
        assembler.feed(arrival_of(color(at), drives=False), at)
        assembler.feed(arrival_of(wall(at)), at)
        assert assembler.poll(at) is not None
    assembler.feed(arrival_of(wall(0.1)), 0.1)
    assert assembler.poll(0.101) is None
    assert 0.0 < assembler.due(0.101) < 0.010
    assembler.feed(arrival_of(color(0.1), drives=False), 0.102)
    assert [item.sensor for item in assembler.poll(0.102).measurements] == ["color", "depth"]
    assembler.feed(arrival_of(wall(0.133)), 0.133)
    assert assembler.poll(0.144) is not None, "it waits no longer than 10 ms"


def test_a_camera_at_half_the_rate_costs_no_waiting():
    assembler = assembled()
    for number in range(8):
        at = number / 30
        if number % 2 == 0:
            assembler.feed(arrival_of(color(at), drives=False), at)
        assembler.feed(arrival_of(wall(at)), at)
        frame = assembler.poll(at)
        assert number < 4 or frame is not None
        assembler.flush(at)


def test_what_is_older_than_half_a_second_joins_no_frame():
    assembler = assembled()
    assembler.feed(arrival_of(scan(1.0), drives=False), 1.0)
    assembler.feed(arrival_of(wall(2.0)), 2.0)
    assert [item.sensor for item in assembler.poll(2.0).measurements] == ["depth"]


def test_a_damaged_picture_is_the_only_loss():
    def broken():
        raise RecordingError("cut off")

    faults = Faults()
    assembler = assembled(faults)
    assembler.feed(arrival_of(color(1.0, broken), drives=False), 1.0)
    assembler.feed(arrival_of(wall(1.0)), 1.0)
    assert [item.sensor for item in assembler.poll(1.0).measurements] == ["depth"]
    assert faults.counts == {"damaged picture": 1}
    assert assembler.refused == 0


def test_transforms_that_are_due_are_waited_for():
    came = []
    assembler = assembled()
    assembler.feed(arrival_of(wall(1.0), ready=lambda: bool(came), patience=0.05), 1.0)
    assert assembler.poll(1.02) is None
    came.append(True)
    assert assembler.poll(1.021) is not None
    assembler.feed(arrival_of(wall(1.03), ready=lambda: False, patience=0.05), 1.03)
    assert assembler.poll(1.07) is None
    assert assembler.poll(1.081) is not None


# The stream


def test_status_is_lost_after_a_third_of_a_second_and_nothing_is_made_up():
    rig = Rig()
    assert rig.live.status == "waiting"
    for number in range(10):
        rig.deliver(arrival_of(wall(1.0 + number / 30)))
        rig.wait(1 / 30, tick=1 / 30)
    assert rig.live.status == "running"
    before = len(rig.frames)
    rig.wait(0.25)
    assert rig.live.status == "running"
    rig.wait(0.1)
    assert rig.live.status == "lost"
    assert rig.counts == {"stalled": 1}
    rig.wait(5.0)
    assert (len(rig.frames), rig.counts) == (before, {"stalled": 1})
    rig.deliver(arrival_of(wall(7.0)))
    assert rig.live.status == "running"
    assert rig.frames[-1].breaks
    assert any("stalled" in line for line in rig.messages)
    assert any("data again after 5.4 s" in line for line in rig.messages)


def test_a_slow_source_is_not_called_lost_between_its_images():
    rig = Rig()
    for number in range(6):
        rig.deliver(arrival_of(wall(1.0 + number * 0.5)))
        rig.wait(0.5)
    assert (rig.live.status, rig.counts) == ("running", {})


def test_a_stalled_source_that_repeats_its_frame_is_lost_too():
    rig = Rig()
    same = wall(1.0)
    for number in range(40):
        rig.deliver(arrival_of(same, stamp=1.0 + number / 30))
        rig.wait(1 / 30, tick=1 / 30)
    assert rig.live.status == "lost"
    assert rig.counts == {"frozen picture": 39, "stalled": 1}
    assert len(rig.frames) == 1
    assert rig.live.refused == 39


class Script(ByHand):
    """Reads what a test wrote down: arrivals, or errors."""

    def __init__(self, *script):
        self.script, self.opened = list(script), 0

    def open(self, clock, faults):
        self.opened += 1

    def read(self, timeout):
        if not self.script:
            raise SourceEnded("done")
        item = self.script.pop(0)
        if isinstance(item, BaseException):
            raise item
        return [item]


def test_an_unplugged_source_is_named_and_opened_again():
    messages = []
    source = Script(arrival_of(wall(1.0)), SourceGone("unplugged"), arrival_of(wall(1.5)))
    with voodoo.live.open(source, on_message=messages.append) as live:
        stamps = [frame.stamp for frame in live]
    assert stamps[-1] == 1.5
    assert source.opened == 2
    assert live.faults.counts["gone"] == 1
    assert [line for line in messages if "stalled" not in line and "again after" not in line] == [
        "gone: unplugged",
        "by hand: it is there again",
    ]
    assert live.status == "ended"


def test_a_source_that_breaks_ends_the_stream_with_its_error():
    with (
        voodoo.live.open(Script(arrival_of(wall(1.0)), ValueError("a bug"))) as live,
        pytest.raises(ValueError, match="bug"),
    ):
        list(live)


def test_overload_drops_and_never_queues():
    """Four images come while one is tracked: what is tracked next is the newest."""
    rig = Rig()
    for number in range(40):
        rig.live.deliver(arrival_of(wall(1.0 + number / 120)))
        rig.live.turn(0.0)
        rig.clock.at += 1 / 120
        if number % 4 == 3:
            frame = rig.live.next(0.0)
            assert frame.stamp == 1.0 + number / 120
            rig.frames.append(frame)
    assert len(rig.frames) == 10
    assert (rig.live.received, rig.live.dropped) == (40, 30)


def test_faults_are_reported_once_a_second_and_all_counted():
    messages = []
    faults = Faults(messages.append)
    for number in range(300):
        faults.add("late", f"number {number}", number / 100)
    assert faults.counts == {"late": 300}
    assert len(messages) == 3
    assert messages[1] == "late (100 times): number 100"
    assert faults.first == {"late": "number 0"}


def test_at_least_twenty_kinds_of_faults_have_a_name_and_a_meaning():
    assert len(FAULTS) >= 20
    assert all(FAULTS.values())


def test_a_clock_of_the_host_does_not_go_back(monkeypatch):
    from voodoo.live.clock import HostClock

    system, clock = time.time(), HostClock()
    times = [clock.now()]
    for back in range(5):  # somebody sets it back by an hour, again and again
        monkeypatch.setattr(time, "time", lambda back=back: system - 3600.0 * (1 + back))
        times.append(clock.now())
    assert times == sorted(times) and times[0] == pytest.approx(system, abs=5.0) and times[-1] - times[0] < 60.0


class Cameras(ByHand):
    """Images of walls, at a rate, for a third of a second."""

    def __init__(self, name, sensor, *, root="base_link", every=0.02, placed=True):
        self.name, self.sensor, self.root_frame, self.every, self.placed = name, sensor, root, every, placed
        self.number = 0

    def open(self, clock, faults):
        self.clock, self.begun = clock, clock.now()

    def read(self, timeout):
        self.number += 1
        time.sleep(max(self.begun + self.number * self.every - self.clock.now(), 0.0))
        if self.number > 0.35 / self.every:
            raise SourceEnded("done")
        return [arrival_of(wall(self.clock.now(), sensor=self.sensor))]


def test_the_first_of_several_sources_makes_the_frames():
    with voodoo.live.open(Cameras("one", "front"), Cameras("two", "back", every=0.007)) as live:
        frames = list(live)
    assert 3 <= len(frames) <= 18
    assert all(frame.measurements[-1].sensor == "front" for frame in frames)
    assert all(len([item for item in frame.measurements if item.sensor == "back"]) <= 1 for frame in frames)
    assert sum(len(frame.measurements) == 2 for frame in frames) >= 0.3 * len(frames)
    assert live.received <= 18


@pytest.mark.parametrize("name", ["_left", "_delivered"])
def test_sources_that_end_or_deliver_together_are_all_counted(name):
    class Slow(Live):
        """Every source reads the count before another one writes it."""

    def slowly(live):
        count = vars(live).get(name)
        time.sleep(0.05)
        return count

    setattr(Slow, name, property(slowly, lambda live, count: vars(live).update({name: count})))
    first, second = (Script(arrival_of(wall(1.0, sensor=sensor))) for sensor in ("front", "back"))
    second.name = "by another hand"
    with Slow([first, second]) as live:
        until = time.monotonic() + 2.0
        while live.status != "ended" and time.monotonic() < until:
            live.next(0.01)
        assert live.status == "ended" and live.received == 1


@pytest.mark.parametrize(
    ("second", "messages"),
    [
        (Cameras("one", "back"), "expected different ones"),
        (Cameras("two", "back", placed=False), "two: expected a calibration"),
        (Cameras("two", "back", root="camera"), "expected one root frame, found one in 'base_link', two in 'camera'"),
    ],
    ids=["same", "unplaced", "elsewhere"],
)
def test_sources_that_do_not_go_together_are_refused(second, messages):
    with pytest.raises(VoodooError, match=messages), voodoo.live.open(Cameras("one", "front"), second) as live:
        list(live)


def test_sources_must_be_there():
    with pytest.raises(VoodooError, match="at least one"):
        voodoo.live.open()


def test_sources_that_are_open_are_closed_where_another_one_is_gone_for_good(monkeypatch):
    first, second, closed = Cameras("one", "front"), Cameras("two", "back"), []
    second.stays = False
    monkeypatch.setattr(second, "open", Mock(side_effect=SourceGone("no such file")))
    for source in (first, second):
        monkeypatch.setattr(source, "close", partial(closed.append, source))
    with pytest.raises(SourceGone, match="no such file"), voodoo.live.open(first, second):
        pass
    assert closed == [first, second]


def test_a_loop_needs_the_with_block():
    with pytest.raises(VoodooError, match="`with` block"):
        next(iter(voodoo.live.open(Script())))
