"""`python -m services.cli` is `slopewise`."""

from services.cli.app import main

main()
