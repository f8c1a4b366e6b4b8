"""Values -> files: motions and source files to clips, targets met, files complete or absent."""
