"""Joints renamed, chosen, mirrored; a motion on another skeleton; joints of the usual skeletons."""
