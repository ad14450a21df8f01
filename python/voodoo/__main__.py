"""`python -m voodoo` is the command `voodoo`."""

import sys


def main() -> None:
    """Entry point of the command; for its version nothing else is imported."""
    if sys.argv[1:] == ["--version"]:
        from voodoo._core import __version__

        sys.stdout.write(f"voodoo {__version__}\n")
        return
    from voodoo.cli import main as command

    command()


if __name__ == "__main__":
    main()
