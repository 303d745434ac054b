"""The command `slopewise`, and `python -m slopewise`."""

from __future__ import annotations


def main() -> None:
    """Run the command line."""
    try:
        from slopewise.services.cli.app import main as run
    except KeyboardInterrupt:  # while libraries load, for a second; as later, without a traceback
        raise SystemExit(130) from None
    run()


if __name__ == "__main__":
    main()
