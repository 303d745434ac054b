"""What each command does, imported when it is run; `slopewise.services.cli.arguments` reads its
words.
"""
