"""The page that shows motions: a server for it, files of it to mail, small players in notebooks.

The page itself is the project ``tools/viewer``; a wheel contains it here as ``viewer.html``.
"""
