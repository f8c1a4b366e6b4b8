"""The command line: one command a file; arguments in, ``mcz.files.file`` out."""
