"""Files -> values: MCZ files opened lazily, clips decoded in part, source files read."""
