"""The fixed list of cases of `scripts/fingerprint`: every solver and every kind of input, as users reach them."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

SOLVERS = ("chain", "tree", "limbwise")
RENDERED = (
    "dev_01_bend_scoop_cmu",
    "dev_02_arms_cmu",
    "dev_03_punch",
    "dev_04_kick_ball_cmu",
    "dev_05_walk",
    "dev_06_cartwheel",
    "dev_07_sword_cmu",
    "dev_08_jump_l515_cmu",
)
UTD_SEQUENCES, UTD_ACTIONS, UTD_SUBJECTS = 40, 27, 4
BUNDLED = "python/voodoo/data/bend_scoop"
SCRIPT_FOLDERS = ("examples", "lab/experiments")
"""Where a checkout has the scripts of the cases; older ones have all of them in the first."""
LASER = "laser/general_tracking_moving_1.zip"
TRC = "pose2sim/S00_P00_T01_BalancingTrial_0-100_filt_butterworth.trc"


@dataclass(frozen=True)
class Case:
    """One thing to run in both builds.

    Args:
        name: what --only looks at.
        kind: "command" (the command line), "example" (a script of the checkout) or "public" (fingerprint_public.py).
        arguments: words of the command; {data}, {checkout}, {out} and {folder} stand for places.
        settings: the tracker's configuration, in {folder}/config.toml.
        frames: end after so many results.
        links: name in {folder}/data -> place in the data folder, for scripts that read whole folders.
        needs: places in the data folder without which the case is skipped.
    """

    name: str
    kind: str
    arguments: tuple[str, ...]
    settings: dict[str, object] = field(default_factory=dict)
    frames: int | None = None
    links: dict[str, str] = field(default_factory=dict)
    needs: tuple[str, ...] = ()


def utd_sequences() -> list[tuple[int, int]]:
    """Action and subject of forty sequences: the subjects in turn, every action once and half of them by another one again."""
    numbers = range(UTD_SEQUENCES)
    return [(number % UTD_ACTIONS + 1, (number + 2 * (number // UTD_ACTIONS)) % UTD_SUBJECTS + 1) for number in numbers]


def track(name: str, recording: str, solver: str, *words: str, frames: int | None = None) -> Case:
    """`voodoo track` of a recording below {data}, or of the bundled one."""
    bundled = recording == BUNDLED
    place = f"{{checkout}}/{recording}" if bundled else f"{{data}}/{recording}"
    arguments = ("voodoo", "track", place, "--config", "{folder}/config.toml", "--out", "{out}/track.npz", *words)
    return Case(name, "command", arguments, {"solver": solver}, frames, needs=() if bundled else (recording,))


def example(name: str, script: str, *words: str, needs: tuple[str, ...] = (), **options: object) -> Case:
    """A script in one of the SCRIPT_FOLDERS of the checkout."""
    return Case(name, "example", (script, *words), needs=needs, **options)  # type: ignore[arg-type]


def tracked() -> list[Case]:
    """Every solver on every kind of recording."""
    cases = []
    for solver in SOLVERS:
        cases.append(track(f"bundled/{solver}", BUNDLED, solver))
        cases.append(
            track(f"bundled-papers/{solver}", BUNDLED, solver, "--model", "papers", "--out", "{out}/track.csv")
        )
        for name in RENDERED:
            cases.append(track(f"rendered/{name}/all/{solver}", f"rendered/{name}", solver))
            cases.append(track(f"rendered/{name}/depth/{solver}", f"rendered/{name}", solver, "--use", "depth"))
        for action, subject in utd_sequences():
            name = f"a{action}_s{subject}_t1"
            cases.append(track(f"utd/{name}/{solver}", f"utd-mhad/Depth/{name}_depth.mat", solver))
        cases.append(track(f"pose2sim/{solver}", "pose2sim", solver))
        cases.append(track(f"markers/{solver}", TRC, solver))
        cases.append(track(f"joined/{solver}", "pose2sim", solver, "--with", f"{{data}}/{TRC}", frames=60))
        cases.append(
            track(f"depth-range/{solver}", f"rendered/{RENDERED[7]}", solver, "--depth-range", "0.5,4.0", frames=80)
        )
    return cases


def inverse() -> list[Case]:
    """Inverse kinematics: the command, the tables and the virtual plane."""
    cases = []
    for name in RENDERED[1], RENDERED[4]:
        recording = f"rendered/{name}"
        for way, words in (
            ("depth", ()),
            ("alone", ("--alone", "--pictures", "none")),
            ("color", ("--pictures", "color")),
        ):
            arguments = ("voodoo", "ik", f"{{data}}/{recording}", "--out", "{out}/ik.npz", *words)
            cases.append(Case(f"ik/{name}/{way}", "command", arguments, frames=60, needs=(recording,)))
    for place in (f"rendered/{RENDERED[2]}", "pose2sim"):
        cases.append(
            example(f"ik/tables/{place}", "ik_tables.py", "{folder}/data", "--out", "{out}",
                    links={place: place}, frames=1500, needs=(place,))
        )  # fmt: skip
    cases.append(example("ik/virtual", "ik_virtual.py", "--out", "{out}", frames=3000))
    cases.append(Case("ik/silhouettes", "public", ("rendered_silhouette",)))
    return cases


def virtual() -> list[Case]:
    """Sequences of our own body, still and disturbed."""
    inputs = {"depth": "depth", "points": "points", "landmarks": "positions,rays", "all": "depth,points,positions,rays"}
    cases = [
        Case(f"virtual/{model}/{name}/{solver}", "public", ("virtual", solver, model, "6.0", words, "1"))
        for solver in SOLVERS
        for model in ("full", "papers")
        for name, words in inputs.items()
    ]
    cases += [
        Case(f"virtual/threads/{solver}", "public", ("virtual", solver, "full", "6.0", "depth,rays", "3"))
        for solver in SOLVERS
    ]
    cases.append(example("perfect_model", "perfect_model.py", "--out", "{out}", "--frames", "40", "--seeds", "1"))
    cases.append(example("stress/virtual", "stress.py", "--out", "{out}", "--frames", "40", "--seeds", "1"))
    place = f"rendered/{RENDERED[0]}"
    words = ("--out", "{out}", "--frames", "5", "--seeds", "1", "--recordings", "{folder}/data/rendered")
    cases.append(example("stress/recorded", "stress.py", *words, links={place: place}, needs=(place,)))
    return cases


def experiments() -> list[Case]:
    """The other scripts: laser, several sensors, a covered camera, disturbed starts, a lamp."""
    laser = [
        Case(f"laser/{solver}", "example", ("fusion_laser.py", f"{{data}}/{LASER}", "--out", "{out}", "--config",
             "{folder}/config.toml"), {"solver": solver}, needs=(LASER,))
        for solver in SOLVERS
    ]  # fmt: skip
    first, fifth = f"rendered/{RENDERED[0]}", f"rendered/{RENDERED[4]}"
    utd = "utd-mhad/Depth/a6_s1_t1_depth.mat"
    return [
        *laser,
        example("lamp", "track_lamp.py"),
        example(
            "covered",
            "covered_camera.py",
            f"{{data}}/{first}",
            f"{{data}}/{fifth}",
            "--seconds",
            "1",
            needs=(first, fifth),
        ),
        example(
            "disturbed", "disturbed_starts.py", f"{{data}}/{fifth}", "--starts", "3", "--every", "2", needs=(fifth,)
        ),
        example(
            "backwards", "disturbed_starts.py", f"{{data}}/{first}", "--starts", "2", "--backwards", needs=(first,)
        ),
        example(
            "fusion", "fusion_experiment.py", f"{{data}}/{fifth}", "--starts", "1", "--out", "{out}", needs=(fifth,)
        ),
        example("fusion-utd", "fusion_utd.py", f"{{data}}/{utd}", "--out", "{out}", needs=(utd,)),
        example(
            "fusion-pose2sim",
            "fusion_pose2sim.py",
            "{data}/pose2sim",
            "--out",
            "{out}",
            needs=("pose2sim",),
            frames=320,
        ),
    ]


def all_cases() -> list[Case]:
    """The list, the same for every build."""
    return [*tracked(), *inverse(), *virtual(), *experiments()]


def missing(case: Case, data: Path) -> list[str]:
    """What of the data folder the case needs and does not find."""
    return [place for place in case.needs if not (data / place).exists()]
