"""`python -m voodoo` is the command `voodoo`."""

from voodoo.cli import main

if __name__ == "__main__":
    main()
