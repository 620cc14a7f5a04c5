"""Work on the disk beside the loop, which must not wait for it."""

from collections import deque
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any

from ...checks import DataError


class DiskJob:
    """Calls functions in a thread, one after the other; `tell_error` gets the errors."""

    def __init__(self, tell_error: Callable[[OSError | DataError], None]) -> None:
        self._tell_error, self._thread = tell_error, ThreadPoolExecutor(1)
        self._calls: deque[Future[Any]] = deque()

    def begin(self, function: Callable[..., Any], *arguments: object) -> None:
        """Call a function, after those before."""
        self._calls.append(self._thread.submit(function, *arguments))

    def is_free(self) -> bool:
        """Return True where no call runs or waits."""
        while self._calls and self._calls[0].done():
            self._end_first()
        return not self._calls

    def end(self) -> None:
        """Wait for all calls."""
        while self._calls:
            self._end_first()

    def _end_first(self) -> None:
        try:
            self._calls.popleft().result()
        except (OSError, DataError) as error:
            self._tell_error(error)
