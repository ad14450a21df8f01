"""Help and version are there at once: what a command needs is imported when it runs."""

import resource
import subprocess
import sys

import pytest

import voodoo

HEAVY = ("numpy", "cv2", "scipy", "matplotlib", "rosbags", "pydantic", "tomlkit", "rerun", "rich")
EXTRA = ("scipy", "matplotlib", "motmetrics", "pandas", "rerun", "onnxruntime", "pyarrow", "distributed", "torch")
"""What no tracker needs: it comes with an extra."""
IMPORT_LIMIT_S = 0.15
TURNS = 8
"""Measurements at most, because other programs share the machine's caches."""
TYPERS_OWN = "pydantic"
"""Typer checks the options of a command with it, even for its help."""
OF_TYPER = 2.0
"""Help and version may take so many times as long as importing Typer, which every command does."""
COMMANDS = ("track", "live", "demo", "init", "ik", "eval", "info", "config", "body")
CALLS = [["--version"], ["--help"], *([command, "--help"] for command in COMMANDS)]


@pytest.mark.parametrize("words", CALLS, ids=" ".join)
def test_help_imports_nothing_heavy(words):
    code = (
        "import sys\nfrom voodoo.cli import main\n"
        f"sys.argv = ['voodoo', *{words!r}]\n"
        "try:\n    main()\nexcept SystemExit as end:\n    assert not end.code, end.code\n"
        f"print('HEAVY', [name for name in {HEAVY!r} if name in sys.modules])\n"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    *displayed, heavy = run.stdout.splitlines()
    own = [TYPERS_OWN] if len(words) > 1 and TYPERS_OWN in heavy else []
    assert heavy == f"HEAVY {own}"
    assert displayed[0].startswith("voodoo " if words == ["--version"] else "Usage: ")


CLI = "from voodoo.cli import main; main()"


def processor_seconds(code, words=()):
    """Processor time of a program: other programs on the machine do not count."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run([sys.executable, "-c", code, *words], capture_output=True, check=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def test_the_package_is_imported_at_once():
    assert any(processor_seconds("import voodoo") < IMPORT_LIMIT_S for _ in range(TURNS))


@pytest.mark.parametrize("words", [["--version"], ["--help"]], ids=" ".join)
def test_help_and_version_are_there_at_once(words):
    """In turns with what it is compared with, the best of each; more turns where the machine is busy."""
    turns = []
    for _ in range(TURNS):
        turns.append((processor_seconds("import typer"), processor_seconds(CLI, words)))
        typer, own = map(min, zip(*turns, strict=True))
        if len(turns) >= 3 and own < OF_TYPER * typer:
            return
    raise AssertionError(f"{own:.2f} s at best, {typer:.2f} s of it Typer")


def test_the_version_takes_less_than_a_tenth_of_a_second():
    version = "import runpy, sys; sys.argv[1:] = ['--version']; runpy.run_module('voodoo', run_name='__main__')"
    assert any(processor_seconds(version) < 0.1 for _ in range(TURNS))
    done = subprocess.run([sys.executable, "-m", "voodoo", "--version"], capture_output=True, text=True, check=True)
    assert done.stdout == f"voodoo {voodoo.__version__}\n"


def test_the_package_imports_nothing_heavy():
    code = f"import sys, voodoo\nprint([name for name in {(*HEAVY, 'typer')!r} if name in sys.modules])"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout == "[]\n"


def test_no_extra_is_needed_to_track():
    """Also of what the test environment holds: nothing is imported because it happens to be there."""
    code = (
        "import importlib, pkgutil, sys, voodoo\n"
        f"for name in {EXTRA!r}: sys.modules[name] = None\n"
        "for found in pkgutil.walk_packages(voodoo.__path__, 'voodoo.'):\n"
        "    importlib.import_module(found.name)\n"
        "print(len([name for name in sys.modules if name.startswith('voodoo.')]))\n"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert run.returncode == 0 and int(run.stdout) > 200, run.stderr


def test_attributes_of_the_package_are_imported_when_they_are_asked_for():
    code = (
        "import sys, voodoo\n"
        "assert 'numpy' not in sys.modules and 'voodoo.recordings.loaders' not in sys.modules\n"
        "print(voodoo.recordings.open_recording is voodoo.open_recording, voodoo.ik.Chain.__name__)\n"
        "try:\n    voodoo.nothing\nexcept AttributeError as error:\n    print(error)\n"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout == "True Chain\nmodule 'voodoo' has no attribute 'nothing'\n"
    assert set(voodoo.__all__) <= set(dir(voodoo))
