"""The command `slopewise`, and `python -m slopewise`."""

from __future__ import annotations


def main() -> None:
    """Run the command line; a foreign package in the way was refused before this is reached."""
    from services.cli.app import main as run

    run()


if __name__ == "__main__":
    main()
