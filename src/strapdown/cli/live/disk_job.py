"""Work on the disk beside the loop, which must not wait for it."""

from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any

from ...checks import DataError


class DiskJob:
    """Calls functions in a thread, one at a time; `tell_error` gets the errors."""

    def __init__(self, tell_error: Callable[[OSError | DataError], None]) -> None:
        self._tell_error, self._thread = tell_error, ThreadPoolExecutor(1)
        self._call: Future[Any] | None = None

    def begin(self, function: Callable[..., Any], *arguments: object) -> None:
        """Call a function, after the one before."""
        self.end()
        self._call = self._thread.submit(function, *arguments)

    def is_free(self) -> bool:
        """Return True where no call runs."""
        if self._call is not None and self._call.done():
            self.end()
        return self._call is None

    def end(self) -> None:
        """Wait for the call that runs."""
        call, self._call = self._call, None
        if call is not None:
            try:
                call.result()
            except (OSError, DataError) as error:
                self._tell_error(error)
