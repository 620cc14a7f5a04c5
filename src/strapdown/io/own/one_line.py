"""What any library raises of a damaged file, as one line."""

from collections.abc import Iterator
from contextlib import contextmanager

from ...checks import DataError
from ...checksum import DAMAGED
from ...typing import File


@contextmanager
def one_line(path: File, what: str) -> Iterator[None]:
    """Around what takes a file apart that should be `what`, as "NetCDF recording": every exception
    becomes a DataError of one line."""
    try:
        yield
    except DataError:
        raise
    except OSError as error:
        said = error.strerror if error.errno and error.strerror else _first_line(error)
        raise DataError(f"{path}: is not a whole {what} ({said}); {DAMAGED}") from error
    except Exception as error:
        said = f"{type(error).__name__}: {_first_line(error)}"
        raise DataError(f"{path}: is not a whole {what} ({said}); {DAMAGED}") from error


def _first_line(error: BaseException) -> str:
    said = str(error).strip().splitlines()
    text = said[0][:120] if said else type(error).__name__
    return "".join(each if each.isprintable() else "?" for each in text)
