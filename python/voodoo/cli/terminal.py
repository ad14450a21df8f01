"""Standard output and errors: names and texts in files of others may hold commands for a terminal, and readers may leave."""

from __future__ import annotations

import os
import re
from collections.abc import Callable
from typing import Any

READER_LEFT = 141
"""Exit code after the reader of the output ended: 128 + SIGPIPE."""
_COMMANDS = r"[^\n\t\x20-\x7e\xa0-\u2027\u202f-\u2065\u206a-\U0010ffff]"
"""Control characters, and those that reverse the direction of text or end a line."""


def escaped(text: str) -> str:
    """The text with commands for a terminal written as in a Python string, e.g. \\x1b."""
    if text.replace("\n", "").replace("\t", "").isprintable():
        return text  # and the pattern, which takes long to compile, is not needed
    return re.sub(_COMMANDS, lambda found: found[0].encode("unicode_escape").decode("ascii"), text)


class Escaped:
    """A text stream that escapes everything that is written to it, and ends the program quietly when its reader has left.

    Args:
        stream: where to.
    """

    def __init__(self, stream: Any) -> None:  # noqa: ANN401 - any object like a text file
        """Write nothing yet."""
        self.stream: Any = stream.stream if isinstance(stream, Escaped) else stream

    def write(self, text: str) -> int:
        """Write a text."""
        return int(self._read(self.stream.write, escaped(text)))

    def flush(self) -> None:
        """Write what is buffered."""
        self._read(self.stream.flush)

    def _read(self, call: Callable[..., Any], *words: str) -> Any:  # noqa: ANN401
        try:
            return call(*words)
        except BrokenPipeError:
            # What is left in the buffer would fail again at the end.
            os.dup2(os.open(os.devnull, os.O_WRONLY), self.stream.fileno())
            raise SystemExit(READER_LEFT) from None

    def __getattr__(self, name: str) -> Any:  # noqa: ANN401
        """Everything else is the stream's."""
        return getattr(self.stream, name)
