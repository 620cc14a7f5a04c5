"""The command line, one file for each group of commands."""


def main() -> None:
    """Entry point of the command `strapdown`."""
    from .app import main as run

    run()
