"""The command line: commands of one kind a file, arguments in, public names called.

``main`` has the table of commands, which are imported when they run. ``options`` has the options
that commands share, ``common`` the exit codes, ``hints`` the words of hints.

Imports every folder.
"""
