"""`python -m slopewise.services.cli` is `slopewise`."""

from slopewise.services.cli.app import main

main()
