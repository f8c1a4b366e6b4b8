"""Groups of frames, coded as they arrive: online."""
