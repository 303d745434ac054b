"""What each command does; `services.cli` only reads its words. Imported when a command is run."""
