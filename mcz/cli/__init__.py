"""The command line: one command a file; arguments in, ``mcz.reading.file`` out."""
