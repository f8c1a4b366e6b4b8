"""Principal components of frames: pca."""
