"""The command line: one command a file; arguments in, ``mcz.file`` out."""
