"""The words of each command. Nothing heavy is imported before a command is run."""
