"""What generators share: files, motions, source files and streams to order."""
