"""Values -> files: motions and source files to clips, targets met, files whole or not there."""
