"""Entry point of the command: Ctrl-C ends it in one line also while the commands are still being
imported."""

import sys


def main() -> None:
    """Run the command `strapdown`."""
    try:
        from .cli.app import main as commands

        commands()
    except KeyboardInterrupt:
        print("strapdown: interrupted", file=sys.stderr)
        raise SystemExit(130) from None


if __name__ == "__main__":
    main()
