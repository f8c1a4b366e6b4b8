"""The command line: one command a file, arguments in, public names called.

``main`` has the table of commands, which are imported when they run. ``options`` has the options
that commands share, ``errors`` the exit codes and the words of hints.

Imports every room.
"""
