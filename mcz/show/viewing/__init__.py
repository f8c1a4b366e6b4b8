"""The page that shows motions: a server for it, files of it to mail, small players in notebooks.

The page itself is the project ``tools/viewer``; a wheel carries it as ``viewer.html`` beside this.
"""
