"""The decoder of each format. What some of them need is loaded only with them."""

from collections.abc import Sequence

from .input_formats import Clock, Decoder, Receiver
from .line_formats import CsvLines, JsonLines


def decoder(
    format: str,
    scale: str,
    clock: Clock,
    kinds: Sequence[str],
    name: str,
    columns: Sequence[str] = (),
) -> Decoder:
    """Return the Decoder of a format: json, csv, ubx, nmea or mavlink."""
    if format == "json":
        return JsonLines(clock, scale)
    if format == "csv":
        return CsvLines(clock, scale, columns)
    if format == "mavlink":
        from .mavlink_input import MavLink

        return MavLink(clock, kinds)
    if format == "ubx":
        from ...io.readers.ubx import ubx_log

        return Receiver(clock, ubx_log, kinds, name)
    from ...io.readers.nmea import log_of_bytes

    return Receiver(clock, log_of_bytes, kinds, name)
