"""`python -m voodoo` is the command `voodoo`."""

import os
import sys


def main() -> None:
    """Entry point of the command; for its version nothing else is imported."""
    if sys.argv[1:] == ["--version"]:
        from voodoo._core import __version__

        try:
            print(f"voodoo {__version__}", flush=True)
        except BrokenPipeError:
            os._exit(141)  # as `voodoo.cli.terminal`, which takes long to import
        return
    from voodoo.cli import main as command

    command()


if __name__ == "__main__":
    main()
