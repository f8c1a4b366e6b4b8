"""Groups of frames, coded as they come: online."""
