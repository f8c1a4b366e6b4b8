"""Tables of docs/evidence and of README, measured and written by one command.

A part is a module with ``tables(data, jobs)``, which yields the name and the lines of each table.
``__main__`` puts them behind their marks in the documents.
"""
