"""What voodoo track says at its end."""

from collections import Counter

from commands import run
from voodoo.cli.track import closing_remarks, nobody_words
from voodoo.recordings import sample_path


def test_the_end_tells_stature_speed_root_frame_and_shares(tmp_path):
    done = run("track", sample_path(), "--out", tmp_path / "o.csv")
    first, second, third = done.stdout.splitlines()
    assert "90 frames" in first and done.stderr == ""
    assert second.startswith("stature 1.7") and "frames a second; root frame base_link" in second
    shares, _, rest = third.partition(" (")
    by_status = {status: int(share) for share, _, status in (part.split(" ") for part in shares.split(", "))}
    assert by_status["tracking"] > 90 and sum(by_status.values()) in (99, 100, 101)
    assert rest == "docs/how-to/read-the-status.md says what that means)"
    told = run("track", sample_path(), "--height", "1.3", "--out", tmp_path / "o.csv")
    assert "1.30 m was told" in told.stderr


def test_unlikely_results_are_doubted():
    good = Counter(tracking=9, lost=1)
    assert closing_remarks(good, stature=1.7, height_m=1.76) == closing_remarks(good, stature=None, height_m=None) == []
    assert (
        len(closing_remarks(good, stature=0.7, height_m=None))
        == len(closing_remarks(good, stature=2.3, height_m=None))
        == 1
    )
    assert closing_remarks(good, stature=0.7, height_m=0.7) == [], "a small child was announced"
    assert "50 % of the frames" in closing_remarks(Counter(tracking=5, lost=5), stature=1.7, height_m=None)[0]
    assert closing_remarks(Counter(tracking=6, lost=4), stature=1.7, height_m=None) == []


def test_where_nobody_is_found_the_last_line_says_what_was_seen_and_what_to_do():
    told = {"stature": None, "doubted": False, "drawn": False}
    assert nobody_words(9, **told) == "nobody was found in 9 frames; --overlay look.mp4 shows what the cameras see"
    assert nobody_words(9, **told | {"drawn": True}) == "nobody was found in 9 frames"
    assert "what is doubted above" in nobody_words(9, **told | {"doubted": True})
    assert "depth shows somebody 0.83 m tall: are the unit of depth" in nobody_words(9, **told | {"stature": 0.834})
