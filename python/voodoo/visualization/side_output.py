"""What is drawn or shown beside the poses: what fails there ends nothing else."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from typing import Any, TypeVar

Self = TypeVar("Self", bound="SideOutput")


class SideOutput:
    """An output of a `with` block that completes its files at the end, or removes them after a failure.

    Attributes:
        failure: why files are missing after the block; None if there are all. It holds the first error.
    """

    def __init__(self) -> None:
        """Nothing is begun yet; what is begun is put on the stack `_ends`."""
        self.failure: Exception | None = None
        self._ends = ExitStack()

    def attempt(self, call: Callable[..., None], *what: Any) -> None:  # noqa: ANN401 - of the function
        """Call a function, unless something has failed before; an error is kept as `failure`."""
        if self.failure is None:
            try:
                call(*what)
            except Exception as error:
                self.failure = error

    def __enter__(self: Self) -> Self:
        """Enter the block."""
        return self

    def __exit__(self, _: object, error: BaseException | None, __: object) -> None:
        """Complete the files; after an error or a failure, remove them."""
        problem = error or self.failure
        try:
            self._ends.__exit__(None if problem is None else type(problem), problem, None)
        except Exception as failure:
            if error is None:
                self.failure = failure  # which names the file
