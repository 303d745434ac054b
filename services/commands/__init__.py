"""What each command does, imported when it is run; `services.command_line` reads its words."""
