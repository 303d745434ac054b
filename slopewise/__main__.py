"""The command `slopewise`, and `python -m slopewise`."""

from __future__ import annotations


def main() -> None:
    """Run the command line."""
    from slopewise.services.cli.app import main as run

    run()


if __name__ == "__main__":
    main()
