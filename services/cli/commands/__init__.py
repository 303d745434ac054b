"""What each command does, imported when it is run; `services.cli.arguments` reads its words."""
